"""Figures of the studies: sheets of panels, saved as PNG."""
import matplotlib
from matplotlib.figure import Figure

from pedestal_bringup.report import figures

SIZE = (7.4, 4.6)
"""Of a figure [inch]."""


def panels(rows, columns=1, size=SIZE, **options):
    """(figure, axes (rows, columns)) on one sheet."""
    figure = Figure(figsize=size, layout='constrained')
    return figure, figure.subplots(rows, columns, squeeze=False, **options)


def draw_torques(axes, record):
    """Draw the torque [Nm] of both azimuth motors of a closed_loop.Run over time."""
    for i, (colour, style) in enumerate(((figures.MOTOR_1, '-'), (figures.MOTOR_2, '--'))):
        axes.plot(record.t, record['adu/motor_states']['effort'][:, i], style, color=colour, label=f'motor {i + 1}')


def save(draw, path):
    """Draw a figure into a PNG; the same bytes every time."""
    with matplotlib.rc_context(figures.STYLE):
        draw().savefig(path, dpi=150, facecolor='white', metadata={'Software': None})
