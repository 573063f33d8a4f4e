"""Stow pins: one per axis, pushed into a hole of the turning part while the brakes hold the axis.

    n    position of a pin in control periods of travel: 0 out, c.travel in
    t    number of control periods for which the pin has been moving

A command to move the pins in waits until both axes stand within the window about their holes. The drive then stops,
the brakes grip, and the pins move in. The drive stays off until both pins are out again. A pin that does not reach its
position in time has failed, which is a fault of its axis. A reset of the faults retries the motion.

Arguments: s and c are the state and the constants of the pins, i is the axis (0 azimuth, 1 elevation).
"""
import math

from adu_drive.controller import faults
from pedestal_common.compiled import compiled
from pedestal_common.graph import topics

PIN_STATES = topics.PIN_STATE_TEXTS
PIN_OUT, PIN_MOVING, PIN_IN, PIN_FAILED = range(len(PIN_STATES))
"""States of a pin, in the order of the texts of adu/stow_pins."""

PIN_COMMAND_TEXTS = topics.TOPIC_BY_NAME['acu/stow_pins'].texts
PIN_COMMAND_OUT, PIN_COMMAND_IN = (PIN_COMMAND_TEXTS.index(place) for place in ('out', 'in'))  # codes of acu/stow_pins


def constants(params):
    """Return the constants of the pins from AduParameters: nested dictionary."""
    p = params.pins
    return {'fitted': int(params.stow_pins), 'hole': [p.azimuth, p.elevation], 'window': p.window,
            'travel': max(math.ceil(p.travel_time / params.period - 1e-6), 1),
            'timeout': math.ceil(p.timeout / params.period - 1e-6)}


def initial_state(params):
    """Return the initial state: nested dictionary.

    ordered: commanded position of both pins; n, t: see the module; failed: 1 for a failed pin; stuck: 1 for a pin with
    the injected fault that it does not move.
    """
    pin_in = int(params.stow_pins and params.pins.initially_in)
    n = pin_in * constants(params)['travel']
    return {'ordered': PIN_COMMAND_IN if pin_in else PIN_COMMAND_OUT, 'n': [n, n], 't': [0, 0], 'failed': [0, 0],
            'stuck': [0, 0]}


@compiled
def state(s, c, i):
    """Return the state of the pin of axis i, an index of PIN_STATES."""
    if s.failed[i]:
        return PIN_FAILED
    return PIN_OUT if s.n[i] == 0 else PIN_IN if s.n[i] == c.travel else PIN_MOVING


@compiled
def state_code(s, c):
    """Return the code of adu/stow_pins."""
    return len(PIN_STATES) * state(s, c, 0) + state(s, c, 1) if c.fitted else topics.NO_TEXT_CODE


@compiled
def pins_out(s):
    """Return True if both pins are out and stay out, so that the axes may move."""
    return s.ordered == PIN_COMMAND_OUT and s.n[0] == 0 and s.n[1] == 0


@compiled
def holds(s, c, i):
    """Return True if the pin of axis i holds the axis, as brakes do."""
    return s.n[i] == c.travel


@compiled
def command_pins(s, c, wanted, azimuth, elevation):
    """Take a command of acu/stow_pins. The command `in` waits until both axes are in the window.

    azimuth, elevation: encoder angles [rad] of standing axes, NaN for a moving axis.
    """
    if wanted == PIN_COMMAND_OUT:
        _set_command(s, PIN_COMMAND_OUT)
    elif wanted == PIN_COMMAND_IN and (abs(azimuth - c.hole[0]) <= c.window
                                       and abs(elevation - c.hole[1]) <= c.window):
        _set_command(s, PIN_COMMAND_IN)


@compiled
def _set_command(s, place):
    """Set the commanded position of both pins. A new command restarts the time of the motion."""
    if place != s.ordered:
        s.ordered, s.t[0], s.t[1] = place, 0, 0


@compiled
def advance(s, c, i):
    """Advance the pin of axis i by a period while the drive is off. Return its fault word."""
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
    """Clear the failures, so that the pins try again."""
    for i in range(2):
        s.failed[i] = s.t[i] = 0
