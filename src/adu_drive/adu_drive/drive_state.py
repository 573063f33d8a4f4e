"""Enable, brakes and faults of the drive: one state machine for both axes, which advances once per control period.

    enabled -> stopping -> engaging brakes -> disabled -> releasing brakes -> enabled

A request enables the drive if no fault and no emergency stop is latched and the stow pins are out. To become disabled,
the drive stops under control, applies the brakes while the motors still hold, and then removes the torque. The stow
pins may move only in the phase `disabled`. Overcurrent, and a stop that takes too long, remove the torque and apply
the brakes at once.
"""
import math
from typing import Protocol

from adu_drive import axis, stow_pins
from adu_drive.controller import faults
from pedestal_common.compiled import compiled
from pedestal_common.graph import topics
from pedestal_common.quantities import Bit

PHASES = ('enabled', 'stopping', 'engaging brakes', 'disabled', 'releasing brakes')
PHASE_ENABLED, PHASE_STOPPING, PHASE_ENGAGING_BRAKES, PHASE_DISABLED, PHASE_RELEASING_BRAKES = range(len(PHASES))

REQUEST_ENABLE, REQUEST_DISABLE, REQUEST_EMERGENCY_STOP, REQUEST_RESET_FAULTS = range(4)
REQUEST_CODES = {'adu/enable': REQUEST_ENABLE, 'adu/disable': REQUEST_DISABLE,
                 'adu/emergency_stop': REQUEST_EMERGENCY_STOP,
                 'adu/reset_faults': REQUEST_RESET_FAULTS}
"""Requests to the drive, {name of the service: code}."""

REPLY_ACCEPTED, REPLY_FAULT_LATCHED, REPLY_EMERGENCY_LATCHED, REPLY_AXES_MOVING, REPLY_CAUSE_PERSISTS = range(5)
REFUSAL_REASONS = {
    REPLY_FAULT_LATCHED: 'a fault is latched (adu/reset_faults)',
    REPLY_EMERGENCY_LATCHED: 'an emergency stop is latched (adu/reset_faults)',
    REPLY_AXES_MOVING: 'the axes still move',
    REPLY_CAUSE_PERSISTS: 'the cause is still present'}
"""Refusals of a request, {code: reason}."""

STATE_TEXTS = topics.TOPIC_BY_NAME['adu/state'].texts
STATE_CODE_EMERGENCY_STOP = STATE_TEXTS.index('emergency stop')
PHASE_CODE_OFFSET = STATE_TEXTS.index(PHASES[PHASE_STOPPING]) - PHASE_STOPPING
"""Offset from a phase to its code of adu/state. A code below len(STATE_TEXTS) is an index of STATE_TEXTS."""

FAULT_BIT, EMERGENCY_STOP_BIT = 16, 32
AZIMUTH_FAULTS_SHIFT = 6
ELEVATION_FAULTS_SHIFT = AZIMUTH_FAULTS_SHIFT + len(faults.AXIS_FAULTS)
"""Bits of a code of adu/state from len(STATE_TEXTS) on: a fault is latched; an emergency stop is latched; first bits
of the fault words of azimuth and elevation."""

STANDSTILL_RATE_RAD_S = 1e-3  # load rate below which an axis counts as standing [rad/s]


class State(Protocol):
    """Part of drive_unit.State that this module reads and changes."""
    azimuth: axis.State
    elevation: axis.State
    phase: int
    age: int
    wanted: Bit
    emergency: Bit
    applied: Bit
    brake_age: int
    pins: stow_pins.State


class Constants(Protocol):
    """Part of drive_unit.Constants that this module reads."""
    azimuth: axis.Constants
    elevation: axis.Constants
    pins: stow_pins.Constants
    engage_periods: int
    release_periods: int
    stop_periods: int


@compiled
def tripped(state: State) -> bool:
    """Return True if an axis has a fault that stops the drive."""
    return faults.stops(state.azimuth.faults) or faults.stops(state.elevation.faults)


@compiled
def permitted(state: State) -> Bit:
    """Return True if the drive may follow commands."""
    return state.wanted and not state.emergency and not tripped(state) and stow_pins.pins_out(state.pins)


@compiled
def condition(state: State) -> int:
    """Return the code of adu/state. It changes with every change of `state_text`.

    Codes 0 to 3 are topics.ENABLED_STATES: bit 0 and bit 1 stand for an azimuth and an elevation with one motor.
    Higher codes below len(STATE_TEXTS) are phases or the emergency stop. Codes from len(STATE_TEXTS) on hold the fault
    words of both axes.
    """
    if tripped(state):
        return (FAULT_BIT | (EMERGENCY_STOP_BIT if state.emergency else 0)
                | state.azimuth.faults << AZIMUTH_FAULTS_SHIFT | state.elevation.faults << ELEVATION_FAULTS_SHIFT)
    if state.emergency:
        return STATE_CODE_EMERGENCY_STOP
    if state.phase == PHASE_ENABLED and permitted(state):
        return ((1 if state.azimuth.faults & faults.MOTORS_LOST_BITS else 0)
                | (2 if state.elevation.faults & faults.MOTORS_LOST_BITS else 0))
    if permitted(state):
        return PHASE_CODE_OFFSET + (PHASE_RELEASING_BRAKES if state.phase == PHASE_DISABLED else state.phase)
    return PHASE_CODE_OFFSET + (PHASE_STOPPING if state.phase == PHASE_ENABLED else state.phase)


def state_text(condition: int) -> str:
    """Return the text of a code of adu/state: 'enabled' with any lost motor, or the reason why the drive is not."""
    if condition < len(STATE_TEXTS):
        return STATE_TEXTS[condition]
    tripped = [f'{axis} {kind}' for axis, shift in (('azimuth', AZIMUTH_FAULTS_SHIFT),
                                                    ('elevation', ELEVATION_FAULTS_SHIFT))
               for kind in faults.names(condition >> shift & faults.ALL_FAULT_BITS)]
    return ('emergency stop; ' if condition & EMERGENCY_STOP_BIT else '') + 'fault: ' + ', '.join(tripped)


@compiled
def is_moving(axis: axis.State, constants: axis.Constants) -> bool:
    """Return True if an axis turns by its motor encoders."""
    return abs(axis.motor_1.measured + axis.motor_2.measured) * constants.per_2N > STANDSTILL_RATE_RAD_S


@compiled
def _next(state: State, constants: Constants, ready: bool) -> int:
    """Return the phase of the next period. ready: True if the amplifiers of the motors are on."""
    allowed = permitted(state)
    if faults.removes_torque(state.azimuth.faults) or faults.removes_torque(state.elevation.faults):
        return PHASE_DISABLED
    if state.phase == PHASE_ENABLED:
        return PHASE_ENABLED if allowed else PHASE_STOPPING
    if state.phase == PHASE_STOPPING:
        if state.age >= constants.stop_periods:
            return PHASE_DISABLED
        turning = state.azimuth.rate != 0.0 or state.elevation.rate != 0.0
        turning |= is_moving(state.azimuth, constants.azimuth) or is_moving(state.elevation, constants.elevation)
        return PHASE_STOPPING if turning else PHASE_ENGAGING_BRAKES
    if state.phase == PHASE_ENGAGING_BRAKES:
        return PHASE_DISABLED if state.brake_age >= constants.engage_periods else PHASE_ENGAGING_BRAKES
    if state.phase == PHASE_DISABLED:
        return PHASE_RELEASING_BRAKES if allowed else PHASE_DISABLED
    if not allowed:
        return PHASE_ENGAGING_BRAKES
    return PHASE_ENABLED if ready and state.brake_age >= constants.release_periods else PHASE_RELEASING_BRAKES


@compiled
def _advance_pins(state: State, constants: Constants, wanted: int) -> None:
    """Advance the stow pins by a period. They move while the drive is disabled. wanted: code of acu/stow_pins."""
    az, el, c = state.azimuth, state.elevation, constants
    stow_pins.command_pins(state.pins, c.pins, wanted,
                           math.nan if is_moving(az, c.azimuth) else c.azimuth.rad * az.reading,
                           math.nan if is_moving(el, c.elevation) else c.elevation.rad * el.reading)
    if state.phase == PHASE_DISABLED and not state.emergency:
        az.faults |= stow_pins.advance(state.pins, c.pins, 0)
        el.faults |= stow_pins.advance(state.pins, c.pins, 1)


@compiled
def advance(state: State, constants: Constants, pins: int, ready: bool) -> bool:
    """Advance the phase by a control period. Return True if the brakes grip.

    pins: code of acu/stow_pins; ready: True if the amplifiers of the motors are on.
    """
    if constants.pins.fitted:
        _advance_pins(state, constants, pins)
    phase = _next(state, constants, ready)
    state.age = state.age + 1 if phase == state.phase else 0
    state.phase = phase
    applied = phase == PHASE_DISABLED or phase == PHASE_ENGAGING_BRAKES
    state.brake_age = state.brake_age + 1 if applied == state.applied else 0
    state.applied = applied
    return state.brake_age >= constants.engage_periods if applied else state.brake_age < constants.release_periods


@compiled
def request(state: State, constants: Constants, what: int) -> int:
    """Execute a request between two periods. Return REPLY_ACCEPTED or the code of a refusal.

    what: a code of REQUEST_CODES. The request takes effect in the next period. Faults and emergency stop can be reset
    while both axes stand and no cause is present. A reset enables the drive again if it was enabled before.
    """
    if what == REQUEST_DISABLE:
        state.wanted = 0
    elif what == REQUEST_EMERGENCY_STOP:
        state.emergency = 1
    elif what == REQUEST_ENABLE:
        if tripped(state):
            return REPLY_FAULT_LATCHED
        if state.emergency:
            return REPLY_EMERGENCY_LATCHED
        state.wanted = 1
    else:
        if is_moving(state.azimuth, constants.azimuth) or is_moving(state.elevation, constants.elevation):
            return REPLY_AXES_MOVING
        if state.azimuth.present | state.elevation.present:
            return REPLY_CAUSE_PERSISTS
        state.azimuth.faults = state.elevation.faults = state.emergency = 0
        stow_pins.retry(state.pins)
    return REPLY_ACCEPTED
