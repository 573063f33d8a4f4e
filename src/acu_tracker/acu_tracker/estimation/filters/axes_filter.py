"""The filters of both axes: one `axis_filter` for the azimuth and one for the elevation of the target.

f, c: records (2,) of axis_filter.Filter and of axis_filter.Constants; m: a Measurement. The prior fields
of a filter hold its prediction.
"""
import math

from acu_tracker.estimation.filters import axis_filter
from acu_tracker.estimation.filters.measurement import Estimate, Innovation
from acu_tracker.geometry.motion import Motion, earth_angles, line_of_sight, turned
from acu_tracker.geometry.vector import Vector, rotated
from pedestal_common.compiled import compiled


@compiled
def start(f, c, m, rate_sigma):
    """Start at a Measurement; rate_sigma: standard deviation of the unknown rates [rad/s]."""
    for i in range(2):
        axis_filter.start(f[i], c[i], m.axis[i].angle, m.axis[i].variance, rate_sigma)


@compiled
def predict(f, c, T):
    """Predict by T [s] >= 0 from the last measurement; the result is in the prior fields."""
    for i in range(2):
        axis_filter.predict(f[i], c[i], T)


@compiled
def innovation(f, c, m):
    """Return the Innovation of a Measurement against the prediction.

    The innovation of the range is NaN, because the filters of the axes use no range.
    """
    return Innovation((axis_filter.innovation(f[0], c[0], m.axis[0]), axis_filter.innovation(f[1], c[1], m.axis[1])),
                      math.nan, math.nan)


@compiled
def correct(f, c, m):
    """Correct the prediction with a Measurement."""
    for i in range(2):
        axis_filter.correct(f[i], c[i], m.axis[i])


@compiled
def expected(f):
    """Return the Motion at the instant of the last `predict`."""
    return Motion(axis_filter.expected_motion(f[0]), axis_filter.expected_motion(f[1]))


@compiled
def outlook(f, c, T):
    """Return the predicted Motion T [s] >= 0 after the last measurement, without a change of the prior fields."""
    return Motion(axis_filter.outlook(f[0], c[0], T), axis_filter.outlook(f[1], c[1], T))


@compiled
def read(f):
    """Return the Estimate at the instant of the last `predict`."""
    azimuth, elevation = axis_filter.expected(f[0]), axis_filter.expected(f[1])
    return Estimate(Motion(azimuth.x, elevation.x), (axis_filter.variances(azimuth), axis_filter.variances(elevation)))


@compiled
def turn(f, c, rotation):
    """Turn both filters into another frame; rotation: Rotation from the old frame into the new one.

    The direction of growing azimuth turns by an angle phi against the old one. Across the line of sight the variance
    of an axis becomes cos2(phi) of its own and sin2(phi) of the variance of the other axis, because the errors of both
    axes are independent. The variance of an azimuth is that across the line of sight over cos2(elevation).
    """
    azimuth, elevation = axis_filter.corrected(f[0]), axis_filter.corrected(f[1])
    motion = earth_angles(turned(rotation, line_of_sight(Motion(azimuth.x, elevation.x))))
    before, after = azimuth.x.angle, motion.azimuth.angle
    across = rotated(rotation, Vector(math.cos(before), -math.sin(before), 0.0))
    cos2 = (across.x * math.cos(after) - across.y * math.sin(after))**2
    scale, per_scale = math.cos(elevation.x.angle)**2, 1.0 / math.cos(motion.elevation.angle)**2
    axis_filter.move(f[0], c[0], motion.azimuth)
    axis_filter.move(f[1], c[1], motion.elevation)
    axis_filter.blend(f[0], c[0], cos2 * scale * per_scale, (1.0 - cos2) * per_scale, elevation.P)
    axis_filter.blend(f[1], c[1], cos2, (1.0 - cos2) * scale, azimuth.P)
