"""Program track that an operator sends before a pass: the predicted target as time-tagged azimuth and elevation."""
import dataclasses
import datetime
import functools

import numpy as np

from pedestal_bringup.scenario.scenario import Scenario
from pedestal_common.geometry import orbit
from pedestal_common.wire import messages
from tracking_receiver_sim import target
from tracking_receiver_sim.path import arrival


@dataclasses.dataclass(frozen=True)
class Plan:
    """scenario.Scenario with its targets and its program tracks; each is built once, at its first use."""
    scenario: Scenario

    @functools.cached_property
    def targets(self):
        """{prefix of the beam: true target.Target}."""
        return {prefix: target.build(self._parameters(prefix), self.scenario.header.duration)
                for prefix in self.scenario.prefixes}

    def _parameters(self, prefix):
        return self.scenario.node_parameters(prefix + 'tracking_receiver').target

    def _nominal_target(self, prefix):
        """Return the target of a beam as the operator knows it, with UT1 equal to UTC."""
        true = self._parameters(prefix)
        nominal = dataclasses.replace(true, leo_pass=dataclasses.replace(true.leo_pass, ut1_offset=0.0))
        return self.targets[prefix] if nominal == true else target.build(nominal, self.scenario.header.duration)

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

    def announced(self):
        """Return lines on the targets of the beams, each once: the flight, or the times when a satellite culminates,
        rises and sets."""
        lines = []
        for built in self.targets.values():
            lines += built.summary or _sky(built, self.scenario.header.duration)
        return list(dict.fromkeys(lines))

    def begins(self):
        """Return the UTC [ns] of the time 0 by the target. Raises ValueError where the target has no date."""
        start_time = self.targets[self.scenario.prefixes[0]].start_time
        if not start_time:
            raise ValueError(f'--start file: the target of {self.scenario.name} has no date; give a UTC instead')
        begin = orbit.instant('start', start_time).replace(tzinfo=datetime.timezone.utc)
        return round(begin.timestamp() * 1e3) * 1_000_000


def _sky(built, duration):
    """Return lines on a target with a date: the UTC of its highest place in a run of `duration` [s], and of its rise
    and set within the run."""
    if not built.start_time:
        return ()
    times = np.linspace(0.0, duration, 1 + int(min(1e5, 10.0 * duration)))
    elevation = np.degrees(target.look_angles(built, times)[1])
    top, up = int(np.argmax(elevation)), np.flatnonzero(elevation > 0.0)
    begin = orbit.instant('start', built.start_time)

    def when(row):
        at = begin + datetime.timedelta(seconds=float(times[row]))
        return f'after {times[row]:.1f} s, at {at:%H:%M:%S} UTC'
    highest = (f'0 s is {begin:%Y-%m-%d %H:%M:%S} UTC; the satellite is highest in this run, '
               f'{elevation[top]:.1f} deg, {when(top)}')
    rises = (f'the satellite rises {when(up[0])}: nothing can be tracked before',) if up.size and up[0] else ()
    sets = (f'the satellite sets {when(up[-1])}: nothing can be tracked after',) if up.size and (
        up[-1] < times.size - 1) else ()
    return (highest, *rises, *sets)


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
