"""A filter of acu_tracker over many noisy records of one motion, reduced to the moments of its errors.

Noise of a run depends on a seed and the number of the run alone, so that every filter, profile and noise sees the same
draws and it does not matter how runs are cut into batches.
"""
import dataclasses
import math

import numpy as np
from scipy.signal import lfilter

from acu_tracker.estimation import axis_filter, unscented
from acu_tracker.estimation.measurement import AxisMeasurement, AxisVariances, Estimate, Measurement
from acu_tracker.estimation.params import TrackerParameters
from acu_tracker.geometry.motion import AxisMotion, Motion
from pedestal_common.compiled import compiled

PERIOD = 0.01
"""Between measurements [s], in all studies of filters."""

INITIAL_RATE = TrackerParameters().initial_rate
"""Standard deviation of the rate at the start [rad/s]."""

MOMENTS = np.dtype([('runs', 'f8'), ('angle', 'f8'), ('angle2', 'f8'), ('rate', 'f8'), ('rate2', 'f8'),
                    ('acceleration', 'f8'), ('acceleration2', 'f8'), ('raw2', 'f8'), ('variance', 'f8'),
                    ('rate_variance', 'f8'), ('nis', 'f8'), ('mu', 'f8', (axis_filter.BANK,))])
"""Sums over runs at one time: errors of angle, rate, acceleration and of the raw angle, their squares, the variances
the filter believes, normalised innovations squared, mode probabilities."""


@dataclasses.dataclass(frozen=True)
class Noise:
    """Of the measured angle: rms sigma [rad]; bandwidth None: white, or that of a first-order lag [Hz].

    rate_sigma: of an independent, white rate measurement [rad/s], None without one.
    """
    sigma: float
    bandwidth: float | None = None
    rate_sigma: float | None = None


def drawn(seed, first, count, n, sensors=2):
    """Standard normal noise (sensors, count, n) of the runs from `first` on; the first sensor is the angle."""
    runs = [np.random.default_rng((seed, first + i)).standard_normal((sensors, n)) for i in range(count)]
    return np.stack(runs, axis=1)


def coloured(white, bandwidth):
    """White noise (runs, n) of variance 1 through a first-order lag of -3 dB bandwidth [Hz]; variance 1 again."""
    rho = math.exp(-2.0 * math.pi * bandwidth * PERIOD)
    rest, _ = lfilter([math.sqrt(1.0 - rho * rho)], [1.0, -rho], white[:, 1:], zi=rho * white[:, :1])
    return np.hstack((white[:, :1], rest))


def records(truth, noise, seed, first, count):
    """Measured angles and rates, each (count, n), of a truth (angle, rate, acceleration); no sensor: rates NaN."""
    angle, rate, _ = truth
    nu, nu_rate = drawn(seed, first, count, len(angle))
    if noise.bandwidth is not None:
        nu = coloured(nu, noise.bandwidth)
    sigma = math.nan if noise.rate_sigma is None else noise.rate_sigma
    return angle + noise.sigma * nu, rate + sigma * nu_rate


def moments(params, t, truth, noise, measured):
    """MOMENTS (n,) of a filter (FilterParameters) over measured records as of `records`.

    The filter is told sigma and rate_sigma, and takes both for white.
    """
    y, y_rate = measured
    c = axis_filter.constants(dataclasses.replace(params, rate_measurement=noise.rate_sigma is not None))
    R = np.full(len(t), noise.sigma**2)
    R_rate = np.full(len(t), (noise.rate_sigma or 0.0) ** 2)
    sums = np.zeros(len(t), MOMENTS)
    _add_runs(c, t, *truth, y, R, y_rate, R_rate, INITIAL_RATE, np.zeros(len(t), axis_filter.ESTIMATE), sums)
    return sums


@compiled
def _add_runs(c, t, angle, rate, acceleration, y, R, y_rate, R_rate, initial_rate, out, sums):
    for run in range(len(y)):
        axis_filter.estimates(c, t, y[run], R, y_rate[run], R_rate, initial_rate, out)
        for k in range(len(t)):
            _add(sums[k], out[k], angle[k], rate[k], acceleration[k], y[run, k])


@compiled
def _add(s, o, angle, rate, acceleration, y):
    """Add to MOMENTS an ESTIMATE of what is angle, rate and acceleration, after the measured angle y."""
    d1, d2, d3, raw = o.angle - angle, o.rate - rate, o.acceleration - acceleration, y - angle
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
    for j in range(len(o.mu)):
        s.mu[j] += o.mu[j]


def unscented_moments(params, t, truth, distance, noise, range_sigma, seed, first, count):
    """MOMENTS (n,) of the azimuth of the IMM of unscented filters (params: UkfParameters).

    The target is at elevation 0, `distance` (n,) [m] away, measured with range_sigma [m], white; both angles as
    `noise` says, the azimuth with the same draws as in `records`.
    """
    nu, _, nu_elevation, nu_range = drawn(seed, first, count, len(t), 4)
    if noise.bandwidth is not None:
        nu, nu_elevation = coloured(nu, noise.bandwidth), coloured(nu_elevation, noise.bandwidth)
    sums = np.zeros(len(t), MOMENTS)
    _add_unscented_runs(unscented.constants(params), PERIOD, *truth, truth[0] + noise.sigma * nu,
                        noise.sigma * nu_elevation, noise.sigma**2, distance + range_sigma * nu_range, range_sigma**2,
                        INITIAL_RATE**2, sums)
    return sums


@compiled
def _add_unscented_runs(c, T, angle, rate, acceleration, azimuth, elevation, R, ranges, R_range, rate_variance, sums):
    out = np.zeros(1, axis_filter.ESTIMATE)
    o = out[0]
    for run in range(len(azimuth)):
        state = np.zeros(1, unscented.STATE)
        s = state[0]
        for k in range(len(angle)):
            A, E, r = azimuth[run, k], elevation[run, k], ranges[run, k]
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
            _add(sums[k], o, angle[k], rate[k], acceleration[k], A)


def added(sums, more):
    """MOMENTS, element by element."""
    return (sums.view('f8') + more.view('f8')).view(MOMENTS)


def total(sums):
    """MOMENTS (1,) of all times (n,) together."""
    return sums.view('f8').reshape(len(sums), -1).sum(axis=0).view(MOMENTS)


def rms(sums, name):
    """Root of the mean of a squared error ('angle', 'rate', 'acceleration', 'raw') of MOMENTS."""
    return np.sqrt(sums[f'{name}2'] / sums['runs'])
