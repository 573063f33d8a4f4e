"""HTML page of `pedestal calibrate drive`: friction, torques of recording and twin, and error of the encoder."""
import html
import typing
from collections.abc import Iterable

import numpy as np
from matplotlib.figure import Figure

from pedestal_analysis.calibration.drive import estimates, twin
from pedestal_analysis.report import elements, figures
from pedestal_analysis.report.figures import FILTERED_COLOUR, RAW_COLOUR, TRUTH_COLOUR, Spec, new_panels, thin

if typing.TYPE_CHECKING:
    from pedestal_analysis.calibration.drive.identified import Identified


def friction(result: 'Identified') -> Figure:
    """Return the figure with the torque at constant rates over the rate, and the fitted friction."""
    figure, panels = new_panels(1, 2, height=2.8, x=[f'{name} rate [rad/s]' for name in result.found],
                                y='torque on the load [Nm]')
    for axes, (name, found) in zip(panels.flat, result.found.items()):
        recording, first = result.recordings[0], result.first[name]
        motion = recording.motions[name]
        pieces = twin.constant_rates(motion, motion.load_torque(getattr(recording.drive, name)), first)
        known = {key: found[key][0] for key in ('coulomb', 'breakaway', 'stribeck_rate', 'viscous') if key in found}
        known = {'breakaway': known['coulomb'], 'stribeck_rate': 1.0, **known}
        constant = first['offset'][0] + (first['unbalance'][0] * np.cos(pieces[:, 2]) if 'unbalance' in first else 0.0)
        axes.semilogx(np.abs(pieces[:, 0]), np.sign(pieces[:, 0]) * (pieces[:, 1] - constant), '.', color=RAW_COLOUR)
        low, high = np.quantile(np.abs(pieces[:, 0]), (0.0, 1.0))
        rates = np.geomspace(low, high, 100)
        axes.semilogx(rates, estimates.friction_torque(rates, **known), color=FILTERED_COLOUR)
        axes.margins(0.05)
    return figure


def torques(result: 'Identified') -> Figure:
    """Return the figure with the torque of the motors in the recording and in the twin, of both axes."""
    figure, panels = new_panels(len(result.found), y=[f'{name}\nmotor torque [Nm]' for name in result.found])
    twins = twin.replayed(result.recordings[0], result.changes)
    for axes, (name, true) in zip(panels.flat, result.recordings[0].motions.items()):
        for motion, colour, label in ((true, TRUTH_COLOUR, 'recording'), (twins[name], FILTERED_COLOUR, 'twin')):
            axes.plot(*thin(motion.t, motion.motor_torque.sum(1)), color=colour, label=label)
    return figures.outside_legend(figure, panels[0, 0])


def encoder(result: 'Identified') -> Figure:
    """Return the figure with the error of the load encoders over the angle; the axes without a turn stay empty."""
    figure, panels = new_panels(1, 2, height=2.6, x=[f'{name} [deg]' for name in result.maps],
                                y='load encoder less motors [mdeg]')
    for axes, table in zip(panels.flat, result.maps.values()):
        axes.plot(np.degrees(table[:, 0]), 1e3 * np.degrees(table[:, 1]), '.-', color=FILTERED_COLOUR)
        axes.margins(0.05)
    return figure


FIGURES = (
    Spec('friction', 'Friction', 'Points: torque on the load at constant rates, in the direction of the motion, less '
         'the torques of inertia, gravity and wind. Line: identified friction. At the slowest rates some points lie '
         'below the line, because the bristles of the friction still bend there.', (), friction),
    Spec('torques', 'Torques', 'Sum of the torques of both motors of an axis. Orange: recording. Blue: twin with the '
         'values of the parameter file, which receives the same commands.', (), torques),
    Spec('encoder', 'Error of the load encoders', 'Load encoder less the mean of the motor encoders, mean of both '
         'directions. The first second of a turn is left out. Empty without a turn.', (), encoder))
"""Figures of the page."""


def page(result: 'Identified', printed: Iterable[str], command: str) -> str:
    """Return the HTML page of a calibration; printed: lines of its table; command: the command line."""
    return elements.page('Drive calibration', [
        f'<h1>Drive calibration: {html.escape(result.source)}</h1>', f'<p class="soft">{html.escape(command)}</p>',
        f'<pre style="font-size: .72rem; white-space: pre-wrap">{html.escape(chr(10).join(printed))}</pre>',
        *(elements.figure(spec, result) for spec in FIGURES)])
