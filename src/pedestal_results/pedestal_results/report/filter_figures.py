"""Figures of a report on the target filter: its errors and stated sigma, its innovations, its motion models."""
import numpy as np
from matplotlib.figure import Figure

from pedestal_common.graph import topics
from pedestal_common.quantities import Floats, Times
from pedestal_results.consistency import BAND_PROBABILITY, bounds
from pedestal_results.recorded_run import RecordedRun
from pedestal_results.report.figures import (
    FILTERED_COLOUR,
    INK_COLOUR,
    RAW_COLOUR,
    TRUTH_COLOUR,
    Spec,
    draw_line,
    existing,
    new_panels,
    outside_legend,
)

MODEL_COLOURS = {'cv': '#2f9e5b', 'ca': '#1f6fd1', 'singer': '#8364c8', 'current_statistical': '#b5179e',
                 'ca_2': '#0b8f8c', 'ca_3': '#7fb069', 'ca_4': '#e0b400', 'ca_5': '#e57a00', 'ca_6': '#d1495b',
                 'ca_7': '#8d1f3d', 'ca_8': '#4a1025'}
"""{name of topics.MOTION_MODELS, in their order: colour}."""
NIS_SPAN_S = 1.0  # span over which the figure averages the NIS (normalised innovation squared) [s]


def estimate(data: RecordedRun) -> Figure:
    """Return the figure of estimate minus truth and of twice the stated sigma, for angle [deg] and rate [deg/s]."""
    known = existing(data.filter)
    figure, panels = new_panels(2, 2, sharex=True)
    for row, axis, i in zip(panels, topics.AXES, range(2)):
        for axes, error, sigma, unit in ((row[0], known.error, known.sigma, 'deg'),
                                         (row[1], known.rate_error, known.rate_sigma, 'deg/s')):
            error, sigma = np.degrees(error[:, i]), np.degrees(sigma[:, i])
            for sign in (-2.0, 2.0):
                draw_line(axes, known.t, sign * sigma, color=FILTERED_COLOUR, linewidth=1.0,
                          label='2 sigma, stated by the filter' if sign > 0.0 else None)
            draw_line(axes, known.t, error, color=TRUTH_COLOUR, linewidth=0.8, label='estimate minus truth')
            shown = np.abs(np.concatenate((error[known.tracking], 2.0 * sigma[known.tracking])))
            shown = shown[np.isfinite(shown)]
            if shown.size and shown.max() > 0.0:
                axes.set_ylim(-1.25 * shown.max(), 1.25 * shown.max())
            axes.set_ylabel(f'error [{unit}]')
        row[0].set_title(f'{axis}: angle')
        row[1].set_title(f'{axis}: rate')
    return outside_legend(figure, panels[0, 0])


def innovations(data: RecordedRun) -> Figure:
    """Return the figure of the innovations [deg] and of the mean NIS over NIS_SPAN_S with its band."""
    known = existing(data.filter)
    figure, panels = new_panels(2, 2, y='innovation [deg]', sharex=True)
    for row, axis, i in zip(panels, topics.AXES, range(2)):
        draw_line(row[0], known.t, np.degrees(known.innovation[:, i]), color=RAW_COLOUR, linewidth=0.7)
        row[1].set_ylabel('mean NIS')
        row[0].set_title(f'{axis}: innovation')
        t, nis, expected, low, high = _averaged(known.t, known.nis[:, i], known.freedoms[:, i])
        row[1].fill_between(t, low, high, color=FILTERED_COLOUR, alpha=0.2, linewidth=0.0,
                            label=f'{100.0 * BAND_PROBABILITY:g} % of a consistent filter')
        draw_line(row[1], t, expected, color=INK_COLOUR, linewidth=0.8, linestyle='--', label='expected')
        draw_line(row[1], t, nis, color=FILTERED_COLOUR, label=f'mean NIS over {NIS_SPAN_S:g} s')
        row[1].set_title(f'{axis}: NIS')
        row[1].set_ylim(0.0, None)
    return outside_legend(figure, panels[0, 1])


def _averaged(t: Times, nis: Floats, freedoms: Floats) -> tuple[Times, Floats, Floats, Floats, Floats]:
    """Return the mean NIS in spans of NIS_SPAN_S: time, mean, expectation, low and high of a consistent filter.

    A span with less than half of the largest number of measurements is NaN.
    """
    part = np.floor((t - t[0]) / NIS_SPAN_S).astype(int)
    known = np.isfinite(nis)
    count = np.bincount(part, known)
    count[count < 0.5 * count.max()] = np.nan
    with np.errstate(invalid='ignore', divide='ignore'):
        mean = np.bincount(part, np.where(known, nis, 0.0)) / count
        total = np.bincount(part, np.where(known, freedoms, 0.0))
        low, high = (bound / count for bound in bounds(total))
        return t[0] + NIS_SPAN_S * (np.arange(count.size) + 0.5), mean, total / count, low, high


def probabilities(data: RecordedRun) -> Figure:
    """Return the figure of the probability of each motion model, for both axes."""
    known = existing(data.filter)
    figure, panels = new_panels(2, y='probability', sharex=True)
    for axes, axis, i in zip(panels[:, 0], topics.AXES, range(2)):
        for number, model in enumerate(topics.MOTION_MODELS):
            values = known.probability[:, i, number]
            if np.isfinite(values).any():
                draw_line(axes, known.t, values, color=MODEL_COLOURS[model], label=model.replace('_', ' '))
        axes.set_ylim(-0.02, 1.02)
        axes.set_title(axis)
    return outside_legend(figure, panels[0, 0])


FIGURES = (
    Spec('estimate', 'Error and stated sigma of the filter', 'Estimate minus truth (orange) and twice the standard '
         'deviation that the filter states (blue): about 95 % should lie between the lines. On a ship the error '
         'includes the attitude error of the INS, which the filter does not model.', ('truth', 'filter'), estimate,
         timed=True),
    Spec('innovations', 'Innovations', 'Innovation: measurement minus prediction. Mean NIS: mean square of the '
         f'innovations over their stated variance, over {NIS_SPAN_S:g} s. Above the band the stated variance is too '
         'small, or the target moves as no model predicts. Below the band the stated variance is too large.',
         ('filter',), innovations, timed=True),
    Spec('probabilities', 'Motion models', 'Probability of each motion model of the filter; a single model has '
         'probability 1.', ('filter', 'bank'), probabilities, timed=True),
)
