"""Antenna drive unit: two axes over one control period T, from commands at t_k to encoders at t_k+1.

The sub-steps run in one compiled call: speed loop 0.5 ms, current loops 100 us, plant 50 us.
"""
import math

from adu_drive import axis
from adu_drive.lanes import at, count
from adu_drive.plant import gimbal, mount, wind
from adu_drive.plant.wind import FieldConstants
from drive_law import drive_state, stow_pins
from drive_law.axis_params import SPEED_LOOP_PERIOD_S
from drive_law.params import AduParameters
from pedestal_common.compiled import compiled, inlined, separate
from pedestal_common.quantities import (
    KilogramMeters2,
    NewtonMeters,
    Pair,
    Radians,
    RadiansPerSecond2,
    Records,
    Seconds,
    Vector3,
)
from pedestal_common.record import Record


class DeckMotion(Record):
    """Motion of the deck, FLU."""
    base_acceleration: Vector3  # angular acceleration [rad/s2]
    base_rate: Vector3          # [rad/s]


class Inputs(drive_state.Inputs, DeckMotion):
    """Inputs of a period."""


class Outputs(drive_state.Outputs):
    """Outputs at t_k+1, with the true motion of the axes."""
    azimuth: axis.Outputs
    elevation: axis.Outputs


class Constants(drive_state.Constants):
    """Constants of the drive and its plant."""
    azimuth: axis.Constants
    elevation: axis.Constants
    bodies: gimbal.Constants
    wind: wind.Constants
    field: FieldConstants
    mount: mount.Constants
    substeps: int               # number of plant sub-steps in a current-loop period


class State(drive_state.State):
    """State of the drive and its plant."""
    azimuth: axis.State
    elevation: axis.State
    last_rate: Pair             # rates of the loads in the previous period [rad/s]


def constants(params: AduParameters, substeps: int = 2, speed_period: Seconds = SPEED_LOOP_PERIOD_S) -> Records:
    """Return the Constants (1,). substeps: number of plant sub-steps in a current-loop period (2: 50 us);
    speed_period: period of the speed loops."""
    h = axis.CURRENT_LOOP_PERIOD_S / substeps
    bodies = gimbal.constants(params)
    return Constants.of(
        **drive_state.constants(params),
        azimuth=axis.constants(params.azimuth, h, bool(bodies['rigid']), speed_period),
        elevation=axis.constants(params.elevation, h, period=speed_period), bodies=bodies,
        wind=wind.constants(params.wind), field=wind.field_constants(params.wind.field),
        mount=mount.constants(params.mount), substeps=substeps)


def initial_state(params: AduParameters) -> Records:
    """Return the State (1,) at rest at the initial angles, in balance with wind (t = 0) and unbalance."""
    axes = {}
    of_field = wind.initial_field_torques(params.wind.field, params.initial_azimuth, params.initial_elevation)
    for name, torque, field in zip(('azimuth', 'elevation'), wind.initial_torques(params.wind), of_field):
        p, theta = getattr(params, name), getattr(params, f'initial_{name}')
        external = torque + field - p.load.unbalance * math.cos(theta)
        axes[name] = axis.initial_state(p, theta, external)
    return State.of(**drive_state.initial_state(params), **axes)


@compiled
def inertial_torques(azimuth: Radians, J_azimuth: KilogramMeters2, J_elevation: KilogramMeters2, x: RadiansPerSecond2,
                     y: RadiansPerSecond2, z: RadiansPerSecond2) -> tuple[NewtonMeters, NewtonMeters]:
    """Return the torques on azimuth and elevation for a deck acceleration (x, y, z) about its FLU axes.

    Relative to the deck, the inertia of a load makes the torque -J (n . acceleration). n is the unit vector about
    which the angle of the axis grows by the right-hand rule. Azimuth grows clockwise: n = (0, 0, -1). Elevation lifts
    the beam (cos A, -sin A, 0) towards +z: n = (-sin A, -cos A, 0).
    """
    return J_azimuth * z, J_elevation * (x * math.sin(azimuth) + y * math.cos(azimuth))


@compiled
def _apply_rigid_body_torques(state: State, constants: Constants, w: Vector3,
                              w_dot: tuple[RadiansPerSecond2, RadiansPerSecond2, RadiansPerSecond2]) -> None:
    """Set the inertia of azimuth and the torques of the turning bodies on both axes. w: rate of the deck, FLU.

    The coupling of an axis uses the acceleration of the other axis in the previous period. The loop of both couplings
    is stable, because M_AE^2 < M_AA M_EE.
    """
    az, el = state.azimuth, state.elevation
    M_AA, M_AE = gimbal.inertia(constants.bodies, el.theta)
    axis.change_inertia(az, constants.azimuth, M_AA)
    h_azimuth, h_elevation = gimbal.gyroscopic(constants.bodies, (az.theta, el.theta), (az.omega, el.omega), w, w_dot)
    A_ddot, E_ddot = ((az.omega - state.last_rate[0]) * constants.bodies.per_period,
                      (el.omega - state.last_rate[1]) * constants.bodies.per_period)
    state.last_rate[0], state.last_rate[1] = az.omega, el.omega
    az.deck, el.deck = -h_azimuth - M_AE * E_ddot, -h_elevation - M_AE * A_ddot


@compiled
def external_torques(state: State, constants: Constants,
                     inputs: Inputs) -> tuple[NewtonMeters, NewtonMeters, bool]:
    """Return the torques on both loads over the period, and True for valid inputs."""
    x, y, z = inputs.base_acceleration[0], inputs.base_acceleration[1], inputs.base_acceleration[2]
    azimuth, elevation = state.azimuth.theta, state.elevation.theta
    T_azimuth, T_elevation = wind.torques(constants.wind, state.k * constants.period)
    if constants.field.blows:
        of_field = wind.field_torques(constants.field, state.k * constants.period, azimuth, elevation)
        T_azimuth, T_elevation = T_azimuth + of_field[0], T_elevation + of_field[1]
    T_azimuth += state.azimuth.gust - constants.azimuth.unbalance * math.cos(azimuth)
    T_elevation += state.elevation.gust - constants.elevation.unbalance * math.cos(elevation)
    valid = drive_state.plausible(x) and drive_state.plausible(y) and drive_state.plausible(z)
    if not valid:
        x = y = z = 0.0
    if constants.bodies.rigid:
        _apply_rigid_body_torques(state, constants, inputs.base_rate, (x, y, z))
    else:
        state.azimuth.deck, state.elevation.deck = inertial_torques(
            azimuth, constants.azimuth.J, constants.elevation.J, x, y, z)
    return T_azimuth + state.azimuth.deck, T_elevation + state.elevation.deck, valid


@compiled
def _beam_from_axes(constants: Constants, azimuth: axis.Outputs, elevation: axis.Outputs) -> None:
    angles, rates = mount.beam(constants.mount, azimuth.load_position, elevation.load_position, azimuth.load_velocity,
                               elevation.load_velocity)
    azimuth.load_position, elevation.load_position = angles
    azimuth.load_velocity, elevation.load_velocity = rates


@compiled
def read(state: State, constants: Constants, outputs: Outputs) -> None:
    """Write the present outputs, without a step."""
    axis.read(state.azimuth, constants.azimuth, outputs.azimuth)
    axis.read(state.elevation, constants.elevation, outputs.elevation)
    if not constants.mount.true:
        _beam_from_axes(constants, outputs.azimuth, outputs.elevation)
    drive_state.read(state, constants, outputs)


@compiled
def _begin_period(state: State, constants: Constants, inputs: Inputs, outputs: Outputs) -> None:
    state.azimuth.external, state.elevation.external, valid = external_torques(state, constants, inputs)
    outputs.invalid_command = 0 if drive_state.receive_command(state, inputs, valid) else 1
    state.braked = drive_state.advance(state, constants, inputs.pins, True)
    axis.begin_period(state.azimuth, constants.azimuth, state.braked)
    axis.begin_period(state.elevation, constants.elevation, state.braked)
    state.azimuth.braked |= stow_pins.holds(state.pins, constants.pins, 0)
    state.elevation.braked |= stow_pins.holds(state.pins, constants.pins, 1)


@inlined
def _speed_control(state: State, of_axis: axis.State, constants: axis.Constants) -> None:
    axis.speed_control(of_axis, constants, of_axis.commanded_rate, of_axis.commanded_torque, state.following,
                       state.phase != drive_state.PHASE_DISABLED, not state.braked)


@compiled
def between_speed_periods(state: axis.State, constants: axis.Constants, substeps: int) -> None:
    """Run current loops and plant of one axis, or of lanes of axes, for one speed-loop period."""
    axes = range(count(state))
    for _ in range(axis.CURRENT_LOOP_STEP_COUNT):
        for i in axes:
            axis.current_control(at(state, i).motor_1, at(constants, i).motor_1)
            axis.current_control(at(state, i).motor_2, at(constants, i).motor_2)
        for _ in range(substeps):
            for i in axes:
                axis.plant_step(at(state, i), at(constants, i), at(state, i).external)


@separate
def step(state: State, constants: Constants, inputs: Inputs, outputs: Outputs) -> None:
    """Advance one control period from t_k to t_k+1. Each record may also be the lanes.Lanes of many drives. All lanes
    have the period and the number of sub-steps of the first lane."""
    drives = range(count(state))
    for i in drives:
        _begin_period(at(state, i), at(constants, i), at(inputs, i), at(outputs, i))
    for j in range(at(constants, 0).speed_ticks):
        for i in drives:
            drive_state.apply_command(at(state, i), at(constants, i), at(inputs, i), j)
        for i in drives:
            _speed_control(at(state, i), at(state, i).azimuth, at(constants, i).azimuth)
        for i in drives:
            _speed_control(at(state, i), at(state, i).elevation, at(constants, i).elevation)
        between_speed_periods(state.azimuth, constants.azimuth, at(constants, 0).substeps)
        between_speed_periods(state.elevation, constants.elevation, at(constants, 0).substeps)
    for i in drives:
        at(state, i).k += 1
        read(at(state, i), at(constants, i), at(outputs, i))
