"""Benchmark `pedestal bench core`: speed of the compiled laws of drive, closed loop and filters on this machine.

The times are compared with targets and with the filters of filterpy.
"""
import functools
import math
import time

import llvmlite.binding
import numba
import numpy as np
from filterpy.kalman import IMMEstimator, KalmanFilter, MerweScaledSigmaPoints, UnscentedKalmanFilter

from acu_tracker.estimation.filters import axis_filter, unscented
from acu_tracker.estimation.filters.measurement import AxisMeasurement, AxisVariances, Estimate, Measurement
from acu_tracker.estimation.params import FilterParameters, UkfParameters
from acu_tracker.geometry.vector import AxisMotion, Motion
from adu_drive import drive_unit, lanes
from adu_drive import unit as adu_unit
from drive_law.params import AduParameters
from pedestal_bringup.loop import closed_loop, side_by_side
from pedestal_bringup.scenario import scenario
from pedestal_common.compiled import compiled
from pedestal_common.parameters import build
from pedestal_common.quantities import AnyRecord, Floats, Json, Records, Row, Times, Vectors3
from pedestal_results.intervals import single
from pedestal_studies.bench import Measured, best_of
from pedestal_workbench.trials import ensemble

CORE_DURATION_S, TRIAL_DURATION_S = 20.0, 10.0  # simulated durations of the closed loop and of a trial [s]
SHORT_RUN_STEPS, SHORT_RUN_COUNT = 40, 100
"""Drive steps of a run that is short enough to be rarely interrupted by other processes; number of these runs."""
SUBSTEPS_PER_STEP = 2 * 100  # sub-steps of the plant in one drive step of 5 ms: 100 of each axis


@compiled
def _drive_steps(state: Records, constants: Records, inputs: Records, outputs: Records, count: int) -> None:
    for _ in range(count):
        drive_unit.step(state[0], constants[0], inputs[0], outputs[0])


@compiled
def _steps_on_lanes(drives: AnyRecord, count: int) -> None:
    """Run the drives on all lanes; the processor computes all lanes together."""
    moving = adu_unit.DRIVE_LANES(drives)
    for _ in range(count):
        drive_unit.step(moving.state, moving.constants, moving.inputs, moving.outputs)


FILTER_STEPS, FILTERPY_STEPS, FILTER_PERIOD_S = 20_000, 500, 0.01
"""Steps of a compiled filter and of a filter of filterpy; time between two measurements [s]."""


def filter_step(**parameters: Json) -> float:
    """Return the time [us] of one prediction and correction of an axis_filter of FilterParameters on a noisy ramp."""
    constants = axis_filter.constants(build(FilterParameters, parameters))
    t = FILTER_PERIOD_S * np.arange(FILTER_STEPS, dtype=float)
    y = 0.02 * t + 5e-4 * np.random.default_rng(1).standard_normal(FILTER_STEPS)
    variance, state = np.full(FILTER_STEPS, 2.5e-7), axis_filter.Filter.zeros()
    _filter_steps(state, constants, t, y, variance)
    return best_of(lambda: _filter_steps(state, constants, t, y, variance)) / FILTER_STEPS * 1e6


@compiled
def _filter_steps(state: Records, constants: Records, t: Times, y: Floats, R: Floats) -> None:
    f, c = state[0], constants[0]
    axis_filter.start(f, c, y[0], R[0], 0.1)
    for k in range(1, len(y)):
        axis_filter.predict(f, c, t[k] - t[k - 1])
        axis_filter.correct(f, c, AxisMeasurement(y[k], R[k], math.nan, math.nan))


def unscented_step() -> float:
    """Return the time [us] of one step of both Cartesian filters, with azimuth, elevation and range measured."""
    state, constants = unscented.State.zeros(), unscented.constants(UkfParameters())
    noise = np.random.default_rng(1).standard_normal((FILTER_STEPS, 3)) * (5e-4, 5e-4, 1.0)
    measured = noise + np.outer(FILTER_PERIOD_S * np.arange(FILTER_STEPS), (0.001, 0.0, 0.0)) + (0.0, 0.3, 500.0)
    _unscented_steps(state, constants, measured)
    return best_of(lambda: _unscented_steps(state, constants, measured)) / FILTER_STEPS * 1e6


@compiled
def _unscented_steps(state: Records, constants: Records, measured: Vectors3) -> None:
    s, c = state[0], constants[0]
    R = 2.5e-7
    known = AxisVariances(R, 0.0, 0.01)
    first = Estimate(Motion(AxisMotion(0.0, 0.0, 0.0), AxisMotion(0.3, 0.0, 0.0)), (known, known))
    unscented.start(s, c, first, 500.0, 1.0)
    for k in range(len(measured)):
        A, E, r = measured[k]
        unscented.predict(s, c, FILTER_PERIOD_S)
        m = Measurement(0.0, (AxisMeasurement(A, R, math.nan, math.nan), AxisMeasurement(E, R, math.nan, math.nan)),
                        r, 1.0)
        unscented.innovation(s, m)
        unscented.correct(s, m)


def filterpy_unscented() -> IMMEstimator:
    """Return filterpy's counterpart of the compiled Cartesian filters: states position (east, north, up) [m],
    velocity, acceleration; measured azimuth, elevation [rad], range [m]."""
    def unscented_filter() -> UnscentedKalmanFilter:
        made = UnscentedKalmanFilter(
            9, 3, FILTER_PERIOD_S, lambda x: np.array([np.arctan2(x[0], x[1]), np.arctan2(x[2], np.hypot(x[0], x[1])),
                                                       np.linalg.norm(x[:3])]),
            lambda x, dt: F @ x, MerweScaledSigmaPoints(9, unscented.ALPHA, unscented.BETA, unscented.KAPPA))
        made.x = np.array([0.0, 478.0, 148.0, 0.5, *np.zeros(5)])
        made.Q, made.R = 0.01 * np.eye(9), np.diag([2.5e-7, 2.5e-7, 1.0])
        return made

    T = FILTER_PERIOD_S
    # F: transition over T of a target of constant acceleration
    F = np.kron([[1.0, T, 0.5 * T * T], [0.0, 1.0, T], [0.0, 0.0, 1.0]], np.eye(3))
    return IMMEstimator([unscented_filter(), unscented_filter()], np.full(2, 0.5),
                        np.array([[0.998, 0.002], [0.002, 0.998]]))


def filterpy_steps() -> list[float]:
    """Return the times [us] of predict and update of filterpy's KalmanFilter of three states, IMMEstimator of three of
    them, and IMMEstimator of two unscented filters."""
    def kalman_filter() -> KalmanFilter:
        made = KalmanFilter(3, 1)
        made.F = np.array([[1.0, FILTER_PERIOD_S, 0.5 * FILTER_PERIOD_S**2], [0.0, 1.0, FILTER_PERIOD_S],
                           [0.0, 0.0, 1.0]])
        made.H, made.R, made.Q = np.array([[1.0, 0.0, 0.0]]), np.array([[2.5e-7]]), 1e-6 * np.eye(3)
        return made

    def steps(estimator: KalmanFilter | IMMEstimator, measured: Floats) -> None:
        for _ in range(FILTERPY_STEPS):
            estimator.predict()
            estimator.update(measured)

    switching = 0.001 + 0.997 * np.eye(3)       # probabilities of a change of the model in one step
    angle = np.zeros((1, 1))
    cases = ((kalman_filter(), angle),
             (IMMEstimator([kalman_filter() for _ in range(3)], np.full(3, 1 / 3), switching), angle),
             (filterpy_unscented(), np.array([0.0, 0.3, 500.0])))
    return [best_of(functools.partial(steps, *case), 3) / FILTERPY_STEPS * 1e6 for case in cases]


def filter_rows() -> list[Row]:
    """Return the rows of the time of a filter step, of our filters and of the filters of filterpy."""
    steps = (filter_step(kind='current_statistical'),
             filter_step(**{'kind': 'imm', 'imm.models': 'cv ca current_statistical',
                                                      'imm.rungs': 1}), unscented_step())
    rows = []
    for metric, ours, target, theirs in zip(('kalman', 'imm3', 'imm_ukf'), steps, ('<= 2', '<= 10', None),
                                            filterpy_steps()):
        rows += [single('core', f'{metric}_step_us', ours, 'us', target),
                 single('filterpy', f'{metric}_step_us', theirs, 'us'),
                 single('filterpy', f'{metric}_ratio', theirs / ours, '')]
    return rows


def drive_rows() -> list[Row]:
    """Return the rows of the time of a plant sub-step, in one drive and on a lane, and of the trial speed. The trial
    speed is the simulated time of all lanes over the CPU time of one core."""
    params = AduParameters(initial_elevation=0.7)
    one = adu_unit.DriveRecord.zeros()
    one['state'], one['constants'] = drive_unit.initial_state(params), drive_unit.constants(params)
    one['inputs']['azimuth']['rate'], one['inputs']['elevation']['rate'], one['inputs']['enable'] = 0.02, -0.01, 1
    drives, (state, constants, inputs, outputs) = lanes.to_lanes(one), (
        one[name] for name in ('state', 'constants', 'inputs', 'outputs'))
    _drive_steps(state, constants, inputs, outputs, 200)
    _steps_on_lanes(drives, 200)
    alone, together = zip(*((best_of(lambda: _drive_steps(state, constants, inputs, outputs, SHORT_RUN_STEPS), 1),
                             best_of(lambda: _steps_on_lanes(drives, SHORT_RUN_STEPS), 1))
                            for _ in range(SHORT_RUN_COUNT)))
    substep = min(alone) / SHORT_RUN_STEPS / SUBSTEPS_PER_STEP * 1e9
    on_lanes = min(together) / SHORT_RUN_STEPS / SUBSTEPS_PER_STEP / lanes.LANE_COUNT * 1e9
    trials = [scenario.load('leo_pass', seed=seed, duration=TRIAL_DURATION_S) for seed in range(lanes.LANE_COUNT)]
    side_by_side.runs([closed_loop.Loop(trial) for trial in trials], ensemble.MEASURED_TOPICS)
    seconds = math.inf
    for _ in range(3):
        loops, begun = [closed_loop.Loop(trial) for trial in trials], time.process_time()
        side_by_side.runs(loops, ensemble.MEASURED_TOPICS)
        seconds = min(seconds, time.process_time() - begun)
    return [single('core', 'substep_ns', substep, 'ns', '<= 45'),
            single('lanes', 'substep_ns', on_lanes, 'ns', '<= 8'),
            single('lanes', 'ratio', substep / on_lanes, '-', '>= 4'),
            single('lanes', 'realtime_factor', lanes.LANE_COUNT * TRIAL_DURATION_S / seconds, '', '>= 1000')]


def run() -> Measured:
    """Run the benchmark."""
    drives = drive_rows()
    loop = scenario.load('ship_pass', duration=CORE_DURATION_S)
    closed_loop.Loop(loop).run()
    loops = [closed_loop.Loop(loop) for _ in range(5)]
    factor = CORE_DURATION_S / best_of(lambda: loops.pop().run())

    rows = [*drives, single('core', 'realtime_factor', factor, '', '>= 200'), *filter_rows()]
    return Measured(f'compiled core, one core of {llvmlite.binding.get_host_cpu_name()}, numba {numba.__version__}',
                    rows)
