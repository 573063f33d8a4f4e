"""Effect of an independent measurement of the rate on the filter (Li 2018): bandwidth and dynamic error.

With constant sigma_a and noises, the 'current' statistical filter settles to constant gains: X+ = A X + B (y, y'). X
is the estimate of angle, rate and acceleration; sigma_a is the acceleration of the target that the filter assumes. A
and B are identified on the compiled filter itself, with one unit state and one unit measurement at a time. A sine y =
e^jwt, y' = jw y then gives the response G of the estimate:

    G(jw) = (1 - A e^-jwT)^-1 B (1, jw)',        angle: G_1,  rate: G_2 / jw,  dynamic error: |1 - G_1|.

The bandwidth of the rate is the frequency at which |G_2 / jw| first falls below -3 dB. If the measured rate has enough
weight, |G_1| never falls below -3 dB, because the two measurements make a complementary filter.
"""
import dataclasses
import math
import typing
from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure

from acu_tracker.estimation.filters import axis_filter
from acu_tracker.estimation.filters.measurement import AxisMeasurement
from acu_tracker.estimation.params import FilterParameters
from pedestal_common.compiled import compiled
from pedestal_common.quantities import (
    Complexes,
    Floats,
    Hertz,
    Pairs,
    Radians,
    RadiansPerSecond,
    RadiansPerSecond2,
    Records,
    Row,
    Times,
    Vector3,
    Vectors3,
)
from pedestal_results import tracking
from pedestal_results.intervals import row
from pedestal_results.report import figures as fig
from pedestal_studies import ensemble, profiles
from pedestal_studies.ensemble import MEASUREMENT_PERIOD_S as T
from pedestal_studies.result import Drawings, Metrics, Result, legend, of_cases
from pedestal_workbench.trials.monte_carlo import Pool, Progress

DEFAULT_RUNS = 40  # number of flybys
ANGLE_SIGMA_RAD = math.radians(0.03)  # noise of a measured angle [rad]
ALPHA = 0.5  # reciprocal of the time for which the filter expects an acceleration to last [1/s]
ACCELERATION_SIGMAS_DEG_S2 = (0.05, 0.5, 3.0)  # values of sigma_a [deg/s2]

RATE_SIGMAS_DEG_S = {'position': math.nan, 'position-rate': 0.1, 'position-rate-0.02': 0.02}

MAIN_SIGMA_DEG_S2 = 0.5  # sigma_a of the cases whose name does not state it [deg/s2]
DYNAMIC_ERROR_FREQUENCY_HZ = 0.2  # frequency of the dynamic error [Hz]
RESPONSE_FREQUENCIES_HZ = np.geomspace(0.01, 0.5 / T, 2000)  # frequencies of the responses [Hz]
SETTLING_STEPS = 20000  # steps after which the gains are constant, also with the smallest sigma_a

FLYBY_PROFILE = 'flyby-60m'

MAX_ACCELERATION_RATIO = 1.2  # a_max of the filter over the largest acceleration of the flight [-]
MIN_SIGMA_RATIO = 0.3  # least sigma_a over a_max [-]

SETTLING_TIME_S = 5.0  # time of the flyby from which the errors are evaluated [s]

DIFFERENCED_RATES = {'differenced-1': 1, 'differenced-20': 20}
"""{case: steps of T over which the measured angles are differenced to a rate}."""

RATE_SOURCE_MEANINGS = {  # {case of the flyby: source of its rate}, for the table of the documentation
    'position': 'none: only the angle is measured', 'position-rate': 'sensor of its own, noise 0.1 deg/s',
    'position-rate-0.02': 'sensor of its own, noise 0.02 deg/s',
    'differenced-1': 'difference of the measured angles over one step of 10 ms',
    'differenced-20': 'difference of the measured angles over 20 steps, 0.2 s'}


class FlybyRecord(typing.NamedTuple):
    """Record of a flyby."""
    angle: Floats       # measured [rad]
    rate: Floats        # measured [rad/s]
    estimate: Records   # axis_filter.Estimate (n,)


NOISE_SEED = 1  # seed of the noise of the flybys


def filter_of(a_max: RadiansPerSecond2, floor: float) -> FilterParameters:
    """Return a 'current' statistical filter that uses the measured rate; floor: least sigma_a over a_max [-]."""
    model = dataclasses.replace(FilterParameters().current_statistical, alpha=ALPHA, a_max=a_max, floor=floor)
    return FilterParameters(kind='current_statistical', rate_measurement=True, current_statistical=model)


@compiled
def _settle(filters: Records, constants: Records, rate: RadiansPerSecond, R_rate: float, steps: int) -> None:
    axis_filter.start(filters[0], constants[0], 0.0, ANGLE_SIGMA_RAD * ANGLE_SIGMA_RAD, 1.0)
    for _ in range(steps):
        axis_filter.predict(filters[0], constants[0], T)
        axis_filter.correct(filters[0], constants[0],
                            AxisMeasurement(0.0, ANGLE_SIGMA_RAD * ANGLE_SIGMA_RAD, rate, R_rate))


@compiled
def _step(filters: Records, constants: Records, y: Radians, y_rate: RadiansPerSecond, R_rate: float) -> None:
    axis_filter.predict(filters[0], constants[0], T)
    axis_filter.correct(filters[0], constants[0],
                        AxisMeasurement(y, ANGLE_SIGMA_RAD * ANGLE_SIGMA_RAD, y_rate, R_rate))


def steady_state_matrices(sigma_a: float, rate_sigma: float) -> tuple[Floats, Floats]:
    """Return (A (3, 3), B (3, 2)) of X+ = A X + B (y, y') with constant gains.

    rate_sigma: noise of the rate [deg/s], NaN without a measured rate. B then has a column of zeros.
    """
    c = axis_filter.constants(filter_of(math.radians(sigma_a), 1.0))        # floor 1: sigma_a = a_max at all times
    R_rate = math.radians(rate_sigma) ** 2
    zero_rate = 0.0 if math.isfinite(R_rate) else math.nan
    f = axis_filter.Filter.zeros()
    _settle(f, c, zero_rate, R_rate, SETTLING_STEPS)

    def after(x: Vector3 | float, y: Radians, y_rate: RadiansPerSecond) -> Vector3:
        """Return the state one step after the state x, with the measurements y and y_rate."""
        one = f.copy()
        one['x'][0, 0] = x
        _step(one, c, y, y_rate, R_rate)
        return one['x'][0, 0]

    A = np.column_stack([after(unit, 0.0, zero_rate) for unit in np.eye(3)])
    B = np.column_stack([after(0.0, 1.0, zero_rate), after(0.0, 0.0, 1.0 if math.isfinite(R_rate) else math.nan)])
    return A, B


def responses(A: Floats, B: Floats, frequency: Floats) -> tuple[Complexes, Complexes]:
    """Return (G_1, G_2 / jw) at frequencies [Hz]: estimated over true angle, and over true rate."""
    jw = 2j * math.pi * frequency
    X = np.linalg.solve(np.eye(3) - A * np.exp(-jw * T)[:, None, None], (B[:, 0] + jw[:, None] * B[:, 1])[..., None])
    return X[:, 0, 0], X[:, 1, 0] / jw


def bandwidth(G: Complexes) -> Hertz:
    """Return the frequency at which |G| over RESPONSE_FREQUENCIES_HZ first falls below -3 dB, or NaN."""
    gain = np.log(np.abs(G)) - 0.5 * math.log(0.5)
    below = np.flatnonzero(gain < 0.0)
    if below.size == 0:
        return math.nan
    i = below[0]
    f = RESPONSE_FREQUENCIES_HZ
    return float(f[i - 1] * (f[i] / f[i - 1]) ** (gain[i - 1] / (gain[i - 1] - gain[i])))


def measures(sigma_a: float, rate_sigma: float) -> Metrics:
    """Return the metrics of the filter with constant gains; arguments: those of `steady_state_matrices`."""
    A, B = steady_state_matrices(sigma_a, rate_sigma)
    angle, rate = responses(A, B, RESPONSE_FREQUENCIES_HZ)
    (angle_at_frequency,), _ = responses(A, B, np.array([DYNAMIC_ERROR_FREQUENCY_HZ]))
    error = 1.0 - angle_at_frequency
    return {'rate_bandwidth_hz': (bandwidth(rate), 'Hz'), 'angle_bandwidth_hz': (bandwidth(angle), 'Hz'),
            'dynamic_error_0p2hz': (abs(error), ''), 'largest_eigenvalue': (np.abs(np.linalg.eigvals(A)).max(), '')}


CASES = {name if sigma_a == MAIN_SIGMA_DEG_S2 else f'{name}/sigma_a-{sigma_a:g}': (sigma_a, rate_sigma)
         for sigma_a in (MAIN_SIGMA_DEG_S2, *ACCELERATION_SIGMAS_DEG_S2)
         for name, rate_sigma in RATE_SIGMAS_DEG_S.items()}
"""{case: (sigma_a [deg/s2], noise of the rate [deg/s])}."""


def differenced_rate(y: Floats, steps: int) -> tuple[Floats, float]:
    """Return (rate [rad/s], its variance) from differences of angles y [rad] over `steps` T, the first `steps` NaN."""
    rate = np.full(len(y), math.nan)
    rate[steps:] = (y[steps:] - y[:-steps]) / (steps * T)
    return rate, 2.0 * (ANGLE_SIGMA_RAD / (steps * T)) ** 2


def filtered(t: Times, target: Vectors3, y: Floats, y_rate: Floats, R_rate: float) -> Records:
    """Return the axis_filter.Estimate (n,) from measured angles y [rad] and rates y_rate [rad/s] of variance R_rate;
    target: true angle, rate and acceleration."""
    c = axis_filter.constants(filter_of(MAX_ACCELERATION_RATIO * np.abs(target[:, 2]).max(), MIN_SIGMA_RATIO))
    out = np.zeros(len(t), axis_filter.Estimate.dtype)
    axis_filter.estimates(c, t, y, np.full(len(t), ANGLE_SIGMA_RAD * ANGLE_SIGMA_RAD), y_rate, np.full(len(t), R_rate),
                          ensemble.INITIAL_RATE_SIGMA_RAD_S, out)
    return out


def flyby() -> tuple[Times, Vectors3]:
    """Return (times, angle, rate and acceleration) of FLYBY_PROFILE."""
    t = T * np.arange(round(profiles.RECORD_DURATION_S / T), dtype=float)
    return t, np.column_stack(profiles.truth(FLYBY_PROFILE, t))


def flyby_record(name: str, run: int) -> FlybyRecord:
    """Return the record of one flyby of one of FLYBY_CASES. The noise depends only on `run`."""
    t, target = flyby()
    normals = ensemble.normal_draws(NOISE_SEED, run, 1, len(t))[:, 0]
    y = target[:, 0] + ANGLE_SIGMA_RAD * normals[0]
    if name in DIFFERENCED_RATES:
        y_rate, R_rate = differenced_rate(y, DIFFERENCED_RATES[name])
    else:
        sigma = math.radians(RATE_SIGMAS_DEG_S[name])
        y_rate, R_rate = target[:, 1] + sigma * normals[1], sigma * sigma
    return FlybyRecord(y, y_rate, filtered(t, target, y, y_rate, R_rate))


def flyby_errors(name: str, run: int) -> Floats:
    """Return the rms errors of the angle [deg] and of the rate [deg/s] of one flyby."""
    t, target = flyby()
    counts = t >= SETTLING_TIME_S
    out = flyby_record(name, run).estimate
    return np.degrees([tracking.rms((out[field] - target[:, i])[counts]) for i, field in enumerate(('angle', 'rate'))])


FLYBY_CASES = (*RATE_SIGMAS_DEG_S, *DIFFERENCED_RATES)
METRIC_TARGETS = {('position-rate', 'rate_bandwidth_ratio'): '>= 1.5',
                  ('position-rate', 'dynamic_error_ratio'): '>= 9'}


def rows(measured: Mapping[str, Metrics], errors: Mapping[str, Pairs]) -> list[Row]:
    """Return the rows of measured {case: of `measures`} and errors {of FLYBY_CASES: rms [deg, deg/s] of runs}."""
    table = []
    for name, values in measured.items():
        table += [row(name, metric, value, unit, target='< 1' if metric == 'largest_eigenvalue' else None)
                   for metric, (value, unit) in values.items()]
        # A ratio compares this case with the case of the same sigma_a without a measured rate.
        kind, _, sigma_a = name.partition('/')
        if kind != 'position':
            without = measured['position' + ('/' + sigma_a if sigma_a else '')]
            for metric, over, under in (('rate_bandwidth', values, without), ('dynamic_error', without, values)):
                full = next(key for key in values if key.startswith(metric))
                ratio = over[full][0] / under[full][0]
                table.append(row(name, f'{metric}_ratio', ratio, '',
                                 target=METRIC_TARGETS.get((name, f'{metric}_ratio'))))
    for name, rms in errors.items():
        table += [row(f'{FLYBY_PROFILE}/{name}', 'angle_rms_deg', rms[:, 0], 'deg'),
                  row(f'{FLYBY_PROFILE}/{name}', 'rate_rms_deg_s', rms[:, 1], 'deg/s')]
    return table


def remarks(measured: Mapping[str, Metrics], errors: Mapping[str, Pairs]) -> list[str]:
    """Return the sentences that explain the rows; arguments: those of `rows`."""
    one, twenty, without = (errors[name][:, 0].mean() for name in (*DIFFERENCED_RATES, 'position'))
    largest, slowest = max((measured[name]['largest_eigenvalue'][0], name) for name in measured)
    return [
        f'Li 2018 prints neither its noises nor its sigma_a. Ours are {math.degrees(ANGLE_SIGMA_RAD):g} deg for the '
        'angle, 0.1 and 0.02 deg/s for the rate, and sigma_a '
        f'{", ".join(f"{sigma_a:g}" for sigma_a in ACCELERATION_SIGMAS_DEG_S2)} deg/s2. Rows without sigma_a in their '
        f'name have {MAIN_SIGMA_DEG_S2:g} deg/s2. The paper claims a wider band and a smaller dynamic error, without '
        'a number. The claim is true; the amount depends on the noises and sigma_a.',
        'An angle_bandwidth_hz without a number means that the gain of the angle never falls by 3 dB, because of the '
        'measured rate.',
        f'The filter is stable in every case: the largest eigenvalue is {largest:.4f} ({slowest}).',
        f'Only an independent rate helps. A rate differenced from the same angles over {T:g} s does not change the '
        f'error on {FLYBY_PROFILE} ({one:.4f} deg, {without:.4f} deg without). A rate differenced over '
        f'{DIFFERENCED_RATES["differenced-20"] * T:g} s, with noise that the filter assumes white, increases the '
        f'error ({twenty:.4f} deg). This rate is late by half that time, and its errors are those of the angles.',
    ]


CASE_COLOURS = {'position': fig.TRUTH_COLOUR, 'position-rate': fig.FILTERED_COLOUR,
                'position-rate-0.02': fig.MOTOR_2_COLOUR}


def figures() -> Drawings:
    """Return the figures."""
    return {'bode': bode_figure, 'sigma_a': sigma_a_figure, 'flyby': flyby_figure}


def bode_figure() -> Figure:
    """Draw the responses of angle and rate with and without a measured rate, and their dynamic errors."""
    figure, axes = fig.new_panels(2, 2, height=5.6, x='frequency [Hz]', y=('gain [dB]', 'dynamic error |1 - G|'),
                                  sharex=True)
    for name, colour in CASE_COLOURS.items():
        angle, rate = responses(*steady_state_matrices(MAIN_SIGMA_DEG_S2, RATE_SIGMAS_DEG_S[name]),
                                RESPONSE_FREQUENCIES_HZ)
        for column, G in enumerate((angle, rate)):
            axes[0, column].semilogx(RESPONSE_FREQUENCIES_HZ, 20.0 * np.log10(np.abs(G)), color=colour, label=name)
            axes[1, column].loglog(RESPONSE_FREQUENCIES_HZ, np.abs(1.0 - G), color=colour, label=name)
    for column, title in enumerate(('estimated over true angle', 'estimated over true rate')):
        axes[0, column].set_title(title)
        axes[0, column].axhline(-3.0, color=fig.INK_COLOUR, linewidth=0.6, linestyle=':')
        axes[0, column].set_ylim(-25.0, 5.0)
        axes[1, column].axvline(DYNAMIC_ERROR_FREQUENCY_HZ, color=fig.INK_COLOUR, linewidth=0.6, linestyle=':')
        axes[1, column].set_ylim(1e-5, 3.0)
    return legend(figure)


def sigma_a_figure() -> Figure:
    """Draw bandwidth of the rate and dynamic error of the angle over sigma_a, with and without a measured rate."""
    figure, axes = fig.new_panels(1, 2, height=3.4, x='sigma_a [deg/s2]', y='bandwidth of the rate [Hz]', sharex=True)
    sigma_a = np.geomspace(ACCELERATION_SIGMAS_DEG_S2[0], ACCELERATION_SIGMAS_DEG_S2[-1], 13)
    for name, colour in CASE_COLOURS.items():
        values = [measures(s, RATE_SIGMAS_DEG_S[name]) for s in sigma_a]
        for panel, metric in zip(axes[0], ('rate_bandwidth_hz', 'dynamic_error_0p2hz')):
            panel.loglog(sigma_a, [value[metric][0] for value in values], color=colour, label=name)
    axes[0, 1].set_ylabel(f'dynamic error of the angle at {DYNAMIC_ERROR_FREQUENCY_HZ:g} Hz')
    return legend(figure)


def flyby_figure() -> Figure:
    """Draw the quantities of the paper's figures 1 to 8 on the flyby: rate, error of angle and rate, acceleration."""
    labels = ('rate [deg/s]', 'error of the angle [deg]', 'error of the rate [deg/s]', 'acceleration [deg/s2]')
    figure, axes = fig.new_panels(4, height=8.6, y=labels, sharex=True)
    t, target = flyby()
    record = flyby_record('position-rate', run=0)
    near = np.abs(t - 0.5 * profiles.RECORD_DURATION_S) <= 0.2 * profiles.RECORD_DURATION_S
    measured = (record.rate, record.angle - target[:, 0], record.rate - target[:, 1], None)
    truth = (target[:, 1], 0.0 * t, 0.0 * t, target[:, 2])
    for panel, values in zip(axes[:, 0], measured):
        if values is not None:
            panel.plot(t[near], np.degrees(values[near]), color=fig.RAW_COLOUR, linewidth=0.5, label='measured')
    for name in ('position', 'position-rate'):
        out = flyby_record(name, run=0).estimate
        for panel, values in zip(axes[:, 0], (out['rate'], out['angle'] - target[:, 0], out['rate'] - target[:, 1],
                                              out['acceleration'])):
            panel.plot(t[near], np.degrees(values[near]), color=CASE_COLOURS[name], label=name)
    for panel, values in zip(axes[:, 0], truth):
        panel.plot(t[near], np.degrees(values[near]), color=fig.INK_COLOUR, linestyle='--', label='truth')
    axes[0, 0].set_title(f'{FLYBY_PROFILE}, one run')
    return legend(figure)


def run(progress: Progress, runs: int = DEFAULT_RUNS, pool: Pool | None = None) -> Result:
    """Identify the filters of CASES and run `runs` flybys."""
    errors = of_cases(flyby_errors, FLYBY_CASES, runs, pool, progress, size=25)
    measured = {name: measures(*case) for name, case in CASES.items()}
    return Result(rows(measured, errors), figures(), remarks(measured, errors))
