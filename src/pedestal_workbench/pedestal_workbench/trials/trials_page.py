"""HTML page of `pedestal trials`: histograms, scatter plots, signals of the worst and of the median trial, tables."""
import dataclasses
import html
import math
from collections.abc import Iterable, Sequence

import numpy as np
from matplotlib.figure import Figure

from pedestal_bringup.loop import memory_recording
from pedestal_common.graph import nodes
from pedestal_common.quantities import Floats, Row
from pedestal_common.text_files.text_table import TextTable
from pedestal_results import tracking
from pedestal_results.report import elements
from pedestal_results.report.figures import (
    FILTERED_COLOUR,
    INK_COLOUR,
    RAW_COLOUR,
    TRUTH_COLOUR,
    Spec,
    draw_line,
    existing,
    new_panels,
)
from pedestal_workbench.trials import statistics
from pedestal_workbench.trials.comparison import Sides
from pedestal_workbench.trials.plan import Plan
from pedestal_workbench.trials.table import Table

HISTOGRAM_RESULTS = ('pointing_rms_deg', 'pointing_max_deg', 'azimuth_following_rms_deg',
                     'elevation_following_rms_deg', 'lock_time_s', 'loss_s', 'azimuth_nis_mean', 'azimuth_nees_mean',
                     'elevation_nis_mean', 'elevation_nees_mean', 'isolation_db', 'heading_error_rms_deg')
"""Names of the results that have a histogram, if their values vary."""


@dataclasses.dataclass
class Trials:
    """Data of the page."""
    plan: Plan
    table: Table
    by: str     # name of the result that ranks the trials
    worst: list[int]    # numbers of the worst trials, the worst trial first
    runs: list[tuple[str, tracking.Tracking]]   # titles and data of the worst and of the median trial
    sides: Sides | None     # the two best sides
    sentences: list[str]    # on the comparison and on the requirements
    command: str    # command line that made the page


def read(plan: Plan, table: Table, by: str, sides: Sides | None, sentences: list[str], command: str,
         count: int = 10) -> Trials:
    """Return the Trials of a plan and its table; count: number of worst trials on the page.

    The worst and the median trial run again, because the table does not hold their signals.
    """
    places = statistics.ranking(by, table.column(by)).tolist()
    # Trials without the result rank as the worst, so the median is that of the trials that have the result.
    known = [i for i in places if math.isfinite(table.column(by)[i])] or places
    chosen = {'worst': places[0], 'median': known[len(known) // 2]}
    beam = nodes.beam_of(by)
    runs = [(f'{name}: trial {i}', tracking.read(memory_recording.record(plan.scenario(i), beam)))
            for name, i in chosen.items()]
    return Trials(plan, table, by, places[:count], runs, sides, sentences, command)


def _label(name: str) -> str:
    unit = statistics.unit(name)
    return f'{name} [{unit}]' if unit else name


def _varying(table: Table, names: Iterable[str]) -> list[tuple[str, Floats]]:
    """Return [(name, values)] of the columns in names whose values vary."""
    found = [(name, table.column(name)) for name in names]
    return [(name, values) for name, values in found
            if np.isfinite(values).any() and np.ptp(values[np.isfinite(values)]) > 0.0]


def histograms(trials: Trials) -> Figure:
    """Return the figure with the histograms of the results, two in a row. A dashed line marks the median."""
    shown = _varying(trials.table, [name for name in trials.table.measured_results
                                    if nodes.plain(name) in HISTOGRAM_RESULTS])
    rows = max(1, -(-len(shown) // 2))
    figure, panels = new_panels(rows, 2, height=0.5 + 1.7 * rows, x='')
    for axes, (name, values) in zip(panels.flat, shown):
        values = values[np.isfinite(values)]
        axes.hist(values, bins='auto' if len(values) < 5000 else 80, color=FILTERED_COLOUR, alpha=0.7)
        axes.axvline(np.median(values), color=INK_COLOUR, linestyle='--', linewidth=0.8)
        axes.set_xlabel(_label(name))
        axes.locator_params(axis='x', nbins=5)
    for axes in panels.flat[len(shown):]:
        axes.set_axis_off()
    return figure


def scatter(trials: Trials) -> Figure:
    """Return the figure with the result `by` over each varied parameter. The worst trials are orange."""
    varied = _varying(trials.table, trials.table.varied)
    rows = max(1, -(-len(varied) // 2))
    figure, panels = new_panels(rows, 2, height=0.5 + 2.0 * rows, x='')
    values = trials.table.column(trials.by)
    for axes, (name, given) in zip(panels.flat, varied):
        axes.plot(given, values, '.', color=RAW_COLOUR, markersize=3)
        axes.plot(given[trials.worst], values[trials.worst], 'o', color=TRUTH_COLOUR, markersize=4)
        axes.margins(0.03)
        if categories := trials.table.categories(name):
            axes.set_xticks(range(len(categories)), categories)
        axes.set_xlabel(name)
        axes.set_ylabel(_label(trials.by), fontsize=8)
    for axes in panels.flat[len(varied):]:
        axes.set_axis_off()
    return figure


def worst_and_median(trials: Trials) -> Figure:
    """Return the figure with the pointing errors of the worst and of the median trial.

    Without a pointing error it shows the following errors.
    """
    pointing = any(run.tracking.any() for _, run in trials.runs)
    figure, panels = new_panels(2, 2, y='pointing error [deg]' if pointing else 'following error [deg]', sharex=True,
                                sharey='row')
    for column, (title, run) in zip(panels.T, trials.runs):
        errors = (np.degrees(run.error) if pointing
                  else run.following)
        if pointing:
            errors = np.where(run.since[:, np.newaxis], errors, np.nan)
        for axes, values, axis in zip(column, errors.T, ('cross-elevation' if pointing else 'azimuth', 'elevation')):
            draw_line(axes, run.t, values, color=TRUTH_COLOUR, linewidth=0.8)
            axes.set_title(f'{title}, {axis}')
    return figure


def pairs(trials: Trials) -> Figure:
    """Return the figure with the result `by` of both sides, pair by pair, and the histogram of its difference."""
    figure, panels = new_panels(1, 2, height=3.3, x=('', 'difference of a pair'))
    sides = existing(trials.sides)
    a, b = sides.pairs(trials.by)
    left, right = panels[0]
    left.plot(b, a, '.', color=FILTERED_COLOUR, markersize=4)
    ends = [min(a.min(), b.min()), max(a.max(), b.max())]
    left.plot(ends, ends, color=INK_COLOUR, linewidth=0.8)
    left.set_xlabel(sides.name_b, fontsize=7)
    left.set_ylabel(sides.name_a, fontsize=7)
    left.set_title(_label(trials.by))
    right.hist(a - b, bins='auto', color=FILTERED_COLOUR, alpha=0.7)
    right.axvline(0.0, color=INK_COLOUR, linewidth=0.8)
    return figure


def _figures(trials: Trials) -> list[tuple[Spec, str]]:
    """Return [(figure, reason why it cannot be drawn, or '')]."""
    nothing_varied = '' if _varying(trials.table, trials.table.varied) else 'no parameter was varied'
    found = [(Spec('histograms', 'Histograms', 'Distribution of each result over the trials in which it was measured; '
                   'dashed: the median.', (), histograms), ''),
             (Spec('scatter', 'Over the varied parameters', f'{trials.by} of each trial; orange: the worst trials.',
                   (), scatter), nothing_varied),
             (Spec('worst', 'Worst trial and median trial', f'Ranked by {trials.by}; both on one scale.', (),
                   worst_and_median), '')]
    if trials.sides is not None:
        few = '' if len(trials.sides.pairs(trials.by)[0]) else f'{trials.by} was measured in no pair'
        found.insert(0, (Spec('pairs', 'Pair by pair', 'Each point is a seed. Below the line the first side has the '
                              'smaller value.', (), pairs), few))
    return found


def _estimates(rows: Sequence[Row], head: Sequence[str]) -> str:
    """Return an HTML table of rows of --json with their values and intervals; head: its header."""
    lines = [[row['case'], row['metric'], elements.number(row['value'] if row['value'] is not None else math.nan,
                                                          row['unit']),
              '' if row['ci_low'] is None and row['ci_high'] is None else
              f'{_bound(row["ci_low"])} to {_bound(row["ci_high"])}', statistics.coverage(row)] for row in rows]
    return TextTable(head, lines).html()


def _bound(value: float | None) -> str:
    return '?' if value is None else f'{value:.4g}'


def page(trials: Trials, rows: Sequence[Row]) -> str:
    """Return the page of Trials as text; rows: their rows of --json."""
    title = f'{trials.plan.runs} trials: {trials.plan.name}'
    values = trials.table.column(trials.by)
    worst = [[f'trial {i}', elements.number(values[i], statistics.unit(trials.by)), trials.plan.command(i)]
             for i in trials.worst]
    head = ['case', 'metric', 'value', '95 % interval', 'trials']
    parts = [f'<h1>{html.escape(title)}</h1>', TextTable(('', ''), [['made by', trials.command]]).html('meta')]
    parts += [f'<p><b>{html.escape(line)}</b></p>' for line in trials.sentences]
    parts += ['<h2 id="figures">Figures</h2>', *(elements.figure(spec, trials, reason)
                                                for spec, reason in _figures(trials)),
              f'<h2 id="worst-trials">Worst trials by {html.escape(trials.by)}</h2>',
              TextTable(('trial', trials.by, 'command that runs the same trial in the graph'), worst).html(),
              '<h2 id="numbers">Numbers</h2>', _estimates(rows, head)]
    return elements.page(title, parts)
