"""The antenna drive unit: two axes over one control period T, from commands at t_k to encoders at t_k+1.

Sub-steps inside: speed loop 0.5 ms, current loops 100 us, plant 50 us, all in one compiled call.
"""
import math

import numpy as np

from adu_drive import axis, drive_state, wind
from adu_drive.params import AduParameters, whole_speed_periods
from pedestal_common.compiled import compiled

RING = 128
"""Commands kept for the transport delay: more than MAX_DELAY over the shortest period."""

LONG_AGO = 1 << 40
"""Periods since the brakes were last moved, at the start."""

LARGEST = 1e6
"""Inputs beyond this (rad/s, Nm, rad/s2), infinite or NaN are not believed."""

_AXIS_INPUTS = np.dtype([('rate', 'f8'), ('torque', 'f8')], align=True)

INPUTS = np.dtype([('azimuth', _AXIS_INPUTS), ('elevation', _AXIS_INPUTS),
                   ('base_acceleration', 'f8', (3,)), ('enable', 'i8')], align=True)
"""Per axis: rate command [rad/s], feed-forward torque (both motors together, on the load axis) [Nm].
base_acceleration: angular acceleration of the deck, FLU [rad/s2].
enable 1: follow, 0: controlled stop, at once whatever the delay."""

_AXIS_OUTPUTS = np.dtype([
    ('position', 'f8'), ('velocity', 'f8'), ('torque', 'f8'),
    ('motor_position', 'f8', (2,)), ('motor_velocity', 'f8', (2,)), ('motor_torque', 'f8', (2,)), ('bias', 'f8'),
    ('torque_limited', 'i8'), ('voltage_limited', 'i8'), ('end_stop', 'i8'), ('stopping', 'i8'),
    ('faults', 'i8'), ('thermal_load', 'f8', (2,)),
    ('load_position', 'f8'), ('load_velocity', 'f8'), ('true_torque', 'f8', (2,))], align=True)

OUTPUTS = np.dtype([('azimuth', _AXIS_OUTPUTS), ('elevation', _AXIS_OUTPUTS), ('invalid_command', 'i8'),
                    ('phase', 'i8'), ('following', 'i8'), ('wanted', 'i8'), ('emergency', 'i8'), ('braked', 'i8'),
                    ('condition', 'i8')], align=True)
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

invalid_command   1 when an input of this call was not finite (or beyond LARGEST): the command counts as enable 0,
                  a disturbance as 0
phase             of drive_state.PHASES; following: 1 when enabled and nothing stands against it at t_k+1
wanted            1 unless the drive was asked to be disabled
emergency         1 when an emergency stop is latched
braked            1 when the brakes grip
condition         see drive_state.condition
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
    h = axis.CURRENT_PERIOD / substeps
    return _record({'azimuth': axis.constants(params.azimuth, h), 'elevation': axis.constants(params.elevation, h),
                    'wind': wind.constants(params.wind), 'period': params.period,
                    'speed_ticks': whole_speed_periods('period', params.period),
                    'delay_ticks': whole_speed_periods('transport_delay', params.transport_delay),
                    **{f'{name}_periods': math.ceil(getattr(params.brakes, f'{name}_time') / params.period - 1e-6)
                       for name in ('engage', 'release', 'stop')},
                    'substeps': substeps})


def _initial_state(params):
    axes, enabled = {}, params.initially_enabled
    for name, torque in zip(('azimuth', 'elevation'), wind.initial_torques(params.wind)):
        p, theta = getattr(params, name), getattr(params, f'initial_{name}')
        external = torque - p.load.unbalance * math.cos(theta)
        axes[name] = axis.initial_state(p, theta, external)
    return _record({**axes, 'rate': np.zeros((RING, 2)), 'torque': np.zeros((RING, 2)),
                    'enable': np.ones(RING, np.int64), 'k': 0,
                    'phase': drive_state.ENABLED if enabled else drive_state.DISABLED, 'age': 0,
                    'wanted': int(enabled), 'emergency': 0,
                    'applied': int(not enabled), 'brake_age': LONG_AGO, 'braked': int(not enabled)})


CONSTANTS = _constants(AduParameters(), 2).dtype
STATE = _initial_state(AduParameters()).dtype
"""One dtype object for all records: numba knows it again at once, an equal one it compares anew (3 us a call)."""


def constants(params: AduParameters, substeps: int = 2) -> np.ndarray:
    """Hoisted constants, (1,) record; `substeps` plant sub-steps in a current-loop period (2: h = 50 us)."""
    return _constants(params, substeps).view(CONSTANTS)


def initial_state(params: AduParameters) -> np.ndarray:
    """At rest at the initial angles, in balance with wind (t = 0) and unbalance, bias in place: (1,) record."""
    return _initial_state(params).view(STATE)


@compiled
def _believed(x):
    return abs(x) <= LARGEST


@compiled
def inertial_torques(azimuth, J_azimuth, J_elevation, x, y, z):
    """Torques [Nm] on azimuth and elevation when the deck accelerates with (x, y, z) [rad/s2] about its FLU axes.

    The load lags behind the deck: -J (n . acceleration) about the axis n of growing angle: azimuth grows clockwise,
    n = (0, 0, -1); elevation lifts the beam (cos A, -sin A, 0) towards +z, n = (-sin A, -cos A, 0).
    """
    return J_azimuth * z, J_elevation * (x * math.sin(azimuth) + y * math.cos(azimuth))


@compiled
def _external(s, c, u):
    """External torques [Nm] on the two loads, constant over the period, and whether every input was believable."""
    x, y, z = u.base_acceleration[0], u.base_acceleration[1], u.base_acceleration[2]
    azimuth, elevation = s.azimuth.theta, s.elevation.theta
    T_azimuth, T_elevation = wind.torques(c.wind, s.k * c.period)
    T_azimuth -= c.azimuth.unbalance * math.cos(azimuth)
    T_elevation -= c.elevation.unbalance * math.cos(elevation)
    believed = _believed(x) and _believed(y) and _believed(z)
    if not believed:
        x = y = z = 0.0
    s.azimuth.deck, s.elevation.deck = inertial_torques(azimuth, c.azimuth.J, c.elevation.J, x, y, z)
    return T_azimuth + s.azimuth.deck, T_elevation + s.elevation.deck, believed


@compiled
def _receive(s, u, disturbance_believed):
    """Put the command of step k into the ring; returns whether it was believable."""
    slot = s.k % RING
    believed = (disturbance_believed and _believed(u.azimuth.rate) and _believed(u.azimuth.torque)
                and _believed(u.elevation.rate) and _believed(u.elevation.torque))
    s.enable[slot] = 1 if believed and u.enable == 1 else 0
    if believed:
        s.rate[slot, 0], s.rate[slot, 1] = u.azimuth.rate, u.elevation.rate
        s.torque[slot, 0], s.torque[slot, 1] = u.azimuth.torque, u.elevation.torque
    return believed


@compiled
def read(s, c, y):
    """Outputs y as they are now, nothing integrated: at t_0, before the first step. Records of this module."""
    axis.read(s.azimuth, c.azimuth, y.azimuth)
    axis.read(s.elevation, c.elevation, y.elevation)
    y.phase, y.wanted, y.emergency, y.braked = s.phase, s.wanted, s.emergency, s.braked
    y.following = s.phase == drive_state.ENABLED and drive_state.permitted(s)
    y.condition = drive_state.condition(s)


@compiled
def request(s, c, y, what):
    """drive_state.request between two periods; the outputs read back what is now."""
    answer = drive_state.request(s, c, what)
    read(s, c, y)
    return answer


@compiled
def step(s, c, u, y):
    """One control period from t_k to t_k+1. Records STATE, CONSTANTS, INPUTS, OUTPUTS; s and y are written."""
    az, el, c_az, c_el = s.azimuth, s.elevation, c.azimuth, c.elevation
    T_az, T_el, believed = _external(s, c, u)
    y.invalid_command = 0 if _receive(s, u, believed) else 1
    s.braked = drive_state.advance(s, c)
    enabled = s.phase == drive_state.ENABLED and u.enable == 1
    powered, free = s.phase != drive_state.DISABLED, not s.braked
    axis.begin_period(az, c_az, s.braked)
    axis.begin_period(el, c_el, s.braked)
    for j in range(c.speed_ticks):
        tick = s.k * c.speed_ticks + j - c.delay_ticks
        slot = (tick // c.speed_ticks) % RING     # before the first command: a slot still empty, rate 0
        enable = s.enable[slot] if enabled else 0
        axis.speed_control(az, c_az, s.rate[slot, 0], s.torque[slot, 0], enable, powered, free)
        axis.speed_control(el, c_el, s.rate[slot, 1], s.torque[slot, 1], enable, powered, free)
        for _ in range(axis.CURRENT_TICKS):
            axis.current_control(az.motor_1, c_az.motor_1)
            axis.current_control(az.motor_2, c_az.motor_2)
            axis.current_control(el.motor_1, c_el.motor_1)
            axis.current_control(el.motor_2, c_el.motor_2)
            for _ in range(c.substeps):
                axis.plant_step(az, c_az, T_az)
                axis.plant_step(el, c_el, T_el)
    s.k += 1
    read(s, c, y)
