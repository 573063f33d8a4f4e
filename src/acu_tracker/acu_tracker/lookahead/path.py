"""The path of the target on the levelled deck for the next seconds, as a table with constant time step.

The path follows the program track, or the great circle on which the target moves. The rows are directions on the sky
first; `to_encoders` converts them to encoder angles, by which the axes move.
"""
import math
from typing import NamedTuple

from acu_tracker.geometry.azimuth_wrap import Travel
from acu_tracker.geometry.vector import Vector, dot, minus, rotated_back, rotation, turned_along
from acu_tracker.program import bridge
from pedestal_common.compiled import compiled
from pedestal_common.geometry import pointing_model
from pedestal_common.geometry.line_of_sight import angles, direction, wrap
from pedestal_common.quantities import Floats, Matrix3, Radians, RadiansPerSecond, Seconds

PATH_ROW_COUNT, PATH_COLUMN_COUNT = 1025, 6  # largest number of rows of a path, and number of its columns

UP_COLUMN, AZIMUTH_COLUMN, LEAST_AZIMUTH_COLUMN, LARGEST_AZIMUTH_COLUMN = range(2, PATH_COLUMN_COUNT)
"""Columns of a path: upward component of the unit vector [-]; azimuth, without jumps of a turn [rad]. The last two are
the least and largest azimuth from this row to the end of the path, or to the end of the program."""


class Path(NamedTuple):
    """Path of the target."""
    # (n, 6): unit vector towards the target (FLU of the levelled deck), then three columns of the azimuth, which
    # `complete` sets
    rows: Floats
    t0: Seconds     # time of the first row
    h: Seconds      # time between two rows


MIN_ZENITH_DISTANCE_SQUARED = 1e-12
"""Least squared horizontal part of a unit vector [-]. This avoids a division by zero at the zenith."""


@compiled
def along_program(path: Path, mat: Matrix3, way: bridge.Way) -> int:
    """Write the unit vectors of a Way; return the number of rows that it covers. mat: levelled deck -> earth."""
    level = rotation(mat)
    for i in range(len(path.rows)):
        t = path.t0 + i * path.h
        if t > way.program.times[-1]:
            return i
        path.rows[i, 0], path.rows[i, 1], path.rows[i, 2] = rotated_back(level, bridge.direction(way, t))
    return len(path.rows)


@compiled
def along_great_circle(path: Path, mat: Matrix3, u: Vector, du: Vector) -> int:
    """Write the unit vectors of the path along a great circle; return the number of rows. mat: levelled deck -> earth;
    u, du: ENU unit vector of the target at t0 and its rate [1/s]."""
    W, level = math.sqrt(dot(du, du)), rotation(mat)
    for i in range(len(path.rows)):
        path.rows[i, 0], path.rows[i, 1], path.rows[i, 2] = rotated_back(level, turned_along(u, du, W, W * i * path.h))
    return len(path.rows)


@compiled
def to_encoders(path: Path, model: pointing_model.PointingModel) -> None:
    """Replace the unit vectors by those of the encoder angles."""
    if model.exact:
        return
    for i in range(len(path.rows)):
        azimuth, elevation = angles(path.rows[i, 0], path.rows[i, 1], path.rows[i, 2])
        A, E, _ = pointing_model.encoder_of(model, azimuth, elevation)
        path.rows[i, 0], path.rows[i, 1], path.rows[i, 2] = direction(A, E)


@compiled
def complete(path: Path, travel: Travel) -> None:
    """Write the azimuth columns; travel: turn of the azimuth from the end of the path to that of the program."""
    rows, n = path.rows, len(path.rows)
    before = math.atan2(-rows[0, 1], rows[0, 0])
    rows[0, AZIMUTH_COLUMN] = before
    for i in range(1, n):
        before += wrap(math.atan2(-rows[i, 1], rows[i, 0]) - before)
        rows[i, AZIMUTH_COLUMN] = before
    rows[n - 1, LEAST_AZIMUTH_COLUMN] = before + travel.below
    rows[n - 1, LARGEST_AZIMUTH_COLUMN] = before + travel.above
    for i in range(n - 2, -1, -1):
        here, after = rows[i, AZIMUTH_COLUMN], rows[i + 1]
        rows[i, LEAST_AZIMUTH_COLUMN] = min(here, after[LEAST_AZIMUTH_COLUMN])
        rows[i, LARGEST_AZIMUTH_COLUMN] = max(here, after[LARGEST_AZIMUTH_COLUMN])


@compiled
def at(path: Path, t: Seconds) -> tuple[Vector, Vector]:
    """Return (unit vector u, its rate du [1/s]) of the path at t, interpolated linearly between the rows."""
    i = min(max(int((t - path.t0) / path.h), 0), len(path.rows) - 2)
    f = (t - path.t0) / path.h - i
    a = Vector(path.rows[i, 0], path.rows[i, 1], path.rows[i, 2])
    d = minus(Vector(path.rows[i + 1, 0], path.rows[i + 1, 1], path.rows[i + 1, 2]), a)
    return (Vector(a.x + f * d.x, a.y + f * d.y, a.z + f * d.z),
            Vector(d.x / path.h, d.y / path.h, d.z / path.h))


@compiled
def azimuth_at(path: Path, t: Seconds, rate: RadiansPerSecond) -> tuple[Radians, RadiansPerSecond]:
    """Return (azimuth, azimuth rate) of the path at t; the rate is limited to +-rate."""
    u, du = at(path, t)
    dA = (u.y * du.x - u.x * du.y) / max(u.x * u.x + u.y * u.y, MIN_ZENITH_DISTANCE_SQUARED)
    return math.atan2(-u.y, u.x), min(max(dA, -rate), rate)

