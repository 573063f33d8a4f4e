"""The figures of a report about the target filter: its errors beside what it states, innovations, probabilities."""
import numpy as np

from pedestal_analysis.report.figures import FILTERED, INK, RAW, TRUTH, Spec, draw_line, new_panels, outside_legend
from pedestal_analysis.results.consistency import PART, bounds
from pedestal_common.graph import topics

MODELS = {'cv': '#2f9e5b', 'ca': '#1f6fd1', 'singer': '#8364c8', 'current_statistical': '#e57a00'}
SPAN = 1.0
"""Seconds over which the NIS is averaged for its figure."""


def estimate(data):
    """Estimate less truth and twice the sigma that the filter states, angle [deg] and rate [deg/s]."""
    known = data.filter
    figure, panels = new_panels(2, 2, sharex=True)
    for row, axis, i in zip(panels, topics.AXES, range(2)):
        for axes, error, sigma, unit in ((row[0], known.error, known.sigma, 'deg'),
                                         (row[1], known.rate_error, known.rate_sigma, 'deg/s')):
            error, sigma = np.degrees(error[:, i]), np.degrees(sigma[:, i])
            for sign in (-2.0, 2.0):
                draw_line(axes, known.t, sign * sigma, color=FILTERED, linewidth=1.0,
                          label='2 sigma, as the filter states' if sign > 0.0 else None)
            draw_line(axes, known.t, error, color=TRUTH, linewidth=0.8, label='estimate less truth')
            shown = np.abs(np.concatenate((error[known.tracking], 2.0 * sigma[known.tracking])))
            shown = shown[np.isfinite(shown)]
            if shown.size and shown.max() > 0.0:
                axes.set_ylim(-1.25 * shown.max(), 1.25 * shown.max())
            axes.set_ylabel(f'error [{unit}]')
        row[0].set_title(f'{axis}: angle')
        row[1].set_title(f'{axis}: rate')
    return outside_legend(figure, panels[0, 0])


def innovations(data):
    """Innovations [deg] and the mean NIS of SPAN seconds in its band."""
    known = data.filter
    figure, panels = new_panels(2, 2, y='innovation [deg]', sharex=True)
    for row, axis, i in zip(panels, topics.AXES, range(2)):
        draw_line(row[0], known.t, np.degrees(known.innovation[:, i]), color=RAW, linewidth=0.7)
        row[1].set_ylabel('mean NIS')
        row[0].set_title(f'{axis}: innovation')
        t, nis, expected, low, high = _averaged(known.t, known.nis[:, i], known.freedoms[:, i])
        row[1].fill_between(t, low, high, color=FILTERED, alpha=0.2, linewidth=0.0,
                            label=f'{100.0 * PART:g} % of an honest filter')
        draw_line(row[1], t, expected, color=INK, linewidth=0.8, linestyle='--', label='expected')
        draw_line(row[1], t, nis, color=FILTERED, label=f'mean NIS of {SPAN:g} s')
        row[1].set_title(f'{axis}: NIS')
        row[1].set_ylim(0.0, None)
    return outside_legend(figure, panels[0, 1])


def _averaged(t, nis, freedoms):
    """(times, mean NIS, its expectation, its band) over stretches of SPAN; NaN where hardly anything was measured."""
    part = np.floor((t - t[0]) / SPAN).astype(int)
    known = np.isfinite(nis)
    count = np.bincount(part, known)
    count[count < 0.5 * count.max()] = np.nan
    with np.errstate(invalid='ignore', divide='ignore'):
        mean = np.bincount(part, np.where(known, nis, 0.0)) / count
        total = np.bincount(part, np.where(known, freedoms, 0.0))
        low, high = (bound / count for bound in bounds(total))
        return t[0] + SPAN * (np.arange(count.size) + 0.5), mean, total / count, low, high


def probabilities(data):
    """Probability of each motion model."""
    known = data.filter
    figure, panels = new_panels(2, y='probability', sharex=True)
    for axes, axis, i in zip(panels[:, 0], topics.AXES, range(2)):
        for number, model in enumerate(topics.MOTION_MODELS):
            values = known.probability[:, i, number]
            if np.isfinite(values).any():
                draw_line(axes, known.t, values, color=MODELS[model], label=model.replace('_', ' '))
        axes.set_ylim(-0.02, 1.02)
        axes.set_title(axis)
    return outside_legend(figure, panels[0, 0])


FIGURES = (
    Spec('estimate', 'What the filter states of its error', 'Estimate less truth (orange) and twice the standard '
         'deviation the filter states (blue): about 95 % should lie between the lines. On a ship the attitude error '
         'of the INS is in the error, and the filter does not know it.', ('truth', 'filter'), estimate),
    Spec('innovations', 'Innovations', 'What each measurement was off its prediction, and the mean of its square in '
         f'units of what the filter expected, over {SPAN:g} s; above the band the filter is too sure of itself or the '
         'target does what no model knows, below it the filter is too careful.', ('filter',), innovations),
    Spec('probabilities', 'Motion models', 'Probability of each model of the bank; one alone has probability 1.',
         ('filter', 'bank'), probabilities),
)
