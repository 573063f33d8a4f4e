"""Stow pins: one an axis, pushed into a hole of the turning part while the axis stands on its brakes.

    n    periods of travel that a pin is in: 0 out, N in
    t    periods for which it has been on its way

They go in only once both axes stand within the window about their holes. From then on until both are out the drive is
off: it stops, its brakes grip, and only then the pins move. A pin that is not where it was sent in time has failed,
which is a fault of its axis; it is tried again once the faults are reset.
"""
import math

from adu_drive.controller import faults
from pedestal_common.compiled import compiled
from pedestal_common.graph import topics

PIN_STATES = topics.PIN_STATE_TEXTS
PIN_OUT, PIN_MOVING, PIN_IN, PIN_FAILED = range(len(PIN_STATES))
"""Of a pin, in the order in which adu/stow_pins tells them."""

PIN_COMMAND_TEXTS = topics.TOPIC_BY_NAME['acu/stow_pins'].texts
PIN_COMMAND_OUT, PIN_COMMAND_IN = (PIN_COMMAND_TEXTS.index(place) for place in ('out', 'in'))
"""Codes of acu/stow_pins."""


def constants(params):
    """Of AduParameters: nested dictionary."""
    p = params.pins
    return {'fitted': int(params.stow_pins), 'hole': [p.azimuth, p.elevation], 'window': p.window,
            'travel': max(math.ceil(p.travel_time / params.period - 1e-6), 1),
            'timeout': math.ceil(p.timeout / params.period - 1e-6)}


def initial_state(params):
    """At the start: nested dictionary. ordered: where both pins belong; n, t: see the module; failed: 1 of a pin that
    has; stuck: 1 of a pin that is broken so that it stays where it is."""
    pin_in = int(params.stow_pins and params.pins.initially_in)
    n = pin_in * constants(params)['travel']
    return {'ordered': PIN_COMMAND_IN if pin_in else PIN_COMMAND_OUT, 'n': [n, n], 't': [0, 0], 'failed': [0, 0],
            'stuck': [0, 0]}


@compiled
def state(s, c, i):
    """Of the pin of axis i, of PIN_STATES."""
    if s.failed[i]:
        return PIN_FAILED
    return PIN_OUT if s.n[i] == 0 else PIN_IN if s.n[i] == c.travel else PIN_MOVING


@compiled
def state_code(s, c):
    """Code of adu/stow_pins."""
    return len(PIN_STATES) * state(s, c, 0) + state(s, c, 1) if c.fitted else topics.NO_TEXT_CODE


@compiled
def pins_out(s):
    """Whether the axes may move: both pins are out and stay there."""
    return s.ordered == PIN_COMMAND_OUT and s.n[0] == 0 and s.n[1] == 0


@compiled
def holds(s, c, i):
    """Whether the pin of axis i holds it as brakes do."""
    return s.n[i] == c.travel


@compiled
def command_pins(s, c, wanted, azimuth, elevation):
    """Take an order of acu/stow_pins; azimuth, elevation: encoder angles [rad] of axes that stand, NaN of one that
    moves. An order to go in waits until both are in the window."""
    if wanted == PIN_COMMAND_OUT:
        _set_command(s, PIN_COMMAND_OUT)
    elif wanted == PIN_COMMAND_IN and (abs(azimuth - c.hole[0]) <= c.window
                                       and abs(elevation - c.hole[1]) <= c.window):
        _set_command(s, PIN_COMMAND_IN)


@compiled
def _set_command(s, place):
    if place != s.ordered:
        s.ordered, s.t[0], s.t[1] = place, 0, 0


@compiled
def advance(s, c, i):
    """One period of the pin of axis i, whose drive is off: its fault word."""
    end = c.travel if s.ordered == PIN_COMMAND_IN else 0
    if s.n[i] == end or s.failed[i]:
        return faults.Bit.STOW_PIN if s.failed[i] else 0
    if not s.stuck[i]:
        s.n[i] += 1 if end > s.n[i] else -1
    s.t[i] += 1
    if s.n[i] != end and s.t[i] >= c.timeout:
        s.failed[i] = 1
    return faults.Bit.STOW_PIN if s.failed[i] else 0


@compiled
def retry(s):
    """Try again what has failed."""
    for i in range(2):
        s.failed[i] = s.t[i] = 0
