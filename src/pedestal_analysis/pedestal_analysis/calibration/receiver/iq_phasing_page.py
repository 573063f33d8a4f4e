"""HTML page of `pedestal calibrate receiver --iq`: the complex ratios over the offsets, and the circle before and
after."""
import typing
from collections.abc import Iterable

import numpy as np
from matplotlib.figure import Figure

from pedestal_analysis.calibration.receiver import phasing_page
from pedestal_analysis.report.figures import FILTERED_COLOUR, INK_COLOUR, RAW_COLOUR, Spec, new_panels

if typing.TYPE_CHECKING:
    from pedestal_analysis.calibration.receiver.iq_phasing import IqPhasing


def ratios(found: 'IqPhasing') -> Figure:
    """Return the figure with the ratios of both channels in the complex plane: received, and multiplied with the new
    matrix."""
    points = found.points
    figure, panels = new_panels(2, 2, height=6.4, x=('in phase with the sum', 'in phase with the sum'),
                                y=('cross-elevation D / (k_m S),\nquadrature', 'elevation D / (k_m S),\nquadrature'))
    columns = ('received', found.ratios), ('multiplied with the new matrix', found.multiplied(found.slopes.matrix))
    for j, (title, values) in enumerate(columns):
        for i in range(2):
            axes = panels[i, j]
            for chosen, colour, label in ((points.fitted, RAW_COLOUR, 'fit'), (points.circle, FILTERED_COLOUR,
                                                                               'circle')):
                axes.plot(values[chosen, i].real, values[chosen, i].imag, 'o', color=colour, markersize=4, label=label)
            axes.axhline(0.0, color=INK_COLOUR, linewidth=0.7)
            axes.axvline(0.0, color=INK_COLOUR, linewidth=0.7)
            axes.set_aspect('equal', 'datalim')
            axes.margins(0.1)
        panels[0, j].set_title(title)
    panels[0, 0].legend(loc='upper right')
    return figure


FIGURES = (
    Spec('ratios', 'Ratios of difference and sum', 'Each point is the mean of one offset. The received ratios of a '
         'channel lie on a line whose angle is the phase of this channel. Multiplied with the new matrix, they lie on '
         'the horizontal axis.', (), ratios),
    Spec('circle', 'Errors on the circle', 'Orange: offsets on the circle. Blue: errors by the samples, multiplied '
         'with the matrix. Both must agree within 5 % of the radius.', (),
         lambda found: phasing_page.circles(found.points, *found.corrected)))
"""Figures of the page."""


def page(found: 'IqPhasing', table: Iterable[str], summary: Iterable[str], command: str) -> str:
    """Return the HTML page of a calibration; table, summary: printed lines; command: the command line."""
    def polar(value: complex) -> tuple[str, str]:
        return f'{abs(value):.4f}', f'{np.degrees(np.angle(value)):.1f} deg'
    points = [[f'{time:.1f} s', *(f'{value:.4f}' for value in offset), *polar(values[0]), *polar(values[1]),
               'circle' if on else 'fit']
              for time, offset, values, on in zip(found.points.times, found.points.offsets, found.ratios,
                                                  found.points.circle)]
    return phasing_page.laid_out(
        found, FIGURES, (*table, '', *summary), command, 'Offsets [beamwidths] and received ratios D / (k_m S)', (
            'time', 'xel offset', 'el offset', 'xel ratio', 'xel phase', 'el ratio', 'el phase', 'use'), points)
