"""The modes stow and unstow: hold the axes at the stow angles and command the stow pins in, or command them out.

A stow pin is a bolt that locks its axis. The axes get a command only while both pins are out and no pin is commanded
in. The last request to the pins, in or out, stays in force when the mode changes.
"""
import math
from typing import TYPE_CHECKING

from acu_tracker.modes import Mode, Reason
from acu_tracker.signals import Inputs
from pedestal_common.compiled import compiled
from pedestal_common.graph import topics
from pedestal_common.quantities import Records, Seconds
from pedestal_common.record import Record

if TYPE_CHECKING:
    from acu_tracker.control_unit import Constants


class Stow(Record):
    """State of stow and unstow."""
    requested: int  # code of acu/stow_pins: requested position of both pins, NO_TEXT_CODE before the first request
    since: Seconds  # stamp of that request
    not_stowed: Seconds     # last stamp at which the axes were not at rest at the stow angles


# Codes of acu/stow_pins, on which the control unit requests the position of both pins.
_REQUEST_TEXTS = topics.TOPIC_BY_NAME['acu/stow_pins'].texts
REQUEST_PINS_OUT, REQUEST_PINS_IN = _REQUEST_TEXTS.index('out'), _REQUEST_TEXTS.index('in')

# Codes of adu/stow_pins, on which the drive reports the states of both pins. Such a code is _PIN_STATE_COUNT times the
# state of the azimuth pin, plus the state of the elevation pin.
_PIN_OUT, _PIN_IN, _PIN_FAILED = (topics.PIN_STATE_TEXTS.index(state) for state in ('out', 'in', 'failed'))
_PIN_STATE_COUNT = len(topics.PIN_STATE_TEXTS)
BOTH_PINS_OUT, BOTH_PINS_IN = _PIN_OUT * _PIN_STATE_COUNT + _PIN_OUT, _PIN_IN * _PIN_STATE_COUNT + _PIN_IN

MAX_REST_RATE_RAD_S = 1e-3  # rate below which an axis is at rest [rad/s]
MIN_REST_TIME_S = 0.5       # rest of both axes at the stow angles before the pins are commanded in [s]


def initialise(stow: Records) -> None:
    """Begin without a request."""
    stow['requested'], stow['since'], stow['not_stowed'] = topics.NO_TEXT_CODE, -math.inf, -math.inf


@compiled
def failed(code: int, i: int) -> bool:
    """Return True if the pin of axis i has failed. code: value of adu/stow_pins; below 0: not yet reported."""
    state = code // _PIN_STATE_COUNT if i == 0 else code % _PIN_STATE_COUNT
    return code >= 0 and state == _PIN_FAILED


@compiled
def obstacle(stow: Stow, constants: 'Constants', inputs: Inputs) -> int:
    """Return the reason why the stow pins forbid motion, or NONE."""
    if not constants.p.stow_pins:
        return Reason.NONE
    if failed(inputs.pins, 0) or failed(inputs.pins, 1):
        return Reason.PIN_FAILED
    return Reason.NONE if inputs.pins == BOTH_PINS_OUT and stow.requested != REQUEST_PINS_IN else Reason.PINNED


@compiled
def commands_no_motion(stow: Stow, constants: 'Constants', inputs: Inputs, mode: int) -> bool:
    """Return True if the mode commands no motion."""
    return (mode == Mode.STANDBY or mode == Mode.UNSTOW
            or (mode == Mode.STOW and obstacle(stow, constants, inputs) != Reason.NONE))


@compiled
def _request_pins(stow: Stow, place: int, t: Seconds) -> None:
    # A repeated request keeps its first stamp.
    if stow.requested != place:
        stow.requested, stow.since = place, t


@compiled
def _at_rest(constants: 'Constants', inputs: Inputs) -> bool:
    """Return True if both axes are at rest within stow_window of their stow angles."""
    for i in range(2):
        if not (abs(inputs.position[i] - constants.axis[i].p.stow) <= constants.p.stow_window
                and abs(inputs.velocity[i]) <= MAX_REST_RATE_RAD_S):
            return False
    return True


@compiled
def step(stow: Stow, constants: 'Constants', inputs: Inputs, mode: int) -> bool:
    """Request the position of the pins that the mode needs. Return True if the mode is stow and the pins are in."""
    t = inputs.stamp
    if mode == Mode.UNSTOW:
        _request_pins(stow, REQUEST_PINS_OUT, t)
    elif mode == Mode.STOW:
        if inputs.pins == BOTH_PINS_OUT and not _at_rest(constants, inputs):
            stow.not_stowed = t
        elif inputs.pins != BOTH_PINS_OUT or t - stow.not_stowed >= MIN_REST_TIME_S:
            # A pin that is not out prevents any motion of the axes. The control unit therefore requests the pins in
            # without waiting for rest.
            _request_pins(stow, REQUEST_PINS_IN, t)
    else:
        stow.not_stowed = t
    return mode == Mode.STOW and inputs.pins == BOTH_PINS_IN


@compiled
def misplaced_pins(stow: Stow, constants: 'Constants', inputs: Inputs) -> int:
    """Return the bits of the axes whose pin has failed, or has not reached its requested position in time."""
    bits, goal = 0, BOTH_PINS_IN if stow.requested == REQUEST_PINS_IN else BOTH_PINS_OUT
    late = stow.requested >= 0 and inputs.stamp - stow.since > constants.p.stow_timeout and inputs.pins != goal
    for i in range(2):
        if failed(inputs.pins, i) or late:
            bits |= 1 << i
    return bits
