"""Figure of a report on the INS of a ship: attitude error and stated standard deviation."""
import numpy as np
from matplotlib.figure import Figure

from pedestal_analysis.report.figures import (
    FILTERED_COLOUR,
    INK_COLOUR,
    TRUTH_COLOUR,
    Spec,
    draw_line,
    existing,
    new_panels,
    outside_legend,
)
from pedestal_analysis.report.run_data import RunData

MIN_DRAWN_ERROR_DEG = 1e-4  # smallest error drawn on the logarithmic scale [deg]


def attitude(data: RunData) -> Figure:
    """Return the figure of the heading and level errors of the INS [deg], and of their stated standard deviations."""
    known = existing(data.attitude)
    figure, panels = new_panels(2, y='error [deg]', sharex=True)
    # known.sigma is (n, 2): level per axis, heading. Both level axes together have sqrt(2) times the sigma of one.
    for axes, name, error, sigma in zip(panels[:, 0], ('heading', 'level, both axes'),
                                        (np.abs(known.heading), known.level),
                                        (known.sigma[:, 1], np.sqrt(2.0) * known.sigma[:, 0])):
        draw_line(axes, known.t, np.maximum(np.degrees(error), MIN_DRAWN_ERROR_DEG), color=TRUTH_COLOUR, linewidth=0.8,
                  label='error')
        draw_line(axes, known.t, np.maximum(np.degrees(sigma), MIN_DRAWN_ERROR_DEG), color=FILTERED_COLOUR,
                  label='1 sigma, stated by the INS')
        if np.isfinite(known.aligned) and known.aligned > known.t[0]:
            axes.axvline(known.aligned, color=INK_COLOUR, linewidth=0.8, linestyle='--', label='aligned')
        axes.set_yscale('log')
        axes.set_title(name)
    return outside_legend(figure, panels[0, 0])


FIGURES = (
    Spec('attitude', 'Attitude error of the INS', 'Error of the attitude that the control unit received (orange) and '
         'the standard deviation that the INS states (blue).', ('attitude',), attitude, timed=True),
)
