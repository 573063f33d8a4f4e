"""A strapdown INS at rest that aligns by one of the five methods which the study of Zhou 2011 compares.

The commands of the method rotate n', the frame that the INS computes for ENU. The method oba commands no rotation. Its
strapdown integrates in inertial space: earth rate, command and gravity are zero. riccati_eso is the method of the
product (ship_motion_sim alignment).
"""
import dataclasses
import math
from collections.abc import Iterable
from typing import Protocol

from pedestal_common.compiled import compiled
from pedestal_common.geometry.quaternion import product
from pedestal_common.parameters import ParameterError, Parameters, group, parameter
from pedestal_common.quantities import Bit, Radians, RadiansPerSecond, Records, Seconds, Vector3
from pedestal_common.record import Record
from pedestal_studies.p001_zhou_yang_qin import adrc, classical, oba
from pedestal_studies.p001_zhou_yang_qin.adrc import AdrcParameters
from ship_motion_sim import alignment, strapdown
from ship_motion_sim.params import AlignmentParameters

METHODS = ('classical', 'adrc', 'adrc_scheduled', 'riccati_eso', 'oba')
METHOD_CLASSICAL, METHOD_ADRC, METHOD_ADRC_SCHEDULED, METHOD_RICCATI_ESO, METHOD_OBA = range(len(METHODS))


@dataclasses.dataclass(frozen=True)
class MethodParameters(Parameters):
    """What the methods assume, and the bandwidths of classical and adrc."""
    alignment: AlignmentParameters = group(AlignmentParameters)
    classical_bandwidth: float = parameter(0.025, 0.005, 0.2, 'rad/s', 'bandwidth s0 of the four poles of method '
                                           'classical')
    adrc: AdrcParameters = group(AdrcParameters)

    def check(self) -> None:
        """Raise ParameterError if the level control of adrc would be unstable at this step."""
        if self.adrc.control * self.alignment.step > 1.0:
            raise ParameterError(f'adrc.control = {self.adrc.control:g} rad/s: must be at most 1 / step = '
                                 f'{1.0 / self.alignment.step:g} rad/s, for a stable loop')


class Constants(Record):
    """Method of an INS."""
    method: int                 # index into METHODS
    step: Seconds               # of the methods
    conditions: alignment.Conditions
    classical: classical.Constants
    adrc: adrc.Constants


class State(Record):
    """State of an INS from power-up on, with that of each method."""
    velocity_set: Bit           # 1 after the first step has set the velocity to zero
    since_step: Seconds         # since the last step of the method
    strapdown: strapdown.State
    command: Vector3            # rate of n' against the earth [rad/s]
    north_command_smoothed: RadiansPerSecond    # of the gyrocompass
    azimuth: Radians            # estimated azimuth of n'
    azimuth_sigma: Radians      # stated 1 sigmas
    level_sigma: Radians
    zero_rate: Vector3          # zeros, for the integration in inertial space
    classical: classical.State
    adrc_scheduled: adrc.ScheduledState
    adrc: adrc.State
    riccati_eso: alignment.State
    oba: oba.State


class CommandingMethod(Protocol):
    """State of a method that commands n'."""
    command: Vector3
    azimuth: Radians
    azimuth_sigma: Radians
    level_sigma: Radians


def constants(p: MethodParameters, method: str, latitude: Radians) -> Records:
    """Return the Constants (1,); method: name of METHODS."""
    k = alignment.conditions(p.alignment, latitude)
    return Constants.of(method=METHODS.index(method), step=p.alignment.step, conditions=k,
                        classical=classical.constants(k, p.classical_bandwidth, p.alignment.step),
                        adrc=adrc.constants(k, p.adrc, p.alignment.step))


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
    state.azimuth_sigma = state.level_sigma = alignment.UNKNOWN_AZIMUTH_SIGMA_RAD
    for observer in (state.adrc.observer, state.adrc_scheduled.observer, state.riccati_eso.observer,
                     state.oba.observer):
        alignment.start(observer, constants.conditions, alignment.INITIAL_LEVEL_SIGMA_RAD,
                        alignment.INITIAL_AZIMUTH_SIGMA_RAD)


@compiled
def copy_method_outputs(state: State, method: CommandingMethod) -> None:
    """Copy the commands, azimuth and 1 sigmas of a method into the state."""
    for i in range(3):
        state.command[i] = method.command[i]
    state.azimuth, state.azimuth_sigma, state.level_sigma = method.azimuth, method.azimuth_sigma, method.level_sigma


@compiled
def reject_reversed_azimuth(state: State, constants: Constants, h: Seconds) -> None:
    """Declare the azimuth of the gyrocompass unknown if the level command shows an azimuth az above 60 deg.

    The loop has a second equilibrium at 180 deg of azimuth. There the north command w_cN is minus twice the north
    component w_N of the earth rate, by equation (19) of Zhou 2011: cos az = 1 + w_cN / w_N.
    """
    # s0: bandwidth of the gyrocompass [rad/s], here of the low-pass.
    state.north_command_smoothed += constants.classical.s0 * h * (state.command[1] - state.north_command_smoothed)
    if 1.0 + state.north_command_smoothed / constants.conditions.earth_rate[1] < 0.5:
        state.azimuth_sigma = alignment.UNKNOWN_AZIMUTH_SIGMA_RAD


@compiled
def step_method(state: State, constants: Constants, h: Seconds) -> None:
    """Execute one step, h after the last, of the method."""
    v, conditions, method = state.strapdown.velocity, constants.conditions, constants.method
    if method == METHOD_OBA:
        oba.step(state.oba, conditions, (v[0], v[1], v[2]), h)
        state.azimuth_sigma, state.level_sigma = state.oba.azimuth_sigma, state.oba.level_sigma
        return
    if state.velocity_set == 0:
        v[0], v[1], state.velocity_set = 0.0, 0.0, 1
    v[2] = 0.0      # Nothing aids the vertical velocity, so its error would grow without limit.
    if method == METHOD_CLASSICAL:
        classical.step(state.classical, constants.classical, conditions, v[0], v[1], h)
        v[0] -= state.classical.correction[0]
        v[1] -= state.classical.correction[1]
        copy_method_outputs(state, state.classical)
        reject_reversed_azimuth(state, constants, h)
    elif method == METHOD_ADRC:
        adrc.step(state.adrc, constants.adrc, conditions, v[0], v[1], h)
        copy_method_outputs(state, state.adrc)
    elif method == METHOD_ADRC_SCHEDULED:
        adrc.step_scheduled(state.adrc_scheduled, conditions, v[0], v[1], h)
        copy_method_outputs(state, state.adrc_scheduled)
    else:
        alignment.step(state.riccati_eso, conditions, v[0], v[1], h, alignment.ALIGNING_BANDWIDTH_RAD_S)
        copy_method_outputs(state, state.riccati_eso)


@compiled
def attitude(state: State, constants: Constants) -> tuple[float, float, float, float]:
    """Return the estimated quaternion (x, y, z, w) deck -> earth."""
    q = state.strapdown.quaternion
    if constants.method == METHOD_OBA:
        if state.oba.count < 2.0:       # One pair of vectors, less its own mean, determines no rotation.
            return q[0], q[1], q[2], q[3]
        return oba.attitude(state.oba, constants.conditions, q[0], q[1], q[2], q[3])
    return product((0.0, 0.0, math.sin(0.5 * state.azimuth), math.cos(0.5 * state.azimuth)), q)


@compiled
def step(state: State, constants: Constants, angle: Vector3, force: Vector3, dt: Seconds) -> None:
    """Process one IMU interval of dt; angle, force: increments of the interval, FLU [rad, m/s]."""
    conditions = constants.conditions
    if constants.method == METHOD_OBA:
        strapdown.step(state.strapdown, angle, force, dt, state.zero_rate, state.zero_rate, 0.0)
    else:
        strapdown.step(state.strapdown, angle, force, dt, conditions.earth_rate, state.command, conditions.gravity)
    # The tolerance of half an interval avoids a step that rounding errors delay by one interval.
    state.since_step += dt
    if state.since_step < constants.step - 0.5 * dt:
        return
    h, state.since_step = state.since_step, 0.0
    step_method(state, constants, h)
