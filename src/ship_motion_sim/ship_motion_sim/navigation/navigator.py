"""A strapdown INS from power-up on: alignment by the selected method, then navigation. aligning_ins calls `step`.

aligning    The strapdown integration runs at the rate of the IMU, the alignment method every `step` seconds. The
            commands of the method rotate n'. The method oba commands no rotation. Its strapdown integrates in inertial
            space: earth rate, command and gravity are zero.
aligned     Navigation begins as soon as the 1 sigma of azimuth is small enough. Without an aid, the INS navigates by
            the IMU alone. With an aid, the method riccati_eso continues. It uses the difference of the velocities of
            strapdown and aid, so that level and azimuth keep improving.

An aid measures the velocity of the ship, in deck axes (log) or in ENU (gnss).

n, n'       ENU; frame that the INS computes as its estimate of n. n' is n turned about the vertical by the azimuth,
            which is unknown at first, and tilted by small level errors
w_c, w_cN   commanded rate of n' against the earth, and its north component [rad/s]
w_N         north component of the earth rate [rad/s]
s, c, h     arguments: state, constants (records of this module), time since the last step of the method [s]
Methods     classical: gyrocompass; adrc, adrc_scheduled: ADRC; riccati_eso: extended state observer with Kalman
            gains; oba: optimisation-based alignment
"""
import math

import numpy as np

from pedestal_common.compiled import compiled
from pedestal_common.geometry.line_of_sight import to_earth
from pedestal_common.geometry.quaternion import product
from pedestal_common.quantities import Vector3
from pedestal_common.record import Record
from ship_motion_sim import strapdown
from ship_motion_sim.alignment import adrc, adrc_scheduled, classical, extended_observer, oba, riccati_eso
from ship_motion_sim.alignment.conditions import UNKNOWN_AZIMUTH_SIGMA_RAD, Conditions, conditions
from ship_motion_sim.params import INS_METHODS, VELOCITY_AIDS

STAGES = ('aligning', 'aligned')
STAGE_ALIGNING, STAGE_ALIGNED = range(len(STAGES))
METHOD_CLASSICAL, METHOD_ADRC, METHOD_ADRC_SCHEDULED, METHOD_RICCATI_ESO, METHOD_OBA = map(
    INS_METHODS.index, ('classical', 'adrc', 'adrc_scheduled', 'riccati_eso', 'oba'))
AID_NONE, AID_LOG, AID_GNSS = range(len(VELOCITY_AIDS))


class Constants(Record):
    """Record."""
    method: int
    aid: int  # index into INS_METHODS, VELOCITY_AIDS
    step: float  # step of the laws [s]
    aligned_sigma: float  # 1 sigma of azimuth at which navigation begins [rad]
    conditions: Conditions
    classical: classical.Constants
    adrc: adrc.Constants


class State(Record):
    """Record."""
    stage: int
    velocity_set: int  # 1 after the first step has set the velocity to that of the aid
    since_step: float  # time since the last step of the laws [s]
    unaided_time: float  # time since navigation without aid began [s]
    strapdown: strapdown.State
    command: Vector3  # w_c [rad/s]
    north_command_smoothed: float  # w_cN of the gyrocompass, smoothed [rad/s]
    azimuth: float  # estimated azimuth of n' [rad]
    azimuth_sigma: float
    level_sigma: float  # [rad]
    aligned_azimuth_sigma: float
    aligned_level_sigma: float  # at the start of navigation [rad]
    zero_rate: Vector3  # zeros, for the integration in inertial space
    classical: classical.State
    adrc: adrc.State
    adrc_scheduled: adrc_scheduled.State
    riccati_eso: riccati_eso.State
    oba: oba.State


def constants(p, method, aid, latitude) -> np.ndarray:
    """Return the record (1,) of Constants of AlignmentParameters p.

    method, aid: names of INS_METHODS, VELOCITY_AIDS; latitude [rad].
    """
    record = Constants.zeros()
    k = conditions(p, latitude)
    record['method'], record['aid'] = INS_METHODS.index(method), VELOCITY_AIDS.index(aid)
    record['step'], record['aligned_sigma'] = p.step, p.aligned_sigma
    record['conditions'] = k
    record['classical'] = classical.constants(k, p.classical_bandwidth, p.step)
    record['adrc'] = adrc.constants(k, p.adrc, p.step)
    return record


def least_azimuth_sigma(c):
    """Return the 1 sigma [rad] of azimuth that the method approaches after a long time.

    c: record of Constants.
    """
    if c['method'] == METHOD_CLASSICAL:
        return float(c['classical']['azimuth_sigma'])
    k = c['conditions']
    return float(k['gyro_bias'] / k['earth_rate'][1])


def initial_state(constants, quaternion) -> np.ndarray:
    """Return the record (1,) of State at power-up; quaternion (x, y, z, w) deck -> n': assumed attitude."""
    state = State.zeros()
    begin(state[0], constants[0], *map(float, quaternion))
    return state


@compiled
def begin(s, c, qx, qy, qz, qw):
    """Set the state s (zeros of State) to the state at power-up; qx, qy, qz, qw: assumed attitude deck -> n'."""
    if c.method == METHOD_OBA:
        qx, qy, qz, qw = 0.0, 0.0, 0.0, 1.0
    strapdown.set_attitude(s.strapdown, qx, qy, qz, qw)
    s.azimuth_sigma = s.level_sigma = UNKNOWN_AZIMUTH_SIGMA_RAD
    for o in (s.adrc.observer, s.adrc_scheduled.observer, s.riccati_eso.observer, s.oba.observer):
        extended_observer.start(o, c.conditions, extended_observer.INITIAL_LEVEL_SIGMA_RAD,
                                extended_observer.INITIAL_AZIMUTH_SIGMA_RAD)


@compiled
def aided_velocity(s, c, aid):
    """Return the (E, N) components in n' [m/s] of the velocity `aid` (3,) [m/s]; zeros without an aid.

    A GNSS is used only after the alignment, when n' is n (params.py refuses gnss with a method that commands n'). Its
    velocity is not rotated by s.azimuth, which riccati_eso still improves in navigation. This avoids a feedback of the
    estimate through the velocity of the ship (7 m/s), which would amplify the errors of the estimate.
    """
    if c.aid == AID_LOG:
        east, north, _ = to_earth(s.strapdown.mat, aid[0], aid[1], aid[2])
        return east, north
    if c.aid == AID_GNSS:
        return aid[0], aid[1]
    return 0.0, 0.0


@compiled
def copy_method_outputs(s, m):
    """Copy the commands, azimuth and 1 sigmas of m, the record of a method, into the state."""
    for i in range(3):
        s.command[i] = m.command[i]
    s.azimuth, s.azimuth_sigma, s.level_sigma = m.azimuth, m.azimuth_sigma, m.level_sigma


@compiled
def align_in_inertial_space(s, c, aid, h):
    """Execute one step of oba, h [s] after the last; aid (3,) [m/s]."""
    a, k = s.strapdown.velocity, c.conditions
    # ux, uy, uz: velocity of the log, in the axes of the strapdown; vx, vy, vz: velocity of GNSS, ENU.
    ux = uy = uz = vx = vy = vz = 0.0
    if c.aid == AID_LOG:
        ux, uy, uz = to_earth(s.strapdown.mat, aid[0], aid[1], aid[2])
    elif c.aid == AID_GNSS:
        vx, vy, vz = aid[0], aid[1], aid[2]
    oba.step(s.oba, k, (a[0] - ux, a[1] - uy, a[2] - uz), (vx, vy, vz), h)
    s.azimuth_sigma, s.level_sigma = s.oba.azimuth_sigma, s.oba.level_sigma


@compiled
def reject_reversed_azimuth(s, c, h):
    """Declare the azimuth of the gyrocompass unknown if the level command shows an azimuth az above 60 deg.

    The loop has a second equilibrium at 180 deg of azimuth. There the north command w_cN is minus twice the north
    component w_N of the earth rate, by equation (19) of paper 001: cos az = 1 + w_cN / w_N.
    """
    # s0: bandwidth of the gyrocompass [rad/s], here of the low-pass.
    s.north_command_smoothed += c.classical.s0 * h * (s.command[1] - s.north_command_smoothed)
    if 1.0 + s.north_command_smoothed / c.conditions.earth_rate[1] < 0.5:
        s.azimuth_sigma = UNKNOWN_AZIMUTH_SIGMA_RAD


@compiled
def step_method(s, c, method, aid, h):
    """Execute one step, h [s] after the last, of a method that commands n'; aid (3,) [m/s]."""
    v, k = s.strapdown.velocity, c.conditions
    east, north = aided_velocity(s, c, aid)
    if s.velocity_set == 0:
        v[0], v[1], s.velocity_set = east, north, 1
    v[2] = 0.0      # Nothing aids the vertical velocity, so its error would grow without limit.
    v_east, v_north = v[0] - east, v[1] - north
    if method == METHOD_CLASSICAL:
        classical.step(s.classical, c.classical, k, v_east, v_north, h)
        v[0] -= s.classical.correction[0]
        v[1] -= s.classical.correction[1]
        copy_method_outputs(s, s.classical)
        reject_reversed_azimuth(s, c, h)
    elif method == METHOD_ADRC:
        adrc.step(s.adrc, c.adrc, k, v_east, v_north, h)
        copy_method_outputs(s, s.adrc)
    elif method == METHOD_ADRC_SCHEDULED:
        adrc_scheduled.step(s.adrc_scheduled, k, v_east, v_north, h)
        copy_method_outputs(s, s.adrc_scheduled)
    else:
        bandwidth = (riccati_eso.NAVIGATING_BANDWIDTH_RAD_S if s.stage == STAGE_ALIGNED
                     else riccati_eso.ALIGNING_BANDWIDTH_RAD_S)
        riccati_eso.step(s.riccati_eso, k, v_east, v_north, h, bandwidth)
        copy_method_outputs(s, s.riccati_eso)


@compiled
def attitude(s, c):
    """Return the estimated quaternion (x, y, z, w) deck -> earth."""
    q = s.strapdown.quaternion
    if c.method == METHOD_OBA and s.stage == STAGE_ALIGNING:
        if s.oba.count < 2.0:       # One pair of vectors, less its own mean, determines no rotation.
            return q[0], q[1], q[2], q[3]
        return oba.attitude(s.oba, c.conditions, q[0], q[1], q[2], q[3])
    return product((0.0, 0.0, math.sin(0.5 * s.azimuth), math.cos(0.5 * s.azimuth)), q)


@compiled
def error_velocity(s, c):
    """Return the (E, N) components in n' [m/s] of the velocity that the method attributes to an error of the INS."""
    # observer.z[0, 0], z[1, 0]: estimated error of the east and the north velocity.
    if c.method == METHOD_ADRC:
        return s.adrc.observer.z[0, 0], s.adrc.observer.z[1, 0]
    if c.method == METHOD_ADRC_SCHEDULED:
        return s.adrc_scheduled.observer.z[0, 0], s.adrc_scheduled.observer.z[1, 0]
    if c.method == METHOD_RICCATI_ESO:
        return s.riccati_eso.observer.z[0, 0], s.riccati_eso.observer.z[1, 0]
    return 0.0, 0.0


@compiled
def begin_navigation(s, c, aid):
    """Rotate n' onto n and start to navigate; aid (3,): velocity [m/s].

    The velocity of the strapdown becomes that of the aid. Without an aid, the part that the alignment attributed to an
    error is subtracted. After oba without an aid it becomes zero, because the velocity at power-up is unknown.
    """
    k, v = c.conditions, s.strapdown.velocity
    qx, qy, qz, qw = attitude(s, c)
    wrong_east, wrong_north = error_velocity(s, c)
    cos, sin = math.cos(s.azimuth), math.sin(s.azimuth)
    east, north = v[0] - wrong_east, v[1] - wrong_north
    v[0], v[1], v[2] = cos * east - sin * north, sin * east + cos * north, 0.0
    if c.method == METHOD_OBA:
        v[0] = v[1] = 0.0
    strapdown.set_attitude(s.strapdown, qx, qy, qz, qw)
    s.stage, s.azimuth = STAGE_ALIGNED, 0.0
    if c.aid != AID_NONE:
        v[0], v[1] = aided_velocity(s, c, aid)
    for i in range(3):
        s.command[i] = 0.0
    s.aligned_azimuth_sigma, s.aligned_level_sigma = s.azimuth_sigma, s.level_sigma
    # The velocity does not show the azimuth error that a constant gyro bias causes. The observer starts without its
    # variance.
    without_bias_variance = max(s.azimuth_sigma**2 - (k.gyro_bias / k.earth_rate[1])**2, 0.0)
    m = s.riccati_eso
    extended_observer.start(m.observer, k, s.level_sigma, math.sqrt(without_bias_variance))
    for i in range(2):
        m.v1[i] = m.v2[i] = 0.0


@compiled
def grow_unaided_sigmas(s, k, h):
    """Increase the 1 sigmas of an INS without aid over h [s]; k: record of Conditions.

    The causes are the random walk and the bias of the gyros. The level is also tilted by the earth rate, whose
    components are computed with a heading that is wrong by its 1 sigma.
    """
    s.unaided_time += h
    walk = k.gyro_noise**2 * s.unaided_time
    s.azimuth_sigma = math.sqrt(s.aligned_azimuth_sigma**2 + walk + (k.gyro_bias * s.unaided_time)**2)
    drift = math.hypot(k.gyro_bias, k.earth_rate[1] * s.aligned_azimuth_sigma) * s.unaided_time
    s.level_sigma = math.sqrt(s.aligned_level_sigma**2 + walk + drift * drift)


@compiled
def step(s, c, angle, force, dt, aid):
    """Process one IMU interval of dt [s]; s, c: records State, Constants.

    angle, force (3,): increments of the interval, FLU [rad, m/s]; aid (3,) [m/s], finite.
    """
    k, in_inertial_space = c.conditions, c.method == METHOD_OBA and s.stage == STAGE_ALIGNING
    if in_inertial_space:
        strapdown.step(s.strapdown, angle, force, dt, s.zero_rate, s.zero_rate, 0.0)
    else:
        strapdown.step(s.strapdown, angle, force, dt, k.earth_rate, s.command, k.gravity)
    # The tolerance of half an interval avoids a step that rounding errors delay by one interval.
    s.since_step += dt
    if s.since_step < c.step - 0.5 * dt:
        return
    h, s.since_step = s.since_step, 0.0
    if in_inertial_space:
        align_in_inertial_space(s, c, aid, h)
    elif s.stage == STAGE_ALIGNING:
        step_method(s, c, c.method, aid, h)
    elif c.aid == AID_NONE:
        s.strapdown.velocity[2] = 0.0
        grow_unaided_sigmas(s, k, h)
    else:
        step_method(s, c, METHOD_RICCATI_ESO, aid, h)
    if s.stage == STAGE_ALIGNING and s.azimuth_sigma <= c.aligned_sigma:
        begin_navigation(s, c, aid)
