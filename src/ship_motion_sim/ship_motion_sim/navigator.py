"""A strapdown INS from power-up on: alignment, then navigation.

The strapdown integration runs at the rate of the IMU, the alignment every `step` seconds; its commands rotate n'.
Navigation begins as soon as the 1 sigma of azimuth is small enough. Without an aid, the INS navigates by the IMU
alone. With an aid, which measures the velocity of the ship in deck axes (log), the alignment continues. It uses the
difference of the velocities of strapdown and aid, so that level and azimuth keep improving. The frame n' is ENU turned
about the vertical by the azimuth, which is unknown at first, and tilted by small level errors.
"""
import math
from collections.abc import Iterable

from pedestal_common.compiled import compiled
from pedestal_common.geometry.line_of_sight import to_earth
from pedestal_common.geometry.quaternion import product
from pedestal_common.quantities import AnyRecord, Bit, MetersPerSecond, Radians, Records, Seconds, Vector3
from pedestal_common.record import Record
from ship_motion_sim import alignment, strapdown
from ship_motion_sim.params import VELOCITY_AIDS, AlignmentParameters

STAGES = ('aligning', 'aligned')
STAGE_ALIGNING, STAGE_ALIGNED = range(len(STAGES))
AID_NONE, AID_LOG = range(len(VELOCITY_AIDS))


class Constants(Record):
    """Aid and alignment of an INS."""
    aid: int                    # index into VELOCITY_AIDS
    step: Seconds               # of the alignment
    aligned_sigma: Radians      # 1 sigma of azimuth at which navigation begins
    conditions: alignment.Conditions


class State(Record):
    """State of an INS from power-up on."""
    stage: int                  # STAGE_ALIGNING or STAGE_ALIGNED
    velocity_set: Bit           # 1 after the first step has set the velocity to that of the aid
    since_step: Seconds         # since the last step of the alignment
    unaided_time: Seconds       # since navigation without aid began
    strapdown: strapdown.State
    command: Vector3            # rate of n' against the earth [rad/s]
    azimuth: Radians            # estimated azimuth of n'
    azimuth_sigma: Radians      # stated 1 sigmas
    level_sigma: Radians
    aligned_azimuth_sigma: Radians      # those at the start of navigation
    aligned_level_sigma: Radians
    alignment: alignment.State


def constants(p: AlignmentParameters, aid: str, latitude: Radians) -> Records:
    """Return the Constants (1,); aid: name of VELOCITY_AIDS."""
    return Constants.of(aid=VELOCITY_AIDS.index(aid), step=p.step, aligned_sigma=p.aligned_sigma,
                        conditions=alignment.conditions(p, latitude))


def least_azimuth_sigma(constants: AnyRecord) -> Radians:
    """Return the 1 sigma of azimuth that the alignment approaches after a long time."""
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
    strapdown.set_attitude(state.strapdown, qx, qy, qz, qw)
    state.azimuth_sigma = state.level_sigma = alignment.UNKNOWN_AZIMUTH_SIGMA_RAD
    alignment.start(state.alignment.observer, constants.conditions, alignment.INITIAL_LEVEL_SIGMA_RAD,
                    alignment.INITIAL_AZIMUTH_SIGMA_RAD)


@compiled
def aided_velocity(state: State, constants: Constants, aid: Vector3) -> tuple[MetersPerSecond, MetersPerSecond]:
    """Return the (E, N) components in n' of the velocity `aid` [m/s]; zeros without an aid."""
    if constants.aid == AID_LOG:
        east, north, _ = to_earth(state.strapdown.mat, aid[0], aid[1], aid[2])
        return east, north
    return 0.0, 0.0


@compiled
def align(state: State, constants: Constants, aid: Vector3, h: Seconds) -> None:
    """Execute one step of the alignment, h after the last; aid [m/s]."""
    v, method = state.strapdown.velocity, state.alignment
    east, north = aided_velocity(state, constants, aid)
    if state.velocity_set == 0:
        v[0], v[1], state.velocity_set = east, north, 1
    v[2] = 0.0      # Nothing aids the vertical velocity, so its error would grow without limit.
    bandwidth = (alignment.NAVIGATING_BANDWIDTH_RAD_S if state.stage == STAGE_ALIGNED
                 else alignment.ALIGNING_BANDWIDTH_RAD_S)
    alignment.step(method, constants.conditions, v[0] - east, v[1] - north, h, bandwidth)
    for i in range(3):
        state.command[i] = method.command[i]
    state.azimuth, state.azimuth_sigma, state.level_sigma = method.azimuth, method.azimuth_sigma, method.level_sigma


@compiled
def attitude(state: State) -> tuple[float, float, float, float]:
    """Return the estimated quaternion (x, y, z, w) deck -> earth."""
    return product((0.0, 0.0, math.sin(0.5 * state.azimuth), math.cos(0.5 * state.azimuth)),
                   state.strapdown.quaternion)


@compiled
def begin_navigation(state: State, constants: Constants, aid: Vector3) -> None:
    """Rotate n' onto ENU and start to navigate, with the velocity of the aid [m/s]. Without an aid, the part that the
    alignment attributed to an error is subtracted."""
    conditions, v, observer = constants.conditions, state.strapdown.velocity, state.alignment.observer
    qx, qy, qz, qw = attitude(state)
    cos, sin = math.cos(state.azimuth), math.sin(state.azimuth)
    east, north = v[0] - observer.z[0, 0], v[1] - observer.z[1, 0]
    v[0], v[1], v[2] = cos * east - sin * north, sin * east + cos * north, 0.0
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
    alignment.start(observer, conditions, state.level_sigma, math.sqrt(without_bias_variance))
    for i in range(2):
        state.alignment.v1[i] = state.alignment.v2[i] = 0.0


@compiled
def grow_unaided_sigmas(state: State, conditions: alignment.Conditions, h: Seconds) -> None:
    """Increase the 1 sigmas of an INS without aid over h, by random walk and bias of the gyros. The earth rate, whose
    components are computed with a heading that is wrong by its 1 sigma, also tilts the level."""
    state.unaided_time += h
    t, bias = state.unaided_time, conditions.gyro_bias
    walk = conditions.gyro_noise**2 * t
    state.azimuth_sigma = math.sqrt(state.aligned_azimuth_sigma**2 + walk + (bias * t)**2)
    drift = math.hypot(bias, conditions.earth_rate[1] * state.aligned_azimuth_sigma) * t
    state.level_sigma = math.sqrt(state.aligned_level_sigma**2 + walk + drift * drift)


@compiled
def step(state: State, constants: Constants, angle: Vector3, force: Vector3, dt: Seconds, aid: Vector3) -> None:
    """Process one IMU interval of dt; angle, force: increments, FLU [rad, m/s]; aid [m/s], finite."""
    conditions = constants.conditions
    strapdown.step(state.strapdown, angle, force, dt, conditions.earth_rate, state.command, conditions.gravity)
    # The tolerance of half an interval avoids a step that rounding errors delay by one interval.
    state.since_step += dt
    if state.since_step < constants.step - 0.5 * dt:
        return
    h, state.since_step = state.since_step, 0.0
    if state.stage == STAGE_ALIGNED and constants.aid == AID_NONE:
        state.strapdown.velocity[2] = 0.0
        grow_unaided_sigmas(state, conditions, h)
    else:
        align(state, constants, aid, h)
    if state.stage == STAGE_ALIGNING and state.azimuth_sigma <= constants.aligned_sigma:
        begin_navigation(state, constants, aid)
