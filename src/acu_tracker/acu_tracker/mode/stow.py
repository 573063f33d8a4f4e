"""The modes stow and unstow: hold the axes at the stow angles and command the stow pins in, or command them out.

A stow pin is a bolt that locks its axis. The axes get a command only while both pins are out and no pin is commanded
in. The last request to the pins, in or out, stays in force when the mode changes.

s: record of Stow; code: code of adu/stow_pins, the states of both pins.
"""
import math

from acu_tracker.modes import Mode, Reason
from pedestal_common.compiled import compiled
from pedestal_common.graph import topics
from pedestal_common.record import Record


class Stow(Record):
    """State of stow and unstow."""
    requested: int  # code of acu/stow_pins: requested position of both pins, NO_TEXT_CODE before the first request
    since: float  # stamp of that request [s]
    not_stowed: float  # last stamp at which the axes were not at rest at the stow angles [s]


_REQUEST_TEXTS = topics.TOPIC_BY_NAME['acu/stow_pins'].texts
REQUEST_PINS_OUT, REQUEST_PINS_IN = _REQUEST_TEXTS.index('out'), _REQUEST_TEXTS.index('in')
"""Codes of acu/stow_pins, on which the control unit requests the position of both pins."""

_PIN_OUT, _PIN_IN, _PIN_FAILED = (topics.PIN_STATE_TEXTS.index(state) for state in ('out', 'in', 'failed'))
"""Codes of the states of one pin."""

_PIN_STATE_COUNT = len(topics.PIN_STATE_TEXTS)
"""Number of states of a pin. A code of adu/stow_pins is _PIN_STATE_COUNT times the state of the azimuth pin, plus the
state of the elevation pin."""

BOTH_PINS_OUT, BOTH_PINS_IN = _PIN_OUT * _PIN_STATE_COUNT + _PIN_OUT, _PIN_IN * _PIN_STATE_COUNT + _PIN_IN
"""Codes of adu/stow_pins, on which the drive reports the states of both pins."""

MAX_REST_RATE_RAD_S = 1e-3  # rate below which an axis is at rest [rad/s]

MIN_REST_TIME_S = 0.5
"""Time for which both axes must be at rest at the stow angles before the pins are commanded in [s]."""


def initialise(s):
    """Begin without a request; s: view of Stow."""
    s['requested'], s['since'], s['not_stowed'] = topics.NO_TEXT_CODE, -math.inf, -math.inf


@compiled
def failed(code, i):
    """Return True if the pin of axis i has failed; a code below 0 means that the drive has reported no state yet."""
    state = code // _PIN_STATE_COUNT if i == 0 else code % _PIN_STATE_COUNT
    return code >= 0 and state == _PIN_FAILED


@compiled
def obstacle(s, fitted, code):
    """Return the reason why the axes must not move, or NONE. fitted: 1 if the antenna has stow pins."""
    if not fitted:
        return Reason.NONE
    if failed(code, 0) or failed(code, 1):
        return Reason.PIN_FAILED
    return Reason.NONE if code == BOTH_PINS_OUT and s.requested != REQUEST_PINS_IN else Reason.PINNED


@compiled
def commands_no_motion(s, fitted, code, mode):
    """Return True if the mode commands no motion; fitted: 1 if the antenna has stow pins."""
    return (mode == Mode.STANDBY or mode == Mode.UNSTOW
            or (mode == Mode.STOW and obstacle(s, fitted, code) != Reason.NONE))


@compiled
def _request_pins(s, place, t):
    """Request a position of the pins at t [s]: `out` or `in`. A repeated request keeps its first stamp."""
    if s.requested != place:
        s.requested, s.since = place, t


@compiled
def _at_rest(c, u):
    """Return True if both axes are at rest within stow_window of their stow angles."""
    for i in range(2):
        if not (abs(u.position[i] - c.axis[i].p.stow) <= c.p.stow_window
                and abs(u.velocity[i]) <= MAX_REST_RATE_RAD_S):
            return False
    return True


@compiled
def step(s, c, u, mode):
    """Request the position of the pins that the mode needs. Return True if the mode is stow and the pins are in.

    c, u: records of control_unit.Constants and of signals.Inputs.dtype.
    """
    t = u.stamp
    if mode == Mode.UNSTOW:
        _request_pins(s, REQUEST_PINS_OUT, t)
    elif mode == Mode.STOW:
        if u.pins == BOTH_PINS_OUT and not _at_rest(c, u):
            s.not_stowed = t
        elif u.pins != BOTH_PINS_OUT or t - s.not_stowed >= MIN_REST_TIME_S:
            # A pin that is not out prevents any motion of the axes. The control unit therefore requests the pins in
            # without waiting for rest.
            _request_pins(s, REQUEST_PINS_IN, t)
    else:
        s.not_stowed = t
    return mode == Mode.STOW and u.pins == BOTH_PINS_IN


@compiled
def misplaced_pins(s, c, u):
    """Return the bits of the axes whose pin has failed, or has not reached its requested position in time."""
    bits, goal = 0, BOTH_PINS_IN if s.requested == REQUEST_PINS_IN else BOTH_PINS_OUT
    late = s.requested >= 0 and u.stamp - s.since > c.p.stow_timeout and u.pins != goal
    for i in range(2):
        if failed(u.pins, i) or late:
            bits |= 1 << i
    return bits
