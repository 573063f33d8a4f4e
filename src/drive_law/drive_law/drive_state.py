"""Drive of two axes: its records, its commands, and one state machine for enable, brakes and faults of both axes.

    enabled -> stopping -> engaging brakes -> disabled -> releasing brakes -> enabled

A request enables the drive if no fault and no emergency stop is latched and the stow pins are out. To become disabled,
the drive stops under control, applies the brakes while the motors still hold, and then removes the torque. The stow
pins may move only in the phase `disabled`. Overcurrent, and a stop that takes too long, remove the torque and apply
the brakes at once.
"""
import math
from typing import Annotated

from drive_law import axis_control, faults, stow_pins
from drive_law.params import AduParameters, whole_speed_periods
from pedestal_common.compiled import compiled
from pedestal_common.graph import nodes, topics
from pedestal_common.quantities import Bit, Floats, Ints, NewtonMeters, RadiansPerSecond, Records, Seconds
from pedestal_common.record import Record

PHASES = ('enabled', 'stopping', 'engaging brakes', 'disabled', 'releasing brakes')
PHASE_ENABLED, PHASE_STOPPING, PHASE_ENGAGING_BRAKES, PHASE_DISABLED, PHASE_RELEASING_BRAKES = range(len(PHASES))

REQUEST_ENABLE, REQUEST_DISABLE, REQUEST_EMERGENCY_STOP, REQUEST_RESET_FAULTS = range(4)
REQUEST_CODES = {service: code for code, service in enumerate(nodes.DRIVE_SERVICES)}
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


COMMAND_RING_SIZE = 256
"""Number of commands in the ring of the transport delay.

It exceeds the 200 commands of a configured and an injected delay, each of MAX_TRANSPORT_DELAY_S, at the
shortest period of 1 ms.
"""

INITIAL_AGE_PERIODS = 1 << 40
"""Initial number of periods since the last change of the brakes: longer ago than any time of a brake or a delay."""

MAX_PLAUSIBLE_INPUT, MAX_PLAUSIBLE_TORQUE_NM = 1e6, 1e9
"""Largest valid input [rad/s, rad/s2], and torque; an input beyond it, infinite or NaN is invalid. The torque that
moves a dish of 25 m is above 1e6 Nm."""


class AxisInputs(Record):
    """Command to an axis."""
    rate: RadiansPerSecond
    torque: NewtonMeters        # feed-forward torque of both motors on the load axis


class Inputs(Record):
    """Inputs of a period."""
    azimuth: AxisInputs
    elevation: AxisInputs
    enable: Bit                 # 1: follow the command; 0: controlled stop, which begins without the transport delay
    pins: int                   # code of acu/stow_pins: command to the stow pins


class Outputs(Record):
    """Outputs at t_k+1."""
    azimuth: axis_control.Outputs
    elevation: axis_control.Outputs
    # 1 if an input of this call was invalid; the command is then taken as enable 0, a disturbance as 0
    invalid_command: Bit
    phase: int                  # index of PHASES
    following: Bit              # 1 if enabled and permitted at t_k+1
    wanted: Bit                 # 0 after a request to disable
    emergency: Bit              # 1 while an emergency stop is latched
    braked: Bit                 # 1 while the brakes grip
    condition: int              # see `condition`
    pins: int                   # see stow_pins.state_code


class Constants(Record):
    """Constants of the drive; X_ticks: in periods of the speed loops, X_periods: in control periods."""
    azimuth: axis_control.Constants
    elevation: axis_control.Constants
    pins: stow_pins.Constants
    period: Seconds             # T
    speed_ticks: int            # the control period
    delay_ticks: int            # transport delay
    engage_periods: int         # times of the brakes
    release_periods: int
    stop_periods: int           # longest controlled stop


class State(Record):
    """State of the drive. `State.dtype` is one object, which all state records share. A record with an equal copy
    would cost 3 us in each call, because numba then compares the copy field by field."""
    azimuth: axis_control.State
    elevation: axis_control.State
    rate: Annotated[Floats, (COMMAND_RING_SIZE, 2)]     # ring of the commands: rates [rad/s]
    torque: Annotated[Floats, (COMMAND_RING_SIZE, 2)]   # feed-forward torques [Nm]
    enable: Annotated[Ints, (COMMAND_RING_SIZE,)]       # inputs `enable`
    k: int                      # number of the period
    phase: int                  # phase, wanted, emergency, following: see Outputs
    age: int                    # periods since the last change of the phase
    wanted: Bit
    emergency: Bit
    tick: int                   # speed-loop period whose command is in force
    late_ticks: int             # injected delay in speed-loop periods
    applied: Bit                # 1 while the brakes are commanded on
    brake_age: int              # periods since the last change of the command to the brakes
    braked: Bit                 # 1 while the brakes grip
    following: Bit
    pins: stow_pins.State


def constants(params: AduParameters) -> dict[str, float | Records]:
    """Return the values of Constants without those of the axes."""
    return {'pins': stow_pins.constants(params), 'period': params.period,
            'speed_ticks': whole_speed_periods('period', params.period),
            'delay_ticks': whole_speed_periods('transport_delay', params.transport_delay),
            **{f'{name}_periods': math.ceil(getattr(params.brakes, f'{name}_time') / params.period - 1e-6)
               for name in ('engage', 'release', 'stop')}}


def initial_state(params: AduParameters) -> dict[str, float | Records]:
    """Return the values of State without those of the axes."""
    enabled = params.initially_enabled and not (params.stow_pins and params.pins.initially_in)
    return {'enable': 1, 'phase': PHASE_ENABLED if enabled else PHASE_DISABLED, 'wanted': params.initially_enabled,
            'tick': -INITIAL_AGE_PERIODS, 'applied': not enabled, 'brake_age': INITIAL_AGE_PERIODS,
            'braked': not enabled, 'pins': stow_pins.initial_state(params)}


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
def is_moving(axis: axis_control.State, constants: axis_control.Constants) -> bool:
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
    """Advance the stow pins by a period. They move while the drive is disabled."""
    az, el, c = state.azimuth, state.elevation, constants
    stow_pins.command_pins(state.pins, c.pins, wanted,
                           math.nan if is_moving(az, c.azimuth) else c.azimuth.rad * az.reading,
                           math.nan if is_moving(el, c.elevation) else c.elevation.rad * el.reading)
    if state.phase == PHASE_DISABLED and not state.emergency:
        az.faults |= stow_pins.advance(state.pins, c.pins, 0)
        el.faults |= stow_pins.advance(state.pins, c.pins, 1)


@compiled
def advance(state: State, constants: Constants, pins: int, ready: bool) -> bool:
    """Advance the phase by a control period. Return True if the brakes grip. pins: code of acu/stow_pins; ready: True
    if the amplifiers of the motors are on."""
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

    The request takes effect in the next period. Faults and emergency stop can be reset while both axes stand and no
    cause is present. A reset enables the drive again if it was enabled before.
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


@compiled
def plausible(x: float) -> bool:
    """Return True if an input is valid, as MAX_PLAUSIBLE_INPUT states; NaN is invalid."""
    return abs(x) <= MAX_PLAUSIBLE_INPUT


@compiled
def plausible_torque(x: NewtonMeters) -> bool:
    """Return True if a torque is valid, as MAX_PLAUSIBLE_TORQUE_NM states; NaN is invalid."""
    return abs(x) <= MAX_PLAUSIBLE_TORQUE_NM


@compiled
def receive_command(state: State, inputs: Inputs, disturbance_valid: bool) -> bool:
    """Put the command of step k into the ring. Return True if command and disturbance are valid."""
    slot = state.k % COMMAND_RING_SIZE
    valid = (disturbance_valid and plausible(inputs.azimuth.rate) and plausible_torque(inputs.azimuth.torque)
             and plausible(inputs.elevation.rate) and plausible_torque(inputs.elevation.torque))
    state.enable[slot] = 1 if valid and inputs.enable == 1 else 0
    if valid:
        state.rate[slot, 0], state.rate[slot, 1] = inputs.azimuth.rate, inputs.elevation.rate
        state.torque[slot, 0], state.torque[slot, 1] = inputs.azimuth.torque, inputs.elevation.torque
    return valid


@compiled
def apply_command(state: State, constants: Constants, inputs: Inputs, j: int) -> None:
    """Take the command of speed-loop period j out of the ring, and set state.following."""
    # While an injected delay begins, `max` repeats the last command. Before the first command, a slot has rate 0.
    state.tick = max(state.tick, state.k * constants.speed_ticks + j - constants.delay_ticks - state.late_ticks)
    slot = (state.tick // constants.speed_ticks) % COMMAND_RING_SIZE
    state.following = state.enable[slot] if state.phase == PHASE_ENABLED and inputs.enable == 1 else 0
    az, el = state.azimuth, state.elevation
    az.commanded_rate, az.commanded_torque = state.rate[slot, 0], state.torque[slot, 0]
    el.commanded_rate, el.commanded_torque = state.rate[slot, 1], state.torque[slot, 1]


@compiled
def read(state: State, constants: Constants, outputs: Outputs) -> None:
    """Write the present outputs, without those of the axes."""
    outputs.phase, outputs.wanted = state.phase, state.wanted
    outputs.emergency, outputs.braked = state.emergency, state.braked
    outputs.following = state.phase == PHASE_ENABLED and permitted(state)
    outputs.condition, outputs.pins = condition(state), stow_pins.state_code(state.pins, constants.pins)
