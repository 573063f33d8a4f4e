"""Study of backlash. Two motors turn an axis and pull against each other with a bias torque.

The bias torque closes the lash, which is the free play between pinion and bull gear. The study measures standstill,
reversals and fast moves with each schedule of the bias torque. The study also compares one speed loop for both motors
with a speed loop for each motor.

Three cases have the controller of Ma 2023, as in the scenarios. The sine and the fast step run with the controller
`best` of the study servo and with every schedule. `pedestal run servo_step|servo_sine --param ...` runs every case
too.
"""
import math

import numpy as np
from matplotlib.figure import Figure

from pedestal_bringup.loop import closed_loop
from pedestal_bringup.loop.closed_loop import Run
from pedestal_bringup.scenario.variant import Variant
from pedestal_common.quantities import Floats, Json, NewtonMeters, Radians, RadiansPerSecond, Row, Seconds, Times
from pedestal_results import metrics, tracking
from pedestal_results.intervals import row
from pedestal_results.report import figures as fig
from pedestal_studies.p000_ma import servo
from pedestal_studies.p000_ma.servo import Runs
from pedestal_studies.result import Drawings, Metrics, Result, draw_torques, legend
from pedestal_workbench.trials.monte_carlo import Progress

STANDSTILL_START_S = 2.0  # time after a step from which the standstill is evaluated [s]
REVERSAL_AMPLITUDE_RAD = 0.05  # amplitude of the sine of the reversals [rad]

REVERSAL_FREQUENCIES_RAD_S = {'reversal': 0.2, 'fast_reversal': 4.0}
"""Angular frequencies of the sine of the reversals [rad/s].

The slow sine shows the lash alone. The fast sine has a peak rate of 0.2 rad/s, at which friction adds to the error.
"""


def bias(schedule: str, torque: NewtonMeters = 12.0, hold: NewtonMeters = 14.0,
         out: NewtonMeters = 45.0) -> dict[str, Json]:
    """Return the parameters of a schedule of the bias torque, which depends on the demanded torque of one motor.

    off         no bias torque
    constant    the same bias torque at every demand
    fade        full at demand 0; it falls to 0 as the demand grows to the parameter `out`
    hold_fade   full up to the demand `hold`; it then falls to 0 at the demand `out`
    """
    return {'adu.azimuth.bias.schedule': schedule, 'adu.azimuth.bias.torque': torque,
            'adu.azimuth.bias.hold': hold, 'adu.azimuth.bias.out': out}


PAPER_CASES = {  # {case with the controller of the paper: parameters}
    'bias-off': bias('off'),
    'bias-on': {},                          # no change: the bias of the scenario, 5 Nm, fading, as in the paper
    'hold-fade': bias('hold_fade')}

BIAS_SCHEDULES = {  # {schedule: parameters}; the number in a name is the bias torque [Nm]
    'off': bias('off'), 'constant-5': bias('constant', torque=5.0), 'constant-12': bias('constant', torque=12.0),
    'fade-5': bias('fade', torque=5.0, hold=0.0, out=30.0), 'fade-12': bias('fade', torque=12.0, hold=0.0, out=30.0),
    'hold-fade': bias('hold_fade')}

SPEED_LOOP_STRUCTURES = {  # {case: parameters}
    'mean-speed': {'adu.azimuth.speed_loop.structure': 'mean'},
    'independent-loops': {'adu.azimuth.speed_loop.structure': 'independent'}}

METRIC_TARGETS = {  # {(case, metric): target}
    ('bias-off', 'standstill_peak_to_peak_rad'): '> 5e-4', ('bias-on', 'standstill_peak_to_peak_rad'): '< 2e-6',
    ('hold-fade', 'standstill_peak_to_peak_rad'): '< 2e-6', ('bias-on', 'reversal_ratio_off_to_on'): '> 30',
    ('hold-fade', 'reversal_ratio_off_to_on'): '> 30',
    ('hold-fade', 'sine_residual_rad'): '<= 1e-4', ('hold-fade', 'step_overshoot_percent'): '<= 2.5'}


def reversal_case(kind: str, name: str) -> Variant:
    """Return the variant of three periods of a sine. kind: key of REVERSAL_FREQUENCIES_RAD_S; name: key of
    PAPER_CASES."""
    return servo.of_sine(Variant('servo_sine').with_({
        **PAPER_CASES[name], 'tracking_receiver.target.angle.azimuth_amplitude': REVERSAL_AMPLITUDE_RAD}),
        REVERSAL_FREQUENCIES_RAD_S[kind], 3)


FAST_STEP_PARAMETERS = {**servo.FULL_TORQUE_PARAMETERS, 'acu.azimuth.shaper.acceleration': 40.0}

MOVE_DURATION_S = 0.5  # time at which the step of the cases SPEED_LOOP_STRUCTURES is over [s]


def standstill(record: Run) -> tuple[Times, Floats]:
    """Return (times, load angle [rad]) from STANDSTILL_START_S on."""
    late = record.t >= STANDSTILL_START_S
    return record.t[late], record['adu/truth']['position'][late, 0]


def steady_residual(record: Run, amplitude: Radians, w: RadiansPerSecond) -> tuple[Times, Floats]:
    """Return (times, error [rad] without its part at the frequency w of the sine), over whole later periods."""
    t, period = record.t, 2.0 * math.pi / w
    error = amplitude * np.sin(w * t) - record['adu/truth']['position'][:, 0]
    steady = metrics.whole_periods(t, period, period)
    return t[steady], metrics.residual(t[steady], error[steady], period)


def opposing_torque(record: Run) -> Floats:
    """Return the torque [Nm] with which the motors oppose each other beyond the commanded bias."""
    motors = record['adu/motor_states']['effort'][:, :2]
    return 0.5 * (motors[:, 0] - motors[:, 1]) - record.truth['bias'][:, 0]


def synchronism_error(record: Run) -> Floats:
    """Return the measured speed of motor 1 minus that of motor 2 [rad/s]."""
    return record['adu/motor_states']['velocity'][:, 0] - record['adu/motor_states']['velocity'][:, 1]


CASES = {('standstill', name): Variant('servo_step', duration=STANDSTILL_START_S + 1.0).with_(changed)
         for name, changed in PAPER_CASES.items()}
CASES |= {(kind, name): reversal_case(kind, name) for kind in REVERSAL_FREQUENCIES_RAD_S for name in PAPER_CASES}
CASES |= {('sine', name): Variant('servo_sine').with_({**servo.BEST_PARAMETERS, **changed})
          for name, changed in BIAS_SCHEDULES.items()}
CASES |= {('step', name): Variant('servo_step').with_({**FAST_STEP_PARAMETERS, **changed})
          for name, changed in BIAS_SCHEDULES.items()}
CASES |= {('structure', name): Variant('servo_step', duration=STANDSTILL_START_S).with_(changed)
          for name, changed in SPEED_LOOP_STRUCTURES.items()}
"""{(kind of run, case): Variant}.

The kinds are a step and the standstill after it, reversals, the sine of 0.4 Hz and the fast step with every schedule,
and a step with each of SPEED_LOOP_STRUCTURES.
"""


def measured(kind: str, name: str, record: Run) -> Metrics:
    """Return the metrics of the run of one of CASES; kind, name: its key there."""
    if kind == 'standstill':
        _, angle = standstill(record)
        return {'standstill_peak_to_peak_rad': (np.ptp(angle), 'rad')}
    if kind in REVERSAL_FREQUENCIES_RAD_S:
        _, residual = steady_residual(record, REVERSAL_AMPLITUDE_RAD, REVERSAL_FREQUENCIES_RAD_S[kind])
        return {f'{kind}_error_rad': (metrics.peak(residual), 'rad')}
    if kind == 'sine':
        _, residual = steady_residual(record, servo.SINE_AMPLITUDE_RAD, servo.SINE_FREQUENCIES_RAD_S['0p4hz'])
        return {'sine_residual_rad': (metrics.peak(residual), 'rad')}
    if kind == 'step':
        overshoot = metrics.overshoot_percent(record['adu/truth']['position'][:, 0], servo.STEP_SIZE_RAD)
        return {'step_overshoot_percent': (overshoot, '%')}
    moving = record.t < MOVE_DURATION_S
    return {'fight_torque_rms_nm': (tracking.rms(opposing_torque(record)[~moving]), 'Nm'),
            'synchronism_error_rms_rad_s': (tracking.rms(synchronism_error(record)[~moving]), 'rad/s'),
            'move_fight_torque_rms_nm': (tracking.rms(opposing_torque(record)[moving]), 'Nm'),
            'move_synchronism_error_rms_rad_s': (tracking.rms(synchronism_error(record)[moving]), 'rad/s')}


def rows(done: Runs) -> list[Row]:
    """Return the rows of the runs of some or all CASES."""
    table = []
    for (kind, name), record in done.items():
        values = measured(kind, name, record)
        if kind in REVERSAL_FREQUENCIES_RAD_S and name != 'bias-off' and (kind, 'bias-off') in done:
            without = measured(kind, 'bias-off', done[kind, 'bias-off'])[f'{kind}_error_rad'][0]
            values[f'{kind}_ratio_off_to_on'] = without / values[f'{kind}_error_rad'][0], ''
        # hold-fade is the default schedule of the drive; the cases of the other schedules have a prefix.
        case = f'schedule-{name}' if kind in ('sine', 'step') and name != 'hold-fade' else name
        table += [row(case, metric, value, unit, target=METRIC_TARGETS.get((name, metric)))
                  for metric, (value, unit) in values.items()]
    return table


def run(progress: Progress) -> Result:
    """Run all CASES."""
    done = {}
    for i, (key, case) in enumerate(CASES.items()):
        progress(i / len(CASES), f'{key[0]}: {key[1]}')
        done[key] = closed_loop.Loop(case.load()).run()
    return Result(rows(done), figures(done), remarks(rows(done)))


def remarks(table: list[Row]) -> list[str]:
    """Return the sentences that explain the rows."""
    values = {(row['case'], row['metric']): row['value'] for row in table}
    slow, fast = REVERSAL_FREQUENCIES_RAD_S.values()
    return [
        f'reversal is the sine {REVERSAL_AMPLITUDE_RAD:g} rad sin({slow:g} t). fast_reversal has the same amplitude '
        f'and up to {REVERSAL_AMPLITUDE_RAD * fast:g} rad/s. With bias the remaining error of fast_reversal comes '
        'from the friction that changes its sign, not from lash. Its ratio is therefore '
        f'{values["bias-on", "fast_reversal_ratio_off_to_on"]:.0f}, and that of reversal is '
        f'{values["bias-on", "reversal_ratio_off_to_on"]:.0f}.',
        'The overshoot of the fast step hardly depends on the schedule, because the shaper ends the move gently. A '
        'constant bias lowers the available peak torque, which would show in a sharper move.',
        'Two speed loops keep the motors closer together during the move (move_*, the first '
        f'{MOVE_DURATION_S:g} s). After the move their integrals treat the returning bias as an error and remove it. '
        'The lash then opens, and the motors continue to oppose each other.',
    ]


def figures(done: Runs) -> Drawings:
    """Return the figures of the runs of all cases."""
    return {'standstill': lambda: standstill_figure(done), 'reversal': lambda: reversal_figure(done),
            'torques': lambda: torques_figure(done), 'schedules': lambda: schedules_figure(done),
            'structures': lambda: structures_figure(done)}


def standstill_figure(done: Runs) -> Figure:
    """Draw the limit cycle of the load at rest and the torque of both motors, without and with bias."""
    figure, axes = fig.new_panels(2, 2, height=4.6, y=('azimuth [\N{MICRO SIGN}rad]', 'torque [Nm]'), sharex=True,
                                  sharey='row')
    for column, name in enumerate(('bias-off', 'bias-on')):
        record = done['standstill', name]
        t, y = standstill(record)
        axes[0, column].plot(t, 1e6 * (y - np.mean(y)), color=(fig.TRUTH_COLOUR, fig.FILTERED_COLOUR)[column])
        axes[0, column].set_title(f'{name}: {1e6 * np.ptp(y):.1f} \N{MICRO SIGN}rad peak to peak')
        draw_torques(axes[1, column], record)
    axes[0, 0].set_xlim(STANDSTILL_START_S, STANDSTILL_START_S + 0.5)
    axes[1, 0].set_ylim(-20.0, 20.0)
    return legend(figure)


def reversal_figure(done: Runs) -> Figure:
    """Draw the effect of lash on a slow sine: reference, then the error without its part at the sine frequency."""
    error = 'error [\N{MICRO SIGN}rad]'
    figure, axes = fig.new_panels(3, height=5.6, y=('reference [rad]', error, error), sharex=True,
                                  height_ratios=(1, 1.2, 1.2))
    t = done['reversal', 'bias-off'].t
    w = REVERSAL_FREQUENCIES_RAD_S['reversal']
    axes[0, 0].plot(t, REVERSAL_AMPLITUDE_RAD * np.sin(w * t), color=fig.INK_COLOUR)
    for panel, name in zip(axes[1:, 0], ('bias-off', 'bias-on')):
        t, residual = steady_residual(done['reversal', name], REVERSAL_AMPLITUDE_RAD, w)
        panel.plot(t, 1e6 * residual, color=fig.TRUTH_COLOUR if name == 'bias-off' else fig.FILTERED_COLOUR)
        panel.set_title(f'{name}: error without its fundamental')
    axes[2, 0].set_xlim(*reversal_window())
    return figure


def reversal_window() -> tuple[Seconds, Seconds]:
    """Return (begin, end) of the 3 s about the first reversal in the second period of the slow sine."""
    # The reversal is the first crest of this period.
    at = 1.25 * 2.0 * math.pi / REVERSAL_FREQUENCIES_RAD_S['reversal']
    return at - 1.0, at + 2.0


def torques_figure(done: Runs) -> Figure:
    """Draw the torque of both motors over the reversal, a panel for each of PAPER_CASES."""
    figure, axes = fig.new_panels(len(PAPER_CASES), height=5.6, y='torque [Nm]', sharex=True, sharey=True)
    for panel, name in zip(axes[:, 0], PAPER_CASES):
        record = done['reversal', name]
        draw_torques(panel, record)
        panel.set_title(name)
    axes[-1, 0].set_xlim(*reversal_window())
    return legend(figure)


def schedules_figure(done: Runs) -> Figure:
    """Draw for every schedule the residual of the sine and the overshoot of the fast step."""
    names = list(BIAS_SCHEDULES)
    sine = [1e6 * measured('sine', name, done['sine', name])['sine_residual_rad'][0] for name in names]
    step = [measured('step', name, done['step', name])['step_overshoot_percent'][0] for name in names]
    figure, axes = fig.new_panels(1, 2, height=3.2, sharey=True)
    for panel, values, bound, label in (
            (axes[0, 0], sine, 100.0, 'residual of the 0.4 Hz sine [\N{MICRO SIGN}rad]'),
            (axes[0, 1], step, 2.5, 'overshoot of the fast step [%]')):
        bars = panel.barh(names, values, color=[fig.FILTERED_COLOUR if name == 'hold-fade' else fig.RAW_COLOUR
                                                for name in names])
        panel.bar_label(bars, [f'{value:.0f}' if value >= 100.0 else f'{value:.3g}' for value in values], padding=3,
                        bbox={'facecolor': 'white', 'edgecolor': 'none', 'pad': 1.0})
        panel.axvline(bound, color=fig.INK_COLOUR, linewidth=0.8, linestyle='--')
        panel.set_xlim(0.0, 1.2 * max(*values, bound))
        panel.grid(axis='y', visible=False)
        panel.set_xlabel(f'{label}, dashed: target')
    axes[0, 0].invert_yaxis()
    return figure


def structures_figure(done: Runs) -> Figure:
    """Draw one speed loop on the mean speed beside a speed loop for each motor, over the step of the paper."""
    figure, axes = fig.new_panels(2, 2, height=4.6, y=('torque [Nm]', 'opposing torque [Nm]'), sharex=True,
                                  sharey='row')
    for column, name in enumerate(SPEED_LOOP_STRUCTURES):
        record = done['structure', name]
        draw_torques(axes[0, column], record)
        axes[1, column].plot(record.t, opposing_torque(record), color=fig.INK_COLOUR)
        axes[0, column].set_title(name)
    axes[0, 0].set_xlim(0.0, 1.0)
    return legend(figure)
