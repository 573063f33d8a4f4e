"""Drawing of the figures of all reports. Measured values are grey, filtered or commanded values blue, true values
orange.
"""
import pathlib
import re
import typing
from collections.abc import Callable, Iterable, Sequence
from typing import IO, TYPE_CHECKING, Any, TypeAlias, TypeVar, cast

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FixedLocator, LogLocator, NullFormatter
from numpy.typing import NDArray

from pedestal_common.quantities import Bools, Floats, Seconds, Times
from pedestal_results.tracking import stretches

if TYPE_CHECKING:
    from matplotlib.typing import RcKeyType

    from pedestal_results.events import Event
    from pedestal_results.recorded_run import RecordedRun

Panels: TypeAlias = NDArray[np.object_]     # (rows, columns) of Axes
Window: TypeAlias = tuple[Seconds, Seconds]     # first and last time to draw
_Part = TypeVar('_Part')

INK_COLOUR = '#20242a'
RAW_COLOUR, FILTERED_COLOUR, TRUTH_COLOUR = '#8d949e', '#1f6fd1', '#e57a00'
MOTOR_1_COLOUR, MOTOR_2_COLOUR = '#0b8f8c', '#a04fc4'
"""Colours of texts and marks, of measured, filtered and true values, and of both motors."""
FIGURE_WIDTH_INCH = 7.4  # width of a figure [inch]

MATPLOTLIB_STYLE: 'dict[RcKeyType, object]' = {
    'font.size': 9.0, 'axes.titlesize': 9.5, 'axes.titlelocation': 'left', 'legend.fontsize': 8.5,
    'legend.frameon': False, 'axes.spines.top': False, 'axes.spines.right': False, 'axes.grid': True,
    'grid.color': '#88919c', 'grid.alpha': 0.25, 'grid.linewidth': 0.6, 'axes.edgecolor': INK_COLOUR,
    'axes.labelcolor': INK_COLOUR,
    'xtick.color': INK_COLOUR, 'ytick.color': INK_COLOUR, 'text.color': INK_COLOUR, 'axes.facecolor': 'none',
    'figure.facecolor': 'none',
    'lines.linewidth': 1.0, 'lines.solid_joinstyle': 'round', 'axes.formatter.useoffset': False,
    'axes.xmargin': 0.0, 'svg.fonttype': 'none',
}


class Spec(typing.NamedTuple):
    """Specification of a figure."""
    key: str    # name of its file without extension
    title: str
    caption: str    # below the title
    needs: tuple[str, ...]  # data that the figure needs: keys of recorded_run._NEEDS
    draw: Callable[..., Figure]     # function of RecordedRun or of experiment.Found
    dpi: int = 150  # of its PNG
    timed: bool = False     # True for panels over time, which get the marks of the events
    paper: int = 0  # number of the same figure in the paper; 0: none


def existing(part: _Part | None) -> _Part:
    """Return a part of the data that a figure needs, which therefore exists (Spec.needs)."""
    assert part is not None
    return part


def thin(t: Times, y: Floats, bins: int = 1000) -> tuple[Times, Floats]:
    """Return a line with fewer points: the smallest and the largest value in each of `bins` parts.

    Because gaps must stay visible, the first NaN of each part stays too.
    """
    if t.size <= 2 * bins:
        return t, y
    edges = np.linspace(0, t.size, bins + 1).astype(int)
    low = np.where(np.isfinite(y), y, np.inf)
    high = np.where(np.isfinite(y), y, -np.inf)
    keep = {0, t.size - 1}
    for start, stop in zip(edges[:-1], edges[1:]):
        gap = np.flatnonzero(~np.isfinite(y[start:stop]))
        keep.update((start + np.argmin(low[start:stop]), start + np.argmax(high[start:stop]), *(start + gap[:1])))
    index = np.array(sorted(keep))
    return t[index], y[index]


def spans(flags: Bools) -> list[tuple[int, int]]:
    """Return [(first index, last index)] of the intervals in which flags are true."""
    return [(first, end - 1) for first, end in stretches(flags)]


def new_panels(rows: int, columns: int = 1, height: float | None = None, width: float = FIGURE_WIDTH_INCH,
               x: str | Sequence[str] = 'time [s]', y: str | Sequence[str] = '',
               **options: Any) -> tuple[Figure, Panels]:  # of matplotlib, which has many
    """Return a figure with some panels. The default height [inch] is 0.5, plus 1.75 for each row.

    x         label below the last row: one text for all columns, or one for each
    y         label left of the first column: one text for all rows, or one for each
    options   of Figure.subplots
    """
    figure = Figure(figsize=(width, height or 0.5 + 1.75 * rows), layout='constrained')
    axes = figure.subplots(rows, columns, squeeze=False, **options)
    for panel, label in zip(axes[-1], np.broadcast_to(x, columns)):
        panel.set_xlabel(label)
    for panel, label in zip(axes[:, 0], np.broadcast_to(y, rows)):
        panel.set_ylabel(label)
    return figure, axes


def draw_line(axes: Axes, t: Times, y: Floats, window: Window | None = None,
              **options: Any) -> None:  # of matplotlib, which has many
    """Draw y over t with fewer points (`thin`); options: those of Axes.plot."""
    if window is not None:
        inside = (t >= window[0]) & (t <= window[1])
        t, y = t[inside], y[inside]
    axes.plot(*thin(t, y), **options)
    if t.size > 1:
        axes.set_xlim(t[0], t[-1])


def outside_legend(figure: Figure, axes: Axes) -> Figure:
    """Add the legend of one panel (axes) above all panels, and return the figure."""
    figure.legend(*axes.get_legend_handles_labels(), loc='outside upper right', ncols=4)
    return figure


EVENT_COLOURS = {'alarm': '#c81e1e', 'refused': '#c81e1e', 'injected fault': '#b5179e', 'state': '#a87b51',
                 'command': '#2f7d4f', 'mode': INK_COLOUR}
"""{kind of event: colour of its mark}, the most urgent first."""

MIN_MARK_DISTANCE = 0.02
"""Smallest distance of two numbers on a panel [widths of the panel]; closer events share one number."""


def mark(figure: Figure, events: Sequence['Event']) -> None:
    """Draw a vertical line for each event on all panels, with its number, from 1, on the first row."""
    for axes in figure.axes:
        low, high = axes.get_xlim()
        seen = [(number, event) for number, event in enumerate(events, start=1) if low < event.t < high]
        for _, event in seen:
            axes.axvline(event.t, color=EVENT_COLOURS[event.kind], linewidth=0.8, linestyle=':')
        if existing(axes.get_subplotspec()).is_first_row():
            for label, t, colour in _labels(seen, MIN_MARK_DISTANCE * (high - low)):
                axes.text(t, 0.99, label, color=colour, fontsize=6.5, ha='right', va='top', rotation=90.0,
                          transform=axes.get_xaxis_transform())


def _labels(seen: Sequence[tuple[int, 'Event']], distance: Seconds) -> list[tuple[str, Seconds, str]]:
    """Return (text, time, colour) of the numbers of events; closer events than `distance` share one."""
    groups: list[list[tuple[int, Event]]] = []
    for numbered in seen:
        if groups and numbered[1].t - groups[-1][0][1].t < distance:
            groups[-1].append(numbered)
        else:
            groups.append([numbered])
    order = list(EVENT_COLOURS)
    return [('-'.join(dict.fromkeys((str(group[0][0]), str(group[-1][0])))), group[0][1].t,
             EVENT_COLOURS[min((event.kind for _, event in group), key=order.index)]) for group in groups]


FILE_METADATA = {'png': {'Software': None}, 'pdf': {'CreationDate': None, 'Creator': None, 'Producer': None},
                 'svg': {'Date': None, 'Creator': None, 'Format': None, 'Type': None}}
"""{format of a file: metadata that are left out}. This avoids different bytes of equal figures."""

LINE_DASHES: dict[object, tuple[float, tuple[float, ...]]] = {
    TRUTH_COLOUR: (0, (6.0, 1.5)), MOTOR_1_COLOUR: (0, (3.0, 1.0, 1.0, 1.0)), MOTOR_2_COLOUR: (0, (2.0, 1.2))}
"""{colour: dashes} by which the lines differ in a print without colour. Lines of all other colours are solid."""


MIN_WIDE_LINE_PT = 2.0  # width above which a line needs no dashes, because its width distinguishes it [pt]


def tidy(figure: Figure) -> None:
    """Make a figure easier to read, after all is drawn.

    In a panel with several lines, the solid lines become dashed by their colours (LINE_DASHES). A logarithmic axis of
    less than three decades has plain numbers as labels.
    """
    for axes in figure.axes:
        lines = [line for line in axes.get_lines() if np.size(line.get_xdata()) > 2]
        _dash(lines if len(lines) > 1 else ())
        for axis in (axes.xaxis, axes.yaxis):
            low, high = sorted(axis.get_view_interval())
            fixed = isinstance(axis.get_major_locator(), FixedLocator)
            if axis.get_scale() == 'log' and 0.0 < high < 1e3 * low and not fixed:
                axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
                axis.set_major_formatter('{x:g}')
                axis.set_minor_formatter(NullFormatter())
    for legend in figure.legends:
        _dash(legend.get_lines())


def _dash(lines: Iterable[Line2D]) -> None:
    for line in lines:
        if line.get_linestyle() == '-' and line.get_linewidth() < MIN_WIDE_LINE_PT and line.get_color() in LINE_DASHES:
            line.set_linestyle(LINE_DASHES[line.get_color()])


def store(figure: Figure, output: pathlib.Path | IO[str], dpi: int = 150) -> None:
    """Write a figure to a path by its suffix, with a white background; to a stream as a transparent SVG."""
    kind = str(output).rpartition('.')[2] if isinstance(output, pathlib.Path) else 'svg'
    colours = {'transparent': True} if kind == 'svg' else {'facecolor': 'white'}
    figure.savefig(output, format=kind, dpi=dpi, metadata=FILE_METADATA[kind], **colours)


def render(spec: Spec, data: object, output: pathlib.Path | IO[str]) -> None:
    """Draw the figure of a Spec, and `store` it in a path or stream. Equal data give equal bytes."""
    with matplotlib.rc_context({**MATPLOTLIB_STYLE, 'svg.hashsalt': spec.key}):
        figure = spec.draw(data)
        if spec.timed:
            mark(figure, cast('RecordedRun', data).events)
        store(figure, output, spec.dpi)


def inline(svg: str) -> str:
    """Return the text of an SVG file as an element of an HTML page, with the colour of the page and cut to 0.01 pt."""
    svg = svg[svg.index('<svg'):]
    svg = re.sub(r'<metadata>.*?</metadata>', '', svg, flags=re.DOTALL)
    svg = re.sub(r' xmlns(:xlink)?="[^"]*"', '', svg)
    svg = re.sub(r'<g id="[^"]*"', '<g', svg)
    svg = re.sub(r'<[^>]*>', lambda tag: re.sub(r'(\d\.\d\d)\d+', r'\1', tag[0]), svg)
    return svg.replace(INK_COLOUR, 'currentColor')
