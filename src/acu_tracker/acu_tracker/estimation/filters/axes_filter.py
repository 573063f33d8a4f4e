"""The filters of both axes: one `axis_filter` for the azimuth and one for the elevation of the target.

The prior fields of a filter hold its prediction.
"""
import math

from acu_tracker.estimation.filters import axis_filter
from acu_tracker.estimation.filters.measurement import Estimate, Innovation, Measurement
from acu_tracker.geometry.motion import Motion, earth_angles, line_of_sight, turned
from acu_tracker.geometry.vector import Rotation, Vector, rotated
from pedestal_common.compiled import compiled
from pedestal_common.quantities import BothAxes, RadiansPerSecond, Seconds


@compiled
def start(filters: BothAxes[axis_filter.Filter], constants: BothAxes[axis_filter.Constants], measurement: Measurement,
          rate_sigma: RadiansPerSecond) -> None:
    """Start at a measurement; rate_sigma: standard deviation of the unknown rates."""
    for i in range(2):
        measured = measurement.axis[i]
        axis_filter.start(filters[i], constants[i], measured.angle, measured.variance, rate_sigma)


@compiled
def predict(filters: BothAxes[axis_filter.Filter], constants: BothAxes[axis_filter.Constants], T: Seconds) -> None:
    """Predict by T >= 0 from the last measurement; the result is in the prior fields."""
    for i in range(2):
        axis_filter.predict(filters[i], constants[i], T)


@compiled
def innovation(filters: BothAxes[axis_filter.Filter], constants: BothAxes[axis_filter.Constants],
               measurement: Measurement) -> Innovation:
    """Return the innovation of a measurement against the prediction.

    The innovation of the range is NaN, because the filters of the axes use no range.
    """
    azimuth = axis_filter.innovation(filters[0], constants[0], measurement.axis[0])
    elevation = axis_filter.innovation(filters[1], constants[1], measurement.axis[1])
    return Innovation((azimuth, elevation), math.nan, math.nan)


@compiled
def correct(filters: BothAxes[axis_filter.Filter], constants: BothAxes[axis_filter.Constants],
            measurement: Measurement) -> None:
    """Correct the prediction with a measurement."""
    for i in range(2):
        axis_filter.correct(filters[i], constants[i], measurement.axis[i])


@compiled
def expected(filters: BothAxes[axis_filter.Filter]) -> Motion:
    """Return the Motion at the instant of the last `predict`."""
    return Motion(axis_filter.expected_motion(filters[0]), axis_filter.expected_motion(filters[1]))


@compiled
def outlook(filters: BothAxes[axis_filter.Filter], constants: BothAxes[axis_filter.Constants], T: Seconds) -> Motion:
    """Return the predicted Motion T >= 0 after the last measurement, without a change of the prior fields."""
    return Motion(axis_filter.outlook(filters[0], constants[0], T), axis_filter.outlook(filters[1], constants[1], T))


@compiled
def read(filters: BothAxes[axis_filter.Filter]) -> Estimate:
    """Return the Estimate at the instant of the last `predict`."""
    azimuth, elevation = axis_filter.expected(filters[0]), axis_filter.expected(filters[1])
    return Estimate(Motion(azimuth.x, elevation.x), (axis_filter.variances(azimuth), axis_filter.variances(elevation)))


@compiled
def turn(filters: BothAxes[axis_filter.Filter], constants: BothAxes[axis_filter.Constants],
         rotation: Rotation) -> None:
    """Turn both filters into another frame; rotation: from the old frame into the new one.

    The direction of growing azimuth turns by an angle phi against the old one. Across the line of sight the variance
    of an axis becomes cos2(phi) of its own and sin2(phi) of the variance of the other axis, because the errors of both
    axes are independent. The variance of an azimuth is that across the line of sight over cos2(elevation).
    """
    azimuth, elevation = axis_filter.corrected(filters[0]), axis_filter.corrected(filters[1])
    motion = earth_angles(turned(rotation, line_of_sight(Motion(azimuth.x, elevation.x))))
    before, after = azimuth.x.angle, motion.azimuth.angle
    across = rotated(rotation, Vector(math.cos(before), -math.sin(before), 0.0))
    cos2 = (across.x * math.cos(after) - across.y * math.sin(after))**2
    scale, per_scale = math.cos(elevation.x.angle)**2, 1.0 / math.cos(motion.elevation.angle)**2
    axis_filter.move(filters[0], constants[0], motion.azimuth)
    axis_filter.move(filters[1], constants[1], motion.elevation)
    axis_filter.blend(filters[0], constants[0], cos2 * scale * per_scale, (1.0 - cos2) * per_scale, elevation.P)
    axis_filter.blend(filters[1], constants[1], cos2, (1.0 - cos2) * scale, azimuth.P)
