"""Scenarios over many seeds: the results of `pedestal run`, with confidence intervals over the seeds.

Every run is the closed loop of the scenario without ROS, with another seed. Cases are <scenario> or
<scenario>-<variant>. A ratio to another case divides the results of two runs with the same seed. `pedestal run
--explain` defines the metrics, except the metrics of `extra_results`.
"""
import math
from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure

from pedestal_bringup.loop import closed_loop, memory_recording
from pedestal_bringup.loop.closed_loop import Run
from pedestal_bringup.loop.memory_recording import MemoryRecording
from pedestal_bringup.scenario.variant import Variant
from pedestal_common.quantities import Floats, Row
from pedestal_results import results, tracking
from pedestal_results.intervals import row
from pedestal_results.recorded_run import RecordedRun
from pedestal_results.report import figures as fig
from pedestal_studies.result import FIRST_SEED, Result, legend, of_cases, seeds
from pedestal_workbench.trials.monte_carlo import Pool, Progress

DEFAULT_RUNS = 40  # runs of each case

NEAR_FLYBY_PARAMETERS = {'tracking_receiver.target.flyby.closest_distance': 60.0,
                         'tracking_receiver.target.flyby.height': 20.0}

NOISELESS_PARAMETERS = {'tracking_receiver.receiver.cn0_dbhz': 120.0, 'acu.tracker.receiver.sigma_floor': 5e-4,
                        **{f'ins.{name}': 0.0 for name in ('tilt_noise', 'heading_noise', 'rate_noise', 'tilt_wander',
                                                           'heading_wander')}}
"""Parameters of a receiver and an INS without noise. The filter still assumes a noise of 5e-4 rad (sigma_floor). With
less assumed noise, the filter would take even the smallest deviation of the target from the motion model for motion,
not for noise."""

CASES = {  # {name: Variant}
    'leo_pass': Variant('leo_pass'), 'ship_pass': Variant('ship_pass'),
    'ship_pass-late': Variant('ship_pass').with_({'ins.latency': 0.02}),
    'ship_pass-quiet': Variant('ship_pass').with_(NOISELESS_PARAMETERS),
    'ship_pass_ss6': Variant('ship_pass_ss6'), 'ship_overhead': Variant('ship_overhead'),
    'ship_align_and_track': Variant('ship_align_and_track'), 'uav_flyby': Variant('uav_flyby'),
    'uav_flyby-60m': Variant('uav_flyby').with_(NEAR_FLYBY_PARAMETERS)}

TRACKING_METRICS = ('pointing_rms_deg', 'pointing_max_deg', 'single_sample_noise_deg', 'pointing_to_noise', 'loss_s')
ISOLATION_METRICS = ('isolation_db', 'isolation_limit_db')
"""Isolation from the rotation of the ship, and the isolation that a perfect antenna would show with the noise and the
length of the run."""
NOISE_METRICS = ('noise_reduction_cross_elevation', 'noise_reduction_elevation')
"""Noise of one receiver sample, divided by the error of the filtered line of sight."""
ALIGNMENT_METRICS = ('aligned_s', 'heading_sigma_at_alignment_deg', 'heading_error_rms_deg',
                     'autotrack_after_alignment_s')
CASE_METRICS = {  # {case: names of its results}, of pedestal_results/results.py or of `extra_results`
    'leo_pass': TRACKING_METRICS, 'ship_pass': (*TRACKING_METRICS, *ISOLATION_METRICS),
    'ship_pass-late': (*TRACKING_METRICS, *ISOLATION_METRICS),
    'ship_pass-quiet': ('pointing_rms_deg', 'isolation_db'), 'ship_pass_ss6': (*TRACKING_METRICS, *ISOLATION_METRICS),
    'ship_overhead': ('loss_s', 'keyhole_loss_predicted_s', 'loss_to_predicted'),
    'ship_align_and_track': (*ALIGNMENT_METRICS, *TRACKING_METRICS), 'uav_flyby': (*TRACKING_METRICS, *NOISE_METRICS),
    'uav_flyby-60m': (*TRACKING_METRICS, *NOISE_METRICS)}

SHIP_CASES = ('ship_pass', 'ship_pass-late', 'ship_pass_ss6')  # compared with leo_pass

METRIC_TARGETS = {  # {(case, metric): target}
    **{(case, 'pointing_to_noise'): '<= 0.4' for case in ('leo_pass', 'ship_pass', 'ship_pass-late')},
    ('ship_pass', 'pointing_to_leo_pass'): '<= 1.3', ('ship_pass-late', 'pointing_to_leo_pass'): '<= 1.5',
    ('ship_pass_ss6', 'pointing_to_leo_pass'): '<= 1.5',
    **{(case, 'isolation_db'): '>= 60' for case in ('ship_pass', 'ship_pass-late', 'ship_pass-quiet',
                                                    'ship_pass_ss6')},
    ('ship_overhead', 'loss_to_predicted'): '0.8 to 1.2',
    **{('uav_flyby', metric): '>= 7' for metric in NOISE_METRICS},
    **{('uav_flyby-60m', metric): '>= 3' for metric in NOISE_METRICS}}

EXTRA_METRIC_UNITS = {'loss_to_predicted': '', 'keyhole_loss_predicted_s': 's', 'autotrack_after_alignment_s': 's'}


def extra_results(values: Mapping[str, float], run: Run) -> dict[str, float]:
    """Return {name: value} of results that a recording does not give.

    values: {name: value} of the other results.

        keyhole_loss_predicted_s        time with the target outside the beam, as the control unit predicts it for a
                                        slew through a keyhole [s]
        loss_to_predicted               measured time outside the beam, divided by the predicted time [-]
        autotrack_after_alignment_s     time from the alignment of the INS to the first autotrack [s], NaN if autotrack
                                        never began
    """
    more = {}
    slew = run.units['acu'].parts['state']['guidance']['lookahead']['slew']
    if slew['loss'] > 0.0:
        more = {'keyhole_loss_predicted_s': float(slew['loss']),
                'loss_to_predicted': values['loss_s'] / float(slew['loss'])}
    if 'aligned_s' in values:
        modes = run.table('acu/mode')
        automatic = modes['t'][np.array(modes['data']) == 'autotrack']
        first = float(automatic[0]) if automatic.size else math.nan
        more['autotrack_after_alignment_s'] = first - values['aligned_s']
    return more


def measured(variant: Variant) -> dict[str, float]:
    """Return {name: value} of one run of a variant."""
    scenario = variant.load()
    run = closed_loop.Loop(scenario).run()
    found = results.measured(RecordedRun(MemoryRecording(scenario, run)).parts)
    values = {name: value for name, (value, _) in found.items()}
    return {**values, **extra_results(values, run)}


def case_results(name: str, run: int) -> list[float]:
    """Return the CASE_METRICS of one run of one of CASES."""
    values = measured(CASES[name].with_(seed=FIRST_SEED + run))
    return [values[metric] for metric in CASE_METRICS[name]]


def rows(values: Mapping[str, Floats]) -> list[Row]:
    """Return the rows of the study; values: {case: (runs, len(CASE_METRICS[case]))}."""
    table = []
    for name, of_runs in values.items():
        for metric, column in zip(CASE_METRICS[name], of_runs.T):
            unit = EXTRA_METRIC_UNITS[metric] if metric in EXTRA_METRIC_UNITS else results.RESULT_BY_NAME[metric].unit
            table.append(row(name, metric, column, unit, target=METRIC_TARGETS.get((name, metric))))
        if name in SHIP_CASES:
            pointing, of_leo_pass = (values[case][:, CASE_METRICS[case].index('pointing_rms_deg')]
                                     for case in (name, 'leo_pass'))
            table.append(row(name, 'pointing_to_leo_pass', pointing / of_leo_pass, '',
                             target=METRIC_TARGETS.get((name, 'pointing_to_leo_pass'))))
    return table


def run(progress: Progress, runs: int = DEFAULT_RUNS, pool: Pool | None = None) -> Result:
    """Run every case `runs` times."""
    values = of_cases(case_results, CASES, runs, pool, progress)
    return Result(rows(values), {'pointing': lambda: pointing_figure(values), 'uav-flyby': flyby_figure},
                  [f'{seeds(runs)} The variants as commands for the nodes:',
                   *(f'{name}: {CASES[name].command()}' for name in ('ship_pass-late', 'uav_flyby-60m'))])


def flyby_figure() -> Figure:
    """Draw Ma 2023's figures 7 to 11 for uav_flyby: error and angle before and after the filter, and the azimuth."""
    figure, axes = fig.new_panels(3, height=7.2, y=('error [deg]', 'elevation [deg]', 'azimuth [deg]'))
    flown = tracking.read(memory_recording.record(CASES['uav_flyby'].with_(seed=FIRST_SEED).load()))
    middle = np.abs(flown.t - 0.5 * flown.t[-1]) <= 0.5
    cross_elevations, elevation_errors = zip(*(errors.T for errors in (flown.measured, flown.filtered, flown.error)))
    # The measured elevation of the target is its true elevation plus the measured error minus the true error. The
    # filtered elevation follows in the same way from the filtered error.
    _, target_elevation = flown.target_earth.T
    elevations = [error - flown.error[:, 1] + target_elevation for error in elevation_errors]
    for panel, curves, title in ((axes[0, 0], cross_elevations, 'error in cross-elevation (figures 7, 8)'),
                                 (axes[1, 0], elevations, 'elevation of the target (figures 9, 10)')):
        for values, colour, label in zip(curves, (fig.RAW_COLOUR, fig.FILTERED_COLOUR, fig.INK_COLOUR),
                                         ('receiver', 'filtered', 'truth')):
            panel.plot(flown.t[middle], np.degrees(values[middle]), color=colour, label=label,
                       linewidth=0.6 if label == 'receiver' else 1.2)
        panel.set_title(title)
    axes[2, 0].plot(flown.t, np.degrees(flown.encoders[:, 0]), color=fig.FILTERED_COLOUR)
    axes[2, 0].set_title('azimuth of the antenna over the flight (figure 11)')
    return legend(figure)


def pointing_figure(values: Mapping[str, Floats]) -> Figure:
    """Draw the pointing error of every seed, rms to the left and largest to the right; values: argument of `rows`."""
    figure, axes = fig.new_panels(1, 2, height=3.8, x=('pointing error, rms [deg]', 'pointing error, largest [deg]'),
                                  sharey=True)
    for panel, metric in zip(axes[0], ('pointing_rms_deg', 'pointing_max_deg')):
        shown = [name for name in values if metric in CASE_METRICS[name]]
        for name in shown:
            column = values[name][:, CASE_METRICS[name].index(metric)]
            panel.plot(column, [name] * len(column), '|', color=fig.FILTERED_COLOUR)
        panel.set_xlim(left=0.0)
    axes[0, 0].invert_yaxis()
    return figure
