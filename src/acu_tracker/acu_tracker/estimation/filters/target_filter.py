"""The target filter: it holds the filters of both axes and the Cartesian filter, and selects which of them is used.

The filters of the axes (`axes_filter`) always run. The Cartesian filter (`unscented`) runs if the kind of the filter
is imm_ukf and the receiver measures the range:

1. The Cartesian filter starts from the estimate of the axis filters, when the standard deviation of a measured range
   is at most ukf.range_share of the range.
2. An axis uses the Cartesian filter once this filter knows the rate with at most half the standard deviation of the
   axis filter. This margin avoids a hand-over that gains little.
3. The Cartesian filter stops when the standard deviation of its own range exceeds ukf.range_share of the range. The
   axis filters then continue from its estimate.

Measured rates go to the axis filters only. The prior fields of a filter hold its prediction.

f, c: records of Filter and of Constants; m: a Measurement.
"""
import math
from typing import Annotated

import numpy as np

from acu_tracker.estimation.filters import axes_filter, axis_filter, unscented
from acu_tracker.estimation.filters.kinds import FILTER_KINDS
from acu_tracker.estimation.filters.measurement import AxisInnovation, Estimate, Innovation, Measurement, with_rate
from acu_tracker.geometry.motion import AxisMotion, Motion
from pedestal_common.compiled import compiled, separate
from pedestal_common.geometry.line_of_sight import wrap
from pedestal_common.quantities import BothAxes, Ints
from pedestal_common.record import Record


class Constants(Record):
    """Constants of the filter."""
    axis: BothAxes[axis_filter.Constants]  # axis, cartesian: constants of the axis filters and of the Cartesian filter
    cartesian: unscented.Constants
    range_share_2: float  # square of ukf.range_share [-]
    wanted: Annotated[Ints, (2,)]  # of each axis: 1 if its kind uses the Cartesian filter


class Filter(Record):
    """State of the filter."""
    axis: BothAxes[axis_filter.Filter]  # axis, cartesian: states of the axis filters and of the Cartesian filter
    cartesian: unscented.State
    running: int  # 1 while the Cartesian filter runs
    used: Annotated[Ints, (2,)]  # of each axis: 1 if the estimate of the Cartesian filter is used
    # time by which the prior fields are predicted from the present estimate [s]; NaN if they belong to an earlier
    # estimate
    predicted: float


def constants(ukf, axes, noise_bandwidth) -> np.ndarray:
    """Return the constants (1,).

    ukf              UkfParameters
    axes             FilterParameters of both axes
    noise_bandwidth  bandwidth of the noise of the measured angles [Hz]; 0: white noise. The Cartesian filter always
                     assumes white noise
    """
    c = Constants.zeros()
    c['axis'] = np.concatenate([axis_filter.constants(params, noise_bandwidth) for params in axes])
    c['cartesian'], c['range_share_2'] = unscented.constants(ukf), ukf.range_share**2
    c['wanted'] = [FILTER_KINDS[params.kind].cartesian for params in axes]
    return c


@compiled
def start(f, c, m, rate_sigma):
    """Start at a Measurement; rate_sigma: standard deviation of the unknown rates [rad/s]."""
    axes_filter.start(f.axis, c.axis, m, rate_sigma)
    f.running = f.used[0] = f.used[1] = 0
    f.predicted = math.nan


@compiled
def walk(f, azimuth, elevation):
    """Set the random walk of the error of the measured azimuth and elevation: variances per second [rad2/s].

    An INS with a slowly changing error causes this walk. The Cartesian filter neglects it.
    """
    f.axis[0].drift_variance_rate, f.axis[1].drift_variance_rate = azimuth, elevation


@separate
def predict(f, c, T):
    """Predict by T [s] >= 0 from the last measurement; the result is in the prior fields.

    A repeated call with the same T does nothing.
    """
    if f.predicted == T:
        return
    f.predicted = T
    axes_filter.predict(f.axis, c.axis, T)
    if f.running:
        unscented.predict(f.cartesian, c.cartesian, T)


@compiled
def axes_azimuth(f):
    """Return the azimuth [rad] that the axis filter predicted; measured azimuths are put on the wrap nearest to it."""
    return axis_filter.expected_motion(f.axis[0]).angle


@compiled
def innovation(f, c, m):
    """Return the Innovation of a Measurement against the prediction.

    rate_chi_square is always that of the axis filter.
    """
    axes = axes_filter.innovation(f.axis, c.axis, m)
    if not f.running:
        return axes
    cartesian = unscented.innovation(f.cartesian, m)
    azimuth = _chosen_innovation(f.used[0], axes.axis[0], cartesian.axis[0])
    elevation = _chosen_innovation(f.used[1], axes.axis[1], cartesian.axis[1])
    return Innovation((azimuth, elevation), cartesian.range_nu, cartesian.range_S)


@compiled
def _chosen_innovation(used, own, cartesian):
    """Return the AxisInnovation of the Cartesian filter if it is used, otherwise that of the axis filter (own)."""
    if not used:
        return own
    # The NaN is the innovation of the rate, because the Cartesian filter uses no measured rate.
    return AxisInnovation(cartesian.nu, cartesian.S, cartesian.chi_square, math.nan, own.rate_chi_square)


@compiled
def correct(f, c, m):
    """Correct the prediction with a Measurement; `innovation` must have been called with it before."""
    axes_filter.correct(f.axis, c.axis, m)
    if f.running:
        unscented.correct(f.cartesian, m)
    f.predicted = math.nan


@compiled
def expected(f):
    """Return the Motion at the instant of the last `predict`; its azimuth is on the wrap of the axis filter."""
    axes = axes_filter.expected(f.axis)
    if not (f.used[0] or f.used[1]):
        return axes
    cartesian, azimuth = unscented.expected(f.cartesian), axes.azimuth
    if f.used[0]:
        _, dA, ddA = cartesian.azimuth
        azimuth = AxisMotion(azimuth.angle + wrap(cartesian.azimuth.angle - azimuth.angle), dA, ddA)
    return Motion(azimuth, cartesian.elevation if f.used[1] else axes.elevation)


@separate
def outlook(f, c, T):
    """Return the predicted Motion T [s] >= 0 after the last measurement.

    The result equals that of `expected` after `predict`. If only the axis filters are used, no covariance is computed.
    """
    if f.predicted == T or f.used[0] or f.used[1]:
        predict(f, c, T)
        return expected(f)
    return axes_filter.outlook(f.axis, c.axis, T)


@compiled
def read(f):
    """Return the Estimate at the instant of the last `predict`."""
    axes = axes_filter.read(f.axis)
    if not (f.used[0] or f.used[1]):
        return axes
    own, (cartesian, _) = axes.variances, unscented.variances(f.cartesian)
    return Estimate(expected(f), (cartesian[0] if f.used[0] else own[0], cartesian[1] if f.used[1] else own[1]))


@compiled
def probabilities(f, c, mu):
    """Set mu (2, BANK_SIZE) to the probability of each of COLUMN_NAMES on both axes, NaN if not in the filter."""
    for i in range(2):
        axis_filter.probabilities(f.axis[i], c.axis[i], mu[i])
        if f.used[i]:
            unscented.probabilities(f.cartesian, mu[i])


@compiled
def usable(c, m):
    """Return the Measurement without the rates that the axis filters do not use, and without an invalid range."""
    azimuth = with_rate(m.axis[0], m.axis[0].rate if c.axis[0].rate_measurement else math.nan)
    elevation = with_rate(m.axis[1], m.axis[1].rate if c.axis[1].rate_measurement else math.nan)
    ranged = m.range > 0.0 and m.range_variance > 0.0
    return Measurement(m.stamp, (azimuth, elevation), m.range if ranged else math.nan, m.range_variance)


@compiled
def select(f, c, m):
    """Start, use or leave the Cartesian filter, after a correction or a start with a Measurement."""
    if f.running:
        if unscented.range_known(f.cartesian, c.range_share_2):
            _use_cartesian(f, c)
        else:
            _leave_cartesian(f, c, f.used[0], f.used[1])
            f.running = 0
    elif (c.wanted[0] or c.wanted[1]) and m.range_variance <= c.range_share_2 * m.range * m.range:
        axes_filter.predict(f.axis, c.axis, 0.0)
        unscented.start(f.cartesian, c.cartesian, axes_filter.read(f.axis), m.range, m.range_variance)
        f.running, f.predicted = 1, math.nan


@compiled
def _use_cartesian(f, c):
    """Use the Cartesian filter on each axis that wants it, once it knows the rate twice as well as the axis filter."""
    if (f.used[0] or not c.wanted[0]) and (f.used[1] or not c.wanted[1]):
        return
    predict(f, c, 0.0)
    axes, (cartesian, _) = axes_filter.read(f.axis).variances, unscented.variances(f.cartesian)
    for i in range(2):
        if c.wanted[i] and cartesian[i].p22 <= 0.25 * axes[i].p22:
            f.used[i] = 1


@compiled
def _leave_cartesian(f, c, azimuth, elevation):
    """Stop using the Cartesian filter on the axes whose argument is 1; their axis filters continue from its estimate.

    An estimate that is not finite is not taken over.
    """
    if not (azimuth or elevation):
        return
    predict(f, c, 0.0)
    motion = expected(f)
    for i, leaves in enumerate((azimuth, elevation)):
        if leaves:
            if math.isfinite(motion[i].angle + motion[i].rate + motion[i].acceleration):
                axis_filter.move(f.axis[i], c.axis[i], motion[i])
            f.used[i] = 0
    f.predicted = math.nan


@compiled
def transfer(f, c, running):
    """Adopt constants that may have changed: a filter of a new kind continues from the estimate of the old filter.

    running: 1 if there is an estimate.
    """
    f.predicted = math.nan
    if running:
        for i in range(2):
            axis_filter.transfer(f.axis[i], c.axis[i])
    _leave_cartesian(f, c, f.used[0] and not c.wanted[0], f.used[1] and not c.wanted[1])
    if not (c.wanted[0] or c.wanted[1]):
        f.running = 0


@compiled
def turn(f, c, rotation):
    """Turn the estimate and its covariances into another frame; rotation: Rotation from the old frame into the new
    one."""
    axes_filter.turn(f.axis, c.axis, rotation)
    if f.running:
        unscented.turn(f.cartesian, rotation)
    f.predicted = math.nan
