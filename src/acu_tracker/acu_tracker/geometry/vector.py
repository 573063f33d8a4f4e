"""Vectors of three components, and the motion of a direction, for compiled functions.

Azimuth is clockwise: from north in the earth frame, from the bow on the deck. FLU on the deck and the axes north, west
and up of the earth therefore have the same formulas. Because earth vectors are ENU in the other modules,
`north_west_up` converts them. M' is the transpose of a Rotation M, which is its inverse.
"""
import math
from typing import NamedTuple

from pedestal_common.compiled import compiled
from pedestal_common.geometry import line_of_sight as pointing
from pedestal_common.quantities import Matrix3, Radians, RadiansPerSecond, RadiansPerSecond2, Vector3


class Vector(NamedTuple):
    """Components of a vector along the axes of a frame, which the function that uses it names."""
    x: float
    y: float
    z: float


ZERO_VECTOR = Vector(0.0, 0.0, 0.0)


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
    a, b, c = pointing.rows(x, y, z, w)
    return Rotation(Vector(*a), Vector(*b), Vector(*c))


@compiled
def minus(a: Vector, b: Vector) -> Vector:
    """Return a - b."""
    return Vector(a.x - b.x, a.y - b.y, a.z - b.z)


@compiled
def times(k: float, a: Vector) -> Vector:
    """Return k a."""
    return Vector(k * a.x, k * a.y, k * a.z)


@compiled
def dot(a: Vector, b: Vector) -> float:
    """Return a . b."""
    return a.x * b.x + a.y * b.y + a.z * b.z


@compiled
def cross(a: Vector, b: Vector) -> Vector:
    """Return a x b."""
    return Vector(*pointing.cross(a.x, a.y, a.z, b.x, b.y, b.z))


@compiled
def transposed(mat: Rotation) -> Rotation:
    """Return M'."""
    return Rotation(Vector(mat.x.x, mat.y.x, mat.z.x), Vector(mat.x.y, mat.y.y, mat.z.y),
                    Vector(mat.x.z, mat.y.z, mat.z.z))


@compiled
def rotated(mat: Rotation, a: Vector) -> Vector:
    """Return M a."""
    return Vector(dot(mat.x, a), dot(mat.y, a), dot(mat.z, a))


@compiled
def rotated_back(mat: Rotation, a: Vector) -> Vector:
    """Return M' a."""
    return rotated(transposed(mat), a)


class AxisMotion(NamedTuple):
    """Motion of one axis."""
    angle: Radians
    rate: RadiansPerSecond
    acceleration: RadiansPerSecond2


class Motion(NamedTuple):
    """Motion of both axes; motion[0] is azimuth, motion[1] elevation."""
    azimuth: AxisMotion
    elevation: AxisMotion


class LineOfSight(NamedTuple):
    """Direction towards the target."""
    u: Vector       # unit vector [-]
    du: Vector      # its first time derivative [1/s]
    ddu: Vector     # its second time derivative [1/s2]


@compiled
def turned(mat: Rotation, sight: LineOfSight) -> LineOfSight:
    """Return a LineOfSight after a rotation."""
    return LineOfSight(rotated(mat, sight.u), rotated(mat, sight.du), rotated(mat, sight.ddu))


@compiled
def line_of_sight(motion: Motion) -> LineOfSight:
    """Return the LineOfSight in ENU of a Motion in earth angles."""
    A, dA, ddA = motion.azimuth
    E, dE, ddE = motion.elevation
    sA, cA, sE, cE = math.sin(A), math.cos(A), math.sin(E), math.cos(E)
    # dh, ddh: derivatives of cos E, the horizontal part; ds, dds and dc, ddc: derivatives of sin A and of cos A.
    dh, ddh = -sE * dE, -cE * dE * dE - sE * ddE
    ds, dds = cA * dA, cA * ddA - sA * dA * dA
    dc, ddc = -sA * dA, -sA * ddA - cA * dA * dA
    return LineOfSight(
        Vector(cE * sA, cE * cA, sE),
        Vector(dh * sA + cE * ds, dh * cA + cE * dc, cE * dE),
        Vector(ddh * sA + 2.0 * dh * ds + cE * dds, ddh * cA + 2.0 * dh * dc + cE * ddc, cE * ddE - sE * dE * dE))


@compiled
def north_west_up(v: Vector) -> Vector:
    """Return the north-west-up components of an ENU vector; FLU of one that line_of_sight made of deck angles."""
    return Vector(v.y, -v.x, v.z)


@compiled
def angles(sight: LineOfSight) -> Motion:
    """Return the Motion of a LineOfSight in FLU or north-west-up. The azimuth is singular at the zenith. Within 1e-6
    rad of the zenith the rates are therefore those at 1e-6 rad."""
    u, du, ddu = sight
    rho2 = max(u.x * u.x + u.y * u.y, 1e-12)
    rho = math.sqrt(rho2)
    dA = (u.y * du.x - u.x * du.y) / rho2
    ddA = (u.y * ddu.x - u.x * ddu.y - 2.0 * dA * (u.x * du.x + u.y * du.y)) / rho2
    dE = du.z / rho
    return Motion(AxisMotion(math.atan2(-u.y, u.x), dA, ddA),
                  AxisMotion(math.atan2(u.z, rho), dE, (ddu.z + u.z * dE * dE) / rho))


@compiled
def earth_angles(sight: LineOfSight) -> Motion:
    """Return the Motion of a LineOfSight in ENU."""
    return angles(LineOfSight(north_west_up(sight.u), north_west_up(sight.du), north_west_up(sight.ddu)))


@compiled
def normalised(v: Vector, dv: Vector, ddv: Vector) -> LineOfSight:
    """Return the LineOfSight along a vector v of any length; dv, ddv: its time derivatives, in the unit of v. n = v /
    |v|, n' = (v' - n (n.v')) / |v|; n: unit vector, ': time derivative, a point: scalar product."""
    k = 1.0 / math.sqrt(dot(v, v))
    n, dv, ddv = times(k, v), times(k, dv), times(k, ddv)
    along = dot(n, dv)
    dn = minus(dv, times(along, n))
    # n'' = v''/|v| - 2 n' (n.v')/|v| - n d/dt(n.v'/|v|) - n (n.v'/|v|)^2, from |v| n = v.
    bend = dot(n, ddv) + dn.x * dn.x + dn.y * dn.y + dn.z * dn.z
    return LineOfSight(n, dn, minus(minus(ddv, times(2.0 * along, dn)), times(bend, n)))


@compiled
def motion_of_position(p: Vector, v: Vector, a: Vector) -> Motion:
    """Return the Motion in earth angles of a point at p (ENU) with the velocity v and the acceleration a."""
    r = math.sqrt(dot(p, p))
    u = Vector(p.x / r, p.y / r, p.z / r)
    dr = dot(u, v)
    du = Vector((v.x - dr * u.x) / r, (v.y - dr * u.y) / r, (v.z - dr * u.z) / r)
    ddr = r * dot(du, du) + u.x * a.x + u.y * a.y + u.z * a.z
    ddu = Vector((a.x - ddr * u.x - 2.0 * dr * du.x) / r, (a.y - ddr * u.y - 2.0 * dr * du.y) / r,
                 (a.z - ddr * u.z - 2.0 * dr * du.z) / r)
    return earth_angles(LineOfSight(u, du, ddu))


@compiled
def turned_along(u: Vector, du: Vector, W: float, angle: Radians) -> Vector:
    """Return the unit vector u after a turn by an angle towards its rate du [1/s]; W: length of du."""
    # du / W is the unit vector along the motion.
    cos, sin = math.cos(angle), math.sin(angle) / W if W > 0.0 else 0.0
    return Vector(cos * u.x + sin * du.x, cos * u.y + sin * du.y, cos * u.z + sin * du.z)
