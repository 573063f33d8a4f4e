"""The frame of the target filter: the earth frame, or near the zenith a tilted frame.

Azimuth and elevation are singular at the zenith. Above TILT_ELEVATION_RAD the filter therefore changes to a tilted
frame, whose equator is laid along the motion of the target. There the elevation of the target stays near 0, and a
target that moves along a great circle has a constant azimuth rate. Below LEVEL_ELEVATION_RAD the filter changes back.

f: record of FRAME_DTYPE. A frame is level while it is the earth frame.
"""
import math

import numpy as np

from acu_tracker.geometry.deck_reference import Attitude
from acu_tracker.geometry.motion import LineOfSight, earth_angles, line_of_sight
from acu_tracker.geometry.vector import Rotation, Vector, cross, dot, rotated, rotated_back, rotation, transposed
from pedestal_common.compiled import compiled
from pedestal_common.geometry.line_of_sight import earth_direction

TILT_ELEVATION_RAD, LEVEL_ELEVATION_RAD = math.radians(75.0), math.radians(70.0)
"""Earth elevations [rad]: above the first the frame is tilted, below the second it is level again."""

FRAME_DTYPE = np.dtype([('mat', 'f8', (3, 3)), ('tilted', 'i8')], align=True)
"""mat: rotation matrix frame -> earth; tilted: 1 while the frame is tilted, 0 while it is the earth frame."""


@compiled
def level(f):
    """Set the frame to the earth frame."""
    f.tilted = 0
    for i in range(3):
        for j in range(3):
            f.mat[i, j] = 1.0 if i == j else 0.0


@compiled
def tilt(f, u, du):
    """Tilt the frame: azimuth and elevation 0 are at the target, and the equator leads along its motion.

    u, du: ENU unit vector towards the target and its rate [1/s].
    """
    W = math.sqrt(dot(du, du))
    if W > 0.0:
        along = Vector(du.x / W, du.y / W, du.z / W)
    else:
        # Because a target at rest has no direction of motion, the equator is laid towards east.
        rho = math.sqrt(u.y * u.y + u.z * u.z)
        along = Vector(rho, -u.x * u.y / rho, -u.x * u.z / rho) if rho > 0.0 else Vector(0.0, 0.0, 0.0)
    up = cross(along, u)
    f.mat[0, 0], f.mat[1, 0], f.mat[2, 0] = along
    f.mat[0, 1], f.mat[1, 1], f.mat[2, 1] = u
    f.mat[0, 2], f.mat[1, 2], f.mat[2, 2] = up
    f.tilted = 1


@compiled
def to_earth(f, motion):
    """Return the LineOfSight in ENU; motion: the Motion in the frame."""
    sight = line_of_sight(motion)
    if not f.tilted:
        return sight
    mat = rotation(f.mat)
    return LineOfSight(rotated(mat, sight.u), rotated(mat, sight.du), rotated(mat, sight.ddu))


@compiled
def to_frame(f, sight):
    """Return the Motion in the frame; sight: the LineOfSight in ENU. The function is the inverse of to_earth."""
    if f.tilted:
        mat = rotation(f.mat)
        sight = LineOfSight(rotated_back(mat, sight.u), rotated_back(mat, sight.du), rotated_back(mat, sight.ddu))
    return earth_angles(sight)


@compiled
def direction_to_frame(f, azimuth, elevation):
    """Return (azimuth, elevation) [rad] of a direction in the frame; azimuth, elevation: its earth angles [rad]."""
    e, n, u = earth_direction(azimuth, elevation)
    v = rotated_back(rotation(f.mat), Vector(e, n, u))
    return math.atan2(v.x, v.y), math.atan2(v.z, math.hypot(v.x, v.y))


@compiled
def verticals(f, azimuth, elevation):
    """Return (across, along), the vertical components of two unit vectors at a right angle to a direction.

    The first vector points to growing azimuth, the second to growing elevation. In a level frame their components
    along the earth's vertical are 0 and cos(elevation). `measurement.attitude_variances` needs these components to
    separate the errors of heading and tilt. azimuth, elevation: angles of the direction in the frame [rad].
    """
    # z: the earth's vertical, as components in the frame.
    s, c, z = math.sin(azimuth), math.cos(azimuth), f.mat[2]
    return z[0] * c - z[1] * s, z[2] * math.cos(elevation) - (z[0] * s + z[1] * c) * math.sin(elevation)


@compiled
def of_deck(f, attitude):
    """Return the Attitude deck -> frame; attitude: the Attitude deck -> earth."""
    mat, (x, y, z) = rotation(f.mat), transposed(attitude.mat)
    columns = Rotation(rotated_back(mat, x), rotated_back(mat, y), rotated_back(mat, z))
    return Attitude(transposed(columns), attitude.w, attitude.dw)


@compiled
def earth_variances(f, framed, earth, p_A, p_E):
    """Return the variances of azimuth and elevation in the earth frame, in the unit of p_A and p_E.

    p_A, p_E       variances of azimuth and elevation in the frame of the filter, of angles [rad2] or of rates; or the
                   covariances of angle and rate
    framed, earth  Motion of the target in the frame of the filter and in the earth frame

    The correlation of azimuth and elevation is taken as zero, because the filter does not estimate it.
    """
    A, E = framed.azimuth.angle, framed.elevation.angle
    azimuth, elevation = earth.azimuth.angle, earth.elevation.angle
    # Unit vectors of both frames in the direction of growing azimuth, and the cosine c of the angle between them.
    across = rotated(rotation(f.mat), Vector(math.cos(A), -math.sin(A), 0.0))
    c = across.x * math.cos(azimuth) - across.y * math.sin(azimuth)
    p_across = p_A * math.cos(E)**2
    cos_el = max(math.cos(elevation), 0.01)
    return (c * c * p_across + (1.0 - c * c) * p_E) / (cos_el * cos_el), c * c * p_E + (1.0 - c * c) * p_across
