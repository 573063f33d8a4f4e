"""Vectors of three components, their products and their rotations, for compiled functions.

M': the transpose of a Rotation M, which is its inverse.
"""
from typing import NamedTuple

from pedestal_common.compiled import compiled
from pedestal_common.geometry import line_of_sight
from pedestal_common.quantities import Matrix3, Vector3


class Vector(NamedTuple):
    """Components of a vector along the axes of a frame. The docstring of the function that uses it names the frame."""
    x: float
    y: float
    z: float


class Rotation(NamedTuple):
    """Matrix of a rotation: its rows."""
    x: Vector
    y: Vector
    z: Vector


@compiled
def vector(row: Vector3) -> Vector:
    """Return the Vector of an array."""
    return Vector(row[0], row[1], row[2])


@compiled
def rotation(mat: Matrix3) -> Rotation:
    """Return the Rotation of an array."""
    return Rotation(Vector(mat[0, 0], mat[0, 1], mat[0, 2]), Vector(mat[1, 0], mat[1, 1], mat[1, 2]),
                    Vector(mat[2, 0], mat[2, 1], mat[2, 2]))


@compiled
def turn(x: float, y: float, z: float, w: float) -> Rotation:
    """Return the Rotation of a unit quaternion with the scalar part w."""
    a, b, c = line_of_sight.rows(x, y, z, w)
    return Rotation(Vector(*a), Vector(*b), Vector(*c))


@compiled
def minus(a: Vector, b: Vector) -> Vector:
    """Return a - b."""
    return Vector(a.x - b.x, a.y - b.y, a.z - b.z)


@compiled
def times(k: float, a: Vector) -> Vector:
    """Return the Vector a times the number k."""
    return Vector(k * a.x, k * a.y, k * a.z)


@compiled
def dot(a: Vector, b: Vector) -> float:
    """Return a . b."""
    return a.x * b.x + a.y * b.y + a.z * b.z


@compiled
def cross(a: Vector, b: Vector) -> Vector:
    """Return a x b."""
    return Vector(*line_of_sight.cross(a.x, a.y, a.z, b.x, b.y, b.z))


@compiled
def transposed(mat: Rotation) -> Rotation:
    """Return M', the transpose of a Rotation M."""
    return Rotation(Vector(mat.x.x, mat.y.x, mat.z.x), Vector(mat.x.y, mat.y.y, mat.z.y),
                    Vector(mat.x.z, mat.y.z, mat.z.z))


@compiled
def rotated(mat: Rotation, a: Vector) -> Vector:
    """Return M a, the Vector a rotated by M."""
    return Vector(dot(mat.x, a), dot(mat.y, a), dot(mat.z, a))


@compiled
def rotated_back(mat: Rotation, a: Vector) -> Vector:
    """Return M' a, the Vector a rotated by the inverse of M."""
    return rotated(transposed(mat), a)
