"""Ma 2023's choice of a filter: least squares, alpha-beta, alpha-beta-gamma, Wiener and Kalman filter compared.

The paper (introduction) names these five filters for the angle of a target and states that the Kalman filter has the
better effect. It prints no number. Its Kalman filter is that of the 'current' statistical model.

Cases are MOTION/FILTER/TUNING. The motions are those of profiles.py, measured at 100 Hz with white noise of 0.03 deg;
MOTION all is their geometric mean. TUNING is own-tuning, for this motion, or one-tuning, for all motions. A tuning
minimises the rms of the angle over records of other seeds. A ratio divides the rms error by that of kalman in the run
of equal noise.
"""
import math
from collections.abc import Mapping, Sequence
from typing import TypeAlias

import numpy as np
from matplotlib.figure import Figure

from acu_tracker.estimation.params import FilterParameters
from pedestal_common.quantities import Pairs, Row
from pedestal_results import tracking
from pedestal_results.intervals import row
from pedestal_results.report import figures as fig
from pedestal_studies import ensemble, profiles
from pedestal_studies.p000_ma import window_filter
from pedestal_studies.result import Result
from pedestal_studies.system import filters
from pedestal_workbench.trials import monte_carlo
from pedestal_workbench.trials.monte_carlo import Pool, Progress
from pedestal_workbench.tuning import parameter_search

Window: TypeAlias = tuple[int, int]     # parameters of least squares: number of measurements, degree
Tuned: TypeAlias = tuple[str, FilterParameters | Window]    # a filter and its parameters

DEFAULT_RUNS, BATCH_RUNS = 100, 25  # runs of each case; runs that one worker makes at a time
NOISE = filters.NOISE_CASES[filters.SHOWN_NOISE]  # noise of the measured angle
WINDOW_STEPS = 600  # window of the Wiener filter and longest window of least squares [measurements]

LEAST_SQUARES_WINDOWS = tuple(sorted({round(n) for n in np.geomspace(5, WINDOW_STEPS, 40)}))
"""Windows that the tuning of least squares tries [measurements]."""

FILTER_MEANINGS = {'least_squares': 'least squares', 'alpha_beta': 'the alpha-beta filter',
                   'alpha_beta_gamma': 'the alpha-beta-gamma filter', 'wiener': 'the Wiener filter',
                   'kalman': "the Kalman filter of the 'current' statistical model",
                   'imm': 'the untuned default filter of the product'}

TUNED_FILTERS = tuple(name for name in FILTER_MEANINGS if name != 'imm')
KALMAN_KINDS = {'kalman': 'current_statistical', 'alpha_beta': 'alpha_beta', 'alpha_beta_gamma': 'alpha_beta_gamma',
                'wiener': 'singer', 'imm': 'imm'}
"""{filter: kind of its FilterParameters}. The Wiener filter has the parameters of the kind singer, whose acceleration
has the same autocorrelation."""

TUNINGS = ('own-tuning', 'one-tuning')
MEAN_MOTION = 'all'  # MOTION of the geometric mean over all motions

UNITS = {'angle': 'deg', 'rate': 'deg/s'}


def errors(tuned: Tuned, motion: str, seed: int, first: int, count: int) -> Pairs:
    """Return the rms errors of angle [rad] and rate [rad/s] of every run, after the window."""
    name, params = tuned
    t = filters.times()
    truth = profiles.truth(motion, t)
    measured = ensemble.records(truth, NOISE, seed, first, count)
    if isinstance(params, tuple):
        estimated = window_filter.estimates(window_filter.least_squares(*params), measured[0])
    elif name == 'wiener':
        estimated = window_filter.estimates(window_filter.wiener(WINDOW_STEPS, params.singer.alpha,
                                                                 params.singer.sigma, NOISE.sigma), measured[0])
    else:
        sums = ensemble.over_time(ensemble.moments(params, t, truth, NOISE, measured)[:, WINDOW_STEPS:])
        return np.column_stack([ensemble.rms(sums, what) for what in UNITS])
    return np.column_stack([tracking.rms((estimated[i] - truth[i])[:, WINDOW_STEPS:], axis=1) for i in range(2)])


def tune(item: tuple[str, tuple[str, ...]]) -> Tuned:
    """Return the tuned filter of an item (filter, motions). Its geometric mean over the motions of the rms error of
    the angle is smallest on the records of filters.TUNING_SEED."""
    name, motions = item

    def criterion(params: FilterParameters | Window) -> float:
        return math.exp(np.mean([math.log(tracking.rms(errors(
            (name, params), motion, filters.TUNING_SEED, 0, filters.TUNING_RUNS)[:, 0])) for motion in motions]))

    if name == 'least_squares':
        return name, min(((n, degree) for n in LEAST_SQUARES_WINDOWS for degree in (1, 2)), key=criterion)
    return name, parameter_search.tuned(FilterParameters(kind=KALMAN_KINDS[name]), criterion)[0]


def batch(item: tuple[tuple[str, Tuned], int, int]) -> Pairs:
    """Return the errors [deg, deg/s] of every run of an item ((motion, tuned), first run, runs)."""
    (motion, tuned), first, count = item
    return np.degrees(errors(tuned, motion, filters.NOISE_SEED, first, count))


def run(progress: Progress, runs: int = DEFAULT_RUNS, pool: Pool | None = None,
        motions: Sequence[str] = profiles.PROFILES) -> Result:
    """Tune all filters and run them `runs` times; motions: names of profiles."""
    pool = pool or monte_carlo.Pool(1)
    groups = dict.fromkeys((*((motion,) for motion in motions), tuple(motions)))
    items = [(name, of) for name in TUNED_FILTERS for of in groups]
    found = dict(zip(items, pool.map(tune, items, lambda share, text: progress(0.7 * share, f'tuning, {text}'))))
    cases = {(motion, name, tuning): (motion, found[name, (motion,) if tuning == 'own-tuning' else tuple(motions)])
             for motion in motions for name in TUNED_FILTERS for tuning in TUNINGS}
    cases |= {(motion, 'imm', 'one-tuning'): (motion, ('imm', FilterParameters(kind='imm'))) for motion in motions}
    pieces = monte_carlo.batches(runs, BATCH_RUNS)
    done = pool.map(batch, [(case, *piece) for case in cases.values() for piece in pieces],
                    lambda share, text: progress(0.7 + 0.3 * share, f'{runs} runs of each case, {text}'))
    values = {case: np.concatenate([next(done) for _ in pieces]) for case in cases}
    for name, tuning in dict.fromkeys(case[1:] for case in cases):
        values[MEAN_MOTION, name, tuning] = np.exp(np.mean(
            [np.log(values[motion, name, tuning]) for motion in motions], axis=0))
    table = rows(values)
    return Result(table, {'ratios': lambda: ratio_figure(table, motions)}, remarks(found, runs),
                  [r for r in table if r['case'].startswith(f'{MEAN_MOTION}/')])


def rows(values: Mapping[tuple[str, str, str], Pairs]) -> list[Row]:
    """Return the rows of {(motion, filter, tuning): errors [deg, deg/s] of every run}."""
    table = []
    for (motion, name, tuning), of_case in values.items():
        case, kalman = f'{motion}/{name}/{tuning}', values[motion, 'kalman', tuning]
        for i, (what, unit) in enumerate(UNITS.items()):
            table.append(row(case, f'{what}_rms_{unit.replace("/", "_")}', of_case[:, i], unit))
            if name != 'kalman':
                table.append(row(case, f'{what}_ratio_to_kalman', of_case[:, i] / kalman[:, i]))
    return table


def remarks(found: Mapping[tuple[str, tuple[str, ...]], Tuned], runs: int) -> list[str]:
    """Return the sentences that explain the rows; found: {(filter, motions): tuned filter}."""
    tuned = ', '.join(f'{motions[0]} {n} measurements, degree {degree}' for (_, motions), (_, params)
                      in found.items() if isinstance(params, tuple) and len(motions) == 1
                      for n, degree in [params])
    return [
        f'{runs} runs of each case, evaluated from {WINDOW_STEPS * ensemble.MEASUREMENT_PERIOD_S:g} s on, when every '
        'window is full.',
        f'Windows of least squares: {tuned}.',
        'After its start a Kalman filter with a fixed model has constant gains, and the Wiener filter of the same '
        'model is then the same filter. The alpha-beta-gamma filter is the steady Kalman filter of another model. '
        'With one tuning for all motions only a filter that changes its model with the target, such as imm, has a '
        'clearly smaller error.']


def ratio_figure(table: list[Row], motions: Sequence[str]) -> Figure:
    """Draw the error of every filter over that of kalman, a panel for each tuning; motions: names of profiles."""
    value = {(r['case'], r['metric']): r['value'] for r in table}
    figure, axes = fig.new_panels(1, 2, x='rms error of the angle over that of kalman', height=3.8, sharey=True)
    for panel, tuning in zip(axes[0], TUNINGS):
        ratios = {motion: {name: value.get((f'{motion}/{name}/{tuning}', 'angle_ratio_to_kalman'), math.nan)
                           for name in FILTER_MEANINGS if name != 'kalman'} for motion in (MEAN_MOTION, *motions)}
        panel.barh(list(ratios[MEAN_MOTION]), list(ratios[MEAN_MOTION].values()), color=fig.FILTERED_COLOUR)
        for motion in motions:
            panel.plot(list(ratios[motion].values()), list(ratios[motion]), 'o', color=fig.RAW_COLOUR, ms=3.0)
        panel.axvline(1.0, color=fig.INK_COLOUR, linewidth=0.8)
        panel.set_title(f'{tuning}; bar: all motions, dots: each motion')
    axes[0, 0].invert_yaxis()
    return figure
