"""The path of the target on the levelled deck, from now on: along the program track, or on its great circle."""
import math
from collections import namedtuple

from acu_tracker.geometry.great_circle import turned
from acu_tracker.geometry.vector import Vector, dot, minus, rotated_back, rotation
from acu_tracker.program import bridge
from pedestal_common.compiled import compiled
from pedestal_common.geometry.line_of_sight import wrap

PATH_ROW_COUNT, PATH_COLUMN_COUNT = 1025, 6
"""Size of the path of a look-ahead."""

Path = namedtuple('Path', 'rows t0 h')
"""rows (n, 6), one every h [s] from t0 [s] on: the unit vector (FLU of the levelled deck), and three columns set by
`complete`. They are the unwrapped azimuth, and the least and the largest azimuth from there to the end [rad]."""


@compiled
def along_program(path, mat, way):
    """Lay out the path of a bridge.Way; return the number of rows that it covers.

    mat (3, 3): levelled deck -> earth.
    """
    level = rotation(mat)
    for i in range(len(path.rows)):
        t = path.t0 + i * path.h
        if t > way.program.times[-1]:
            return i
        path.rows[i, 0], path.rows[i, 1], path.rows[i, 2] = rotated_back(level, bridge.direction(way, t))
    return len(path.rows)


@compiled
def along_great_circle(path, mat, u, du):
    """Lay out the path of an ENU unit vector u that keeps its rate du [1/s]; return the number of rows."""
    W, level = math.sqrt(dot(du, du)), rotation(mat)
    for i in range(len(path.rows)):
        path.rows[i, 0], path.rows[i, 1], path.rows[i, 2] = rotated_back(level, turned(u, du, W, W * i * path.h))
    return len(path.rows)


@compiled
def complete(path, travel):
    """Fill the azimuth columns; travel: the Travel of the azimuth after the end of the path."""
    rows, n = path.rows, len(path.rows)
    before = math.atan2(-rows[0, 1], rows[0, 0])
    rows[0, 3] = before
    for i in range(1, n):
        before += wrap(math.atan2(-rows[i, 1], rows[i, 0]) - before)
        rows[i, 3] = before
    rows[n - 1, 4], rows[n - 1, 5] = before + travel.below, before + travel.above
    for i in range(n - 2, -1, -1):
        rows[i, 4], rows[i, 5] = min(rows[i, 3], rows[i + 1, 4]), max(rows[i, 3], rows[i + 1, 5])


@compiled
def at(path, t):
    """Return (u, du [1/s]) of the path at t [s], in straight lines between its rows."""
    i = min(max(int((t - path.t0) / path.h), 0), len(path.rows) - 2)
    f = (t - path.t0) / path.h - i
    a = Vector(path.rows[i, 0], path.rows[i, 1], path.rows[i, 2])
    d = minus(Vector(path.rows[i + 1, 0], path.rows[i + 1, 1], path.rows[i + 1, 2]), a)
    return (Vector(a.x + f * d.x, a.y + f * d.y, a.z + f * d.z),
            Vector(d.x / path.h, d.y / path.h, d.z / path.h))


@compiled
def azimuth_at(path, t, rate):
    """Return (azimuth [rad], its rate within +-rate [rad/s]) of the path at t [s]."""
    u, du = at(path, t)
    dA = (u.y * du.x - u.x * du.y) / max(u.x * u.x + u.y * u.y, 1e-12)
    return math.atan2(-u.y, u.x), min(max(dA, -rate), rate)


@compiled
def end(path):
    """Return the time of the last row [s]."""
    return path.t0 + (len(path.rows) - 1) * path.h
