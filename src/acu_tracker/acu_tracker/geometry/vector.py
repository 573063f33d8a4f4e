"""Vectors of three components, their products and their rotations, for compiled functions.

M, mat: a Rotation; M': its transpose, which is its inverse; a, b: Vectors.
"""
from collections import namedtuple

from pedestal_common.compiled import compiled
from pedestal_common.geometry import line_of_sight

Vector = namedtuple('Vector', 'x y z')
"""Components of a vector along the axes of a frame. The docstring of the function that uses it names the frame."""

Rotation = namedtuple('Rotation', 'x y z')  # matrix of a rotation: its rows, each a Vector


@compiled
def vector(row):
    """Return the Vector of an array (3,)."""
    return Vector(row[0], row[1], row[2])


@compiled
def rotation(mat):
    """Return the Rotation of an array (3, 3)."""
    return Rotation(Vector(mat[0, 0], mat[0, 1], mat[0, 2]), Vector(mat[1, 0], mat[1, 1], mat[1, 2]),
                    Vector(mat[2, 0], mat[2, 1], mat[2, 2]))


@compiled
def turn(x, y, z, w):
    """Return the Rotation of a unit quaternion with the scalar part w."""
    a, b, c = line_of_sight.rows(x, y, z, w)
    return Rotation(Vector(*a), Vector(*b), Vector(*c))


@compiled
def minus(a, b):
    """Return a - b."""
    return Vector(a.x - b.x, a.y - b.y, a.z - b.z)


@compiled
def times(k, a):
    """Return the Vector a times the number k."""
    return Vector(k * a.x, k * a.y, k * a.z)


@compiled
def dot(a, b):
    """Return a . b."""
    return a.x * b.x + a.y * b.y + a.z * b.z


@compiled
def cross(a, b):
    """Return a x b."""
    return Vector(*line_of_sight.cross(a.x, a.y, a.z, b.x, b.y, b.z))


@compiled
def transposed(mat):
    """Return M', the transpose of a Rotation M."""
    return Rotation(Vector(mat.x.x, mat.y.x, mat.z.x), Vector(mat.x.y, mat.y.y, mat.z.y),
                    Vector(mat.x.z, mat.y.z, mat.z.z))


@compiled
def rotated(mat, a):
    """Return M a, the Vector a rotated by M."""
    return Vector(dot(mat.x, a), dot(mat.y, a), dot(mat.z, a))


@compiled
def rotated_back(mat, a):
    """Return M' a, the Vector a rotated by the inverse of M."""
    return rotated(transposed(mat), a)
