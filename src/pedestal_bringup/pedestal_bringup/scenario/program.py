"""Program track that an operator sends before a pass: the predicted target as time-tagged azimuth and elevation."""
import dataclasses
import datetime
import functools

import numpy as np

from pedestal_bringup.scenario.scenario import Scenario
from pedestal_common.geometry import orbit
from pedestal_common.wire import messages
from ship_motion_sim.sea import motion
from tracking_receiver_sim import target
from tracking_receiver_sim.path import arrival


@dataclasses.dataclass(frozen=True)
class Plan:
    """scenario.Scenario with its targets and its program tracks; each is built once, at its first use."""
    scenario: Scenario

    @functools.cached_property
    def targets(self):
        """{prefix of the beam: true target.Target}."""
        return {prefix: self._built(prefix, self._parameters(prefix)) for prefix in self.scenario.prefixes}

    def _parameters(self, prefix):
        return self.scenario.node_parameters(prefix + 'tracking_receiver').target

    def _built(self, prefix, parameters):
        mask = self.scenario.node_parameters(prefix + 'tracking_receiver').receiver.horizon_mask
        return target.build(parameters, self.scenario.header.duration, mask)

    def _nominal_target(self, prefix):
        """Return the target of a beam as the operator knows it, with UT1 equal to UTC."""
        true = self._parameters(prefix)
        nominal = dataclasses.replace(true, leo_pass=dataclasses.replace(true.leo_pass, ut1_offset=0.0))
        return self.targets[prefix] if nominal == true else self._built(prefix, nominal)

    @functools.cached_property
    def tables(self):
        """{prefix of the beam: (times (n,) s, angles (n, 2) earth azimuth (unwrapped), elevation [rad])} of the
        prediction. It contains neither UT1 nor the travel time of the signal, and of the refraction only
        `refractivity`.

        The table begins at stamp 0 and ends two intervals after the run, so that the end of the run is inside. Outside
        its known path the target is at its first or last known place. The times equal those that the ACU reads from
        the message, to the last bit.
        """
        program, duration = self.scenario.header.program, self.scenario.header.duration
        nanoseconds = np.round(np.arange(0.0, duration + 2.0 * program.interval, program.interval) * 1e9)
        times = nanoseconds // 1e9 + nanoseconds % 1e9 * 1e-9
        tables = {}
        for prefix in self.scenario.prefixes:
            built = self._nominal_target(prefix)
            known = np.clip(times - program.time_offset, built.breaks[0], built.breaks[-1])
            azimuth, elevation, _ = target.look_angles(built, known)
            if program.refractivity > 0.0:
                elevation = elevation + [arrival.refraction(program.refractivity, E)[0] for E in elevation]
            tables[prefix] = times, np.column_stack((np.unwrap(azimuth) + program.azimuth_offset,
                                                     elevation + program.elevation_offset))
        return tables

    @functools.cached_property
    def tracks(self):
        """{topic: JointTrajectory} of the program track for every beam; {} without a program track."""
        if self.scenario.header.program.source == 'none':
            return {}
        return {f'{prefix}acu/program_track': program_message(*table) for prefix, table in self.tables.items()}

    @functools.cached_property
    def ship_summary(self):
        """Lines on the file of the ship's motion, see motion.summary."""
        if 'ship_motion' not in self.scenario.nodes:
            return ()
        return motion.summary(self.scenario.node_parameters('ship_motion').ship)

    def announced(self):
        """Return lines on changed values, on the file of the ship and on the targets of the beams, each once.

        The lines of a target state what a flight is, when the target is highest, and when it rises and sets. Raises
        csv_table.TableError for a file that cannot be used.
        """
        lines = [*self.scenario.notes, *self.ship_summary]
        for prefix, built in self.targets.items():
            lines += [*built.summary, *_sky(built, self._parameters(prefix).kind, self.scenario.header.duration)]
        return list(dict.fromkeys(lines))

    def begins(self):
        """Return the UTC [ns] of the time 0 by the target. Raises ValueError where the target has no date."""
        start_time = self.targets[self.scenario.prefixes[0]].start_time
        if not start_time:
            raise ValueError(f'--start file: the target of {self.scenario.name} has no date; give a UTC instead')
        begin = orbit.instant('start', start_time).replace(tzinfo=datetime.timezone.utc)
        return round(begin.timestamp() * 1e3) * 1_000_000


def _sky(built, kind, duration):
    """Return lines on a target of a kind: its rise and set if they are within a run of `duration` [s], and the highest
    place of a target that has a date and no summary."""
    name = 'satellite' if kind == 'leo_pass' else 'target'
    times = np.linspace(0.0, duration, 1 + int(min(1e5, 10.0 * duration)))
    elevation = np.degrees(target.look_angles(built, times)[1])
    known, up = np.flatnonzero(np.isfinite(elevation)), np.flatnonzero(elevation > 0.0)
    if not up.size:
        return ()
    begin = orbit.instant('start', built.start_time) if built.start_time else None

    def when(row):
        at = f', at {begin + datetime.timedelta(seconds=float(times[row])):%H:%M:%S} UTC' if begin else ''
        return f'after {times[row]:.1f} s{at}'
    top = int(np.nanargmax(elevation))
    highest = (f'0 s is {begin:%Y-%m-%d %H:%M:%S} UTC; the {name} is highest in this run, {elevation[top]:.1f} deg, '
               f'{when(top)}',) if begin and not built.summary else ()
    rises = (f'the {name} rises {when(up[0])}: nothing can be tracked before',) if up[0] > known[0] else ()
    sets = (f'the {name} sets {when(up[-1])}: nothing can be tracked after',) if up[-1] < known[-1] else ()
    return (*highest, *rises, *sets)


def program_message(times, angles):
    """Return the JointTrajectory of a table: times (n,) s, angles (n, 2) rad."""
    points = []
    for time, positions in zip(times, angles):
        point = messages.trajectory_point(len(positions))
        point.positions[:] = positions
        nanoseconds = round(time * 1e9)
        point.time_from_start = messages.Duration(sec=nanoseconds // 10**9, nanosec=nanoseconds % 10**9)
        point.velocities = point.accelerations = np.zeros(0)
        points.append(point)
    return messages.program_track(points)
