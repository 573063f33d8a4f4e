"""One axis: encoders, speed loop, two current loops, two motors, gear train and load.

drive_unit.step calls `speed_control`, `current_control` and `plant_step` at their own periods. These functions work on
the records s (state) and c (constants) of the axis, or m and k of one motor. This module builds both records as nested
dictionaries from p, the AxisParameters.
"""
import math

import numpy as np

from adu_drive.controller import bias, current_loop, disturbance_observer, encoder, faults, pi, speed_loop, travel
from adu_drive.params import SPEED_LOOP_PERIOD_S
from adu_drive.plant import brake, friction, gear_train, motor, structure, thermal
from pedestal_common.compiled import compiled, inlined

CURRENT_LOOP_STEP_COUNT = 5  # number of current-loop periods in a speed-loop period

BRAKE_CONDITIONS = BRAKE_WORKING, BRAKE_STUCK_ON, BRAKE_STUCK_OFF = range(3)
"""Conditions of a brake: it follows its command, or ignores it."""

CURRENT_LOOP_PERIOD_S = SPEED_LOOP_PERIOD_S / CURRENT_LOOP_STEP_COUNT  # period of the current loops [s]

SECOND_PINION_OFFSET_RAD = 0.5 * math.pi
"""Angle by which the second pinion is mounted ahead of the first [rad], so that the runouts of both do not add."""


def _motor_constants(m, loop, heat, per_rad, h, period):
    """Return the constants of a motor; psi, K_t, R are true values, psi_hat, K_t_hat values in the controller.

    m, loop, heat: MotorParameters, CurrentLoopParameters, ThermalParameters; per_rad: counts of the motor encoder per
    rad; h: sub-step of the plant [s]; period: of the speed loop [s].
    """
    w = 2.0 * math.pi * loop.bandwidth
    R, psi = m.resistance * (1.0 + m.drift.resistance), m.flux_linkage * (1.0 + m.drift.flux_linkage)
    return {'p': float(m.pole_pairs), 'psi': psi, 'L': m.inductance, 'K_t': 1.5 * m.pole_pairs * psi,
            'h_L': h / m.inductance, 'h_R_L': h * R / m.inductance,
            'rise': thermal.COPPER_COEFFICIENT_PER_K * heat.rise, 'per_rated': 1.0 / heat.rated_torque,
            'heat_gain': 1.0 - math.exp(-period / heat.time_constant),
            'h_brake_J': h * m.brake / m.inertia, 'T_c': m.friction, 'per_v': 1.0 / m.friction_speed,
            'h_J': h / m.inertia, 'q_B': 1.0 / (1.0 + h * m.viscous / m.inertia),
            'T_cog': m.cogging, 'cogs': float(m.cogging_per_turn),
            'psi_hat': m.flux_linkage, 'K_t_hat': m.torque_constant, 'per_K_t_hat': 1.0 / m.torque_constant,
            'gain': 1.0 + m.drift.current_gain, 'offset': m.drift.current_offset,
            'K_p': w * m.inductance, 'K_iT': w * m.resistance * CURRENT_LOOP_PERIOD_S, 'v_max': m.voltage,
            'limit': m.torque_limit, 'per_rad': per_rad, 'rad': 1.0 / per_rad,
            'speed': 1.0 / per_rad / period}


def _dish(p):
    """Return inertia [kg m2], stiffness [Nm/rad] and damping [Nms/rad] of the dish, the flexible part of the load."""
    J_dish = p.structure.inertia_share * p.load.inertia
    return J_dish, *structure.spring_and_damper(J_dish, p.structure.frequency, p.structure.damping)


def _uneven(p):
    """Return the constants of runout, tooth error and cogging, which vary with the angles of pinions and motors."""
    g = p.gear_train
    return {'uneven': int(g.runout + g.tooth_error + p.motor_1.cogging + p.motor_2.cogging > 0.0), 'runout': g.runout,
            'tooth_error': g.tooth_error, 'teeth': float(g.pinion_teeth), 'per_reducer': 1.0 / g.reducer_ratio}


def constants(p, h, varying=False, period=SPEED_LOOP_PERIOD_S):
    """Return the constants of an axis (AxisParameters) for a plant sub-step h [s], computed once: nested dictionary.

    varying: True if the inertia of the load varies; `change_inertia` then sets it before each control period. period:
    of the speed loop [s].

    The docstrings of the laws define their constants. The names follow these rules:

    per_X            1 / X; per_2N = 1 / (2 N)
    h_X, h_R_L       h / X, h R / L; h_sigma_0 = h sigma_0; sigma_1_h = sigma_1 / h; h in h_J_shaft: speed-loop period
    q_B              factor of an implicit step with viscous friction: 1 / (1 + h B / J)
    K_iT             integral gain times the period of its loop
    X_gain           share of the way to its input that a first-order lag moves in a period: 1 - exp(-period / lag)
    rad, per_rad     angle of an encoder count [rad], counts per rad
    X_hat            value in the controller; the true value has no suffix
    """
    per_rad = 2.0 ** p.encoder.load_bits / (2.0 * math.pi)
    motor_per_rad = 2.0 ** p.encoder.motor_bits / (2.0 * math.pi)
    N = p.gear_train.ratio
    J_shaft = 0.5 * (p.motor_1.inertia + p.motor_2.inertia + p.speed_loop.load_inertia / N ** 2)
    T_b, out, per_fade = bias.schedule_constants(p.bias)
    J_dish, k_dish, c_dish = _dish(p)
    J_base = p.load.inertia - J_dish
    final, emergency, buffer = p.limits.switches
    l_1, l_2 = disturbance_observer.gains(p.speed_loop.disturbance_observer, period)
    return {
        'motor_1': _motor_constants(p.motor_1, p.current_loop, p.thermal, motor_per_rad, h, period),
        'motor_2': _motor_constants(p.motor_2, p.current_loop, p.thermal, motor_per_rad, h, period),
        'N': N, 'per_N': 1.0 / N, 'per_2N': 0.5 / N, 'per_rad': per_rad, 'rad': 1.0 / per_rad,
        'K_p': p.speed_loop.proportional, 'K_iT': p.speed_loop.integral * period,
        'K_d': p.speed_loop.differential_damping, 'independent': int(p.speed_loop.structure == 'independent'),
        'l_1': l_1, 'l_2': l_2, 'h_J_shaft': period / J_shaft,
        'T_b': T_b, 'out': out, 'per_fade': per_fade,
        'bias_gain': 1.0 - math.exp(-period / p.bias.lag) if p.bias.lag > 0.0 else 1.0,
        'k': p.gear_train.stiffness, 'c': p.gear_train.damping, 'half_lash': 0.5 * p.gear_train.lash,
        'pinion_ratio': p.gear_train.pinion_ratio, **_uneven(p),
        'flexible': int(J_dish > 0.0), 'k_dish': k_dish, 'c_dish': c_dish,
        'h_J_dish': h / J_dish if J_dish else 0.0, 'base_share': 1.0 - p.structure.inertia_share,
        'varying': int(varying), 'h': h, 'J': p.load.inertia, 'B': p.load.viscous, 'h_J': h / J_base,
        'q_B': 1.0 / (1.0 + h * p.load.viscous / J_base), 'unbalance': p.load.unbalance,
        'T_c': p.friction.coulomb, 'T_sc': p.friction.breakaway - p.friction.coulomb,
        'per_v2': p.friction.stribeck_rate ** -2, 'sigma_0': p.friction.stiffness,
        'h_sigma_0': h * p.friction.stiffness, 'sigma_1_h': p.friction.damping / h,
        'encoder': encoder.errors(p.encoder.error),
        'rate_max': p.limits.rate, 'a': p.limits.deceleration, 'ramp': p.limits.deceleration * period,
        'lower': p.limits.lower, 'upper': p.limits.upper, 'K': p.limits.approach,
        'stop_lower': p.limits.lower - buffer, 'stop_upper': p.limits.upper + buffer,
        'k_stop': p.limits.buffer_stiffness, 'c_stop': p.limits.buffer_damping,
        'faults': {'current_2': p.faults.overcurrent ** 2, 'omega': N * p.faults.overspeed,
                   'disagreement': p.faults.encoder_disagreement, 'error': N * p.faults.following_error,
                   'late_periods': math.ceil(p.faults.following_time / period - 1e-6),
                   'heat': p.faults.overtemperature, 'final_low': p.limits.lower - final,
                   'final_high': p.limits.upper + final, 'emergency_low': p.limits.lower - emergency,
                   'emergency_high': p.limits.upper + emergency}}


def _motor_at_rest(m, g, T, total, theta, per_rad):
    """Return the state of a motor that makes T [Nm] at standstill with its pinion on the flank, load at theta [rad].

    m, g: MotorParameters, GearTrainParameters; total: part of T from the integral of the speed loop [Nm]; per_rad:
    counts of the motor encoder per rad.
    """
    i_ref = T / m.torque_constant
    i_q = (i_ref - m.drift.current_offset) / (1.0 + m.drift.current_gain)
    v_q = m.resistance * (1.0 + m.drift.resistance) * i_q
    made = m.torque_constant * (1.0 + m.drift.flux_linkage) * i_q
    flank = math.copysign(0.5 * g.lash, made) if made != 0.0 else 0.0
    angle = g.ratio * (theta + flank + made * g.ratio / g.stiffness)
    return {'i_d': 0.0, 'i_q': i_q, 'i_ref': i_ref, 'v_d': 0.0, 'v_q': v_q, 'sum_d': 0.0, 'sum_q': v_q,
            'omega': 0.0, 'theta': angle, 'count': encoder.counts.py_func(angle, per_rad), 'measured': 0.0,
            'sum': total, 'torque_ref': T, 'limited': 0, 'inhibited': 0, 'heat': 0.0, 'q_R': 1.0}


def initial_state(p, theta, external):
    """Return the state of an axis at rest at theta [rad], in balance with an external torque [Nm]: nested dictionary.

    reading        counts of the load encoder at t_k
    external       torque on the load [Nm], constant over a control period; it includes `deck`
    deck           part of `external` from the motion of the deck and of the other axis [Nm]; base and dish
                   get it in proportion to their inertia
    commanded_rate, commanded_torque    command that is executed in a speed-loop period [rad/s, Nm]
    rate           rate reference of the speed loop [rad/s]: the commanded rate within ramp and travel
    stopping       1 if the axis was not enabled in the control period: it ramped to standstill, or held
    ramping        1 from a stop on, until a ramp with the deceleration `limits.deceleration` has led to the command
    faults         latched fault word, see faults.AXIS_FAULTS; present: faults whose cause was present in this period
    late           number of successive speed-loop periods with a rate error above the limit of the following error

    Fields of injected faults:

    motor_lost     1 for a motor whose amplifier is off and reports it
    jump, stuck    error of the load encoder [counts]; 1 if its reading is stuck
    brake_stuck    one of BRAKE_CONDITIONS
    toothless      1 if a pinion has lost a tooth; `teeth` is then its number of teeth, else 0
    gust           torque on the load in addition to the wind [Nm]
    """
    per_rad = 2.0 ** p.encoder.motor_bits / (2.0 * math.pi)
    _, k_dish, _ = _dish(p)
    T = -0.5 * external / p.gear_train.ratio
    observed = p.speed_loop.disturbance_observer > 0.0
    total = 0.0 if observed else T
    T_b = bias.scheduled.py_func(T, *bias.schedule_constants(p.bias))
    return {'motor_1': _motor_at_rest(p.motor_1, p.gear_train, T + T_b, total, theta, per_rad),
            'motor_2': _motor_at_rest(p.motor_2, p.gear_train, T - T_b, total, theta, per_rad),
            'theta': theta, 'omega': 0.0, 'z': 0.0, 'h_J': 0.0, 'q_B': 0.0, 'h_J_dish': 0.0,
            'dish': theta + external / k_dish if k_dish else theta, 'omega_dish': 0.0, 'external': external,
            'deck': 0.0, 'commanded_rate': 0.0, 'commanded_torque': 0.0,
            'bias': T_b, 'rate': 0.0, 'omega_hat': 0.0, 'd_hat': -T if observed else 0.0,
            'torque_limited': 0, 'voltage_limited': 0, 'end_stop': 0, 'stopping': 0,
            'faults': 0, 'present': 0, 'late': 0, 'ramping': 0, 'braked': 0, 'reading': 0.0,
            'motor_lost': np.zeros(2, np.int64), 'jump': 0.0, 'stuck': 0, 'brake_stuck': BRAKE_WORKING, 'toothless': 0,
            'teeth': np.zeros(2), 'gust': 0.0}


@inlined
def load_counts(s, c):
    """Return the reading of the load encoder [counts]."""
    return s.reading if s.stuck else encoder.counts(encoder.reading(s.theta, c.encoder), c.per_rad) + s.jump


@inlined
def _measured_speed(m, k):
    """Return the motor speed [rad/s]: encoder difference over a speed-loop period (0.25 ms old on average)."""
    return (encoder.counts(m.theta, k.per_rad) - m.count) * k.speed


@inlined
def read_motor_sensors(m, k):
    """Measure the speed of a motor and advance its thermal load by a speed-loop period; m, k: state and constants."""
    m.measured = _measured_speed(m, k)
    m.heat = thermal.load(m.heat, k.K_t * m.i_q, k.per_rated, k.heat_gain)
    m.count = encoder.counts(m.theta, k.per_rad)


@inlined
def _measured_torque(m, k):
    """Return the torque [Nm] from the current sensor and the torque constant in the controller."""
    return k.K_t_hat * (k.gain * m.i_q + k.offset)


@inlined
def realised_torque(m, k):
    """Return the torque [Nm] that the motor made: its reference, or by its current if the voltage was limited."""
    return _measured_torque(m, k) if m.limited else m.torque_ref


@inlined
def mean_motor_speed(s, omega_1, omega_2):
    """Return the mean speed [rad/s] of the working motors."""
    if s.faults & faults.Bit.MOTOR_1_LOST:
        return omega_2
    if s.faults & faults.Bit.MOTOR_2_LOST:
        return omega_1
    return 0.5 * (omega_1 + omega_2)


@inlined
def _torque_control(s, c, omega, feed_forward):
    """Set the torque references of both motors for the rate s.rate. Return True if a motor is at its limit.

    omega: mean motor speed [rad/s]; feed_forward: torque added to the demand of each motor [Nm]. A single working
    motor makes the torque of both, up to its limit.
    """
    m1, m2, k1, k2 = s.motor_1, s.motor_2, c.motor_1, c.motor_2
    alone = s.faults & faults.MOTORS_LOST_BITS
    omega_1, omega_2 = (m1.measured, m2.measured) if c.independent and not alone else (omega, omega)
    error_1, error_2 = c.N * s.rate - omega_1, c.N * s.rate - omega_2
    T_1 = speed_loop.torque(error_1, m1.sum, c.K_p, feed_forward)
    T_2 = speed_loop.torque(error_2, m2.sum, c.K_p, feed_forward)
    if alone:
        s.bias, total = 0.0, T_1 + T_2
        T_1, T_2 = (0.0, total) if alone & faults.Bit.MOTOR_1_LOST else (total, 0.0)
    else:
        s.bias += c.bias_gain * (bias.scheduled(0.5 * (T_1 + T_2), c.T_b, c.out, c.per_fade) - s.bias)
        T_1, T_2 = speed_loop.shared(T_1, T_2, s.bias, m1.measured, m2.measured, c.K_d)
    m1.torque_ref, m2.torque_ref = speed_loop.limited(T_1, k1.limit), speed_loop.limited(T_2, k2.limit)

    # Anti-windup: the excess is the demanded minus the realised torque (pi.integral). With one speed loop for both
    # motors, both integrals get the mean excess, so that they stay equal.
    limited = m1.torque_ref != T_1 or m2.torque_ref != T_2
    excess_1 = excess_2 = 0.0
    if limited or m1.limited or m2.limited:
        excess_1, excess_2 = T_1 - realised_torque(m1, k1), T_2 - realised_torque(m2, k2)
        if alone or not c.independent:
            excess_1 = excess_2 = 0.5 * (excess_1 + excess_2)
    m1.sum = pi.integral(m1.sum, error_1, c.K_iT, excess_1)
    m2.sum = pi.integral(m2.sum, error_2, c.K_iT, excess_2)
    return limited


@inlined
def _squared_current(m, k):
    """Return the square of the measured current [A2]."""
    i_d, i_q = k.gain * m.i_d, k.gain * m.i_q + k.offset
    return i_d * i_d + i_q * i_q


@inlined
def _supervise(s, c, omega, free):
    """Set the faults that the drive measures.

    omega: mean motor speed [rad/s]; free: True if the motors may turn. Only a free motor can have a following error.
    """
    m1, m2, k = s.motor_1, s.motor_2, c.faults
    s.late = faults.late(s.late, c.N * s.rate - omega, k.error) if free else 0
    s.present |= faults.measured_faults(
        max(_squared_current(m1, c.motor_1), _squared_current(m2, c.motor_2)),
        max(abs(m1.measured), abs(m2.measured)),
        c.rad * load_counts(s, c) - c.encoder.zero - c.per_2N * (c.motor_1.rad * m1.count + c.motor_2.rad * m2.count),
        s.late, max(m1.heat, m2.heat), s.faults, k)
    s.present |= faults.lost_motor_faults(s.motor_lost) | faults.end_switch_faults(s.theta, c.per_N * omega, k)
    s.faults |= s.present


@inlined
def _remove_torque(s, omega, free):
    """Remove the torque of both motors.

    free: True while no brake holds the motors; the integrals are then cleared. Behind closed brakes the integrals
    stay, because the motors need them when the brakes open. omega: mean motor speed [rad/s].
    """
    s.motor_1.torque_ref = s.motor_2.torque_ref = s.motor_1.i_ref = s.motor_2.i_ref = 0.0
    s.motor_1.inhibited = s.motor_2.inhibited = s.stopping = s.ramping = 1
    s.rate, s.bias, s.omega_hat = 0.0, 0.0, omega
    if free:
        s.motor_1.sum = s.motor_2.sum = s.d_hat = 0.0


@inlined
def speed_control(s, c, rate, torque, enable, powered, free):
    """Run one speed-loop period: compute the current references of both motors from a command.

    rate, torque   commanded rate [rad/s] and feed-forward torque [Nm] of the load
    enable         1 to follow the command, 0 to stop and hold
    powered        True if the motors may make torque
    free           True if no brake holds the motors
    """
    m1, m2 = s.motor_1, s.motor_2
    read_motor_sensors(m1, c.motor_1)
    read_motor_sensors(m2, c.motor_2)
    control_measured(s, c, 0.5 * (realised_torque(m1, c.motor_1) + realised_torque(m2, c.motor_2)), rate, torque,
                     enable, powered, free)


@inlined
def control_measured(s, c, made, rate, torque, enable, powered, free):
    """Run one speed-loop period with the speeds, counts and thermal loads of the motors that the state contains.

    made: mean torque that the motors have made since the last period [Nm]; other arguments: as of `speed_control`.
    """
    m1, m2, k1, k2 = s.motor_1, s.motor_2, c.motor_1, c.motor_2
    omega = mean_motor_speed(s, m1.measured, m2.measured)
    _supervise(s, c, omega, powered and free)
    if not powered or faults.removes_torque(s.faults):
        _remove_torque(s, omega, free)
        return
    m1.inhibited, m2.inhibited = s.faults & faults.Bit.MOTOR_1_LOST, s.faults & faults.Bit.MOTOR_2_LOST
    s.omega_hat, s.d_hat = disturbance_observer.update(
        s.omega_hat, s.d_hat, omega, made, c.l_1, c.l_2, c.h_J_shaft)

    feed_forward = 0.0
    if enable:
        wanted = min(max(rate, -c.rate_max), c.rate_max)
        if s.ramping:       # The command may have changed during the stop: approach it by a ramp.
            ramped = s.rate + min(max(wanted - s.rate, -c.ramp), c.ramp)
            s.ramping = ramped != wanted
            wanted = ramped
        else:
            feed_forward = torque * c.per_2N
    else:
        wanted = s.rate - min(max(s.rate, -c.ramp), c.ramp)
        s.stopping = s.ramping = 1
    position = c.rad * load_counts(s, c)
    s.rate = min(max(wanted, -travel.approach_rate(position - c.lower, c.K, c.a)),
                 travel.approach_rate(c.upper - position, c.K, c.a))
    if s.rate != wanted:
        feed_forward = 0.0
        s.end_stop = 1

    limited = _torque_control(s, c, omega, feed_forward - s.d_hat)
    m1.i_ref = m1.torque_ref * k1.per_K_t_hat
    m2.i_ref = m2.torque_ref * k2.per_K_t_hat

    s.torque_limited |= limited
    s.voltage_limited |= m1.limited | m2.limited
    m1.limited = 0
    m2.limited = 0


@compiled
def begin_period(s, c, grip):
    """Begin a control period: brakes, winding temperatures, constant inertia, and cleared flags.

    grip: True if the brakes grip by their command; a stuck brake ignores it.
    """
    m1, m2, k1, k2 = s.motor_1, s.motor_2, c.motor_1, c.motor_2
    if not c.varying:
        s.h_J, s.q_B, s.h_J_dish = c.h_J, c.q_B, c.h_J_dish
    s.braked = 1 if grip else 0
    if s.brake_stuck != BRAKE_WORKING:
        s.braked = 1 if s.brake_stuck == BRAKE_STUCK_ON else 0
    m1.q_R = thermal.damping(k1.h_R_L, k1.rise, m1.heat)
    m2.q_R = thermal.damping(k2.h_R_L, k2.rise, m2.heat)
    s.torque_limited = s.voltage_limited = s.end_stop = s.stopping = s.present = 0


@inlined
def current_control(m, k):
    """Run one current-loop period of one motor: compute the phase voltages from the current reference.

    The inverter of an inhibited motor is off. Its current is then 0, even if the current sensor has an offset, and its
    open terminals show the back-EMF. The model omits the diodes, which empty the inductance within a millisecond.
    """
    v_d, v_q, sum_d, sum_q, limited = current_loop.voltages(
        k.gain * m.i_d, k.gain * m.i_q + k.offset, m.i_ref, k.p * m.measured, m.sum_d, m.sum_q, k.K_p, k.K_iT, k.L,
        k.psi_hat, k.v_max)
    i_d, i_q = m.i_d, m.i_q
    if m.inhibited:
        i_d = i_q = v_d = sum_d = sum_q = 0.0
        v_q, limited = k.p * m.omega * k.psi, False
    m.i_d, m.i_q, m.v_d, m.v_q, m.sum_d, m.sum_q = i_d, i_q, v_d, v_q, sum_d, sum_q
    m.limited |= limited


@compiled
def change_inertia(s, c, J):
    """Set the inertia J [kg m2] of a varying load, base and dish.

    The share of the base in the inertia and the spring of the dish stay constant.
    """
    J_base = c.base_share * J
    s.h_J, s.q_B = c.h / J_base, 1.0 / (1.0 + c.h * c.B / J_base)
    if c.flexible:
        s.h_J_dish = c.h / (J - J_base)


@inlined
def plant_step(s, c, external):
    """Advance the plant by a sub-step h under an external load torque [Nm], which includes s.deck.

    Semi-implicit Euler: the new currents give the speeds, and the new speeds give the angles. The step is implicit in
    the phase resistance R, the viscous friction and the bristle deflection.
    """
    m1, m2, k1, k2 = s.motor_1, s.motor_2, c.motor_1, c.motor_2
    m1.i_d, m1.i_q = motor.currents(m1.i_d, m1.i_q, m1.v_d, m1.v_q, k1.p * m1.omega, k1.L, k1.psi, k1.h_L, m1.q_R)
    m2.i_d, m2.i_q = motor.currents(m2.i_d, m2.i_q, m2.v_d, m2.v_q, k2.p * m2.omega, k2.L, k2.psi, k2.h_L, m2.q_R)

    delta_1, delta_2 = m1.theta * c.per_N - s.theta, m2.theta * c.per_N - s.theta
    if c.uneven:
        delta_1 += gear_train.transmission_error(m1.theta * c.per_reducer, c)
        delta_2 += gear_train.transmission_error(m2.theta * c.per_reducer + SECOND_PINION_OFFSET_RAD, c)
    half_1 = half_2 = c.half_lash
    if s.toothless:
        half_1 += gear_train.gap(m1.theta * c.per_reducer, s.teeth[0], c.pinion_ratio)
        half_2 += gear_train.gap(m2.theta * c.per_reducer, s.teeth[1], c.pinion_ratio)
    mesh_1 = gear_train.mesh_torque(delta_1, m1.omega * c.per_N - s.omega, c.k, c.c, half_1)
    mesh_2 = gear_train.mesh_torque(delta_2, m2.omega * c.per_N - s.omega, c.k, c.c, half_2)
    bearing, s.z = friction.lugre(s.z, s.omega, c.T_c, c.T_sc, c.per_v2, c.sigma_0, c.h_sigma_0, c.sigma_1_h, c.h)
    stop = travel.buffer_torque(s.theta, s.omega, c.stop_lower, c.stop_upper, c.k_stop, c.c_stop)

    if c.flexible:
        on_base = c.base_share * s.deck
        s.dish, s.omega_dish, twist = structure.swing(
            s.dish, s.omega_dish, s.theta, s.omega, external - on_base, c.k_dish, c.c_dish, c.h, s.h_J_dish)
        external = on_base + twist

    T_1, T_2 = k1.K_t * m1.i_q - mesh_1 * c.per_N, k2.K_t * m2.i_q - mesh_2 * c.per_N
    if c.uneven:
        T_1 += motor.cogging(m1.theta, k1.T_cog, k1.cogs)
        T_2 += motor.cogging(m2.theta, k2.T_cog, k2.cogs)
    m1.omega = motor.speed(m1.omega, T_1, k1.T_c, k1.per_v, k1.h_J, k1.q_B)
    m2.omega = motor.speed(m2.omega, T_2, k2.T_c, k2.per_v, k2.h_J, k2.q_B)
    if s.braked:
        m1.omega, m2.omega = brake.braked(m1.omega, k1.h_brake_J), brake.braked(m2.omega, k2.h_brake_J)
    s.omega = (s.omega + s.h_J * (mesh_1 + mesh_2 + external + stop - bearing)) * s.q_B

    m1.theta += c.h * m1.omega
    m2.theta += c.h * m2.omega
    s.theta += c.h * s.omega


@compiled
def read(s, c, y):
    """Write the present outputs y of the axis: values of its sensors and controllers, and the true load."""
    m1, m2, k1, k2 = s.motor_1, s.motor_2, c.motor_1, c.motor_2
    s.reading = load_counts(s, c)
    y.position = c.rad * s.reading
    y.motor_position[0] = k1.rad * encoder.counts(m1.theta, k1.per_rad)
    y.motor_position[1] = k2.rad * encoder.counts(m2.theta, k2.per_rad)
    y.motor_velocity[0] = _measured_speed(m1, k1)
    y.motor_velocity[1] = _measured_speed(m2, k2)
    y.velocity = c.per_N * mean_motor_speed(s, y.motor_velocity[0], y.motor_velocity[1])
    y.motor_torque[0] = _measured_torque(m1, k1)
    y.motor_torque[1] = _measured_torque(m2, k2)
    y.torque = c.N * (y.motor_torque[0] + y.motor_torque[1])
    y.bias = s.bias
    y.torque_limited = s.torque_limited
    y.voltage_limited = s.voltage_limited
    y.end_stop = s.end_stop
    y.stopping = s.stopping
    y.faults = s.faults
    y.thermal_load[0], y.thermal_load[1] = m1.heat, m2.heat
    y.load_position = s.dish if c.flexible else s.theta
    y.load_velocity = s.omega_dish if c.flexible else s.omega
    y.true_torque[0] = k1.K_t * m1.i_q
    y.true_torque[1] = k2.K_t * m2.i_q
