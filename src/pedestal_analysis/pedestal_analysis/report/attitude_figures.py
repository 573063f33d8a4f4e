"""The figures of a report about the INS: the error of its attitude beside the one it stated."""
import numpy as np

from pedestal_analysis.report.figures import (
    FILTERED_COLOUR,
    INK_COLOUR,
    TRUTH_COLOUR,
    Spec,
    draw_line,
    new_panels,
    outside_legend,
)

MIN_DRAWN_ERROR_DEG = 1e-4
"""Smallest error [deg] drawn on the logarithmic scale."""


def attitude(data):
    """Heading and level error of the INS [deg] and their standard deviations as it states them."""
    known = data.attitude
    figure, panels = new_panels(2, y='error [deg]', sharex=True)
    for axes, name, error, sigma in zip(panels[:, 0], ('heading', 'level, both axes'),
                                        (np.abs(known.heading), known.level),
                                        (known.sigma[:, 1], np.sqrt(2.0) * known.sigma[:, 0])):
        draw_line(axes, known.t, np.maximum(np.degrees(error), MIN_DRAWN_ERROR_DEG), color=TRUTH_COLOUR, linewidth=0.8,
                  label='error')
        draw_line(axes, known.t, np.maximum(np.degrees(sigma), MIN_DRAWN_ERROR_DEG), color=FILTERED_COLOUR,
                  label='1 sigma, as the INS says')
        if np.isfinite(known.aligned) and known.aligned > known.t[0]:
            axes.axvline(known.aligned, color=INK_COLOUR, linewidth=0.8, linestyle='--', label='aligned')
        axes.set_yscale('log')
        axes.set_title(name)
    return outside_legend(figure, panels[0, 0])


FIGURES = (
    Spec('attitude', 'What the INS knew of the deck', 'Error of the attitude that the control unit was given (orange) '
         'and its standard deviation as the INS states it (blue).', ('attitude',), attitude),
)
