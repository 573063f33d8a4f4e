"""HTML page of `pedestal trials`: histograms, scatter plots, signals of the worst and of the median trial, tables."""
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
from pedestal_workbench.trials.experiment import Found
from pedestal_workbench.trials.table import Table

HISTOGRAM_RESULTS = ('pointing_rms_deg', 'pointing_max_deg', 'azimuth_following_rms_deg',
                     'elevation_following_rms_deg', 'lock_time_s', 'loss_s', 'azimuth_nis_mean', 'azimuth_nees_mean',
                     'elevation_nis_mean', 'elevation_nees_mean', 'isolation_db', 'heading_error_rms_deg')
"""Names of the results that have a histogram, if their values vary."""


def _label(name: str) -> str:
    unit = statistics.unit(name)
    return f'{name} [{unit}]' if unit else name


def _varying(table: Table, names: Iterable[str]) -> list[tuple[str, Floats]]:
    found = [(name, table.column(name)) for name in names]
    return [(name, values) for name, values in found
            if np.isfinite(values).any() and np.ptp(values[np.isfinite(values)]) > 0.0]


def histograms(found: Found) -> Figure:
    """Return the figure with the histograms of the results, two in a row. A dashed line marks the median."""
    shown = _varying(found.table, [name for name in found.table.measured_results
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


def scatter(found: Found) -> Figure:
    """Return the figure with the result `by` over each varied parameter. The worst trials are orange."""
    varied = _varying(found.table, found.table.varied)
    rows = max(1, -(-len(varied) // 2))
    figure, panels = new_panels(rows, 2, height=0.5 + 2.0 * rows, x='')
    values = found.table.column(found.ranking)
    for axes, (name, given) in zip(panels.flat, varied):
        axes.plot(given, values, '.', color=RAW_COLOUR, markersize=3)
        axes.plot(given[found.worst()], values[found.worst()], 'o', color=TRUTH_COLOUR, markersize=4)
        axes.margins(0.03)
        if categories := found.table.categories(name):
            axes.set_xticks(range(len(categories)), categories)
        axes.set_xlabel(name)
        axes.set_ylabel(_label(found.ranking), fontsize=8)
    for axes in panels.flat[len(varied):]:
        axes.set_axis_off()
    return figure


def worst_and_median(found: Found) -> Figure:
    """Return the figure with the pointing errors of the worst and of the median trial; without a pointing error, the
    following errors. Both trials run again, because the table does not hold their signals."""
    # Trials without the result rank as the worst, so the median is that of the trials that have the result.
    places = found.places()
    known = [i for i in places if math.isfinite(found.table.column(found.ranking)[i])] or places
    beam = nodes.beam_of(found.ranking)
    runs = [(f'{name}: trial {i}', tracking.read(memory_recording.record(found.plan.scenario(i), beam)))
            for name, i in (('worst', places[0]), ('median', known[len(known) // 2]))]
    pointing = any(run.tracking.any() for _, run in runs)
    figure, panels = new_panels(2, 2, y='pointing error [deg]' if pointing else 'following error [deg]', sharex=True,
                                sharey='row')
    for column, (title, run) in zip(panels.T, runs):
        errors = (np.degrees(run.error) if pointing
                  else run.following)
        if pointing:
            errors = np.where(run.since[:, np.newaxis], errors, np.nan)
        for axes, values, axis in zip(column, errors.T, ('cross-elevation' if pointing else 'azimuth', 'elevation')):
            draw_line(axes, run.t, values, color=TRUTH_COLOUR, linewidth=0.8)
            axes.set_title(f'{title}, {axis}')
    return figure


def pairs(found: Found) -> Figure:
    """Return the figure with the result `by` of both sides, pair by pair, and the histogram of its difference."""
    figure, panels = new_panels(1, 2, height=3.3, x=('', 'difference of a pair'))
    sides = existing(found.best_two)
    a, b = sides.pairs(found.ranking)
    left, right = panels[0]
    left.plot(b, a, '.', color=FILTERED_COLOUR, markersize=4)
    ends = [min(a.min(), b.min()), max(a.max(), b.max())]
    left.plot(ends, ends, color=INK_COLOUR, linewidth=0.8)
    left.set_xlabel(sides.name_b, fontsize=7)
    left.set_ylabel(sides.name_a, fontsize=7)
    left.set_title(_label(found.ranking))
    right.hist(a - b, bins='auto', color=FILTERED_COLOUR, alpha=0.7)
    right.axvline(0.0, color=INK_COLOUR, linewidth=0.8)
    return figure


def _figures(found: Found) -> list[tuple[Spec, str]]:
    """Return [(figure, reason why it cannot be drawn, or '')]."""
    by, sides = found.ranking, found.best_two
    nothing_varied = '' if _varying(found.table, found.table.varied) else 'no parameter was varied'
    figures = [(Spec('histograms', 'Histograms', 'Distribution of each result over the trials in which it was '
                     'measured; dashed: the median.', (), histograms), ''),
               (Spec('scatter', 'Over the varied parameters', f'{by} of each trial; orange: the worst trials.',
                     (), scatter), nothing_varied),
               (Spec('worst', 'Worst trial and median trial', f'Ranked by {by}; both on one scale.', (),
                     worst_and_median), '')]
    if sides is not None:
        few = '' if len(sides.pairs(by)[0]) else f'{by} was measured in no pair'
        figures.insert(0, (Spec('pairs', 'Pair by pair', 'Each point is a seed. Below the line the first side has the '
                                'smaller value.', (), pairs), few))
    return figures


def _estimates(rows: Sequence[Row], head: Sequence[str]) -> str:
    lines = [[row['case'], row['metric'], elements.number(row['value'] if row['value'] is not None else math.nan,
                                                          row['unit']),
              '' if row['ci_low'] is None and row['ci_high'] is None else
              f'{_bound(row["ci_low"])} to {_bound(row["ci_high"])}', statistics.coverage(row)] for row in rows]
    return TextTable(head, lines).html()


def _bound(value: float | None) -> str:
    return '?' if value is None else f'{value:.4g}'


def page(found: Found, command: str) -> str:
    """Return the page as text; command: command line that makes it."""
    by, plan = found.ranking, found.plan
    title = f'{plan.runs} trials: {plan.name}'
    worst = [[f'{found.names[side]}: ' * (len(found.sides) > 1) + f'trial {i}',
              elements.number(found.tables[side].column(by)[i], statistics.unit(by)),
              found.sides[side].plan.command(i)] for side in found.order for i in found.worst(side)]
    head = ['case', 'metric', 'value', '95 % interval', 'trials']
    parts = [f'<h1>{html.escape(title)}</h1>', TextTable(('', ''), [['made by', command]]).html('meta')]
    parts += [f'<p><b>{html.escape(line)}</b></p>' for line in found.sentences]
    parts += ['<h2 id="figures">Figures</h2>', *(elements.figure(spec, found, reason)
                                                for spec, reason in _figures(found)),
              f'<h2 id="worst-trials">Worst trials by {html.escape(by)}</h2>',
              TextTable(('trial', by, 'command that runs the same trial in the graph'), worst).html(),
              '<h2 id="numbers">Numbers</h2>', _estimates(found.rows, head)]
    return elements.page(title, parts)
