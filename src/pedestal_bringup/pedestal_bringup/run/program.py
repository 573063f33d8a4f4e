"""The program track an operator sends before a pass: the predicted target as time-tagged azimuth and elevation."""
import dataclasses
import datetime

import numpy as np

from pedestal_common import messages, orbit
from tracking_receiver_sim import target
from tracking_receiver_sim.path import arrival


def program_table(scenario, prefix=''):
    """(times (n,) s, angles (n, 2) earth azimuth (unwrapped), elevation [rad]) of a scenario's prediction; prefix: of
    the beam. The operator knows neither UT1 nor how late the target is seen, and of the air what `refractivity` says.

    From stamp 0 until two intervals past the end, so that the end of the run lies inside; where the target is not
    known, it stands at its first or last known place. Times to the last bit as the ACU reads them from the message.
    """
    program, duration = scenario.header.program, scenario.header.duration
    true = scenario.node_parameters(prefix + 'tracking_receiver').target
    believed = dataclasses.replace(true, leo_pass=dataclasses.replace(true.leo_pass, ut1_offset=0.0))
    built = target.build(believed, duration)
    nanoseconds = np.round(np.arange(0.0, duration + 2.0 * program.interval, program.interval) * 1e9)
    times = nanoseconds // 1e9 + nanoseconds % 1e9 * 1e-9
    known = np.clip(times - program.time_offset, built.breaks[0], built.breaks[-1])
    azimuth, elevation, _ = target.look_angles(built, known)
    if program.refractivity > 0.0:
        elevation = elevation + [arrival.refraction(program.refractivity, E)[0] for E in elevation]
    return times, np.column_stack((np.unwrap(azimuth) + program.azimuth_offset, elevation + program.elevation_offset))


def announced(scenario):
    """Lines on the targets of a scenario's beams, each once: what a flight is, when a satellite is highest, rises and
    sets."""
    lines = []
    for prefix in scenario.prefixes:
        built = target.build(scenario.node_parameters(prefix + 'tracking_receiver').target, scenario.header.duration)
        lines += built.summary or _sky(built, scenario.header.duration)
    return list(dict.fromkeys(lines))


def begins(scenario):
    """UTC [ns] of the time 0 of a scenario by its target. Raises ValueError where the target has no date."""
    built = target.build(scenario.node_parameters(f'{scenario.prefixes[0]}tracking_receiver').target,
                         scenario.header.duration)
    if not built.start_time:
        raise ValueError(f'--start file: the target of {scenario.name} has no date; say a UTC instead')
    begin = orbit.instant('start', built.start_time).replace(tzinfo=datetime.timezone.utc)
    return round(begin.timestamp() * 1e3) * 1_000_000


def _sky(built, duration):
    """Lines on a target that has a date: the UTC of its highest place in a run of `duration` [s], of its rise and set
    where they are within."""
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


def program_messages(scenario):
    """{topic: JointTrajectory} of a scenario's program track for every beam; {} where it has none."""
    if scenario.header.program.source == 'none':
        return {}
    return {f'{prefix}acu/program_track': program_message(*program_table(scenario, prefix))
            for prefix in scenario.prefixes}


def program_message(times, angles):
    """The JointTrajectory of a table: times (n,) s, angles (n, 2) rad."""
    points = []
    for time, positions in zip(times, angles):
        point = messages.trajectory_point(len(positions))
        point.positions[:] = positions
        nanoseconds = round(time * 1e9)
        point.time_from_start = messages.Duration(sec=nanoseconds // 10**9, nanosec=nanoseconds % 10**9)
        point.velocities = point.accelerations = np.zeros(0)
        points.append(point)
    return messages.program_track(points)
