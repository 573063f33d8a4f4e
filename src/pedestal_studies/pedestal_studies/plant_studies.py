"""Studies of your own plant: `pedestal study servo|backlash|bode --scenario FILE` measures both axes of a scenario.

The antenna stands ashore and in still air. The plant is the drive with motors, gears and load. `servo` measures the
true angle of the dish after a step, in a sine and in a gust of wind torque on the load. `backlash` measures the motion
at rest after the step and the error at the reversals of the sine, with and without bias torque.
"""
import functools
import math
from collections.abc import Callable, Mapping

import numpy as np
from matplotlib.figure import Figure

from pedestal_bringup.loop import closed_loop
from pedestal_bringup.loop.closed_loop import Run
from pedestal_bringup.scenario.variant import Variant
from pedestal_common.graph.topics import AXES
from pedestal_common.quantities import Floats, NewtonMeters, Times
from pedestal_results import metrics, tracking
from pedestal_results.intervals import row
from pedestal_results.report import figures as fig
from pedestal_studies.p000_ma import bode
from pedestal_studies.result import Result, legend
from pedestal_workbench.trials.monte_carlo import Progress
from pedestal_workbench.tuning import loops

STEP_SIZE_RAD, SINE_AMPLITUDE_RAD, SINE_FREQUENCY_HZ = 0.02, 0.02, 0.1
GUST_TORQUE_SHARE = 0.2  # torque of the gust over the largest torque of both motors [-]

START_ANGLES_RAD = (0.0, 0.6)  # initial angles of azimuth and elevation [rad]
SETTLING_BAND = 0.02  # half-width of the band of the settling time over the size of the step [-]
RUN_DURATION_S, SINE_PERIODS = 10.0, 3  # of step and gust [s]; of the sine, of which the first is not evaluated

GUST_START_S, STANDSTILL_START_S = 4.0, 5.0  # start of the gust; start of the evaluated standstill after the step [s]

BIAS_PARAMETERS = {'': {}, '/bias-off': {f'adu.{name}.bias.schedule': 'off' for name in AXES}}

REST_PARAMETERS = {**loops.STILL_AIR_PARAMETERS, 'scenario.program.source': 'none', 'acu.initial_mode': 'preset',
                   **{f'adu.initial_{name}': start for name, start in zip(AXES, START_ANGLES_RAD)},
                   **{f'acu.{name}.preset': start for name, start in zip(AXES, START_ANGLES_RAD)}}
"""Parameters with which both axes hold START_ANGLES_RAD."""

STEP_PARAMETERS = {**REST_PARAMETERS, **{f'acu.{name}.preset': start + STEP_SIZE_RAD
                                         for name, start in zip(AXES, START_ANGLES_RAD)}}
"""Parameters with which both axes make the step at the start of the run."""

SINE_PARAMETERS = {**loops.STILL_AIR_PARAMETERS, 'acu.tracker.handover': False, 'scenario.program.time_offset': 0.0,
                   'scenario.program.interval': 0.02, 'tracking_receiver.target.kind': 'sine',
                   'tracking_receiver.target.angle.frequency': SINE_FREQUENCY_HZ,
                   **{f'adu.initial_{name}': start for name, start in zip(AXES, START_ANGLES_RAD)},
                   **{f'tracking_receiver.target.angle.{name}': start for name, start in zip(AXES, START_ANGLES_RAD)},
                   **{f'tracking_receiver.target.angle.{name}_amplitude': SINE_AMPLITUDE_RAD for name in AXES}}
"""Parameters with which both axes follow the sine, a program track."""


def bode_study(source: str, progress: Progress) -> Result:
    """Run the study bode for a scenario, a name or a path. Raises ValueError."""
    plant, responses = loops.Loops(Variant(source)), {}
    for i, name in enumerate(AXES):
        progress(i / len(AXES), f'{name}: current, speed and position loop')
        for loop in ('current', 'speed', 'position'):
            found = plant.response(loop, name)
            if found is None:
                raise ValueError(f'{plant.name}, {name}: the drive trips during the measurement of its {loop} '
                                 'loop')
            responses[f'{loop}/{name}'] = found

    def drawn(loop: str) -> Callable[[], Figure]:
        curves = {name: (responses[f'{loop}/{name}'], colour)
                  for name, colour in zip(AXES, (fig.FILTERED_COLOUR, fig.TRUTH_COLOUR))}
        return lambda: bode.bode_figure(f'{loop} loops of {plant.name}', curves, None)

    return Result(bode.rows(responses), {loop: drawn(loop) for loop in ('speed', 'position')},
                  bode.without_gain_margin(responses))


def servo_study(source: str, progress: Progress) -> Result:
    """Run the study servo for a scenario, a name or a path. Raises ValueError."""
    plant = loops.Loops(Variant(source))
    torque = {name: GUST_TORQUE_SHARE * (p.axis.motor_1.torque_limit + p.axis.motor_2.torque_limit) * p.ratio
              for name, p in plant.plants.items()}
    runs = {'step': (STEP_PARAMETERS, RUN_DURATION_S),
            'gust': ({**REST_PARAMETERS, 'adu.wind.gust.kind': 'step', 'adu.wind.gust.start': GUST_START_S,
                      **{f'adu.wind.gust.{name}': value for name, value in torque.items()}}, RUN_DURATION_S),
            'sine': (SINE_PARAMETERS, SINE_PERIODS / SINE_FREQUENCY_HZ)}
    records = {}
    for i, (name, (changes, duration)) in enumerate(runs.items()):
        progress(i / len(runs), name)
        records[name] = closed_loop.Loop(Variant(source, duration=duration).with_(changes).load()).run()
    return Result([row(f'{plant.name}/{name}', metric, value, unit) for i, name in enumerate(AXES)
                   for metric, value, unit in _metrics(records, i, torque[name])],
                  {name: functools.partial(_figure, name, records[name]) for name in runs})


def backlash_study(source: str, progress: Progress) -> Result:
    """Run the study backlash for a scenario, a name or a path. Raises ValueError."""
    plant, records = loops.Loops(Variant(source)), {}
    runs = {(kind, end): Variant(source, duration=duration).with_({**changes, **bias})
            for end, bias in BIAS_PARAMETERS.items()
            for kind, changes, duration in (('standstill', STEP_PARAMETERS, RUN_DURATION_S),
                                            ('sine', SINE_PARAMETERS, SINE_PERIODS / SINE_FREQUENCY_HZ))}
    for done, (key, variant) in enumerate(runs.items()):
        progress(done / len(runs), ''.join(key))
        records[key] = closed_loop.Loop(variant.load()).run()
    rows = []
    for i, name in enumerate(AXES):
        lash = plant.plants[name].axis.gear_train.lash
        rows.append(row(f'{plant.name}/{name}', 'lash_rad', lash, 'rad'))
        reversal_errors = {}
        for end in BIAS_PARAMETERS:
            _, angle = _standstill(records['standstill', end], i)
            _, residual = _reversals(records['sine', end], i)
            reversal_errors[end] = metrics.peak(residual)
            rows += [row(f'{plant.name}/{name}{end}', 'standstill_peak_to_peak_rad', np.ptp(angle), 'rad'),
                     row(f'{plant.name}/{name}{end}', 'reversal_error_rad', reversal_errors[end], 'rad')]
        rows.append(row(f'{plant.name}/{name}', 'reversal_ratio_off_to_on',
                        reversal_errors['/bias-off'] / reversal_errors[''], '-'))
    return Result(rows, {kind: functools.partial(_bias_figure, kind, motion_of, records)
                         for kind, motion_of in (('standstill', _standstill), ('sine', _reversals))})


def _standstill(run: Run, i: int) -> tuple[Times, Floats]:
    stands = run.t >= STANDSTILL_START_S
    angle = _angle(run, i)[stands]
    return run.t[stands], angle - np.mean(angle)


def _reversals(run: Run, i: int) -> tuple[Times, Floats]:
    """Return (times, error [rad] without the part at the sine frequency) over whole periods after the first."""
    steady = metrics.whole_periods(run.t, 1.0 / SINE_FREQUENCY_HZ, 1.0 / SINE_FREQUENCY_HZ)
    return run.t[steady], metrics.residual(run.t[steady], _sine_error(run, i)[steady], 1.0 / SINE_FREQUENCY_HZ)


def _bias_figure(kind: str, motion_of: Callable[[Run, int], tuple[Times, Floats]],
                 records: Mapping[tuple[str, str], Run]) -> Figure:
    figure, axes = fig.new_panels(2, height=4.6, sharex=True,
                                  y=f'{"error" if kind == "sine" else "angle"} [\N{MICRO SIGN}rad]')
    for i, (panel, name) in enumerate(zip(axes[:, 0], AXES)):
        for end, colour, label in (('/bias-off', fig.TRUTH_COLOUR, 'without bias'),
                                   ('', fig.FILTERED_COLOUR, 'as the scenario is')):
            t, remaining = motion_of(records[kind, end], i)
            panel.plot(t, 1e6 * remaining, color=colour, label=label)
        panel.set_title(f'{kind}, {name}')
    return legend(figure)


def _angle(run: Run, i: int) -> Floats:
    return run['adu/truth']['position'][:, i] - START_ANGLES_RAD[i]


def _sine_error(run: Run, i: int) -> Floats:
    return SINE_AMPLITUDE_RAD * np.sin(2.0 * math.pi * SINE_FREQUENCY_HZ * run.t) - _angle(run, i)


def _metrics(records: Mapping[str, Run], i: int, torque: NewtonMeters) -> list[tuple[str, float, str]]:
    step, gust, sine = (records[name] for name in ('step', 'gust', 'sine'))
    after, settled = _angle(gust, i)[gust.t >= GUST_START_S], sine.t >= 1.0 / SINE_FREQUENCY_HZ
    return [('step_overshoot_percent', metrics.overshoot_percent(_angle(step, i), STEP_SIZE_RAD), '%'),
            ('step_settling_2percent_s', metrics.settling_time(step.t, _angle(step, i), STEP_SIZE_RAD, SETTLING_BAND),
             's'),
            ('gust_torque_nm', torque, 'Nm'), ('gust_peak_rad', metrics.peak(after - after[0]), 'rad'),
            ('sine_max_error_rad', metrics.peak(_sine_error(sine, i)[settled]), 'rad'),
            ('sine_rms_error_rad', tracking.rms(_sine_error(sine, i)[settled]), 'rad')]


def _figure(kind: str, run: Run) -> Figure:
    figure, axes = fig.new_panels(2, height=4.6, y='error [mrad]' if kind == 'sine' else 'angle [mrad]', sharex=True)
    for i, (panel, name) in enumerate(zip(axes[:, 0], AXES)):
        values = _sine_error(run, i) if kind == 'sine' else _angle(run, i)
        panel.plot(run.t, 1e3 * values, color=fig.FILTERED_COLOUR)
        if kind == 'step':
            panel.axhline(1e3 * STEP_SIZE_RAD, color=fig.INK_COLOUR, lw=0.8, ls='--')
        panel.set_title(f'{kind}, {name}')
    return figure


PLANT_STUDIES = {'backlash': backlash_study, 'bode': bode_study, 'servo': servo_study}
