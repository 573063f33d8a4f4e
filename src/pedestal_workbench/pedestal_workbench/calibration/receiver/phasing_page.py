"""HTML page of `pedestal calibrate receiver`: the errors over the offsets, and the circle before and after."""
import html
import typing
from collections.abc import Iterable, Sequence

import numpy as np
from matplotlib.figure import Figure

from pedestal_common.quantities import Pairs
from pedestal_common.text_files.text_table import TextTable
from pedestal_results.report import elements
from pedestal_results.report.figures import FILTERED_COLOUR, INK_COLOUR, RAW_COLOUR, TRUTH_COLOUR, Spec, new_panels
from pedestal_workbench.calibration.receiver.offsets import Points

if typing.TYPE_CHECKING:
    from pedestal_workbench.calibration.receiver.iq_phasing import IqPhasing
    from pedestal_workbench.calibration.receiver.phasing import Phasing


def curves(found: 'Phasing') -> Figure:
    """Return the figure with both errors over both offsets, and the fitted slopes."""
    points, slopes = found.points, found.slopes
    figure, panels = new_panels(2, 2, y=('cross-elevation error\n[beamwidths]', 'elevation error\n[beamwidths]'),
                                x=('cross-elevation offset [beamwidths]', 'elevation offset [beamwidths]'))
    limits = np.array((-1.1, 1.1)) * np.abs(points.offsets).max()
    for i in range(2):
        for j in range(2):
            axes, chosen = panels[i, j], points.fitted & (np.abs(points.offsets[:, 1 - j]) < 0.05)
            axes.plot(points.offsets[chosen, j], points.errors[chosen, i], 'o', color=RAW_COLOUR, markersize=4)
            axes.plot(limits, slopes.null[i] + slopes.C[i, j] * limits, color=FILTERED_COLOUR)
            axes.axhline(0.0, color=INK_COLOUR, linewidth=0.7)
            axes.set_ylim(*(limits * max(1.0, np.abs(slopes.C).max())))
    return figure


def circle(found: 'Phasing') -> Figure:
    """Return the figure with the circle of offsets and the errors that the control unit sees, before and after."""
    errors = found.points.errors - found.slopes.null
    return circles(found.points, errors @ found.in_force.T, errors @ found.slopes.matrix.T)


def circles(points: Points, before: Pairs, after: Pairs) -> Figure:
    """Return the figure with the circle of offsets, and the errors before and after a calibration."""
    figure, panels = new_panels(1, 2, height=3.6, x='cross-elevation [beamwidths]', y='elevation [beamwidths]')
    offset = np.vstack((points.offsets[points.circle], points.offsets[points.circle][:1]))
    for axes, errors, title in zip(panels.flat, (before, after), ('matrix in force', 'new matrix')):
        corrected = errors[points.circle]
        axes.plot(*offset.T, color=TRUTH_COLOUR, label='offset')
        axes.plot(*np.vstack((corrected, corrected[:1])).T, '.-', color=FILTERED_COLOUR, label='error')
        for start, end in zip(offset, corrected):
            axes.plot(*zip(start, end), color=RAW_COLOUR, linewidth=0.6)
        axes.set_aspect('equal', 'datalim')
        axes.set_title(title)
        axes.margins(0.1)
        axes.legend(loc='upper right')
    return figure


FIGURES = (
    Spec('curves', 'Errors over the offsets', 'Points: mean errors of the receiver at offsets on one axis. Lines: the '
         'fitted slopes. A line in a panel off the diagonal that is not level is cross-talk.', (), curves),
    Spec('circle', 'Errors on the circle', 'Orange: offsets on the circle. Blue: errors of the receiver, multiplied '
         'with the matrix. Both must agree within 5 % of the radius.', (), circle))
"""Figures of the page."""


def page(found: 'Phasing', table: Iterable[str], summary: Iterable[str], command: str) -> str:
    """Return the HTML page of a calibration; table, summary: printed lines; command: the command line."""
    points = [[f'{time:.1f} s', *(f'{value:.4f}' for value in (*offset, *error, *sigma)), 'circle' if on else 'fit']
              for time, offset, error, sigma, on in zip(found.points.times, found.points.offsets, found.points.errors,
                                                        found.points.sigma, found.points.circle)]
    return laid_out(found, FIGURES, (*table, '', *summary), command, 'Points [beamwidths]', (
        'time', 'xel offset', 'el offset', 'xel error', 'el error', 'xel sigma', 'el sigma', 'use'), points)


def laid_out(found: 'Phasing | IqPhasing', figures: Iterable[Spec], printed: Iterable[str], command: str, heading: str,
             columns: Iterable[str], points: Iterable[Sequence[str]]) -> str:
    """Return the HTML page of a calibration.

    printed: printed lines; command: the command line; heading, columns, points: table of the points.
    """
    return elements.page('Receiver calibration', [
        f'<h1>Receiver calibration: {html.escape(found.source)}</h1>',
        f'<p class="soft">{html.escape(command)}</p>',
        f'<pre class="wide">{html.escape(chr(10).join(printed))}</pre>',
        *(elements.figure(spec, found) for spec in figures),
        f'<h2>{heading}</h2>',
        TextTable(list(columns), points).html('n')])
