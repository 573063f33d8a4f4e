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
h           time since the last step of the method [s]
Methods     classical: gyrocompass; adrc, adrc_scheduled: ADRC; riccati_eso: extended state observer with Kalman
            gains; oba: optimisation-based alignment
"""
import math
from collections.abc import Iterable
from typing import Protocol

from pedestal_common.compiled import compiled
from pedestal_common.geometry.line_of_sight import to_earth
from pedestal_common.geometry.quaternion import product
from pedestal_common.quantities import (
    AnyRecord,
    Bit,
    MetersPerSecond,
    Radians,
    RadiansPerSecond,
    Records,
    Seconds,
    Vector3,
)
from pedestal_common.record import Record
from ship_motion_sim import strapdown
from ship_motion_sim.alignment import adrc, adrc_scheduled, classical, extended_observer, oba, riccati_eso
from ship_motion_sim.alignment.conditions import UNKNOWN_AZIMUTH_SIGMA_RAD, Conditions, conditions
from ship_motion_sim.params import INS_METHODS, VELOCITY_AIDS, AlignmentParameters

STAGES = ('aligning', 'aligned')
STAGE_ALIGNING, STAGE_ALIGNED = range(len(STAGES))
METHOD_CLASSICAL, METHOD_ADRC, METHOD_ADRC_SCHEDULED, METHOD_RICCATI_ESO, METHOD_OBA = map(
    INS_METHODS.index, ('classical', 'adrc', 'adrc_scheduled', 'riccati_eso', 'oba'))
AID_NONE, AID_LOG, AID_GNSS = range(len(VELOCITY_AIDS))


class Constants(Record):
    """Method and aid of an INS."""
    method: int                 # index into INS_METHODS
    aid: int                    # index into VELOCITY_AIDS
    step: Seconds               # of the laws
    aligned_sigma: Radians      # 1 sigma of azimuth at which navigation begins
    conditions: Conditions
    classical: classical.Constants
    adrc: adrc.Constants


class State(Record):
    """State of an INS from power-up on, with that of each method."""
    stage: int                  # STAGE_ALIGNING or STAGE_ALIGNED
    velocity_set: Bit           # 1 after the first step has set the velocity to that of the aid
    since_step: Seconds         # since the last step of the laws
    unaided_time: Seconds       # since navigation without aid began
    strapdown: strapdown.State
    command: Vector3            # w_c [rad/s]
    north_command_smoothed: RadiansPerSecond    # w_cN of the gyrocompass
    azimuth: Radians            # estimated azimuth of n'
    azimuth_sigma: Radians      # stated 1 sigmas
    level_sigma: Radians
    aligned_azimuth_sigma: Radians      # those at the start of navigation
    aligned_level_sigma: Radians
    zero_rate: Vector3          # zeros, for the integration in inertial space
    classical: classical.State
    adrc: adrc.State
    adrc_scheduled: adrc_scheduled.State
    riccati_eso: riccati_eso.State
    oba: oba.State


class CommandingMethod(Protocol):
    """State of a method that commands n'."""
    command: Vector3
    azimuth: Radians
    azimuth_sigma: Radians
    level_sigma: Radians


def constants(p: AlignmentParameters, method: str, aid: str, latitude: Radians) -> Records:
    """Return the Constants (1,); method, aid: names of INS_METHODS, VELOCITY_AIDS."""
    record = Constants.zeros()
    k = conditions(p, latitude)
    record['method'], record['aid'] = INS_METHODS.index(method), VELOCITY_AIDS.index(aid)
    record['step'], record['aligned_sigma'] = p.step, p.aligned_sigma
    record['conditions'] = k
    record['classical'] = classical.constants(k, p.classical_bandwidth, p.step)
    record['adrc'] = adrc.constants(k, p.adrc, p.step)
    return record


def least_azimuth_sigma(constants: AnyRecord) -> Radians:
    """Return the 1 sigma of azimuth that the method of Constants approaches after a long time."""
    if constants['method'] == METHOD_CLASSICAL:
        return float(constants['classical']['azimuth_sigma'])
    k = constants['conditions']
    return float(k['gyro_bias'] / k['earth_rate'][1])


def initial_state(constants: Records, quaternion: Iterable[float]) -> Records:
    """Return the State (1,) at power-up; quaternion (x, y, z, w) deck -> n': assumed attitude."""
    state = State.zeros()
    begin(state[0], constants[0], *map(float, quaternion))
    return state


@compiled
def begin(state: State, constants: Constants, qx: float, qy: float, qz: float, qw: float) -> None:
    """Set a state of zeros to the state at power-up; qx, qy, qz, qw: assumed attitude deck -> n'."""
    if constants.method == METHOD_OBA:
        qx, qy, qz, qw = 0.0, 0.0, 0.0, 1.0
    strapdown.set_attitude(state.strapdown, qx, qy, qz, qw)
    state.azimuth_sigma = state.level_sigma = UNKNOWN_AZIMUTH_SIGMA_RAD
    for observer in (state.adrc.observer, state.adrc_scheduled.observer, state.riccati_eso.observer,
                     state.oba.observer):
        extended_observer.start(observer, constants.conditions, extended_observer.INITIAL_LEVEL_SIGMA_RAD,
                                extended_observer.INITIAL_AZIMUTH_SIGMA_RAD)


@compiled
def aided_velocity(state: State, constants: Constants, aid: Vector3) -> tuple[MetersPerSecond, MetersPerSecond]:
    """Return the (E, N) components in n' of the velocity `aid` [m/s]; zeros without an aid.

    A GNSS is used only after the alignment, when n' is n (params.py refuses gnss with a method that commands n'). Its
    velocity is not rotated by state.azimuth, which riccati_eso still improves in navigation. This avoids a feedback of
    the estimate through the velocity of the ship (7 m/s), which would amplify the errors of the estimate.
    """
    if constants.aid == AID_LOG:
        east, north, _ = to_earth(state.strapdown.mat, aid[0], aid[1], aid[2])
        return east, north
    if constants.aid == AID_GNSS:
        return aid[0], aid[1]
    return 0.0, 0.0


@compiled
def copy_method_outputs(state: State, method: CommandingMethod) -> None:
    """Copy the commands, azimuth and 1 sigmas of a method into the state."""
    for i in range(3):
        state.command[i] = method.command[i]
    state.azimuth, state.azimuth_sigma, state.level_sigma = method.azimuth, method.azimuth_sigma, method.level_sigma


@compiled
def align_in_inertial_space(state: State, constants: Constants, aid: Vector3, h: Seconds) -> None:
    """Execute one step of oba, h after the last; aid [m/s]."""
    a, conditions = state.strapdown.velocity, constants.conditions
    # ux, uy, uz: velocity of the log, in the axes of the strapdown; vx, vy, vz: velocity of GNSS, ENU.
    ux = uy = uz = vx = vy = vz = 0.0
    if constants.aid == AID_LOG:
        ux, uy, uz = to_earth(state.strapdown.mat, aid[0], aid[1], aid[2])
    elif constants.aid == AID_GNSS:
        vx, vy, vz = aid[0], aid[1], aid[2]
    oba.step(state.oba, conditions, (a[0] - ux, a[1] - uy, a[2] - uz), (vx, vy, vz), h)
    state.azimuth_sigma, state.level_sigma = state.oba.azimuth_sigma, state.oba.level_sigma


@compiled
def reject_reversed_azimuth(state: State, constants: Constants, h: Seconds) -> None:
    """Declare the azimuth of the gyrocompass unknown if the level command shows an azimuth az above 60 deg.

    The loop has a second equilibrium at 180 deg of azimuth. There the north command w_cN is minus twice the north
    component w_N of the earth rate, by equation (19) of paper 001: cos az = 1 + w_cN / w_N.
    """
    # s0: bandwidth of the gyrocompass [rad/s], here of the low-pass.
    state.north_command_smoothed += constants.classical.s0 * h * (state.command[1] - state.north_command_smoothed)
    if 1.0 + state.north_command_smoothed / constants.conditions.earth_rate[1] < 0.5:
        state.azimuth_sigma = UNKNOWN_AZIMUTH_SIGMA_RAD


@compiled
def step_method(state: State, constants: Constants, method: int, aid: Vector3, h: Seconds) -> None:
    """Execute one step, h after the last, of a method that commands n'; aid [m/s]."""
    v, conditions = state.strapdown.velocity, constants.conditions
    east, north = aided_velocity(state, constants, aid)
    if state.velocity_set == 0:
        v[0], v[1], state.velocity_set = east, north, 1
    v[2] = 0.0      # Nothing aids the vertical velocity, so its error would grow without limit.
    v_east, v_north = v[0] - east, v[1] - north
    if method == METHOD_CLASSICAL:
        classical.step(state.classical, constants.classical, conditions, v_east, v_north, h)
        v[0] -= state.classical.correction[0]
        v[1] -= state.classical.correction[1]
        copy_method_outputs(state, state.classical)
        reject_reversed_azimuth(state, constants, h)
    elif method == METHOD_ADRC:
        adrc.step(state.adrc, constants.adrc, conditions, v_east, v_north, h)
        copy_method_outputs(state, state.adrc)
    elif method == METHOD_ADRC_SCHEDULED:
        adrc_scheduled.step(state.adrc_scheduled, conditions, v_east, v_north, h)
        copy_method_outputs(state, state.adrc_scheduled)
    else:
        bandwidth = (riccati_eso.NAVIGATING_BANDWIDTH_RAD_S if state.stage == STAGE_ALIGNED
                     else riccati_eso.ALIGNING_BANDWIDTH_RAD_S)
        riccati_eso.step(state.riccati_eso, conditions, v_east, v_north, h, bandwidth)
        copy_method_outputs(state, state.riccati_eso)


@compiled
def attitude(state: State, constants: Constants) -> tuple[float, float, float, float]:
    """Return the estimated quaternion (x, y, z, w) deck -> earth."""
    q = state.strapdown.quaternion
    if constants.method == METHOD_OBA and state.stage == STAGE_ALIGNING:
        if state.oba.count < 2.0:       # One pair of vectors, less its own mean, determines no rotation.
            return q[0], q[1], q[2], q[3]
        return oba.attitude(state.oba, constants.conditions, q[0], q[1], q[2], q[3])
    return product((0.0, 0.0, math.sin(0.5 * state.azimuth), math.cos(0.5 * state.azimuth)), q)


@compiled
def error_velocity(state: State, constants: Constants) -> tuple[MetersPerSecond, MetersPerSecond]:
    """Return the (E, N) components in n' of the velocity that the method attributes to an error of the INS."""
    # observer.z[0, 0], z[1, 0]: estimated error of the east and the north velocity.
    if constants.method == METHOD_ADRC:
        return state.adrc.observer.z[0, 0], state.adrc.observer.z[1, 0]
    if constants.method == METHOD_ADRC_SCHEDULED:
        return state.adrc_scheduled.observer.z[0, 0], state.adrc_scheduled.observer.z[1, 0]
    if constants.method == METHOD_RICCATI_ESO:
        return state.riccati_eso.observer.z[0, 0], state.riccati_eso.observer.z[1, 0]
    return 0.0, 0.0


@compiled
def begin_navigation(state: State, constants: Constants, aid: Vector3) -> None:
    """Rotate n' onto n and start to navigate; aid: velocity [m/s].

    The velocity of the strapdown becomes that of the aid. Without an aid, the part that the alignment attributed to an
    error is subtracted. After oba without an aid it becomes zero, because the velocity at power-up is unknown.
    """
    conditions, v = constants.conditions, state.strapdown.velocity
    qx, qy, qz, qw = attitude(state, constants)
    wrong_east, wrong_north = error_velocity(state, constants)
    cos, sin = math.cos(state.azimuth), math.sin(state.azimuth)
    east, north = v[0] - wrong_east, v[1] - wrong_north
    v[0], v[1], v[2] = cos * east - sin * north, sin * east + cos * north, 0.0
    if constants.method == METHOD_OBA:
        v[0] = v[1] = 0.0
    strapdown.set_attitude(state.strapdown, qx, qy, qz, qw)
    state.stage, state.azimuth = STAGE_ALIGNED, 0.0
    if constants.aid != AID_NONE:
        v[0], v[1] = aided_velocity(state, constants, aid)
    for i in range(3):
        state.command[i] = 0.0
    state.aligned_azimuth_sigma, state.aligned_level_sigma = state.azimuth_sigma, state.level_sigma
    # The velocity does not show the azimuth error that a constant gyro bias causes. The observer starts without its
    # variance.
    without_bias_variance = max(state.azimuth_sigma**2 - (conditions.gyro_bias / conditions.earth_rate[1])**2, 0.0)
    m = state.riccati_eso
    extended_observer.start(m.observer, conditions, state.level_sigma, math.sqrt(without_bias_variance))
    for i in range(2):
        m.v1[i] = m.v2[i] = 0.0


@compiled
def grow_unaided_sigmas(state: State, conditions: Conditions, h: Seconds) -> None:
    """Increase the 1 sigmas of an INS without aid over h.

    The causes are the random walk and the bias of the gyros. The level is also tilted by the earth rate, whose
    components are computed with a heading that is wrong by its 1 sigma.
    """
    state.unaided_time += h
    t, bias = state.unaided_time, conditions.gyro_bias
    walk = conditions.gyro_noise**2 * t
    state.azimuth_sigma = math.sqrt(state.aligned_azimuth_sigma**2 + walk + (bias * t)**2)
    drift = math.hypot(bias, conditions.earth_rate[1] * state.aligned_azimuth_sigma) * t
    state.level_sigma = math.sqrt(state.aligned_level_sigma**2 + walk + drift * drift)


@compiled
def step(state: State, constants: Constants, angle: Vector3, force: Vector3, dt: Seconds, aid: Vector3) -> None:
    """Process one IMU interval of dt.

    angle, force: increments of the interval, FLU [rad, m/s]; aid [m/s], finite.
    """
    conditions = constants.conditions
    in_inertial_space = constants.method == METHOD_OBA and state.stage == STAGE_ALIGNING
    if in_inertial_space:
        strapdown.step(state.strapdown, angle, force, dt, state.zero_rate, state.zero_rate, 0.0)
    else:
        strapdown.step(state.strapdown, angle, force, dt, conditions.earth_rate, state.command, conditions.gravity)
    # The tolerance of half an interval avoids a step that rounding errors delay by one interval.
    state.since_step += dt
    if state.since_step < constants.step - 0.5 * dt:
        return
    h, state.since_step = state.since_step, 0.0
    if in_inertial_space:
        align_in_inertial_space(state, constants, aid, h)
    elif state.stage == STAGE_ALIGNING:
        step_method(state, constants, constants.method, aid, h)
    elif constants.aid == AID_NONE:
        state.strapdown.velocity[2] = 0.0
        grow_unaided_sigmas(state, conditions, h)
    else:
        step_method(state, constants, METHOD_RICCATI_ESO, aid, h)
    if state.stage == STAGE_ALIGNING and state.azimuth_sigma <= constants.aligned_sigma:
        begin_navigation(state, constants, aid)
