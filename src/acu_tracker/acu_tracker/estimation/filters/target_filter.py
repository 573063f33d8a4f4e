"""The target filter: it holds the filters of both axes and the Cartesian filter, and selects which of them is used.

A filter of each axis (`axis_filter`) always runs. The Cartesian filter (`unscented`) runs if the kind of the filter is
imm_ukf and the receiver measures the range:

1. The Cartesian filter starts from the estimate of the axis filters, when the standard deviation of a measured range
   is at most ukf.range_share of the range.
2. An axis uses the Cartesian filter once this filter knows the rate with at most half the standard deviation of the
   axis filter. This margin avoids a hand-over that gains little.
3. The Cartesian filter stops when the standard deviation of its own range exceeds ukf.range_share of the range. The
   axis filters then continue from its estimate.

Measured rates go to the axis filters only. The prior fields of a filter hold its prediction.
"""
import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated

import numpy as np

from acu_tracker.estimation.filters import axis_filter, unscented
from acu_tracker.estimation.filters.kinds import FILTER_KINDS
from acu_tracker.estimation.filters.measurement import (
    AxisInnovation,
    AxisVariances,
    Estimate,
    Innovation,
    Measurement,
    with_rate,
)
from acu_tracker.geometry.vector import (
    AxisMotion,
    Motion,
    Rotation,
    Vector,
    earth_angles,
    line_of_sight,
    rotated,
    turned,
)
from pedestal_common.compiled import compiled, separate
from pedestal_common.geometry.line_of_sight import wrap
from pedestal_common.quantities import Bit, BothAxes, Floats, Hertz, Ints, Radians, RadiansPerSecond, Records, Seconds
from pedestal_common.record import Record

if TYPE_CHECKING:
    from acu_tracker.estimation.params import FilterParameters, UkfParameters


class Constants(Record):
    """Constants of the filter."""
    axis: BothAxes[axis_filter.Constants]
    cartesian: unscented.Constants
    range_share_2: float    # square of ukf.range_share [-]
    wanted: Annotated[Ints, (2,)]   # of each axis: 1 if its kind uses the Cartesian filter


class Filter(Record):
    """State of the filter."""
    axis: BothAxes[axis_filter.Filter]
    cartesian: unscented.State
    running: Bit        # 1 while the Cartesian filter runs
    used: Annotated[Ints, (2,)]     # of each axis: 1 if the estimate of the Cartesian filter is used
    # time by which the prior fields are predicted from the present estimate; NaN if they belong to an earlier estimate
    predicted: Seconds


def constants(ukf: 'UkfParameters', axes: 'Sequence[FilterParameters]', noise_bandwidth: Hertz) -> Records:
    """Return the constants (1,); noise_bandwidth: that of axis_filter; the Cartesian filter assumes white noise."""
    c = Constants.zeros()
    c['axis'] = np.concatenate([axis_filter.constants(params, noise_bandwidth) for params in axes])
    c['cartesian'], c['range_share_2'] = unscented.constants(ukf), ukf.range_share**2
    c['wanted'] = [FILTER_KINDS[params.kind].cartesian for params in axes]
    return c


@compiled
def start(state: Filter, constants: Constants, measurement: Measurement, rate_sigma: RadiansPerSecond) -> None:
    """Start at a measurement; rate_sigma: standard deviation of the unknown rates."""
    for i in range(2):
        measured = measurement.axis[i]
        axis_filter.start(state.axis[i], constants.axis[i], measured.angle, measured.variance, rate_sigma)
    state.running = state.used[0] = state.used[1] = 0
    state.predicted = math.nan


@compiled
def walk(state: Filter, azimuth: float, elevation: float) -> None:
    """Set the random walk of the error of the measured azimuth and elevation: variances per second [rad2/s]. An INS
    with a slowly changing error causes this walk. The Cartesian filter neglects it."""
    state.axis[0].drift_variance_rate, state.axis[1].drift_variance_rate = azimuth, elevation


@separate
def predict(state: Filter, constants: Constants, T: Seconds) -> None:
    """Predict by T >= 0 from the last measurement into the prior fields; a repeated call does nothing."""
    if state.predicted == T:
        return
    state.predicted = T
    for i in range(2):
        axis_filter.predict(state.axis[i], constants.axis[i], T)
    if state.running:
        unscented.predict(state.cartesian, constants.cartesian, T)


@compiled
def axes_azimuth(state: Filter) -> Radians:
    """Return the predicted azimuth of the axis filter; measured azimuths are put on the wrap nearest to it."""
    return axis_filter.expected_motion(state.axis[0]).angle


@compiled
def innovation(state: Filter, constants: Constants, measurement: Measurement) -> Innovation:
    """Return the innovation of a measurement; rate_chi_square is always that of the axis filter."""
    azimuth = axis_filter.innovation(state.axis[0], constants.axis[0], measurement.axis[0])
    elevation = axis_filter.innovation(state.axis[1], constants.axis[1], measurement.axis[1])
    if not state.running:
        return Innovation((azimuth, elevation), math.nan, math.nan)     # The filters of the axes use no range.
    cartesian = unscented.innovation(state.cartesian, measurement)
    azimuth = _chosen_innovation(state.used[0], azimuth, cartesian.axis[0])
    elevation = _chosen_innovation(state.used[1], elevation, cartesian.axis[1])
    return Innovation((azimuth, elevation), cartesian.range_nu, cartesian.range_S)


@compiled
def _chosen_innovation(used: Bit, own: AxisInnovation, cartesian: AxisInnovation) -> AxisInnovation:
    if not used:
        return own
    # The NaN is the innovation of the rate, because the Cartesian filter uses no measured rate.
    return AxisInnovation(cartesian.nu, cartesian.S, cartesian.chi_square, math.nan, own.rate_chi_square)


@compiled
def correct(state: Filter, constants: Constants, measurement: Measurement) -> None:
    """Correct the prediction with a measurement; `innovation` must have been called with it before."""
    for i in range(2):
        axis_filter.correct(state.axis[i], constants.axis[i], measurement.axis[i])
    if state.running:
        unscented.correct(state.cartesian, measurement)
    state.predicted = math.nan


@compiled
def expected(state: Filter) -> Motion:
    """Return the Motion at the instant of the last `predict`; its azimuth is on the wrap of the axis filter."""
    azimuth, elevation = axis_filter.expected_motion(state.axis[0]), axis_filter.expected_motion(state.axis[1])
    if not (state.used[0] or state.used[1]):
        return Motion(azimuth, elevation)
    cartesian = unscented.expected(state.cartesian)
    if state.used[0]:
        _, dA, ddA = cartesian.azimuth
        azimuth = AxisMotion(azimuth.angle + wrap(cartesian.azimuth.angle - azimuth.angle), dA, ddA)
    return Motion(azimuth, cartesian.elevation if state.used[1] else elevation)


@separate
def outlook(state: Filter, constants: Constants, T: Seconds) -> Motion:
    """Return the Motion T >= 0 after the last measurement, equal to `expected` after `predict`. If only the axis
    filters are used, no covariance is computed."""
    if state.predicted == T or state.used[0] or state.used[1]:
        predict(state, constants, T)
        return expected(state)
    return Motion(axis_filter.outlook(state.axis[0], constants.axis[0], T),
                  axis_filter.outlook(state.axis[1], constants.axis[1], T))


@compiled
def read(state: Filter) -> Estimate:
    """Return the Estimate at the instant of the last `predict`."""
    return _with_cartesian(state, read_axes(state))


@compiled
def _with_cartesian(state: Filter, axes: Estimate) -> Estimate:
    if not (state.used[0] or state.used[1]):
        return axes
    own, (cartesian, _) = axes.variances, unscented.variances(state.cartesian)
    return Estimate(expected(state), (cartesian[0] if state.used[0] else own[0],
                                      cartesian[1] if state.used[1] else own[1]))


@compiled
def read_corrected(state: Filter, constants: Constants) -> Estimate:
    """Return the Estimate at the last measurement, with the variances of the banks. Convergence and the start of
    the Cartesian filter use these, because the stated variances must not change the estimate."""
    if state.running:
        predict(state, constants, 0.0)
    return _with_cartesian(state, _of_banks(state))


@compiled
def read_axes(state: Filter) -> Estimate:
    """Return the Estimate of the axis filters alone, at the instant of their last `predict`."""
    azimuth, elevation = axis_filter.expected(state.axis[0]), axis_filter.expected(state.axis[1])
    return Estimate(Motion(azimuth.x, elevation.x), (axis_filter.variances(state.axis[0], azimuth),
                                                     axis_filter.variances(state.axis[1], elevation)))


@compiled
def _of_banks(state: Filter) -> Estimate:
    (a, A), (e, E) = axis_filter.corrected(state.axis[0]), axis_filter.corrected(state.axis[1])
    return Estimate(Motion(a, e), (AxisVariances(A.p11, A.p12, A.p22), AxisVariances(E.p11, E.p12, E.p22)))


@compiled
def probabilities(state: Filter, constants: Constants, mu: Floats) -> None:
    """Set mu (2, BANK_SIZE) to the probability of each of COLUMN_NAMES on both axes, NaN if not in the filter."""
    for i in range(2):
        axis_filter.probabilities(state.axis[i], constants.axis[i], mu[i])
        if state.used[i]:
            unscented.probabilities(state.cartesian, mu[i])


@compiled
def usable(constants: Constants, measurement: Measurement) -> Measurement:
    """Return the measurement without the rates that the axis filters do not use, and without an invalid range."""
    azimuth, elevation = measurement.axis
    azimuth = with_rate(azimuth, azimuth.rate if constants.axis[0].rate_measurement else math.nan)
    elevation = with_rate(elevation, elevation.rate if constants.axis[1].rate_measurement else math.nan)
    ranged = measurement.range > 0.0 and measurement.range_variance > 0.0
    return Measurement(measurement.stamp, (azimuth, elevation), measurement.range if ranged else math.nan,
                       measurement.range_variance)


@compiled
def select(state: Filter, constants: Constants, measurement: Measurement) -> None:
    """Start, use or leave the Cartesian filter, after a correction or a start with a measurement."""
    if state.running:
        if unscented.range_known(state.cartesian, constants.range_share_2):
            _use_cartesian(state, constants)
        else:
            _leave_cartesian(state, constants, state.used[0], state.used[1])
            state.running = 0
    elif ((constants.wanted[0] or constants.wanted[1])
          and measurement.range_variance <= constants.range_share_2 * measurement.range * measurement.range):
        unscented.start(state.cartesian, constants.cartesian, _of_banks(state), measurement.range,
                        measurement.range_variance)
        state.running, state.predicted = 1, math.nan


@compiled
def _use_cartesian(state: Filter, constants: Constants) -> None:
    """Use the Cartesian filter on each axis that wants it, once it knows the rate twice as well as the axis filter."""
    if (state.used[0] or not constants.wanted[0]) and (state.used[1] or not constants.wanted[1]):
        return
    predict(state, constants, 0.0)
    axes, (cartesian, _) = _of_banks(state).variances, unscented.variances(state.cartesian)
    for i in range(2):
        if constants.wanted[i] and cartesian[i].p22 <= 0.25 * axes[i].p22:
            state.used[i] = 1


@compiled
def _leave_cartesian(state: Filter, constants: Constants, azimuth: Bit, elevation: Bit) -> None:
    """Leave the Cartesian filter on axes whose argument is 1; a finite estimate of it goes to their axis filters."""
    if not (azimuth or elevation):
        return
    predict(state, constants, 0.0)
    motion = expected(state)
    for i, leaves in enumerate((azimuth, elevation)):
        if leaves:
            if math.isfinite(motion[i].angle + motion[i].rate + motion[i].acceleration):
                axis_filter.move(state.axis[i], constants.axis[i], motion[i])
            state.used[i] = 0
    state.predicted = math.nan


@compiled
def transfer(state: Filter, constants: Constants, running: Bit) -> None:
    """Adopt constants that may have changed: a filter of a new kind continues from the estimate, if one is running."""
    state.predicted = math.nan
    if running:
        for i in range(2):
            axis_filter.transfer(state.axis[i], constants.axis[i])
    _leave_cartesian(state, constants, state.used[0] and not constants.wanted[0],
                     state.used[1] and not constants.wanted[1])
    if not (constants.wanted[0] or constants.wanted[1]):
        state.running = 0


@compiled
def turn(state: Filter, constants: Constants, rotation: Rotation) -> None:
    """Turn the estimate and its covariances into another frame; rotation: matrix from the old frame into the new one.

    The direction of growing azimuth turns by an angle phi against the old one. Across the line of sight the variance
    of an axis becomes cos2(phi) of its own and sin2(phi) of the variance of the other axis, because the errors of both
    axes are independent. The variance of an azimuth is that across the line of sight over cos2(elevation). The
    probabilities of the models turn likewise, because an acceleration belongs to a direction and not to an axis.
    """
    azimuth, elevation = axis_filter.corrected(state.axis[0]), axis_filter.corrected(state.axis[1])
    motion = earth_angles(turned(rotation, line_of_sight(Motion(azimuth.x, elevation.x))))
    before, after = azimuth.x.angle, motion.azimuth.angle
    across = rotated(rotation, Vector(math.cos(before), -math.sin(before), 0.0))
    cos2 = (across.x * math.cos(after) - across.y * math.sin(after))**2
    scale, per_scale = math.cos(elevation.x.angle)**2, 1.0 / math.cos(motion.elevation.angle)**2
    own = cos2 * scale * per_scale, cos2
    share = (1.0 - cos2) * per_scale, (1.0 - cos2) * scale
    others = elevation.P, azimuth.P
    if state.axis[0].bank == state.axis[1].bank:
        for j in range(state.axis[0].count):
            mu = state.axis[0].mu[j], state.axis[1].mu[j]
            for i in range(2):
                state.axis[i].mu[j] = cos2 * mu[i] + (1.0 - cos2) * mu[1 - i]
    for i in range(2):
        axis_filter.move(state.axis[i], constants.axis[i], motion[i])
        axis_filter.blend(state.axis[i], constants.axis[i], own[i], share[i], others[i])
    if state.running:
        unscented.turn(state.cartesian, rotation)
    state.predicted = math.nan
