"""Ma 2023's step and sine (figures 5, 6), then a better controller on the same plant.

The plant is the azimuth axis with two motors, gears and load. The paper prints a sine of "0.4 rad/s", which is read in
two ways: 0.4 Hz (paper-r1) and 0.4 rad/s (paper-r2). The case paper-all has the controller of the paper with gains for
all numbers of figures 5 and 6. The case best has feed-forward. The case best-full-torque has no reserve for a heavier
load. `pedestal run servo_step|servo_sine --param ...` runs every case too (Variant.command).
"""
import functools
import math
from collections.abc import Callable, Iterable
from typing import TypeAlias

import numpy as np
from matplotlib.figure import Figure

from drive_law.params import AduParameters
from pedestal_bringup.loop import closed_loop
from pedestal_bringup.loop.closed_loop import Run
from pedestal_bringup.scenario.variant import Variant
from pedestal_common.quantities import Floats, Json, Radians, RadiansPerSecond, Row, Seconds
from pedestal_results import metrics, tracking
from pedestal_results.intervals import row
from pedestal_results.report import figures as fig
from pedestal_studies.result import Drawings, Result, draw_torques, legend
from pedestal_workbench.trials.monte_carlo import Progress

Runs: TypeAlias = dict[tuple[str, str], Run]    # {(case, kind of run): its run}

STEP_SIZE_RAD = 0.174  # step of figure 5 [rad]
SINE_AMPLITUDE_RAD = 0.87  # amplitude of figure 6 [rad]
SINE_FREQUENCIES_RAD_S = {'0p4hz': 0.8 * math.pi, '0p4rads': 0.4}  # two readings of the paper's sine [rad/s]
SINE_READINGS = {'0p4hz': '0.4 Hz', '0p4rads': '0.4 rad/s'}  # {reading of the paper's sine: label in a figure}
SINE_PERIODS = 4  # periods of each sine, of which the first belongs to the transient
GUST_TORQUE_NM, GUST_START_S = 1000.0, 0.2  # step of wind torque on the azimuth [Nm] and its start [s]
SETTLING_BAND = 0.02  # half-width of the band of the settling time, divided by the step

PAPER_R1_PARAMETERS: dict[str, float] = {}  # the scenarios have the gains for 0.4 Hz

PAPER_R2_PARAMETERS = {'acu.azimuth.pid.bandwidth': 8.75, 'acu.azimuth.pid.derivative': 0.0}

PAPER_ALL_PARAMETERS = {'acu.azimuth.pid.bandwidth': 54.0, 'acu.azimuth.pid.derivative': 0.45,
                        'adu.azimuth.speed_loop.proportional': 1.5, 'adu.azimuth.speed_loop.integral': 7.0}
"""Gains that a search found, because the paper prints none.

A position loop K e + D e' before a rate loop of type 1 does not reach the amplitude of the sine. The shortfall is
(1 + 2 D) (w / K)^2 / 2, which is 0.2 % with paper-r1. A slow rate loop with the time constant tau = J / K_p reduces
the shortfall by tau w^2 / K. K, D: bandwidth [1/s] and derivative gain [-] of the pid; e: position error, e': its
rate; w: frequency of the sine [rad/s]; J: inertia; K_p: proportional gain of the speed loop.
"""

DRIVE_PARAMETERS = {  # speed loop and bias torque of the cases best and adrc
    'adu.azimuth.speed_loop.proportional': 8.0, 'adu.azimuth.speed_loop.integral': 50.0,
    'adu.azimuth.bias.schedule': 'hold_fade', 'adu.azimuth.bias.torque': 12.0, 'adu.azimuth.bias.hold': 14.0,
    'adu.azimuth.bias.out': 45.0}

SHAPER_PARAMETERS = {  # a quarter of the torque remains for a load heavier than assumed
    'acu.azimuth.shaper.rate': 2.42, 'acu.azimuth.shaper.acceleration': 31.0, 'acu.azimuth.shaper.jerk': 8000.0,
    'acu.azimuth.shaper.h0': 0.006}

BEST_PARAMETERS = {
    **DRIVE_PARAMETERS, **SHAPER_PARAMETERS, 'adu.azimuth.speed_loop.disturbance_observer': 400.0,
    'acu.azimuth.controller': 'feedforward', 'acu.azimuth.feedforward.bandwidth': 30.0,
    'acu.azimuth.feedforward.integral': 0.2}
"""Controller of the case best.

After a shock that opens the lash, the loop stays stable if any one gain is multiplied by up to 1.3. Above this factor
(for example a bandwidth of 45 rad/s) the closing of the lash takes so much torque that the bias torque stays faded
out. The lash then opens again, in a limit cycle of some mrad. A faster observer (600 rad/s) reduces the effect of the
gust by 6 % and lets the load ring on the gear for 0.2 s.
"""

FULL_TORQUE_PARAMETERS = {**BEST_PARAMETERS, 'acu.azimuth.shaper.acceleration': 38.0,
                          'acu.azimuth.shaper.jerk': 4000.0, 'acu.azimuth.shaper.h0': 0.01}

ADRC_PARAMETERS = {**DRIVE_PARAMETERS, **SHAPER_PARAMETERS, 'adu.azimuth.speed_loop.proportional': 6.0,
                   'adu.azimuth.speed_loop.integral': 200.0, 'acu.azimuth.controller': 'adrc'}
"""ADRC, and the speed loop for which it was designed. The observer of the ADRC replaces the observer of the drive."""

CASE_PARAMETERS: dict[str, dict[str, Json]] = {
    'paper-r1': PAPER_R1_PARAMETERS, 'paper-r2': PAPER_R2_PARAMETERS, 'paper-all': PAPER_ALL_PARAMETERS,
    'best': BEST_PARAMETERS,
    'best-inertia-plus': {**BEST_PARAMETERS, 'adu.azimuth.load.inertia': 252.0},
    'best-inertia-minus': {**BEST_PARAMETERS, 'adu.azimuth.load.inertia': 168.0},
    'best-full-torque': FULL_TORQUE_PARAMETERS, 'adrc': ADRC_PARAMETERS}
"""{case: parameters}; 252 and 168 kg m2 are 20 % more and less than the inertia of the load, 210 kg m2."""

METRIC_TARGETS = {  # {case: {metric: target}}; target: 'value +- tolerance', 'low to high', or a limit
    **{name: {'step_overshoot_percent': '12 +- 1.5', 'step_settling_2percent_s': '0.20 +- 0.03',
              'step_crossings': '1 +- 0', 'sine_0p4hz_max_error_rad': '0.0397 +- 0.002',
              'sine_0p4hz_rms_error_rad': '0.0281 +- 0.001', 'sine_0p4hz_amplitude_rad': '0.868 to 0.8695',
              'sine_0p4hz_peak_error_percent': '< 0.12', 'sine_0p4hz_max_error_percent': '< 4.6'}
       for name in ('paper-r1', 'paper-all')},
    'paper-r2': {'sine_0p4rads_max_error_rad': '0.0397 +- 0.002', 'sine_0p4rads_rms_error_rad': '0.0281 +- 0.001',
                 'sine_0p4rads_amplitude_rad': '0.868 to 0.8695', 'sine_0p4rads_peak_error_percent': '< 0.12',
                 'sine_0p4rads_max_error_percent': '< 4.6'},
    'best': {'step_overshoot_percent': '<= 0.5', 'step_settling_2percent_s': '<= 0.15',
             'sine_0p4rads_max_error_rad': '<= 5e-5', 'sine_0p4rads_start_error_rad': '<= 4e-3',
             'sine_0p4hz_max_error_rad': '<= 3e-4', 'gust_1000nm_peak_rad': '<= 3.4e-4'},
    'best-inertia-plus': {'step_overshoot_percent': '<= 0.5', 'step_settling_2percent_s': '<= 0.15'},
    'best-inertia-minus': {'step_overshoot_percent': '<= 0.5', 'step_settling_2percent_s': '<= 0.15'},
}
PAPER_VALUES = {'step_overshoot_percent': 12.0, 'step_settling_2percent_s': 0.2, 'max_error_rad': 0.04,
                'rms_error_rad': 0.0281, 'amplitude_rad': 0.869, 'peak_error_percent': 0.12, 'max_error_percent': 4.6}
SUFFIX_UNITS = {'percent': '%', 's': 's', 'rad': 'rad', 'crossings': ''}  # {last word of a metric: unit}


def step_case(name: str) -> Variant:
    """Return the variant of the step of figure 5 with the parameters of CASE_PARAMETERS[name]."""
    return Variant('servo_step').with_(CASE_PARAMETERS[name])


def of_sine(variant: Variant, w: RadiansPerSecond, periods: float) -> Variant:
    """Return the variant with a target that moves in a sine of w for a number of periods.

    The duration is up to 12 ms longer, so that the last period is complete.
    """
    step = 0.002
    duration = math.ceil((2.0 * math.pi * periods / w + 0.01) / step) * step
    return variant.with_({'tracking_receiver.target.angle.frequency': w / (2.0 * math.pi)},
                         duration=round(duration, 3))


def sine_case(name: str, reading: str) -> Variant:
    """Return the variant of SINE_PERIODS periods of the paper's sine; reading: key of SINE_READINGS."""
    return of_sine(Variant('servo_sine').with_(CASE_PARAMETERS[name]), SINE_FREQUENCIES_RAD_S[reading], SINE_PERIODS)


def gust_case(name: str, **more: Json) -> Variant:
    """Return the variant of an axis at rest with a step of wind torque; more: further parameters."""
    return Variant('servo_step').with_({
        **CASE_PARAMETERS[name], 'acu.azimuth.preset': 0.0, 'adu.wind.gust.kind': 'step',
        'adu.wind.gust.azimuth': GUST_TORQUE_NM, 'adu.wind.gust.start': GUST_START_S, **more})


def step_metrics(record: Run) -> dict[str, float]:
    """Return {metric: value} of the run of a step."""
    t, y = record.t, record['adu/truth']['position'][:, 0]
    return {'step_overshoot_percent': metrics.overshoot_percent(y, STEP_SIZE_RAD),
            'step_settling_2percent_s': metrics.settling_time(t, y, STEP_SIZE_RAD, SETTLING_BAND),
            'step_crossings': metrics.crossings(y, STEP_SIZE_RAD)}


def sine_error(record: Run, w: RadiansPerSecond) -> Floats:
    """Return the sine of figure 6 at w minus the true load angle [rad]."""
    return SINE_AMPLITUDE_RAD * np.sin(w * record.t) - record['adu/truth']['position'][:, 0]


def sine_metrics(record: Run, reading: str) -> dict[str, float]:
    """Return {metric: value} of a run of one of SINE_READINGS of the sine."""
    w = SINE_FREQUENCIES_RAD_S[reading]
    t, error, period = record.t, sine_error(record, w), 2.0 * math.pi / w
    steady = metrics.whole_periods(t, period, period)
    amplitude, fitted = metrics.amplitude_and_period(t[steady], record['adu/truth']['position'][steady, 0], period)
    largest = metrics.peak(error[steady])
    return {f'sine_{reading}_max_error_rad': largest,
            f'sine_{reading}_max_error_percent': 100.0 * largest / SINE_AMPLITUDE_RAD,
            f'sine_{reading}_peak_error_percent': 100.0 * abs(1.0 - amplitude / SINE_AMPLITUDE_RAD),
            f'sine_{reading}_rms_error_rad': tracking.rms(error[steady]),
            f'sine_{reading}_amplitude_rad': amplitude, f'sine_{reading}_period_s': fitted,
            f'sine_{reading}_start_error_rad': metrics.peak(error[t < period])}


def gust_metrics(record: Run) -> dict[str, float]:
    """Return {metric: value} of the run of a gust."""
    t, y = record.t, record['adu/truth']['position'][:, 0]
    return {'gust_1000nm_peak_rad': metrics.peak(y[t >= GUST_START_S] - y[t < GUST_START_S][-1])}


CASE_RUNS = {  # {case: kinds of its runs}: step, sine of one reading, gust
    'paper-r1': ('step', '0p4hz', '0p4rads', 'gust'), 'paper-r2': ('step', '0p4rads'),
    'paper-all': ('step', '0p4hz'),
    'best': ('step', '0p4rads', '0p4hz', 'gust'), 'best-inertia-plus': ('step',),
    'best-inertia-minus': ('step',), 'best-full-torque': ('step',),
    'adrc': ('step', '0p4rads', '0p4hz', 'gust'),
}


def records(cases: Iterable[str], progress: Progress) -> Runs:
    """Run the named cases."""
    wanted = [(name, kind) for name in cases for kind in CASE_RUNS[name]]
    done = {}
    for i, (name, kind) in enumerate(wanted):
        progress(i / len(wanted), f'{name}: {kind}')
        case = step_case(name) if kind == 'step' else gust_case(name) if kind == 'gust' else sine_case(name, kind)
        done[name, kind] = closed_loop.Loop(case.load()).run()
    return done


RUN_METRICS: dict[str, Callable[[Run], dict[str, float]]] = {
    'step': step_metrics, 'gust': gust_metrics,
    **{reading: functools.partial(sine_metrics, reading=reading) for reading in SINE_FREQUENCIES_RAD_S}}


def rows(done: Runs) -> list[Row]:
    """Return the rows of the study."""
    return [row(name, metric, value, SUFFIX_UNITS[metric.rpartition('_')[2]],
                PAPER_VALUES.get(metric.removeprefix(f'sine_{kind}_')),
                METRIC_TARGETS.get(name, {}).get(metric))
            for (name, kind), record in done.items() for metric, value in RUN_METRICS[kind](record).items()]


def bang_bang(step: Radians, adu: AduParameters) -> tuple[Seconds, Seconds]:
    """Return (time of the whole move, time to its 2 % band) of the fastest rest-to-rest move of the azimuth.

    The motors have full torque forwards, then backwards. Coulomb friction opposes the acceleration and supports the
    deceleration.
    """
    p = adu.azimuth
    N = p.gear_train.ratio
    J = p.load.inertia + N * N * (p.motor_1.inertia + p.motor_2.inertia)
    T = N * (p.motor_1.torque_limit + p.motor_2.torque_limit)
    friction = p.friction.coulomb + N * (p.motor_1.friction + p.motor_2.friction)
    up, down = (T - friction) / J, (T + friction) / J
    whole = math.sqrt(2.0 * step * (1.0 / up + 1.0 / down))
    return whole, whole - math.sqrt(2.0 * SETTLING_BAND * step / down)


def remarks(done: Runs) -> list[str]:
    """Return the sentences that explain the rows, with the limits of the plant."""
    slow = step_metrics(done['paper-r2', 'step'])['step_settling_2percent_s']
    adu = step_case('best').load().node_parameters('adu')
    whole, settled = bang_bang(STEP_SIZE_RAD, adu)
    gear, bits = adu.azimuth.gear_train, adu.azimuth.encoder.load_bits
    stiffness, damping = 2.0 * gear.stiffness, 2.0 * gear.damping
    zeta = 0.5 * damping / math.sqrt(stiffness * adu.azimuth.load.inertia)
    swing = GUST_TORQUE_NM / stiffness * (1.0 + math.exp(-math.pi * zeta / math.sqrt(1.0 - zeta * zeta)))
    return [
        'The cases paper-... have the controller of the paper, which prints no gains: paper-r1 those of servo_step '
        'and servo_sine, for a sine of 0.4 Hz; paper-r2 gains for a sine of 0.4 rad/s; paper-all gains for all '
        'numbers of both figures, with a sine of 0.4 Hz.',
        "If the paper's sine is 0.4 rad/s, one controller cannot give the numbers of both figures. An error of "
        f'0.04 rad needs a gain of {SINE_AMPLITUDE_RAD * 0.4 / 0.04:.2g} 1/s (paper-r2), with which the step takes '
        f'{slow:.3f} s instead of 0.2 s. If the sine is 0.4 Hz, paper-all gives all printed numbers, also the peak of '
        'the sine to 0.12 %. paper-r1 misses the peak.',
        'peak_error_percent is the shortfall of the amplitude (0.869 of 0.87 rad). max_error_percent is the largest '
        'error after the first period over the amplitude. The mean square error of 2.81 % is read as 0.0281 rad rms.',
        f'The 0.4 Hz sine starts with {SINE_AMPLITUDE_RAD * SINE_FREQUENCIES_RAD_S["0p4hz"]:.2f} rad/s, the load from '
        'rest. The torque determines the error v^2 / (2 a) of this start, which no controller removes.',
        f'Limit of the step: torque. Full torque forwards and back takes {whole:.3f} s, {settled:.3f} s to the 2 % '
        'band. best keeps a quarter of the torque for a load heavier than assumed, best-full-torque does not.',
        f'Limit of the gust: the gear. {GUST_TORQUE_NM:g} Nm bend the two meshes by '
        f'{GUST_TORQUE_NM / stiffness:.1e} rad. The load swings to {swing:.1e} rad on the meshes with motors that do '
        'not move at all. The aim of 2e-4 rad is not reached. A faster observer (600 rad/s) reaches 2.1e-4 rad and '
        'rings.',
        f'Limit of the sine: the encoder step, {2.0 * math.pi / 2**bits:.1e} rad, and, where the rate changes its '
        'sign, the difference between the friction and the friction fed forward.',
    ]


CASE_COLOURS = {
    'paper-r1': fig.TRUTH_COLOUR, 'paper-r2': fig.RAW_COLOUR, 'best': fig.FILTERED_COLOUR, 'adrc': fig.MOTOR_2_COLOUR,
    'best-inertia-plus': fig.TRUTH_COLOUR, 'best-inertia-minus': fig.MOTOR_1_COLOUR}


def figures(done: Runs) -> Drawings:
    """Return the figures of the runs of all cases."""
    return {'step': lambda: step_figure(done), 'sine': lambda: sine_figure(done), 'gust': lambda: gust_figure(done),
            'inertia': lambda: inertia_figure(done)}


def step_figure(done: Runs) -> Figure:
    """Draw figure 5: the load's angle, and the torque of both motors below."""
    names = ('paper-r1', 'paper-r2', 'best')
    figure, axes = fig.new_panels(4, height=8.0, y=('azimuth [rad]', *3 * ['torque [Nm]']), sharex=True,
                                  height_ratios=(2.2, 1, 1, 1))
    top = axes[0, 0]
    top.axhline(STEP_SIZE_RAD, color=fig.INK_COLOUR, linewidth=0.8, linestyle='--', label='reference')
    for name, below in zip(names, axes[1:, 0]):
        record = done[name, 'step']
        t = record.t
        top.plot(t, record['adu/truth']['position'][:, 0], color=CASE_COLOURS[name], linewidth=1.4, label=name)
        draw_torques(below, record)
        below.set_title(f'{name}: torque of the motors')
        below.set_ylim(-100.0, 100.0)
    top.set_xlim(0.0, 0.6)
    top.set_title('step of 0.174 rad (figure 5 of the paper)')
    return legend(figure)


def sine_figure(done: Runs) -> Figure:
    """Draw figure 6: reference and load, errors of the paper's controllers, and the error of best on its own scale."""
    figure, axes = fig.new_panels(3, height=7.0, x='time [periods of the sine]', sharex=True,
                                  height_ratios=(1.4, 1.2, 1),
                                  y=('azimuth [rad]', 'error [mrad]', 'error [\N{MICRO SIGN}rad]'))
    period = 2.0 * math.pi / SINE_FREQUENCIES_RAD_S['0p4hz']
    record = done['paper-r1', '0p4hz']
    t = record.t / period
    axes[0, 0].plot(t, SINE_AMPLITUDE_RAD * np.sin(SINE_FREQUENCIES_RAD_S['0p4hz'] * record.t), color=fig.INK_COLOUR,
                    linestyle='--', label='reference')
    axes[0, 0].plot(t, record['adu/truth']['position'][:, 0], color=fig.TRUTH_COLOUR, linewidth=1.4,
                    label='paper-r1, 0.4 Hz')
    axes[0, 0].set_title('sine of 0.87 rad (figure 6 of the paper)')
    for name, reading, colour, style, scale, panel in (
            ('paper-r1', '0p4hz', fig.TRUTH_COLOUR, '-', 1e3, 1),
            ('paper-r2', '0p4rads', fig.INK_COLOUR, '--', 1e3, 1),
            ('best', '0p4hz', fig.FILTERED_COLOUR, '-', 1e6, 2),
            ('best', '0p4rads', fig.MOTOR_1_COLOUR, '-', 1e6, 2)):
        record, w = done[name, reading], SINE_FREQUENCIES_RAD_S[reading]
        axes[panel, 0].plot(record.t * w / (2.0 * math.pi), scale * sine_error(record, w), style, color=colour,
                            label=f'{name}, {SINE_READINGS[reading]}')
    axes[2, 0].set_title('best, with its start outside the scale')
    axes[2, 0].set_ylim(-100.0, 100.0)
    axes[2, 0].set_xlim(0.0, SINE_PERIODS)
    return legend(figure)


def gust_figure(done: Runs) -> Figure:
    """Draw the deflection of the load by the gust."""
    figure, axes = fig.new_panels(1, height=3.4, y='deflection of the azimuth [\N{MICRO SIGN}rad]')
    axes = axes[0, 0]
    for name in ('paper-r1', 'adrc', 'best'):
        record = done[name, 'gust']
        y = record['adu/truth']['position'][:, 0]
        axes.plot(record.t, 1e6 * (y - y[record.t < GUST_START_S][-1]), color=CASE_COLOURS[name], linewidth=1.3,
                  label=name)
    stiffness = 2.0 * step_case('best').load().node_parameters('adu').azimuth.gear_train.stiffness
    axes.axhline(1e6 * GUST_TORQUE_NM / stiffness, color=fig.INK_COLOUR, linewidth=0.8, linestyle='--',
                 label='deflection of the gear by the gust torque')
    axes.set_xlim(GUST_START_S - 0.05, GUST_START_S + 0.5)
    axes.set_title(f'gust: a step of {GUST_TORQUE_NM:g} Nm at {GUST_START_S:g} s')
    return legend(figure)


def inertia_figure(done: Runs) -> Figure:
    """Draw the end of the step of best with 20 % more and 20 % less load inertia, and the torque of the motors."""
    figure, axes = fig.new_panels(2, height=5.2, y=('azimuth - 0.174 rad [mrad]', 'torque [Nm]'), sharex=True)
    for name, label in (('best-inertia-minus', 'load 20 % lighter'), ('best', 'load as assumed'),
                        ('best-inertia-plus', 'load 20 % heavier')):
        record = done[name, 'step']
        axes[0, 0].plot(record.t, 1e3 * (record['adu/truth']['position'][:, 0] - STEP_SIZE_RAD),
                        color=CASE_COLOURS[name], label=label)
        torque = record['adu/motor_states']['effort'][:, :2].mean(axis=1)
        axes[1, 0].plot(record.t, torque, color=CASE_COLOURS[name], label=label)
    for side in (-SETTLING_BAND, SETTLING_BAND):
        axes[0, 0].axhline(1e3 * side * STEP_SIZE_RAD, color=fig.INK_COLOUR, linewidth=0.8, linestyle='--')
    axes[0, 0].set_xlim(0.0, 0.3)
    axes[0, 0].set_ylim(-8.0, 6.0)
    axes[0, 0].set_title('step of best: the end of the move, 2 % band dashed')
    axes[1, 0].set_title('mean torque of the two motors')
    return legend(figure)


def run(progress: Progress) -> Result:
    """Run all CASE_PARAMETERS."""
    done = records(CASE_PARAMETERS, progress)
    return Result(rows(done), figures(done), remarks(done))
