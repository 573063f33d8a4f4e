"""Feed-forward of estimated rate and acceleration (Lin 2020): a conventional Kalman filter beside the IMM.

An IMM (interacting multiple model) filter mixes several Kalman filters by the probabilities of their models. The loop
is that of feedforward_loop.py. Cases are AXIS/SOURCE; SOURCE_MEANINGS describes the sources of the rate and
acceleration that are fed forward. kalman-cv-Q and kalman-ca-Q have the process noise Q. A source ...-predicted is
predicted from the time of the miss to the middle of the interval in which the command is in force, d + T / 2 later. A
source drive-... is in the whole chain: receiver of latency d, control unit, motors, gears. All filters get the same
noise. In the cases drive-... the target reverses without a uniform part, so its motion is a sine.
"""
import dataclasses
import math
from collections.abc import Mapping
from typing import NamedTuple, TypeAlias

import numpy as np
from matplotlib.figure import Figure

from acu_tracker.estimation.filters.motion_models import MODEL_NAMES
from acu_tracker.estimation.params import FilterParameters
from acu_tracker.modes import Mode
from pedestal_bringup.loop import closed_loop
from pedestal_bringup.scenario.variant import Variant
from pedestal_common.parameters import as_dict
from pedestal_common.quantities import Bools, Degrees, Floats, Pairs, RadiansPerSecond, Row, Times, Vectors3
from pedestal_results import metrics, tracking
from pedestal_results.intervals import row
from pedestal_results.report import figures as fig
from pedestal_studies import profiles
from pedestal_studies.ensemble import MEASUREMENT_PERIOD_S as T
from pedestal_studies.p003_lin_wu_zhu import feedforward_loop
from pedestal_studies.p003_lin_wu_zhu.feedforward_loop import (
    METRIC_UNITS,
    MISS_SIGMA_RAD,
    REVERSAL_S_BY_AXIS,
    MissStatistics,
    Source,
    ca,
    cv,
    filter_of,
    imm,
    statistics,
)
from pedestal_studies.result import FIRST_SEED, Drawings, Result, legend, of_cases
from pedestal_workbench.trials import monte_carlo
from pedestal_workbench.trials.monte_carlo import Pool, Progress

Misses: TypeAlias = dict[str, MissStatistics]   # {case: its statistics}

DEFAULT_RUNS = 50  # runs of each case, with independent noise

DRIVE_DURATION_S, DRIVE_EVALUATION_START_S, DRIVE_ELEVATION_RAD = 36.0, 6.0, 0.5  # of the whole chain [s, s, rad]

CV_NOISES = (0.1, 0.2, 0.3, 0.5, 4.0)  # process noises of the conventional filter [deg/s2/sqrt(Hz)]

PAPER_CV_NOISES = {'azimuth': 0.1, 'elevation': 0.3}
"""Process noise of `kalman-cv` [deg/s2/sqrt(Hz)] that comes nearest to the paper's results; the paper prints none."""

FEEDFORWARD_SOURCES = {
    'imm': imm(q_ca=40.0, predicted=False), 'imm-predicted': imm(q_ca=40.0, predicted=True),
    'perfect-state': Source(filter=None, predicted=True), 'imm-b-predicted': imm(q_ca=5.0, predicted=True),
    'kalman-ca-0.1': ca(0.1), 'kalman-ca-40': ca(40.0),
    'kalman-ca-40-predicted': dataclasses.replace(ca(40.0), predicted=True)}
"""{name: Source} of rate and acceleration. The argument of ca and q_ca of imm are process noises [deg/s3/sqrt(Hz)]."""

SOURCE_MEANINGS = {  # {name of a case without its axis: description}, for the table of the documentation
    'kalman-cv': 'conventional Kalman filter of constant velocity, with the noise that comes nearest to the paper',
    'imm': 'IMM of cv, ca and current_statistical, tuned on the azimuth',
    'imm-predicted': 'the same IMM, predicted over the delay of the miss to the middle of the interval of the command',
    'perfect-state': 'true rate and acceleration in that middle: the limit of the rate loop',
    'kalman-ca-40-predicted': 'Kalman filter of constant acceleration with 40 deg/s3/sqrt(Hz), predicted like the IMM',
    'drive-kalman-cv': 'kalman-cv in receiver, control unit, motors and gears',
    'drive-imm': 'imm in receiver, control unit, motors and gears',
    'drive-imm-default': 'the default IMM of the product in receiver, control unit, motors and gears'}


def cv_name(axis: str, q: float) -> str:
    """Return the name of the case of a conventional filter; q: its process noise [deg/s2/sqrt(Hz)]."""
    return f'{axis}/kalman-cv' if q == PAPER_CV_NOISES[axis] else f'{axis}/kalman-cv-{q:g}'


CASES = {  # {case: (axis, Source)}
    **{f'{axis}/kalman-cv': (axis, cv(q)) for axis, q in PAPER_CV_NOISES.items()},
    **{f'{axis}/{name}': (axis, source)
       for axis in REVERSAL_S_BY_AXIS for name, source in FEEDFORWARD_SOURCES.items()},
    **{cv_name(axis, q): (axis, cv(q)) for axis in REVERSAL_S_BY_AXIS for q in CV_NOISES}}


class DriveCase(NamedTuple):
    """A case of the whole chain, in which the target moves on one axis."""
    axis: str
    variant: Variant


def drive_case(axis: str, tuned: FilterParameters,
               rate: RadiansPerSecond = profiles.S_MOTION_RATE_RAD_S) -> DriveCase:
    """Return the case of the whole chain, in which the target follows a sine on an axis, with this largest rate.

    tuned: filter of this axis. The target's range of 510 m is the reference_range of the scenario uav_flyby, at which
    the receiver has its nominal C/N0.
    """
    w = math.pi / REVERSAL_S_BY_AXIS[axis]
    amplitudes = {f'tracking_receiver.target.angle.{name}_amplitude':
                  rate / w if name == axis else 0.0 for name in REVERSAL_S_BY_AXIS}
    return DriveCase(axis, Variant('uav_flyby', duration=DRIVE_DURATION_S).with_({
        'tracking_receiver.target.kind': 'sine', 'tracking_receiver.target.angle.frequency': 0.5 * w / math.pi,
        'tracking_receiver.target.angle.range': 510.0, 'tracking_receiver.target.angle.elevation': DRIVE_ELEVATION_RAD,
        **amplitudes, 'tracking_receiver.receiver.latency': feedforward_loop.MISS_DELAY_STEPS * T,
        'scenario.program.interval': T,
        'adu.initial_azimuth': 0.0, 'adu.initial_elevation': DRIVE_ELEVATION_RAD,
        **{f'acu.{axis}.filter.{name}': value for name, value in as_dict(tuned).items()
           if value != as_dict(FilterParameters())[name]}}))


DRIVE_CASES = {  # {case: DriveCase} of the whole chain
    f'{axis}/drive-{name}': drive_case(axis, tuned) for axis in REVERSAL_S_BY_AXIS for name, tuned in {
        'kalman-cv': cv(PAPER_CV_NOISES[axis]).own_filter, 'imm': FEEDFORWARD_SOURCES['imm'].own_filter,
        'imm-default': filter_of('imm')}.items()}


def drive_error(case: DriveCase, seed: int) -> tuple[Times, Floats]:
    """Return (times, true pointing error of the axis [rad]) of one of `drive_case` from DRIVE_EVALUATION_START_S on,
    NaN if the run left autotrack."""
    record = closed_loop.Loop(case.variant.with_(seed=seed).load()).run()
    record = record.where(record.t >= DRIVE_EVALUATION_START_S)
    error = record.truth['error'][:, list(REVERSAL_S_BY_AXIS).index(case.axis)]
    return record.t, error if np.all(record['acu/mode'] == Mode.AUTOTRACK) else np.full_like(error, math.nan)


def drive_misses(name: str, run: int) -> tuple[Degrees, Degrees]:
    """Return (rms, largest) miss of one run of one of DRIVE_CASES."""
    _, error = drive_error(DRIVE_CASES[name], FIRST_SEED + run)
    return math.degrees(tracking.rms(error)), math.degrees(metrics.peak(error))


MISS_TARGETS_DEG = {  # targets of miss_rms_deg
    'azimuth/kalman-cv': '0.16 to 0.17', 'azimuth/imm': '<= 0.036', 'azimuth/imm-predicted': '<= 0.025',
    'elevation/kalman-cv': '0.085 to 0.095', 'elevation/imm': '<= 0.028', 'elevation/imm-predicted': '<= 0.018'}

PAPER_MISSES_DEG = {'azimuth/kalman-cv': 0.17, 'azimuth/imm': 0.035, 'elevation/kalman-cv': 0.1, 'elevation/imm': 0.03}
"""{case: number of the paper [deg]}. The paper names it the largest miss (RMS); we read it as the rms of the miss."""

MAIN_CASES = {f'{axis}/{name}' for axis in REVERSAL_S_BY_AXIS  # cases that have all rows
              for name in ('kalman-cv', 'imm', 'imm-predicted', 'perfect-state')}

MISS_RATIO_TARGETS = {'azimuth/imm': ('>= 4', None), 'azimuth/imm-predicted': ('>= 6', None),
                      'elevation/imm': ('>= 3', 3.0), 'elevation/imm-predicted': ('>= 5', None)}
"""{case: (target, number of the paper or None)} of a ratio: miss of kalman-cv divided by miss of the case. For azimuth
the paper prints 4 to 5."""


def conventional_curve(misses: Misses, axis: str) -> Floats:
    """Return (rate noise [deg/s], miss [deg]) of the conventional filters of CV_NOISES, an array (2, n, runs)."""
    return np.array([[misses[cv_name(axis, q)].of(metric) for q in CV_NOISES]
                     for metric in ('rate_noise_deg_s', 'miss_rms_deg')])


def at_rate_noise(misses: Misses, axis: str, rate_noise: Floats) -> Floats:
    """Return the miss [deg] of a conventional filter tuned to a rate noise [deg/s] in each run, log-log between
    CV_NOISES. If even the quietest filter is noisier, its miss is returned, which is too small."""
    noises, curve = np.log(conventional_curve(misses, axis))
    return np.exp([np.interp(*run) for run in zip(np.log(rate_noise), noises.T, curve.T)])


def rows(misses: Misses) -> list[Row]:
    """Return the rows of all cases. A ratio divides the misses of two filters in runs with the same noise."""
    table = []
    for name, case in misses.items():
        axis, miss = case.axis, case.of('miss_rms_deg')
        table.append(row(name, 'miss_rms_deg', miss, 'deg', PAPER_MISSES_DEG.get(name), MISS_TARGETS_DEG.get(name)))
        table += [row(name, metric, case.of(metric), unit) for metric, unit in METRIC_UNITS.items()
                  if metric == 'rate_noise_deg_s' or metric != 'miss_rms_deg' and name in MAIN_CASES]
        if name in MISS_RATIO_TARGETS:
            target, paper = MISS_RATIO_TARGETS[name]
            table.append(row(name, 'miss_ratio_to_kalman_cv', misses[f'{axis}/kalman-cv'].of('miss_rms_deg') / miss,
                             '', paper, target))
            table.append(row(name, 'miss_ratio_at_equal_rate_noise',
                             at_rate_noise(misses, axis, case.of('rate_noise_deg_s')) / miss, '', None,
                             '>= 5' if axis == 'azimuth' and name.endswith('predicted') else None))
    return table


def drive_rows(of_drive: Mapping[str, Pairs]) -> list[Row]:
    """Return the rows of {name of DRIVE_CASES: (rms, largest) miss [deg] of every run}."""
    table = []
    for name, values in of_drive.items():
        table += [row(name, 'miss_rms_deg', values[:, 0], 'deg'), row(name, 'miss_peak_deg', values[:, 1], 'deg')]
        conventional = f'{name.partition("/")[0]}/drive-kalman-cv'
        if name != conventional:
            table.append(row(name, 'miss_ratio_to_kalman_cv', of_drive[conventional][:, 0] / values[:, 0], '',
                             target='>= 3'))
    return table


def remarks(misses: Misses) -> list[str]:
    """Return the sentences that explain the rows."""
    value = {(name, metric): case.mean(metric) for name, case in misses.items() for metric in METRIC_UNITS}
    late = (feedforward_loop.MISS_DELAY_STEPS + 0.5) * T
    steepest = math.pi * math.degrees(profiles.S_MOTION_RATE_RAD_S) / REVERSAL_S_BY_AXIS['azimuth']
    return [
        'The paper does not print the duration of a reversal, sample time, noise '
        f'({math.degrees(MISS_SIGMA_RAD):g} deg), delay, rate loop, K_p and the constants of the filters; they are '
        'ours. Its "largest miss (RMS)" is read as the rms over the whole motion. miss_worst_second_deg is the rms of '
        'the worst second.',
        f'A feed-forward that is {1e3 * late:g} ms late (d + T / 2) causes a miss of a (d + T / 2) / K_p in a long '
        f'turn at the acceleration a. The miss is {steepest * late / feedforward_loop.K_P:.3f} deg at the '
        f'{steepest:.1f} deg/s2 of the azimuth. '
        'imm-predicted has no such miss. The rate of kalman-cv is the same with and without prediction.',
        'perfect-state is the limit of this servo: its miss comes from the noise of the miss and the jerk in the rate '
        'loop.',
        f'The elevation of the paper (0.1 deg) needs a conventional filter of {PAPER_CV_NOISES["elevation"]:g} '
        f'deg/s2/sqrt(Hz). With the {PAPER_CV_NOISES["azimuth"]:g} deg/s2/sqrt(Hz) of the azimuth the miss is '
        f'{value["elevation/kalman-cv-0.1", "miss_rms_deg"]:.3f} deg.',
        'Any filter can have a small miss if its rate is noisy. A conventional filter of 4 deg/s2/sqrt(Hz) has '
        f'{value["azimuth/kalman-cv-4", "miss_rms_deg"]:.3f} deg. A predicted ca of 40 deg/s3/sqrt(Hz) has '
        f'{value["azimuth/kalman-ca-40-predicted", "miss_rms_deg"]:.3f} deg, with '
        f'{value["azimuth/kalman-ca-40-predicted", "rate_noise_deg_s"]:.2f} deg/s of noise on the rate; the IMM has '
        f'{value["azimuth/imm-predicted", "rate_noise_deg_s"]:.3f} deg/s. miss_ratio_at_equal_rate_noise therefore '
        'compares with a conventional filter that is tuned to the same noise. The IMM was tuned on the azimuth only.',
        'drive: the control unit predicts over the known latency and commands the estimated angle, so the miss is the '
        'error of the filter. imm-default is the IMM with the default parameters of the product. In azimuth the error '
        'of kalman-cv is so large in every turn that the gate refuses the measurements and restarts the filter. '
        'Without a gate (acu.tracker.gate) the miss is larger. Command for the nodes: '
        f'{DRIVE_CASES["azimuth/drive-imm-default"].variant.command()}',
    ]


SOURCE_COLOURS = {'kalman-cv': fig.TRUTH_COLOUR, 'imm': fig.MOTOR_1_COLOUR, 'imm-predicted': fig.FILTERED_COLOUR,
                  'perfect-state': fig.INK_COLOUR}


def figures(misses: Misses) -> Drawings:
    """Return the figures."""
    return {'azimuth': lambda: miss_figure('azimuth', 'figures 8 and 9', misses),
            'elevation': lambda: miss_figure('elevation', 'figures 10 and 11', misses),
            'feedforward': feedforward_figure, 'probabilities': probability_figure,
            'tunings': lambda: tuning_figure(misses), 'drive': drive_figure}


def from_first_reversal(axis: str) -> tuple[Times, Bools, Vectors3]:
    """Return (times since the first evaluated step, mask of the evaluated steps, the target at all steps)."""
    t, target, period = feedforward_loop.motion(axis)
    counts = t >= 0.5 * period
    return t[counts] - 0.5 * period, counts, target


def miss_figure(axis: str, figures_of_paper: str, misses: Misses) -> Figure:
    """Draw the miss: one run of each case and the mean over the runs."""
    names = ('kalman-cv', 'imm', 'imm-predicted')
    figure, axes = fig.new_panels(len(names), height=6.4, y='miss [deg]', sharex=True, sharey=True)
    t, counts, _ = from_first_reversal(axis)
    for name, panel in zip(names, axes[:, 0]):
        case = f'{axis}/{name}'
        one = feedforward_loop.steps_of(*CASES[case], first=0, count=1)['miss'][0, counts]
        panel.plot(t, np.degrees(one), color=fig.RAW_COLOUR, linewidth=0.7, label='one run')
        panel.plot(t, np.degrees(misses[case].miss_mean[counts]), color=fig.FILTERED_COLOUR, linewidth=1.4,
                   label='mean of the runs')
        panel.set_title(f'{name}: {misses[case].mean("miss_rms_deg"):.3f} deg rms')
    axes[0, 0].set_title(f'{axis}, {figures_of_paper} of the paper. {axes[0, 0].get_title(loc="left")}')
    return legend(figure)


def feedforward_figure() -> Figure:
    """Draw the rate and acceleration that are fed forward in one reversal of one run, beside the truth."""
    figure, axes = fig.new_panels(2, height=5.4, y=('rate [deg/s]', 'acceleration [deg/s2]'), sharex=True)
    t, counts, target = from_first_reversal('azimuth')
    for panel, field, column in ((axes[0, 0], 'rate', 1), (axes[1, 0], 'acceleration', 2)):
        panel.plot(t, np.degrees(target[counts, column]), color=fig.INK_COLOUR, linestyle='--', label='truth')
        for name in ('kalman-cv', 'imm', 'imm-predicted'):
            one = feedforward_loop.steps_of(*CASES[f'azimuth/{name}'], first=0, count=1)[field][0, counts]
            panel.plot(t, np.degrees(one), color=SOURCE_COLOURS[name], label=name)
    reversal = t[np.argmax(np.abs(target[counts, 2]))]
    axes[0, 0].set_xlim(reversal - 1.5, reversal + 2.5)
    axes[0, 0].set_title('fed forward through a reversal of the azimuth')
    return legend(figure)


def probability_figure() -> Figure:
    """Draw the model probabilities of the IMM through reversals, mean over BATCH_RUNS runs."""
    figure, axes = fig.new_panels(2, height=4.6, y=('acceleration\n[deg/s2]', 'probability'), sharex=True,
                                  height_ratios=(1, 1.6))
    t, counts, target = from_first_reversal('azimuth')
    steps = feedforward_loop.steps_of(*CASES['azimuth/imm'], first=0, count=feedforward_loop.BATCH_RUNS)
    mu = steps['mu'][:, counts].mean(axis=0)        # probability of each model
    axes[0, 0].plot(t, np.degrees(target[counts, 2]), color=fig.INK_COLOUR)
    axes[0, 0].set_title('the target, and the probability of each model of imm')
    for model, colour in (('cv', fig.TRUTH_COLOUR), ('ca', fig.MOTOR_2_COLOUR),
                          ('current_statistical', fig.FILTERED_COLOUR)):
        axes[1, 0].plot(t, mu[:, MODEL_NAMES.index(model)], color=colour, label=model)
    axes[1, 0].set_ylim(0.0, 1.0)
    return legend(figure)


def tuning_figure(misses: Misses) -> Figure:
    """Draw the miss of every filter over the noise of the rate that it feeds forward."""
    figure, axes = fig.new_panels(1, 2, height=3.8, x='noise of the rate fed forward [deg/s]', y='miss rms [deg]',
                                  sharex=True, sharey=True)
    for axis, panel in zip(REVERSAL_S_BY_AXIS, axes[0]):
        panel.loglog(*conventional_curve(misses, axis).mean(axis=-1), '.-', color=fig.TRUTH_COLOUR,
                     label=f'kalman-cv, q {CV_NOISES[0]:g} to {CV_NOISES[-1]:g}')
        for name, colour, marker in (('kalman-ca-0.1', fig.RAW_COLOUR, 'v'),
                                     ('kalman-ca-40-predicted', fig.RAW_COLOUR, '^'),
                                     ('imm', fig.MOTOR_1_COLOUR, 'o'), ('imm-predicted', fig.FILTERED_COLOUR, 'o'),
                                     ('imm-b-predicted', fig.MOTOR_2_COLOUR, 's')):
            case = misses[f'{axis}/{name}']
            panel.loglog(case.mean('rate_noise_deg_s'), case.mean('miss_rms_deg'), marker, color=colour, label=name)
        panel.set_title(axis)
        panel.set_xlim(0.015, 1.0)
        panel.set_ylim(0.012, 0.3)
    return legend(figure)


def drive_figure() -> Figure:
    """Draw the miss of the whole chain over time, one run of each filter."""
    figure, axes = fig.new_panels(2, height=4.8, y='miss [deg]', sharex=True)
    for axis, panel in zip(REVERSAL_S_BY_AXIS, axes[:, 0]):
        for name, colour in (('kalman-cv', fig.TRUTH_COLOUR), ('imm', fig.MOTOR_1_COLOUR),
                             ('imm-default', fig.FILTERED_COLOUR)):
            t, miss = drive_error(DRIVE_CASES[f'{axis}/drive-{name}'], FIRST_SEED)
            panel.plot(t, np.degrees(miss), color=colour, label=name)
        panel.set_xlim(DRIVE_EVALUATION_START_S, DRIVE_EVALUATION_START_S + 8.0)
        panel.set_title(f'{axis}: control unit, motors and gears, reversals of {REVERSAL_S_BY_AXIS[axis]:g} s')
    return legend(figure)


def run(progress: Progress, runs: int = DEFAULT_RUNS, pool: Pool | None = None) -> Result:
    """Run CASES and DRIVE_CASES `runs` times."""
    pool = pool or monte_carlo.Pool(1)
    misses = statistics(CASES, runs, pool, lambda share, text: progress(0.5 * share, text))
    of_drive = of_cases(drive_misses, DRIVE_CASES, runs, pool, lambda share, text: progress(
        0.5 + 0.5 * share, f'the whole chain, {text}'), size=1)
    return Result(rows(misses) + drive_rows(of_drive), figures(misses), remarks(misses))
