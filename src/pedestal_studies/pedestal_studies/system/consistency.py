"""Consistency of the default target filter, second by second after its start.

NEES is the squared error of angle and rate over the covariance that the filter states
(`pedestal_results.consistency`). A consistent filter has 2. A larger value means that the filter is too sure. Cases
are scenarios with the default filter, and targets that accelerate hard. A metric nees_AXIS_T_s is the mean of one
second about T [s] after the first estimate of the filter.

A second counts if in it, and in the second before, errors came without a gap while the target was in the main lobe. A
result has a target only if its interval shows on which side of the target it is.
"""
import functools
from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure

from acu_tracker.estimation.params import FilterParameters
from pedestal_bringup.loop import memory_recording
from pedestal_bringup.scenario.variant import Variant
from pedestal_common.graph.topics import AXES
from pedestal_common.quantities import Bools, Floats, Pairs, Row
from pedestal_results import consistency, tracking
from pedestal_results.consistency import Consistency
from pedestal_results.intervals import interval, row
from pedestal_results.report import figures as fig
from pedestal_results.tracking import Tracking
from pedestal_studies.result import FIRST_SEED, Result, legend, of_cases, seeds
from pedestal_studies.system import target_filters
from pedestal_workbench.trials.monte_carlo import Pool, Progress

DEFAULT_RUNS = 40  # runs of each case
TIMES_S = (2.0, 5.0, 10.0, 30.0, 60.0, 120.0)  # times after the first estimate [s]
DURATION_S = 125.0
WINDOW_S = 1.0  # span of a mean [s]
SETTLING_S = 1.0  # time before it in which errors must have come [s]
MAX_GAP_S = 0.1  # longest time without an error [s]

SCENARIOS = ('blockage', 'fade', 'late_tle', 'leo_pass', 'leo_station_7m', 'manoeuvre_in_coast', 'phased_array_sway',
             'ship_overhead', 'ship_pass', 'ship_pass_ss6', 'ship_terminal_1m2', 'sidelobe', 'station_real',
             'uav_flyby', 'uav_tracker_3m')
HARD_TARGETS = ('helicopter', 'jet', 'square', 's-motion')  # targets of the study target-filters
DEFAULT_KIND = {f'acu.{axis}.filter.kind': FilterParameters.kind for axis in AXES}  # two scenarios have other filters
CASES = {**{name: Variant(name, duration=DURATION_S).with_(DEFAULT_KIND) for name in SCENARIOS},
         **{name: target_filters.CASES[f'{name}/default'] for name in HARD_TARGETS}}
MAX_NEES = 2.4  # largest NEES of a filter that is not too sure: 2 plus 20 %


def gaps(found: Consistency, tracked: Tracking) -> Floats:
    """Return the time [s] at each step since the last error that came while the target was in the main lobe."""
    came = np.isfinite(found.innovation[:, 0]) & (tracked.distance <= 0.5 * tracked.beamwidth)
    return found.t - np.maximum.accumulate(np.where(came, found.t, -np.inf))


def of_second(time: float, after: Floats, values: Pairs, counted: Bools) -> Floats:
    """Return the mean (2,) of the values in the second about `time`; NaN if a step in it, or before it, is not
    counted. after: times of the steps."""
    since = after - (time - 0.5 * WINDOW_S)
    second, before = (since >= 0.0) & (since <= WINDOW_S), (since >= -SETTLING_S) & (since < 0.0)
    counts = second.any() and counted[second | before].all()
    return values[second].mean(axis=0) if counts else np.full(2, np.nan)


def nees(name: str, run: int) -> Pairs:
    """Return the NEES of one run of one of CASES at TIMES_S, NaN for a second that does not count."""
    seed = FIRST_SEED + run
    recorded = memory_recording.record(target_filters.loaded(f'{name}/default', seed) if name in HARD_TARGETS
                                       else CASES[name].with_(seed=seed).load())
    tracked = tracking.read(recorded)
    found = consistency.read(recorded, tracked)
    assert found is not None
    known = np.isfinite(found.nees[:, 0])
    after = found.t - (found.t[known][0] if known.any() else np.inf)
    counted = known & (gaps(found, tracked) <= MAX_GAP_S)
    return np.array([of_second(time, after, found.nees, counted) for time in TIMES_S])


def _row(name: str, metric: str, values: Floats) -> Row:
    """Return the Row of a result, with a target only if the interval of its values does not contain MAX_NEES."""
    _, low, high = interval(values)
    return row(name, metric, values, target=None if low <= MAX_NEES < high else f'<= {MAX_NEES:g}')


def rows(values: Mapping[str, Floats]) -> list[Row]:
    """Return the rows of values {case: (runs, len(TIMES_S), 2)}. A second that counts in less than three quarters of
    the runs, or in a single run, has no row."""
    return [_row(name, f'nees_{axis}_{time:g}_s', of_runs[known, k, i])
            for name, of_runs in values.items() for k, time in enumerate(TIMES_S) for i, axis in enumerate(AXES)
            if 4 * (known := np.isfinite(of_runs[:, k, i])).sum() >= max(3 * len(known), 8)]


def run(progress: Progress, runs: int = DEFAULT_RUNS, pool: Pool | None = None) -> Result:
    """Run every case `runs` times."""
    values = of_cases(nees, CASES, runs, pool, progress)
    return Result(rows(values), {'nees': functools.partial(figure, values)},
                  [f'{seeds(runs)} A filter is too sure above {MAX_NEES:g}.'])


def figure(values: Mapping[str, Floats]) -> Figure:
    """Draw the mean NEES of both axes over the time after the start, a panel for each scenario."""
    drawn, axes = fig.new_panels(len(values), height=1.1 * len(values) + 1.0, y='NEES', sharex=True)
    for panel, (name, of_runs) in zip(axes[:, 0], values.items()):
        for i, (axis, colour) in enumerate(zip(AXES, (fig.FILTERED_COLOUR, fig.TRUTH_COLOUR))):
            known = np.isfinite(of_runs[:, :, i]).any(axis=0)
            panel.semilogy(np.array(TIMES_S)[known], np.nanmean(of_runs[:, known, i], axis=0), 'o-', color=colour,
                           label=axis)
        panel.axhline(2.0, linewidth=0.8)
        panel.set_title(name)
    return legend(drawn)
