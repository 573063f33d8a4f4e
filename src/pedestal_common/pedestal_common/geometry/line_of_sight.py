"""Line-of-sight geometry: directions in the frames of beam, deck and earth, which pedestal_common defines.

    b, c, e         components of a vector along the beam, in cross-elevation and in elevation
    db, dc, de      time derivatives of b, c, e
    sa, ca, se, ce  sine and cosine of the azimuth, sine and cosine of the elevation
"""
import math

import numpy as np

from pedestal_common.compiled import compiled
from pedestal_common.quantities import Direction, Matrix3, Radians, RadiansPerSecond, Xyz


@compiled
def wrap(angle: Radians) -> Radians:
    """Return the same angle in [-pi, pi)."""
    return angle - 2.0 * math.pi * math.floor((angle + math.pi) / (2.0 * math.pi))


@compiled
def cross(ax: float, ay: float, az: float, bx: float, by: float, bz: float) -> Xyz:
    """Return a x b."""
    return ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx


@compiled
def direction(azimuth: Radians, elevation: Radians) -> Xyz:
    """Return the unit vector of an azimuth (clockwise): FLU of deck angles, north-west-up of earth angles."""
    cos_el = math.cos(elevation)
    return cos_el * math.cos(azimuth), -cos_el * math.sin(azimuth), math.sin(elevation)


@compiled
def angles(x: float, y: float, z: float) -> Direction:
    """Return azimuth (clockwise) and elevation of a vector of any length, FLU or north-west-up as in `direction`."""
    return math.atan2(-y, x), math.atan2(z, math.hypot(x, y))


@compiled
def earth_angles(east: float, north: float, up: float) -> Direction:
    """Return azimuth clockwise from north and elevation of an ENU vector."""
    return angles(north, -east, up)


@compiled
def earth_direction(azimuth: Radians, elevation: Radians) -> Xyz:
    """Return the ENU unit vector of an azimuth clockwise from north and an elevation."""
    north, west, up = direction(azimuth, elevation)
    return -west, north, up


@compiled
def to_earth(mat_ed: Matrix3, x: float, y: float, z: float) -> Xyz:
    """Return a deck vector (FLU) in ENU; mat_ed rotates deck -> earth."""
    return (mat_ed[0, 0] * x + mat_ed[0, 1] * y + mat_ed[0, 2] * z,
            mat_ed[1, 0] * x + mat_ed[1, 1] * y + mat_ed[1, 2] * z,
            mat_ed[2, 0] * x + mat_ed[2, 1] * y + mat_ed[2, 2] * z)


@compiled
def to_deck(mat_ed: Matrix3, east: float, north: float, up: float) -> Xyz:
    """Return an ENU vector in the deck frame (FLU); the transpose of to_earth."""
    return (mat_ed[0, 0] * east + mat_ed[1, 0] * north + mat_ed[2, 0] * up,
            mat_ed[0, 1] * east + mat_ed[1, 1] * north + mat_ed[2, 1] * up,
            mat_ed[0, 2] * east + mat_ed[1, 2] * north + mat_ed[2, 2] * up)


@compiled
def offsets(azimuth: Radians, elevation: Radians, x: float, y: float, z: float) -> tuple[Radians, Radians]:
    """Return the offset (dX, dE) of a direction, a vector of any length in the frame of the angles of the beam.

    The cross-elevation dX is positive in the direction of growing azimuth, the elevation dE is positive upwards. The
    offset is azimuthal equidistant: its length hypot(dX, dE) is the angle between beam and direction, exact up to 180
    deg.
    """
    sa, ca, se, ce = math.sin(azimuth), math.cos(azimuth), math.sin(elevation), math.cos(elevation)
    b = ce * ca * x - ce * sa * y + se * z
    c = -sa * x - ca * y
    e = -se * ca * x + se * sa * y + ce * z
    across = math.hypot(c, e)
    if across == 0.0:
        return 0.0, 0.0
    # scale: angle between beam and direction, divided by the length of the direction across the beam.
    scale = math.atan2(across, b) / across
    return scale * c, scale * e


@compiled
def offset_rates(beam: Direction, beam_rate: tuple[RadiansPerSecond, RadiansPerSecond], r: Xyz,
                 v: Xyz) -> tuple[RadiansPerSecond, RadiansPerSecond]:
    """Return the time derivative of `offsets`, of a direction r with its derivative v."""
    azimuth, elevation = beam
    azimuth_rate, elevation_rate = beam_rate
    x, y, z = r
    dx, dy, dz = v
    sa, ca, se, ce = math.sin(azimuth), math.cos(azimuth), math.sin(elevation), math.cos(elevation)
    b, c, e = ce * ca * x - ce * sa * y + se * z, -sa * x - ca * y, -se * ca * x + se * sa * y + ce * z
    # The axes of the beam turn: the azimuth rate couples c with b (factor ce) and with e (factor se), the elevation
    # rate couples b with e.
    db = ce * ca * dx - ce * sa * dy + se * dz + azimuth_rate * ce * c + elevation_rate * e
    dc = -sa * dx - ca * dy + azimuth_rate * (se * e - ce * b)
    de = -se * ca * dx + se * sa * dy + ce * dz - azimuth_rate * se * c - elevation_rate * b
    across = math.hypot(c, e)
    if across == 0.0:
        return dc / b, de / b
    # theta: angle between beam and direction; scale: as in `offsets`; rise: time derivative of scale.
    theta = math.atan2(across, b)
    across_rate = (c * dc + e * de) / across
    scale = theta / across
    rise = ((b * across_rate - across * db) / (b * b + across * across) - scale * across_rate) / across
    return scale * dc + rise * c, scale * de + rise * e


@compiled
def displaced(azimuth: Radians, elevation: Radians, cross_elevation: Radians, elevation_error: Radians) -> Direction:
    """Return azimuth and elevation of the direction at an offset (dX, dE) from the beam: the inverse of `offsets`. The
    azimuth is within pi of the azimuth of the beam."""
    theta = math.hypot(cross_elevation, elevation_error)
    sinc = math.sin(theta) / theta if theta > 0.0 else 1.0
    b, c, e = math.cos(theta), sinc * cross_elevation, sinc * elevation_error
    se, ce = math.sin(elevation), math.cos(elevation)
    along, up = ce * b - se * e, se * b + ce * e
    return azimuth + math.atan2(c, along), math.atan2(up, math.hypot(along, c))


@compiled
def displaced_motion(azimuth: Radians, elevation: Radians, azimuth_rate: RadiansPerSecond,
                     elevation_rate: RadiansPerSecond, cross_elevation: Radians, elevation_error: Radians,
                     cross_elevation_rate: RadiansPerSecond,
                     elevation_error_rate: RadiansPerSecond) -> tuple[float, float, float, float, float, float]:
    """Return the unit vector of the direction at an offset from the beam, and its time derivative [1/s], FLU for deck
    angles, north-west-up for earth angles. See `offsets`, `offset_rates`."""
    theta2 = cross_elevation * cross_elevation + elevation_error * elevation_error
    theta = math.sqrt(theta2)
    cos_theta = math.cos(theta)
    sinc = math.sin(theta) / theta if theta > 0.0 else 1.0
    # bend: derivative of sinc by theta, divided by theta. Near 0 this quotient would lose digits, so the first two
    # terms of its series replace it.
    bend = (cos_theta - sinc) / theta2 if theta2 > 1e-4 else -1.0 / 3.0 + theta2 / 30.0
    along = cross_elevation * cross_elevation_rate + elevation_error * elevation_error_rate
    b, c, e = cos_theta, sinc * cross_elevation, sinc * elevation_error
    db = -sinc * along
    dc = sinc * cross_elevation_rate + bend * along * cross_elevation
    de = sinc * elevation_error_rate + bend * along * elevation_error
    sa, ca, se, ce = math.sin(azimuth), math.cos(azimuth), math.sin(elevation), math.cos(elevation)
    db -= azimuth_rate * ce * c + elevation_rate * e
    dc += azimuth_rate * (ce * b - se * e)
    de += azimuth_rate * se * c + elevation_rate * b
    return (ce * ca * b - sa * c - se * ca * e, -ce * sa * b - ca * c + se * sa * e, se * b + ce * e,
            ce * ca * db - sa * dc - se * ca * de, -ce * sa * db - ca * dc + se * sa * de, se * db + ce * de)


@compiled
def rows(qx: float, qy: float, qz: float, qw: float) -> tuple[Xyz, Xyz, Xyz]:
    """Return the three rows of the rotation matrix of a unit quaternion (x, y, z, w)."""
    return ((1 - 2 * (qy * qy + qz * qz), 2 * (qx * qy - qz * qw), 2 * (qx * qz + qy * qw)),
            (2 * (qx * qy + qz * qw), 1 - 2 * (qx * qx + qz * qz), 2 * (qy * qz - qx * qw)),
            (2 * (qx * qz - qy * qw), 2 * (qy * qz + qx * qw), 1 - 2 * (qx * qx + qy * qy)))


@compiled
def rotation(qx: float, qy: float, qz: float, qw: float, mat: Matrix3) -> None:
    """Fill mat with the rotation of a unit quaternion (x, y, z, w)."""
    x, y, z = rows(qx, qy, qz, qw)
    mat[0, 0], mat[0, 1], mat[0, 2] = x
    mat[1, 0], mat[1, 1], mat[1, 2] = y
    mat[2, 0], mat[2, 1], mat[2, 2] = z


@compiled
def quaternion(roll: Radians, pitch: Radians, yaw: Radians) -> tuple[float, float, float, float]:
    """Return the quaternion deck -> earth of angles about fixed axes (REP 103). At yaw 0 the bow points east."""
    cr, sr = math.cos(0.5 * roll), math.sin(0.5 * roll)
    cp, sp = math.cos(0.5 * pitch), math.sin(0.5 * pitch)
    cy, sy = math.cos(0.5 * yaw), math.sin(0.5 * yaw)
    return (sr * cp * cy - cr * sp * sy, cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy, cr * cp * cy + sr * sp * sy)


ASHORE_ATTITUDE = (0.0, 0.0, math.sqrt(0.5), math.sqrt(0.5))
"""Quaternion (x, y, z, w) deck -> earth of a pedestal ashore: the bow points north."""


def ashore_matrix() -> Matrix3:
    """Return mat_ed of a pedestal ashore."""
    return np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
