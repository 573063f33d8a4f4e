"""The INS of method `model`: the true attitude with parametrised errors, released after a latency.

The node `ins` subscribes only to `ship/imu/data_raw`, which has no attitude (REP 145 reserves it for `imu/data`). So
the INS evaluates the stateless law motion.truth at the stamp of each IMU message, and adds its errors. Its `ship`
parameters must be those of ship_motion_node. The INS compares the rate of the IMU with that of the law, and its status
reports a difference.
"""
import math
from typing import Annotated, Protocol

from pedestal_common import ring
from pedestal_common.codes import codes
from pedestal_common.compiled import compiled
from pedestal_common.geometry.line_of_sight import quaternion
from pedestal_common.quantities import (
    Bit,
    Floats,
    Ints,
    Nanoseconds,
    Quaternion,
    RadiansPerSecond,
    Records,
    Seconds,
    Vector3,
)
from pedestal_common.record import Record
from ship_motion_sim import earth, imu, motion
from ship_motion_sim.params import InsParameters

INS_NORMALS_PER_STEP = 9
"""Number of standard normals of a step: three for the slow errors, three for the attitude, three for the rate."""
STATUS_TEXTS = dict(
    OK='ok', BAD_STAMP='stamp does not advance', BAD_IMU='IMU data are not finite',
    IMU_DISAGREES='IMU disagrees with the ship parameters of the INS',
    BUFFER_FULL='more samples than the latency buffer holds',
    ATTITUDE_LOST='no IMU data for too long: the attitude is lost, the alignment starts again')
INS_STATUS_TEXTS = tuple(STATUS_TEXTS.values())
Status = codes(STATUS_TEXTS)

LATENCY_RING_SIZE = 256  # largest number of samples that wait for the latency to pass: the largest latency at 1 kHz
NO_STAMP = -2 ** 63  # stamp before the first message


class Constants(Record):
    """Errors of the INS."""
    ship: motion.Constants
    earth_rate: Vector3     # ENU [rad/s]
    bias: Vector3           # roll, pitch, yaw [rad]
    wander: Vector3         # rms of the slow error of roll, pitch, yaw [rad]
    wander_time: Seconds    # correlation time of the slow error
    noise: Vector3          # rms of the white noise of roll, pitch, yaw [rad]
    rate_noise: RadiansPerSecond        # rms of the white noise of the deck rate
    imu_tolerance: RadiansPerSecond     # largest difference between the rates of IMU and law
    latency_ns: Nanoseconds
    variance: Vector3       # declared variance of roll, pitch, heading [rad2]
    walk: Vector3           # declared random walk of roll, pitch, heading [rad/sqrt(s)]


class LatencyRing(Record):
    """Ring of the samples whose latency has not passed."""
    written: int            # numbers of samples in and out, see pedestal_common.ring
    released: int
    ring_stamp_ns: Annotated[Ints, (LATENCY_RING_SIZE,)]
    quaternion: Annotated[Floats, (LATENCY_RING_SIZE, 4)]
    angular_velocity: Annotated[Floats, (LATENCY_RING_SIZE, 3)]     # [rad/s]
    linear_acceleration: Annotated[Floats, (LATENCY_RING_SIZE, 3)]  # [m/s2]
    variance: Annotated[Floats, (LATENCY_RING_SIZE, 3)]             # [rad2]
    stage: Annotated[Ints, (LATENCY_RING_SIZE,)]


class _Errors(Record):
    last_stamp_ns: Nanoseconds
    wander: Vector3         # slow error of roll, pitch, yaw [rad]
    truth: motion.Truth     # ship at the last stamp


class State(LatencyRing, _Errors):
    """State of the INS. The fields of the last base come first."""


class LateIns(Protocol):
    """Constants of an INS of either kind."""
    latency_ns: Nanoseconds


class Inputs(Record):
    """Inputs of the INS: a message of the IMU."""
    stamp_ns: Nanoseconds
    angular_velocity: Vector3       # [rad/s]
    linear_acceleration: Vector3    # [m/s2]


class Outputs(Record):
    """Result of a step."""
    status: int                     # one of Status, index into INS_STATUS_TEXTS
    due: Bit                        # 1: the result below is new; 0: nothing to publish
    stamp_ns: Nanoseconds           # of the measurement
    quaternion: Quaternion          # deck -> earth, with error
    angular_velocity: Vector3       # deck against earth, FLU, with noise [rad/s]
    linear_acceleration: Vector3    # of the IMU message with this stamp [m/s2]
    variance: Vector3               # declared variance of roll, pitch, heading [rad2]
    stage: int                      # stage of this result, index of navigator.STAGES; NO_STAGE for the model
    noise: Vector3                  # declared, of roll, pitch, heading [rad]
    walk: Vector3                   # [rad/sqrt(s)]
    velocity: Vector3               # present velocity of an INS that navigates, ENU [m/s]


NO_STAGE = -1  # stage of a result of method `model`


def constants(params: InsParameters) -> Records:
    """Return the Constants (1,)."""
    record = Constants.zeros()
    record['ship'] = motion.constants(params.ship)
    record['earth_rate'] = earth.rate(math.radians(params.ship.latitude_deg))
    record['bias'] = params.roll_bias, params.pitch_bias, -params.heading_bias
    record['wander'] = params.tilt_wander, params.tilt_wander, params.heading_wander
    record['wander_time'] = params.wander_time
    record['noise'] = params.tilt_noise, params.tilt_noise, params.heading_noise
    record['rate_noise'] = params.rate_noise
    record['imu_tolerance'] = params.imu_tolerance
    record['latency_ns'] = round(params.latency * 1e9)
    record['variance'] = model_variance(params)
    record['walk'] = math.sqrt(2.0 / params.wander_time) * record['wander']
    return record


def model_variance(p: InsParameters) -> tuple[float, float, float]:
    """Return the variance of roll, pitch and heading [rad2] that the method `model` declares."""
    return (p.roll_bias**2 + p.tilt_wander**2 + p.tilt_noise**2, p.pitch_bias**2 + p.tilt_wander**2 + p.tilt_noise**2,
            p.heading_bias**2 + p.heading_wander**2 + p.heading_noise**2)


def initial_state() -> Records:
    """Return the State (1,) before the first sample."""
    return State.of(last_stamp_ns=NO_STAMP)


@compiled
def wander(constants: Constants, state: State, stamp_ns: Nanoseconds, normals: Floats) -> None:
    """Advance the slow errors [rad] of roll, pitch and yaw, first-order Gauss-Markov processes. The step is exact for
    any length, and the first errors have the final rms; normals: three or more."""
    kept = 0.0      # share of the last error in the new error
    if state.last_stamp_ns != NO_STAMP:
        kept = math.exp(-1e-9 * (stamp_ns - state.last_stamp_ns) / constants.wander_time)
    fresh = math.sqrt(1.0 - kept * kept)
    for i in range(3):
        state.wander[i] = kept * state.wander[i] + fresh * constants.wander[i] * normals[i]
    state.last_stamp_ns = stamp_ns


@compiled
def disagrees(truth: motion.Truth, constants: Constants, measured: Vector3) -> bool:
    """Return True if a measured rate [rad/s] differs by more than imu_tolerance from the rate of the true ship."""
    wx, wy, wz = imu.inertial_rate(truth, constants.earth_rate)
    return max(abs(measured[0] - wx), abs(measured[1] - wy), abs(measured[2] - wz)) > constants.imu_tolerance


@compiled
def measure(constants: Constants, state: State, stamp_ns: Nanoseconds, force: Vector3, normals: Floats) -> None:
    """Put attitude and rate at stamp_ns, with errors, and the specific force of the IMU [m/s2] into the ring."""
    n, truth = ring.put(state, stamp_ns), state.truth
    roll = truth.roll + constants.bias[0] + state.wander[0] + constants.noise[0] * normals[3]
    pitch = truth.pitch + constants.bias[1] + state.wander[1] + constants.noise[1] * normals[4]
    yaw = truth.yaw + constants.bias[2] + state.wander[2] + constants.noise[2] * normals[5]
    q, w = state.quaternion, state.angular_velocity
    q[n, 0], q[n, 1], q[n, 2], q[n, 3] = quaternion(roll, pitch, yaw)
    for i in range(3):
        w[n, i] = truth.angular_velocity[i] + constants.rate_noise * normals[6 + i]
        state.linear_acceleration[n, i] = force[i]
        state.variance[n, i] = constants.variance[i]
    state.stage[n] = NO_STAGE


@compiled
def release(constants: LateIns, samples: LatencyRing, now_ns: Nanoseconds, out: Outputs) -> None:
    """Put the newest sample that is older than the latency into `out`; out.due is 0 if there is no new one."""
    n = ring.release(samples, now_ns - constants.latency_ns)
    out.due = 0 if n == ring.NONE_DUE else 1
    if out.due == 1:
        out.stamp_ns = samples.ring_stamp_ns[n]
        for i in range(4):
            out.quaternion[i] = samples.quaternion[n, i]
        for i in range(3):
            out.angular_velocity[i] = samples.angular_velocity[n, i]
            out.linear_acceleration[i] = samples.linear_acceleration[n, i]
            out.variance[i] = samples.variance[n, i]
        out.stage = samples.stage[n]


@compiled
def step(state: State, constants: Constants, inputs: Inputs, out: Outputs, normals: Floats) -> None:
    """Take one IMU message; normals (INS_NORMALS_PER_STEP,). A stamp that does not advance changes nothing, and a
    message that is not finite gives no sample. The status reports both."""
    out.status, out.due, out.stage = Status.OK, 0, NO_STAGE
    if inputs.stamp_ns <= state.last_stamp_ns:
        out.status = Status.BAD_STAMP
        return
    wander(constants, state, inputs.stamp_ns, normals)
    motion.truth(constants.ship, 1e-9 * inputs.stamp_ns, state.truth)
    for n in range(3):
        if not (math.isfinite(inputs.angular_velocity[n]) and math.isfinite(inputs.linear_acceleration[n])):
            out.status = Status.BAD_IMU
    if out.status == Status.OK:
        if disagrees(state.truth, constants, inputs.angular_velocity):
            out.status = Status.IMU_DISAGREES
        if ring.full(state):
            out.status = Status.BUFFER_FULL
        measure(constants, state, inputs.stamp_ns, inputs.linear_acceleration, normals)
    for n in range(3):
        out.noise[n], out.walk[n] = constants.noise[n], constants.walk[n]
    release(constants, state, inputs.stamp_ns, out)
