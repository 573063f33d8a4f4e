"""Runs of a filter of acu_tracker over many noisy records of one motion, reduced to the moments of its errors.

The filter studies use this module. The moments are sums over the runs of the errors and of their squares. The noise of
a run depends only on a seed and the number of the run. Every filter, motion and kind of noise therefore has the same
draws, for any division of the runs into batches.
"""
import dataclasses
import math
from collections import namedtuple

import numpy as np
from scipy.signal import lfilter

from acu_tracker.estimation.filters import axis_filter, unscented
from acu_tracker.estimation.filters.measurement import AxisMeasurement, AxisVariances, Estimate, Measurement
from acu_tracker.estimation.params import TrackerParameters
from acu_tracker.geometry.vector import AxisMotion, Motion
from pedestal_common.compiled import compiled

ESTIMATE_TYPE, UNSCENTED_TYPE = axis_filter.Estimate.dtype, unscented.State.dtype

MEASUREMENT_PERIOD_S = 0.01  # time between measurements in all studies of filters [s]

INITIAL_RATE_SIGMA_RAD_S = TrackerParameters().initial_rate
"""Standard deviation of the rate that a filter assumes at its start [rad/s]."""

MOMENTS = np.dtype([('runs', 'f8'), ('angle', 'f8'), ('angle2', 'f8'), ('rate', 'f8'), ('rate2', 'f8'),
                    ('acceleration', 'f8'), ('acceleration2', 'f8'), ('raw2', 'f8'), ('variance', 'f8'),
                    ('rate_variance', 'f8'), ('nis', 'f8'), ('nees', 'f8'), ('mu', 'f8', (axis_filter.BANK_SIZE,))])
"""Sums over `runs` runs at one time.

angle, rate, acceleration     errors of the estimate [rad, rad/s, rad/s2]
angle2, rate2, acceleration2  squares of these errors
raw2                          squared error of the measured angle [rad2]
variance, rate_variance       variances of angle [rad2] and rate [rad2/s2] that the filter states
nis, nees                     normalised innovation squared; normalised estimation error squared of angle and rate
mu                            probability of each motion model in an IMM
"""

Series = namedtuple('Series', 't y R y_rate R_rate')
"""Measurements of one axis for a filter.

`t`: times (n,) [s]. `y`, `R`: angles (runs, n) [rad] and their variance (n,). `y_rate`, `R_rate`: rates (runs, n)
[rad/s] and their variance (n,).
"""

RangedSeries = namedtuple('RangedSeries', 'azimuth elevation R ranges R_range')
"""Measurements for the Cartesian filter: angles (runs, n) [rad] with their variance R, ranges (runs, n) [m] with their
variance R_range."""


@dataclasses.dataclass(frozen=True)
class Noise:
    """Noise of the measurements of one axis.

    `sigma`: rms of the noise of the angle [rad]. `bandwidth`: bandwidth of the lag that colours this noise [Hz], None
    for white noise. `expected`: True if the filter knows the bandwidth. `rate_sigma`: rms of the noise of an
    independent, white rate measurement [rad/s], None without such a measurement.
    """
    sigma: float
    bandwidth: float | None = None
    rate_sigma: float | None = None
    expected: bool = False


def normal_draws(seed, first, count, n, sensors=2):
    """Return standard normal noise (sensors, count, n) of `count` runs from run `first` on; sensor 0 is the angle."""
    runs = [np.random.default_rng((seed, first + i)).standard_normal((sensors, n)) for i in range(count)]
    return np.stack(runs, axis=1)


def coloured_noise(white, bandwidth):
    """Return white noise (runs, n) of variance 1 after a first-order lag of -3 dB bandwidth [Hz], with variance 1."""
    rho = math.exp(-2.0 * math.pi * bandwidth * MEASUREMENT_PERIOD_S)
    rest, _ = lfilter([math.sqrt(1.0 - rho * rho)], [1.0, -rho], white[:, 1:], zi=rho * white[:, :1])
    return np.hstack((white[:, :1], rest))


def records(truth, noise, seed, first, count):
    """Return measured angles [rad] and rates [rad/s], each (count, n), of a truth (angle, rate, acceleration).

    The rates are NaN without a sensor.
    """
    angle, rate, _ = truth
    nu, nu_rate = normal_draws(seed, first, count, len(angle))
    if noise.bandwidth is not None:
        nu = coloured_noise(nu, noise.bandwidth)
    sigma = math.nan if noise.rate_sigma is None else noise.rate_sigma
    return angle + noise.sigma * nu, rate + sigma * nu_rate


def moments(params, t, truth, noise, measured):
    """Return MOMENTS (runs, n) of a filter, each for one run and time.

    params: FilterParameters. t: times (n,) [s]. truth: (angle, rate, acceleration). measured: as `records` returns.
    The filter knows sigma and rate_sigma of the Noise. A filter that does not know the bandwidth assumes white noise.
    """
    y, y_rate = measured
    c = axis_filter.constants(dataclasses.replace(params, rate_measurement=noise.rate_sigma is not None),
                              noise.bandwidth if noise.expected else 0.0)
    series = Series(t, y, np.full(len(t), noise.sigma**2), y_rate, np.full(len(t), (noise.rate_sigma or 0.0) ** 2))
    sums = np.zeros(y.shape, MOMENTS)
    _add_runs(c, AxisMotion(*truth), series, INITIAL_RATE_SIGMA_RAD_S, np.zeros(len(t), axis_filter.Estimate.dtype),
              sums)
    return sums


@compiled
def _add_runs(c, truth, m, initial_rate, out, sums):
    """Add the errors of a filter over a Series m to MOMENTS (runs, n).

    c: constants of the filter. truth: AxisMotion of arrays (n,). out: working memory, Estimate (n,).
    """
    for run in range(len(m.y)):
        axis_filter.estimates(c, m.t, m.y[run], m.R, m.y_rate[run], m.R_rate, initial_rate, out)
        for k in range(len(m.t)):
            _add(sums[run, k], out[k], truth, k, m.y[run, k])


@compiled
def _add(s, o, truth, k, y):
    """Add the errors of an estimate o (Estimate) at step k to a record s of MOMENTS; y: measured angle [rad]."""
    angle = truth.angle[k]
    d1, d2, d3, raw = o.angle - angle, o.rate - truth.rate[k], o.acceleration - truth.acceleration[k], y - angle
    s.runs += 1.0
    s.angle += d1
    s.angle2 += d1 * d1
    s.rate += d2
    s.rate2 += d2 * d2
    s.acceleration += d3
    s.acceleration2 += d3 * d3
    s.raw2 += raw * raw
    s.variance += o.variance
    s.rate_variance += o.rate_variance
    s.nis += o.nis
    s.nees += ((o.rate_variance * d1 * d1 - 2.0 * o.covariance * d1 * d2 + o.variance * d2 * d2)
               / (o.variance * o.rate_variance - o.covariance * o.covariance))
    for j in range(len(o.mu)):
        s.mu[j] += o.mu[j]


def unscented_moments(params, truth, distance, noise, range_sigma, runs):
    """Return MOMENTS (runs, n) of the azimuth of the IMM of unscented filters (params: UkfParameters).

    runs: (seed, first, count). The target is at elevation 0 and at `distance` (n,) [m], measured with white noise of
    range_sigma [m]. Both angles have the Noise `noise`, the azimuth with the draws of `records`.
    """
    seed, first, count = runs
    nu, _, nu_elevation, nu_range = normal_draws(seed, first, count, len(distance), 4)
    if noise.bandwidth is not None:
        nu, nu_elevation = coloured_noise(nu, noise.bandwidth), coloured_noise(nu_elevation, noise.bandwidth)
    sums = np.zeros((count, len(distance)), MOMENTS)
    measured = RangedSeries(truth[0] + noise.sigma * nu, noise.sigma * nu_elevation, noise.sigma**2,
                            distance + range_sigma * nu_range, range_sigma**2)
    _add_unscented_runs(unscented.constants(params), MEASUREMENT_PERIOD_S, AxisMotion(*truth), measured,
                        INITIAL_RATE_SIGMA_RAD_S**2, sums)
    return sums


@compiled
def _add_unscented_runs(c, T, truth, measured, rate_variance, sums):
    """Add the errors in azimuth over a RangedSeries with a measurement every T [s] to MOMENTS (runs, n).

    c: constants of the filter. truth: AxisMotion of arrays (n,). rate_variance: at the start [rad2/s2].
    """
    R, R_range = measured.R, measured.R_range
    out = np.zeros(1, ESTIMATE_TYPE)
    o = out[0]
    for run in range(len(measured.azimuth)):
        state = np.zeros(1, UNSCENTED_TYPE)
        s = state[0]
        for k in range(len(truth.angle)):
            A, E, r = measured.azimuth[run, k], measured.elevation[run, k], measured.ranges[run, k]
            o.nis = math.nan
            if k == 0:
                known = AxisVariances(R, 0.0, rate_variance)
                first = Estimate(Motion(AxisMotion(A, 0.0, 0.0), AxisMotion(E, 0.0, 0.0)), (known, known))
                unscented.start(s, c[0], first, r, R_range)
            else:
                unscented.predict(s, c[0], T)
                m = Measurement(0.0, (AxisMeasurement(A, R, math.nan, math.nan),
                                      AxisMeasurement(E, R, math.nan, math.nan)), r, R_range)
                o.nis = unscented.innovation(s, m).axis[0].chi_square
                unscented.correct(s, m)
            unscented.predict(s, c[0], 0.0)
            o.angle, o.rate, o.acceleration = unscented.expected(s).azimuth
            axes, _ = unscented.variances(s)
            o.variance, o.covariance, o.rate_variance = axes[0]
            unscented.probabilities(s, o.mu)
            _add(sums[run, k], o, truth, k, A)


def sum_of_moments(sums, more):
    """Return the sum of two arrays (n,) of MOMENTS, element by element."""
    return (sums.view('f8') + more.view('f8')).view(MOMENTS)


def over_runs(sums):
    """Return the sum (n,) of MOMENTS (runs, n) over the runs."""
    return _summed(sums, 0)


def over_time(sums):
    """Return the sum (runs,) of MOMENTS (runs, n) over the times, which holds the moments of every run."""
    return _summed(sums, 1)


def _summed(sums, axis):
    """Return the sum of MOMENTS (runs, n) over an axis."""
    numbers = np.ascontiguousarray(sums).view('f8').reshape(*sums.shape, -1)
    return numbers.sum(axis=axis).view(MOMENTS)[:, 0]


def rms(sums, name):
    """Return the rms error (n,) of MOMENTS (n,) [rad, rad/s, rad/s2].

    name: 'angle', 'rate', 'acceleration' or 'raw'.
    """
    return np.sqrt(sums[f'{name}2'] / sums['runs'])
