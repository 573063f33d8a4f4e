"""Frequency response of the current, speed and position loops, measured by multisine on the simulated plant.

The dashed line of a figure is the open loop for which the gains were designed. Sampling, delay and elasticity cause
the difference between the design and the measurement. The open loops of the design are

    w_c / s                     current loop; w_c: bandwidth [rad/s]
    (K_p + K_i / s) / (J s)     speed loop of a rigid drive; J: inertia at the motor
    K_p / s + K_i / s^2         position loop
"""
import dataclasses
import functools
import math
from collections.abc import Callable, Mapping
from typing import TypeAlias

import numpy as np
from matplotlib.figure import Figure

from acu_tracker.params import AcuParameters
from drive_law.params import AduParameters
from pedestal_bringup.scenario.variant import Variant
from pedestal_common.graph.topics import AXES
from pedestal_common.multisine import Sweep
from pedestal_common.quantities import Complexes, Floats, Json, Row
from pedestal_results.intervals import row
from pedestal_results.report import figures as fig
from pedestal_studies.p000_ma import servo
from pedestal_studies.result import Drawings, Result, legend
from pedestal_workbench.trials.monte_carlo import Progress
from pedestal_workbench.tuning import frequency_response as frequency
from pedestal_workbench.tuning.frequency_response import Response

Design: TypeAlias = Callable[[Complexes], Complexes]    # function of s that returns the open loop of the design


def _moving(source: str, changes: Mapping[str, Json]) -> Variant:
    return frequency.moving(Variant(source).with_(changes))


def controller(name: str) -> Variant:
    """Return the variant of scenario leo_pass in which both axes have the position controller of this name."""
    return _moving('leo_pass', {f'acu.{axis}.controller': name for axis in AXES})


FAST_LOOP_PARAMETERS = {'acu.azimuth.feedforward.bandwidth': 40.0}  # position loop of higher bandwidth
STRUCTURE_PARAMETERS = {**FAST_LOOP_PARAMETERS, 'adu.azimuth.structure.inertia_share': 0.5,
                        'adu.azimuth.structure.frequency': 8.0}
NOTCH_PARAMETERS = {**STRUCTURE_PARAMETERS, 'acu.azimuth.notch.frequency': 7.5, 'acu.azimuth.notch.width': 0.5,
                    'acu.azimuth.notch.depth': 0.3}
"""Position loop of higher bandwidth with a flexible load and a notch at the resonance of the loop without notch."""

LOOP_CASES = {
    'pid': (controller('pid'), AXES), 'feedforward': (controller('feedforward'), AXES),
    'adrc': (controller('adrc'), AXES),
    'paper-r1': (_moving('servo_sine', servo.PAPER_R1_PARAMETERS), AXES[:1]),
    'best': (_moving('servo_sine', servo.BEST_PARAMETERS), AXES[:1]),
    'rigid': (_moving('leo_pass', FAST_LOOP_PARAMETERS), AXES[:1]),
    'structure': (_moving('leo_pass', STRUCTURE_PARAMETERS), AXES[:1]),
    'structure-notch': (_moving('leo_pass', NOTCH_PARAMETERS), AXES[:1])}
"""{name of a position loop: (its Variant, the axes on which it is measured)}.

pid, feedforward, adrc: the controllers with their defaults. paper-r1, best: cases of the study servo. rigid,
structure, structure-notch: a faster loop with a rigid load, a flexible load, and a flexible load with a notch.
"""

MARGIN_BAND_FACTOR = math.sqrt(10.0)
"""Band about crossover in which a loop must be linear, because the margins are read there: |L| within this factor of
1, +-10 dB."""


MAX_DRAWN_DEVIATION = 0.2
"""Relative standard deviation of a measured response above which a frequency is not drawn [-]."""


def nonlinearity(measured: Response, smaller: Response) -> float:
    """Return the largest relative change of L between a larger and a smaller excitation, within MARGIN_BAND_FACTOR."""
    change = np.abs(smaller.open_loop / measured.open_loop - 1.0)
    return float(change[np.abs(np.log(np.abs(measured.open_loop))) < math.log(MARGIN_BAND_FACTOR)].max())


def rows(responses: Mapping[str, Response]) -> list[Row]:
    """Return the rows of the margins of {name of a loop: response}."""
    return [row(name, metric, value, unit) for name, measured in responses.items()
            for metric, (value, unit) in frequency.margins(measured).items()]


def without_gain_margin(responses: Mapping[str, Response]) -> list[str]:
    """Return a line on the loops of {name: response} that have no gain margin in the measured band."""
    return frequency.without_gain_margin([name for name, measured in responses.items()
                                          if math.isnan(frequency.margins(measured)['gain_margin_db'][0])])


def position(loop: str, sweep: Sweep = frequency.POSITION_SWEEP) -> dict[str, Response]:
    """Return {'position/AXIS/LOOP': response} of one of LOOP_CASES."""
    variant, axes = LOOP_CASES[loop]
    return {f'{name}/{loop}': found for name, found in frequency.position(variant, axes, sweep).items()}


def run(progress: Progress) -> Result:
    """Measure all loops, each with full and with half excitation to test that it is linear."""
    drive = AduParameters()
    parts = {'current loops': (functools.partial(frequency.current, drive), frequency.CURRENT_SWEEP),
             'speed loops': (functools.partial(frequency.speed, drive), frequency.SPEED_SWEEP)}
    parts |= {f'position loop {name}': (functools.partial(position, name), frequency.POSITION_SWEEP)
              for name in LOOP_CASES}
    responses: dict[str, frequency.Response] = {}
    change: dict[str, float] = {}
    for i, (text, (measure, sweep)) in enumerate(parts.items()):
        progress(i / len(parts), text)
        measured, smaller = measure(sweep), measure(dataclasses.replace(sweep, peak=0.5 * sweep.peak))
        change |= {name: nonlinearity(measured[name], smaller[name]) for name in measured}
        responses |= measured
    worst = max(change, key=change.__getitem__)
    remarks = [f'The loops are linear: with half the excitation no open loop changes by more than '
               f'{100.0 * change[worst]:.1f} % within 10 dB of |L| = 1 (largest change: {worst}).',
               *without_gain_margin(responses)]
    return Result(rows(responses), drawings(responses, drive), remarks)


def drawings(responses: Mapping[str, Response], drive: AduParameters) -> Drawings:
    """Return the figures; responses as of `rows`."""
    p, c = drive.azimuth, AcuParameters().azimuth.feedforward
    w_c = 2.0 * math.pi * p.current_loop.bandwidth
    # At its shaft, each of the two motors moves its own inertia and half of the load.
    J = p.motor_1.inertia + 0.5 * p.load.inertia / p.gear_train.ratio ** 2

    def chosen(title: str, curves: Mapping[str, tuple[str, str]],
               design: Design | None = None) -> Callable[[], Figure]:
        measured = {label: (responses[name], colour) for label, (name, colour) in curves.items()}
        return lambda: bode_figure(title, measured, design)

    return {
        'current': chosen('current loops of the azimuth motors',
                          {'motor 1': ('current/motor_1', fig.MOTOR_1_COLOUR),
                           'motor 2': ('current/motor_2', fig.MOTOR_2_COLOUR)},
                          lambda s: w_c / s),
        'speed': chosen('speed loops',
                        {'azimuth': ('speed/azimuth', fig.FILTERED_COLOUR),
                         'elevation': ('speed/elevation', fig.TRUTH_COLOUR)},
                        lambda s: (p.speed_loop.proportional + p.speed_loop.integral / s) / (J * s)),
        'position': chosen('position loops',
                           {'feed-forward (and pid), azimuth': ('position/azimuth/feedforward', fig.FILTERED_COLOUR),
                            'feed-forward (and pid), elevation': ('position/elevation/feedforward', fig.TRUTH_COLOUR),
                            'adrc, azimuth': ('position/azimuth/adrc', fig.MOTOR_2_COLOUR)},
                           lambda s: c.bandwidth / s + c.integral * c.bandwidth ** 2 / s ** 2),
        'structure': chosen('position loop, azimuth, with a flexible load',
                            {'rigid': ('position/azimuth/rigid', fig.RAW_COLOUR),
                             'flexible': ('position/azimuth/structure', fig.TRUTH_COLOUR),
                             'flexible, notch': ('position/azimuth/structure-notch', fig.FILTERED_COLOUR)}),
        'paper': chosen('position loop, azimuth, of Ma 2023 and ours',
                        {'paper': ('position/azimuth/paper-r1', fig.RAW_COLOUR),
                         'best': ('position/azimuth/best', fig.FILTERED_COLOUR)})}


def decibel(x: Complexes) -> Floats:
    """Return the magnitude [dB] of x."""
    return 20.0 * np.log10(np.abs(x))


def degrees(x: Complexes) -> Floats:
    """Return the phase [deg] without jumps, the first in (-360, 0]."""
    phase = np.degrees(np.unwrap(np.angle(x)))
    return phase - 360.0 * math.ceil(phase[0] / 360.0)


def bode_figure(title: str, curves: Mapping[str, tuple[Response, str]], design: Design | None) -> Figure:
    """Draw Bode diagrams of the open and the closed loop of curves {label: (response, colour)}.

    Crosses mark the crossover, and the legend gives the margins. The first of two or more curves is drawn wide, so
    that it remains visible behind a curve that coincides with it.
    """
    figure, axes = fig.new_panels(2, 2, height=5.4, x='frequency [Hz]', y=('gain [dB]', 'phase [deg]'), sharex=True)
    figure.suptitle(title)
    for column, loop in enumerate(('open loop', 'closed loop')):
        gain, phase = axes[:, column]
        if design:
            f = next(iter(curves.values()))[0].frequency
            L = design(2j * math.pi * f.astype(complex))
            x = L / (1.0 + L) if column else L
            gain.semilogx(f, decibel(x), color=fig.INK_COLOUR, lw=0.8, ls='--', label='as designed')
            phase.semilogx(f, degrees(x), color=fig.INK_COLOUR, lw=0.8, ls='--')
        for i, (label, (measured, colour)) in enumerate(curves.items()):
            keep = measured.deviation < MAX_DRAWN_DEVIATION
            f, x = measured.frequency[keep], (measured.closed_loop if column else measured.open_loop)[keep]
            width = 3.2 if i == 0 and len(curves) > 1 else 1.1
            gain.semilogx(f, decibel(x), color=colour, lw=width, alpha=0.6 if width > 2.0 else 1.0,
                          label=f'{label}: {margin_text(measured)}')
            phase.semilogx(f, degrees(x), color=colour, lw=width, alpha=0.6 if width > 2.0 else 1.0)
            at = frequency.margins(measured)['crossover_hz'][0]
            if not column and math.isfinite(at):
                phase_there = float(np.interp(math.log(at), np.log(f), degrees(x)))
                gain.plot(at, 0.0, 'x', color=fig.INK_COLOUR, ms=6.0)
                phase.plot(at, phase_there, 'x', color=fig.INK_COLOUR, ms=6.0)
                phase.plot([at, at], [-180.0, phase_there], color=colour, lw=0.8, ls=':')
        gain.set_title(loop)
        gain.axhline(-3.0 if column else 0.0, color=fig.INK_COLOUR, lw=0.6, ls=':')
        gain.set_ylim(bottom=-40.0)
        if not column:
            phase.axhline(-180.0, color=fig.INK_COLOUR, lw=0.6, ls=':')
        phase.set_ylim(-360.0, 60.0)
        phase.set_yticks(np.arange(-360.0, 1.0, 90.0))
    return legend(figure)


def margin_text(measured: Response) -> str:
    """Return the gain and phase margin of a response in words, for a legend."""
    gain, phase = (frequency.margins(measured)[name][0] for name in ('gain_margin_db', 'phase_margin_deg'))
    parts = [f'{value:.0f} {unit}' for value, unit in ((gain, 'dB'), (phase, 'deg')) if math.isfinite(value)]
    return f'margins {", ".join(parts)}' if parts else 'no margin in the band'
