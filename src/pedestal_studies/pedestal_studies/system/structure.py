"""The default target filter on a flexible structure with untuned loops, beside the filter before its ladder of models.

Cases are <scenario>/<frequency>Hz-<share>-<air>/<filter>. Share is the part of the load inertia that swings, on both
axes. The air is calm or has Davenport gusts about a mean torque of 300 Nm. The loops are those of the scenario, not of
`pedestal tune --loops`. `default` uses the models that the margins of the loop allow (acu_tracker.structure). `before`
has the models of the filter that the ladder replaced. The cases <frequency>Hz-<share>-<air> join the runs of all
scenarios, and `all` those of all cases.

held_runs           runs that `before` tracks from the begin of autotrack to the end
lost_runs           those of them that `default` loses
gained_runs         other runs that `default` tracks
pointing_to_before  pointing error over that of `before` under the same seed, if both hold every run
compared, above_limit   numbers of joined cases with this ratio, and with a mean of it above 1.05
"""
import functools
import itertools
import math
from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure

from acu_tracker.modes import Mode
from pedestal_bringup.loop import closed_loop
from pedestal_bringup.scenario.variant import Variant
from pedestal_common.graph.topics import AXES
from pedestal_common.quantities import Floats, Json, Row
from pedestal_results.intervals import row
from pedestal_results.report import figures as fig
from pedestal_results.tracking import HANDOVER_SETTLING_S
from pedestal_studies.result import FIRST_SEED, Result, of_cases, seeds
from pedestal_workbench.trials.monte_carlo import Pool, Progress

DEFAULT_RUNS = 10  # runs of each case
DURATION_S = 25.0

SCENARIOS = ('leo_pass', 'uav_flyby', 'ship_pass')
FREQUENCIES_HZ, SHARES = (2.0, 3.0, 4.0, 6.0, 8.0, 9.0, 11.0, 14.0, 20.0), (0.1, 0.2, 0.4, 0.7)
AIR_PARAMETERS: dict[str, dict[str, Json]] = {'calm': {}, 'gusts': {
    'adu.wind.azimuth': 300.0, 'adu.wind.elevation': 300.0, 'adu.wind.gust.kind': 'davenport'}}


def _both(node: str, changes: Mapping[str, Json]) -> dict[str, Json]:
    return {f'{node}.{axis}.{key}': value for axis in AXES for key, value in changes.items()}


FILTER_PARAMETERS: dict[str, dict[str, Json]] = {
    'default': {},
    'before': _both('acu', {'filter.imm.models': 'cv ca singer current_statistical', 'filter.imm.rungs': 1,
                            'filter.imm.dwell': 3000.0, 'filter.imm.ca.noise': math.radians(2.5e-3)})}

CASES = {  # {case: Variant}
    f'{name}/{frequency:g}Hz-{share:g}-{air}/{filter_name}': Variant(name, duration=DURATION_S).with_({
        **_both('adu', {'structure.frequency': frequency, 'structure.inertia_share': share}), **wind, **own})
    for name, frequency, share, (air, wind), (filter_name, own) in itertools.product(
        SCENARIOS, FREQUENCIES_HZ, SHARES, AIR_PARAMETERS.items(), FILTER_PARAMETERS.items())}

RATIO, MAX_POINTING_RATIO = 'pointing_to_before', 1.05  # metric, and its largest value for the default filter


def tracked(name: str, number: int) -> tuple[float, float]:
    """Return (time in autotrack after its begin [%], settled rms pointing error [deg]) of a run of one of CASES. The
    error is NaN if autotrack ended, or began too late to settle."""
    seed = FIRST_SEED + number
    run = closed_loop.Loop(CASES[name].with_({'adu.wind.gust.seed': seed}, seed=seed).load()).run()
    on = run['acu/mode'] == Mode.AUTOTRACK
    if not on.any():
        return 0.0, math.nan
    begin = run.t[on][0]
    share = float(np.mean(on[run.t >= begin]))
    settled = run.truth['error'][run.t >= begin + HANDOVER_SETTLING_S]
    if share < 1.0 or not len(settled):
        return 100.0 * share, math.nan
    return 100.0, math.degrees(math.sqrt(np.mean(np.sum(settled**2, axis=1))))


def rows(values: Mapping[str, Floats]) -> list[Row]:
    """Return the rows of the study; values: {case: (runs, 2) of `tracked`}."""
    table, of_cells = [], dict[str, list[tuple[Floats, Floats]]]()
    for name, of_runs in values.items():
        table.append(row(name, 'tracked_percent', of_runs[:, 0], '%'))
        place, _, filter_name = name.rpartition('/')
        if filter_name == 'default':
            pair = of_runs[:, 1], values[f'{place}/before'][:, 1]
            of_cells.setdefault(place.partition('/')[2], []).append(pair)
            table += _compared(name, *pair)
    joined = [line for cell, pairs in of_cells.items() for line in _compared(cell, *map(np.concatenate, zip(*pairs)))]
    ratios = [line['value'] for line in joined if line['metric'] == RATIO and line['value'] is not None]
    return [*table, *joined, *_lost('all', *map(np.concatenate, zip(*itertools.chain(*of_cells.values())))),
            row('all', 'compared', len(ratios)),
            row('all', 'above_limit', sum(ratio > MAX_POINTING_RATIO for ratio in ratios), target='<= 0')]


def _lost(case: str, default: Floats, before: Floats) -> list[Row]:
    held, kept = np.isfinite(before), np.isfinite(default)
    return [row(case, 'held_runs', int(held.sum())), row(case, 'gained_runs', int((kept & ~held).sum())),
            row(case, 'lost_runs', int((held & ~kept).sum()), target='<= 0')]


def _compared(case: str, default: Floats, before: Floats) -> list[Row]:
    """Return the rows of a comparison of the errors (runs,) of both filters."""
    ratio = default / before
    return _lost(case, default, before) + [
        row(case, RATIO, ratio, '', target=f'<= {MAX_POINTING_RATIO:g}')] * bool(np.isfinite(ratio).all())


def run(progress: Progress, runs: int = DEFAULT_RUNS, pool: Pool | None = None) -> Result:
    """Run every case `runs` times."""
    values = of_cases(tracked, CASES, runs, pool, progress)
    table = rows(values)
    return Result(table, {'tracked': functools.partial(figure, values)}, [seeds(runs)],
                  [line for line in table if '/' not in line['case']])


def figure(values: Mapping[str, Floats]) -> Figure:
    """Draw the time in autotrack of every run over the frequency of the structure, a panel for each filter."""
    drawn, axes = fig.new_panels(len(FILTER_PARAMETERS), height=6.0, x='frequency of the structure [Hz]',
                                 y='in autotrack [%]', sharex=True)
    for panel, filter_name in zip(axes[:, 0], FILTER_PARAMETERS):
        for name, of_runs in values.items():
            _, cell, own = name.split('/')
            if own == filter_name:
                colour = fig.TRUTH_COLOUR if cell.endswith('gusts') else fig.FILTERED_COLOUR
                panel.plot(np.full(len(of_runs), float(cell.partition('Hz')[0])), of_runs[:, 0], '_', color=colour)
        panel.set_title(filter_name)
    return drawn
