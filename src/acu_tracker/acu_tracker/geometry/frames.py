"""The frames of a line of sight: earth, rotating deck, and the frame of the target filter.

The conversion to the deck is exact: it differentiates the unit vector u to the target twice. M rotates deck -> earth,
or deck -> frame of the filter; M' is its transpose; the suffix _dot is a time derivative:

    M'_dot = -[w x] M',    u_d = M' u,    u_d_dot = M' du - w x u_d
    u_d_dot_dot = M' ddu - w x (2 M' du - w x u_d) - dw x u_d

The equator of the frame of the filter passes through the target, along its motion. In azimuth and elevation of the
earth, a target that flies straight has an acceleration and a jerk that grow towards the zenith. On the equator of this
frame a great circle is an azimuth of constant rate. Therefore the filter needs less process noise, and no direction is
singular. The frame is laid when the filter starts, and again when the target is more than MAX_FRAME_ELEVATION_RAD off
the equator. Between these instants the frame is fixed to the earth.
"""
import math
from typing import NamedTuple

from acu_tracker.geometry.vector import (
    ZERO_VECTOR,
    LineOfSight,
    Motion,
    Rotation,
    Vector,
    angles,
    cross,
    dot,
    earth_angles,
    line_of_sight,
    minus,
    rotated,
    rotated_back,
    rotation,
    times,
    transposed,
    turned,
)
from pedestal_common.compiled import compiled
from pedestal_common.geometry import line_of_sight as pointing
from pedestal_common.quantities import Matrix3, Radians, RadiansPerSecond
from pedestal_common.record import Record


class Attitude(NamedTuple):
    """Attitude of the deck and its motion."""
    mat: Rotation   # M, from the deck to the frame in which the target is given
    w: Vector       # angular rate of the deck, FLU [rad/s]
    dw: Vector      # its angular acceleration, FLU [rad/s2]


@compiled
def on_deck(attitude: Attitude, sight: LineOfSight) -> LineOfSight:
    """Return a LineOfSight on the deck (FLU) of one in the frame to which attitude.mat rotates."""
    u, du, ddu = turned(transposed(attitude.mat), sight)
    wu, dwu = cross(attitude.w, u), cross(attitude.dw, u)
    return LineOfSight(u, minus(du, wu), minus(minus(ddu, cross(attitude.w, minus(times(2.0, du), wu))), dwu))


@compiled
def fixed_rates(w: Vector, A: Radians, E: Radians) -> tuple[RadiansPerSecond, RadiansPerSecond]:
    """Return the rates (dA, dE) of the deck angles A, E of an earth-fixed direction; w: rate of the deck, FLU."""
    u = Vector(*pointing.direction(A, E))
    motion = angles(LineOfSight(u, times(-1.0, cross(w, u)), ZERO_VECTOR))
    return motion.azimuth.rate, motion.elevation.rate


@compiled
def earth_rates(attitude: Attitude, u: Vector, du: Vector) -> tuple[RadiansPerSecond, RadiansPerSecond]:
    """Return the rates (dA, dE), in the frame to which attitude.mat rotates, of a direction that is measured on the
    deck.

    u, du: unit vector (FLU) of the direction and its rate on the deck [1/s]. In the earth frame the latter is M (du +
    w x u).
    """
    wu = cross(attitude.w, u)
    du = Vector(du.x + wu.x, du.y + wu.y, du.z + wu.z)
    motion = earth_angles(LineOfSight(rotated(attitude.mat, u), rotated(attitude.mat, du), ZERO_VECTOR))
    return motion.azimuth.rate, motion.elevation.rate


MAX_FRAME_ELEVATION_RAD = math.radians(20.0)
"""Largest angle [rad] of the target off the equator. At this angle the acceleration of a great circle reaches 0.36 of
the squared rate. A smaller limit lays the frame more often on the way of a target that turns."""


class Frame(Record):
    """Frame of the filter."""
    mat: Matrix3    # rotation frame -> earth


@compiled
def lay(frame: Frame, u: Vector, du: Vector) -> None:
    """Lay the frame: azimuth and elevation 0 are at the target, and the equator leads along its motion. u, du: ENU
    unit vector towards the target and its rate [1/s]. At a target at rest the equator is horizontal."""
    speed, rho = math.sqrt(dot(du, du)), math.hypot(u.x, u.y)
    if speed > 0.0:
        along = Vector(du.x / speed, du.y / speed, du.z / speed)
    elif rho > 0.0:
        along = Vector(u.y / rho, -u.x / rho, 0.0)
    else:
        along = Vector(1.0, 0.0, 0.0)
    up = cross(along, u)
    frame.mat[0, 0], frame.mat[1, 0], frame.mat[2, 0] = along
    frame.mat[0, 1], frame.mat[1, 1], frame.mat[2, 1] = u
    frame.mat[0, 2], frame.mat[1, 2], frame.mat[2, 2] = up


@compiled
def to_earth(frame: Frame, motion: Motion) -> LineOfSight:
    """Return the LineOfSight in ENU of a Motion in the frame."""
    return turned(rotation(frame.mat), line_of_sight(motion))


@compiled
def direction_to_frame(frame: Frame, azimuth: Radians, elevation: Radians) -> tuple[Radians, Radians]:
    """Return (azimuth, elevation) in the frame of a direction in earth angles."""
    e, n, u = pointing.earth_direction(azimuth, elevation)
    v = rotated_back(rotation(frame.mat), Vector(e, n, u))
    return math.atan2(v.x, v.y), math.atan2(v.z, math.hypot(v.x, v.y))


@compiled
def verticals(frame: Frame, azimuth: Radians, elevation: Radians) -> tuple[float, float]:
    """Return (across, along), the vertical components of the unit vectors towards growing azimuth and elevation in the
    frame. In the frame of the earth these components are 0 and cos(elevation). `measurement.attitude_variances` needs
    them to separate the errors of heading and tilt."""
    # z: the earth's vertical, as components in the frame.
    s, c, z = math.sin(azimuth), math.cos(azimuth), frame.mat[2]
    return z[0] * c - z[1] * s, z[2] * math.cos(elevation) - (z[0] * s + z[1] * c) * math.sin(elevation)


@compiled
def from_earth(frame: Frame, mat: Rotation) -> Rotation:
    """Return the Rotation into the frame of a Rotation into the earth's frame."""
    turn, (x, y, z) = rotation(frame.mat), transposed(mat)
    return transposed(Rotation(rotated_back(turn, x), rotated_back(turn, y), rotated_back(turn, z)))


@compiled
def of_deck(frame: Frame, attitude: Attitude) -> Attitude:
    """Return the Attitude deck -> frame of an Attitude deck -> earth."""
    return Attitude(from_earth(frame, attitude.mat), attitude.w, attitude.dw)


@compiled
def earth_shares(frame: Frame, framed: Motion, earth: Motion) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return the shares ((A, E) of azimuth, (A, E) of elevation) that variances of azimuth A and elevation E in the
    frame of the filter have in those of the earth frame. Variances of angles, of rates, and covariances of both have
    the same shares. The correlation of azimuth and elevation is taken as zero, because the filter does not estimate
    it."""
    A, azimuth = framed.azimuth.angle, earth.azimuth.angle
    # Unit vectors of both frames in the direction of growing azimuth, and the square of the cosine of their angle.
    across = rotated(rotation(frame.mat), Vector(math.cos(A), -math.sin(A), 0.0))
    cos2 = (across.x * math.cos(azimuth) - across.y * math.sin(azimuth))**2
    scale = math.cos(framed.elevation.angle)**2     # variance across the line of sight over that of the azimuth
    per_scale = 1.0 / max(math.cos(earth.elevation.angle), 0.01)**2
    return (cos2 * scale * per_scale, (1.0 - cos2) * per_scale), ((1.0 - cos2) * scale, cos2)
