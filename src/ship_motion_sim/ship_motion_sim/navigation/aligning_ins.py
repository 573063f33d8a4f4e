"""The INS of every method except `model`: integration of the IMU, alignment, navigation and estimated accuracy.

This INS takes the messages of `ship/imu/data_raw` and puts out attitude and deck rate after a latency, as `ins` does.
Its `ship` parameters serve only for the latitude and for the true velocity, which an aid measures with noise.
Arguments: s state, c constants, i inputs, out outputs (records of this module and of ins).
"""
import math

import numpy as np

from pedestal_common.compiled import compiled
from pedestal_common.geometry.line_of_sight import quaternion, rotation, to_deck
from pedestal_common.parameters import ParameterError
from pedestal_common.quantities import Vector3
from pedestal_common.record import Record
from ship_motion_sim import earth
from ship_motion_sim.navigation import ins, navigator
from ship_motion_sim.navigation.ins import LATENCY_RING_FIELDS, LATENCY_RING_SIZE, NO_STAMP
from ship_motion_sim.params import InsParameters
from ship_motion_sim.sea import motion

MAX_IMU_GAP_S = 0.1
"""Longest time between two usable IMU messages over which the INS integrates [s].

An angular acceleration of the deck of 0.1 rad/s2 causes an error of 0.5 mrad within this time.
"""


class Constants(Record):
    """Record."""
    ship: motion.Constants
    earth_rate: Vector3  # ENU [rad/s]
    latency_ns: int
    increment: int  # 1: mean rates of the IMU since its last sample, 0: rates at the stamp
    aid_noise: float  # rms [m/s]
    navigator: navigator.Constants
    power_up: navigator.State  # state of the navigator at power-up


State = np.dtype([
    ('last_stamp_ns', 'i8'),
    ('truth', motion.Truth.dtype),        # true motion of the ship, for the aid
    *LATENCY_RING_FIELDS,
    ('navigator', navigator.State.dtype),
    ('imu_stamp_ns', 'i8'),                 # of the last usable IMU message
    ('last_rate', 'f8', (3,)), ('last_force', 'f8', (3,)),      # in the last usable IMU message
    ('angle', 'f8', (3,)), ('force', 'f8', (3,)),   # increments since that message [rad, m/s]
    ('aid', 'f8', (3,)),                    # velocity that the aid measures [m/s]
    ('mat_ed', 'f8', (3, 3)),               # estimated deck -> earth
], align=True)


def constants(params: InsParameters) -> np.ndarray:
    """Return the record (1,) of Constants. Raises ParameterError if the azimuth cannot reach
    alignment.aligned_sigma."""
    record, latitude = Constants.zeros(), math.radians(params.ship.latitude_deg)
    record['ship'] = motion.constants(params.ship)
    record['earth_rate'] = earth.rate(latitude)
    record['latency_ns'] = round(params.latency * 1e9)
    record['increment'], record['aid_noise'] = params.imu_output == 'increment', params.aid.noise
    record['navigator'] = navigator.constants(params.alignment, params.method, params.aid.source, latitude)
    aligned, least = params.alignment.aligned_sigma, navigator.least_azimuth_sigma(record['navigator'][0])
    if aligned <= least:
        raise ParameterError(f'alignment.aligned_sigma = {aligned:g} rad: must be above {least:.3g} rad, the limit of '
                             f'method {params.method} at latitude {params.ship.latitude_deg:g} deg with '
                             f'alignment.gyro_bias = {params.alignment.gyro_bias:g} rad/s')
    yaw = math.radians(90.0 - params.alignment.initial_heading_deg)
    record['power_up'] = navigator.initial_state(record['navigator'], quaternion(0.0, 0.0, yaw))
    return record


def initial_state(constants) -> np.ndarray:
    """Return the record (1,) of State before the first sample; constants: Constants (1,)."""
    state = np.zeros(1, State)
    state['last_stamp_ns'] = state['imu_stamp_ns'] = NO_STAMP
    state['navigator'] = constants['power_up']
    return state


@compiled
def measure_aid(c, s, stamp_ns, normals):
    """Put the velocity [m/s] that the aid measures at stamp_ns, with noise, into s.aid; normals: three or more."""
    if c.navigator.aid == navigator.AID_NONE:
        return
    motion.truth(c.ship, 1e-9 * stamp_ns, s.truth)
    for i in range(3):
        v = s.truth.velocity_deck[i] if c.navigator.aid == navigator.AID_LOG else s.truth.velocity[i]
        s.aid[i] = v + c.aid_noise * normals[i]


@compiled
def integrate(c, s, stamp_ns, rate, force):
    """Integrate an IMU message, rate (3,) [rad/s] and force (3,) [m/s2], at stamp_ns.

    Return False after a gap above MAX_IMU_GAP_S, which resets the INS to the state at power-up. Mean rates directly
    give the increments; rates at the stamps are integrated by the trapezoidal rule. The first message after power-up
    is not integrated, because its interval began before power-up.
    """
    dt = 1e-9 * (stamp_ns - s.imu_stamp_ns) if s.imu_stamp_ns != NO_STAMP else 0.0
    if dt > MAX_IMU_GAP_S:
        s.navigator, s.imu_stamp_ns = c.power_up, NO_STAMP
        return False
    if dt > 0.0:
        for i in range(3):
            if c.increment == 1:
                s.angle[i], s.force[i] = dt * rate[i], dt * force[i]
            else:
                s.angle[i] = 0.5 * dt * (rate[i] + s.last_rate[i])
                s.force[i] = 0.5 * dt * (force[i] + s.last_force[i])
        navigator.step(s.navigator, c.navigator, s.angle, s.force, dt, s.aid)
    return True


@compiled
def measure(c, s, stamp_ns, rate, force):
    """Put attitude and deck rate of the navigator at stamp_ns into the ring; rate, force (3,): of the IMU message."""
    n = s.measured % LATENCY_RING_SIZE
    q, w = s.quaternion, s.angular_velocity
    q[n, 0], q[n, 1], q[n, 2], q[n, 3] = navigator.attitude(s.navigator, c.navigator)
    rotation(q[n, 0], q[n, 1], q[n, 2], q[n, 3], s.mat_ed)
    e = c.earth_rate
    ex, ey, ez = to_deck(s.mat_ed, e[0], e[1], e[2])
    first = s.imu_stamp_ns == NO_STAMP
    for i in range(3):
        # A mean rate belongs to the middle of its interval; this extrapolates it to the stamp.
        half = 0.5 * (rate[i] - s.last_rate[i]) if c.increment == 1 and not first else 0.0
        w[n, i] = rate[i] + half - (ex if i == 0 else ey if i == 1 else ez)
        s.last_rate[i], s.last_force[i] = rate[i], force[i]
        s.linear_acceleration[n, i] = force[i]
    s.variance[n, 0] = s.variance[n, 1] = s.navigator.level_sigma**2
    s.variance[n, 2] = s.navigator.azimuth_sigma**2
    s.stage[n] = s.navigator.stage
    s.stamp_ns[n] = s.imu_stamp_ns = stamp_ns
    s.measured += 1


@compiled
def step(s, c, i, out, normals):
    """Take one IMU message like ins.step; the first three of the normals (INS_NORMALS_PER_STEP,) are for the aid."""
    out.status, out.due = ins.Status.OK, 0
    if i.stamp_ns <= s.last_stamp_ns:
        out.status = ins.Status.BAD_STAMP
        return
    s.last_stamp_ns = i.stamp_ns
    for n in range(3):
        if not (math.isfinite(i.angular_velocity[n]) and math.isfinite(i.linear_acceleration[n])):
            out.status = ins.Status.BAD_IMU
    if out.status == ins.Status.OK:
        if s.measured - s.released == LATENCY_RING_SIZE:
            s.released += 1
            out.status = ins.Status.BUFFER_FULL
        measure_aid(c, s, i.stamp_ns, normals)
        if not integrate(c, s, i.stamp_ns, i.angular_velocity, i.linear_acceleration):
            out.status = ins.Status.ATTITUDE_LOST
        measure(c, s, i.stamp_ns, i.angular_velocity, i.linear_acceleration)
    if s.released == 0:
        out.stage = navigator.STAGE_ALIGNING
    for n in range(3):
        out.velocity[n] = s.navigator.strapdown.velocity[n]
        # The integrated noise of a gyro is a pure random walk.
        out.noise[n], out.walk[n] = 0.0, c.navigator.conditions.gyro_noise
    ins.release(c, s, i.stamp_ns, out)
