"""The figures of a report about the INS: how wrong its attitude was, beside what it said of it."""
import numpy as np

from pedestal_bringup.report.figures import FILTERED, INK, TRUTH, Spec, draw_line, new_panels, outside_legend

LEAST = 1e-4
"""Smallest error [deg] drawn on the logarithmic scale."""


def attitude(recording):
    found = recording.attitude
    figure, panels = new_panels(2, sharex=True)
    for axes, name, error, sigma in zip(panels[:, 0], ('heading', 'level, both axes'),
                                        (np.abs(found.heading), found.level),
                                        (found.sigma[:, 1], np.sqrt(2.0) * found.sigma[:, 0])):
        draw_line(axes, found.t, np.maximum(np.degrees(error), LEAST), color=TRUTH, linewidth=0.8, label='error')
        draw_line(axes, found.t, np.maximum(np.degrees(sigma), LEAST), color=FILTERED,
                  label='1 sigma, as the INS says')
        if np.isfinite(found.aligned) and found.aligned > found.t[0]:
            axes.axvline(found.aligned, color=INK, linewidth=0.8, linestyle='--', label='aligned')
        axes.set_yscale('log')
        axes.set_title(name)
        axes.set_ylabel('error [deg]')
    panels[1, 0].set_xlabel('time [s]')
    outside_legend(figure, panels[0, 0])
    return figure


FIGURES = (
    Spec('attitude', 'What the INS knew of the deck', 'Error of the attitude that the control unit was given (orange) '
         'and its standard deviation as the INS states it (blue).', ('attitude',), attitude),
)
