"""Rate and acceleration of filters through ever sharper reversals (Lin 2020, figures 3 and 4).

A target moves to and fro through 20 deg at 3.5 deg/s. In a reversal its rate is half a cosine. Cases are
reversal-<seconds>/<filter>; their metrics are the rms errors of rate and acceleration inside the reversal. `imm-a` and
`imm-b` are IMMs whose ca model has a process noise of 40 and of 5 deg/s3/sqrt(Hz), as in `imm` and `imm-b` of the
study imm-feedforward.
"""
import math
from collections.abc import Mapping
from typing import TypeAlias

import numpy as np
from matplotlib.figure import Figure

from pedestal_common.quantities import Bools, Floats, Records, Row, Seconds, Times
from pedestal_results.intervals import row
from pedestal_results.report import figures as fig
from pedestal_studies import ensemble, profiles
from pedestal_studies.p003_lin_wu_zhu import feedforward_loop
from pedestal_studies.profiles import Motion
from pedestal_studies.result import Item, Result, legend
from pedestal_workbench.trials import monte_carlo
from pedestal_workbench.trials.monte_carlo import Pool, Progress

Errors: TypeAlias = dict[tuple[Seconds, str], Floats]
"""{(reversal, filter): rms (2, runs) of rate [deg/s] and acceleration [deg/s2]}."""

DEFAULT_RUNS = 200  # runs of the motion; the paper has 50
BATCH_RUNS, NOISE_SEED = 25, 1  # runs of one batch; seed of their noise

REVERSAL_DURATIONS_S = (4.0, 2.0, 1.0, 0.5, 0.35)  # their peak accelerations are 2.7 to 31 deg/s2

LEAD_TIME_S = 5.0  # of uniform motion, until the target is in the middle of its stroke [s]

MEASUREMENT_NOISE = ensemble.Noise(feedforward_loop.MISS_SIGMA_RAD)  # noise of the measured angle

FILTERS = {'cv': feedforward_loop.cv(0.1).own_filter, 'ca': feedforward_loop.ca(10.0).own_filter,
           'imm-a': feedforward_loop.imm(q_ca=40.0, predicted=False).own_filter,
           'imm-b': feedforward_loop.imm(q_ca=5.0, predicted=False).own_filter}
"""{filter: its parameters}. The numbers are the process noise of the filter: cv in deg/s2/sqrt(Hz), ca and imm in
deg/s3/sqrt(Hz)."""

FILTER_COLOURS = {'cv': fig.TRUTH_COLOUR, 'ca': fig.RAW_COLOUR, 'imm-a': fig.MOTOR_1_COLOUR,
                  'imm-b': fig.FILTERED_COLOUR}

ACCELERATION_ROW = 1  # row of the acceleration in the rms of `measured`; row 0 is the rate
RATE_RATIO_TARGET = '>= 3'  # required ratio: rate error of cv divided by rate error of imm-b [-]


def motion() -> tuple[Times, Motion, dict[Seconds, Bools]]:
    """Return (times, truth, {reversal: mask of its times}) of all reversals."""
    # begin: time at which the target is in the middle of its stroke before the next reversal; legs: these times of all
    # reversals; starts: {reversal: time at which it starts}.
    stroke, rate = profiles.S_MOTION_STROKE_RAD, profiles.S_MOTION_RATE_RAD_S
    begin, legs, starts = LEAD_TIME_S, [], {}
    for reversal in REVERSAL_DURATIONS_S:
        uniform = stroke / rate - 2.0 * reversal / math.pi
        legs.append(begin)
        starts[reversal] = begin + 0.5 * uniform
        begin += uniform + reversal
    t = ensemble.MEASUREMENT_PERIOD_S * np.arange(round(begin / ensemble.MEASUREMENT_PERIOD_S), dtype=float)
    truth = np.array([rate * (t - LEAD_TIME_S), np.full(len(t), rate), np.zeros(len(t))])
    for i, (reversal, leg) in enumerate(zip(REVERSAL_DURATIONS_S, legs)):
        later = t >= leg
        truth[:, later] = (-1.0) ** i * np.array(profiles.s_motion(t[later] - leg, stroke, rate, reversal))
    return t, profiles.Motion(*truth), {reversal: (t >= start) & (t <= start + reversal)
                                        for reversal, start in starts.items()}


def batch(item: Item) -> tuple[Records, Floats]:
    """Return (Moments (n,) over the runs, rms of rate [deg/s] and acceleration [deg/s2] of every run inside the
    reversals, (count, len(REVERSAL_DURATIONS_S), 2)) of an item (filter, first run, number of runs)."""
    name, first, count = item
    t, truth, reversals = motion()
    sums = ensemble.moments(FILTERS[name], t, truth, MEASUREMENT_NOISE, ensemble.records(truth, MEASUREMENT_NOISE,
                                                                                         NOISE_SEED, first, count))
    inside = [ensemble.over_time(sums[:, mask]) for mask in reversals.values()]
    rms = np.degrees([[ensemble.rms(moments, what) for what in ('rate', 'acceleration')] for moments in inside])
    return ensemble.over_runs(sums), rms.transpose(2, 0, 1)


def run(progress: Progress, runs: int = DEFAULT_RUNS, pool: Pool | None = None) -> Result:
    """Filter `runs` noisy records with each of FILTERS."""
    pool = pool or monte_carlo.Pool(1)
    items = [(name, first, count) for name in FILTERS for first, count in monte_carlo.batches(runs, BATCH_RUNS)]
    sums_of: dict[str, Records] = {}
    errors: dict[str, list[Floats]] = {}
    for (name, *_), (sums, rms) in zip(items, pool.map(batch, items, progress)):
        sums_of[name] = ensemble.sum_of_moments(sums_of[name], sums) if name in sums_of else sums
        errors.setdefault(name, []).append(rms)
    values = measured({name: np.concatenate(rms) for name, rms in errors.items()})
    figures = {'figure-3': lambda: moments_figure(sums_of, 'rate', 'rate [deg/s]'),
               'figure-4': lambda: moments_figure(sums_of, 'acceleration', 'acceleration [deg/s2]'),
               'sharpness': lambda: sharpness_figure(values)}
    return Result(rows(values), figures, remarks(values))


def measured(errors: Mapping[str, Floats]) -> Errors:
    """Return the errors by reversal and filter; errors: {filter: (runs, len(REVERSAL_DURATIONS_S), 2)}."""
    return {(reversal, name): rms[:, i].T for i, reversal in enumerate(REVERSAL_DURATIONS_S)
            for name, rms in errors.items()}


def rows(values: Errors) -> list[Row]:
    """Return the rows of the study."""
    table = []
    for (reversal, name), (rate, acceleration) in values.items():
        case = f'reversal-{reversal:g}s/{name}'
        table += [row(case, 'rate_rms_deg_s', rate, 'deg/s'),
                  row(case, 'acceleration_rms_deg_s2', acceleration, 'deg/s2')]
        if name != 'cv':
            cv_rate, cv_acceleration = values[reversal, 'cv']
            table += [row(case, 'rate_ratio_of_cv', cv_rate / rate, '',
                          target=RATE_RATIO_TARGET if name == 'imm-b' else None),
                      row(case, 'acceleration_ratio_of_cv', cv_acceleration / acceleration, '')]
    return table


def peak_acceleration(reversal: Seconds) -> float:
    """Return the peak acceleration [deg/s2] of a reversal of this duration."""
    return math.pi * math.degrees(profiles.S_MOTION_RATE_RAD_S) / reversal


def remarks(values: Errors) -> list[str]:
    """Return the sentences that explain the rows."""
    worse = [f'{peak_acceleration(reversal):.1f}' for reversal in REVERSAL_DURATIONS_S
             if values[reversal, 'imm-a'][ACCELERATION_ROW].mean() > values[reversal, 'cv'][ACCELERATION_ROW].mean()]
    lines = ['_ratio_of_cv is the error of cv over the error of the filter. cv estimates no acceleration, so its '
             'error is the acceleration itself.']
    if worse:
        lines.append(f'imm-a is tuned for the miss. In reversals of {", ".join(worse)} deg/s2 its acceleration has '
                     'a larger error than an estimate of zero.')
    return lines


def moments_figure(sums_of: Mapping[str, Records], what: str, label: str) -> Figure:
    """Draw truth and mean estimates, mean errors +-1 sigma below (figures 3, 4); what: 'rate', 'acceleration'."""
    t, truth, _ = motion()
    figure, axes = fig.new_panels(2, height=5.4, y=(label, f'error of the {label}'), sharex=True)
    true_value = truth[('angle', 'rate', 'acceleration').index(what)]
    axes[0, 0].plot(t, np.degrees(true_value), color=fig.INK_COLOUR, linestyle='--', linewidth=0.8, label='truth')
    for name in ('cv', 'imm-b'):
        sums = sums_of[name]
        mean = sums[what] / sums['runs']
        sigma = np.sqrt(np.maximum(sums[f'{what}2'] / sums['runs'] - mean * mean, 0.0))
        axes[0, 0].plot(t, np.degrees(true_value + mean), color=FILTER_COLOURS[name], label=name)
        axes[1, 0].plot(t, np.degrees(mean), color=FILTER_COLOURS[name])
        axes[1, 0].fill_between(t, np.degrees(mean - sigma), np.degrees(mean + sigma), color=FILTER_COLOURS[name],
                                alpha=0.25, linewidth=0.0)
    axes[1, 0].set_xlim(LEAD_TIME_S - 1.0, t[-1])
    return legend(figure)


def sharpness_figure(values: Errors) -> Figure:
    """Draw the errors of rate and acceleration over the peak acceleration of the reversal."""
    figure, axes = fig.new_panels(1, 2, height=3.6, x='peak acceleration of the reversal [deg/s2]', sharex=True)
    x = [peak_acceleration(reversal) for reversal in REVERSAL_DURATIONS_S]
    for i, (panel, label) in enumerate(zip(axes[0], ('rate rms [deg/s]', 'acceleration rms [deg/s2]'))):
        for name, colour in FILTER_COLOURS.items():
            y = [values[reversal, name][i].mean() for reversal in REVERSAL_DURATIONS_S]
            panel.loglog(x, y, 'o-', ms=3.5, color=colour, label=name)
        panel.set_ylabel(label)
        panel.set_xticks(x, [f'{value:.2g}' for value in x])
        panel.set_xticks([], minor=True)
    return legend(figure)
