"""A time-tagged table of directions: cubic Hermite interpolation with parabolic slopes, so the rate is continuous."""
import math

import numpy as np

from acu_tracker.geometry.deck_reference import from_lever_arm, moving_angles
from acu_tracker.modes import AFTER_PROGRAM, BEFORE_PROGRAM, NO_PROGRAM, NONE
from pedestal_common.compiled import compiled
from pedestal_common.interval import interval
from pedestal_common.line_of_sight import earth_direction, wrap

MAX_ROWS = 100_000
STEEP = math.radians(80.0)
"""Elevation of the rows above which directions are interpolated."""


class ProgramTrackError(ValueError):
    """A table that cannot be followed; the message names row, value and what is allowed."""


def checked(times, angles):
    """A table as arrays times (n,) [s], angles (n, 2) [rad azimuth, elevation]; ProgramTrackError if it is none."""
    times, angles = np.array(times, float), np.array(angles, float)
    if times.ndim != 1 or angles.shape != (len(times), 2):
        raise ProgramTrackError(f'program track: times {times.shape}, angles {angles.shape}; must be (n,), (n, 2)')
    if not 2 <= len(times) <= MAX_ROWS:
        raise ProgramTrackError(f'program track has {len(times)} rows; must be 2 to {MAX_ROWS}')
    bad = np.flatnonzero(~(np.isfinite(times) & np.isfinite(angles).all(axis=1)))
    if bad.size:
        raise ProgramTrackError(f'program track row {bad[0]}: {times[bad[0]]} s {angles[bad[0]]} rad; must be finite')
    back = np.flatnonzero(np.diff(times) <= 0.0)
    if back.size:
        raise ProgramTrackError(f'program track row {back[0] + 1}: time {times[back[0] + 1]:g} s; '
                                f'must be after {times[back[0]]:g} s')
    high = np.flatnonzero(np.abs(angles[:, 1]) > 0.5 * math.pi)
    if high.size:
        raise ProgramTrackError(f'program track row {high[0]}: elevation {angles[high[0], 1]:g} rad; '
                                'must be -1.5708 to 1.5708')
    return times, angles


@compiled
def status(times, t):
    """NONE if the table covers t [s], otherwise the reason."""
    if len(times) < 2:
        return NO_PROGRAM
    if t < times[0]:
        return BEFORE_PROGRAM
    return NONE if t <= times[-1] else AFTER_PROGRAM


@compiled
def _difference(angles, i, axis):
    difference = angles[i + 1, axis] - angles[i, axis]
    return wrap(difference) if axis == 0 else difference


@compiled
def _slope(times, angles, i, axis):
    """Rate at row i of the parabola through its neighbours; at the ends through the nearest three rows."""
    if len(times) == 2:
        return _difference(angles, 0, axis) / (times[1] - times[0])
    m = min(max(i, 1), len(times) - 2)
    before, after = times[m] - times[m - 1], times[m + 1] - times[m]
    d0, d1 = _difference(angles, m - 1, axis) / before, _difference(angles, m, axis) / after
    bend = (d1 - d0) / (before + after)
    return d0 + bend * (before + 2.0 * (times[i] - times[m]))


@compiled
def interpolated(times, angles, t, axis):
    """(angle, rate, acceleration) of axis 0 (azimuth, the short way round) or 1 (elevation) at t [s]."""
    i = interval(times, t)
    T = times[i + 1] - times[i]
    x = (t - times[i]) / T
    y0, d = angles[i, axis], _difference(angles, i, axis)
    m0, m1 = T * _slope(times, angles, i, axis), T * _slope(times, angles, i + 1, axis)
    c2, c3 = 3.0 * d - 2.0 * m0 - m1, m0 + m1 - 2.0 * d
    return (y0 + x * (m0 + x * (c2 + x * c3)), (m0 + x * (2.0 * c2 + 3.0 * x * c3)) / T,
            (2.0 * c2 + 6.0 * x * c3) / (T * T))


@compiled
def _component(angles, i, axis):
    """Component (0 east, 1 north, 2 up) of the unit vector of row i."""
    return earth_direction(angles[i, 0], angles[i, 1])[axis]


@compiled
def _component_slope(times, angles, i, axis):
    """As _slope, of a component."""
    m = min(max(i, 1), len(times) - 2)
    before, after = times[m] - times[m - 1], times[m + 1] - times[m]
    middle = _component(angles, m, axis)
    d0 = (middle - _component(angles, m - 1, axis)) / before
    d1 = (_component(angles, m + 1, axis) - middle) / after
    return d0 + (d1 - d0) / (before + after) * (before + 2.0 * (times[i] - times[m]))


@compiled
def _curve(times, angles, i, t, axis):
    """(component, its rate, acceleration) at t between rows i and i + 1; as `interpolated`."""
    T = times[i + 1] - times[i]
    x = (t - times[i]) / T
    y0 = _component(angles, i, axis)
    d = _component(angles, i + 1, axis) - y0
    m0, m1 = T * _component_slope(times, angles, i, axis), T * _component_slope(times, angles, i + 1, axis)
    c2, c3 = 3.0 * d - 2.0 * m0 - m1, m0 + m1 - 2.0 * d
    return (y0 + x * (m0 + x * (c2 + x * c3)), (m0 + x * (2.0 * c2 + 3.0 * x * c3)) / T,
            (2.0 * c2 + 6.0 * x * c3) / (T * T))


@compiled
def outlook(times, angles, t):
    """(A, dA, ddA, E, dE, ddE) at t [s]. Between two rows above STEEP, where the azimuth may turn by any amount from
    one to the next, the unit vector is interpolated instead of the angles."""
    i = interval(times, t)
    if min(angles[i, 1], angles[i + 1, 1]) < STEEP or len(times) < 3:
        A, dA, ddA = interpolated(times, angles, t, 0)
        E, dE, ddE = interpolated(times, angles, t, 1)
        return A, dA, ddA, E, dE, ddE
    e, de, dde = _curve(times, angles, i, t, 0)
    n, dn, ddn = _curve(times, angles, i, t, 1)
    u, du, ddu = _curve(times, angles, i, t, 2)
    return moving_angles(*from_lever_arm(0.0, 0.0, 0.0, n, -e, u, dn, -de, du, ddn, -dde, ddu))


@compiled
def direction(times, angles, t):
    """ENU unit vector at t [s]."""
    A, _, _, E, _, _ = outlook(times, angles, t)
    return earth_direction(A, E)


@compiled
def azimuth_travel(times, angles, t):
    """(below, above) [rad] that the azimuth still travels from its value at t until the end of the table."""
    first = interval(times, t)
    here = interpolated(times, angles, t, 0)[0] - angles[first, 0]
    at, below, above = 0.0, 0.0, 0.0
    for i in range(first, len(times) - 1):
        at += _difference(angles, i, 0)
        below, above = min(below, at - here), max(above, at - here)
    return below, above
