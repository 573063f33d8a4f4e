"""The antenna drive unit: two axes over one control period T, from commands at t_k to encoders at t_k+1.

Sub-steps inside: speed loop 0.5 ms, current loops 100 us, plant 50 us, all in one compiled call.
"""
import math

import numpy as np

from adu_drive import axis, drive_state, stow_pins
from adu_drive.lanes import at, count
from adu_drive.params import AduParameters, whole_speed_periods
from adu_drive.plant import gimbal, mount, wind, wind_field
from pedestal_common.compiled import compiled, inlined

COMMAND_RING_SIZE = 256
"""Commands kept for the transport delay: more than twice MAX_DELAY over the shortest period, once of its own and once
injected."""

INITIAL_AGE_PERIODS = 1 << 40
"""Periods since the brakes were last moved, at the start."""

MAX_PLAUSIBLE_INPUT = 1e6
"""Inputs beyond this (rad/s, Nm, rad/s2), infinite or NaN are not believed."""

_AXIS_INPUTS_DTYPE = np.dtype([('rate', 'f8'), ('torque', 'f8')], align=True)

INPUTS_DTYPE = np.dtype([('azimuth', _AXIS_INPUTS_DTYPE), ('elevation', _AXIS_INPUTS_DTYPE),
                         ('base_acceleration', 'f8', (3,)), ('enable', 'i8'), ('base_rate', 'f8', (3,)),
                         ('pins', 'i8')],
                        align=True)
"""Per axis: rate command [rad/s], feed-forward torque (both motors together, on the load axis) [Nm].
base_acceleration, base_rate: angular acceleration [rad/s2] and rate [rad/s] of the deck, FLU.
enable 1: follow, 0: controlled stop, at once whatever the delay. pins: code of acu/stow_pins."""

_AXIS_OUTPUTS_DTYPE = np.dtype([
    ('position', 'f8'), ('velocity', 'f8'), ('torque', 'f8'),
    ('motor_position', 'f8', (2,)), ('motor_velocity', 'f8', (2,)), ('motor_torque', 'f8', (2,)), ('bias', 'f8'),
    ('torque_limited', 'i8'), ('voltage_limited', 'i8'), ('end_stop', 'i8'), ('stopping', 'i8'),
    ('faults', 'i8'), ('thermal_load', 'f8', (2,)),
    ('load_position', 'f8'), ('load_velocity', 'f8'), ('true_torque', 'f8', (2,))], align=True)

OUTPUTS_DTYPE = np.dtype([('azimuth', _AXIS_OUTPUTS_DTYPE), ('elevation', _AXIS_OUTPUTS_DTYPE),
                          ('invalid_command', 'i8'),
                          ('phase', 'i8'), ('following', 'i8'), ('wanted', 'i8'), ('emergency', 'i8'),
                          ('braked', 'i8'),
                          ('condition', 'i8'), ('pins', 'i8')], align=True)
"""At t_k+1, per axis:

position          load encoder [rad]
velocity          mean motor speed / N [rad/s], from the motor encoders over the last 0.5 ms
torque            of both motors on the load axis, from their currents [Nm]
motor_position, motor_velocity, motor_torque    of motor 1 and 2 on the shaft: encoder, its difference, K_t times
                  the current as measured
bias              T_b [Nm]
torque_limited, voltage_limited                 1 when it happened within the period
end_stop          1 when the end of travel cut the rate command within the period
stopping          1 when not enabled within the period: ramped to standstill, then held there
faults            latched fault word, see faults.FAULTS
thermal_load      of motor 1 and 2; 1 after rated torque for ever
load_position, load_velocity                    the truth: where the beam points (the dish, where the structure is
                  flexible) [rad] and how fast it turns [rad/s]; no controller knows it
true_torque       K_t i_q of motor 1 and 2, for tests; never published

invalid_command   1 when an input of this call was not finite (or beyond MAX_PLAUSIBLE_INPUT): the command counts as
enable 0,
                  a disturbance as 0
phase             of drive_state.PHASES; following: 1 when enabled and nothing stands against it at t_k+1
wanted            1 unless the drive was asked to be disabled
emergency         1 when an emergency stop is latched
braked            1 when the brakes grip
condition         see drive_state.condition; pins: stow_pins.told
"""


def _record(values):
    """A (1,) record of a nested dictionary: int -> i8, float -> f8, array and dictionary nested."""
    fields = {name: _record(value) if isinstance(value, dict) else np.asarray(value)[np.newaxis]
              for name, value in values.items()}
    record = np.zeros(1, np.dtype([(name, field.dtype, field.shape[1:]) for name, field in fields.items()],
                                  align=True))
    for name, field in fields.items():
        record[name] = field
    return record


def _constants(params, substeps):
    h = axis.CURRENT_LOOP_PERIOD_S / substeps
    bodies = gimbal.constants(params)
    return _record({'azimuth': axis.constants(params.azimuth, h, bodies['rigid']),
                    'elevation': axis.constants(params.elevation, h), 'bodies': bodies,
                    'wind': wind.constants(params.wind), 'field': wind_field.constants(params.wind.field),
                    'mount': mount.constants(params.mount), 'pins': stow_pins.constants(params),
                    'period': params.period,
                    'speed_ticks': whole_speed_periods('period', params.period),
                    'delay_ticks': whole_speed_periods('transport_delay', params.transport_delay),
                    **{f'{name}_periods': math.ceil(getattr(params.brakes, f'{name}_time') / params.period - 1e-6)
                       for name in ('engage', 'release', 'stop')},
                    'substeps': substeps})


def _initial_state(params):
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
                    'late_ticks': 0,
                     'applied': int(not enabled), 'brake_age': INITIAL_AGE_PERIODS, 'braked': int(not enabled),
                    'following': 0,
                     'pins': stow_pins.initial_state(params)})


CONSTANTS_DTYPE = _constants(AduParameters(), 2).dtype
STATE_DTYPE = _initial_state(AduParameters()).dtype
"""One dtype object for all records: numba knows it again at once, an equal one it compares anew (3 us a call)."""


def constants(params: AduParameters, substeps: int = 2) -> np.ndarray:
    """Hoisted constants, (1,) record; `substeps` plant sub-steps in a current-loop period (2: h = 50 us)."""
    return _constants(params, substeps).view(CONSTANTS_DTYPE)


def initial_state(params: AduParameters) -> np.ndarray:
    """At rest at the initial angles, in balance with wind (t = 0) and unbalance, bias in place: (1,) record."""
    return _initial_state(params).view(STATE_DTYPE)


@compiled
def _plausible(x):
    return abs(x) <= MAX_PLAUSIBLE_INPUT


@compiled
def inertial_torques(azimuth, J_azimuth, J_elevation, x, y, z):
    """Torques [Nm] on azimuth and elevation when the deck accelerates with (x, y, z) [rad/s2] about its FLU axes.

    The load lags behind the deck: -J (n . acceleration) about the axis n of growing angle: azimuth grows clockwise,
    n = (0, 0, -1); elevation lifts the beam (cos A, -sin A, 0) towards +z, n = (-sin A, -cos A, 0).
    """
    return J_azimuth * z, J_elevation * (x * math.sin(azimuth) + y * math.cos(azimuth))


@compiled
def _apply_rigid_body_torques(s, c, w, w_dot):
    """Set the inertia of azimuth and the torques that turning bodies put on both axes, constant over the period.

    An axis feels the other's acceleration of the period before: M_AE^2 < M_AA M_EE, so that dies out.
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
def _external(s, c, u):
    """External torques [Nm] on the two loads, constant over the period, and whether every input was believable."""
    x, y, z = u.base_acceleration[0], u.base_acceleration[1], u.base_acceleration[2]
    azimuth, elevation = s.azimuth.theta, s.elevation.theta
    T_azimuth, T_elevation = wind.torques(c.wind, s.k * c.period)
    if c.field.blows:
        of_field = wind_field.torques(c.field, s.k * c.period, azimuth, elevation)
        T_azimuth, T_elevation = T_azimuth + of_field[0], T_elevation + of_field[1]
    T_azimuth += s.azimuth.gust - c.azimuth.unbalance * math.cos(azimuth)
    T_elevation += s.elevation.gust - c.elevation.unbalance * math.cos(elevation)
    believed = _plausible(x) and _plausible(y) and _plausible(z)
    if not believed:
        x = y = z = 0.0
    if c.bodies.rigid:
        _apply_rigid_body_torques(s, c, u.base_rate, (x, y, z))
    else:
        s.azimuth.deck, s.elevation.deck = inertial_torques(azimuth, c.azimuth.J, c.elevation.J, x, y, z)
    return T_azimuth + s.azimuth.deck, T_elevation + s.elevation.deck, believed


@compiled
def _receive(s, u, disturbance_believed):
    """Put the command of step k into the ring; returns whether it was believable."""
    slot = s.k % COMMAND_RING_SIZE
    believed = (disturbance_believed and _plausible(u.azimuth.rate) and _plausible(u.azimuth.torque)
                and _plausible(u.elevation.rate) and _plausible(u.elevation.torque))
    s.enable[slot] = 1 if believed and u.enable == 1 else 0
    if believed:
        s.rate[slot, 0], s.rate[slot, 1] = u.azimuth.rate, u.elevation.rate
        s.torque[slot, 0], s.torque[slot, 1] = u.azimuth.torque, u.elevation.torque
    return believed


@compiled
def _beam_from_axes(c, azimuth, elevation):
    """Turn the angles and rates of the axes into those of the beam, in the outputs of both."""
    angles, rates = mount.beam(c.mount, azimuth.load_position, elevation.load_position, azimuth.load_velocity,
                               elevation.load_velocity)
    azimuth.load_position, elevation.load_position = angles
    azimuth.load_velocity, elevation.load_velocity = rates


@compiled
def read(s, c, y):
    """Outputs y as they are now, nothing integrated: at t_0, before the first step. Records of this module."""
    axis.read(s.azimuth, c.azimuth, y.azimuth)
    axis.read(s.elevation, c.elevation, y.elevation)
    if not c.mount.true:
        _beam_from_axes(c, y.azimuth, y.elevation)
    y.phase, y.wanted, y.emergency, y.braked = s.phase, s.wanted, s.emergency, s.braked
    y.following = s.phase == drive_state.PHASE_ENABLED and drive_state.permitted(s)
    y.condition, y.pins = drive_state.condition(s), stow_pins.state_code(s.pins, c.pins)


@compiled
def request(s, c, y, what):
    """drive_state.request between two periods; the outputs read back what is now."""
    answer = drive_state.request(s, c, what)
    read(s, c, y)
    return answer


@compiled
def _begin_period(s, c, u, y):
    """What happens once in a period, at its beginning: external torques, the command, brakes and windings."""
    s.azimuth.external, s.elevation.external, believed = _external(s, c, u)
    y.invalid_command = 0 if _receive(s, u, believed) else 1
    s.braked = drive_state.advance(s, c, u.pins)
    axis.begin_period(s.azimuth, c.azimuth, s.braked)
    axis.begin_period(s.elevation, c.elevation, s.braked)
    s.azimuth.braked |= stow_pins.holds(s.pins, c.pins, 0)
    s.elevation.braked |= stow_pins.holds(s.pins, c.pins, 1)


@compiled
def _apply_command(s, c, u, j):
    """Take the command that is obeyed in speed-loop period j out of the ring; 1 where that enables the drive."""
    s.tick = max(s.tick, s.k * c.speed_ticks + j - c.delay_ticks - s.late_ticks)    # late: the last one stays
    slot = (s.tick // c.speed_ticks) % COMMAND_RING_SIZE     # before the first command: a slot still empty, rate 0
    s.following = s.enable[slot] if s.phase == drive_state.PHASE_ENABLED and u.enable == 1 else 0
    az, el = s.azimuth, s.elevation
    az.asked_rate, az.asked_torque = s.rate[slot, 0], s.torque[slot, 0]
    el.asked_rate, el.asked_torque = s.rate[slot, 1], s.torque[slot, 1]


@inlined
def _speed_control(s, a, c):
    """One speed-loop period of axis a of a drive s."""
    axis.speed_control(a, c, a.asked_rate, a.asked_torque, s.following, s.phase != drive_state.PHASE_DISABLED,
                       not s.braked)


@compiled
def between_speed_periods(s, c, substeps):
    """Current loops and plant of one axis, or of lanes of them, from one speed-loop period to the next."""
    axes = range(count(s))
    for _ in range(axis.CURRENT_LOOP_STEP_COUNT):
        for i in axes:
            axis.current_control(at(s, i).motor_1, at(c, i).motor_1)
            axis.current_control(at(s, i).motor_2, at(c, i).motor_2)
        for _ in range(substeps):
            for i in axes:
                axis.plant_step(at(s, i), at(c, i), at(s, i).external)


@compiled
def step(s, c, u, y):
    """One control period from t_k to t_k+1. Records STATE_DTYPE, CONSTANTS_DTYPE, INPUTS_DTYPE, OUTPUTS_DTYPE, or
    lanes.Lanes of them, whose
    periods and sub-steps are those of the first; s and y are written."""
    drives = range(count(s))
    for i in drives:
        _begin_period(at(s, i), at(c, i), at(u, i), at(y, i))
    for j in range(at(c, 0).speed_ticks):
        for i in drives:
            _apply_command(at(s, i), at(c, i), at(u, i), j)
        for i in drives:
            _speed_control(at(s, i), at(s, i).azimuth, at(c, i).azimuth)
        for i in drives:
            _speed_control(at(s, i), at(s, i).elevation, at(c, i).elevation)
        between_speed_periods(s.azimuth, c.azimuth, at(c, 0).substeps)
        between_speed_periods(s.elevation, c.elevation, at(c, 0).substeps)
    for i in drives:
        at(s, i).k += 1
        read(at(s, i), at(c, i), at(y, i))
