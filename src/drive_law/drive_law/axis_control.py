"""Control of one axis with two motors on one load: speed loop, bias torque, observer, and the faults it detects.

A simulated drive writes the values of its sensors into the state, a real drive those of its reports.
"""
import math
from typing import Annotated

from drive_law import faults, loops
from drive_law.axis_params import AxisParameters, MotorParameters, ThermalParameters
from pedestal_common.compiled import compiled, inlined
from pedestal_common.quantities import (
    Amperes,
    Bit,
    Ints,
    NewtonMeters,
    Pair,
    Radians,
    RadiansPerSecond,
    RadiansPerSecond2,
    Records,
    Seconds,
)
from pedestal_common.record import Record


class MotorConstants(Record):
    """A motor. The names follow the rules of Constants."""
    per_rated: float        # 1 / T_rated
    heat_gain: float
    K_t_hat: float          # [Nm/A]
    per_K_t_hat: float
    gain: float             # of the current sensor
    offset: Amperes
    limit: NewtonMeters     # largest torque reference
    per_rad: float          # of the motor encoder
    rad: Radians


class Constants(Record):
    """Constants of an axis. The names follow these rules:

    per_X            1 / X; per_2N = 1 / (2 N)
    K_iT             integral gain times the period of its loop
    X_gain           share of the way to its input that a first-order lag moves in a period: 1 - exp(-period / lag)
    rad, per_rad     angle of an encoder count [rad], counts per rad
    X_hat            value in the controller; the true value has no suffix
    """
    motor_1: MotorConstants
    motor_2: MotorConstants
    N: float                # ratio motor : load
    per_N: float
    per_2N: float
    per_rad: float          # of the load encoder
    rad: Radians
    zero_hat: Radians       # zero of the load encoder minus zero of the motor encoders
    K_p: float              # of the speed loop
    K_iT: float
    K_d: float              # damping between the motors [Nms/rad]
    independent: Bit        # 1: a speed loop for each motor
    l_1: float              # see loops.observer_gains
    l_2: float
    h_J_shaft: float        # h: period of the speed loop
    T_b: NewtonMeters       # bias torque that keeps the two pinions on opposite flanks
    out: NewtonMeters       # see loops.bias_constants
    per_fade: float
    bias_gain: float
    rate_max: RadiansPerSecond
    a: RadiansPerSecond2
    ramp: RadiansPerSecond      # change of the rate in a speed-loop period at the deceleration a
    lower: Radians              # ends of travel
    upper: Radians
    K: float                    # see loops.approach_rate
    faults: faults.Limits


class MotorState(Record):
    """State of a motor."""
    i_d: Amperes
    i_q: Amperes
    theta: Radians
    count: int                  # of the encoder, at the last speed-loop period
    measured: RadiansPerSecond
    sum: NewtonMeters           # integral part of the speed loop
    torque_ref: NewtonMeters
    limited: Bit                # 1 if the voltages were limited since the last speed-loop period
    inhibited: Bit              # 1 while the inverter is off
    heat: float                 # thermal load


class State(Record):
    """State of an axis."""
    motor_1: MotorState
    motor_2: MotorState
    theta: Radians              # at which the load meets the switches beyond the ends of travel
    reading: float              # counts of the load encoder at t_k
    commanded_rate: RadiansPerSecond    # command that is executed in a speed-loop period
    commanded_torque: NewtonMeters
    bias: NewtonMeters
    rate: RadiansPerSecond      # reference of the speed loop: the commanded rate within ramp and travel
    omega_hat: RadiansPerSecond         # estimates of the observer: mean motor speed, disturbance per motor
    d_hat: NewtonMeters
    torque_limited: Bit         # 1 if it was so in this control period; voltage_limited and end_stop too
    voltage_limited: Bit
    end_stop: Bit
    stopping: Bit               # 1 if the axis was not enabled in the control period: it ramped to standstill, or held
    faults: int                 # latched fault word, see faults.AXIS_FAULTS
    present: int                # faults whose cause was present in this period
    late: int                   # successive speed-loop periods with a rate error above that of the following error
    ramping: Bit                # 1 from a stop on, until a ramp with `limits.deceleration` has led to the command
    motor_lost: Annotated[Ints, (2,)]   # 1 for a motor whose amplifier is off and reports it


class Outputs(Record):
    """Outputs of an axis at t_k+1."""
    position: Radians           # of the load encoder
    velocity: RadiansPerSecond  # mean motor speed / N, from the motor encoders over the last 0.5 ms
    torque: NewtonMeters        # of both motors on the load axis, from their currents
    motor_position: Pair        # of motors 1 and 2 on the shaft, from their encoders [rad]
    motor_velocity: Pair        # difference of an encoder [rad/s]
    motor_torque: Pair          # K_t times the measured current [Nm]
    bias: NewtonMeters          # T_b
    torque_limited: Bit         # 1 if the limit was active in the period
    voltage_limited: Bit
    end_stop: Bit               # 1 if the end of travel reduced the rate command in the period
    stopping: Bit               # 1 if the axis was not enabled in the period: it ramped to standstill, or held
    faults: int                 # latched fault word, see faults.AXIS_FAULTS
    thermal_load: Pair          # of motors 1 and 2; 1: steady state at rated torque


def motor_constants(m: MotorParameters, heat: ThermalParameters, motor_bits: int, period: Seconds) -> dict[str, float]:
    """Return the values of MotorConstants. period: that of the speed loop."""
    per_rad = counts_per_rad(motor_bits)
    return {'per_rated': 1.0 / heat.rated_torque, 'heat_gain': 1.0 - math.exp(-period / heat.time_constant),
            'K_t_hat': m.torque_constant, 'per_K_t_hat': 1.0 / m.torque_constant,
            'gain': 1.0 + m.drift.current_gain, 'offset': m.drift.current_offset, 'limit': m.torque_limit,
            'per_rad': per_rad, 'rad': 1.0 / per_rad}


def constants(p: AxisParameters, period: Seconds) -> dict[str, float | Records]:
    """Return the values of Constants without those of the motors. period: that of the speed loop."""
    per_rad, N = counts_per_rad(p.encoder.load_bits), p.gear_train.ratio
    J_shaft = 0.5 * (p.motor_1.inertia + p.motor_2.inertia + p.speed_loop.load_inertia / N ** 2)
    T_b, out, per_fade = loops.bias_constants(p.bias)
    final, emergency, _ = p.limits.switches
    l_1, l_2 = loops.observer_gains(p.speed_loop.disturbance_observer, period)
    trips = faults.Limits.of(
        current_2=p.faults.overcurrent ** 2, omega=N * p.faults.overspeed, disagreement=p.faults.encoder_disagreement,
        error=N * p.faults.following_error, late_periods=math.ceil(p.faults.following_time / period - 1e-6),
        heat=p.faults.overtemperature, final_low=p.limits.lower - final, final_high=p.limits.upper + final,
        emergency_low=p.limits.lower - emergency, emergency_high=p.limits.upper + emergency)
    return {'N': N, 'per_N': 1.0 / N, 'per_2N': 0.5 / N, 'per_rad': per_rad, 'rad': 1.0 / per_rad,
            'zero_hat': p.encoder.error.zero, 'K_p': p.speed_loop.proportional,
            'K_iT': p.speed_loop.integral * period, 'K_d': p.speed_loop.differential_damping,
            'independent': p.speed_loop.structure == 'independent', 'l_1': l_1, 'l_2': l_2,
            'h_J_shaft': period / J_shaft, 'T_b': T_b, 'out': out, 'per_fade': per_fade,
            'bias_gain': 1.0 - math.exp(-period / p.bias.lag) if p.bias.lag > 0.0 else 1.0,
            'rate_max': p.limits.rate, 'a': p.limits.deceleration, 'ramp': p.limits.deceleration * period,
            'lower': p.limits.lower, 'upper': p.limits.upper, 'K': p.limits.approach, 'faults': trips}


def counts_per_rad(bits: int) -> float:
    """Return the counts per rad of an encoder. bits: its resolution per turn."""
    return 2.0 ** bits / (2.0 * math.pi)


@inlined
def counts(angle: Radians, per_rad: float) -> float:
    """Return the nearest whole count."""
    return math.floor(angle * per_rad + 0.5)


@compiled
def begin_period(axis: State) -> None:
    """Clear the flags of the last control period."""
    axis.torque_limited = axis.voltage_limited = axis.end_stop = axis.stopping = axis.present = 0


@inlined
def _measured_torque(motor: MotorState, constants: MotorConstants) -> NewtonMeters:
    return constants.K_t_hat * (constants.gain * motor.i_q + constants.offset)


@inlined
def realised_torque(motor: MotorState, constants: MotorConstants) -> NewtonMeters:
    """Return the torque that the motor made: its reference, or by its current if the voltage was limited."""
    return _measured_torque(motor, constants) if motor.limited else motor.torque_ref


@inlined
def mean_motor_speed(axis: State, omega_1: RadiansPerSecond, omega_2: RadiansPerSecond) -> RadiansPerSecond:
    """Return the mean speed of the working motors."""
    if axis.faults & faults.Bit.MOTOR_1_LOST:
        return omega_2
    if axis.faults & faults.Bit.MOTOR_2_LOST:
        return omega_1
    return 0.5 * (omega_1 + omega_2)


@inlined
def _torque_control(axis: State, constants: Constants, omega: RadiansPerSecond, feed_forward: NewtonMeters) -> bool:
    """Set the torque references of both motors for the rate axis.rate. Return True if a motor is at its limit. omega:
    mean motor speed. A single working motor makes the torque of both, up to its limit."""
    c, m1, m2, k1, k2 = constants, axis.motor_1, axis.motor_2, constants.motor_1, constants.motor_2
    alone = axis.faults & faults.MOTORS_LOST_BITS
    omega_1, omega_2 = (m1.measured, m2.measured) if c.independent and not alone else (omega, omega)
    error_1, error_2 = c.N * axis.rate - omega_1, c.N * axis.rate - omega_2
    T_1 = loops.torque_demand(error_1, m1.sum, c.K_p, feed_forward)
    T_2 = loops.torque_demand(error_2, m2.sum, c.K_p, feed_forward)
    if alone:
        axis.bias, total = 0.0, T_1 + T_2
        T_1, T_2 = (0.0, total) if alone & faults.Bit.MOTOR_1_LOST else (total, 0.0)
    else:
        axis.bias += c.bias_gain * (loops.scheduled_bias(0.5 * (T_1 + T_2), c.T_b, c.out, c.per_fade) - axis.bias)
        T_1, T_2 = loops.shared_torques(T_1, T_2, axis.bias, m1.measured, m2.measured, c.K_d)
    m1.torque_ref, m2.torque_ref = loops.limited_torque(T_1, k1.limit), loops.limited_torque(T_2, k2.limit)

    # Anti-windup: the excess is the demanded minus the realised torque (loops.integral). With one speed loop for both
    # motors, both integrals get the mean excess, so that they stay equal.
    limited = m1.torque_ref != T_1 or m2.torque_ref != T_2
    excess_1 = excess_2 = 0.0
    if limited or m1.limited or m2.limited:
        excess_1, excess_2 = T_1 - realised_torque(m1, k1), T_2 - realised_torque(m2, k2)
        if alone or not c.independent:
            excess_1 = excess_2 = 0.5 * (excess_1 + excess_2)
    m1.sum = loops.integral(m1.sum, error_1, c.K_iT, excess_1)
    m2.sum = loops.integral(m2.sum, error_2, c.K_iT, excess_2)
    return limited


@inlined
def _squared_current(motor: MotorState, constants: MotorConstants) -> float:
    i_d, i_q = constants.gain * motor.i_d, constants.gain * motor.i_q + constants.offset
    return i_d * i_d + i_q * i_q


@inlined
def _supervise(axis: State, constants: Constants, reading: float, omega: RadiansPerSecond, free: bool) -> None:
    """Set the faults that the drive measures. Only a motor that is free to turn can have a following error."""
    c, m1, m2, k1, k2 = constants, axis.motor_1, axis.motor_2, constants.motor_1, constants.motor_2
    axis.late = faults.late(axis.late, c.N * axis.rate - omega, c.faults.error) if free else 0
    axis.present |= faults.measured_faults(
        max(_squared_current(m1, k1), _squared_current(m2, k2)),
        max(abs(m1.measured), abs(m2.measured)),
        c.rad * reading - c.zero_hat - c.per_2N * (k1.rad * m1.count + k2.rad * m2.count),
        axis.late, max(m1.heat, m2.heat), axis.faults, c.faults)
    axis.present |= faults.lost_motor_faults(axis.motor_lost)
    axis.present |= faults.end_switch_faults(axis.theta, c.per_N * omega, c.faults)
    axis.faults |= axis.present


@inlined
def _remove_torque(axis: State, omega: RadiansPerSecond, free: bool) -> None:
    """Remove the torque of both motors. The integrals of free motors are cleared. Behind closed brakes they stay,
    because the motors need them when the brakes open."""
    m1, m2 = axis.motor_1, axis.motor_2
    m1.torque_ref = m2.torque_ref = 0.0
    m1.inhibited = m2.inhibited = axis.stopping = axis.ramping = 1
    axis.rate, axis.bias, axis.omega_hat = 0.0, 0.0, omega
    if free:
        m1.sum = m2.sum = axis.d_hat = 0.0


@inlined
def control(axis: State, constants: Constants, reading: float, made: NewtonMeters, rate: RadiansPerSecond,
            torque: NewtonMeters, enable: Bit, powered: bool, free: bool) -> None:
    """Run one speed-loop period: compute the torque references of both motors from a command.

    reading        counts of the load encoder
    made           mean torque that the motors have made since the last period
    rate, torque   commanded rate and feed-forward torque of the load
    enable         1 to follow the command, 0 to stop and hold
    powered        True if the motors may make torque
    free           True if no brake holds the motors
    """
    c, m1, m2 = constants, axis.motor_1, axis.motor_2
    omega = mean_motor_speed(axis, m1.measured, m2.measured)
    _supervise(axis, c, reading, omega, powered and free)
    if not powered or faults.removes_torque(axis.faults):
        _remove_torque(axis, omega, free)
        return
    m1.inhibited, m2.inhibited = axis.faults & faults.Bit.MOTOR_1_LOST, axis.faults & faults.Bit.MOTOR_2_LOST
    axis.omega_hat, axis.d_hat = loops.updated_observer(
        axis.omega_hat, axis.d_hat, omega, made, c.l_1, c.l_2, c.h_J_shaft)

    feed_forward = 0.0
    if enable:
        wanted = min(max(rate, -c.rate_max), c.rate_max)
        if axis.ramping:       # The command may have changed during the stop: approach it by a ramp.
            ramped = axis.rate + min(max(wanted - axis.rate, -c.ramp), c.ramp)
            axis.ramping = ramped != wanted
            wanted = ramped
        else:
            feed_forward = torque * c.per_2N
    else:
        wanted = axis.rate - min(max(axis.rate, -c.ramp), c.ramp)
        axis.stopping = axis.ramping = 1
    position = c.rad * reading
    axis.rate = min(max(wanted, -loops.approach_rate(position - c.lower, c.K, c.a)),
                 loops.approach_rate(c.upper - position, c.K, c.a))
    if axis.rate != wanted:
        feed_forward = 0.0
        axis.end_stop = 1

    limited = _torque_control(axis, c, omega, feed_forward - axis.d_hat)
    axis.torque_limited |= limited
    axis.voltage_limited |= m1.limited | m2.limited
    m1.limited = 0
    m2.limited = 0


@compiled
def read(axis: State, constants: Constants, reading: float, omega_1: RadiansPerSecond, omega_2: RadiansPerSecond,
         outputs: Outputs) -> None:
    """Write the outputs of the axis. omega_1, omega_2: measured motor speeds."""
    c, m1, m2, k1, k2 = constants, axis.motor_1, axis.motor_2, constants.motor_1, constants.motor_2
    axis.reading = reading
    outputs.position = c.rad * reading
    outputs.motor_position[0] = k1.rad * counts(m1.theta, k1.per_rad)
    outputs.motor_position[1] = k2.rad * counts(m2.theta, k2.per_rad)
    outputs.motor_velocity[0], outputs.motor_velocity[1] = omega_1, omega_2
    outputs.velocity = c.per_N * mean_motor_speed(axis, omega_1, omega_2)
    outputs.motor_torque[0] = _measured_torque(m1, k1)
    outputs.motor_torque[1] = _measured_torque(m2, k2)
    outputs.torque = c.N * (outputs.motor_torque[0] + outputs.motor_torque[1])
    outputs.bias = axis.bias
    outputs.torque_limited = axis.torque_limited
    outputs.voltage_limited = axis.voltage_limited
    outputs.end_stop = axis.end_stop
    outputs.stopping = axis.stopping
    outputs.faults = axis.faults
    outputs.thermal_load[0], outputs.thermal_load[1] = m1.heat, m2.heat
