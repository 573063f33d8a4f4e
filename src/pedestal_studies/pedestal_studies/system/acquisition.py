"""Acquisition: time to track a target, from power-up or after a loss, and share of searches that find the target.

In late_tle the satellite is 1 to 3 s late. A case search-<pattern> has one round of a search. Its target stands still
anywhere in the searched area, with equal probability. The case steptrack_geo tracks a geostationary satellite by its
signal level alone and has other metrics. The metric tracked_after_s is the time until the antenna remains in autotrack
with the receiver locked. The metric found_percent is the share of the runs that end so with the target in the beam.
"""
import math
from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure
from scipy.stats import beta

from acu_tracker.modes import Mode
from acu_tracker.search.acquisition import SearchParameters
from acu_tracker.search.pattern import PATTERN_SPIRAL, PATTERN_SQUARE, SEARCH_PATTERNS
from pedestal_bringup.loop import closed_loop
from pedestal_bringup.loop.closed_loop import Run
from pedestal_bringup.scenario.variant import Variant
from pedestal_common.quantities import Floats, Pairs, Radians, Row, Seconds
from pedestal_results.intervals import CONFIDENCE_LEVEL, row
from pedestal_results.report import figures as fig
from pedestal_studies.result import FIRST_SEED, Result, of_cases, seeds
from pedestal_workbench.trials.monte_carlo import Pool, Progress

DEFAULT_RUNS = 100  # runs of each case

ERROR_TOPIC, MODE_TOPIC = 'tracking_receiver/angle_error', 'acu/mode'

POWER_UP_CASES = ('late_tle', 'sidelobe')  # cases whose tracked_after_s is measured from the start
SIGNAL_LOSS_CASES = ('fade', 'blockage', 'manoeuvre_in_coast')
"""Cases whose tracked_after_s is measured from the loss of the signal; `pedestal scenarios` describes each."""

TARGET_ELEVATION_RAD = 0.6  # elevation of the target of the search cases [rad]

SEARCH_PARAMETERS = {'acu.commands': '3 search', 'acu.search.rounds': 1, 'acu.acquisition.expected_dbhz': 0.0,
                     'tracking_receiver.receiver.cn0_dbhz': 46.4}

SEARCH_DURATIONS_S = {'spiral': 85.0, 'raster': 55.0, 'square': 115.0, 'sector': 55.0}  # one round and acquisition

FOUND_PERCENT_TARGET = '>= 99'  # target of found_percent

CASE_NAMES = (*POWER_UP_CASES, *SIGNAL_LOSS_CASES, 'steptrack_geo', *(f'search-{name}' for name in SEARCH_PATTERNS))

MAX_FOUND_ERROR_BEAMWIDTHS = 0.2  # largest true pointing error at which the target counts as in the beam [beamwidths]

MAIN_LOBE_LOSS_DB = 12.0
"""Level lost at one beamwidth off the axis of a parabolic main lobe [dB]. The loss grows with the square of the error,
so it is 3 dB at half a beamwidth."""

STEPTRACK_SETTLING_TIME_S = 90.0  # time after which step track is on its target [s]


def case_of(name: str, seed: int) -> Variant:
    """Return the variant of one run; name: one of CASE_NAMES."""
    rng = np.random.default_rng(seed)
    if name == 'late_tle':
        return Variant(name, seed=seed).with_({'scenario.program.time_offset': -rng.uniform(1.0, 3.0)})
    if not name.startswith('search-'):
        return Variant(name, seed=seed)
    pattern = name.removeprefix('search-')
    x, e = offset(SEARCH_PATTERNS.index(pattern), rng)
    return Variant('sidelobe', seed=seed, duration=SEARCH_DURATIONS_S[pattern]).with_({
        **SEARCH_PARAMETERS, 'acu.search.pattern': pattern, 'scenario.program.elevation_offset': e,
        'scenario.program.azimuth_offset': x / math.cos(TARGET_ELEVATION_RAD)})


def offset(pattern: int, rng: np.random.Generator, beamwidth: Radians = 0.0175) -> tuple[Radians, Radians]:
    """Return the (cross-elevation, elevation) of a random place in the full search area, from its centre.

    The area of a spiral and of a square pattern is a circle; a place outside the circle is drawn again. The area of
    the other patterns is a rectangle.
    """
    p = SearchParameters()
    while True:
        x, e = rng.uniform(-1.0, 1.0, 2) * p.full * beamwidth
        if pattern not in (PATTERN_SPIRAL, PATTERN_SQUARE):
            return x, e * p.across
        if math.hypot(x, e) <= p.full * beamwidth:
            return x, e


def tracked_after(run: Run, from_loss: bool) -> Seconds:
    """Return the time until the target is tracked for the rest of the run, or NaN.

    from_loss: True to measure from the first loss of the signal in autotrack, False from the start.
    """
    tracked = (run[MODE_TOPIC] == Mode.AUTOTRACK) & np.isfinite(run[ERROR_TOPIC]['vector'][:, 0])
    if not tracked[-1]:
        return math.nan
    untracked = np.flatnonzero(~tracked)
    first_tracked = np.flatnonzero(tracked)[0]
    tracked_since = untracked[-1] + 1 if untracked.size else 0
    if not from_loss:
        return run.t[tracked_since]
    lost = untracked[untracked > first_tracked]
    return run.t[tracked_since] - run.t[lost[0]] if lost.size else math.nan


def off_axis(run: Run) -> Floats:
    """Return the true pointing error [beamwidths] of a run; NaN where it is not known."""
    return np.hypot(*run.truth['error'].T) / run.units['tracking_receiver'].parameters.antenna.beamwidth


def measured(name: str, number: int) -> tuple[float, float]:
    """Return tracked_after_s of one run, and 1 if the target is in the beam at the end, else 0. For steptrack_geo,
    return the rms of the lost level [dB] and the largest error [beamwidths]."""
    run = closed_loop.Loop(case_of(name, FIRST_SEED + number).load()).run()
    off = off_axis(run)
    if name == 'steptrack_geo':
        settled = off[run.t > STEPTRACK_SETTLING_TIME_S]
        level_loss_db = MAIN_LOBE_LOSS_DB * settled**2
        return math.sqrt(np.mean(level_loss_db**2)), settled.max()
    after = tracked_after(run, name in SIGNAL_LOSS_CASES)
    return after, float(math.isfinite(after) and off[-1] < MAX_FOUND_ERROR_BEAMWIDTHS)


def least_share(found: int, runs: int) -> float:
    """Return the lower limit of the CONFIDENCE_LEVEL interval of a share, from `found` successes in `runs` runs
    (Clopper and Pearson, Biometrika 26 (1934) 404)."""
    return float(beta.ppf(0.5 * (1.0 - CONFIDENCE_LEVEL), found, runs - found + 1)) if found else 0.0


def rows(values: Mapping[str, Pairs]) -> list[Row]:
    """Return the rows of the study; values: {case: as `measured` returns, of every run}."""
    table = []
    for name, of_runs in values.items():
        if name == 'steptrack_geo':
            level_loss, largest_error = of_runs.T
            table += [row(name, 'level_loss_rms_db', level_loss, 'dB', target='<= 0.25'),
                      row(name, 'pointing_max_beamwidths', largest_error, 'beamwidths')]
            continue
        tracked_after_s, in_beam = of_runs.T
        found = in_beam == 1.0
        if found.any():
            table.append(row(name, 'tracked_after_s', tracked_after_s[found], 's'))
        table += [row(name, 'found_percent', 100.0 * float(found.mean()), '%', target=FOUND_PERCENT_TARGET),
                  row(name, 'found_percent_low', 100.0 * least_share(int(found.sum()), len(found)), '%')]
    return table


def run(progress: Progress, runs: int = DEFAULT_RUNS, pool: Pool | None = None) -> Result:
    """Run every case `runs` times."""
    values = of_cases(measured, CASE_NAMES, runs, pool, progress)
    return Result(rows(values), {'time': lambda: time_figure(values)},
                  [f'{seeds(runs)} tracked_after_s is over the runs that found their target.'])


def time_figure(values: Mapping[str, Pairs]) -> Figure:
    """Draw tracked_after_s of every run that found its target; values: argument of `rows`."""
    figure, axes = fig.new_panels(1, height=3.8, x='time until the target is tracked [s]')
    for name, of_runs in values.items():
        if name != 'steptrack_geo':
            tracked_after_s, in_beam = of_runs.T
            found = tracked_after_s[in_beam == 1.0]
            axes[0, 0].plot(found, [name] * len(found), '|', color=fig.FILTERED_COLOUR)
    axes[0, 0].invert_yaxis()
    axes[0, 0].set_xlim(left=0.0)
    return figure
