"""What a drive trips on, from what it measures itself. A fault stays until it is reset (drive_state.request)."""
from adu_drive import thermal
from pedestal_common.compiled import compiled

KINDS = ('overcurrent', 'overspeed', 'encoder disagreement', 'following error', 'overtemperature')
"""Bit i of a fault word stands for KINDS[i]."""
OVERCURRENT, OVERSPEED, DISAGREEMENT, FOLLOWING, OVERTEMPERATURE = (1 << i for i in range(len(KINDS)))
ALL = (1 << len(KINDS)) - 1


def names(bits):
    """The kinds in a fault word, as a tuple."""
    return tuple(kind for i, kind in enumerate(KINDS) if int(bits) >> i & 1)


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
