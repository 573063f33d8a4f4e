"""A program track: a table of times, azimuths and elevations (earth angles), and its interpolation to any instant.
Tables: the program track and the predicted tables of a satellite and the sun, which have the same type.

The interpolation is cubic (Hermite). The slope at a row is that of a parabola through the row and its neighbours.
Therefore the rate is continuous.
"""
import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from acu_tracker import modes
from acu_tracker.geometry.azimuth_wrap import Travel
from acu_tracker.geometry.vector import AxisMotion, Motion, Vector, angles, normalised, north_west_up
from acu_tracker.modes import Reason
from pedestal_common.compiled import compiled, separate
from pedestal_common.geometry.interval import interval
from pedestal_common.geometry.line_of_sight import earth_direction, wrap
from pedestal_common.quantities import Pairs, Radians, RadiansPerSecond, Seconds, Times

MAX_PROGRAM_ROWS = 100_000  # largest number of rows of a program
STEEP_ELEVATION_RAD = math.radians(80.0)  # above it the unit vector is interpolated, not the angles


class ProgramTrack(NamedTuple):
    """A table of directions in the earth frame."""
    times: Times    # increasing; without a row: no program
    angles: Pairs   # azimuth and elevation [rad]


NO_TRACK = ProgramTrack(np.zeros(0), np.zeros((0, 2)))  # ProgramTrack without a row


class ProgramTrackError(ValueError):
    """A table that cannot be followed; the message names row, value and allowed range."""


def checked(times: ArrayLike, angles: ArrayLike) -> ProgramTrack:
    """Return the ProgramTrack of times and angles (n, 2) [rad]; raise ProgramTrackError if it cannot be followed."""
    times, angles = np.array(times, float), np.array(angles, float)
    if times.ndim != 1 or angles.shape != (len(times), 2):
        raise ProgramTrackError(f'program track: times have the shape {times.shape}, angles {angles.shape}; '
                                'must be (n,), (n, 2)')
    if not 2 <= len(times) <= MAX_PROGRAM_ROWS:
        raise ProgramTrackError(f'program track has {len(times)} rows; must be 2 to {MAX_PROGRAM_ROWS}')
    bad = np.flatnonzero(~(np.isfinite(times) & np.isfinite(angles).all(axis=1)))
    if bad.size:
        raise ProgramTrackError(f'program track row {bad[0]}: {times[bad[0]]} s {angles[bad[0]]} rad; must be finite')
    back = np.flatnonzero(np.diff(times) <= 0.0)
    if back.size:
        raise ProgramTrackError(f'program track row {back[0] + 1}: time {times[back[0] + 1]:g} s; '
                                f'must be after {times[back[0]]:g} s')
    high = np.flatnonzero(np.abs(angles[:, 1]) > 0.5 * math.pi)
    if high.size:
        raise ProgramTrackError(f'program track row {high[0]}: elevation {math.degrees(angles[high[0], 1]):.6g} deg; '
                                'must be -90 to 90')
    return ProgramTrack(times, angles)


@compiled
def status(program: ProgramTrack, t: Seconds) -> int:
    """Return NONE if the program covers t, otherwise the reason (of modes.REASONS)."""
    if len(program.times) < 2:
        return Reason.NO_PROGRAM
    if t < program.times[0]:
        return Reason.BEFORE_PROGRAM
    return Reason.NONE if t <= program.times[-1] else Reason.AFTER_PROGRAM


@compiled
def _difference(program: ProgramTrack, i: int, axis: int) -> Radians:
    """Return the change of an angle (0 azimuth, the short way round, 1 elevation) from row i to the next."""
    difference = program.angles[i + 1, axis] - program.angles[i, axis]
    return wrap(difference) if axis == 0 else difference


@compiled
def _slope(program: ProgramTrack, i: int, axis: int) -> RadiansPerSecond:
    """Return the rate of an angle at row i, from the parabola through the three rows about it or nearest to it."""
    times = program.times
    if len(times) == 2:
        return _difference(program, 0, axis) / (times[1] - times[0])
    m = min(max(i, 1), len(times) - 2)
    before, after = times[m] - times[m - 1], times[m + 1] - times[m]
    d0, d1 = _difference(program, m - 1, axis) / before, _difference(program, m, axis) / after
    bend = (d1 - d0) / (before + after)
    return d0 + bend * (before + 2.0 * (times[i] - times[m]))


@compiled
def _hermite(y0: float, d: float, m0: float, m1: float, x: float, T: Seconds) -> AxisMotion:
    """Return the motion of the cubic polynomial from y0 to y0 + d in T, at the place x from 0 to 1; m0, m1: slopes at
    its ends, times T."""
    c2, c3 = 3.0 * d - 2.0 * m0 - m1, m0 + m1 - 2.0 * d
    return AxisMotion(y0 + x * (m0 + x * (c2 + x * c3)), (m0 + x * (2.0 * c2 + 3.0 * x * c3)) / T,
                      (2.0 * c2 + 6.0 * x * c3) / (T * T))


@compiled
def interpolated(program: ProgramTrack, t: Seconds, axis: int) -> AxisMotion:
    """Return the motion of one axis (0 azimuth, 1 elevation) at t, interpolated."""
    times = program.times
    i = interval(times, t)
    T = times[i + 1] - times[i]
    return _hermite(program.angles[i, axis], _difference(program, i, axis), T * _slope(program, i, axis),
                    T * _slope(program, i + 1, axis), (t - times[i]) / T, T)


@compiled
def _component(program: ProgramTrack, i: int, axis: int) -> float:
    """Return a component (0 east, 1 north, 2 up) of the unit vector at row i."""
    return earth_direction(program.angles[i, 0], program.angles[i, 1])[axis]


@compiled
def _component_slope(program: ProgramTrack, i: int, axis: int) -> float:
    """Return the rate of a component of the unit vector at row i [1/s], computed as in _slope."""
    times = program.times
    m = min(max(i, 1), len(times) - 2)
    before, after = times[m] - times[m - 1], times[m + 1] - times[m]
    middle = _component(program, m, axis)
    d0 = (middle - _component(program, m - 1, axis)) / before
    d1 = (_component(program, m + 1, axis) - middle) / after
    return d0 + (d1 - d0) / (before + after) * (before + 2.0 * (times[i] - times[m]))


@compiled
def _interpolated_component(program: ProgramTrack, i: int, t: Seconds, axis: int) -> AxisMotion:
    """Return (component of the unit vector, its rate, its acceleration) at t between rows i and i + 1."""
    times = program.times
    T = times[i + 1] - times[i]
    y0 = _component(program, i, axis)
    return _hermite(y0, _component(program, i + 1, axis) - y0, T * _component_slope(program, i, axis),
                    T * _component_slope(program, i + 1, axis), (t - times[i]) / T, T)


@separate
def motion_at(program: ProgramTrack, t: Seconds) -> Motion:
    """Return the motion in earth angles at t. Between two rows above STEEP_ELEVATION_RAD the unit vector is
    interpolated, because near the zenith the azimuth may change by any amount from row to row."""
    i = interval(program.times, t)
    if min(program.angles[i, 1], program.angles[i + 1, 1]) < STEEP_ELEVATION_RAD or len(program.times) < 3:
        return Motion(interpolated(program, t, 0), interpolated(program, t, 1))
    e, de, dde = _interpolated_component(program, i, t, 0)
    n, dn, ddn = _interpolated_component(program, i, t, 1)
    u, du, ddu = _interpolated_component(program, i, t, 2)
    return angles(normalised(north_west_up(Vector(e, n, u)), north_west_up(Vector(de, dn, du)),
                             north_west_up(Vector(dde, ddn, ddu))))


@compiled
def direction(program: ProgramTrack, t: Seconds) -> Vector:
    """Return the ENU unit vector at t."""
    motion = motion_at(program, t)
    e, n, u = earth_direction(motion.azimuth.angle, motion.elevation.angle)
    return Vector(e, n, u)


@compiled
def azimuth_travel(program: ProgramTrack, t: Seconds) -> Travel:
    """Return the Travel of the azimuth from t until the end of the program, relative to its value at t."""
    first = interval(program.times, t)
    here = interpolated(program, t, 0).angle - program.angles[first, 0]
    at, below, above = 0.0, 0.0, 0.0
    for i in range(first, len(program.times) - 1):
        at += _difference(program, i, 0)
        below, above = min(below, at - here), max(above, at - here)
    return Travel(below, above)


TABLE_MODES = tuple(row for row in modes.MODE_ROWS if row.table)  # rows of the modes that follow a table


class Tables(NamedTuple):
    """A table for each mode that follows one, in the order of TABLE_MODES."""
    program: ProgramTrack
    tle: ProgramTrack
    sun: ProgramTrack


NO_TABLES = Tables(*(NO_TRACK for _ in TABLE_MODES))  # tables without a row

TABLE_INDEX = tuple(TABLE_MODES.index(row) if row.table else 0 for row in modes.MODE_ROWS)
"""Index in Tables of the table of each mode; 0, the program, for a mode that follows none."""


def shifted(track: ProgramTrack, offset: tuple[Seconds, Radians, Radians]) -> ProgramTrack:
    """Return a ProgramTrack with an offset (time, azimuth, elevation) added; elevations are limited to the zenith."""
    if not any(offset):
        return track
    time, *angles = offset
    moved = track.angles + angles
    moved[:, 1] = np.clip(moved[:, 1], -0.5 * math.pi, 0.5 * math.pi)
    return ProgramTrack(track.times + time, moved)


@compiled
def of_mode(tables: Tables, mode: int) -> ProgramTrack:
    """Return the table that a mode follows; for a mode that follows no table, return the program."""
    return tables[TABLE_INDEX[mode]]
