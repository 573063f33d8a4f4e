"""Program track that an operator sends to the control unit (ACU) before a pass: a table of times, azimuths and
elevations, predicted for the target of a scenario."""
import dataclasses
import datetime
import functools
import math

import numpy as np

from pedestal_bringup.scenario.scenario import Scenario
from pedestal_bringup.scenario.sections import AnyParameters
from pedestal_common.geometry import orbit
from pedestal_common.geometry.geodesy import SPEED_OF_LIGHT_M_S
from pedestal_common.quantities import Message, Meters, Nanoseconds, Pairs, Radians, Seconds, Times
from pedestal_common.wire import messages
from ship_motion_sim import motion
from tracking_receiver_sim import target, wave_path
from tracking_receiver_sim.params import TargetParameters

MIN_STATED_S = 2.0  # shortest part of a run without a target to be tracked that is announced [s]


@dataclasses.dataclass(frozen=True)
class Plan:
    """Scenario together with its targets and its program tracks, which are built once, at their first use."""
    scenario: Scenario
    own_table: tuple[Times, Pairs] | None = None    # (times, angles) that the operator sends instead of the predicted

    @functools.cached_property
    def targets(self) -> dict[str, target.Target]:
        """{prefix of the beam ('' for a single beam): the target that the simulation moves}."""
        return {prefix: self._built(prefix, self._parameters(prefix)) for prefix in self.scenario.prefixes}

    def _parameters(self, prefix: str) -> TargetParameters:
        return self.scenario.node_parameters(prefix + 'tracking_receiver').target

    def _built(self, prefix: str, parameters: TargetParameters) -> target.Target:
        return target.build(parameters, self.scenario.header.duration, self._mask(prefix))

    def _mask(self, prefix: str) -> Radians:
        return self.scenario.node_parameters(prefix + 'tracking_receiver').receiver.horizon_mask

    def _nominal_target(self, prefix: str) -> target.Target:
        """Return the target of a beam as the operator predicts it: with the time UT1 of the earth's rotation equal to
        UTC."""
        true = self._parameters(prefix)
        nominal = dataclasses.replace(true, leo_pass=dataclasses.replace(true.leo_pass, ut1_offset=0.0))
        return self.targets[prefix] if nominal == true else self._built(prefix, nominal)

    @functools.cached_property
    def tables(self) -> dict[str, tuple[Times, Pairs]]:
        """Predicted tables {prefix of the beam: (times, angles)}. The times go from stamp 0 to two intervals after the
        run, so that the end of the run is inside. They are equal to the last bit to those that the ACU reads from the
        message. The angles are earth azimuth (unwrapped) and elevation.

        The prediction omits UT1 - UTC of the true target. It includes the travel time of the wave and refraction only
        if the header sets `program.light_time` and `program.refractivity`. Before or after its known path the target
        stays at the first or last known place.
        """
        program, duration = self.scenario.header.program, self.scenario.header.duration
        nanoseconds = np.round(np.arange(0.0, duration + 2.0 * program.interval, program.interval) * 1e9)
        times = nanoseconds // 1e9 + nanoseconds % 1e9 * 1e-9
        tables = {}
        for prefix in self.scenario.prefixes:
            built = self._nominal_target(prefix)
            known = np.clip(times - program.time_offset, built.breaks[0], built.breaks[-1])
            azimuth, elevation, distance = target.look_angles(built, known)
            if program.light_time:
                left = np.maximum(known - distance / SPEED_OF_LIGHT_M_S, built.breaks[0])
                azimuth, elevation, _ = target.look_angles(built, left)
            if program.refractivity > 0.0:
                elevation = elevation + [wave_path.refraction(program.refractivity, E)[0] for E in elevation]
            tables[prefix] = times, np.column_stack((np.unwrap(azimuth) + program.azimuth_offset,
                                                     elevation + program.elevation_offset))
        return tables

    @functools.cached_property
    def tracks(self) -> dict[str, Message]:
        """{topic: JointTrajectory} of the program track for every beam; {} without a program track."""
        if self.scenario.header.program.source == 'none':
            return {}
        tables = dict.fromkeys(self.scenario.prefixes, self.own_table) if self.own_table else self.tables
        return {f'{prefix}acu/program_track': program_message(*table) for prefix, table in tables.items()}

    @functools.cached_property
    def ship_summary(self) -> tuple[str, ...]:
        """Lines on the file of a recorded ship motion (motion.summary); () without such a file or without a ship."""
        if 'ship_motion' not in self.scenario.nodes:
            return ()
        return motion.summary(self.scenario.node_parameters('ship_motion').ship, self.scenario.header.duration)

    def announced(self) -> list[str]:
        """Return the lines that a user reads before the run. They state the position of the antenna, the notes of the
        scenario, the file of the ship motion, and the targets (a recorded flight, when it is highest, rises and sets).
        Equal lines of several beams appear once. Raises csv_table.TableError for a file that cannot be used."""
        stations = [self.scenario.node_parameters(f'{prefix}acu').prediction.station
                    for prefix in self.scenario.prefixes]
        lines = [*(f'antenna at {station.text}' for station in stations), *self.scenario.notes, *self.ship_summary]
        # The target of a receiver of the user is its own, unless the scenario predicts it.
        unseen = 'tracking_receiver' in self.scenario.own and self.scenario.header.program.source == 'none'
        for prefix, built in ({} if unseen else self.targets).items():
            lines += [*built.summary, *_sky(built, self._parameters(prefix).kind, self.scenario.header.duration,
                                            self._mask(prefix)),
                      *_link(built, self.scenario.node_parameters(f'{prefix}tracking_receiver'),
                             self.scenario.header.duration)]
        wind = getattr(self.scenario.node_parameters('adu'), 'wind', None)
        if wind and wind.field.speed > 0.0:
            lines.append(f'wind: {wind.field.speed:g} m/s on a dish of {wind.field.diameter:g} m')
        return list(dict.fromkeys(lines))

    def begins(self) -> Nanoseconds:
        """Return the UTC of time 0 of the run, by the date of the first beam's target. Raises ValueError for a target
        without a date."""
        start_time = self.targets[self.scenario.prefixes[0]].start_time
        if not start_time:
            raise ValueError(f'--start file: the target of {self.scenario.name} has no date; give a UTC instead')
        begin = orbit.instant('start', start_time).replace(tzinfo=datetime.timezone.utc)
        return round(begin.timestamp() * 1e3) * 1_000_000


def _sky(built: target.Target, kind: str, duration: Seconds, mask: Radians) -> tuple[str, ...]:
    """Return lines on a target: its rise and its set or end if they take more than MIN_STATED_S from the run, and its
    highest place if it has a date and no summary. (The summary of a recorded flight already states the highest place.)
    mask: elevation of rise and set."""
    name = 'satellite' if kind == 'leo_pass' else 'target'
    times = np.linspace(0.0, duration, 1 + int(min(1e5, 10.0 * duration)))
    elevation = np.degrees(target.look_angles(built, times)[1])
    known, up = np.flatnonzero(np.isfinite(elevation)), np.flatnonzero(elevation > np.degrees(mask))
    above, below = (f'{word} the horizon mask of {np.degrees(mask):.3g} deg' if mask else ''
                    for word in (' above', ' below'))
    if not up.size:
        return (f'the {name} never rises{above}, highest {np.nanmax(elevation):.1f} deg: nothing can be tracked',
                ) if known.size else ()
    begin = orbit.instant('start', built.start_time) if built.start_time else None

    def when(row: int) -> str:
        at = f', at {begin + datetime.timedelta(seconds=float(times[row])):%H:%M:%S} UTC' if begin else ''
        return f'after {times[row]:.1f} s{at}'
    top = int(np.nanargmax(elevation))
    highest = (f'0 s is {begin:%Y-%m-%d %H:%M:%S} UTC; the {name} is highest in this run, {elevation[top]:.1f} deg, '
               f'{when(top)}',) if begin and not built.summary else ()
    late, left = times[up[0]] - times[known[0]], times[known[-1]] - times[up[-1]]
    rises = (f'the {name} rises{above} {when(up[0])}: nothing can be tracked before',) if late > MIN_STATED_S else ()
    sets = (f'the {name} sets{below} {when(up[-1])}: nothing can be tracked after',
            ) if left > MIN_STATED_S else ()
    ends = (f'the track of the {name} ends {when(known[-1])}: nothing can be tracked after',
            ) if not sets and known[-1] < times.size - 1 else ()
    return (*highest, *rises, *sets, *ends)


def _link(built: target.Target, parameters: AnyParameters, duration: Seconds) -> tuple[str, ...]:
    """Return a line on the C/N0 over the ranges of a run; () for a C/N0 that does not depend on the range."""
    receiver: AnyParameters = getattr(parameters, 'receiver', None)
    if parameters.target.of_noise or not getattr(receiver, 'range_exponent', 0.0):
        return ()
    _, elevation, distance = target.look_angles(built, np.linspace(0.0, duration, 1 + int(min(1e4, duration))))
    seen = distance[elevation > receiver.horizon_mask]
    if not seen.size:
        return ()
    near, far = float(seen.min()), float(seen.max())
    best, worst = (receiver.cn0_dbhz - 10.0 * receiver.range_exponent * math.log10(distance / receiver.reference_range)
                   for distance in (near, far))
    levels, ranges = ((one, other) if one != other else (one,) for one, other in (
        (f'{best:.1f}', f'{worst:.1f}'), (_km(near), _km(far))))
    text = (f'link: C/N0 {receiver.cn0_dbhz:.4g} dB-Hz at {1e-3 * receiver.reference_range:g} km; in this run '
            f'{" to ".join(levels)} dB-Hz at {" to ".join(ranges)} km; lock at {receiver.acquire_level_dbhz:g} dB-Hz')
    if best < receiver.acquire_level_dbhz:
        text += (': the receiver cannot lock; state the target by scenario.link.eirp, or by '
                 'tracking_receiver.receiver.cn0_dbhz at reference_range')
    return (text,)


def _km(distance: Meters) -> str:
    return f'{1e-3 * distance:.0f}' if distance >= 100e3 else f'{1e-3 * distance:.3g}'


def program_message(times: Times, angles: Pairs) -> Message:
    """Return the JointTrajectory of a table. angles: earth azimuth, elevation [rad]."""
    points = []
    for time, positions in zip(times, angles):
        point = messages.trajectory_point(len(positions))
        point.positions[:] = positions
        nanoseconds = round(time * 1e9)
        point.time_from_start = messages.Duration(sec=nanoseconds // 10**9, nanosec=nanoseconds % 10**9)
        point.velocities = point.accelerations = np.zeros(0)
        points.append(point)
    return messages.program_track(points)
