"""Enable, brakes and faults of the drive: one state machine for both axes, advanced once per control period.

    enabled -> stopping -> engaging brakes -> disabled -> releasing brakes -> enabled

The drive wants to be enabled while it is asked to be, no fault and no emergency stop is latched. It stops under
control, lets the brakes grip while the motors still hold, and only then takes their torque away. Overcurrent, and a
stop that takes too long, take the torque away at once and let the brakes fall in.
"""
from adu_drive.faults import ALL, FAULTS, OVERCURRENT, names
from pedestal_common.compiled import compiled

PHASES = ('enabled', 'stopping', 'engaging brakes', 'disabled', 'releasing brakes')
ENABLED, STOPPING, ENGAGING, DISABLED, RELEASING = range(len(PHASES))

ENABLE, DISABLE, EMERGENCY_STOP, RESET_FAULTS = range(4)
REQUESTS = {'adu/enable': ENABLE, 'adu/disable': DISABLE, 'adu/emergency_stop': EMERGENCY_STOP,
            'adu/reset_faults': RESET_FAULTS}
"""What can be asked for, by the name of its service."""

GRANTED, FAULT_LATCHED, EMERGENCY_LATCHED, MOVING, CAUSE_PERSISTS = range(5)
REFUSALS = {
    FAULT_LATCHED: 'a fault is latched (adu/reset_faults)',
    EMERGENCY_LATCHED: 'an emergency stop is latched (adu/reset_faults)',
    MOVING: 'the axes still move',
    CAUSE_PERSISTS: 'the cause is still there'}
"""Answers to a request, and why it is not granted."""

PHASE, PREVENTED, EMERGENCY = 7, 8, 16
AZIMUTH_FAULTS = 5
ELEVATION_FAULTS = AZIMUTH_FAULTS + len(FAULTS)
"""Bits of the code of adu/state: phase, whether following is not permitted, emergency stop, fault words."""

STANDSTILL = 1e-3
"""Load rate [rad/s] below which an axis stands."""


@compiled
def permitted(s):
    """Whether the drive may follow commands."""
    return s.wanted and not s.emergency and not (s.azimuth.faults | s.elevation.faults)


@compiled
def condition(s):
    """Code of adu/state, 0 for 'enabled': all that `described` tells, in one number, so that it changes when something
    of it does."""
    return (s.phase | (0 if permitted(s) else PREVENTED) | (EMERGENCY if s.emergency else 0)
            | s.azimuth.faults << AZIMUTH_FAULTS | s.elevation.faults << ELEVATION_FAULTS)


def described(condition):
    """'enabled' when the drive follows commands, otherwise why it does not."""
    phase = condition & PHASE
    if not condition & PREVENTED:
        return PHASES[RELEASING if phase == DISABLED else phase]
    tripped = [f'{axis} {kind}' for axis, shift in (('azimuth', AZIMUTH_FAULTS), ('elevation', ELEVATION_FAULTS))
               for kind in names(condition >> shift & ALL)]
    why = ['emergency stop'] if condition & EMERGENCY else []
    if tripped:
        why.append('fault: ' + ', '.join(tripped))
    if why:
        return '; '.join(why)
    return PHASES[STOPPING if phase == ENABLED else phase]


@compiled
def moves(axis, c):
    """Whether an axis turns, by its motor encoders."""
    return abs(axis.motor_1.measured + axis.motor_2.measured) * c.per_2N > STANDSTILL


@compiled
def _next(s, c):
    allowed = permitted(s)
    if (s.azimuth.faults | s.elevation.faults) & OVERCURRENT:
        return DISABLED
    if s.phase == ENABLED:
        return ENABLED if allowed else STOPPING
    if s.phase == STOPPING:
        if s.age >= c.stop_periods:
            return DISABLED
        turning = s.azimuth.rate != 0.0 or s.elevation.rate != 0.0
        turning |= moves(s.azimuth, c.azimuth) or moves(s.elevation, c.elevation)
        return STOPPING if turning else ENGAGING
    if s.phase == ENGAGING:
        return DISABLED if s.brake_age >= c.engage_periods else ENGAGING
    if s.phase == DISABLED:
        return RELEASING if allowed else DISABLED
    if not allowed:
        return ENGAGING
    return ENABLED if s.brake_age >= c.release_periods else RELEASING


@compiled
def advance(s, c):
    """One control period: the phase, and whether the brakes grip in it."""
    phase = _next(s, c)
    s.age = s.age + 1 if phase == s.phase else 0
    s.phase = phase
    applied = phase == DISABLED or phase == ENGAGING
    s.brake_age = s.brake_age + 1 if applied == s.applied else 0
    s.applied = applied
    return s.brake_age >= c.engage_periods if applied else s.brake_age < c.release_periods


@compiled
def request(s, c, what):
    """Ask something of the drive between two periods: GRANTED, or why not. It acts in the next period.

    Faults and emergency stop can be reset when both axes stand and no cause is present; the drive is then enabled
    again by itself if it was before.
    """
    if what == DISABLE:
        s.wanted = 0
    elif what == EMERGENCY_STOP:
        s.emergency = 1
    elif what == ENABLE:
        if s.azimuth.faults | s.elevation.faults:
            return FAULT_LATCHED
        if s.emergency:
            return EMERGENCY_LATCHED
        s.wanted = 1
    else:
        if moves(s.azimuth, c.azimuth) or moves(s.elevation, c.elevation):
            return MOVING
        if s.azimuth.present | s.elevation.present:
            return CAUSE_PERSISTS
        s.azimuth.faults = s.elevation.faults = s.emergency = 0
    return GRANTED
