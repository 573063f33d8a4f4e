"""Antenna drive unit: two axes over one control period T, from commands at t_k to encoders at t_k+1.

The sub-steps run in one compiled call: speed loop 0.5 ms, current loops 100 us, plant 50 us. The unit of the node
`adu` (adu_drive.unit) calls `step`. Arguments: s state, c constants, u inputs, y outputs, all records of this module.
"""
import math

import numpy as np

from adu_drive import axis, drive_state, stow_pins
from adu_drive.lanes import at, count
from adu_drive.params import SPEED_LOOP_PERIOD_S, AduParameters, whole_speed_periods
from adu_drive.plant import gimbal, mount, wind, wind_field
from pedestal_common.compiled import compiled, inlined, separate
from pedestal_common.quantities import Pair, Vector3
from pedestal_common.record import Record

COMMAND_RING_SIZE = 256
"""Number of commands in the ring of the transport delay.

It exceeds the 200 commands of a configured and an injected delay, each of MAX_TRANSPORT_DELAY_S, at the
shortest period of 1 ms.
"""

INITIAL_AGE_PERIODS = 1 << 40
"""Initial number of periods since the last change of the brakes: longer ago than any time of a brake or a delay."""

MAX_PLAUSIBLE_INPUT = 1e6  # largest valid input [rad/s, Nm, rad/s2]. An input beyond it, infinite or NaN is invalid.


class _AxisInputs(Record):
    """Record."""
    rate: float
    torque: float


class Inputs(Record):
    """Inputs of a period."""
    # azimuth, elevation: rate command [rad/s], feed-forward torque of both motors on the load axis [Nm]
    azimuth: _AxisInputs
    elevation: _AxisInputs
    # base_acceleration, base_rate: angular acceleration [rad/s2] and rate [rad/s] of the deck, FLU
    base_acceleration: Vector3
    enable: int  # 1: follow the command; 0: controlled stop, which begins without the transport delay
    base_rate: Vector3
    pins: int  # code of acu/stow_pins: command to the stow pins


class _AxisOutputs(Record):
    """Record."""
    position: float
    velocity: float
    torque: float
    motor_position: Pair
    motor_velocity: Pair
    motor_torque: Pair
    bias: float
    torque_limited: int
    voltage_limited: int
    end_stop: int
    stopping: int
    faults: int
    thermal_load: Pair
    load_position: float
    load_velocity: float
    true_torque: Pair


class Outputs(Record):
    """Outputs at t_k+1, per axis:

    and of the drive:
    """
    azimuth: _AxisOutputs
    elevation: _AxisOutputs
    # 1 if an input of this call was invalid; the command is then taken as enable 0, a disturbance as 0
    invalid_command: int
    phase: int  # index of drive_state.PHASES; following: 1 if enabled and permitted at t_k+1
    following: int
    wanted: int  # 0 after a request to disable
    emergency: int  # 1 while an emergency stop is latched
    braked: int  # 1 while the brakes grip
    condition: int  # see drive_state.condition; pins: see stow_pins.state_code
    pins: int
    # position: load encoder [rad]; velocity: mean motor speed / N [rad/s], from the motor encoders over the last 0.5 ms; torque: torque of both motors on the load axis, from their currents [Nm]; motor_position, motor_velocity, motor_torque: values of motors 1 and 2 on the shaft: encoder, encoder difference, K_t times the measured current; bias: T_b [Nm]; torque_limited, voltage_limited: 1 if the limit was active in the period; end_stop: 1 if the end of travel reduced the rate command in the period; stopping: 1 if the axis was not enabled in the period: it ramped to standstill, or held; faults: latched fault word, see faults.AXIS_FAULTS; thermal_load: thermal load of motors 1 and 2; 1: steady state at rated torque; load_position, load_velocity: true angle [rad] and rate [rad/s] of the beam (of the dish, if the structure is flexible), unknown to the controllers; true_torque: K_t i_q of motors 1 and 2, for tests; never published


def _record(values):
    """Return a nested dictionary as a record (1,): int -> i8, float -> f8, array and dictionary nested."""
    fields = {name: _record(value) if isinstance(value, dict) else np.asarray(value)[np.newaxis]
              for name, value in values.items()}
    record = np.zeros(1, np.dtype([(name, field.dtype, field.shape[1:]) for name, field in fields.items()],
                                  align=True))
    for name, field in fields.items():
        record[name] = field
    return record


def _constants(params, substeps, speed_period=SPEED_LOOP_PERIOD_S):
    """Return the record (1,) of `constants`; each call makes a new dtype object."""
    h = axis.CURRENT_LOOP_PERIOD_S / substeps
    bodies = gimbal.constants(params)
    return _record({'azimuth': axis.constants(params.azimuth, h, bodies['rigid'], speed_period),
                    'elevation': axis.constants(params.elevation, h, period=speed_period), 'bodies': bodies,
                    'wind': wind.constants(params.wind), 'field': wind_field.constants(params.wind.field),
                    'mount': mount.constants(params.mount), 'pins': stow_pins.constants(params),
                    'period': params.period,
                    'speed_ticks': whole_speed_periods('period', params.period),
                    'delay_ticks': whole_speed_periods('transport_delay', params.transport_delay),
                    **{f'{name}_periods': math.ceil(getattr(params.brakes, f'{name}_time') / params.period - 1e-6)
                       for name in ('engage', 'release', 'stop')},
                    'substeps': substeps})


def _initial_state(params):
    """Return the record (1,) of `initial_state`; each call makes a new dtype object.

    rate, torque, enable   ring of the commands: rates [rad/s], feed-forward torques [Nm], inputs `enable`
    k                      number of the period
    last_rate              rates of the loads in the previous period [rad/s]
    tick                   speed-loop period whose command is in force
    late_ticks             injected delay in speed-loop periods
    age, brake_age         periods since the last change of the phase and of the command to the brakes
    applied                1 while the brakes are commanded on; braked: 1 while they grip

    phase, wanted, emergency, following, pins: see Outputs and stow_pins.
    """
    axes, enabled = {}, params.initially_enabled and not (params.stow_pins and params.pins.initially_in)
    of_field = wind_field.initial_torques(params.wind.field, params.initial_azimuth, params.initial_elevation)
    for name, torque, field in zip(('azimuth', 'elevation'), wind.initial_torques(params.wind), of_field):
        p, theta = getattr(params, name), getattr(params, f'initial_{name}')
        external = torque + field - p.load.unbalance * math.cos(theta)
        axes[name] = axis.initial_state(p, theta, external)
    return _record({**axes, 'rate': np.zeros((COMMAND_RING_SIZE, 2)), 'torque': np.zeros((COMMAND_RING_SIZE, 2)),
                    'enable': np.ones(COMMAND_RING_SIZE, np.int64), 'k': 0, 'last_rate': np.zeros(2),
                    'phase': drive_state.PHASE_ENABLED if enabled else drive_state.PHASE_DISABLED, 'age': 0,
                    'wanted': int(params.initially_enabled), 'emergency': 0, 'tick': -INITIAL_AGE_PERIODS,
                    'late_ticks': 0, 'applied': int(not enabled), 'brake_age': INITIAL_AGE_PERIODS,
                    'braked': int(not enabled), 'following': 0, 'pins': stow_pins.initial_state(params)})


Constants = _constants(AduParameters(), 2).dtype
State = _initial_state(AduParameters()).dtype
"""Dtype object that all state records share.

A record with an equal copy would cost 3 us in each call, because numba then compares the copy field by field.
"""


def constants(params: AduParameters, substeps: int = 2, speed_period: float = SPEED_LOOP_PERIOD_S) -> np.ndarray:
    """Return the constants, record (1,). substeps: number of plant sub-steps in a current-loop period (2: 50 us);
    speed_period: period of the speed loops [s]."""
    return _constants(params, substeps, speed_period).view(Constants)


def initial_state(params: AduParameters) -> np.ndarray:
    """Return the state at rest at the initial angles, in balance with wind (t = 0) and unbalance, record (1,)."""
    return _initial_state(params).view(State)


@compiled
def _plausible(x):
    """Return True if an input x is valid, as MAX_PLAUSIBLE_INPUT states; NaN is invalid."""
    return abs(x) <= MAX_PLAUSIBLE_INPUT


@compiled
def inertial_torques(azimuth, J_azimuth, J_elevation, x, y, z):
    """Return the torques [Nm] on azimuth and elevation for a deck acceleration (x, y, z) [rad/s2] about its FLU axes.

    azimuth: angle A of the axis [rad]; J_azimuth, J_elevation: inertia of the loads [kg m2].

    Relative to the deck, the inertia of a load makes the torque -J (n . acceleration). n is the unit vector about
    which the angle of the axis grows by the right-hand rule. Azimuth grows clockwise: n = (0, 0, -1). Elevation lifts
    the beam (cos A, -sin A, 0) towards +z: n = (-sin A, -cos A, 0).
    """
    return J_azimuth * z, J_elevation * (x * math.sin(azimuth) + y * math.cos(azimuth))


@compiled
def _apply_rigid_body_torques(s, c, w, w_dot):
    """Set the inertia of azimuth and the torques of the turning bodies on both axes, constant over the period.

    w, w_dot (3,): rate [rad/s] and angular acceleration [rad/s2] of the deck, FLU. Other symbols: see gimbal.py.
    The coupling of an axis uses the acceleration of the other axis in the previous period. The loop of both couplings
    is stable, because M_AE^2 < M_AA M_EE.
    """
    az, el = s.azimuth, s.elevation
    M_AA, M_AE = gimbal.inertia(c.bodies, el.theta)
    axis.change_inertia(az, c.azimuth, M_AA)
    h_azimuth, h_elevation = gimbal.gyroscopic(c.bodies, (az.theta, el.theta), (az.omega, el.omega), w, w_dot)
    A_ddot, E_ddot = ((az.omega - s.last_rate[0]) * c.bodies.per_period,
                      (el.omega - s.last_rate[1]) * c.bodies.per_period)
    s.last_rate[0], s.last_rate[1] = az.omega, el.omega
    az.deck, el.deck = -h_azimuth - M_AE * E_ddot, -h_elevation - M_AE * A_ddot


@compiled
def external_torques(s, c, u):
    """Return the external torques [Nm] on both loads, constant over the period, and True for valid inputs."""
    x, y, z = u.base_acceleration[0], u.base_acceleration[1], u.base_acceleration[2]
    azimuth, elevation = s.azimuth.theta, s.elevation.theta
    T_azimuth, T_elevation = wind.torques(c.wind, s.k * c.period)
    if c.field.blows:
        of_field = wind_field.torques(c.field, s.k * c.period, azimuth, elevation)
        T_azimuth, T_elevation = T_azimuth + of_field[0], T_elevation + of_field[1]
    T_azimuth += s.azimuth.gust - c.azimuth.unbalance * math.cos(azimuth)
    T_elevation += s.elevation.gust - c.elevation.unbalance * math.cos(elevation)
    valid = _plausible(x) and _plausible(y) and _plausible(z)
    if not valid:
        x = y = z = 0.0
    if c.bodies.rigid:
        _apply_rigid_body_torques(s, c, u.base_rate, (x, y, z))
    else:
        s.azimuth.deck, s.elevation.deck = inertial_torques(azimuth, c.azimuth.J, c.elevation.J, x, y, z)
    return T_azimuth + s.azimuth.deck, T_elevation + s.elevation.deck, valid


@compiled
def receive_command(s, u, disturbance_valid):
    """Put the command of step k into the ring. Return True if the command and the disturbance are valid."""
    slot = s.k % COMMAND_RING_SIZE
    valid = (disturbance_valid and _plausible(u.azimuth.rate) and _plausible(u.azimuth.torque)
             and _plausible(u.elevation.rate) and _plausible(u.elevation.torque))
    s.enable[slot] = 1 if valid and u.enable == 1 else 0
    if valid:
        s.rate[slot, 0], s.rate[slot, 1] = u.azimuth.rate, u.elevation.rate
        s.torque[slot, 0], s.torque[slot, 1] = u.azimuth.torque, u.elevation.torque
    return valid


@compiled
def _beam_from_axes(c, azimuth, elevation):
    """Replace the angles and rates of the axes by those of the beam, in the outputs of both."""
    angles, rates = mount.beam(c.mount, azimuth.load_position, elevation.load_position, azimuth.load_velocity,
                               elevation.load_velocity)
    azimuth.load_position, elevation.load_position = angles
    azimuth.load_velocity, elevation.load_velocity = rates


@compiled
def read(s, c, y):
    """Write the present outputs y without integration, for t_0 before the first step. Records of this module."""
    axis.read(s.azimuth, c.azimuth, y.azimuth)
    axis.read(s.elevation, c.elevation, y.elevation)
    if not c.mount.true:
        _beam_from_axes(c, y.azimuth, y.elevation)
    y.phase, y.wanted, y.emergency, y.braked = s.phase, s.wanted, s.emergency, s.braked
    y.following = s.phase == drive_state.PHASE_ENABLED and drive_state.permitted(s)
    y.condition, y.pins = drive_state.condition(s), stow_pins.state_code(s.pins, c.pins)


@compiled
def request(s, c, y, what):
    """Execute drive_state.request between two periods and update the outputs. Return its reply."""
    answer = drive_state.request(s, c, what)
    read(s, c, y)
    return answer


@compiled
def _begin_period(s, c, u, y):
    """Begin a period: external torques, command, brakes and windings."""
    s.azimuth.external, s.elevation.external, valid = external_torques(s, c, u)
    y.invalid_command = 0 if receive_command(s, u, valid) else 1
    s.braked = drive_state.advance(s, c, u.pins, True)
    axis.begin_period(s.azimuth, c.azimuth, s.braked)
    axis.begin_period(s.elevation, c.elevation, s.braked)
    s.azimuth.braked |= stow_pins.holds(s.pins, c.pins, 0)
    s.elevation.braked |= stow_pins.holds(s.pins, c.pins, 1)


@compiled
def apply_command(s, c, u, j):
    """Take the command of speed-loop period j out of the ring. s.following is then 1 if it enables the drive."""
    # While an injected delay begins, `max` repeats the last command. Before the first command, a slot has rate 0.
    s.tick = max(s.tick, s.k * c.speed_ticks + j - c.delay_ticks - s.late_ticks)
    slot = (s.tick // c.speed_ticks) % COMMAND_RING_SIZE
    s.following = s.enable[slot] if s.phase == drive_state.PHASE_ENABLED and u.enable == 1 else 0
    az, el = s.azimuth, s.elevation
    az.commanded_rate, az.commanded_torque = s.rate[slot, 0], s.torque[slot, 0]
    el.commanded_rate, el.commanded_torque = s.rate[slot, 1], s.torque[slot, 1]


@inlined
def _speed_control(s, a, c):
    """Run one speed-loop period of axis a of a drive s."""
    axis.speed_control(a, c, a.commanded_rate, a.commanded_torque, s.following, s.phase != drive_state.PHASE_DISABLED,
                       not s.braked)


@compiled
def between_speed_periods(s, c, substeps):
    """Run current loops and plant of one axis, or of lanes of axes, from one speed-loop period to the next.

    s, c: state and constants of the axis; substeps: plant sub-steps per current-loop period.
    """
    axes = range(count(s))
    for _ in range(axis.CURRENT_LOOP_STEP_COUNT):
        for i in axes:
            axis.current_control(at(s, i).motor_1, at(c, i).motor_1)
            axis.current_control(at(s, i).motor_2, at(c, i).motor_2)
        for _ in range(substeps):
            for i in axes:
                axis.plant_step(at(s, i), at(c, i), at(s, i).external)


@separate
def step(s, c, u, y):
    """Advance one control period from t_k to t_k+1. s and y are written.

    s, c, u, y: records State, Constants, Inputs, Outputs, or lanes.Lanes of them for many
    drives at once. All lanes have the period and the number of sub-steps of the first lane.
    """
    drives = range(count(s))
    for i in drives:
        _begin_period(at(s, i), at(c, i), at(u, i), at(y, i))
    for j in range(at(c, 0).speed_ticks):
        for i in drives:
            apply_command(at(s, i), at(c, i), at(u, i), j)
        for i in drives:
            _speed_control(at(s, i), at(s, i).azimuth, at(c, i).azimuth)
        for i in drives:
            _speed_control(at(s, i), at(s, i).elevation, at(c, i).elevation)
        between_speed_periods(s.azimuth, c.azimuth, at(c, 0).substeps)
        between_speed_periods(s.elevation, c.elevation, at(c, 0).substeps)
    for i in drives:
        at(s, i).k += 1
        read(at(s, i), at(c, i), at(y, i))
