"""Pointing error of a recorded run in the modes that follow a direction without the angle errors of the receiver.

The error is the direction that the mode follows minus the direction of the beam. `program`, `tle` and `steptrack`
follow the true target. `preset` follows the requested deck angle, which is the reference of the position loop while
this reference stands. `slave` follows the commanded earth angle with its rates, `sun` the sun as seen from the
station.

Only the settled part of a mode counts, without the slew to the direction. It begins when the error has moved by less
than MAX_DRIFT beamwidths per second for SETTLING_TIME_S. In `preset` and `slave`, which may get another direction,
each slew is left out. Because step track moves the beam on purpose, its settled part begins HANDOVER_SETTLING_S after
the begin of the mode.
"""
from collections.abc import Callable, Mapping
from typing import TypeAlias

import numpy as np

from acu_tracker.command_table import ACU_COMMANDS
from acu_tracker.program.air import WEATHER_QUANTITIES, Air, RefractionParameters
from acu_tracker.program.prediction import PredictionParameters, Predictor
from pedestal_common.compiled import compiled
from pedestal_common.geometry import line_of_sight
from pedestal_common.graph.topics import AXES, TOPIC_BY_NAME
from pedestal_common.parameters import ParameterError, build
from pedestal_common.quantities import Bools, Floats, Json, Pairs
from pedestal_common.wire import commands, messages
from pedestal_recording import recording as recordings
from pedestal_recording.recording import Recording
from pedestal_results import tracking
from pedestal_results.tracking import DEG_PER_RAD, Tracking

FOLLOWED_DIRECTIONS = {'program': 'true target', 'tle': 'true target', 'preset': 'requested angles',
                       'steptrack': 'true target', 'slave': 'commanded direction', 'sun': 'direction of the sun'}
"""{mode with results of its own, and with a row of _PARTS: the direction that it follows}."""
SETTLING_TIME_S = 0.5  # time for which the error must be still before a mode counts as settled [s]
MAX_DRIFT = 0.25  # largest motion of a still error [beamwidths/s]
_Part: TypeAlias = tuple[Pairs, Bools]  # error (cross-elevation, elevation) [rad], the settled steps of a mode
MAX_REFERENCE_STEP_RAD = 1e-5  # largest motion within SETTLING_TIME_S of a reference that counts as standing [rad]


def read(bag: Recording, run: Tracking) -> dict[str, Pairs]:
    """Return {mode: pointing errors [deg] in cross-elevation and elevation} in the settled part of each mode.

    An electronic beam has two rows per step: at the end and at the beginning of the interval. A mode without a settled
    part is left out.
    """
    found = {}
    for mode, direction in FOLLOWED_DIRECTIONS.items():
        inside = run.mode == mode
        if not inside.any():
            continue
        error, on = _PARTS[mode](bag, run, inside)
        if np.isfinite(error[on]).any():
            parts = [error[on], run.begun[on]] if run.electronic and direction == 'true target' else [error[on]]
            found[mode] = np.concatenate(parts) * DEG_PER_RAD
    return found


def _window(run: Tracking) -> int:
    return max(1, round(SETTLING_TIME_S / run.period))


def _moved(values: Pairs, window: int) -> Floats:
    """Return the distance that values moved in the last `window` steps; infinite in the first rows."""
    out = np.full(len(values), np.inf)
    out[window:] = np.hypot(*(values[window:] - values[:-window]).T)
    return out


@compiled
def fill_offsets(beam: Pairs, directions: Pairs, error: Pairs) -> None:
    """Fill error with the offsets of earth directions from the beam [rad]."""
    for k in range(len(beam)):
        x, y, z = line_of_sight.direction(directions[k, 0], directions[k, 1])
        error[k, 0], error[k, 1] = line_of_sight.offsets(beam[k, 0], beam[k, 1], x, y, z)


def _to_earth_direction(run: Tracking, directions: Pairs) -> Pairs:
    """Return the error [rad] of the true beam against earth angles."""
    error = np.empty_like(directions)
    fill_offsets(run.beam_earth, directions, error)
    return error


def _of_table(_: Recording, run: Tracking, inside: Bools) -> _Part:
    return _after_slew(run.error, run, inside)


def _after_slew(error: Pairs, run: Tracking, inside: Bools) -> _Part:
    """Return the error, and the steps after the first slew of each stretch."""
    on = np.zeros(run.t.size, bool)
    for first, last in tracking.stretches(inside):
        settled = np.flatnonzero(_settled(error[first:last], run))
        if settled.size:
            on[first + settled[0]:last] = True
    return error, on


def _settled(error: Pairs, run: Tracking) -> Bools:
    """Return the steps at which the error has been still for SETTLING_TIME_S."""
    window = _window(run)
    return np.convolve(_still(error, run), np.ones(window, int))[:len(error)] == window


def _still(error: Pairs, run: Tracking) -> Bools:
    """Return the steps at which the error drifts by less than MAX_DRIFT."""
    return _moved(error, _window(run)) < MAX_DRIFT * SETTLING_TIME_S * run.beamwidth


def _of_steps(_: Recording, run: Tracking, inside: Bools) -> _Part:
    return run.error, tracking.settled(inside, run.t)


def _of_preset(bag: Recording, run: Tracking, inside: Bools) -> _Part:
    columns, window = ('azimuth.position', 'elevation.position'), _window(run)
    beam = recordings.at(bag, run.t, 'adu/truth' if 'adu/truth' in bag.topics else 'joint_states', columns)
    error, on = run.reference - beam, np.zeros(run.t.size, bool)
    error[:, 0] *= np.cos(beam[:, 1])
    for first, last in tracking.stretches(inside):
        part = slice(first, last)
        on[part] = ((_moved(run.reference[part], window) < MAX_REFERENCE_STEP_RAD)
                    & _still(error[part], run))
    return error, on


def _of_slave(bag: Recording, run: Tracking, inside: Bools) -> _Part:
    directions, air = np.full((run.t.size, 2), np.nan), None
    known = recordings.parameters(bag, 'acu')
    if known.get('refraction.slave') != 'apparent':
        air = air_of(bag, known)
    granted = [(t, commands.values(ACU_COMMANDS, command)) for t, command, reply in
               recordings.replies(bag, 'acu/command_result') if command.verb == 'slave' and reply.granted]
    begins = np.searchsorted(run.t, [t for t, _ in granted])
    for (t, given), first, last in zip(granted, begins, [*begins[1:], run.t.size]):
        moved = np.minimum(run.t[first:last] - t, given['moves'])
        for i, axis in enumerate(AXES):
            directions[first:last, i] = given[axis] + given[f'{axis}_rate'] * moved
    known_steps = np.isfinite(directions[:, 1])
    if air and known_steps.any():
        directions[known_steps, 1] = air.bent(directions[known_steps, 1], run.t[known_steps])
    error, on = _to_earth_direction(run, directions), np.zeros(run.t.size, bool)
    for first, last in tracking.stretches(inside):
        on[first:last] = _settled(error[first:last], run)
    return error, on


def air_of(bag: Recording, known: Mapping[str, Json]) -> Air:
    """Return the Air of a recorded run, with the weather that was published; known: parameters of the ACU."""
    air = Air(build(RefractionParameters, {key: value for key, value in known.items()
                                           if key.startswith('refraction.')}, 'refraction.'))
    readings = [(log, topic, message) for topic in WEATHER_QUANTITIES
                if bag.topics.get(topic) == TOPIC_BY_NAME[topic].type for _, log, _, message in bag.messages(topic)]
    for log, topic, message in sorted(readings, key=lambda reading: reading[0]):
        now = (log - bag.start) * 1e-9
        stamp = messages.nanoseconds(message.header.stamp)
        air.take(topic, (stamp - bag.start) * 1e-9 if stamp else None, message, now)
        air.update(now)
    return air


def predictor_of(bag: Recording, known: Mapping[str, Json]) -> Predictor:
    """Return the Predictor of a recorded run; known: parameters of the ACU.

    Raises ParameterError, for example for a file of the earth's orientation that is not on this machine.
    """
    given = {key: value for key, value in known.items() if key.startswith('prediction.')}
    return Predictor(build(PredictionParameters, given, 'prediction.'), bag.start, air_of(bag, known))


def _of_sun(bag: Recording, run: Tracking, inside: Bools) -> _Part:
    """Return the part of the mode `sun`, NaN without recorded parameters."""
    known = recordings.parameters(bag, 'acu')
    if not known:
        return np.full((run.t.size, 2), np.nan), inside
    try:
        predictor = predictor_of(bag, known)
    except ParameterError:      # the file of the earth's orientation is not on this machine
        return np.full((run.t.size, 2), np.nan), inside
    return _after_slew(_to_earth_direction(run, predictor.sun_angles(run.t)), run, inside)


_PARTS: dict[str, Callable[[Recording, Tracking, Bools], _Part]] = {
    'program': _of_table, 'tle': _of_table, 'preset': _of_preset, 'steptrack': _of_steps, 'slave': _of_slave,
    'sun': _of_sun}
"""{mode: function(bag, run, the steps in the mode)}."""
