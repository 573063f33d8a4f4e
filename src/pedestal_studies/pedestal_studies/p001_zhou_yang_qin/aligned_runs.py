"""Runs of an alignment: the IMU of a swaying ship of Zhou 2011, a navigator over its samples, sums of its errors.

The IMU, the sway of the ship and a white velocity of 0.05 m/s per axis are those of Zhou 2011 (section 5 and table 1).
The velocity has one value per 0.02 s. The paper does not state this period, and the results scale with it.
"""
import dataclasses
import functools
import math
import time
from collections.abc import Callable, Mapping
from typing import Annotated, NamedTuple, TypeAlias

import numpy as np

from pedestal_common.compiled import compiled
from pedestal_common.geometry.line_of_sight import to_deck
from pedestal_common.geometry.quaternion import product
from pedestal_common.quantities import (
    Degrees,
    Floats,
    Quaternion,
    Quaternions,
    Radians,
    Records,
    Seconds,
    Vector3,
    Vectors3,
    Xyz,
    Xyzw,
)
from pedestal_common.record import Record
from pedestal_results import tracking
from pedestal_results.intervals import pseudo_values
from pedestal_studies.p001_zhou_yang_qin import methods
from pedestal_studies.p001_zhou_yang_qin.methods import MethodParameters
from pedestal_workbench.trials import monte_carlo
from pedestal_workbench.trials.monte_carlo import Pool, Progress
from ship_motion_sim import imu, motion
from ship_motion_sim.params import (
    AlignmentParameters,
    ImuParameters,
    PlainParameters,
    ShipMotionParameters,
    ShipParameters,
)

BATCH_RUNS = 5  # runs that one worker makes at a time

BASE_SEED, QUADRANT_SEED, SWELL_SEED = 1, 2, 3
IMU_PERIOD_S, LAW_STEP_S, EVALUATION_PERIOD_S = 0.01, 0.02, 1.0

RUN_DURATION_S, SHORT_RUN_DURATION_S = 600.0, 300.0  # duration of a run, and of a run in a quadrant or on swell [s]

ARCMIN_RAD = math.radians(1.0 / 60.0)
HOUR_S = 3600.0
GYRO_BIAS_RAD_S, GYRO_NOISE_DENSITY = math.radians(0.01) / HOUR_S, math.radians(0.005) / 60.0  # [rad/s, rad/sqrt(s)]
G = 9.80665  # acceleration [m/s2] in whose unit the paper states errors of accelerometers
ACCELEROMETER_BIAS_M_S2, ACCELEROMETER_NOISE_DENSITY = 3e-5 * G, 6e-6 * G  # [m/s2, m/s/sqrt(s)]

SHIP_PARAMETERS = ShipParameters(motion='plain', speed=0.0, latitude_deg=34.0, plain=PlainParameters(
    roll_amplitude_deg=7.0, roll_period=1.0 / 0.3, pitch_amplitude_deg=5.0, pitch_period=1.0 / 0.5,
    yaw_amplitude_deg=9.0, yaw_period=1.0 / 0.2))
"""Ship with the sway of Zhou 2011, table 1. In the paper x points to starboard and y to the bow, so that a rotation
about x is our pitch."""

MISALIGNMENT_RAD = np.radians((3.0, 3.0, 180.0))  # misalignment a_x, a_y, a_z about east, north, up [rad]

VELOCITY_NOISE_M_S, SWELL_VELOCITY_M_S, SWELL_FREQUENCY_HZ = 0.05, 0.5, 0.1

INS_PARAMETERS = MethodParameters(AlignmentParameters(
    step=LAW_STEP_S, velocity_disturbance=VELOCITY_NOISE_M_S, gyro_noise=GYRO_NOISE_DENSITY,
    gyro_bias=GYRO_BIAS_RAD_S, accelerometer_bias=ACCELEROMETER_BIAS_M_S2))

Method: TypeAlias = tuple[str, MethodParameters]    # method of alignment, and the parameters of the INS


class AlignmentEstimate(Record):
    """Estimate of a navigator."""
    quaternion: Quaternion      # attitude deck -> earth
    azimuth_sigma: Radians      # 1 sigma of the azimuth that it states
    level_sigma: Radians        # 1 sigma of the level that it states


class Sensors(NamedTuple):
    """Records (1,) of an IMU on its ship."""
    state: Records      # imu.State
    constants: Records  # imu.Constants
    ship: Records       # motion.Constants
    inputs: Records     # imu.Inputs
    truth: Records      # motion.Truth
    outputs: Records    # imu.Outputs


class Increments(NamedTuple):
    """Samples of an IMU in FLU, each over IMU_PERIOD_S."""
    angle: Vectors3         # rotation [rad]
    force: Vectors3         # integral of the specific force [m/s]
    attitude: Quaternions   # true attitude at the end of each sample


AZIMUTH_COLUMN, EAST_TILT_COLUMN, LEVEL_COLUMNS = 2, 0, slice(0, 2)  # of an error about east, north, up


class Conditions(NamedTuple):
    """Conditions of a run."""
    heading_deg: Degrees    # of the ship
    misalignment: Vector3   # a_x, a_y, a_z [rad]
    # of three gyros and three accelerometers, as multiples of GYRO_BIAS_RAD_S and ACCELEROMETER_BIAS_M_S2
    biases: Annotated[Floats, (6,)]


class InformationLimit(NamedTuple):
    """1 sigmas at the instants of the evaluation."""
    azimuth: Floats     # [rad]
    level: Floats       # [rad]


class Sums(NamedTuple):
    """Sums over runs."""
    squares: Vectors3 | float = 0.0     # squared errors about east, north, up [rad2]
    ratios: Floats | float = 0.0        # squared ratio of the error in azimuth to its 1 sigma
    first: Vectors3 | None = None       # errors of the first run [rad], None if it is not among the runs
    wall_time: Seconds = 0.0            # of the steps of the alignment law
    steps: float = 0.0                  # number of these steps
    runs: int = 0                       # number of runs

    def plus(self, more: 'Sums') -> 'Sums':
        """Return the sum of these and more Sums."""
        return Sums(self.squares + more.squares, self.ratios + more.ratios,
                    more.first if self.first is None else self.first, self.wall_time + more.wall_time,
                    self.steps + more.steps, self.runs + more.runs)


JACKKNIFE_PARTS = 20  # parts of the runs for the jackknife (intervals.pseudo_values) of statistics over all runs


@dataclasses.dataclass(frozen=True)
class Accuracy:
    """Accuracy of a method."""
    parts: list[Sums]   # one for each part of its runs

    @functools.cached_property
    def whole(self) -> Sums:
        """Sums of all runs."""
        return functools.reduce(Sums.plus, self.parts)

    @property
    def rms(self) -> Vectors3:
        """Rms of the errors over the runs [arcmin]."""
        return np.sqrt(self.whole.squares / self.whole.runs) / ARCMIN_RAD

    @property
    def azimuth(self) -> Floats:
        """Rms of the error in azimuth over the runs [arcmin]."""
        return self.rms[:, AZIMUTH_COLUMN]

    @property
    def level(self) -> float:
        """Rms of the level errors over the runs and the time from SHORT_RUN_DURATION_S on [arcmin]."""
        return tracking.rms(self.rms[round(SHORT_RUN_DURATION_S / EVALUATION_PERIOD_S):, LEVEL_COLUMNS])

    @property
    def first(self) -> Vectors3:
        """Errors of the first run [rad]."""
        assert self.whole.first is not None
        return self.whole.first

    @property
    def ratio(self) -> Floats:
        """Rms over the runs of the ratio of the azimuth error to the 1 sigma that the navigator states."""
        return np.sqrt(self.whole.ratios / self.whole.runs)

    @property
    def step_us(self) -> float:
        """Wall time of a step of the alignment law [us]."""
        return 1e6 * self.whole.wall_time / self.whole.steps

    def over_parts(self, statistic: Callable[['Accuracy'], float]) -> Floats:
        """Return intervals.pseudo_values of a statistic."""
        return pseudo_values(self.parts, lambda parts: statistic(Accuracy(parts)))


@dataclasses.dataclass(frozen=True)
class Batch:
    """Runs first ... first + count - 1 of a kind."""
    kind: str   # '', 'swell' or 'quadrant-1' ... 'quadrant-4'
    first: int
    count: int

    @property
    def duration(self) -> Seconds:
        """Duration of its runs."""
        return SHORT_RUN_DURATION_S if self.kind else RUN_DURATION_S


@compiled
def simulate(sensors: Sensors, normals: Floats, velocity: Vectors3, out: Increments) -> None:
    """Fill `out` from an IMU on its ship; velocity (n + 1, 3): added to that of the ship, ENU [m/s]."""
    u, truth, measured = sensors.inputs[0], sensors.truth[0], sensors.outputs[0]
    dt = u.dt
    for k in range(len(out.angle)):
        u.t = (k + 1) * dt
        motion.truth(sensors.ship[0], u.t, truth)
        imu.step(sensors.state[0], sensors.constants[0], sensors.ship[0], u, truth, measured, normals[k])
        gained = velocity[k + 1] - velocity[k]
        x, y, z = to_deck(truth.mat_ed, gained[0], gained[1], gained[2])
        rate, push = measured.angular_velocity, measured.linear_acceleration
        for i in range(3):
            out.angle[k, i] = rate[i] * dt
            out.force[k, i] = push[i] * dt + (x if i == 0 else y if i == 1 else z)
        for i in range(4):
            out.attitude[k, i] = truth.quaternion[i]


@compiled
def align(state: Records, constants: Records, angle: Vectors3, force: Vectors3, dt: Seconds, every: int,
          estimates: Records) -> None:
    """Run a navigator over increments of dt, and write its AlignmentEstimate after every `every` increments."""
    for k in range(len(angle)):
        methods.step(state[0], constants[0], angle[k], force[k], dt)
        if (k + 1) % every == 0:
            s, out = state[0], estimates[(k + 1) // every - 1]
            q = out.quaternion
            q[0], q[1], q[2], q[3] = methods.attitude(s, constants[0])
            out.azimuth_sigma, out.level_sigma = s.azimuth_sigma, s.level_sigma


def quaternion(axis: int, angle: Radians) -> Quaternion:
    """Return the quaternion (x, y, z, w) of a rotation by an angle about an axis of ENU (0, 1, 2)."""
    q = np.zeros(4)
    q[axis], q[3] = math.sin(0.5 * angle), math.cos(0.5 * angle)
    return q


def misaligned(attitude: Quaternion, angles: Vector3) -> Quaternion | Xyzw:
    """Return the attitude deck -> n' for an attitude deck -> ENU: C_n^n' = R_y(a_y)^T R_x(a_x)^T R_z(a_z)^T; n': the
    frame that the INS takes for ENU."""
    turned: Quaternion | Xyzw = attitude
    for axis in (2, 0, 1):      # z, x, y: the order of the factors from right to left
        turned = product(quaternion(axis, -angles[axis]), turned)
    return turned


def draw_conditions(batch: Batch, random: np.random.Generator) -> Conditions:
    """Return the conditions of one run of a batch."""
    if not batch.kind.startswith('quadrant'):
        # The paper's axes point to starboard and to the bow; our x points to the bow, our y to port. Therefore the
        # biases along our y are negative.
        return Conditions(0.0, MISALIGNMENT_RAD, np.array((1.0, -1.0, 1.0, 1.0, -1.0, 1.0)))
    azimuth = 0.5 * math.pi * (int(batch.kind[-1]) - 1 + random.random())
    misalignment = np.array((*MISALIGNMENT_RAD[:2], azimuth))
    return Conditions(random.uniform(0.0, 360.0), misalignment, random.standard_normal(6))


def disturbance(batch: Batch, random: np.random.Generator, n: int) -> Vectors3:
    """Return the velocity (n + 1, 3) of the white noise and the swell at the samples of the IMU, ENU [m/s]."""
    held = round(LAW_STEP_S / IMU_PERIOD_S)     # samples of the IMU for which a value of the white noise holds
    velocity = np.repeat(VELOCITY_NOISE_M_S * random.standard_normal((n // held + 1, 3)), held, axis=0)[:n + 1]
    if batch.kind == 'swell':
        t = IMU_PERIOD_S * np.arange(n + 1)[:, None]
        velocity = velocity + SWELL_VELOCITY_M_S * np.sin(2.0 * math.pi * (SWELL_FREQUENCY_HZ * t + random.random(3)))
    return velocity


def simulated_run(batch: Batch, run: int) -> tuple[Increments, Quaternion | Xyzw]:
    """Return (samples, misaligned attitude at 0 s) of one run of a batch."""
    seed = {'': BASE_SEED, 'swell': SWELL_SEED}.get(batch.kind, QUADRANT_SEED)
    # The last character of the kind, its number, gives each quadrant a noise of its own; the kind '' has none.
    random = np.random.default_rng((seed, *batch.kind.encode()[-1:], run))
    conditions = draw_conditions(batch, random)
    biases = conditions.biases * np.repeat((GYRO_BIAS_RAD_S, ACCELEROMETER_BIAS_M_S2), 3)
    gyro: Xyz = biases[0], biases[1], biases[2]
    accelerometer: Xyz = biases[3], biases[4], biases[5]
    params = ShipMotionParameters(
        dataclasses.replace(SHIP_PARAMETERS, heading_deg=conditions.heading_deg),
        ImuParameters(*gyro, GYRO_NOISE_DENSITY, *accelerometer, ACCELEROMETER_NOISE_DENSITY, gyro_scale=90e-6,
                      accelerometer_scale=70e-6, output='increment'))
    ship, n = motion.constants(params.ship), round(batch.duration / IMU_PERIOD_S)
    ship['phase'][0, :4] = random.uniform(0.0, 2.0 * math.pi, 4)
    inputs, truth = imu.Inputs.zeros(), motion.Truth.zeros()
    inputs['dt'] = IMU_PERIOD_S
    motion.truth(ship[0], 0.0, truth[0])
    start = misaligned(truth[0]['quaternion'], conditions.misalignment)
    increments = Increments(np.zeros((n, 3)), np.zeros((n, 3)), np.zeros((n, 4)))
    simulate(Sensors(imu.initial_state(), imu.constants(params), ship, inputs, truth, imu.Outputs.zeros()),
             random.standard_normal((n, imu.IMU_NORMALS_PER_STEP)), disturbance(batch, random, n), increments)
    return increments, start


def errors(estimated: Quaternions, attitude: Quaternions) -> Vectors3:
    """Return the errors about east, north, up [rad] of an estimated attitude: the rotation vector of estimated times
    inverse true attitude. The sign of w selects the shorter of two rotations."""
    x, y, z, w = product(estimated.T, (attitude * (-1.0, -1.0, -1.0, 1.0)).T)
    size = np.sqrt(x * x + y * y + z * z)
    angle = 2.0 * np.arctan2(size, np.abs(w)) * np.sign(np.where(w == 0.0, 1.0, w))
    return np.stack((x, y, z), axis=1) * (angle / np.where(size > 0.0, size, 1.0))[:, None]


def align_batch(item: tuple[Batch, Mapping[str, Method]]) -> dict[str, Sums]:
    """Return {case: sums} of an item (batch, {case: method}), in which every case gets the same IMU samples."""
    batch, cases = item
    every, latitude = round(EVALUATION_PERIOD_S / IMU_PERIOD_S), math.radians(SHIP_PARAMETERS.latitude_deg)
    n = round(batch.duration / EVALUATION_PERIOD_S)
    sums: dict[str, Sums] = {}
    for i in range(batch.count):
        (angle, force, attitude), start = simulated_run(batch, batch.first + i)
        for case, (method, params) in cases.items():
            constants = methods.constants(params, method, latitude)
            state, estimates = methods.initial_state(constants, start), AlignmentEstimate.zeros(n)
            # This call compiles the law before the call that is timed.
            align(state.copy(), constants, angle[:2], force[:2], IMU_PERIOD_S, every, estimates)
            begun = time.perf_counter()
            align(state, constants, angle, force, IMU_PERIOD_S, every, estimates)
            wall_time = time.perf_counter() - begun
            e = errors(estimates['quaternion'], attitude[every - 1::every])
            sums[case] = sums.get(case, Sums()).plus(Sums(
                squares=e * e, ratios=(e[:, AZIMUTH_COLUMN] / estimates['azimuth_sigma'])**2,
                first=e if batch.first + i == 0 else None, wall_time=wall_time, steps=batch.duration / LAW_STEP_S,
                runs=1))
    return sums


def limit() -> InformationLimit:
    """Return the 1 sigmas that the method riccati_eso states for a motionless IMU without noise.

    The covariance depends on the assumed noises, not on the measurements. Noise and sway could only enlarge the 1
    sigmas, because innovations larger than expected increase them.
    """
    constants = methods.constants(INS_PARAMETERS, 'riccati_eso', math.radians(SHIP_PARAMETERS.latitude_deg))
    state, n = methods.initial_state(constants, (0.0, 0.0, 0.0, 1.0)), round(RUN_DURATION_S / IMU_PERIOD_S)
    estimates, still = AlignmentEstimate.zeros(round(RUN_DURATION_S / EVALUATION_PERIOD_S)), np.zeros((n, 3))
    # A deck at rest turns with the earth, and its accelerometers measure the reaction to gravity.
    k = constants[0]['conditions']
    still_force = np.tile((0.0, 0.0, float(k['gravity']) * IMU_PERIOD_S), (n, 1))
    align(state, constants, still + k['earth_rate'] * IMU_PERIOD_S, still_force, IMU_PERIOD_S,
          round(EVALUATION_PERIOD_S / IMU_PERIOD_S), estimates)
    return InformationLimit(estimates['azimuth_sigma'], estimates['level_sigma'])


def accuracies(kinds: Mapping[str, int], cases: Mapping[str, Method], pool: Pool,
               progress: Progress) -> dict[str, dict[str, Accuracy]]:
    """Return {kind of runs: {case: accuracy}}; kinds: {kind of runs: number of runs}."""
    batches = [Batch(kind, *part) for kind, count in kinds.items() for part in monte_carlo.batches(count, BATCH_RUNS)]
    parts = {(kind, case): [Sums()] * min(JACKKNIFE_PARTS, -(-count // BATCH_RUNS))
             for kind, count in kinds.items() for case in cases}
    for batch, sums in zip(batches, pool.map(align_batch, [(batch, cases) for batch in batches], progress)):
        for case, more in sums.items():
            of_case = parts[batch.kind, case]
            i = batch.first // BATCH_RUNS % len(of_case)
            of_case[i] = of_case[i].plus(more)
    return {kind: {case: Accuracy(parts[kind, case]) for case in cases} for kind in kinds}
