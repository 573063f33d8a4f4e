"""Miss over rate noise for all tunings of every filter: a fair comparison of Lin 2020's feed-forward.

The loop is that of the study imm-feedforward, azimuth, with prediction over the delay for all filters. The rate noise
is the rms error of the rate that is fed forward while the rate of the target is constant. Any filter has a small miss
if its rate may be noisy. Each filter is therefore tuned from low to high bandwidth, which gives a curve of miss over
rate noise. This curve is compared with one point, the case imm-predicted: the IMM with the tuning of the study
imm-feedforward.
"""
import dataclasses
import math
from collections.abc import Mapping
from typing import TypeAlias

import numpy as np
from matplotlib.figure import Figure

from pedestal_common.quantities import Degrees, Floats, Row
from pedestal_results.intervals import row
from pedestal_results.report import figures as fig
from pedestal_studies.p003_lin_wu_zhu import feedforward_loop
from pedestal_studies.p003_lin_wu_zhu.feedforward_loop import MissStatistics, Source
from pedestal_studies.result import Result, legend
from pedestal_workbench.trials import monte_carlo
from pedestal_workbench.trials.monte_carlo import Pool, Progress

Tuning: TypeAlias = tuple[str, float]   # filter, value of its tuned parameter
Points: TypeAlias = Mapping[Tuning, tuple[float, Degrees] | Floats]     # {tuning: (rate noise [deg/s], miss)}

DEFAULT_RUNS = 50  # runs of each tuning, as many as in the paper
LOOP_AXIS = 'azimuth'  # axis of all runs

REFERENCE_SOURCE = feedforward_loop.imm(q_ca=40.0, predicted=True)  # case imm-predicted of imm-feedforward

REFERENCE_POINT = ('reference', 0.0)  # key of REFERENCE_SOURCE beside the keys (filter, value) of the tunings


def _current_statistical(a_max: float) -> Source:
    return Source(feedforward_loop.filter_of('current_statistical', current_statistical={
        'alpha': 0.5, 'a_max': math.radians(a_max)}))


def _logarithmic(low: float, high: float, points: int) -> list[float]:
    return [float(f'{value:.3g}') for value in np.geomspace(low, high, points)]


FILTER_TUNINGS = {  # {filter: (name of the tuned parameter, its values, function value -> Source)}; q: process noise
    'cv': ('q [deg/s2/sqrt(Hz)]', _logarithmic(0.05, 50.0, 13), feedforward_loop.cv),
    'ca': ('q [deg/s3/sqrt(Hz)]', _logarithmic(0.05, 500.0, 13), feedforward_loop.ca),
    'current_statistical': ('a_max [deg/s2], alpha 0.5 1/s', _logarithmic(0.5, 1000.0, 13), _current_statistical),
    'imm': ('q of its ca [deg/s3/sqrt(Hz)]', _logarithmic(0.5, 500.0, 10),
            lambda q: feedforward_loop.imm(q_ca=q, predicted=True))}

FILTER_MEANINGS = {'cv': 'Kalman filter of constant rate', 'ca': 'Kalman filter of constant acceleration',
                   'current_statistical': "'current' statistical model of Ma 2023",
                   'imm': 'IMM of cv, ca and current_statistical, with other noises of its ca'}

FILTER_COLOURS = {'cv': fig.TRUTH_COLOUR, 'ca': fig.RAW_COLOUR, 'current_statistical': fig.MOTOR_2_COLOUR,
                  'imm': fig.FILTERED_COLOUR}

MISS_RATIO_TARGET = '>= 5'


def cases() -> dict[Tuning, tuple[str, Source]]:
    """Return {tuning: (axis, source)} of all tunings and of the reference."""
    tunings = {(name, value): (LOOP_AXIS, dataclasses.replace(source(value), predicted=True))
             for name, (_, values, source) in FILTER_TUNINGS.items() for value in values}
    return tunings | {REFERENCE_POINT: (LOOP_AXIS, REFERENCE_SOURCE)}


def run(progress: Progress, runs: int = DEFAULT_RUNS, pool: Pool | None = None) -> Result:
    """Run every tuning `runs` times."""
    misses = feedforward_loop.statistics(cases(), runs, pool or monte_carlo.Pool(1), progress)
    points = {case: measured(misses[case]) for case in misses}
    mean = {case: tuple(values.mean(axis=1)) for case, values in points.items()}
    return Result(rows(points), {'miss': lambda: miss_figure(mean)}, remarks(mean))


def measured(statistics: MissStatistics) -> Floats:
    """Return (rate noise [deg/s], miss rms [deg]) of every run, an array (2, runs)."""
    return np.array([statistics.of(metric) for metric in ('rate_noise_deg_s', 'miss_rms_deg')])


def curve(points: Points, name: str) -> Floats:
    """Return (rate noise [deg/s], miss [deg]) of a filter over its tunings, an array (2, n)."""
    return np.array([points[name, value] for value in FILTER_TUNINGS[name][1]]).T


def frontier(points: Points, name: str) -> Floats:
    """Return the Pareto frontier of the curve of a filter, (2, n) of (rate noise, miss) by rising rate noise.

    It holds the tunings for which no other tuning has both less rate noise and less miss.
    """
    kept: list[tuple[float, float]] = []
    for noise, miss in sorted(map(tuple, curve(points, name).T)):
        if not kept or miss < kept[-1][1]:
            kept.append((noise, miss))
    return np.array(kept).T


def miss_at(front: Floats, noise: float) -> Degrees:
    """Return the miss on a frontier at a rate noise [deg/s] within its range, log-log between its points."""
    return math.exp(np.interp(math.log(noise), *np.log(front)))


def noise_at(front: Floats, miss: Degrees) -> float:
    """Return the rate noise [deg/s] on a frontier at a miss within its range, log-log between its points."""
    noises, misses = np.log(front)
    return math.exp(np.interp(math.log(miss), misses[::-1], noises[::-1]))


def rows(points: Mapping[Tuning, Floats]) -> list[Row]:
    """Return the rows of {tuning: (rate noise [deg/s], miss [deg]) of every run, an array (2, runs)}.

    The curves are read run by run, because all filters have the same noise in a run. A number that is not on the curve
    of every run has no row.
    """
    noise, miss = points[REFERENCE_POINT]
    table = [row('imm-predicted', 'miss_rms_deg', miss, 'deg'),
             row('imm-predicted', 'rate_noise_deg_s', noise, 'deg/s')]
    for name in FILTER_TUNINGS:
        fronts = [frontier({case: values[:, i] for case, values in points.items()}, name) for i in range(len(miss))]
        table += [row(name, 'least_miss_deg', np.array([front[1, -1] for front in fronts]), 'deg'),
                  row(name, 'rate_noise_at_least_miss_deg_s', np.array([front[0, -1] for front in fronts]), 'deg/s')]
        # A frontier begins at its least rate noise and ends at its least miss.
        if all(front[0, 0] <= own for front, own in zip(fronts, noise)):
            equal = np.array([miss_at(*run) for run in zip(fronts, noise)])
            table += [row(name, 'miss_at_equal_rate_noise_deg', equal, 'deg'),
                      row(name, 'miss_ratio_at_equal_rate_noise', equal / miss, '', None,
                          MISS_RATIO_TARGET if name == 'cv' else None)]
        if all(front[1, -1] <= own for front, own in zip(fronts, miss)):
            table.append(row(name, 'rate_noise_at_equal_miss_deg_s',
                             np.array([noise_at(*run) for run in zip(fronts, miss)]), 'deg/s'))
    return table


def remarks(points: Points) -> list[str]:
    """Return the sentences that explain the rows; points: means of the runs."""
    tuned = '; '.join(f'{name}: {what} {values[0]:g} to {values[-1]:g}'
                      for name, (what, values, _) in FILTER_TUNINGS.items())
    noise, miss = points[REFERENCE_POINT]
    loud = [name for name in FILTER_TUNINGS if frontier(points, name)[0, 0] > noise]
    never = [name for name in FILTER_TUNINGS if frontier(points, name)[1, -1] > miss]
    lines = [f'Every filter is predicted to the instant of its command. The tunings are {tuned}. The rows give the '
             'points of the curves at the rate noise and at the miss of imm-predicted (study imm-feedforward). A '
             'curve is straight between two tunings on logarithmic scales.']
    if loud:
        lines.append(f'No tuning of {", ".join(loud)} has as little rate noise as imm-predicted.')
    if never:
        lines.append(f'No tuning of {", ".join(never)} has as small a miss as imm-predicted, at any rate noise.')
    return lines


def miss_figure(points: Points) -> Figure:
    """Draw miss over rate noise, a curve for every filter."""
    figure, axes = fig.new_panels(1, height=4.8, x='noise of the rate fed forward, at constant rate [deg/s]',
                                  y='miss rms [deg]')
    panel = axes[0, 0]
    for name, colour in FILTER_COLOURS.items():
        panel.loglog(*curve(points, name), '.-', ms=5.0, color=colour, label=f'{name}, {FILTER_TUNINGS[name][0]}')
        values = FILTER_TUNINGS[name][1]
        for value in (values[0], values[len(values) // 2], values[-1]):
            panel.annotate(f'{value:g}', points[name, value], xytext=(3, 3), textcoords='offset points', color=colour,
                           fontsize=8)
    noise, miss = points[REFERENCE_POINT]
    panel.loglog(noise, miss, 'o', ms=7.0, color=fig.MOTOR_1_COLOUR, fillstyle='none', label='imm-predicted')
    panel.axvline(noise, color=fig.INK_COLOUR, linewidth=0.6, linestyle=':')
    panel.axhline(miss, color=fig.INK_COLOUR, linewidth=0.6, linestyle=':')
    return legend(figure)
