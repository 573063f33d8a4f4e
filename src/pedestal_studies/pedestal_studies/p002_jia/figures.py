"""Figures of the study phased-array: those of Jia 2025 for each smoothing, and figures of loops with a filter."""
from collections.abc import Callable, Mapping
from typing import Any, TypeAlias

import numpy as np
from matplotlib.figure import Figure

from pedestal_common.quantities import Floats, Seconds
from pedestal_results.report import figures as fig
from pedestal_studies.p002_jia.angle_loop import GRID_STEP_S, PaperLoop
from pedestal_studies.result import legend

Readings: TypeAlias = dict[str, tuple[Floats, Floats]]   # {smoothing: (error that the receiver measures, true error)}

LINE_COLOURS = (fig.FILTERED_COLOUR, fig.TRUTH_COLOUR, fig.MOTOR_2_COLOUR, fig.MOTOR_1_COLOUR, fig.INK_COLOUR)
SMOOTHING_TITLES = {'S0': 'S0, no smoothing', 'S1': 'S1, recursion', 'S2': 'S2, moving average'}


def side_by_side(rows: int, **options: Any) -> tuple[Figure, fig.Panels]:    # of new_panels, which has many
    """Return (figure, axes (rows, 3)) with a column for each smoothing."""
    figure, axes = fig.new_panels(rows, 3, height=1.2 + 2.4 * rows, width=9.6, sharey='row', sharex=True, **options)
    for column, title in zip(axes.T, SMOOTHING_TITLES.values()):
        column[0].set_title(title, fontsize=10)
    return figure, axes


def steps(done: Mapping[PaperLoop, Floats], label: Callable[[PaperLoop], str], title: str, seconds: Seconds) -> Figure:
    """Draw step responses {PaperLoop: beam over step} with a column for each smoothing; label: name of a loop."""
    figure, axes = side_by_side(1, y='beam over step')
    for panel, S in zip(axes[0], SMOOTHING_TITLES):
        loops = [loop for loop in done if loop.smoothing == S]
        for loop, colour in zip(loops, LINE_COLOURS):
            panel.step(GRID_STEP_S * np.arange(len(done[loop])), done[loop], color=colour, linewidth=1.2, where='post',
                       label=label(loop))
        panel.axhline(1.0, color=fig.INK_COLOUR, linewidth=0.6, linestyle='--')
        panel.set_xlim(0.0, seconds)
    axes[0, 0].set_ylim(-0.05, 2.3)
    figure.suptitle(title)
    return legend(figure)


def lags(done: Mapping[str, Readings], title: str, seconds: tuple[Seconds, Seconds]) -> Figure:
    """Draw errors {label: readings [rad]}, measured above true ones; seconds: (begin, end) of the drawn time."""
    figure, axes = side_by_side(2, y=('measured error [deg]', 'true error [deg]'))
    for (label, by_smoothing), colour in zip(done.items(), LINE_COLOURS):
        for column, S in zip(axes.T, SMOOTHING_TITLES):
            for panel, error in zip(column, by_smoothing[S]):
                window = round(seconds[0] / GRID_STEP_S), round(seconds[1] / GRID_STEP_S)
                error = np.degrees(error[slice(*window)])
                panel.plot(GRID_STEP_S * np.arange(*window), error, color=colour, linewidth=0.9, label=label)
    figure.suptitle(title)
    return legend(figure)


def stability(limits: Mapping[PaperLoop, tuple[int, int]]) -> Figure:
    """Draw the largest stable delays {PaperLoop: (by bisection, by eigenvalues) [ms]} over alpha and over slope."""
    figure, axes = fig.new_panels(1, 3, height=3.6, width=9.6, x=('alpha', 'alpha', 'true slope over assumed'),
                                  y='largest stable delay [ms]')
    for panel, T in zip(axes[0], (10, 5)):
        for S, colour in zip(SMOOTHING_TITLES, LINE_COLOURS):
            by_alpha = {loop.alpha: both for loop, both in limits.items() if loop.smoothing == S and loop.period == T
                     and loop.slope == 1.0 and loop.form == 'type_1'}
            panel.plot(list(by_alpha), [bisected for bisected, _ in by_alpha.values()], color=colour, label=S)
            panel.plot(list(by_alpha), [exact for _, exact in by_alpha.values()], 'o', color=colour, markersize=4)
        panel.set_title(f'T = {T} ms')
        panel.set_ylim(0.0, 220.0)
    by_slope = {loop.slope: both for loop, both in limits.items() if loop.alpha == 0.1 and loop.smoothing == 'S1'
             and loop.period == 10 and loop.form == 'type_1'}
    order = sorted(by_slope)
    axes[0, 2].plot(order, [by_slope[slope][0] for slope in order], color=fig.TRUTH_COLOUR)
    axes[0, 2].plot(order, [by_slope[slope][1] for slope in order], 'o', color=fig.TRUTH_COLOUR, markersize=4)
    axes[0, 2].set_title('alpha 0.1, T = 10 ms, S1')
    axes[0, 2].set_ylim(0.0, 220.0)
    figure.suptitle('largest stable delay: bisection (lines) and eigenvalues (dots)')
    return legend(figure)


def filter_loop_errors(errors: Mapping[str, Floats], seconds: tuple[Seconds, Seconds]) -> Figure:
    """Draw true errors {case: error [rad]} without noise, of the paper's loop and of loops with a filter."""
    figure, axes = fig.new_panels(3, height=7.6, y='largest error [deg]', sharex=True)
    lines = {'paper': fig.RAW_COLOUR, 'paper-delta': fig.INK_COLOUR, 'type-2': fig.MOTOR_2_COLOUR,
             'tracked-10ms': fig.MOTOR_1_COLOUR, 'best': fig.FILTERED_COLOUR}
    window = slice(*(round(t / GRID_STEP_S) for t in seconds))
    t = GRID_STEP_S * np.arange(window.start, window.stop)
    for panel, target, title in zip(axes[:, 0], ('ramp', 'sine', 'sway'),
                                    ('30 deg/s', 'sine of 30 deg/s and 10 deg/s2', 'sway of 10 deg in 8 s')):
        for loop, colour in lines.items():
            if target == 'sway' or loop != 'paper-delta':
                panel.semilogy(t, envelope(np.degrees(np.abs(errors[f'{loop}/{target}'][window]))), color=colour,
                               linewidth=1.1, label=loop)
        panel.set_title(title, fontsize=10)
        panel.set_ylim(1e-5, 1.0)
    axes[2, 0].semilogy(t, envelope(np.degrees(np.abs(errors['best/sway-ins'][window]))), color=fig.TRUTH_COLOUR,
                        linewidth=1.1, label='best with INS, 5 ms late')
    figure.suptitle('true error without noise, delay 20 ms (best has no error on the ramp)')
    return legend(figure)


def envelope(x: Floats, width: int = 10) -> Floats:
    """Return x with each block of `width` samples replaced by its largest sample; n: a multiple of `width`."""
    return np.repeat(np.maximum(x.reshape(-1, width).max(axis=1), 1e-9), width)


def loss(records: Mapping[str, Floats], seconds: tuple[Seconds, Seconds]) -> Figure:
    """Draw true errors {label: error [beamwidths]} of a loop that keeps the target and of a loop that loses it."""
    figure, axes = fig.new_panels(1, height=3.6, y='true error [beamwidths]')
    panel, window = axes[0, 0], slice(*(round(t / GRID_STEP_S) for t in seconds))
    for (label, error), colour in zip(records.items(), LINE_COLOURS):
        panel.plot(GRID_STEP_S * np.arange(window.start, window.stop), error[window], color=colour, linewidth=1.0,
                   label=label)
    for half in (-0.5, 0.5):
        panel.axhline(half, color=fig.INK_COLOUR, linewidth=0.8, linestyle='--')
    panel.set_ylim(-1.5, 1.5)
    panel.set_title('no signal beyond half a beamwidth (dashed)')
    return legend(figure)
