"""Wrong slopes of the receiver in autotrack: time of the alarm, false alarms, and the bound of all such tests.

A case is <target>/<slope>. At a random time of autotrack the errors of the receiver get a wrong factor, get turned
axes, or get the wrong sign on one axis. In the case `right` they stay right. The targets are those of the study
target-filters, and all other scenarios that track a moving target.

alarm_steps               steps from the onset to the alarm `diverged`, over the runs with the alarm
in_time_percent           share of the runs with the alarm within 200 steps
known_in_time_percent     share of the runs in which a test that knows the target could give the alarm in this time
largest_error_beamwidths  largest pointing error until the alarm, or until the end of the run

The last test sums the log-likelihood ratio of the wrong and the right slope from the onset on, with the true direction
of the target. A limit of ln(n) gives at least n steps to a false alarm on average (Lorden, Annals of Mathematical
Statistics 42 (1971) 1897). No other test with so few false alarms is faster for long. While the beam is nearer to the
target than the noise of the receiver, errors of any slope look alike.

The score of a step is J - WRONG_SLOPE_RATIO (J' - EXPLAINED_ROUGHNESS k) of `acu_tracker.estimation.monitors`. The
alarm has a limit for the score; the figure shows what lower limits would do. For a target that keeps to its program,
the sum of `acu_tracker.estimation.slope_ratio` has a limit too; largest_sum is its largest value in the case `right`.
"""
import cmath
import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure

from acu_tracker.estimation import monitors, slope_ratio
from acu_tracker.estimation.filters.measurement import error_variance
from acu_tracker.modes import Mode
from pedestal_bringup.loop import closed_loop
from pedestal_bringup.loop.closed_loop import Run
from pedestal_bringup.scenario.variant import Variant
from pedestal_common.quantities import AnyRecord, Complexes, Floats, Pairs, Row, Seconds
from pedestal_results.intervals import row
from pedestal_results.report import figures as fig
from pedestal_studies.result import FIRST_SEED, Result, legend, of_cases, seeds
from pedestal_studies.system import target_filters
from pedestal_workbench.trials.monte_carlo import Pool, Progress

DEFAULT_RUNS = 20  # runs of each case

SCENARIOS = ('leo_station_7m', 'phased_array_sway', 'ship_overhead', 'ship_terminal_1m2', 'ship_uav', 'station_real',
             'uav_tracker_3m')
TARGETS = (*target_filters.TARGET_SCENARIOS, *SCENARIOS)


class Slope(NamedTuple):
    """A slope of the receiver."""
    inject: str         # text of the injected fault; '' without a fault
    factor: complex     # factor of the errors, cross-elevation as real and elevation as imaginary part
    axis: int = -1      # axis with this factor; -1: both


def _of_both(factor: float, turn_deg: float) -> Slope:
    turn = math.radians(turn_deg)
    return Slope(f'wrong_slope factor={factor:g} turn={turn:.6g}', factor * cmath.exp(1j * turn))


SLOPES = {'right': Slope('', 1.0), **{f'factor-{f:g}': _of_both(f, 0.0) for f in (0.3, 0.5, 2.0, 3.0)},
          **{f'turn-{turn}': _of_both(1.0, turn) for turn in (45, 90, 120, 150)},
          'phase-180': Slope('phase_180', -1.0),
          'sign-cross-elevation': Slope('wrong_slope axis=cross_elevation', -1.0, 0),
          'sign-elevation': Slope('wrong_slope axis=elevation', -1.0, 1)}
GROSS_SLOPES = tuple(name for name, slope in SLOPES.items() if slope.factor.real < 1e-9)
"""Slopes that drive the beam away from the target. The loop holds its target with all others."""

EARLIEST_ONSET_S, LATEST_ONSET_S, RUN_AFTER_ONSET_S = 6.0, 16.0, 4.0
RIGHT_DURATION_S = 60.0  # of a run without a fault
MAX_ALARM_STEPS = 200  # latest alarm, in steps after the onset
FALSE_ALARM_FREE_STEPS = 10 * 3600 * 200  # 10 h
MARGINS = (0.0, 0.5, 1.0, 1.5, monitors.WRONG_SLOPE_MARGIN)  # limits of the score; the last one is that of the alarm
COARSE_STEPS, FINE_STEPS = 20, monitors.BLOCK_ERROR_COUNT  # steps between two scores before and after the onset


def variant(target: str, slope: str, seed: int, onset: Seconds) -> Variant:
    """Return the variant of a run."""
    chosen = (Variant(target, seed=seed) if target in SCENARIOS
              else target_filters.placed(f'{target}/default', seed))
    most = chosen.load().header.duration
    if not SLOPES[slope].inject:
        return chosen.with_(duration=min(RIGHT_DURATION_S, most))
    return chosen.with_({'tracking_receiver.inject': f'{onset:g} {SLOPES[slope].inject}'},
                        duration=onset + RUN_AFTER_ONSET_S)


def score(state: AnyRecord) -> float:
    """Return the score of a WrongSlope, 0 before its first verdict."""
    if state['n'] < monitors.MIN_BLOCK_COUNT:
        return 0.0
    return max(monitors.score(state, hypothesis, monitors.WRONG_SLOPE_RATIO) for hypothesis in range(3))


def ratio(state: AnyRecord) -> float:
    """Return the largest sum of a SlopeRatio less its deductions, 0 without a program."""
    if state['n'] < slope_ratio.MIN_BLOCK_COUNT:
        return 0.0
    return float((state['S'] - slope_ratio.MISFIT_WEIGHT * np.maximum(state['X'], 0.0)).max())


def known_steps(true: Complexes, variance: Floats, factor: complex) -> float:
    """Return the number of errors until a test that knows the target gives its alarm; NaN without one.

    true: error of the beam at each measured error, cross-elevation as real and elevation as imaginary part [rad];
    variance: variance of the noise of each error [rad2]; factor: that of the measured errors.
    """
    evidence = np.nancumsum(0.5 * np.abs((1.0 - factor) * true)**2 / variance)
    after = int(np.searchsorted(evidence, math.log(FALSE_ALARM_FREE_STEPS)))
    return after + 1.0 if after < len(evidence) else math.nan


def _known_steps(run: Run, slope: Slope, first: int) -> float:
    """Return known_steps from step `first` of a run on."""
    receiver = run.units['acu'].parts['constants']['p']['tracker']['receiver']
    variance = np.array([error_variance(x, e, cn0_dbhz, receiver)
                         for x, e, cn0_dbhz in run['tracking_receiver/angle_error']['vector'][first:]])
    true = run.truth['error'][first:]
    return known_steps(true @ (1.0, 1.0j) if slope.axis < 0 else true[:, slope.axis].astype(complex), variance,
                       slope.factor)


def measured(name: str, number: int) -> Floats:
    """Return of one run: steps from the onset until the score is above each of MARGINS, hours of autotrack,
    known_steps, largest error [beamwidths], largest score and largest sum of slope_ratio without a fault."""
    target, _, slope = name.partition('/')
    seed = FIRST_SEED + number
    onset = round(float(np.random.default_rng(seed).uniform(EARLIEST_ONSET_S, LATEST_ONSET_S)), 2)
    loop = closed_loop.Loop(variant(target, slope, seed, onset).load())
    first = math.ceil(onset * 1e9 / loop.period_ns) if SLOPES[slope].inject else loop.steps
    acu = loop.units['acu']
    state = acu.parts['state']['tracking']
    steps, quiet = np.full(len(MARGINS), np.nan), [(0.0, 0.0)]

    def watch(made: int) -> int:
        now = score(state['wrong_slope'])
        if made <= first:
            quiet.append((now, ratio(state['slope_ratio'])))
            return min(COARSE_STEPS, first - made) or FINE_STEPS
        if state['divergence']['diverged']:
            now = math.inf
        steps[np.isnan(steps) & (now > np.array(MARGINS))] = made - first
        return FINE_STEPS
    run = loop.run(watch=watch)
    if state['divergence']['diverged'] and first == loop.steps:
        steps[:] = 0.0
    begun = int(np.argmax(run['acu/mode'] == Mode.AUTOTRACK)) + MAX_ALARM_STEPS
    judged = slice(begun, None) if first == loop.steps else slice(first, None if np.isnan(steps[-1])
                                                                  else first + int(steps[-1]))
    off = np.hypot(*run.truth['error'][judged].T) / acu.parameters.tracker.receiver.beamwidth
    known = _known_steps(run, SLOPES[slope], first) if first < loop.steps else math.nan
    hours = (run['acu/mode'] == Mode.AUTOTRACK).sum() * loop.period_ns / 3.6e12
    return np.array([*steps, hours, known, np.nanmax(off), *np.max(quiet, axis=0)])


def rows(values: Mapping[str, Pairs]) -> list[Row]:
    """Return the rows of the study; values: {case: as `measured` returns, of every run}."""
    table = []
    for slope in SLOPES:
        of_slope = {name: of_runs for name, of_runs in values.items() if name.endswith(f'/{slope}')}
        if of_slope:
            table += _rows(f'all/{slope}', np.concatenate(list(of_slope.values())))
        if slope == 'phase-180':
            for name, of_runs in of_slope.items():
                table += _rows(name, of_runs)
    return table


def _rows(case: str, of_runs: Pairs) -> list[Row]:
    steps, known, error = of_runs[:, len(MARGINS) - 1], of_runs[:, -4], of_runs[:, -3]
    told, slope = np.isfinite(steps), case.partition('/')[2]
    gross = slope in GROSS_SLOPES
    table = [row(case, 'alarm_percent', 100.0 * told, '%', target=None if gross else '<= 0'),
             row(case, 'largest_error_beamwidths', error, 'beamwidths', target='<= 0.5')]
    if gross:
        table += [row(case, 'in_time_percent', 100.0 * (steps <= MAX_ALARM_STEPS), '%'),
                  row(case, 'known_in_time_percent', 100.0 * (np.fmin(known, steps) <= MAX_ALARM_STEPS), '%')]
        if told.any():
            table.append(row(case, 'alarm_steps', steps[told], 'steps'))
    if slope == 'right':
        table += [row(case, 'hours', float(of_runs[:, -5].sum()), 'h'),
                  row(case, 'largest_score', float(of_runs[:, -2].max()),
                      target=f'<= {monitors.WRONG_SLOPE_MARGIN:g}'),
                  row(case, 'largest_sum', float(of_runs[:, -1].max()), target=f'<= {slope_ratio.MAX_S:g}')]
    return table


def run(progress: Progress, runs: int = DEFAULT_RUNS, pool: Pool | None = None) -> Result:
    """Run every case `runs` times."""
    values = of_cases(measured, [f'{target}/{slope}' for target in TARGETS for slope in SLOPES], runs, pool, progress)
    return Result(rows(values), {'margins': lambda: figure(values)}, [seeds(runs)])


def figure(values: Mapping[str, Pairs]) -> Figure:
    """Draw the alarms in time and the runs with a false alarm over the limit of the score."""
    drawn, axes = fig.new_panels(1, height=3.8, x='limit of the score', y='share of the runs [%]')
    for slope in GROSS_SLOPES:
        steps = np.concatenate([of_runs[:, :len(MARGINS)] for name, of_runs in values.items()
                                if name.endswith(f'/{slope}')])
        axes[0, 0].plot(MARGINS, 100.0 * (steps <= MAX_ALARM_STEPS).mean(axis=0), 'o-', label=f'in time: {slope}')
    quiet = np.concatenate([of_runs[:, -2] for name, of_runs in values.items() if name.endswith('/right')])
    axes[0, 0].plot(MARGINS, [100.0 * (quiet > margin).mean() for margin in MARGINS], 'k--', label='false alarm')
    return legend(drawn)
