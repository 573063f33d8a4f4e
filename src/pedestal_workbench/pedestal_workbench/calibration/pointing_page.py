"""HTML page of `pedestal calibrate pointing`: the residuals as a plot of the sky and as arrows, and tables."""
import html
import typing
from collections.abc import Iterable, Sequence

import numpy as np
from matplotlib.figure import Figure
from matplotlib.projections.polar import PolarAxes

from pedestal_common.quantities import Degrees, Pairs
from pedestal_common.text_files.text_table import TextTable
from pedestal_results.report import elements
from pedestal_results.report.figures import FILTERED_COLOUR, INK_COLOUR, RAW_COLOUR, TRUTH_COLOUR, Spec, new_panels
from pedestal_workbench.calibration import terms

if typing.TYPE_CHECKING:
    from pedestal_workbench.calibration.pointing import Calibration

ARROW_LENGTH_DEG = 12.0  # length on the plot of the arrow whose residual is stated as its scale [deg of elevation]


def _sky(axes: PolarAxes) -> None:
    """Prepare polar axes as a view of the sky from below: north above, east to the right, the zenith in the middle."""
    axes.set_theta_zero_location('N')
    axes.set_theta_direction(-1)
    axes.set_rlim(0.0, 90.0)
    axes.set_rgrids((0.0, 30.0, 60.0), ('90', '60', '30'), fontsize=7)


def _arrows(axes: PolarAxes, directions: Pairs, vectors: Pairs, scale: Degrees, colour: str) -> None:
    """Draw arrows for vectors [deg] in cross-elevation and elevation at directions [deg].

    scale: size of the vector whose arrow has the length ARROW_LENGTH_DEG
    """
    az, el = np.radians(directions).T
    radius = 90.0 - directions[:, 1]
    # East and north on the plane of the plot: cross-elevation points along the azimuth, elevation to the middle.
    across = np.column_stack((np.cos(az), -np.sin(az)))
    upward = np.column_stack((-np.sin(az), -np.cos(az)))
    start = np.column_stack((radius * np.sin(az), radius * np.cos(az)))
    step = ARROW_LENGTH_DEG / scale * (vectors[:, :1] * across + vectors[:, 1:] * upward)
    for (x, y), (dx, dy) in zip(start, step):
        end = np.arctan2(x + dx, y + dy), np.hypot(x + dx, y + dy)
        axes.annotate('', xy=end, xytext=(np.arctan2(x, y), np.hypot(x, y)),
                      arrowprops={'arrowstyle': '->', 'color': colour, 'linewidth': 0.9, 'shrinkA': 0, 'shrinkB': 0})
    axes.plot(az, radius, '.', color=INK_COLOUR, markersize=3)


def sky_plot(found: 'Calibration') -> Figure:
    """Return the figure with the directions on the sky; the colour is the size of offset and residual."""
    figure, panels = new_panels(1, 2, height=3.9, x='', subplot_kw={'projection': 'polar'})
    az, el = np.radians(found.offsets.directions).T
    for axes, vectors, title in zip(panels.flat, (found.offsets.values, found.fit.residuals),
                                    ('offsets', 'residuals')):
        _sky(axes)
        size = np.hypot(*vectors.T)
        marks = axes.scatter(az, np.degrees(0.5 * np.pi - el), c=size, cmap='viridis', s=22)
        figure.colorbar(marks, ax=axes, label=f'{title} [deg]', shrink=0.7)
        axes.plot(az[found.outliers], np.degrees(0.5 * np.pi - el[found.outliers]), 'o', color=TRUTH_COLOUR,
                  markersize=10, fillstyle='none')
    return figure


def arrow_plot(found: 'Calibration') -> Figure:
    """Return the figure with the offsets and the residuals as arrows, each with its own scale."""
    figure, panels = new_panels(1, 2, height=4.1, x='', subplot_kw={'projection': 'polar'})
    for axes, vectors, colour, title in zip(panels.flat, (found.offsets.values, found.fit.residuals),
                                            (RAW_COLOUR, FILTERED_COLOUR), ('offsets', 'residuals')):
        _sky(axes)
        scale = max(float(np.hypot(*vectors.T).max()), 1e-12)
        _arrows(axes, found.offsets.directions, vectors, scale, colour)
        axes.set_title(f'{title}; longest arrow {scale:.4g} deg', fontsize=9)
    return figure


def by_angle(found: 'Calibration') -> Figure:
    """Return the figure with the residuals of both axes over azimuth and elevation."""
    figure, panels = new_panels(2, 2, y=('cross-elevation [deg]', 'elevation [deg]'),
                                x=('azimuth [deg]', 'elevation [deg]'))
    for axis in range(2):
        for angle in range(2):
            axes = panels[axis, angle]
            at, values = found.offsets.directions[:, angle], found.fit.residuals[:, axis]
            axes.plot(at, values, '.', color=FILTERED_COLOUR, markersize=4)
            axes.plot(at[found.outliers], values[found.outliers], 'o', color=TRUTH_COLOUR, fillstyle='none')
            axes.axhline(0.0, color=INK_COLOUR, linewidth=0.7)
            axes.margins(0.04)
    return figure


FIGURES = (
    Spec('sky', 'Offsets and residuals on the sky', 'North is above, east to the right, the zenith in the middle. The '
         'colour is the size on the sky. Orange circles: outliers.', (), sky_plot),
    Spec('arrows', 'Offsets and residuals as arrows', 'The direction of an arrow is that on the sky. A pattern in the '
         'residuals is an effect that the terms do not describe.', (), arrow_plot),
    Spec('angles', 'Residuals over azimuth and elevation', 'Residuals of both axes. Orange circles: outliers.', (),
         by_angle))
"""Figures of the page."""


def page(found: 'Calibration', summary: Iterable[str], remarks: Sequence[str], command: str) -> str:
    """Return the HTML page of a calibration; summary, remarks: lines of text; command: the command line."""
    fitted, measured = found.fit, found.offsets
    half = fitted.interval * fitted.sigma
    table = [[name, f'{value:.6f}', f'{sigma:.6f}', f'{value - width:.6f} to {value + width:.6f}',
              terms.TERM_BY_NAME[name].unit, terms.TERM_BY_NAME[name].meaning]
             for name, value, sigma, width in zip(fitted.names, fitted.values, fitted.sigma, half)]
    correlation = [[name, *(f'{value:.2f}' for value in values)]
                   for name, values in zip(fitted.names, fitted.correlation)]
    points = [[place, *(f'{value:.4f}' for value in (*direction, *value, *residual, *left))]
              for place, direction, value, residual, left in zip(measured.places, measured.directions, measured.values,
                                                                 fitted.residuals, fitted.left_out)]
    return elements.page('Pointing calibration', [
        f'<h1>Pointing calibration: {html.escape(measured.source)}</h1>',
        f'<p class="soft">{html.escape(command)}</p>',
        f'<p>{len(measured.places)} offsets{f" of {found.date}" if found.date else ""}, {fitted.form} form.</p>',
        TextTable(('term', 'value', 'sigma', '95 % interval', 'unit', 'meaning'), table).html('n'),
        f'<pre class="wide">{html.escape(chr(10).join(summary))}</pre>',
        *([f'<ul>{"".join(f"<li>{html.escape(line)}</li>" for line in remarks)}</ul>'] if remarks else []),
        *(elements.figure(spec, found) for spec in FIGURES),
        '<h2>Correlation of the terms</h2>', TextTable(('', *fitted.names), correlation).html('n'),
        '<h2>Points</h2>', TextTable(('place', 'azimuth', 'elevation', 'xel offset', 'el offset', 'xel residual',
                                        'el residual', 'xel left out', 'el left out'), points).html('n')])
