"""The position loop of Lin 2020 on one axis: measured miss, with rate and acceleration of the target fed forward.

The miss, a term of the paper, is the pointing error: angle of the target minus angle of the antenna. Every T = 10 ms
the tracker measures the miss, with noise and the delay d. The encoder angle of that instant plus the miss is the angle
y of the target, from which a filter estimates rate v and acceleration a of the target. The command u [rad/s] of the
rate loop W(s), of bandwidth w and damping zeta, is

    u = K_p miss(t - d) + k_v v + k_a a,        W(s) = w^2 / (s^2 + 2 zeta w s + w^2)

k_v + k_a s are the first two terms of the series of 1 / W(s). Therefore a constant acceleration leaves no miss.
"""
import dataclasses
import math
from collections.abc import Mapping
from typing import Annotated, TypeVar

import numpy as np
from scipy.linalg import expm

from acu_tracker.estimation.filters import axis_filter
from acu_tracker.estimation.filters.measurement import AxisMeasurement
from acu_tracker.estimation.params import FilterParameters
from acu_tracker.servo import controllers
from pedestal_common.compiled import compiled
from pedestal_common.quantities import (
    Floats,
    Json,
    Pairs,
    Radians,
    RadiansPerSecond,
    Records,
    Seconds,
    Times,
    Vectors3,
)
from pedestal_common.record import Record
from pedestal_results import metrics, tracking
from pedestal_studies import ensemble, profiles
from pedestal_studies.ensemble import MEASUREMENT_PERIOD_S as T
from pedestal_studies.profiles import S_MOTION_RATE_RAD_S, S_MOTION_STROKE_RAD
from pedestal_workbench.trials import monte_carlo
from pedestal_workbench.trials.monte_carlo import Pool, Progress

MISS_DELAY_STEPS = 4  # delay d of a miss, in T
MISS_SIGMA_RAD = math.radians(0.02)  # noise of a miss [rad]
K_P = 5.0  # gain of the miss [1/s]
RATE_LOOP_CONSTANTS = (2.0 * math.pi * 8.0, 0.7)  # bandwidth w [rad/s] and damping zeta of the rate loop

REVERSAL_S_BY_AXIS = {'azimuth': 1.0, 'elevation': 1.6}
"""{axis: duration of a reversal [s]}. The paper does not print it. The peak accelerations are 11 and 6.9 deg/s2."""

EVALUATED_PERIODS = 2  # periods of the motion that are evaluated, after half a period to settle
UNIFORM_RATE_DELAY_S = 2.0  # time after a reversal from which the rate of the target counts as uniform [s]
BATCH_RUNS, NOISE_SEED = 25, 1  # runs of one batch; seed of their noise


def feedforward_gains(w: RadiansPerSecond, zeta: float) -> tuple[float, Seconds]:
    """Return (k_v [-], k_a [s]) of 1 / W(s) = 1 + 2 zeta s / w + s^2 / w^2.

    The paper calls these gains c_1 and c_2. Its formulas are corrected here (acu_tracker/servo/controllers.py).
    """
    return 1.0, 2.0 * zeta / w


def rate_loop_step(w: RadiansPerSecond, zeta: float) -> Floats:
    """Return the matrix M (3, 4) of a step over T: x(t + T) = M (x(t), u), exact for a constant u.

    The state x is angle [rad], rate [rad/s] and acceleration [rad/s2] of the antenna.
    """
    A = np.zeros((4, 4))
    A[0, 1] = A[1, 2] = 1.0
    A[2, 1:] = -w * w, -2.0 * zeta * w, w * w
    return expm(A * T)[:3]


K_V, K_A = feedforward_gains(*RATE_LOOP_CONSTANTS)  # gains k_v [-] and k_a [s] of the feed-forward


class Step(Record):
    """Step of the loop."""
    miss: Radians           # true miss
    rate: float             # rate that is fed forward [rad/s]
    acceleration: float     # acceleration that is fed forward [rad/s2]
    mu: Annotated[Floats, (axis_filter.BANK_SIZE,)]     # probability of each motion model


@compiled
def _follow(target: Vectors3, known: Pairs, filters: Records, constants: Records, lead: Seconds, M: Floats,
            normals: Floats, out: Records) -> None:
    """Run the loop once for each row of `normals` (runs, n) and write its Steps to `out` (runs, n).

    known: rate and acceleration to feed forward; if it is (0, 2), the filter estimates them. lead: time from the
    instant of the miss to that of the prediction. M: that of `rate_loop_step`. The miss of step j arrives in step k.
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
                    axis_filter.start(filters[0], constants[0], y, R, S_MOTION_RATE_RAD_S)
                else:
                    axis_filter.predict(filters[0], constants[0], T)
                    axis_filter.correct(filters[0], constants[0], AxisMeasurement(y, R, math.nan, math.nan))
                _, v, a = axis_filter.outlook(filters[0], constants[0], lead)
            if len(known) > 0:
                v, a = known[k]
            u = controllers.feedforward_rate(e, 0.0, controllers.fed(v, a, K_V, K_A), K_P)
            step = out[i, k]
            step.miss, step.rate, step.acceleration = target[k, 0] - theta, v, a
            axis_filter.probabilities(filters[0], constants[0], step.mu)
            theta, omega, omega_dot = (
                theta + M[0, 1] * omega + M[0, 2] * omega_dot + M[0, 3] * u,
                M[1, 1] * omega + M[1, 2] * omega_dot + M[1, 3] * u,
                M[2, 1] * omega + M[2, 2] * omega_dot + M[2, 3] * u)


@dataclasses.dataclass(frozen=True)
class Source:
    """Source of rate and acceleration: a filter, the differences of the measured angle, or the truth."""
    filter: FilterParameters | None     # None for differences and for the truth
    predicted: bool = False     # True for values at the instant of the command, False for values at that of the miss
    difference_steps: int = 0   # distance of the differenced angles, in T; 0 for a filter and for the truth

    @property
    def own_filter(self) -> FilterParameters:
        """The filter of a source that has one."""
        assert self.filter is not None
        return self.filter


def filter_of(kind: str, **groups: Mapping[str, Json]) -> FilterParameters:
    """Return the filter of a kind with parameters changed by group, for example cv={'noise': 0.01}."""
    return FilterParameters(kind=kind, **{name: dataclasses.replace(getattr(FilterParameters(), name), **values)
                                          for name, values in groups.items()})


def cv(q: float) -> Source:
    """Return the source of a constant-rate filter; q: process noise [deg/s2/sqrt(Hz)]."""
    return Source(filter_of('cv', cv={'noise': math.radians(q)}))


def ca(q: float) -> Source:
    """Return the source of a constant-acceleration filter; q: process noise [deg/s3/sqrt(Hz)]."""
    return Source(filter_of('ca', ca={'noise': math.radians(q)}))


def imm(q_ca: float, predicted: bool) -> Source:
    """Return the source of an IMM of cv with little process noise, ca with q_ca [deg/s3/sqrt(Hz)], and
    current_statistical up to 40 deg/s2 for fast manoeuvres. A model holds for a mean dwell of 5 s."""
    default = FilterParameters().imm
    bank = {
        'models': 'cv ca current_statistical', 'rungs': 1, 'dwell': 5.0,
        'cv': dataclasses.replace(default.cv, noise=math.radians(0.003)),
        'ca': dataclasses.replace(default.ca, noise=math.radians(q_ca)),
        'current_statistical': dataclasses.replace(default.current_statistical, alpha=4.0, a_max=math.radians(40.0),
                                                   floor=0.3)}
    return Source(filter_of('imm', imm=bank), predicted)


def motion(axis: str, rate: RadiansPerSecond = S_MOTION_RATE_RAD_S) -> tuple[Times, Vectors3, Seconds]:
    """Return (times, angle, rate and acceleration of the target, period) of the motion on an axis.

    The times are half a period to settle and EVALUATED_PERIODS. rate: between reversals.
    """
    reversal = REVERSAL_S_BY_AXIS[axis]
    period = 2.0 * (S_MOTION_STROKE_RAD / rate + reversal * (1.0 - 2.0 / math.pi))
    t = T * np.arange(round((0.5 + EVALUATED_PERIODS) * period / T), dtype=float)
    return t, np.column_stack(profiles.s_motion(t, S_MOTION_STROKE_RAD, rate, reversal)), period


def differenced(y: Floats, steps: int) -> Pairs:
    """Return rate [rad/s] and acceleration [rad/s2] by the differences of angles y [rad] over `steps` T; 0 until there
    are enough angles. The angle of step k is in the row k + MISS_DELAY_STEPS, in which it arrives."""
    known, span = np.zeros((len(y), 2)), steps * T
    rate = (y[steps:] - y[:-steps]) / span
    acceleration = (rate[steps:] - rate[:-steps]) / span
    known[steps + MISS_DELAY_STEPS:, 0] = rate[:-MISS_DELAY_STEPS]
    known[2 * steps + MISS_DELAY_STEPS:, 1] = acceleration[:-MISS_DELAY_STEPS]
    return known


def steps_of(axis: str, source: Source, first: int, count: int,
             rate: RadiansPerSecond = S_MOTION_RATE_RAD_S) -> Records:
    """Return the Steps (count, n) of runs first ... of a source. The noise of run i depends only on i."""
    t, target, _ = motion(axis, rate)
    lead = (MISS_DELAY_STEPS + 0.5) * T if source.predicted else 0.0
    known = np.zeros((0, 2))
    if source.filter is None and not source.difference_steps:
        at = t + 0.5 * T if source.predicted else t - MISS_DELAY_STEPS * T
        known = np.column_stack(profiles.s_motion(at, S_MOTION_STROKE_RAD, rate, REVERSAL_S_BY_AXIS[axis])[1:])
    [normals] = ensemble.normal_draws(NOISE_SEED, first, count, len(t), 1)
    out = np.zeros((count, len(t)), Step.dtype)
    c = axis_filter.constants(source.filter or FilterParameters())
    f, M = axis_filter.Filter.zeros(), rate_loop_step(*RATE_LOOP_CONSTANTS)
    if not source.difference_steps:
        _follow(target, known, f, c, lead, M, normals, out)
        return out
    for i in range(count):
        known = differenced(target[:, 0] + MISS_SIGMA_RAD * normals[i], source.difference_steps)
        _follow(target, known, f, c, lead, M, normals[i:i + 1], out[i:i + 1])
    return out


METRIC_UNITS = {'miss_rms_deg': 'deg', 'miss_worst_second_deg': 'deg', 'miss_peak_deg': 'deg',
                'rate_noise_deg_s': 'deg/s'}
"""{metric of a run: unit}: rms, rms of the worst second and peak of the miss; rms error of the rate that is fed
forward while the rate of the target is uniform."""


def measures(axis: str, steps: Records, rate: RadiansPerSecond = S_MOTION_RATE_RAD_S) -> Floats:
    """Return the metrics of METRIC_UNITS of every run, an array (runs, 4); steps: Steps (runs, n)."""
    t, target, period = motion(axis, rate)
    counts = t >= 0.5 * period
    second = round(1.0 / T)
    # reversing: the rate is below 99.9 % of the uniform rate, or was so in the last UNIFORM_RATE_DELAY_S.
    reversing = np.convolve(np.abs(target[:, 1]) < 0.999 * rate,
                            np.ones(round(UNIFORM_RATE_DELAY_S / T)))[:len(t)] > 0.5
    miss, noise = steps['miss'][:, counts], (steps['rate'] - target[:, 1])[:, counts & ~reversing]
    values = [(tracking.rms(m), math.sqrt(np.convolve(m * m, np.full(second, 1.0 / second), 'valid').max()),
               metrics.peak(m), tracking.rms(rate_error)) for m, rate_error in zip(miss, noise)]
    return np.degrees(values)


def batch(item: tuple[str, Source, int, int]) -> tuple[Floats, Floats]:
    """Return (miss (n,) [rad] summed over the runs; metrics of METRIC_UNITS of every run (count, 4)) of an item (axis,
    source, first run, number of runs)."""
    axis, source, first, count = item
    steps = steps_of(axis, source, first, count)
    return steps['miss'].sum(axis=0), measures(axis, steps)


@dataclasses.dataclass(frozen=True)
class MissStatistics:
    """Statistics of the runs of a source on an axis."""
    axis: str
    miss_mean: Floats   # mean over the runs at each step [rad]
    values: Annotated[Floats, '(runs, 4)']  # metrics of METRIC_UNITS of every run

    def of(self, metric: str) -> Floats:
        """Return the values of a metric in every run. metric: a key of METRIC_UNITS."""
        return self.values[:, list(METRIC_UNITS).index(metric)]

    def mean(self, metric: str) -> float:
        """Return the mean of a metric over the runs. metric: a key of METRIC_UNITS."""
        return float(self.of(metric).mean())


_Name = TypeVar('_Name')    # of a case


def statistics(cases: Mapping[_Name, tuple[str, Source]], count: int, pool: Pool,
               progress: Progress = lambda share, text: None) -> dict[_Name, MissStatistics]:
    """Return {name: statistics} of `count` runs of each of {name: (axis, source)}."""
    pieces = monte_carlo.batches(count, BATCH_RUNS)
    items = [(axis, source, *piece) for axis, source in cases.values() for piece in pieces]
    done = pool.map(batch, items, progress)
    result = {}
    for name, (axis, _) in cases.items():
        miss, values = np.zeros(()), []
        for _ in pieces:
            more, of_runs = next(done)
            miss = miss + more
            values.append(of_runs)
        result[name] = MissStatistics(axis, miss / count, np.concatenate(values))
    return result
