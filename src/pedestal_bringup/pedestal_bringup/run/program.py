"""The program track an operator sends before a pass: the predicted target as time-tagged azimuth and elevation."""
import numpy as np

from pedestal_common import messages
from tracking_receiver_sim import target


def program_table(scenario, prefix=''):
    """(times (n,) s, angles (n, 2) earth azimuth (unwrapped), elevation [rad]) of a scenario's prediction; prefix: of
    the beam.

    From stamp 0 until two intervals past the end, so that the end of the run lies inside; where the target is not
    known, it stands at its first or last known place. Times to the last bit as the ACU reads them from the message.
    """
    program, duration = scenario.header.program, scenario.header.duration
    built = target.build(scenario.node_parameters(prefix + 'tracking_receiver').target, duration)
    nanoseconds = np.round(np.arange(0.0, duration + 2.0 * program.interval, program.interval) * 1e9)
    times = nanoseconds // 1e9 + nanoseconds % 1e9 * 1e-9
    known = np.clip(times - program.time_offset, built.breaks[0], built.breaks[-1])
    azimuth, elevation, _ = target.look_angles(built, known)
    return times, np.column_stack((np.unwrap(azimuth) + program.azimuth_offset, elevation + program.elevation_offset))


def flights(scenario):
    """Lines on the recorded flights that are the targets of a scenario's beams, each once; [] where there is none."""
    built = (target.build(scenario.node_parameters(prefix + 'tracking_receiver').target, scenario.header.duration)
             for prefix in scenario.prefixes)
    return list(dict.fromkeys(line for made in built for line in made.summary))


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
