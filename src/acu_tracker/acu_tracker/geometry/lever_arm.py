"""The lever arm r, the vector (FLU) from the INS to the antenna; it shifts the direction of a target of measured
range.

Because the antenna of a rolling ship moves, a near target appears to move by the angle |r| / range. Seen from the INS
the target does not move so. With a measured range the filter uses the line of sight from the INS. The ranges R from
the INS and rho from the antenna follow R = |rho u + r|; u: unit vector from the antenna to the target.
"""
import math

from acu_tracker.geometry.vector import (
    ZERO_VECTOR,
    AxisMotion,
    LineOfSight,
    Motion,
    Rotation,
    Vector,
    minus,
    normalised,
    rotated,
    vector,
)
from pedestal_common.compiled import compiled
from pedestal_common.geometry.lever_arm import LeverArm as LeverArmParameters
from pedestal_common.geometry.line_of_sight import earth_angles, earth_direction, wrap
from pedestal_common.quantities import Bit, Meters, Vector3
from pedestal_common.record import Record


class LeverArm(Record):
    """State of the conversion."""
    arm: Vector3    # r / R, FLU [-]; zero without a range
    range: Meters   # smoothed R; 0 if the filter started without a range


RANGE_SMOOTHING_SHARE = 0.05  # share of each new measurement in the smoothed range [-]


@compiled
def from_ins(state: LeverArm, arm: LeverArmParameters, measured: Meters, running: Bit, v: Vector) -> Vector:
    """Return the direction of the target from the INS, a vector (FLU) of length about 1; v: unit vector from the
    antenna.

    measured: range from the antenna; NaN: no range; running: True if the filter of the target runs. For a filter that
    started with a range the function smooths R and adds the lever arm to rho v. For another filter it returns v. This
    avoids an estimate that mixes the lines of sight from the INS and from the antenna.
    """
    along, r2 = v.x * arm.x + v.y * arm.y + v.z * arm.z, arm.x * arm.x + arm.y * arm.y + arm.z * arm.z
    known = measured > 0.0
    R = math.sqrt(measured * measured + 2.0 * measured * along + r2) if known else 0.0
    if not running:
        state.range = R
    elif state.range > 0.0 and known:
        state.range += RANGE_SMOOTHING_SHARE * (R - state.range)
    if not state.range > math.sqrt(r2):
        state.arm[:] = 0.0
        return v
    k = 1.0 / state.range
    state.arm[0], state.arm[1], state.arm[2] = k * arm.x, k * arm.y, k * arm.z
    rho = k * (math.sqrt(along * along + state.range * state.range - r2) - along)
    return Vector(rho * v.x + state.arm[0], rho * v.y + state.arm[1], rho * v.z + state.arm[2])


@compiled
def to_antenna(state: LeverArm, sight: LineOfSight) -> LineOfSight:
    """Return the LineOfSight from the antenna of one from the INS, both FLU: minus r / R, with R taken as constant."""
    return normalised(minus(sight.u, vector(state.arm)), sight.du, sight.ddu)


@compiled
def to_ins(state: LeverArm, u: Vector, du: Vector) -> tuple[Vector, Vector]:
    """Return (unit vector from the INS to the target, its rate [1/s]) of those from the antenna, all FLU."""
    sight = normalised(Vector(u.x + state.arm[0], u.y + state.arm[1], u.z + state.arm[2]), du, ZERO_VECTOR)
    return sight.u, sight.du


@compiled
def earth_angles_to_antenna(state: LeverArm, mat_ed: Rotation, motion: Motion) -> Motion:
    """Return the Motion in earth angles as seen from the antenna; motion: that seen from the INS. Only the angles
    differ; the rates and the accelerations stay as they are."""
    A, E = motion.azimuth.angle, motion.elevation.angle
    e, n, u = earth_direction(A, E)
    r = rotated(mat_ed, vector(state.arm))
    azimuth, elevation = earth_angles(e - r.x, n - r.y, u - r.z)
    return Motion(AxisMotion(A + wrap(azimuth - A), motion.azimuth.rate, motion.azimuth.acceleration),
                  AxisMotion(elevation, motion.elevation.rate, motion.elevation.acceleration))
