"""Stow pins: one per axis (0 azimuth, 1 elevation), pushed into a hole of the turning part while the brakes hold the
axis.

A command to move the pins in waits until both axes stand within the window about their holes. The drive then stops,
the brakes grip, and the pins move in. The drive stays off until both pins are out again. A pin that does not reach its
position in time has failed, which is a fault of its axis. A reset of the faults retries the motion.
"""
import math
from typing import Annotated

from drive_law import faults
from drive_law.params import AduParameters
from pedestal_common.compiled import compiled
from pedestal_common.graph import topics
from pedestal_common.quantities import Bit, Ints, Pair, Radians, Records
from pedestal_common.record import Record

PIN_STATES = topics.PIN_STATE_TEXTS
PIN_OUT, PIN_MOVING, PIN_IN, PIN_FAILED = range(len(PIN_STATES))
"""States of a pin, in the order of the texts of adu/stow_pins."""

PIN_COMMAND_TEXTS = topics.TOPIC_BY_NAME['acu/stow_pins'].texts
PIN_COMMAND_OUT, PIN_COMMAND_IN = (PIN_COMMAND_TEXTS.index(place) for place in ('out', 'in'))  # codes of acu/stow_pins


class Constants(Record):
    """Place of the holes and times of the motion, in control periods."""
    fitted: Bit
    hole: Pair              # azimuth and elevation at which each pin meets its hole [rad]
    window: Radians         # largest distance from the hole for moving a pin in
    travel: int
    timeout: int


class State(Record):
    """State of both pins."""
    ordered: int                        # commanded position, PIN_COMMAND_OUT or PIN_COMMAND_IN
    n: Annotated[Ints, (2,)]            # position in control periods of travel: 0 out, Constants.travel in
    t: Annotated[Ints, (2,)]            # number of control periods for which the pin has been moving
    failed: Annotated[Ints, (2,)]       # 1 for a failed pin
    stuck: Annotated[Ints, (2,)]        # 1 for a pin with the injected fault that it does not move


def constants(params: AduParameters) -> Records:
    """Return the Constants (1,)."""
    p = params.pins
    return Constants.of(fitted=params.stow_pins, hole=[p.azimuth, p.elevation], window=p.window,
                        travel=max(math.ceil(p.travel_time / params.period - 1e-6), 1),
                        timeout=math.ceil(p.timeout / params.period - 1e-6))


def initial_state(params: AduParameters) -> Records:
    """Return the State (1,)."""
    pin_in = params.stow_pins and params.pins.initially_in
    return State.of(ordered=PIN_COMMAND_IN if pin_in else PIN_COMMAND_OUT,
                    n=constants(params)['travel'] if pin_in else 0)


@compiled
def state(pins: State, constants: Constants, axis: int) -> int:
    """Return the state of the pin of an axis, an index of PIN_STATES."""
    if pins.failed[axis]:
        return PIN_FAILED
    return PIN_OUT if pins.n[axis] == 0 else PIN_IN if pins.n[axis] == constants.travel else PIN_MOVING


@compiled
def state_code(pins: State, constants: Constants) -> int:
    """Return the code of adu/stow_pins."""
    if not constants.fitted:
        return topics.NO_TEXT_CODE
    return len(PIN_STATES) * state(pins, constants, 0) + state(pins, constants, 1)


@compiled
def pins_out(pins: State) -> bool:
    """Return True if both pins are out and stay out, so that the axes may move."""
    return pins.ordered == PIN_COMMAND_OUT and pins.n[0] == 0 and pins.n[1] == 0


@compiled
def holds(pins: State, constants: Constants, axis: int) -> bool:
    """Return True if the pin of an axis holds it, as brakes do."""
    return pins.n[axis] == constants.travel


@compiled
def command_pins(pins: State, constants: Constants, wanted: int, azimuth: Radians, elevation: Radians) -> None:
    """Take a command of acu/stow_pins. The command `in` waits until both axes are in the window. azimuth, elevation:
    encoder angles of standing axes, NaN for a moving axis."""
    if wanted == PIN_COMMAND_OUT:
        _set_command(pins, PIN_COMMAND_OUT)
    elif wanted == PIN_COMMAND_IN and (abs(azimuth - constants.hole[0]) <= constants.window
                                       and abs(elevation - constants.hole[1]) <= constants.window):
        _set_command(pins, PIN_COMMAND_IN)


@compiled
def _set_command(pins: State, place: int) -> None:
    """Set the commanded position of both pins. A new command restarts the time of the motion."""
    if place != pins.ordered:
        pins.ordered, pins.t[0], pins.t[1] = place, 0, 0


@compiled
def advance(pins: State, constants: Constants, axis: int) -> int:
    """Advance the pin of an axis by a period while the drive is off. Return its fault word."""
    end = constants.travel if pins.ordered == PIN_COMMAND_IN else 0
    if pins.n[axis] == end or pins.failed[axis]:
        return faults.Bit.STOW_PIN if pins.failed[axis] else 0
    if not pins.stuck[axis]:
        pins.n[axis] += 1 if end > pins.n[axis] else -1
    pins.t[axis] += 1
    if pins.n[axis] != end and pins.t[axis] >= constants.timeout:
        pins.failed[axis] = 1
    return faults.Bit.STOW_PIN if pins.failed[axis] else 0


@compiled
def retry(pins: State) -> None:
    """Clear the failures, so that the pins try again."""
    for i in range(2):
        pins.failed[i] = pins.t[i] = 0
