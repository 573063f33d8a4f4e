"""The loop of paper 003: a rate loop whose command is a measured miss with rate and acceleration fed forward.

The target moves to and fro; in a reversal its rate is half a cosine. Every T the tracker measures the miss of the
antenna, with noise and the delay d. The encoder angle of that instant plus the miss is the line of sight, y. A filter
of `acu_tracker.estimation.filters.axis_filter` estimates its rate v and acceleration a. The command of the rate loop
is

    u = K_p miss(t - d) + k_v v + k_a a,        W(s) = w^2 / (s^2 + 2 zeta w s + w^2),

where k_v + k_a s are the first two terms of 1 / W(s), so that a constant acceleration leaves no miss.
"""
import dataclasses
import math

import numpy as np
from scipy.linalg import expm

from acu_tracker.estimation.filters import axis_filter
from acu_tracker.estimation.filters.measurement import AxisMeasurement
from acu_tracker.estimation.params import FilterParameters
from acu_tracker.servo import feedforward
from pedestal_analysis.results import tracking
from pedestal_analysis.trials import monte_carlo
from pedestal_common.compiled import compiled
from pedestal_studies.rigs import ensemble, metrics, profiles
from pedestal_studies.rigs.ensemble import MEASUREMENT_PERIOD_S as T
from pedestal_studies.rigs.profiles import S_MOTION_RATE_RAD_S, S_MOTION_STROKE_RAD

MISS_DELAY_STEPS = 4
"""Delay d of a miss, in T."""

MISS_SIGMA_RAD = math.radians(0.02)
"""Noise of a miss [rad]."""

K_P = 5.0
"""Gain of the miss [1/s]."""

RATE_LOOP_CONSTANTS = (2.0 * math.pi * 8.0, 0.7)
"""Bandwidth w [rad/s] and damping zeta of the rate loop."""

REVERSAL_S_BY_AXIS = {'azimuth': 1.0, 'elevation': 1.6}
"""{axis: duration of a reversal [s]}, which the paper does not print; the peaks are 11 and 6.9 deg/s2."""

EVALUATED_PERIODS = 2
"""Periods of the motion that are evaluated, after half a period to settle."""

UNIFORM_RATE_DELAY_S = 2.0
"""Time after a reversal from which the rate counts as uniform [s]."""

BATCH_RUNS, NOISE_SEED = 25, 1
"""Runs of one batch; seed of their noise."""


def feedforward_gains(w, zeta):
    """Return (k_v [-], k_a [s]) of 1 / W(s) = 1 + 2 zeta s / w + s^2 / w^2.

    They are paper 003's c1, c2, corrected, for this W.
    """
    return 1.0, 2.0 * zeta / w


def rate_loop_step(w, zeta):
    """Return M (3, 4) of (theta, omega, omega') T later = M (theta, omega, omega', u), exact for a constant u."""
    A = np.zeros((4, 4))
    A[0, 1] = A[1, 2] = 1.0
    A[2, 1:] = -w * w, -2.0 * zeta * w, w * w
    return expm(A * T)[:3]


K_V, K_A = feedforward_gains(*RATE_LOOP_CONSTANTS)

STEP_RECORD = np.dtype([('miss', 'f8'), ('rate', 'f8'), ('acceleration', 'f8'), ('mu', 'f8', axis_filter.BANK_SIZE)],
                       align=True)
"""True angle minus antenna [rad]; rate [rad/s] and acceleration [rad/s2] fed forward; probability of each model."""


@compiled
def _follow(target, known, f, c, lead, M, normals, out):
    """Run the loop: target (n, 3), normals (runs, n) into STEP_RECORD records out (runs, n); M as of `rate_loop_step`.

    known (n, 2): rate and acceleration to feed forward. If known is (0, 2), they are the estimates of the filter with
    state f and constants c, `lead` [s] after its miss. Step j is the step of the miss that arrives in step k.
    """
    R = MISS_SIGMA_RAD * MISS_SIGMA_RAD
    encoder = np.empty(len(target))
    for i in range(len(normals)):
        theta, omega, omega_dot = target[0]
        for k in range(len(target)):
            encoder[k] = theta
            e, v, a = 0.0, target[0, 1], target[0, 2]
            j = k - MISS_DELAY_STEPS
            if j >= 0:
                e = target[j, 0] + MISS_SIGMA_RAD * normals[i, j] - encoder[j]
                y = encoder[j] + e
                if j == 0:
                    axis_filter.start(f[0], c[0], y, R, S_MOTION_RATE_RAD_S)
                else:
                    axis_filter.predict(f[0], c[0], T)
                    axis_filter.correct(f[0], c[0], AxisMeasurement(y, R, math.nan, math.nan))
                _, v, a = axis_filter.outlook(f[0], c[0], lead)
            if len(known) > 0:
                v, a = known[k]
            u = feedforward.rate(e, 0.0, feedforward.fed(v, a, K_V, K_A), K_P)
            step = out[i, k]
            step.miss, step.rate, step.acceleration = target[k, 0] - theta, v, a
            axis_filter.probabilities(f[0], c[0], step.mu)
            theta, omega, omega_dot = (
                theta + M[0, 1] * omega + M[0, 2] * omega_dot + M[0, 3] * u,
                M[1, 1] * omega + M[1, 2] * omega_dot + M[1, 3] * u,
                M[2, 1] * omega + M[2, 2] * omega_dot + M[2, 3] * u)


@dataclasses.dataclass(frozen=True)
class Source:
    """Source of rate and acceleration: a filter, or None for the truth.

    `predicted`: True for values predicted to the instant of the command, False for values at the time of the miss.
    """
    filter: FilterParameters | None
    predicted: bool = False


def filter_of(kind, **groups):
    """Return the FilterParameters of a kind with groups of its parameters changed: cv=dict(noise=...)."""
    return FilterParameters(kind=kind, **{name: dataclasses.replace(getattr(FilterParameters(), name), **values)
                                          for name, values in groups.items()})


def cv(q):
    """Return the Source of a constant-rate filter; q [deg/s2/sqrt(Hz)]."""
    return Source(filter_of('cv', cv={'noise': math.radians(q)}))


def ca(q):
    """Return the Source of a constant-acceleration filter; q [deg/s3/sqrt(Hz)]."""
    return Source(filter_of('ca', ca={'noise': math.radians(q)}))


def imm(q_ca, predicted):
    """Return the Source of an IMM of cv, ca and current_statistical with a dwell of 5 s.

    cv has low noise, ca has q_ca [deg/s3/sqrt(Hz)], current_statistical has a high acceleration.
    """
    default = FilterParameters().imm
    bank = {
        'models': 'cv ca current_statistical', 'rungs': 1, 'dwell': 5.0,
        'cv': dataclasses.replace(default.cv, noise=math.radians(0.003)),
        'ca': dataclasses.replace(default.ca, noise=math.radians(q_ca)),
        'current_statistical': dataclasses.replace(default.current_statistical, alpha=4.0, a_max=math.radians(40.0),
                                                   floor=0.3)}
    return Source(filter_of('imm', imm=bank), predicted)


def motion(axis):
    """Return (t (n,) [s], target (n, 3), period [s]) of an axis, over half a period and EVALUATED_PERIODS."""
    reversal = REVERSAL_S_BY_AXIS[axis]
    period = 2.0 * (S_MOTION_STROKE_RAD / S_MOTION_RATE_RAD_S + reversal * (1.0 - 2.0 / math.pi))
    t = T * np.arange(round((0.5 + EVALUATED_PERIODS) * period / T))
    return t, np.column_stack(profiles.s_motion(t, S_MOTION_STROKE_RAD, S_MOTION_RATE_RAD_S, reversal)), period


def steps_of(axis, source, first, count):
    """Return STEP_RECORD records (count, n) of runs first ... first + count - 1 of a Source on an axis.

    The noise of run i depends only on i.
    """
    t, target, _ = motion(axis)
    lead = (MISS_DELAY_STEPS + 0.5) * T if source.predicted else 0.0
    known = np.zeros((0, 2))
    if source.filter is None:
        at = t + 0.5 * T if source.predicted else t - MISS_DELAY_STEPS * T
        known = np.column_stack(profiles.s_motion(at, S_MOTION_STROKE_RAD, S_MOTION_RATE_RAD_S,
                                                  REVERSAL_S_BY_AXIS[axis])[1:])
    [normals] = ensemble.normal_draws(NOISE_SEED, first, count, len(t), 1)
    out = np.zeros((count, len(t)), STEP_RECORD)
    c = axis_filter.constants(source.filter or FilterParameters())
    _follow(target, known, np.zeros(1, axis_filter.FILTER_DTYPE), c, lead, rate_loop_step(*RATE_LOOP_CONSTANTS),
            normals, out)
    return out


METRIC_UNITS = {'miss_rms_deg': 'deg', 'miss_worst_second_deg': 'deg', 'miss_peak_deg': 'deg',
                'rate_noise_deg_s': 'deg/s'}
"""{metric of a run: unit}: rms, rms of the worst second and peak of the miss; noise of a uniform rate."""


def measures(axis, steps):
    """Return METRIC_UNITS of every run, an array (runs, 4), of STEP_RECORD records (runs, n) on an axis."""
    t, target, period = motion(axis)
    counts = t >= 0.5 * period
    second = round(1.0 / T)
    # The rate counts as uniform from UNIFORM_RATE_DELAY_S after a rate below 99.9 % of that between the ends.
    reversing = np.convolve(np.abs(target[:, 1]) < 0.999 * S_MOTION_RATE_RAD_S,
                            np.ones(round(UNIFORM_RATE_DELAY_S / T)))[:len(t)] > 0.5
    miss, noise = steps['miss'][:, counts], (steps['rate'] - target[:, 1])[:, counts & ~reversing]
    values = [(tracking.rms(m), math.sqrt(np.convolve(m * m, np.full(second, 1.0 / second), 'valid').max()),
               metrics.peak(m), tracking.rms(rate_error)) for m, rate_error in zip(miss, noise)]
    return np.degrees(values)


def batch(item):
    """Return (sum over the runs of the miss (n,) [rad], METRIC_UNITS of every run (count, 4)) of an item.

    An item is (axis, source, first run, number of runs).
    """
    axis, source, first, count = item
    steps = steps_of(axis, source, first, count)
    return steps['miss'].sum(axis=0), measures(axis, steps)


@dataclasses.dataclass(frozen=True)
class MissStatistics:
    """Statistics of the runs of a Source on an axis.

    `miss_mean` (n,) [rad]: mean over the runs at each step. `values` (runs, 4): METRIC_UNITS of every run.
    """
    axis: str
    miss_mean: np.ndarray
    values: np.ndarray

    def of(self, metric):
        """Return the values (runs,) of one of METRIC_UNITS."""
        return self.values[:, list(METRIC_UNITS).index(metric)]

    def mean(self, metric):
        """Return the mean over the runs of one of METRIC_UNITS."""
        return float(self.of(metric).mean())


def statistics(cases, count, pool, progress=lambda share, text: None):
    """Return {name: MissStatistics} of `count` runs of each of {name: (axis, Source)}; pool: monte_carlo.Pool."""
    pieces = monte_carlo.batches(count, BATCH_RUNS)
    items = [(axis, source, *piece) for axis, source in cases.values() for piece in pieces]
    done = pool.map(batch, items, progress)
    result = {}
    for name, (axis, _) in cases.items():
        miss, values = 0.0, []
        for _ in pieces:
            more, of_runs = next(done)
            miss += more
            values.append(of_runs)
        result[name] = MissStatistics(axis, miss / count, np.concatenate(values))
    return result
