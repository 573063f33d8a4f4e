"""Enable, brakes and faults of the drive: one state machine for both axes, advanced once per control period.

    enabled -> stopping -> engaging brakes -> disabled -> releasing brakes -> enabled

The drive wants to be enabled while it is asked to be, no fault and no emergency stop is latched and the stow pins are
out. It stops under control, lets the brakes grip while the motors still hold, and only then takes their torque away;
then stow pins may move. Overcurrent, and a stop that takes too long, take the torque away at once and let the brakes
fall in.
"""
import math

from adu_drive import stow_pins
from adu_drive.controller import faults
from pedestal_common.compiled import compiled
from pedestal_common.graph import topics

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

TOLD = topics.BY_NAME['adu/state'].texts
STOPPED = TOLD.index('emergency stop')
FIRST_PHASE = TOLD.index(PHASES[STOPPING]) - STOPPING
"""Codes of adu/state below len(TOLD) are places in it: which motors are lost while it is enabled, then the phases."""

FAULTY, EMERGENCY = 16, 32
AZIMUTH_FAULTS = 6
ELEVATION_FAULTS = AZIMUTH_FAULTS + len(faults.FAULTS)
"""Bits of the other codes: that there are faults, emergency stop, fault words."""

STANDSTILL = 1e-3
"""Load rate [rad/s] below which an axis stands."""


@compiled
def tripped(s):
    """Whether an axis has a fault that stops the drive."""
    return faults.stops(s.azimuth.faults) or faults.stops(s.elevation.faults)


@compiled
def permitted(s):
    """Whether the drive may follow commands."""
    return s.wanted and not s.emergency and not tripped(s) and stow_pins.clear(s.pins)


@compiled
def condition(s):
    """Code of adu/state, 0 for 'enabled': all that `described` tells, in one number, so that it changes when something
    of it does."""
    if tripped(s):
        return (FAULTY | (EMERGENCY if s.emergency else 0)
                | s.azimuth.faults << AZIMUTH_FAULTS | s.elevation.faults << ELEVATION_FAULTS)
    if s.emergency:
        return STOPPED
    if s.phase == ENABLED and permitted(s):
        return ((1 if s.azimuth.faults & faults.MOTORS_LOST else 0)
                | (2 if s.elevation.faults & faults.MOTORS_LOST else 0))
    if permitted(s):
        return FIRST_PHASE + (RELEASING if s.phase == DISABLED else s.phase)
    return FIRST_PHASE + (STOPPING if s.phase == ENABLED else s.phase)


def described(condition):
    """'enabled' when the drive follows commands, with what it lacks; otherwise why it does not."""
    if condition < len(TOLD):
        return TOLD[condition]
    tripped = [f'{axis} {kind}' for axis, shift in (('azimuth', AZIMUTH_FAULTS), ('elevation', ELEVATION_FAULTS))
               for kind in faults.names(condition >> shift & faults.ALL)]
    return ('emergency stop; ' if condition & EMERGENCY else '') + 'fault: ' + ', '.join(tripped)


@compiled
def moves(axis, c):
    """Whether an axis turns, by its motor encoders."""
    return abs(axis.motor_1.measured + axis.motor_2.measured) * c.per_2N > STANDSTILL


@compiled
def _next(s, c):
    allowed = permitted(s)
    if faults.drops(s.azimuth.faults) or faults.drops(s.elevation.faults):
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
def _advance_pins(s, c, wanted):
    """One control period of the stow pins, which move while the drive is off; wanted: code of acu/stow_pins."""
    az, el, k = s.azimuth, s.elevation, c.pins
    stow_pins.order(s.pins, k, wanted, math.nan if moves(az, c.azimuth) else c.azimuth.rad * az.reading,
                    math.nan if moves(el, c.elevation) else c.elevation.rad * el.reading)
    if s.phase == DISABLED and not s.emergency:
        az.faults |= stow_pins.advance(s.pins, k, 0)
        el.faults |= stow_pins.advance(s.pins, k, 1)


@compiled
def advance(s, c, pins):
    """One control period: the phase, and whether the brakes grip in it; pins: code of acu/stow_pins."""
    if c.pins.fitted:
        _advance_pins(s, c, pins)
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
        if tripped(s):
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
        stow_pins.retry(s.pins)
    return GRANTED
