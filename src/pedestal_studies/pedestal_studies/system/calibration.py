"""Pointing calibration of a new station: four passes and the sun, then the program-track error in other directions.

Scenario station_new has the errors of a station that was built and not yet calibrated. Each pass and each scan of each
run has its own seed of receiver noise and wind:

    1. four passes in autotrack, which begin with a search, on a calm day with measured refractivity; `calibrate
       pointing` takes POINTS_PER_PASS offsets from each of them
    2. four scans of the sun on the same days, scenario station_sun; an offset from each of them
    3. a fifth pass in program track, in directions that were not used, with the wind and the refractivity of the
       scenario: the pointing error without a model (`raw`), and with the model of TERMS (`calibrated`)

`leave_one_out_default_rms_deg` is that of the default terms alone, by which an operator decides for more terms.
`within_3_sigma` is the share of the terms, over all runs, whose error is below three of their sigmas. A term that was
dropped counts with the value 0 and the sigma that it had before.
"""
import dataclasses
import functools
import math
from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from acu_tracker.program.program_track import checked
from drive_law.axis_params import AxisParameters
from pedestal_bringup.loop import closed_loop, memory_recording
from pedestal_bringup.scenario import scenario
from pedestal_bringup.scenario.program import Plan
from pedestal_bringup.scenario.scenario import Scenario
from pedestal_common.quantities import Degrees, Floats, Radians, Seconds
from pedestal_results.intervals import row
from pedestal_results.report import figures as fig
from pedestal_results.tracking import rms
from pedestal_studies.result import FIRST_SEED, Result, of_cases
from pedestal_workbench.calibration import collect, pointing, scan
from pedestal_workbench.calibration.collect import Point
from pedestal_workbench.calibration.offsets import Offsets
from pedestal_workbench.calibration.pointing import PointingCalibration
from pedestal_workbench.calibration.terms import DEFAULT_TERMS
from pedestal_workbench.trials.monte_carlo import Pool, Progress

SCENARIO_NAME, SCAN_SCENARIO_NAME = 'station_new', 'station_sun'  # scenario of the passes, and of the scans of the sun
DEFAULT_RUNS = 30
TERMS = (*DEFAULT_TERMS, 'P11', 'P13', 'P14')  # with the eccentricity of both encoders
POINTS_PER_PASS = 9  # number of offsets from a pass

CALIBRATION_PASSES = ('2019-12-09T16:38:33Z', '2019-12-10T17:26:30Z', '2019-12-11T16:38:10Z', '2019-12-10T12:35:55Z')
"""UTC of the begin of the passes from which the offsets are taken: the culminations are 69, 20, 31 and 54 deg."""
CALM_OVERRIDES = 'adu.wind.field.speed=2', 'scenario.program.refractivity=330'
"""Overrides of the calibration passes: a wind of 2 m/s, and the refractivity of the path in the program track."""
SCANS = '2019-12-09T09:00:00Z', '2019-12-10T10:20:00Z', '2019-12-10T12:00:00Z', '2019-12-11T13:20:00Z'
"""UTC of the begin of the scans of the sun; azimuth and elevation are (148, 13), (166, 19), (190, 19), (208, 14) deg.
"""
SCAN_OVERRIDES = ('adu.wind.field.speed=2',)  # overrides of the scans: the wind of the calibration passes
SEEDS_PER_RUN = len(CALIBRATION_PASSES) + len(SCANS) + 1  # number of passes and scans of a run, and thus of its seeds
PROGRAM_OVERRIDES = 'acu.initial_mode=program', 'acu.tracker.handover=false'
TEST_PASS = '2019-12-12T15:49:47Z'  # UTC of the begin of the test pass; the culmination is 48 deg

EVALUATION_START_S, EVALUATION_PERIOD_S = 15.0, 0.1  # start and period of the evaluation of the error [s]


def of_pass(begin: str, seed: int, changes: Sequence[str] = (), duration: Seconds | None = None,
            name: str = SCENARIO_NAME, low: Radians = -np.pi) -> Scenario:
    """Return the scenario of a pass or a scan that begins at a UTC. The antenna begins at the first predicted
    direction; low: least azimuth at which it begins."""
    chosen = [f'tracking_receiver.target.leo_pass.start_time={begin}', f'adu.wind.field.seed={seed}', *changes]
    _, angles = Plan(scenario.load(name, chosen, seed, duration)).tables['']
    azimuth, elevation = float(np.remainder(angles[0, 0] - low, 2.0 * np.pi) + low), float(angles[0, 1])
    return scenario.load(name, [*chosen, f'adu.initial_azimuth={azimuth:.4f}',
                                f'adu.initial_elevation={elevation:.4f}'], seed, duration)


def offsets_of(begin: str, seed: int, duration: Seconds | None = None) -> tuple[str, list[Point]]:
    """Return (label, points) of a pass in autotrack, for collect.joined."""
    chosen = of_pass(begin, seed, CALM_OVERRIDES, duration)
    track = checked(*Plan(chosen).tables[''])
    return begin, collect.listed('', collect.points(memory_recording.record(chosen), [track], POINTS_PER_PASS))


def offset_of_sun(begin: str, seed: int) -> tuple[str, list[Point]]:
    """Return (label, points) of a scan of the sun, for collect.joined. The azimuth begins on the turn of the wrap that
    holds the whole day of the sun."""
    chosen = of_pass(begin, seed, SCAN_OVERRIDES, None, SCAN_SCENARIO_NAME, -1.5 * np.pi)
    return begin, collect.listed('scan', scan.points(memory_recording.record(chosen), [])[:3])


def overrides(found: PointingCalibration) -> list[str]:
    """Return the overrides that give the control unit the model of a calibration."""
    model = dataclasses.replace(found, file='study').parameters()['acu']
    return [f'acu.{name}={value}' for name, value in model.items() if value]


def program_error(seed: int, changes: Sequence[str] = (), duration: Seconds | None = None) -> Degrees:
    """Return the rms of the true error of the beam in program track, of both axes together."""
    chosen = of_pass(TEST_PASS, SEEDS_PER_RUN * (seed + 1) - 1, (*PROGRAM_OVERRIDES, *changes), duration)
    run = closed_loop.Loop(chosen).run()
    every = round(EVALUATION_PERIOD_S / (run.t[1] - run.t[0]))
    errors = run.truth['error'][::every][run.t[::every] >= EVALUATION_START_S]
    return rms(np.degrees(errors))


def measured(seed: int, duration: Seconds | None = None) -> Offsets:
    """Return the offsets of the calibration passes and the scans of a run."""
    passes = [offsets_of(begin, SEEDS_PER_RUN * seed + i, duration) for i, begin in enumerate(CALIBRATION_PASSES)]
    scans = [offset_of_sun(begin, SEEDS_PER_RUN * seed + len(passes) + i) for i, begin in enumerate(SCANS)]
    return collect.joined([*passes, *scans], SCENARIO_NAME)


def bending(axis: AxisParameters) -> Radians:
    """Return the largest deflection of the dish by its unbalance, at elevation 0. The stiffness of the structure
    follows from the frequency at which the dish swings on it."""
    structure, load = axis.structure, axis.load
    return load.unbalance / ((2.0 * math.pi * structure.frequency)**2 * structure.inertia_share * load.inertia)


def truth() -> dict[str, Degrees]:
    """Return {name of a term: true value} of the scenario.

    The null of the difference channels is not on the axis of the beam. Because autotrack follows the null, this angle
    is a part of the collimation and of the zero of the elevation. The bending of the structure by the unbalance and
    the cosine of the elevation encoder are parts of the sag.
    """
    loaded = scenario.load(SCENARIO_NAME)
    drive, antenna = loaded.node_parameters('adu'), loaded.node_parameters('tracking_receiver').antenna
    mount, azimuth, elevation = drive.mount, drive.azimuth.encoder.error, drive.elevation.encoder.error
    values = {'P1': azimuth.zero, 'P3': mount.non_perpendicularity,
              'P4': mount.collimation + antenna.boresight_cross_elevation, 'P5': mount.tilt_forward,
              'P6': mount.tilt_starboard, 'P7': elevation.zero - antenna.boresight_elevation,
              'P8': mount.sag + bending(drive.elevation) + elevation.eccentricity_cos,
              'P11': elevation.eccentricity_sin, 'P13': azimuth.eccentricity_cos, 'P14': azimuth.eccentricity_sin}
    return {name: float(np.degrees(value)) for name, value in values.items()}


MEASURED_NAMES = ('raw_rms_deg', 'calibrated_rms_deg', 'residual_rms_deg', 'leave_one_out_rms_deg',
                  'leave_one_out_default_rms_deg', 'points')


def numbers_of_run(case: None, run: int, duration: Seconds | None) -> list[float]:
    """Return the numbers of a run: MEASURED_NAMES, then the values of TERMS and their sigmas."""
    seed = FIRST_SEED + run
    offsets = measured(seed, duration)
    found, default = (pointing.calibrate(offsets, names, 'exact') for names in (TERMS, DEFAULT_TERMS))
    return [program_error(seed, (), duration), program_error(seed, overrides(found), duration),
            rms(found.fit.residuals), rms(found.fit.left_out), rms(default.fit.left_out),
            len(offsets.places), *_of_terms(found)]


def _of_terms(found: PointingCalibration) -> tuple[float, ...]:
    values = dict(zip(found.fit.names, zip(found.fit.values, found.fit.sigma)))
    values |= {name: (0.0, sigma) for name, _, sigma in found.dropped}
    return *(values[name][0] for name in TERMS), *(values[name][1] for name in TERMS)


def run(progress: Progress, runs: int = DEFAULT_RUNS, pool: Pool | None = None,
        duration: Seconds | None = None) -> Result:
    """Measure the calibration over seeds; duration: length of a pass, None for that of the scenario."""
    numbers = of_cases(functools.partial(numbers_of_run, duration=duration), [None], runs, pool, progress, 1)[None]
    targets = {'calibrated_rms_deg': '<= 0.01'}
    rows = [row('program track', name, numbers[:, i], '' if name == 'points' else 'deg', target=targets.get(name))
            for i, name in enumerate(MEASURED_NAMES)]
    at, true = len(MEASURED_NAMES), truth()
    values, sigmas = np.split(numbers[:, at:], 2, axis=1)
    errors = values - [true[name] for name in TERMS]
    for i, name in enumerate(TERMS):
        rows += [row('terms', name, values[:, i], 'deg'), row('terms', f'{name}_true', true[name], 'deg'),
                 row('terms', f'{name}_sigma', sigmas[:, i], 'deg')]
    inside = np.abs(errors) < 3.0 * sigmas
    rows += [row('terms', 'within_3_sigma', float(inside.mean()), target='>= 0.99'),
             row('terms', 'cases', float(inside.size))]
    return Result(rows, {'calibration': functools.partial(figure, numbers, errors, sigmas)},
                  [f'Seeds {FIRST_SEED} to {FIRST_SEED + runs - 1}; {POINTS_PER_PASS} offsets from each of '
                   f'{len(CALIBRATION_PASSES)} passes, and {len(SCANS)} of the sun; the test pass begins at '
                   f'{TEST_PASS}.'])


def figure(numbers: Floats, errors: Floats, sigmas: Floats) -> Figure:
    """Draw the program-track error of each run before and after, and the errors of the terms in sigmas."""
    drawn, ((left, right),) = fig.new_panels(1, 2, height=3.0, x=('run', 'term'))
    for i, name in enumerate(('without a model', 'calibrated')):
        left.semilogy(np.arange(len(numbers)), numbers[:, i], '.', label=name)
    left.axhline(0.01, linewidth=0.8, linestyle='--')
    left.set_ylabel('program-track error, rms [deg]')
    left.legend()
    right.plot(np.arange(errors.shape[1]), (errors / sigmas).T, '.', color='#8d949e', markersize=3)
    right.set_xticks(range(errors.shape[1]), TERMS)
    right.set_ylabel('error [sigma]')
    return drawn
