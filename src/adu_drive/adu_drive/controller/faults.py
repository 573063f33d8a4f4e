"""What a drive trips on, from what it measures itself. A fault stays until it is reset (drive_state.request)."""
import typing

from adu_drive.plant import thermal
from pedestal_common.codes import bits
from pedestal_common.compiled import inlined


class Fault(typing.NamedTuple):
    """A fault of an axis: its name, what it is told by, the parameters of an axis that say when; stops: whether the
    drive stops on it."""
    name: str
    doc: str
    parameters: tuple
    stops: bool = True


AXIS_FAULTS = (
    Fault('overcurrent', 'phase current of a motor; torque off at once, the brakes fall in', ('faults.overcurrent',)),
    Fault('overspeed', 'speed of a motor over the gear ratio', ('faults.overspeed',)),
    Fault('encoder disagreement', 'load encoder against the mean of the motor encoders',
          ('faults.encoder_disagreement',)),
    Fault('following error', 'rate wanted against rate measured, for longer than `faults.following_time`',
          ('faults.following_error', 'faults.following_time')),
    Fault('overtemperature', 'I2t of a motor, 1 after rated torque for ever; gone below 0.8',
          ('faults.overtemperature', 'thermal')),
    *(Fault(f'motor {i} lost', 'its amplifier reports that it makes no torque; the other motor goes on alone, without '
            'bias; without either the brakes fall in', (), stops=False) for i in (1, 2)),
    Fault('final limit', 'switch behind the end of travel, whatever the encoders say, while the axis moves outwards; '
          'torque off at once, the brakes fall in; once it is reset the drive leads back', ('limits.final',)),
    Fault('emergency limit', 'switch behind the final one; as that, but it is not reset there: the axis is led back '
          'by hand', ('limits.emergency',)),
    Fault('stow pin', 'a stow pin is not where it was sent within `pins.timeout`', ('pins.timeout',)),
)
"""Bit i of a fault word stands for AXIS_FAULTS[i]."""
Bit = bits([fault.name for fault in AXIS_FAULTS])
MOTORS_LOST_BITS = Bit.MOTOR_1_LOST | Bit.MOTOR_2_LOST
ALL_FAULT_BITS = (1 << len(AXIS_FAULTS)) - 1
_TORQUE_OFF_BITS = Bit.OVERCURRENT | Bit.FINAL_LIMIT | Bit.EMERGENCY_LIMIT
_STOP_BITS = sum(1 << i for i, fault in enumerate(AXIS_FAULTS) if fault.stops)


def names(bits):
    """The names of the faults in a fault word, a tuple."""
    return tuple(fault.name for i, fault in enumerate(AXIS_FAULTS) if int(bits) >> i & 1)


MIN_OUTWARD_RATE_RAD_S = 1e-3
"""Rate [rad/s] from which an axis moves further behind its end."""


@inlined
def stops(bits):
    """Whether the drive stops on the faults of an axis."""
    return bits & _STOP_BITS != 0 or bits & MOTORS_LOST_BITS == MOTORS_LOST_BITS


@inlined
def removes_torque(bits):
    """Whether nothing is left to stop an axis under control: the brakes fall in at once."""
    return bits & _TORQUE_OFF_BITS != 0 or bits & MOTORS_LOST_BITS == MOTORS_LOST_BITS


@inlined
def late(periods, error, limit):
    """Periods in a row in which the rate error [rad/s] was beyond its limit."""
    return periods + 1 if abs(error) > limit else 0


@inlined
def lost_motor_faults(motors):
    """Fault word of the motors (2,) whose amplifiers are off."""
    return (Bit.MOTOR_1_LOST if motors[0] else 0) | (Bit.MOTOR_2_LOST if motors[1] else 0)


@inlined
def end_switch_faults(theta, omega, c):
    """Fault word of the switches behind the ends of travel, with the load at theta [rad] at a rate omega [rad/s]."""
    bits = 0
    if theta > c.final_high and omega > MIN_OUTWARD_RATE_RAD_S or theta < c.final_low and omega < -MIN_OUTWARD_RATE_RAD_S:
        bits |= Bit.FINAL_LIMIT
    if theta > c.emergency_high or theta < c.emergency_low:
        bits |= Bit.EMERGENCY_LIMIT
    return bits


@inlined
def measured_faults(current_2, omega, disagreement, late_periods, heat, latched, c):
    """Fault word of one period of one axis; c its trip levels (see params.FaultParameters).

    current_2: larger square of a motor's current [A2]; omega: larger motor speed [rad/s]; disagreement: load encoder
    less mean motor encoder over the ratio [rad]; heat: larger thermal load of a motor, which must fall below
    thermal.WARM to be gone once it is latched.
    """
    bits = 0
    if current_2 > c.current_2:
        bits |= Bit.OVERCURRENT
    if omega > c.omega:
        bits |= Bit.OVERSPEED
    if abs(disagreement) > c.disagreement:
        bits |= Bit.ENCODER_DISAGREEMENT
    if late_periods >= c.late_periods:
        bits |= Bit.FOLLOWING_ERROR
    if heat > (min(thermal.WARNING_THERMAL_LOAD, c.heat) if latched & Bit.OVERTEMPERATURE else c.heat):
        bits |= Bit.OVERTEMPERATURE
    return bits
