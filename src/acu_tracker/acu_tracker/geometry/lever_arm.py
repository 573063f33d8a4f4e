"""The arm r from the INS to the antenna, used if the range is measured.

The antenna of a rolling ship moves, so that a near target appears to move by r / range. Seen from the INS it does not.

    R = |rho u + r|    R, rho: range of the target from the INS and from the antenna [m]; u: unit vector to the target
"""
import math

import numpy as np

from acu_tracker.geometry.motion import AxisMotion, Motion, normalised
from acu_tracker.geometry.vector import Vector, minus, rotated, vector
from pedestal_common.compiled import compiled
from pedestal_common.geometry.line_of_sight import earth_angles, earth_direction, wrap

LEVER_ARM_DTYPE = np.dtype([('arm', 'f8', (3,)), ('range', 'f8')], align=True)
"""arm: r over the range from the INS, FLU [-]; range: that range [m], 0 if it was not measured."""

RANGE_SMOOTHING_SHARE = 0.05
"""Share of a new range in the smoothed range [-]."""


@compiled
def from_ins(s, r, measured, running, v):
    """Return the direction from the INS of a unit vector v (FLU) measured at the antenna: a Vector of length about 1.

    r: the arm, record x, y, z [m]; measured: range of the antenna [m], NaN for none; running: whether a filter runs.

    With a range the estimate is the line of sight from the INS, which the deck's rotation does not move: R is
    smoothed, and the arm is added. Only a filter that starts with a range does so. This avoids an estimate that mixes
    both lines of sight.
    """
    along, r2 = v.x * r.x + v.y * r.y + v.z * r.z, r.x * r.x + r.y * r.y + r.z * r.z
    known = measured > 0.0
    R = math.sqrt(measured * measured + 2.0 * measured * along + r2) if known else 0.0
    if not running:
        s.range = R
    elif s.range > 0.0 and known:
        s.range += RANGE_SMOOTHING_SHARE * (R - s.range)
    if not s.range > math.sqrt(r2):
        s.arm[:] = 0.0
        return v
    k = 1.0 / s.range
    s.arm[0], s.arm[1], s.arm[2] = k * r.x, k * r.y, k * r.z
    rho = k * (math.sqrt(along * along + s.range * s.range - r2) - along)
    return Vector(rho * v.x + s.arm[0], rho * v.y + s.arm[1], rho * v.z + s.arm[2])


@compiled
def to_antenna(s, sight):
    """Return the LineOfSight at the antenna of one at the INS, both FLU: v = u - r; the range is taken as constant."""
    return normalised(minus(sight.u, vector(s.arm)), sight.du, sight.ddu)


@compiled
def to_ins(s, u, du):
    """Return (u, du) at the INS of a unit vector u and its rate du [1/s] at the antenna, both FLU."""
    sight = normalised(Vector(u.x + s.arm[0], u.y + s.arm[1], u.z + s.arm[2]), du, Vector(0.0, 0.0, 0.0))
    return sight.u, sight.du


@compiled
def earth_angles_to_antenna(s, mat_ed, motion):
    """Return the Motion in earth angles at the antenna of a Motion at the INS;
    mat_ed: Rotation deck -> earth; the rates stay."""
    A, E = motion.azimuth.angle, motion.elevation.angle
    e, n, u = earth_direction(A, E)
    r = rotated(mat_ed, vector(s.arm))
    azimuth, elevation = earth_angles(e - r.x, n - r.y, u - r.z)
    return Motion(AxisMotion(A + wrap(azimuth - A), motion.azimuth.rate, motion.azimuth.acceleration),
                  AxisMotion(elevation, motion.elevation.rate, motion.elevation.acceleration))
