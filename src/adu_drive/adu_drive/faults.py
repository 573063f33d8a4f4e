"""What a drive trips on, from what it measures itself. A fault stays until it is reset (drive_state.request)."""
import typing

from adu_drive import thermal
from pedestal_common.compiled import compiled


class Fault(typing.NamedTuple):
    """A fault of an axis: its name, what it is told by, the parameters of an axis that say when."""
    name: str
    doc: str
    parameters: tuple


FAULTS = (
    Fault('overcurrent', 'phase current of a motor; torque off at once, the brakes fall in', ('faults.overcurrent',)),
    Fault('overspeed', 'speed of a motor over the gear ratio', ('faults.overspeed',)),
    Fault('encoder disagreement', 'load encoder against the mean of the motor encoders',
          ('faults.encoder_disagreement',)),
    Fault('following error', 'rate wanted against rate measured, for longer than `faults.following_time`',
          ('faults.following_error', 'faults.following_time')),
    Fault('overtemperature', 'I2t of a motor, 1 after rated torque for ever; gone below 0.8',
          ('faults.overtemperature', 'thermal')),
)
"""Bit i of a fault word stands for FAULTS[i]."""
OVERCURRENT, OVERSPEED, DISAGREEMENT, FOLLOWING, OVERTEMPERATURE = (1 << i for i in range(len(FAULTS)))
ALL = (1 << len(FAULTS)) - 1


def names(bits):
    """The names of the faults in a fault word, a tuple."""
    return tuple(fault.name for i, fault in enumerate(FAULTS) if int(bits) >> i & 1)


@compiled
def late(periods, error, limit):
    """Periods in a row in which the rate error [rad/s] was beyond its limit."""
    return periods + 1 if abs(error) > limit else 0


@compiled
def detected(current_2, omega, disagreement, late_periods, heat, latched, c):
    """Fault word of one period of one axis; c its trip levels (see params.FaultParameters).

    current_2: larger square of a motor's current [A2]; omega: larger motor speed [rad/s]; disagreement: load encoder
    less mean motor encoder over the ratio [rad]; heat: larger thermal load of a motor, which must fall below
    thermal.WARM to be gone once it is latched.
    """
    bits = 0
    if current_2 > c.current_2:
        bits |= OVERCURRENT
    if omega > c.omega:
        bits |= OVERSPEED
    if abs(disagreement) > c.disagreement:
        bits |= DISAGREEMENT
    if late_periods >= c.late_periods:
        bits |= FOLLOWING
    if heat > (min(thermal.WARM, c.heat) if latched & OVERTEMPERATURE else c.heat):
        bits |= OVERTEMPERATURE
    return bits
