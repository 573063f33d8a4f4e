"""How figures are drawn: colours, style, panels, lines, and one figure as a file or as part of a page.

Grey is what was measured, blue what was filtered or commanded, orange the truth.
"""
import re
import typing

import matplotlib
import numpy as np
from matplotlib.figure import Figure

INK = '#20242a'
RAW, FILTERED, TRUTH = '#8d949e', '#1f6fd1', '#e57a00'
MOTOR_1, MOTOR_2 = '#0b8f8c', '#a04fc4'
WIDTH = 7.4
"""Of a figure [inch]."""

STYLE = {
    'font.size': 9.0, 'axes.titlesize': 9.5, 'axes.titlelocation': 'left', 'legend.fontsize': 8.5,
    'legend.frameon': False, 'axes.spines.top': False, 'axes.spines.right': False, 'axes.grid': True,
    'grid.color': '#88919c', 'grid.alpha': 0.25, 'grid.linewidth': 0.6, 'axes.edgecolor': INK, 'axes.labelcolor': INK,
    'xtick.color': INK, 'ytick.color': INK, 'text.color': INK, 'axes.facecolor': 'none', 'figure.facecolor': 'none',
    'lines.linewidth': 1.0, 'lines.solid_joinstyle': 'round', 'axes.formatter.useoffset': False,
    'axes.xmargin': 0.0, 'svg.fonttype': 'none',
}


class Spec(typing.NamedTuple):
    """A figure: key, the name of its PNG; needs, what RunData must not lack; draw(RunData) -> Figure; dots per inch of
    its PNG."""
    key: str
    title: str
    caption: str
    needs: tuple
    draw: typing.Callable
    dpi: int = 150


def thin(t, y, bins=1000):
    """(t, y), both (n,), of the smallest and the largest value in each of `bins` stretches, in order, and of the first
    NaN in each, so that gaps stay gaps."""
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


def spans(flags):
    """[(first, last index)] of the stretches where flags (n,) bool are true."""
    edges = np.flatnonzero(np.diff(np.concatenate(([0], flags.astype(int), [0]))))
    return list(zip(edges[::2].tolist(), (edges[1::2] - 1).tolist()))


def new_panels(rows, columns=1, height=1.75, **options):
    """(Figure, axes (rows, columns)); height of a row [inch], options of Figure.subplots."""
    figure = Figure(figsize=(WIDTH, 0.5 + height * rows), layout='constrained')
    return figure, figure.subplots(rows, columns, squeeze=False, **options)


def draw_line(axes, t, y, window=None, **options):
    """Draw y (n,) over t (n,), thinned; window: (first, last t) that is drawn, options of Axes.plot."""
    if window is not None:
        inside = (t >= window[0]) & (t <= window[1])
        t, y = t[inside], y[inside]
    axes.plot(*thin(t, y), **options)
    if t.size > 1:
        axes.set_xlim(t[0], t[-1])


def outside_legend(figure, axes, **options):
    """The legend of some axes above the figure, options of Figure.legend."""
    figure.legend(*axes.get_legend_handles_labels(), loc='outside upper right', ncols=4, **options)


def render(spec, data, output):
    """Draw the figure of a Spec into a path or stream: .png on white, else transparent SVG. Equal data give equal
    bytes."""
    with matplotlib.rc_context({**STYLE, 'svg.hashsalt': spec.key}):
        figure = spec.draw(data)
        if str(output).endswith('.png'):
            figure.savefig(output, dpi=spec.dpi, facecolor='white', metadata={'Software': None})
        else:
            figure.savefig(output, format='svg', transparent=True,
                           metadata={'Date': None, 'Creator': None, 'Format': None, 'Type': None})


def inline(svg):
    """The text of an SVG file as an element of an HTML page: no prolog, no names, the ink of the page, coordinates to
    0.01 pt."""
    svg = svg[svg.index('<svg'):]
    svg = re.sub(r'<metadata>.*?</metadata>', '', svg, flags=re.DOTALL)
    svg = re.sub(r' xmlns(:xlink)?="[^"]*"', '', svg)
    svg = re.sub(r'<g id="[^"]*"', '<g', svg)
    svg = re.sub(r'<[^>]*>', lambda tag: re.sub(r'(\d\.\d\d)\d+', r'\1', tag[0]), svg)
    return svg.replace(INK, 'currentColor')
