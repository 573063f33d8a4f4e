"""Directions on the deck that a recorded control unit predicted, by the table that it followed last.

The directions contain the refraction that the control unit adds, and not the offsets that an operator has commanded.
On a ship, the recorded attitude of the INS turns earth directions to the deck, from the alignment of the INS on.
"""
from collections.abc import Iterable, Sequence

import numpy as np

from acu_tracker.program import program_track
from acu_tracker.program.prediction import Predictor
from acu_tracker.program.program_track import ProgramTrack, checked
from pedestal_common.compiled import compiled
from pedestal_common.geometry import line_of_sight
from pedestal_common.graph.modes import MODE_ROWS
from pedestal_common.parameters import ParameterError
from pedestal_common.quantities import Pairs, Quaternions, Texts, Times
from pedestal_common.wire import messages
from pedestal_recording import recording as recordings
from pedestal_recording.recording import Recording
from pedestal_results import known_attitude, mode_pointing
from pedestal_workbench.calibration.calibration import CalibrationError

PROGRAM_TOPIC, S_PER_NS = 'acu/program_track', 1e-9
TABLE_MODES = tuple(row.name for row in MODE_ROWS if row.table)  # modes that follow a table


@compiled
def _of_table(program: ProgramTrack, times: Times, out: Pairs) -> None:
    """Fill out with the directions of a program track; NaN outside its table."""
    for k in range(len(times)):
        out[k, 0] = out[k, 1] = np.nan
        if program.times[0] <= times[k] <= program.times[-1]:
            motion = program_track.motion_at(program, times[k])
            out[k, 0], out[k, 1] = motion.azimuth.angle, motion.elevation.angle


@compiled
def _on_deck(attitude: Quaternions, angles: Pairs) -> None:
    """Turn earth angles [rad] to deck angles, in place; attitude: rotation deck -> earth."""
    mat_ed = np.empty((3, 3))
    for k in range(len(angles)):
        line_of_sight.rotation(attitude[k, 0], attitude[k, 1], attitude[k, 2], attitude[k, 3], mat_ed)
        e, n, u = line_of_sight.earth_direction(angles[k, 0], angles[k, 1])
        angles[k, 0], angles[k, 1] = line_of_sight.angles(*line_of_sight.to_deck(mat_ed, e, n, u))


def programs(bag: Recording) -> list[ProgramTrack]:
    """Return the program tracks of a recording in their order, with the refraction that the control unit added."""
    found = []
    for _, _, _, message in bag.messages(PROGRAM_TOPIC) if PROGRAM_TOPIC in bag.topics else ():
        if len(message.points) > 1:
            start = messages.nanoseconds(messages.since(message, bag.start).header.stamp) * S_PER_NS
            times = [start + point.time_from_start.sec + point.time_from_start.nanosec * S_PER_NS
                     for point in message.points]
            found.append(checked(times, [point.positions for point in message.points]))
    known = recordings.parameters(bag, 'acu')
    if known.get('refraction.program') == 'apparent':
        return found
    air = mode_pointing.air_of(bag, known)
    return [air.apparent(track) for track in found]


def of_programs(tracks: Iterable[ProgramTrack], t: Times) -> Pairs:
    """Return the directions [rad] of the last of several program tracks that covers an instant."""
    out, part = np.full((t.size, 2), np.nan), np.empty((t.size, 2))
    for track in tracks:
        _of_table(track, t, part)
        known = np.isfinite(part[:, 0])
        out[known] = part[known]
    return out


def _satellite(bag: Recording, predictor: Predictor, t: Times) -> Pairs:
    """Return the directions [rad] of the satellite of the mode tle, by the elements in force at each time."""
    changes = [(-np.inf, predictor)]
    for time, command, reply in recordings.replies(bag, 'acu/command_result'):
        given = command.arguments
        if command.verb in ('tle', 'elements') and reply.granted and any(given.values()):
            line_1, line_2, omm = (given.get(name, '') for name in ('line_1', 'line_2', 'omm'))
            changes.append((time, predictor.with_elements(line_1.replace('_', ' '), line_2.replace('_', ' '), omm)))
    out = np.full((t.size, 2), np.nan)
    for (begins, one), ends in zip(changes, [*(time for time, _ in changes[1:]), np.inf]):
        rows = np.flatnonzero((t >= begins) & (t < ends))
        while rows.size:
            known = one.satellite(float(t[rows[0]]))
            if not len(known.track.times):
                break
            inside = rows[t[rows] < known.until]
            part = np.empty((inside.size, 2))
            _of_table(one.air.apparent(known.track), t[inside], part)
            out[inside], rows = part, rows[inside.size:]
    return out


def followed(bag: Recording, modes: Texts, tracks: Sequence[ProgramTrack]) -> Texts:
    """Return the mode of the table that the control unit followed last at each step. Before the first table, the
    program track is expected, and without a track the satellite of the mode tle."""
    inside = np.isin(modes, TABLE_MODES)
    last = np.maximum.accumulate(np.where(inside, np.arange(modes.size), -1))
    first = 'program' if tracks else 'tle'
    return np.where(last < 0, first, modes[last])


def on_deck(bag: Recording, t: Times, tracks: Sequence[ProgramTrack], modes: Texts) -> Pairs:
    """Return the predicted deck angles [rad] at the steps; NaN where nothing is predicted. Raises CalibrationError for
    predictions that need more than the recording."""
    tables, out = followed(bag, modes, tracks), np.full((t.size, 2), np.nan)
    if 'program' in tables:
        out[tables == 'program'] = of_programs(tracks, t[tables == 'program'])
    if {'tle', 'sun'} & set(tables):
        try:
            predictor = mode_pointing.predictor_of(bag, recordings.parameters(bag, 'acu'))
        except ParameterError as error:
            raise CalibrationError(str(error)) from None
        for mode, angles in (('tle', lambda times: _satellite(bag, predictor, times)), ('sun', predictor.sun_angles)):
            if (tables == mode).any():
                out[tables == mode] = angles(t[tables == mode])
    if known_attitude.ATTITUDE_TOPIC in bag.topics:
        attitude = recordings.of_equipment(bag, t, known_attitude.ATTITUDE_TOPIC,
                                           [f'orientation.{letter}' for letter in 'xyzw'])
        out[~np.isfinite(attitude).all(1) | ~(t >= known_attitude.aligned_from(bag, t[0]))] = np.nan
        _on_deck(attitude, out)
    return out
