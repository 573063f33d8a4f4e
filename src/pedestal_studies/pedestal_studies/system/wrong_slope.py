"""Wrong slopes of the receiver in autotrack: time of the alarm, false alarms, and the bound of all such tests.

A case is <target>/<slope>, or all/<slope> for all targets. At a random time of autotrack, copies of the run get errors
with a wrong factor, with turned axes, or with the wrong sign on one axis. In the case `right` the errors stay right.
The targets are those of the study target-filters, all other scenarios that track a moving target, and a satellite that
the operator did not declare (`keeps_program`).

in_time_percent           share of the runs with the alarm `diverged` within 200 steps from the onset
alarm_steps_median        steps from the onset to the alarm, if more than half of the runs have it
known_in_time_percent, known_steps_median   the same of a test that knows the target
alarm_percent             share of the runs with the alarm within 2 s
lost_percent              share of the runs whose autotrack ends within 2 s without the alarm
largest_error_beamwidths  largest pointing error in these 2 s, until autotrack ends
false_alarms_per_10_h     of `right`: rate of the alarms, with the interval of Garwood (Biometrika 28 (1936) 437)

The test that knows the target sums the log-likelihood ratio of the wrong and the right slope from the onset on, with
the true direction of the target. A limit of ln(n) gives at least n steps to a false alarm on average (Lorden, Annals
of Mathematical Statistics 42 (1971) 1897). No other test with so few false alarms is faster for long. While the beam
is nearer to the target than the noise of the receiver, errors of any slope look alike.

The alarm has two limits: one for the largest score of `acu_tracker.estimation.monitors`, and one for the sum of
`acu_tracker.estimation.slope_ratio` of a target that keeps to its program. The cases limits/<factor> have all gross
slopes of all targets, with both limits times the factor; the figure has them for each slope.
"""
import cmath
import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure
from scipy.stats import chi2

from acu_tracker.estimation import monitors, slope_ratio
from acu_tracker.estimation.filters.measurement import error_variance
from acu_tracker.modes import Mode
from pedestal_bringup.loop.closed_loop import Loop, Run
from pedestal_bringup.scenario.variant import Variant
from pedestal_common.quantities import Bools, Complexes, Estimate, Floats, Row
from pedestal_common.wire.commands import Command
from pedestal_results.intervals import CONFIDENCE_LEVEL, estimated, row
from pedestal_results.report import figures as fig
from pedestal_studies.result import FIRST_SEED, Result, legend, of_cases, seeds
from pedestal_studies.system import target_filters
from pedestal_workbench.trials.monte_carlo import Pool, Progress
from pedestal_workbench.trials.statistics import percentile, rate

DEFAULT_RUNS = 200  # runs of each case

SCENARIOS = ('leo_station_7m', 'phased_array_sway', 'ship_overhead', 'ship_terminal_1m2', 'ship_uav', 'station_real',
             'uav_tracker_3m')
UNDECLARED_SUFFIX = '-undeclared'  # part of the name of a satellite without `keeps_program`
TARGETS = (*target_filters.TARGET_SCENARIOS, *SCENARIOS, f'leo{UNDECLARED_SUFFIX}', f'leo-ship{UNDECLARED_SUFFIX}')


class Slope(NamedTuple):
    """A wrong slope of the receiver."""
    factor: complex     # factor of the errors, cross-elevation as real and elevation as imaginary part
    arguments: dict[str, str]   # of the injected fault wrong_slope
    axis: int = -1      # axis with this factor; -1: both


def _of_both(factor: float, turn_deg: float) -> Slope:
    turn = math.radians(turn_deg)
    return Slope(factor * cmath.exp(1j * turn), {'factor': f'{factor:g}', 'turn': f'{turn:.6g}'})


def _name(factor: float, turn_deg: float) -> str:
    return '-'.join([f'factor-{factor:g}'] * (factor != 1.0) + [f'turn-{turn_deg:g}'] * (turn_deg != 0.0))


SLOPES = {**{_name(factor, turn): _of_both(factor, turn) for factor, turn in (
              (0.3, 0.0), (3.0, 0.0), (1.0, 45.0), (1.0, 90.0), (1.0, 135.0), (1.0, 180.0), (0.3, 180.0),
              (3.0, 180.0))},
          'sign-cross-elevation': Slope(-1.0, {'axis': 'cross_elevation'}, 0),
          'sign-elevation': Slope(-1.0, {'axis': 'elevation'}, 1)}
GROSS_SLOPES = tuple(name for name, slope in SLOPES.items() if slope.factor.real < 1e-9)
"""Slopes that drive the beam away from the target."""
RIGHT_CASE = 'right'  # name of the case without a wrong slope

EARLIEST_ONSET_S, LATEST_ONSET_S, RUN_AFTER_ONSET_S = 6.0, 20.0, 2.0
LONG_RUN_S, LONG_RUN_SPACING = 60.0, 8  # duration of every eighth run of the case `right`; others end at the onset
DURATIONS_S = {'phased_array_sway': 20.0}  # of scenarios that are shorter
MAX_ALARM_STEPS = 200  # latest alarm, in steps after the onset
FALSE_ALARM_FREE_STEPS = 10 * 3600 * 200  # 10 h
LIMIT_FACTORS = (0.25, 0.5, 0.75, 1.0)  # of both limits; the last one is that of the alarm
LOOK_STEPS = monitors.BLOCK_ERROR_COUNT  # steps between two looks at a run
COLUMN_COUNT = len(LIMIT_FACTORS) + 3  # numbers of a run of one case


def variant(target: str, seed: int) -> Variant:
    """Return the variant of a run, at most of LONG_RUN_S."""
    name = target.removesuffix(UNDECLARED_SUFFIX)
    if name in SCENARIOS:
        return Variant(name, seed=seed, duration=DURATIONS_S.get(name, LONG_RUN_S))
    chosen = target_filters.placed(f'{name}/default', seed).with_(duration=LONG_RUN_S)
    return chosen if name == target else chosen.with_({'acu.tracker.keeps_program': False})


def reached(loop: Loop) -> tuple[float, float]:
    """Return the score and the sum of a loop, each divided by its limit; 0 before the first verdict."""
    tracking = loop.units['acu'].parts['state']['tracking']
    score, sums = float(tracking['wrong_slope']['score']), tracking['slope_ratio']
    summed = sums['n'] >= slope_ratio.MIN_BLOCK_COUNT
    largest = (sums['S'] - slope_ratio.MISFIT_WEIGHT * np.maximum(sums['X'], 0.0)).max() if summed else 0.0
    return score, float(largest) / slope_ratio.MAX_S


def _alarmed(loop: Loop) -> bool:
    return bool(loop.units['acu'].parts['state']['tracking']['divergence']['diverged'])


def _tracks(loop: Loop) -> bool:
    return bool(loop.units['acu'].parts['state']['mode']['now'] == Mode.AUTOTRACK)


def known_steps(true: Complexes, variance: Floats, factor: complex) -> float:
    """Return the number of errors until a test that knows the target gives its alarm; NaN without one.

    true: error of the beam at each measured error, cross-elevation as real and elevation as imaginary part [rad];
    variance: variance of the noise of each error [rad2]; factor: that of the measured errors.
    """
    evidence = np.nancumsum(0.5 * np.abs((1.0 - factor) * true)**2 / variance)
    after = int(np.searchsorted(evidence, math.log(FALSE_ALARM_FREE_STEPS)))
    return after + 1.0 if after < len(evidence) else math.nan


def _known_steps(run: Run, slope: Slope) -> float:
    """Return known_steps of a run from the onset on."""
    receiver = run.units['acu'].parts['constants']['p']['tracker']['receiver']
    variance = np.array([error_variance(x, e, cn0_dbhz, receiver)
                         for x, e, cn0_dbhz in run['tracking_receiver/angle_error']['vector']])
    true = run.truth['error']
    return known_steps(true @ (1.0, 1.0j) if slope.axis < 0 else true[:, slope.axis].astype(complex), variance,
                       slope.factor)


def _largest_error(run: Run) -> float:
    """Return the largest pointing error of a run [beamwidths], NaN without an error."""
    off = np.hypot(*run.truth['error'].T) / run.units['acu'].parameters.tracker.receiver.beamwidth
    return float(np.nanmax(off, initial=-math.inf))


def _quiet(loop: Loop, last: int) -> Floats:
    """Track with the right slope up to step number `last` or an alarm. Return 1 for the alarm or 0, hours of
    autotrack, and the largest of both numbers of `reached`."""
    most = np.zeros(2)

    def watch(made: int) -> int:
        np.maximum(most, reached(loop), out=most)
        return 0 if _alarmed(loop) else LOOK_STEPS
    on = loop.run(watch=watch, last=last)['acu/mode'] == Mode.AUTOTRACK
    return np.array([_alarmed(loop), on.sum() * loop.period_ns / 3.6e12, *most])


def _after_onset(loop: Loop, name: str) -> Floats:
    """Give the receiver of a loop a wrong slope. Return steps from the onset until each of LIMIT_FACTORS is reached,
    known_steps, the largest error, and 1 if autotrack ends without the alarm, else 0."""
    loop.units['tracking_receiver'].command(Command('wrong_slope', arguments=SLOPES[name].arguments))
    onset, steps = loop.made, np.full(len(LIMIT_FACTORS), np.nan)

    def watch(made: int) -> int:
        share = math.inf if _alarmed(loop) else min(max(reached(loop)), LIMIT_FACTORS[-1])
        steps[np.isnan(steps) & (share > np.array(LIMIT_FACTORS))] = made - onset
        return LOOK_STEPS if _tracks(loop) and not _alarmed(loop) else 0
    run = loop.run(watch=watch, last=onset + round(RUN_AFTER_ONSET_S * 1e9 / loop.period_ns))
    watch(loop.made)
    lost = not (_tracks(loop) or _alarmed(loop))
    return np.array([*steps, _known_steps(run, SLOPES[name]), _largest_error(run), lost])


def measured(target: str, number: int) -> Floats:
    """Return the numbers of a run (cases, COLUMN_COUNT): of the right slope as `_quiet` returns them, then of each of
    SLOPES as `_after_onset` does. They are NaN if the antenna does not track at the onset."""
    seed = FIRST_SEED + number
    loop = Loop(variant(target, seed).load())
    latest = min(LATEST_ONSET_S, loop.steps * loop.period_ns * 1e-9 - RUN_AFTER_ONSET_S)
    onset = math.ceil(np.random.default_rng(seed).uniform(EARLIEST_ONSET_S, latest) * 1e9 / loop.period_ns)
    table = np.full((1 + len(SLOPES), COLUMN_COUNT), np.nan)
    quiet = _quiet(loop, onset)
    if _tracks(loop) and not _alarmed(loop):
        for line, name in zip(table[1:], SLOPES):
            line[:] = _after_onset(loop.copy(), name)
        if number % LONG_RUN_SPACING == 0:
            later = _quiet(loop, loop.steps)
            quiet = np.array([later[0], quiet[1] + later[1], *np.maximum(quiet[2:], later[2:])])
    table[0, :len(quiet)] = quiet
    return table


def rows(values: Mapping[str, Floats]) -> list[Row]:
    """Return the rows of the study; values: {target: as `measured` returns, of every run}."""
    of_all = {'all': np.concatenate(list(values.values())), **values}
    table = _limit_rows(of_all['all'])
    for target, of_runs in of_all.items():
        table += _right_rows(f'{target}/{RIGHT_CASE}', of_runs[:, 0])
        for k, slope in enumerate(SLOPES, 1):
            table += _slope_rows(f'{target}/{slope}', slope in GROSS_SLOPES, of_runs[:, k])
    return table


def alarm_rate(count: int, hours: float) -> Estimate:
    """Return the alarms per 10 h of `count` alarms in some hours, with the exact interval of a Poisson process."""
    tail = 0.5 * (1.0 - CONFIDENCE_LEVEL)
    low = 0.5 * float(chi2.ppf(tail, 2 * count)) if count else 0.0
    return 10.0 * count / hours, 10.0 * low / hours, 5.0 * float(chi2.isf(tail, 2 * count + 2)) / hours


def _false_alarms(of_right: Floats) -> list[Estimate]:
    """Return the false alarms per 10 h with the limits times each of LIMIT_FACTORS."""
    alarms, hours, *most = of_right[:, :4].T
    share = np.where(alarms > 0.0, math.inf, np.minimum(np.max(most, axis=0), LIMIT_FACTORS[-1]))
    return [alarm_rate(int((share > factor).sum()), float(hours.sum())) for factor in LIMIT_FACTORS]


def _limit_rows(of_all: Floats) -> list[Row]:
    """Return the rows of LIMIT_FACTORS, over all targets and gross slopes."""
    gross = of_all[:, [k for k, name in enumerate(SLOPES, 1) if name in GROSS_SLOPES]].reshape(-1, COLUMN_COUNT)
    steps = gross[np.isfinite(gross[:, -1]), :len(LIMIT_FACTORS)]
    return [line for factor, false, taken in zip(LIMIT_FACTORS, _false_alarms(of_all[:, 0]), steps.T) for line in (
        estimated(f'limits/{factor:g}', 'false_alarms_per_10_h', false, '', len(of_all)),
        _share(f'limits/{factor:g}', 'in_time_percent', taken <= MAX_ALARM_STEPS))]


def _right_rows(case: str, of_runs: Floats) -> list[Row]:
    alarms, hours, score, total = of_runs[:, :4].T
    runs = len(of_runs)
    return [row(case, 'false_alarms', int(alarms.sum()), target='<= 0'), row(case, 'hours', hours.sum(), 'h'),
            estimated(case, 'false_alarms_per_10_h', alarm_rate(int(alarms.sum()), hours.sum()), '', runs),
            row(case, 'largest_score', score.max(), target='<= 1'),
            row(case, 'largest_sum', total.max() * slope_ratio.MAX_S, target=f'<= {slope_ratio.MAX_S:g}')]


def _share(case: str, metric: str, met: Floats | Bools) -> Row:
    return estimated(case, metric, rate(int(met.sum()), len(met)), '%', len(met))


def _median(case: str, metric: str, steps: Floats) -> list[Row]:
    """Return the Row of the median of steps, which are NaN for never; no Row if half of them are."""
    if 2 * np.isfinite(steps).sum() <= len(steps) + 1:
        return []
    ordered = np.where(np.isfinite(steps), steps, math.inf)
    return [estimated(case, metric, percentile(ordered, 50.0), 'steps', len(steps))]


def _slope_rows(case: str, gross: bool, of_runs: Floats) -> list[Row]:
    of_runs = of_runs[np.isfinite(of_runs[:, -1])]
    if not len(of_runs):
        return []
    steps, (known, error, lost) = of_runs[:, len(LIMIT_FACTORS) - 1], of_runs[:, -3:].T
    known = np.fmin(known, steps)
    table = [_share(case, 'alarm_percent', np.isfinite(steps)), _share(case, 'lost_percent', lost),
             row(case, 'largest_error_beamwidths', error, 'beamwidths')]
    if gross:
        table += [_share(case, 'in_time_percent', steps <= MAX_ALARM_STEPS),
                  _share(case, 'known_in_time_percent', known <= MAX_ALARM_STEPS),
                  *_median(case, 'alarm_steps_median', steps), *_median(case, 'known_steps_median', known)]
    return table


def run(progress: Progress, runs: int = DEFAULT_RUNS, pool: Pool | None = None) -> Result:
    """Run every case `runs` times."""
    values = of_cases(measured, TARGETS, runs, pool, progress)
    table = rows(values)
    return Result(table, {'limits': lambda: figure(values)}, [seeds(runs)],
                  [line for line in table if line['case'].startswith(('all/', 'limits/'))])


def figure(values: Mapping[str, Floats]) -> Figure:
    """Draw the alarms in time over the false alarms, for each of LIMIT_FACTORS and each gross slope."""
    drawn, axes = fig.new_panels(1, height=4.2, x='false alarms in 10 h of a right slope', y='alarms in time [%]')
    of_all = np.concatenate(list(values.values()))
    false = [value for value, *_ in _false_alarms(of_all[:, 0])]
    axes[0, 0].set_xscale('symlog')
    for k, slope in enumerate(SLOPES, 1):
        if slope in GROSS_SLOPES:
            steps = of_all[np.isfinite(of_all[:, k, -1]), k, :len(LIMIT_FACTORS)]
            axes[0, 0].plot(false, 100.0 * (steps <= MAX_ALARM_STEPS).mean(axis=0), 'o-', label=slope)
    return legend(drawn)
