"""HTML page of `pedestal calibrate sensitivity`: levels and fit over both axes."""
import html
import typing
from collections.abc import Iterable

import numpy as np
from matplotlib.figure import Figure

from pedestal_analysis.calibration.sensitivity import beam
from pedestal_analysis.report import elements
from pedestal_analysis.report.figures import FILTERED_COLOUR, RAW_COLOUR, Spec, new_panels

if typing.TYPE_CHECKING:
    from pedestal_analysis.calibration.sensitivity.sensitivity import Sensitivity


def cuts(found: 'Sensitivity') -> Figure:
    """Return the figure with the levels over both offsets from the peak, and the fitted cuts."""
    figure, panels = new_panels(1, 2, height=3.0, x=('cross-elevation from the peak [deg]',
                                                    'elevation from the peak [deg]'), y='level over the peak [dB]')
    fitted = found.beam
    points, off = beam.disk(found.diameter), found.levels.offsets - fitted.place
    top = fitted.floor + fitted.peak
    levels = 10.0 * np.log10(found.levels.power / top)
    for i, axes in enumerate(panels.flat):
        along = np.linspace(off[:, i].min(), off[:, i].max(), 200)
        place = np.zeros((200, 2))
        place[:, i] = along
        power = fitted.floor + fitted.amplitude * beam.pattern(place, np.zeros(2), fitted.width, points)
        near = np.abs(off[:, 1 - i]) < 0.25 * fitted.width[1 - i]
        axes.plot(off[near, i], levels[near], 'o', color=RAW_COLOUR, markersize=4)
        axes.plot(along, 10.0 * np.log10(np.maximum(power / top, 1e-4)), color=FILTERED_COLOUR)
        axes.set_ylim(min(float(levels.min()), -10.0) - 1.0, 1.0)
    return figure


FIGURES = (Spec('cuts', 'Cuts through the beam', 'Points: levels within a quarter of a beamwidth of each cut. Lines: '
                'Gaussian beam, convolved with the disk of the source.', (), cuts),)
"""Figures of the page."""


def page(found: 'Sensitivity', printed: Iterable[str], command: str) -> str:
    """Return the HTML page of a beam cut; printed: its lines; command: the command line."""
    return elements.page('Sensitivity', [
        f'<h1>Sensitivity: {html.escape(found.levels.source)}</h1>', f'<p class="soft">{html.escape(command)}</p>',
        f'<pre class="wide">{html.escape(chr(10).join(printed))}</pre>',
        *(elements.figure(spec, found) for spec in FIGURES)])
