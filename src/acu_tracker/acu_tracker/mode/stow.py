"""Stow and unstow: the axes stand at the stow angles and the pins are asked to go in; the pins are asked to go out.

A pin holds its axis by force: nothing is commanded while one is not out, or was asked to go in. What was asked stays
asked, whatever the mode is then, until the other is.
"""
import math

import numpy as np

from acu_tracker.modes import Mode, Reason
from pedestal_common.compiled import compiled
from pedestal_common.graph import topics

STOW_DTYPE = np.dtype([('asked', 'i8'), ('since', 'f8'), ('off', 'f8')], align=True)
"""asked: code of acu/stow_pins, SILENT before the first; since: stamp at which that was asked [s]; off: stamp at which
the axes were not at rest at the stow angles last [s]."""

_REQUEST_TEXTS = topics.TOPIC_BY_NAME['acu/stow_pins'].texts
REQUEST_PINS_OUT, REQUEST_PINS_IN = _REQUEST_TEXTS.index('out'), _REQUEST_TEXTS.index('in')

_PIN_STATE_COUNT = len(topics.PIN_STATE_TEXTS)
_PIN_OUT, _PIN_IN, _PIN_FAILED = (topics.PIN_STATE_TEXTS.index(state) for state in ('out', 'in', 'failed'))
"""Of a pin; a code of adu/stow_pins is that of the azimuth times _STATES and that of the elevation."""

BOTH_PINS_OUT, BOTH_PINS_IN = _PIN_OUT * _PIN_STATE_COUNT + _PIN_OUT, _PIN_IN * _PIN_STATE_COUNT + _PIN_IN

MAX_REST_RATE_RAD_S = 1e-3
"""Rate [rad/s] below which an axis stands."""

MIN_REST_TIME_S = 0.5
"""Time for which both axes must stand at the stow angles [s]."""


def initialise(s):
    """Nothing was asked; s: view of STOW_DTYPE."""
    s['asked'], s['since'], s['off'] = topics.NO_TEXT_CODE, -math.inf, -math.inf


@compiled
def failed(code, i):
    """Whether a code of adu/stow_pins says that the pin of axis i has failed."""
    return code >= 0 and (code // _PIN_STATE_COUNT if i == 0 else code % _PIN_STATE_COUNT) == _PIN_FAILED


@compiled
def obstacle(s, fitted, code):
    """NONE, or the reason why the axes must not move. fitted: 1 where there are pins; code: of adu/stow_pins."""
    if not fitted:
        return Reason.NONE
    if failed(code, 0) or failed(code, 1):
        return Reason.PIN_FAILED
    return Reason.NONE if code == BOTH_PINS_OUT and s.asked != REQUEST_PINS_IN else Reason.PINNED


@compiled
def commands_no_motion(s, fitted, code, mode):
    """Whether the mode commands no motion."""
    return (mode == Mode.STANDBY or mode == Mode.UNSTOW
            or (mode == Mode.STOW and obstacle(s, fitted, code) != Reason.NONE))


@compiled
def _request_pins(s, place, t):
    if s.asked != place:
        s.asked, s.since = place, t


@compiled
def _at_rest(c, u):
    """Whether both axes stand at the stow angles."""
    for i in range(2):
        if not (abs(u.position[i] - c.axis[i].p.stow) <= c.p.stow_window
                and abs(u.velocity[i]) <= MAX_REST_RATE_RAD_S):
            return False
    return True


@compiled
def step(s, c, u, mode):
    """Ask of the pins what the mode needs; whether mode stow has them in. c, u: records of control_unit.CONSTANTS and
    of signals.INPUTS."""
    t = u.stamp
    if mode == Mode.UNSTOW:
        _request_pins(s, REQUEST_PINS_OUT, t)
    elif mode == Mode.STOW:
        if u.pins == BOTH_PINS_OUT and not _at_rest(c, u):
            s.off = t
        elif u.pins != BOTH_PINS_OUT or t - s.off >= MIN_REST_TIME_S:
            _request_pins(s, REQUEST_PINS_IN, t)
    else:
        s.off = t
    return mode == Mode.STOW and u.pins == BOTH_PINS_IN


@compiled
def misplaced_pins(s, c, u):
    """Bits of the axes whose pin has failed, or is not where it was asked to be in time."""
    bits = 0
    for i in range(2):
        late = s.asked >= 0 and u.stamp - s.since > c.p.stow_timeout and u.pins != (BOTH_PINS_IN
                                                                                    if s.asked == REQUEST_PINS_IN else
                                                                                   BOTH_PINS_OUT)
        if failed(u.pins, i) or late:
            bits |= 1 << i
    return bits
