"""The INS of method `model`: the true attitude with parametrised errors, released after a latency.

The node `ins` subscribes only to `ship/imu/data_raw`, which has no attitude (REP 145, the ROS convention for an IMU,
reserves it for `imu/data`). So the INS evaluates the stateless law of the ship motion (sea.motion) at the stamp of
each IMU message, and adds its errors. Its `ship` parameters must be those of ship_motion_node. The INS compares the
rate of the IMU with that of the law, and its status reports a difference. `aligning_ins` integrates the IMU instead.

Arguments: s state, c constants, i inputs, out outputs (records of this module).
"""
import math
from typing import Annotated

import numpy as np

from pedestal_common.codes import codes
from pedestal_common.compiled import compiled
from pedestal_common.geometry.line_of_sight import quaternion
from pedestal_common.quantities import Floats, Vector3
from pedestal_common.record import Record
from ship_motion_sim import earth, imu
from ship_motion_sim.params import InsParameters
from ship_motion_sim.sea import motion

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
    """Record."""
    ship: motion.Constants
    earth_rate: Vector3  # ENU [rad/s]
    bias: Vector3  # roll, pitch, yaw [rad]
    wander: Vector3  # rms of the slow error of roll, pitch, yaw [rad]
    wander_time: float  # correlation time of the slow error [s]
    noise: Vector3  # rms of the white noise of roll, pitch, yaw [rad]
    rate_noise: float  # rms of the white noise of the deck rate [rad/s]
    imu_tolerance: float  # largest difference between the rates of IMU and law [rad/s]
    latency_ns: int
    variance: Vector3  # declared variance of roll, pitch, heading [rad2]
    walk: Vector3  # declared random walk of roll, pitch, heading [rad/sqrt(s)]


LATENCY_RING_FIELDS = [
    ('measured', 'i8'), ('released', 'i8'),     # numbers of samples in and out; n has the index n % LATENCY_RING_SIZE
    ('stamp_ns', 'i8', (LATENCY_RING_SIZE,)),
    ('quaternion', 'f8', (LATENCY_RING_SIZE, 4)),
    ('angular_velocity', 'f8', (LATENCY_RING_SIZE, 3)),
    ('linear_acceleration', 'f8', (LATENCY_RING_SIZE, 3)),
    ('variance', 'f8', (LATENCY_RING_SIZE, 3)),
    ('stage', 'i8', (LATENCY_RING_SIZE,)),
]
"""Ring of the samples whose latency has not passed."""

State = np.dtype([
    ('last_stamp_ns', 'i8'),
    ('wander', 'f8', (3,)),                 # slow error of roll, pitch, yaw [rad]
    ('truth', motion.Truth.dtype),        # ship at the last stamp
    *LATENCY_RING_FIELDS,
], align=True)


class Inputs(Record):
    """Record."""
    stamp_ns: int  # of the IMU message
    angular_velocity: Vector3  # of the IMU message [rad/s]
    linear_acceleration: Vector3  # of the IMU message [m/s2]


class Outputs(Record):
    """Record."""
    status: int  # one of Status, index into INS_STATUS_TEXTS
    due: int  # 1: the result below is new; 0: nothing to publish
    stamp_ns: int  # of the measurement
    quaternion: Annotated[Floats, (4,)]  # x, y, z, w, deck -> earth, with error
    angular_velocity: Vector3  # deck against earth, FLU, with noise [rad/s]
    linear_acceleration: Vector3  # of the IMU message with this stamp [m/s2]
    variance: Vector3  # declared variance of roll, pitch, heading [rad2]
    stage: int  # stage of this result, index of navigator.STAGES; NO_STAGE for the model
    noise: Vector3
    walk: Vector3  # declared, of roll, pitch, heading [rad], [rad/sqrt(s)]
    velocity: Vector3  # present velocity of an INS that navigates, ENU [m/s]


NO_STAGE = -1  # stage of a result of method `model`


def constants(params: InsParameters) -> np.ndarray:
    """Return the record (1,) of Constants."""
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


def model_variance(p):
    """Return the variance of roll, pitch and heading [rad2] that the method `model` declares; p: InsParameters."""
    return (p.roll_bias**2 + p.tilt_wander**2 + p.tilt_noise**2, p.pitch_bias**2 + p.tilt_wander**2 + p.tilt_noise**2,
            p.heading_bias**2 + p.heading_wander**2 + p.heading_noise**2)


def initial_state() -> np.ndarray:
    """Return the record (1,) of State before the first sample."""
    state = np.zeros(1, State)
    state['last_stamp_ns'] = NO_STAMP
    return state


@compiled
def wander(c, s, stamp_ns, normals):
    """Advance the slow errors [rad] of roll, pitch and yaw to stamp_ns; normals: three or more.

    The errors are first-order Gauss-Markov processes. The step is exact for any length, and the first errors have the
    final rms.
    """
    kept = 0.0      # share of the last error in the new error
    if s.last_stamp_ns != NO_STAMP:
        kept = math.exp(-1e-9 * (stamp_ns - s.last_stamp_ns) / c.wander_time)
    fresh = math.sqrt(1.0 - kept * kept)
    for i in range(3):
        s.wander[i] = kept * s.wander[i] + fresh * c.wander[i] * normals[i]
    s.last_stamp_ns = stamp_ns


@compiled
def disagrees(truth, c, measured):
    """Return True if a measured rate (3,) [rad/s] differs by more than imu_tolerance from the rate of the true
    ship."""
    wx, wy, wz = imu.inertial_rate(truth, c.earth_rate)
    return max(abs(measured[0] - wx), abs(measured[1] - wy), abs(measured[2] - wz)) > c.imu_tolerance


@compiled
def measure(c, s, stamp_ns, force, normals):
    """Put attitude and rate at stamp_ns, with errors, and the specific force (3,) of the IMU [m/s2] into the ring."""
    n, truth = s.measured % LATENCY_RING_SIZE, s.truth
    roll = truth.roll + c.bias[0] + s.wander[0] + c.noise[0] * normals[3]
    pitch = truth.pitch + c.bias[1] + s.wander[1] + c.noise[1] * normals[4]
    yaw = truth.yaw + c.bias[2] + s.wander[2] + c.noise[2] * normals[5]
    q, w = s.quaternion, s.angular_velocity
    q[n, 0], q[n, 1], q[n, 2], q[n, 3] = quaternion(roll, pitch, yaw)
    for i in range(3):
        w[n, i] = truth.angular_velocity[i] + c.rate_noise * normals[6 + i]
        s.linear_acceleration[n, i] = force[i]
        s.variance[n, i] = c.variance[i]
    s.stage[n] = NO_STAGE
    s.stamp_ns[n] = stamp_ns
    s.measured += 1


@compiled
def release(c, s, now_ns, out):
    """Put the newest sample whose age at now_ns has reached the latency into the outputs `out`.

    out.due is 0 if no sample has reached the latency since the last step.
    """
    out.due = 0
    while s.released < s.measured and s.stamp_ns[s.released % LATENCY_RING_SIZE] <= now_ns - c.latency_ns:
        s.released += 1
        out.due = 1
    if out.due == 1:
        n = (s.released - 1) % LATENCY_RING_SIZE
        out.stamp_ns = s.stamp_ns[n]
        for i in range(4):
            out.quaternion[i] = s.quaternion[n, i]
        for i in range(3):
            out.angular_velocity[i] = s.angular_velocity[n, i]
            out.linear_acceleration[i] = s.linear_acceleration[n, i]
            out.variance[i] = s.variance[n, i]
        out.stage = s.stage[n]


@compiled
def step(s, c, i, out, normals):
    """Take one IMU message.

    s, c, i, out: records State, Constants, Inputs, Outputs; normals: (INS_NORMALS_PER_STEP,).
    A stamp that does not advance changes nothing, and a message that is not finite gives no sample. The status reports
    both.
    """
    out.status, out.due, out.stage = Status.OK, 0, NO_STAGE
    if i.stamp_ns <= s.last_stamp_ns:
        out.status = Status.BAD_STAMP
        return
    wander(c, s, i.stamp_ns, normals)
    motion.truth(c.ship, 1e-9 * i.stamp_ns, s.truth)
    for n in range(3):
        if not (math.isfinite(i.angular_velocity[n]) and math.isfinite(i.linear_acceleration[n])):
            out.status = Status.BAD_IMU
    if out.status == Status.OK:
        if disagrees(s.truth, c, i.angular_velocity):
            out.status = Status.IMU_DISAGREES
        if s.measured - s.released == LATENCY_RING_SIZE:
            s.released += 1
            out.status = Status.BUFFER_FULL
        measure(c, s, i.stamp_ns, i.linear_acceleration, normals)
    for n in range(3):
        out.noise[n], out.walk[n] = c.noise[n], c.walk[n]
    release(c, s, i.stamp_ns, out)
