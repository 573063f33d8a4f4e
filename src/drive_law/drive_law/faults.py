"""Faults that a drive detects by its own measurements. A fault is latched until its reset (drive_state.request)."""
from typing import NamedTuple

from pedestal_common.codes import bits
from pedestal_common.compiled import inlined
from pedestal_common.quantities import Ints, NewtonMeters, Radians, RadiansPerSecond
from pedestal_common.record import Record


class Fault(NamedTuple):
    """A fault of an axis."""
    name: str
    doc: str                        # its condition
    parameters: tuple[str, ...]     # those of its limits
    stops: bool = True              # True if the drive stops on it


AXIS_FAULTS = (
    Fault('overcurrent',
          'a phase current of a motor is above the limit; torque off at once, brakes on', ('faults.overcurrent',)),
    Fault('overspeed', 'the motor speed, divided by the gear ratio, is above the limit', ('faults.overspeed',)),
    Fault('encoder disagreement',
          'the load encoder differs from the mean of the motor encoders by more than the limit',
          ('faults.encoder_disagreement',)),
    Fault('following error',
          'the measured rate differs from the commanded rate by more than `faults.following_error` for longer than '
          '`faults.following_time`',
          ('faults.following_error', 'faults.following_time')),
    Fault('overtemperature', 'the thermal load (I2t) of a motor is above the limit (1: steady state at rated '
          'torque); reset possible below 0.8',
          ('faults.overtemperature', 'thermal')),
    *(Fault(f'motor {lost} lost', f'the amplifier of motor {lost} reports that it is off; motor {other} continues '
            'alone, without bias torque. If both motors are lost: torque off, brakes on', (), stops=False)
      for lost, other in ((1, 2), (2, 1))),
    Fault('final limit', 'the axis moves outwards on the switch beyond the end of travel, which is independent of the '
          'encoders; torque off at once, brakes on; after a reset the drive moves the axis back', ('limits.final',)),
    Fault('emergency limit', 'the axis is on the switch beyond the final switch; torque off at once, brakes on. A '
          'reset is not possible there; the axis must be moved back by hand', ('limits.emergency',)),
    Fault('stow pin', 'a stow pin did not reach its position within `pins.timeout`', ('pins.timeout',)),
)
"""Faults of an axis; bit i of a fault word is AXIS_FAULTS[i]."""

WARNING_THERMAL_LOAD = 0.8
"""Thermal load of a motor above which the drive reports a warning, and below which overtemperature ends."""

Bit = bits([fault.name for fault in AXIS_FAULTS])
MOTORS_LOST_BITS = Bit.MOTOR_1_LOST | Bit.MOTOR_2_LOST
ALL_FAULT_BITS = (1 << len(AXIS_FAULTS)) - 1
# _TORQUE_OFF_BITS: the motors cannot or must not stop the axis, so the brakes do. _STOP_BITS: the drive stops.
_TORQUE_OFF_BITS = Bit.OVERCURRENT | Bit.FINAL_LIMIT | Bit.EMERGENCY_LIMIT
_STOP_BITS = sum(1 << i for i, fault in enumerate(AXIS_FAULTS) if fault.stops)


class Limits(Record):
    """Trip levels and places of the switches of an axis."""
    current_2: float                # square of the overcurrent [A2]
    omega: RadiansPerSecond         # overspeed of a motor
    disagreement: Radians
    error: RadiansPerSecond         # following error, of a motor
    late_periods: int               # number of periods of the speed loop with this error
    heat: float                     # thermal load
    final_low: Radians              # places of the final and of the emergency switches
    final_high: Radians
    emergency_low: Radians
    emergency_high: Radians


def names(bits: int) -> tuple[str, ...]:
    """Return the names of the faults in a fault word."""
    return tuple(fault.name for i, fault in enumerate(AXIS_FAULTS) if int(bits) >> i & 1)


MIN_OUTWARD_RATE_RAD_S = 1e-3  # smallest rate of an axis that counts as outward motion beyond its end [rad/s]


@inlined
def thermal_load(x: float, torque: NewtonMeters, per_rated: float, gain: float) -> float:
    """Return the thermal load one period h later, as in the I2t protection; torque and current are proportional:

        tau dx/dt = (T / T_rated)^2 - x        x = 1: steady state at rated torque

    per_rated = 1 / T_rated; gain = 1 - exp(-h / tau).
    """
    relative = torque * per_rated
    return x + gain * (relative * relative - x)


@inlined
def stops(bits: int) -> bool:
    """Return True if the drive stops on the faults of an axis."""
    return bits & _STOP_BITS != 0 or bits & MOTORS_LOST_BITS == MOTORS_LOST_BITS


@inlined
def removes_torque(bits: int) -> bool:
    """Return True if an axis cannot be stopped under control: torque off, brakes on at once."""
    return bits & _TORQUE_OFF_BITS != 0 or bits & MOTORS_LOST_BITS == MOTORS_LOST_BITS


@inlined
def late(periods: int, error: RadiansPerSecond, limit: RadiansPerSecond) -> int:
    """Return the number of successive periods with a rate error beyond its limit."""
    return periods + 1 if abs(error) > limit else 0


@inlined
def lost_motor_faults(motors: Ints) -> int:
    """Return the fault word of the motors (2,) whose amplifiers are off."""
    return (Bit.MOTOR_1_LOST if motors[0] else 0) | (Bit.MOTOR_2_LOST if motors[1] else 0)


@inlined
def end_switch_faults(theta: Radians, omega: RadiansPerSecond, limits: Limits) -> int:
    """Return the fault word of the switches beyond the ends of travel."""
    bits = 0
    if (theta > limits.final_high and omega > MIN_OUTWARD_RATE_RAD_S
            or theta < limits.final_low and omega < -MIN_OUTWARD_RATE_RAD_S):
        bits |= Bit.FINAL_LIMIT
    if theta > limits.emergency_high or theta < limits.emergency_low:
        bits |= Bit.EMERGENCY_LIMIT
    return bits


@inlined
def measured_faults(current_2: float, omega: RadiansPerSecond, disagreement: Radians, late_periods: int, heat: float,
                    latched: int, limits: Limits) -> int:
    """Return the fault word of one period of one axis.

    current_2      larger square of a motor current [A2]
    omega          larger absolute motor speed
    disagreement   load encoder minus mean motor encoder divided by the ratio
    late_periods   result of `late`
    heat           larger thermal load of a motor; a latched overtemperature ends below WARNING_THERMAL_LOAD
    latched        fault word of the axis before this period
    """
    bits = 0
    if current_2 > limits.current_2:
        bits |= Bit.OVERCURRENT
    if omega > limits.omega:
        bits |= Bit.OVERSPEED
    if abs(disagreement) > limits.disagreement:
        bits |= Bit.ENCODER_DISAGREEMENT
    if late_periods >= limits.late_periods:
        bits |= Bit.FOLLOWING_ERROR
    if heat > (min(WARNING_THERMAL_LOAD, limits.heat) if latched & Bit.OVERTEMPERATURE else limits.heat):
        bits |= Bit.OVERTEMPERATURE
    return bits
