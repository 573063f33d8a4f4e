"""Runs of a filter of acu_tracker over many noisy records of one motion, reduced to the moments of its errors.

The noise of a run depends only on a seed and the number of the run. Every filter, motion and kind of noise therefore
has the same draws, for any division of the runs into batches.
"""
import dataclasses
import math
from typing import Annotated, NamedTuple

import numpy as np
from scipy.signal import lfilter

from acu_tracker.estimation.filters import axis_filter, unscented
from acu_tracker.estimation.filters.measurement import AxisMeasurement, AxisVariances, Estimate, Measurement
from acu_tracker.estimation.params import FilterParameters, TrackerParameters, UkfParameters
from acu_tracker.geometry.vector import AxisMotion, Motion
from pedestal_common.compiled import compiled
from pedestal_common.quantities import (
    Floats,
    Hertz,
    Meters,
    Radians,
    Radians2,
    RadiansPerSecond,
    Records,
    Seconds,
    Times,
)
from pedestal_common.record import Record
from pedestal_studies import profiles

MEASUREMENT_PERIOD_S = 0.01  # time between measurements in all studies of filters [s]

INITIAL_RATE_SIGMA_RAD_S = TrackerParameters().initial_rate  # that a filter assumes at its start [rad/s]


ESTIMATE_TYPE, UNSCENTED_TYPE = axis_filter.Estimate.dtype, unscented.State.dtype


class Moments(Record):
    """Sums over runs at one time."""
    runs: float             # number of runs
    angle: float            # error of the estimate [rad]
    angle2: float           # its square
    rate: float             # error of the estimate [rad/s]
    rate2: float            # its square
    acceleration: float     # error of the estimate [rad/s2]
    acceleration2: float    # its square
    raw2: float             # squared error of the measured angle [rad2]
    variance: float         # of the angle, which the filter states [rad2]
    rate_variance: float    # of the rate, which the filter states [rad2/s2]
    nis: float              # normalised innovation squared
    nees: float             # normalised estimation error squared of angle and rate
    mu: Annotated[Floats, (axis_filter.BANK_SIZE,)]     # probability of each motion model in an IMM


class Series(NamedTuple):
    """Measurements of one axis for a filter."""
    t: Times
    y: Floats       # angles (runs, n) [rad]
    R: Floats       # their variance (n,) [rad2]
    y_rate: Floats  # rates (runs, n) [rad/s]
    R_rate: Floats  # their variance (n,) [rad2/s2]


class RangedSeries(NamedTuple):
    """Measurements for the Cartesian filter."""
    azimuth: Floats     # (runs, n) [rad]
    elevation: Floats   # (runs, n) [rad]
    R: Radians2         # variance of both angles
    ranges: Floats      # (runs, n) [m]
    R_range: float      # their variance [m2]


@dataclasses.dataclass(frozen=True)
class Noise:
    """Noise of the measurements of one axis."""
    sigma: Radians                      # rms of the noise of the angle
    bandwidth: Hertz | None = None      # of the lag that colours this noise; None for white noise
    rate_sigma: RadiansPerSecond | None = None  # rms of an independent, white rate measurement; None without it
    expected: bool = False              # True if the filter knows the bandwidth


def normal_draws(seed: int, first: int, count: int, n: int, sensors: int = 2) -> Floats:
    """Return standard normal noise (sensors, count, n) of `count` runs from run `first` on; sensor 0 is the angle."""
    runs = [np.random.default_rng((seed, first + i)).standard_normal((sensors, n)) for i in range(count)]
    return np.stack(runs, axis=1)


def coloured_noise(white: Floats, bandwidth: Hertz) -> Floats:
    """Return white noise (runs, n) of variance 1 after a first-order lag of -3 dB bandwidth [Hz], with variance 1."""
    rho = math.exp(-2.0 * math.pi * bandwidth * MEASUREMENT_PERIOD_S)
    rest, _ = lfilter([math.sqrt(1.0 - rho * rho)], [1.0, -rho], white[:, 1:], zi=rho * white[:, :1])
    return np.hstack((white[:, :1], rest))


def records(truth: profiles.Motion, noise: Noise, seed: int, first: int, count: int) -> tuple[Floats, Floats]:
    """Return measured angles [rad] and rates [rad/s], each (count, n). The rates are NaN without a sensor."""
    angle, rate, _ = truth
    nu, nu_rate = normal_draws(seed, first, count, len(angle))
    if noise.bandwidth is not None:
        nu = coloured_noise(nu, noise.bandwidth)
    sigma = math.nan if noise.rate_sigma is None else noise.rate_sigma
    return angle + noise.sigma * nu, rate + sigma * nu_rate


def moments(params: FilterParameters, t: Times, truth: profiles.Motion, noise: Noise,
            measured: tuple[Floats, Floats]) -> Records:
    """Return Moments (runs, n) of a filter, each for one run and time; measured: as `records` returns. The filter
    knows sigma and rate_sigma of the Noise. Without the bandwidth it assumes white noise."""
    y, y_rate = measured
    c = axis_filter.constants(dataclasses.replace(params, rate_measurement=noise.rate_sigma is not None),
                              (noise.bandwidth or 0.0) if noise.expected else 0.0)
    series = Series(t, y, np.full(len(t), noise.sigma**2), y_rate, np.full(len(t), (noise.rate_sigma or 0.0) ** 2))
    sums = np.zeros(y.shape, Moments.dtype)
    _add_runs(c, profiles.Motion(*truth), series, INITIAL_RATE_SIGMA_RAD_S, axis_filter.Estimate.zeros(len(t)), sums)
    return sums


@compiled
def _add_runs(constants: Records, truth: profiles.Motion, measured: Series, initial_rate: RadiansPerSecond,
              out: Records, sums: Records) -> None:
    for run in range(len(measured.y)):
        axis_filter.estimates(constants, measured.t, measured.y[run], measured.R, measured.y_rate[run],
                              measured.R_rate, initial_rate, out)
        for k in range(len(measured.t)):
            _add(sums[run, k], out[k], truth, k, measured.y[run, k])


@compiled
def _add(sums: Moments, estimate: axis_filter.Estimate, truth: profiles.Motion, k: int, y: Radians) -> None:
    s, o, angle = sums, estimate, truth.angle[k]
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


def unscented_moments(params: UkfParameters, truth: profiles.Motion, distance: Floats, noise: Noise,
                      range_sigma: Meters, runs: tuple[int, int, int]) -> Records:
    """Return Moments (runs, n) of the azimuth of the IMM of unscented filters.

    runs: (seed, first, count). The target is at elevation 0 and at `distance` [m], measured with white noise of
    range_sigma. Both angles have the same noise, the azimuth with the draws of `records`.
    """
    seed, first, count = runs
    nu, _, nu_elevation, nu_range = normal_draws(seed, first, count, len(distance), 4)
    if noise.bandwidth is not None:
        nu, nu_elevation = coloured_noise(nu, noise.bandwidth), coloured_noise(nu_elevation, noise.bandwidth)
    sums = np.zeros((count, len(distance)), Moments.dtype)
    measured = RangedSeries(truth[0] + noise.sigma * nu, noise.sigma * nu_elevation, noise.sigma**2,
                            distance + range_sigma * nu_range, range_sigma**2)
    _add_unscented_runs(unscented.constants(params), MEASUREMENT_PERIOD_S, profiles.Motion(*truth), measured,
                        INITIAL_RATE_SIGMA_RAD_S**2, sums)
    return sums


@compiled
def _add_unscented_runs(constants: Records, T: Seconds, truth: profiles.Motion, measured: RangedSeries,
                        rate_variance: float, sums: Records) -> None:
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
                unscented.start(s, constants[0], first, r, R_range)
            else:
                unscented.predict(s, constants[0], T)
                m = Measurement(0.0, (AxisMeasurement(A, R, math.nan, math.nan),
                                      AxisMeasurement(E, R, math.nan, math.nan)), r, R_range)
                o.nis = unscented.innovation(s, m).axis[0].chi_square
                unscented.correct(s, m)
            unscented.predict(s, constants[0], 0.0)
            o.angle, o.rate, o.acceleration = unscented.expected(s).azimuth
            axes, _ = unscented.variances(s)
            o.variance, o.covariance, o.rate_variance = axes[0]
            unscented.probabilities(s, o.mu)
            _add(sums[run, k], o, truth, k, A)


def sum_of_moments(sums: Records, more: Records) -> Records:
    """Return the sum of two arrays (n,) of Moments, element by element."""
    return (sums.view('f8') + more.view('f8')).view(Moments.dtype)


def over_runs(sums: Records) -> Records:
    """Return the sum (n,) of Moments (runs, n) over the runs."""
    return _summed(sums, 0)


def over_time(sums: Records) -> Records:
    """Return the sum (runs,) of Moments (runs, n) over the times, which holds the moments of every run."""
    return _summed(sums, 1)


def _summed(sums: Records, axis: int) -> Records:
    numbers = np.ascontiguousarray(sums).view('f8').reshape(*sums.shape, -1)
    return numbers.sum(axis=axis).view(Moments.dtype)[:, 0]


def rms(sums: Records, name: str) -> Floats:
    """Return the rms error (n,) of Moments (n,); name: 'angle', 'rate', 'acceleration' or 'raw'."""
    return np.sqrt(sums[f'{name}2'] / sums['runs'])
