"""Feed-forward of Lin 2020 with differenced angles, and with targets of 30 and 50 m/s.

The paper (introduction and section 1) states that targets fly at 30 to 50 m/s, and that an IMM estimates rate and
acceleration better than differences and than a conventional Kalman filter. Its test stand shows 30 m/s only. Loop,
noise, filters and names of the sources are those of the study imm-feedforward. At 50 m/s the rates, and so the
accelerations of the reversals, are 5/3 of those at 30 m/s.

Cases are AXIS/SPEED/SOURCE. The source difference-N is the first and second difference of the measured angles over N
steps of 10 ms. The errors rate_rms_deg_s and acceleration_rms_deg_s2 are those at the instant of the measured miss. A
ratio divides by the metric in the run of equal noise. The cases drive-... have rows other than autotrack_percent only
if all runs stay in autotrack.
"""
import math
from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure

from pedestal_common.quantities import Degrees, Floats, Pairs, RadiansPerSecond, Records, Row
from pedestal_results import tracking
from pedestal_results.intervals import row
from pedestal_results.report import figures as fig
from pedestal_studies.p003_lin_wu_zhu import feedforward_loop, imm_feedforward
from pedestal_studies.p003_lin_wu_zhu.feedforward_loop import (
    METRIC_UNITS,
    MISS_DELAY_STEPS,
    REVERSAL_S_BY_AXIS,
    Source,
)
from pedestal_studies.profiles import S_MOTION_RATE_RAD_S
from pedestal_studies.result import FIRST_SEED, Item, Result, legend, of_cases
from pedestal_workbench.trials import monte_carlo
from pedestal_workbench.trials.monte_carlo import Pool, Progress

DEFAULT_RUNS, BATCH_RUNS = 50, 10  # runs of each case, with independent noise; runs that one worker makes at a time

RATES_RAD_S = {f'{speed}m_s': S_MOTION_RATE_RAD_S * speed / 30.0 for speed in (30, 50)}
"""{speed of the target at 500 m: its rate between the reversals [rad/s]}. The paper rounds 30 m/s to 3.5 deg/s."""

DRIVE_SPEED = '50m_s'  # speed of the cases drive-...; the study imm-feedforward has these cases at 30 m/s

DIFFERENCE_STEPS = (1, 15)  # steps of 10 ms: one step, and the distance of the least rate error


def sources(axis: str) -> dict[str, Source]:
    """Return the sources of an axis."""
    return {'kalman-cv': feedforward_loop.cv(imm_feedforward.PAPER_CV_NOISES[axis]),
            'imm': imm_feedforward.FEEDFORWARD_SOURCES['imm'],
            **{f'difference-{n}': Source(filter=None, difference_steps=n) for n in DIFFERENCE_STEPS}}


CASES = {f'{axis}/{speed}/{name}': (axis, source, rate) for axis in REVERSAL_S_BY_AXIS
         for speed, rate in RATES_RAD_S.items() for name, source in sources(axis).items()}
"""{case: (axis, Source, rate of the target [rad/s])}."""

DRIVE_CASES = {f'{axis}/{DRIVE_SPEED}/drive-{name}': imm_feedforward.drive_case(  # {case: DriveCase}
    axis, sources(axis)[name].own_filter, RATES_RAD_S[DRIVE_SPEED])
    for axis in REVERSAL_S_BY_AXIS for name in ('kalman-cv', 'imm')}

UNITS = {**METRIC_UNITS, 'rate_rms_deg_s': 'deg/s', 'acceleration_rms_deg_s2': 'deg/s2'}  # {metric of a run: unit}

COMPARED_METRICS = ('miss_rms_deg', 'rate_rms_deg_s', 'acceleration_rms_deg_s2')

IMM_RATIO_TARGET = '>= 3'  # required ratio: miss of kalman-cv divided by miss of imm [-]


def estimate_errors(axis: str, steps: Records, rate: RadiansPerSecond) -> Pairs:
    """Return the rms errors of rate [deg/s] and acceleration [deg/s2] at the instant of the measured miss."""
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


def drive_miss(name: str, run: int) -> Degrees:
    """Return the rms miss of one run of one of DRIVE_CASES."""
    _, error = imm_feedforward.drive_error(DRIVE_CASES[name], FIRST_SEED + run)
    return math.degrees(tracking.rms(error))


def rows(values: Mapping[str, Floats], of_drive: Mapping[str, Floats]) -> list[Row]:
    """Return the rows of {case: metrics of every run (runs, 6)} and of {drive case: misses (runs,)}."""
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
    for case, misses in of_drive.items():
        kept, conventional = np.isfinite(misses), of_drive[case.replace('drive-imm', 'drive-kalman-cv')]
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
    of_drive = of_cases(drive_miss, DRIVE_CASES, runs, pool, lambda share, text: progress(
        0.2 + 0.8 * share, f'the whole chain, {text}'), size=1)
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
    colours = dict(zip(sources(axis), (fig.TRUTH_COLOUR, fig.FILTERED_COLOUR, fig.RAW_COLOUR, fig.MOTOR_1_COLOUR)))
    figure, axes = fig.new_panels(len(colours), height=7.0, y='rate [deg/s]', sharex=True)
    for panel, (name, colour) in zip(axes[:, 0], colours.items()):
        steps = feedforward_loop.steps_of(axis, sources(axis)[name], 0, 1, rate)
        panel.plot(since, np.degrees(steps['rate'][0, counts]), color=colour, label=name, linewidth=0.9)
        panel.set_title(name)
    axes[0, 0].set_xlim(reversal - 1.5, reversal + 2.5)
    return legend(figure)
