"""Vectors of three components, and their products."""
from collections import namedtuple

from pedestal_common.compiled import compiled
from pedestal_common.geometry import line_of_sight

Vector = namedtuple('Vector', 'x y z')
"""Components along the axes of a frame, which the docstring of the caller names."""


@compiled
def vector(row):
    """The Vector of an array (3,)."""
    return Vector(row[0], row[1], row[2])


@compiled
def minus(a, b):
    """a - b."""
    return Vector(a.x - b.x, a.y - b.y, a.z - b.z)


@compiled
def times(k, a):
    """k a, k a number."""
    return Vector(k * a.x, k * a.y, k * a.z)


@compiled
def dot(a, b):
    """a . b."""
    return a.x * b.x + a.y * b.y + a.z * b.z


@compiled
def cross(a, b):
    """a x b."""
    return Vector(*line_of_sight.cross(a.x, a.y, a.z, b.x, b.y, b.z))


@compiled
def rotated(mat, a):
    """M a, of a rotation M (3, 3)."""
    return Vector(*line_of_sight.to_earth(mat, a.x, a.y, a.z))


@compiled
def rotated_back(mat, a):
    """M' a, of a rotation M (3, 3)."""
    return Vector(*line_of_sight.to_deck(mat, a.x, a.y, a.z))
