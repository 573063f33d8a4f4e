"""Studies of your own plant, `pedestal study servo|backlash|bode --scenario FILE`: both axes of a scenario, ashore.

bode      the loops by trials/frequency_response, each axis for itself
servo     a step of STEP and a sine of AMPLITUDE at FREQUENCY in still air, a step of wind torque of GUST of what the
          motors have for a short time; of the true angle of the dish
backlash  the standstill after that step, and what the sine leaves of its reversals, with the bias of the scenario and
          without any
"""
import math

import numpy as np

from pedestal_analysis.report.figures import FILTERED, INK, TRUTH, new_panels
from pedestal_analysis.results import tracking
from pedestal_analysis.results.intervals import row
from pedestal_analysis.trials.cases import Case
from pedestal_analysis.tuning import loops
from pedestal_common.graph.topics import AXES
from pedestal_studies.rigs import drawing, metrics
from pedestal_studies.rigs.rows import Result
from pedestal_studies.system import bode

STEP, AMPLITUDE, FREQUENCY, GUST = 0.02, 0.02, 0.1, 0.2
"""[rad], [rad], [Hz], share of both torque limits."""

DURATION, START, BAND, PERIODS = 10.0, (0.0, 0.6), 0.02, 3
"""Of step and gust [s]; where the axes begin [rad]; of the settling time; of the sine, the first to settle."""

GUST_START, STANDSTILL = 4.0, 5.0
"""When the gust begins, from when on an axis stands after the step [s]."""

BIASES = {'': {}, '/bias-off': {f'adu.{name}.bias.schedule': 'off' for name in AXES}}
"""{end of the case's name: parameters}: as the scenario is, and without bias."""

AT_REST = {**loops.STILL, 'scenario.program.source': 'none', 'acu.initial_mode': 'preset',
           **{f'adu.initial_{name}': start for name, start in zip(AXES, START)},
           **{f'acu.{name}.preset': start for name, start in zip(AXES, START)}}

MOVED = {**AT_REST, **{f'acu.{name}.preset': start + STEP for name, start in zip(AXES, START)}}

SINE = {**loops.STILL, 'acu.tracker.handover': False, 'scenario.program.time_offset': 0.0,
        'scenario.program.interval': 0.02, 'tracking_receiver.target.kind': 'sine',
        'tracking_receiver.target.angle.frequency': FREQUENCY,
        **{f'adu.initial_{name}': start for name, start in zip(AXES, START)},
        **{f'tracking_receiver.target.angle.{name}': start for name, start in zip(AXES, START)},
        **{f'tracking_receiver.target.angle.{name}_amplitude': AMPLITUDE for name in AXES}}


def of_bode(source, progress):
    """The Result of the study bode for a scenario, a name or a path. Raises LoopError, ScenarioError."""
    plant, responses = loops.Loops(source), {}
    for i, name in enumerate(AXES):
        progress(i / len(AXES), f'{name}: current, speed and position loop')
        for loop in ('current', 'speed', 'position'):
            found = plant.response(loop, name)
            if found is None:
                raise loops.LoopError(f'{plant.name}, {name}: the drive trips while its {loop} loop is measured')
            responses[f'{loop}/{name}'] = found
    figures = {loop: lambda loop=loop: bode.bode_figure(
        f'{loop} loops of {plant.name}', {name: (responses[f'{loop}/{name}'], colour) for name, colour in
                                          zip(AXES, (FILTERED, TRUTH))}, None) for loop in ('speed', 'position')}
    return Result(bode.rows(responses), figures)


def of_servo(source, progress):
    """The Result of the study servo for a scenario, a name or a path. Raises LoopError, ScenarioError."""
    plant = loops.Loops(source)
    torque = {name: GUST * (p.axis.motor_1.torque_limit + p.axis.motor_2.torque_limit) * p.ratio
              for name, p in plant.plants.items()}
    runs = {'step': (MOVED, DURATION),
            'gust': ({**AT_REST, 'adu.wind.gust.kind': 'step', 'adu.wind.gust.start': GUST_START,
                      **{f'adu.wind.gust.{name}': value for name, value in torque.items()}}, DURATION),
            'sine': (SINE, PERIODS / FREQUENCY)}
    flown = {}
    for i, (name, (changes, duration)) in enumerate(runs.items()):
        progress(i / len(runs), name)
        flown[name] = Case(name, source, changes, duration).run()
    return Result([row(f'{plant.name}/{name}', metric, value, unit) for i, name in enumerate(AXES)
                   for metric, value, unit in _metrics(flown, i, torque[name])],
                  {name: lambda name=name: _figure(name, flown[name]) for name in runs})


def of_backlash(source, progress):
    """The Result of the study backlash for a scenario, a name or a path. Raises LoopError, ScenarioError."""
    plant, flown = loops.Loops(source), {}
    runs = {(kind, end): Case(kind, source, {**changes, **bias}, duration) for end, bias in BIASES.items()
            for kind, changes, duration in (('standstill', MOVED, DURATION), ('sine', SINE, PERIODS / FREQUENCY))}
    for done, (key, case) in enumerate(runs.items()):
        progress(done / len(runs), ''.join(key))
        flown[key] = case.run()
    rows = []
    for i, name in enumerate(AXES):
        lash = plant.plants[name].axis.gear_train.lash
        rows.append(row(f'{plant.name}/{name}', 'lash_rad', lash, 'rad'))
        left = {end: metrics.peak(_reversals(flown['sine', end], i)[1]) for end in BIASES}
        for end in BIASES:
            rows += [row(f'{plant.name}/{name}{end}', 'standstill_peak_to_peak_rad',
                         np.ptp(_standstill(flown['standstill', end], i)[1]), 'rad'),
                     row(f'{plant.name}/{name}{end}', 'reversal_error_rad', left[end], 'rad')]
        rows.append(row(f'{plant.name}/{name}', 'reversal_ratio_off_to_on', left['/bias-off'] / left[''], '-'))
    return Result(rows, {kind: lambda kind=kind, cut=cut: _bias_figure(kind, cut, flown)
                         for kind, cut in (('standstill', _standstill), ('sine', _reversals))})


def _standstill(run, i):
    """(times [s], angle less its mean [rad]) of an axis that stands."""
    stands = run.t >= STANDSTILL
    angle = _angle(run, i)[stands]
    return run.t[stands], angle - np.mean(angle)


def _reversals(run, i):
    """(times [s], error without its fundamental [rad]) of an axis over the whole periods after the first."""
    steady = metrics.whole_periods(run.t, 1.0 / FREQUENCY, 1.0 / FREQUENCY)
    return run.t[steady], metrics.residual(run.t[steady], _sine_error(run, i)[steady], 1.0 / FREQUENCY)


def _bias_figure(kind, cut, flown):
    """What is left of both axes, with the scenario's bias and without one."""
    figure, axes = new_panels(2, height=4.6, sharex=True,
                              y=f'{"error" if kind == "sine" else "angle"} [\N{MICRO SIGN}rad]')
    for i, (panel, name) in enumerate(zip(axes[:, 0], AXES)):
        for end, colour, label in (('/bias-off', TRUTH, 'without bias'), ('', FILTERED, 'as the scenario is')):
            t, left = cut(flown[kind, end], i)
            panel.plot(t, 1e6 * left, color=colour, label=label)
        panel.set_title(f'{kind}, {name}')
    return drawing.legend(figure)


def _angle(run, i):
    """True angle (n,) [rad] of an axis from where it begins."""
    return run['adu/truth']['position'][:, i] - START[i]


def _sine_error(run, i):
    return AMPLITUDE * np.sin(2.0 * math.pi * FREQUENCY * run.t) - _angle(run, i)


def _metrics(flown, i, torque):
    """(metric, value, unit) of an axis."""
    step, gust, sine = (flown[name] for name in ('step', 'gust', 'sine'))
    after, settled = _angle(gust, i)[gust.t >= GUST_START], sine.t >= 1.0 / FREQUENCY
    return [('step_overshoot_percent', metrics.overshoot_percent(_angle(step, i), STEP), '%'),
            ('step_settling_2percent_s', metrics.settling_time(step.t, _angle(step, i), STEP, BAND), 's'),
            ('gust_torque_nm', torque, 'Nm'), ('gust_peak_rad', metrics.peak(after - after[0]), 'rad'),
            ('sine_max_error_rad', metrics.peak(_sine_error(sine, i)[settled]), 'rad'),
            ('sine_rms_error_rad', tracking.rms(_sine_error(sine, i)[settled]), 'rad')]


def _figure(kind, run):
    """Both axes over time, of the sine its error [mrad]."""
    figure, axes = new_panels(2, height=4.6, y='error [mrad]' if kind == 'sine' else 'angle [mrad]', sharex=True)
    for i, (panel, name) in enumerate(zip(axes[:, 0], AXES)):
        values = _sine_error(run, i) if kind == 'sine' else _angle(run, i)
        panel.plot(run.t, 1e3 * values, color=FILTERED)
        if kind == 'step':
            panel.axhline(1e3 * STEP, color=INK, lw=0.8, ls='--')
        panel.set_title(f'{kind}, {name}')
    return figure


STUDIES = {'backlash': of_backlash, 'bode': of_bode, 'servo': of_servo}
"""{study: function(source, progress) -> Result} of those that measure any plant."""
