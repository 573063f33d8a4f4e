"""Feed-forward of Lin 2020 with differenced angles, and with targets of 30 and 50 m/s.

The paper (introduction and section 1) states that targets fly at 30 to 50 m/s, and that an IMM estimates rate and
acceleration better than differences and than a conventional Kalman filter. Its test stand shows 30 m/s only. The loop,
its noise and its filters are those of the study imm-feedforward, without another tuning. At 50 m/s the rates, and so
the accelerations of the reversals, are 5/3 of those at 30 m/s.

Cases are AXIS/SPEED/SOURCE. SOURCE is the source of the rate and acceleration that are fed forward:

kalman-cv, imm      as in the study imm-feedforward
difference-N        first and second difference of the measured angles over N steps of 10 ms, N and 2 N steps long
drive-...           filter of this name in the whole chain: receiver, control unit, motors, gears

rate_rms_deg_s, acceleration_rms_deg_s2   rms error at the instant of the measured miss, over the whole motion
..._ratio_to_imm                          this metric divided by that of imm in the run of equal noise
miss_ratio_to_kalman_cv                   miss of kalman-cv divided by this miss
autotrack_percent                         share of the runs that stay in autotrack; the cases drive-... have their
                                          other rows only if all runs stay
"""
from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure

from pedestal_common.quantities import Floats, Pairs, RadiansPerSecond, Records, Row
from pedestal_results import tracking
from pedestal_results.intervals import row
from pedestal_results.report.figures import FILTERED_COLOUR, MOTOR_1_COLOUR, RAW_COLOUR, TRUTH_COLOUR, new_panels
from pedestal_studies.p003_lin_wu_zhu import feedforward_loop, imm_feedforward
from pedestal_studies.p003_lin_wu_zhu.feedforward_loop import (
    METRIC_UNITS,
    MISS_DELAY_STEPS,
    REVERSAL_S_BY_AXIS,
    Source,
)
from pedestal_studies.profiles import S_MOTION_RATE_RAD_S
from pedestal_studies.result import Item, Result, legend
from pedestal_workbench.trials import monte_carlo
from pedestal_workbench.trials.monte_carlo import Pool, Progress

DEFAULT_RUNS, BATCH_RUNS = 50, 10  # runs of each case, with independent noise; runs that one worker makes at a time

RATES_RAD_S = {f'{speed}m_s': S_MOTION_RATE_RAD_S * speed / 30.0 for speed in (30, 50)}
"""{speed of the target at 500 m: its rate between the reversals [rad/s]}. The paper rounds 30 m/s to 3.5 deg/s."""

DRIVE_SPEED = '50m_s'  # speed of the cases drive-...; the study imm-feedforward has these cases at 30 m/s

DIFFERENCE_STEPS = (1, 15)
"""Distances of the differenced angles [steps of 10 ms]: one step, and the distance of the least rate error."""


def sources(axis: str) -> dict[str, Source]:
    """Return the sources of an axis."""
    return {'kalman-cv': feedforward_loop.cv(imm_feedforward.PAPER_CV_NOISES[axis]),
            'imm': imm_feedforward.FEEDFORWARD_SOURCES['imm'],
            **{f'difference-{n}': Source(filter=None, difference_steps=n) for n in DIFFERENCE_STEPS}}


CASES = {f'{axis}/{speed}/{name}': (axis, source, rate) for axis in REVERSAL_S_BY_AXIS
         for speed, rate in RATES_RAD_S.items() for name, source in sources(axis).items()}
"""{case: (axis, Source, rate of the target [rad/s])}."""

DRIVE_CASES = {f'{axis}/{DRIVE_SPEED}/drive-{name}': imm_feedforward.drive_case(
    axis, sources(axis)[name].own_filter, RATES_RAD_S[DRIVE_SPEED])
    for axis in REVERSAL_S_BY_AXIS for name in ('kalman-cv', 'imm')}
"""{case: DriveCase}."""

UNITS = {**METRIC_UNITS, 'rate_rms_deg_s': 'deg/s', 'acceleration_rms_deg_s2': 'deg/s2'}  # {metric of a run: unit}

COMPARED_METRICS = ('miss_rms_deg', 'rate_rms_deg_s', 'acceleration_rms_deg_s2')
"""Metrics that the rows ..._ratio_to_imm compare."""

IMM_RATIO_TARGET = '>= 3'  # required ratio: miss of kalman-cv divided by miss of imm [-]


def estimate_errors(axis: str, steps: Records, rate: RadiansPerSecond) -> Pairs:
    """Return the rms errors of rate [deg/s] and acceleration [deg/s2] of every run.

    The errors are against the truth at the instant of the measured miss. Arguments as of feedforward_loop.measures.
    """
    t, target, period = feedforward_loop.motion(axis, rate)
    counts = t[MISS_DELAY_STEPS:] >= 0.5 * period
    late = target[:-MISS_DELAY_STEPS]
    return np.degrees(np.column_stack([
        tracking.rms((steps[field][:, MISS_DELAY_STEPS:] - late[:, column])[:, counts], axis=1)
        for field, column in (('rate', 1), ('acceleration', 2))]))


def batch(item: Item) -> Floats:
    """Return the metrics of UNITS of every run (count, 6) of an item (case, first run, number of runs)."""
    case, first, count = item
    axis, source, rate = CASES[case]
    steps = feedforward_loop.steps_of(axis, source, first, count, rate)
    return np.hstack([feedforward_loop.measures(axis, steps, rate), estimate_errors(axis, steps, rate)])


def drive_batch(item: Item) -> Floats:
    """Return the rms miss [deg] of every run (count, 1) of an item.

    An item is (name of DRIVE_CASES, first run, number of runs).
    """
    name, first, count = item
    seeds = range(feedforward_loop.NOISE_SEED + first, feedforward_loop.NOISE_SEED + first + count)
    return np.array([imm_feedforward.drive_misses((DRIVE_CASES[name], seed))[:1] for seed in seeds])


def rows(values: Mapping[str, Floats], of_drive: Mapping[str, Floats]) -> list[Row]:
    """Return the rows of {case: metrics of every run (runs, 6)} and of {drive case: misses (runs, 1)}."""
    table = []
    for case, of_case in values.items():
        name = case.rpartition('/')[2]
        imm, cv = (dict(zip(UNITS, values[case.replace(name, other)].T)) for other in ('imm', 'kalman-cv'))
        measured = dict(zip(UNITS, of_case.T))
        table += [row(case, metric, measured[metric], unit) for metric, unit in UNITS.items()]
        if name == 'imm':
            table.append(row(case, 'miss_ratio_to_kalman_cv', cv['miss_rms_deg'] / measured['miss_rms_deg'], '',
                             target=IMM_RATIO_TARGET))
        else:
            table += [row(case, f'{metric.partition("_rms")[0]}_ratio_to_imm', measured[metric] / imm[metric])
                      for metric in COMPARED_METRICS]
    for case, of_case in of_drive.items():
        misses, kept = of_case[:, 0], np.isfinite(of_case[:, 0])
        conventional = of_drive[case.replace('drive-imm', 'drive-kalman-cv')][:, 0]
        table.append(row(case, 'autotrack_percent', 100.0 * kept, '%'))
        if kept.all():
            table.append(row(case, 'miss_rms_deg', misses, 'deg'))
        if case.endswith('imm') and np.isfinite(conventional).all():
            table.append(row(case, 'miss_ratio_to_kalman_cv', conventional / misses, '', target=IMM_RATIO_TARGET))
    return table


def run(progress: Progress, runs: int = DEFAULT_RUNS, pool: Pool | None = None) -> Result:
    """Run CASES and DRIVE_CASES `runs` times."""
    pool = pool or monte_carlo.Pool(1)
    values = pool.of_cases(batch, CASES, runs, BATCH_RUNS, lambda share, text: progress(0.2 * share, text))
    of_drive = pool.of_cases(drive_batch, DRIVE_CASES, runs, 1, lambda share, text: progress(
        0.2 + 0.8 * share, f'the whole chain, {text}'))
    table = rows(values, of_drive)
    return Result(table, {'rates': lambda: rate_figure('30m_s')}, remarks(table),
                  [r for r in table if r['metric'] not in ('miss_worst_second_deg', 'miss_peak_deg')])


def remarks(table: list[Row]) -> list[str]:
    """Return the sentences that explain the rows."""
    value = {(r['case'], r['metric']): r['value'] for r in table}
    return [
        'difference-1 has nearly the miss of imm, because the rate loop (8 Hz) and the integration to an angle smooth '
        'the noise of the command. The price is the command itself: its rate has '
        f'{value["azimuth/30m_s/difference-1", "rate_noise_deg_s"]:.1f} deg/s of noise while the target moves at a '
        f'constant rate, and that of imm has {value["azimuth/30m_s/imm", "rate_noise_deg_s"]:.2f} deg/s. The loop of '
        'this study has no limit of torque.',
        'difference-15 has the least rate error of all distances. Its values are half of this distance late.']


def rate_figure(speed: str) -> Figure:
    """Draw the rate that is fed forward in one reversal of one run in azimuth, a panel for each source."""
    axis, rate = 'azimuth', RATES_RAD_S[speed]
    t, target, period = feedforward_loop.motion(axis, rate)
    counts = t >= 0.5 * period
    since = t[counts] - 0.5 * period
    reversal = since[np.argmax(np.abs(target[counts, 2]))]
    colours = dict(zip(sources(axis), (TRUTH_COLOUR, FILTERED_COLOUR, RAW_COLOUR, MOTOR_1_COLOUR)))
    figure, axes = new_panels(len(colours), height=7.0, y='rate [deg/s]', sharex=True)
    for panel, (name, colour) in zip(axes[:, 0], colours.items()):
        steps = feedforward_loop.steps_of(axis, sources(axis)[name], 0, 1, rate)
        panel.plot(since, np.degrees(steps['rate'][0, counts]), color=colour, label=name, linewidth=0.9)
        panel.set_title(name)
    axes[0, 0].set_xlim(reversal - 1.5, reversal + 2.5)
    return legend(figure)
