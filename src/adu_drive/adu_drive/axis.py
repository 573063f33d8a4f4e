"""One axis: encoders, current loops, two motors, gear train and load, around the speed loop of drive_law.axis_control.

drive_unit.step calls `speed_control`, `current_control` and `plant_step` at their own periods.
"""
import math
from typing import cast

from adu_drive.plant import mechanics, motors
from drive_law import axis_control, faults, loops
from drive_law.axis_params import SPEED_LOOP_PERIOD_S, AxisParameters, MotorParameters
from pedestal_common.compiled import compiled, inlined
from pedestal_common.law import Law
from pedestal_common.quantities import (
    Amperes,
    Bit,
    KilogramMeters2,
    NewtonMeters,
    Pair,
    Radians,
    RadiansPerSecond,
    Records,
    Seconds,
    Volts,
)
from pedestal_common.record import Record

CURRENT_LOOP_STEP_COUNT = 5  # number of current-loop periods in a speed-loop period

BRAKE_CONDITIONS = BRAKE_WORKING, BRAKE_STUCK_ON, BRAKE_STUCK_OFF = range(3)
"""Conditions of a brake: it follows its command, or ignores it."""

CURRENT_LOOP_PERIOD_S = SPEED_LOOP_PERIOD_S / CURRENT_LOOP_STEP_COUNT  # period of the current loops [s]

SECOND_PINION_OFFSET_RAD = 0.5 * math.pi
"""Angle by which the second pinion is mounted ahead of the first [rad], so that the runouts of both do not add."""


class EncoderErrors(Record):
    """Errors of a load encoder."""
    exact: Bit              # 1 for an encoder without errors
    zero: Radians
    sin: Radians            # factors of sine and cosine in the error of a disc off the centre
    cos: Radians
    interpolation: Radians  # amplitude
    lines: float            # number of lines of the disc
    age: Seconds            # of the angle


class MotorConstants(axis_control.MotorConstants, motors.Constants):
    """A motor with its current loop; psi, K_t and R are true values, psi_hat and K_t_hat values in the controller.

    The fields of the last base come first. Numba takes a record that begins with the fields of another record for its
    subtype, and warns about it.
    """
    psi_hat: float
    K_p: float              # of the current loop
    K_iT: float
    v_max: Volts
    speed: RadiansPerSecond     # of one count in a speed-loop period


class Constants(axis_control.Constants):
    """Constants of an axis with its plant. The names follow the rules of axis_control.Constants, and these:

    h_X, h_R_L       h / X, h R / L; h_sigma_0 = h sigma_0; sigma_1_h = sigma_1 / h; h: sub-step of the plant
    q_B              factor of an implicit step with viscous friction: 1 / (1 + h B / J)
    """
    motor_1: MotorConstants
    motor_2: MotorConstants
    k: float                # [Nm/rad]
    c: float                # [Nms/rad]
    half_lash: Radians
    pinion_ratio: float
    uneven: Bit             # 1 if runout, tooth error or cogging vary with the angles of pinions and motors
    runout: Radians
    tooth_error: Radians
    teeth: float
    per_reducer: float
    flexible: Bit           # 1 if a dish swings on the base
    k_dish: float           # [Nm/rad]
    c_dish: float           # [Nms/rad]
    h_J_dish: float
    base_share: float       # share of the base in the inertia of the load
    varying: Bit            # 1 if the inertia of the load varies
    h: Seconds
    J: KilogramMeters2
    B: float                # viscous friction [Nms/rad]
    h_J: float              # of the base
    q_B: float
    unbalance: NewtonMeters
    T_c: NewtonMeters
    T_sc: NewtonMeters
    per_v2: float
    sigma_0: float
    h_sigma_0: float
    sigma_1_h: float
    encoder: EncoderErrors
    stop_lower: Radians         # places of the mechanical end stops
    stop_upper: Radians
    k_stop: float               # [Nm/rad]
    c_stop: float               # [Nms/rad]


class MotorState(axis_control.MotorState, motors.State):
    """A motor with its current loop."""
    i_ref: Amperes
    sum_d: Volts                # integral parts of the current loop
    sum_q: Volts


class State(axis_control.State):
    """An axis with its plant."""
    motor_1: MotorState
    motor_2: MotorState
    omega: RadiansPerSecond
    z: Radians                  # LuGre bristle deflection
    h_J: float                  # of the base, constant over a control period, as q_B and h_J_dish
    q_B: float
    h_J_dish: float
    dish: Radians
    omega_dish: RadiansPerSecond
    external: NewtonMeters      # torque on the load, constant over a control period; it includes `deck`
    # Part of `external` from the motion of the deck and of the other axis. Base and dish get it in proportion to their
    # inertia.
    deck: NewtonMeters
    braked: Bit
    # injected faults, as motor_lost:
    jump: float                 # error of the load encoder [counts]
    stuck: Bit                  # 1 if the reading of the load encoder is stuck
    brake_stuck: int            # one of BRAKE_CONDITIONS
    toothless: Bit              # 1 if a pinion has lost a tooth
    teeth: Pair                 # number of teeth of the pinion that has lost one, else 0
    gust: NewtonMeters          # torque on the load in addition to the wind


class Truth(Record):
    """True motion of an axis, unknown to the controllers."""
    load_position: Radians      # of the beam, or of the dish if the structure is flexible; load_velocity too
    load_velocity: RadiansPerSecond
    true_torque: Pair           # K_t i_q of motors 1 and 2 [Nm], for tests; never published


class Outputs(axis_control.Outputs, Truth):
    """Outputs of an axis at t_k+1, with its true motion."""


def _motor_constants(m: MotorParameters, p: AxisParameters, h: Seconds, period: Seconds) -> Records:
    w = 2.0 * math.pi * p.current_loop.bandwidth
    R, psi = m.resistance * (1.0 + m.drift.resistance), m.flux_linkage * (1.0 + m.drift.flux_linkage)
    control = axis_control.motor_constants(m, p.thermal, p.encoder.motor_bits, period)
    return MotorConstants.of(**control, p=m.pole_pairs, psi=psi, L=m.inductance, K_t=1.5 * m.pole_pairs * psi,
                             h_L=h / m.inductance, h_R_L=h * R / m.inductance,
                             rise=motors.COPPER_COEFFICIENT_PER_K * p.thermal.rise, h_brake_J=h * m.brake / m.inertia,
                             T_c=m.friction, per_v=1.0 / m.friction_speed, h_J=h / m.inertia,
                             q_B=1.0 / (1.0 + h * m.viscous / m.inertia), T_cog=m.cogging, cogs=m.cogging_per_turn,
                             psi_hat=m.flux_linkage, K_p=w * m.inductance,
                             K_iT=w * m.resistance * CURRENT_LOOP_PERIOD_S, v_max=m.voltage,
                             speed=control['rad'] / period)


def _dish(p: AxisParameters) -> tuple[KilogramMeters2, float, float]:
    """Return inertia, stiffness [Nm/rad] and damping [Nms/rad] of the dish."""
    J_dish = p.structure.inertia_share * p.load.inertia
    return J_dish, *mechanics.spring_and_damper(J_dish, p.structure.frequency, p.structure.damping)


def constants(p: AxisParameters, h: Seconds, varying: bool = False,
              period: Seconds = SPEED_LOOP_PERIOD_S) -> Records:
    """Return the Constants (1,) of an axis for a plant sub-step h. period: that of the speed loop. varying: True if
    the inertia of the load varies; `change_inertia` then sets it before each control period."""
    g, error = p.gear_train, p.encoder.error
    J_dish, k_dish, c_dish = _dish(p)
    J_base = p.load.inertia - J_dish
    _, _, buffer = p.limits.switches
    encoder = EncoderErrors.of(
        exact=not any((error.zero, error.eccentricity_sin, error.eccentricity_cos, error.interpolation, error.age)),
        zero=error.zero, sin=error.eccentricity_sin, cos=error.eccentricity_cos, interpolation=error.interpolation,
        lines=error.lines, age=error.age)
    return Constants.of(**axis_control.constants(p, period), motor_1=_motor_constants(p.motor_1, p, h, period),
                        motor_2=_motor_constants(p.motor_2, p, h, period), k=g.stiffness, c=g.damping,
                        half_lash=0.5 * g.lash, pinion_ratio=g.pinion_ratio,
                        uneven=g.runout + g.tooth_error + p.motor_1.cogging + p.motor_2.cogging > 0.0, runout=g.runout,
                        tooth_error=g.tooth_error, teeth=g.pinion_teeth, per_reducer=1.0 / g.reducer_ratio,
                        flexible=J_dish > 0.0, k_dish=k_dish, c_dish=c_dish, h_J_dish=h / J_dish if J_dish else 0.0,
                        base_share=1.0 - p.structure.inertia_share, varying=varying, h=h, J=p.load.inertia,
                        B=p.load.viscous, h_J=h / J_base, q_B=1.0 / (1.0 + h * p.load.viscous / J_base),
                        unbalance=p.load.unbalance, T_c=p.friction.coulomb,
                        T_sc=p.friction.breakaway - p.friction.coulomb, per_v2=p.friction.stribeck_rate ** -2,
                        sigma_0=p.friction.stiffness, h_sigma_0=h * p.friction.stiffness,
                        sigma_1_h=p.friction.damping / h, encoder=encoder, stop_lower=p.limits.lower - buffer,
                        stop_upper=p.limits.upper + buffer, k_stop=p.limits.buffer_stiffness,
                        c_stop=p.limits.buffer_damping)


def _motor_at_rest(m: MotorParameters, p: AxisParameters, T: NewtonMeters, total: NewtonMeters,
                   theta: Radians) -> Records:
    """Return the MotorState (1,) of a motor that makes T at standstill with its pinion on the flank, load at theta.
    total: part of T from the integral of the speed loop."""
    g, per_rad = p.gear_train, axis_control.counts_per_rad(p.encoder.motor_bits)
    i_ref = T / m.torque_constant
    i_q = (i_ref - m.drift.current_offset) / (1.0 + m.drift.current_gain)
    v_q = m.resistance * (1.0 + m.drift.resistance) * i_q
    made = m.torque_constant * (1.0 + m.drift.flux_linkage) * i_q
    flank = math.copysign(0.5 * g.lash, made) if made != 0.0 else 0.0
    angle = g.ratio * (theta + flank + made * g.ratio / g.stiffness)
    return MotorState.of(i_q=i_q, i_ref=i_ref, v_q=v_q, sum_q=v_q, theta=angle,
                         count=cast(Law, axis_control.counts).py_func(angle, per_rad), sum=total, torque_ref=T,
                         q_R=1.0)


def initial_state(p: AxisParameters, theta: Radians, external: NewtonMeters) -> Records:
    """Return the State (1,) of an axis at rest at theta, in balance with an external torque."""
    _, k_dish, _ = _dish(p)
    T = -0.5 * external / p.gear_train.ratio
    observed = p.speed_loop.disturbance_observer > 0.0
    total = 0.0 if observed else T
    T_b = cast(Law, loops.scheduled_bias).py_func(T, *loops.bias_constants(p.bias))
    return State.of(motor_1=_motor_at_rest(p.motor_1, p, T + T_b, total, theta),
                    motor_2=_motor_at_rest(p.motor_2, p, T - T_b, total, theta), theta=theta,
                    dish=theta + external / k_dish if k_dish else theta, external=external, bias=T_b,
                    d_hat=-T if observed else 0.0, brake_stuck=BRAKE_WORKING)


@inlined
def _encoder_angle(theta: Radians, omega: RadiansPerSecond, errors: EncoderErrors) -> Radians:
    """Return the angle that a load encoder measures: its disc is mounted off the centre (error once per turn), and its
    signal is interpolated between two lines of the disc. Its angle is old by `age`; omega: rate of the axis."""
    if errors.exact:
        return theta
    theta -= errors.age * omega
    return (theta + errors.zero + errors.sin * math.sin(theta) + errors.cos * math.cos(theta)
            + errors.interpolation * math.sin(errors.lines * theta))


@inlined
def _load_counts(axis: State, constants: Constants) -> float:
    if axis.stuck:
        return axis.reading
    angle = _encoder_angle(axis.theta, axis.omega, constants.encoder)
    return axis_control.counts(angle, constants.per_rad) + axis.jump


@inlined
def _measured_speed(motor: MotorState, constants: MotorConstants) -> RadiansPerSecond:
    """Return the motor speed: encoder difference over a speed-loop period (0.25 ms old on average)."""
    return (axis_control.counts(motor.theta, constants.per_rad) - motor.count) * constants.speed


@inlined
def read_motor_sensors(motor: MotorState, constants: MotorConstants) -> None:
    """Measure speed, count and thermal load of a motor, in a period of the speed loop."""
    motor.measured = _measured_speed(motor, constants)
    motor.heat = faults.thermal_load(motor.heat, constants.K_t * motor.i_q, constants.per_rated, constants.heat_gain)
    motor.count = int(axis_control.counts(motor.theta, constants.per_rad))


@inlined
def speed_control(axis: State, constants: Constants, rate: RadiansPerSecond, torque: NewtonMeters, enable: Bit,
                  powered: bool, free: bool) -> None:
    """Run one speed-loop period: compute the current references of both motors from a command. The arguments are those
    of axis_control.control."""
    m1, m2, k1, k2 = axis.motor_1, axis.motor_2, constants.motor_1, constants.motor_2
    read_motor_sensors(m1, k1)
    read_motor_sensors(m2, k2)
    made = 0.5 * (axis_control.realised_torque(m1, k1) + axis_control.realised_torque(m2, k2))
    axis_control.control(axis, constants, _load_counts(axis, constants), made, rate, torque, enable, powered, free)
    m1.i_ref = m1.torque_ref * k1.per_K_t_hat
    m2.i_ref = m2.torque_ref * k2.per_K_t_hat


@compiled
def begin_period(axis: State, constants: Constants, grip: bool) -> None:
    """Begin a control period: brakes, winding temperatures, constant inertia, and cleared flags. grip: True if the
    brakes grip by their command; a stuck brake ignores it."""
    c, m1, m2, k1, k2 = constants, axis.motor_1, axis.motor_2, constants.motor_1, constants.motor_2
    if not c.varying:
        axis.h_J, axis.q_B, axis.h_J_dish = c.h_J, c.q_B, c.h_J_dish
    axis.braked = 1 if grip else 0
    if axis.brake_stuck != BRAKE_WORKING:
        axis.braked = 1 if axis.brake_stuck == BRAKE_STUCK_ON else 0
    m1.q_R = motors.resistive_damping(k1.h_R_L, k1.rise, m1.heat)
    m2.q_R = motors.resistive_damping(k2.h_R_L, k2.rise, m2.heat)
    axis_control.begin_period(axis)


@inlined
def voltages(i_d: Amperes, i_q: Amperes, i_ref: Amperes, omega_e: RadiansPerSecond, sum_d: Volts, sum_q: Volts,
             K_p: float, K_iT: float, L: float, psi: float, v_max: Volts) -> tuple[Volts, Volts, Volts, Volts, bool]:
    """Return the voltages v_d, v_q, the two new integral parts, and True if the voltages were limited.

    The current loop of one motor in rotor coordinates: i_d = 0, decoupled, inside the voltage circle v_d^2 + v_q^2 <=
    v_max^2. K_p = w L and K_i = w R cancel the pole of the winding: the closed loop of each axis is w / (s + w). The
    terms with omega_e, the electrical speed, decouple the axes.
    """
    e_d, e_q = -i_d, i_ref - i_q
    u_d = K_p * e_d + sum_d - omega_e * L * i_q
    u_q = K_p * e_q + sum_q + omega_e * (L * i_d + psi)
    v_d, v_q = u_d, u_q
    limited = u_d * u_d + u_q * u_q > v_max * v_max
    if limited:
        # v_d has priority, because v_d keeps i_d at 0. With i_d = 0 the current gives the largest torque.
        v_d = min(max(u_d, -v_max), v_max)
        room = math.sqrt(v_max * v_max - v_d * v_d)
        v_q = min(max(u_q, -room), room)
    sum_d, sum_q = loops.integral(sum_d, e_d, K_iT, u_d - v_d), loops.integral(sum_q, e_q, K_iT, u_q - v_q)
    return v_d, v_q, sum_d, sum_q, limited


@inlined
def current_control(motor: MotorState, constants: MotorConstants) -> None:
    """Run one current-loop period of one motor: compute the phase voltages from the current reference.

    The inverter of an inhibited motor is off. Its current is then 0, even if the current sensor has an offset, and its
    open terminals show the back-EMF. The model omits the diodes, which empty the inductance within a millisecond.
    """
    k = constants
    v_d, v_q, sum_d, sum_q, limited = voltages(
        k.gain * motor.i_d, k.gain * motor.i_q + k.offset, motor.i_ref, k.p * motor.measured, motor.sum_d, motor.sum_q,
        k.K_p, k.K_iT, k.L, k.psi_hat, k.v_max)
    i_d, i_q = motor.i_d, motor.i_q
    if motor.inhibited:
        i_d = i_q = v_d = sum_d = sum_q = 0.0
        v_q, limited = k.p * motor.omega * k.psi, False
    motor.i_d, motor.i_q, motor.v_d, motor.v_q = i_d, i_q, v_d, v_q
    motor.sum_d, motor.sum_q = sum_d, sum_q
    motor.limited |= limited


@compiled
def change_inertia(axis: State, constants: Constants, J: KilogramMeters2) -> None:
    """Set the inertia J of a varying load. The share of the base in it and the spring of the dish stay constant."""
    J_base = constants.base_share * J
    axis.h_J, axis.q_B = constants.h / J_base, 1.0 / (1.0 + constants.h * constants.B / J_base)
    if constants.flexible:
        axis.h_J_dish = constants.h / (J - J_base)


@inlined
def plant_step(axis: State, constants: Constants, external: NewtonMeters) -> None:
    """Advance the plant by a sub-step h under an external load torque, which includes axis.deck.

    Semi-implicit Euler: the new currents give the speeds, and the new speeds give the angles. The step is implicit in
    the phase resistance R, the viscous friction and the bristle deflection.
    """
    c, m1, m2, k1, k2 = constants, axis.motor_1, axis.motor_2, constants.motor_1, constants.motor_2
    m1.i_d, m1.i_q = motors.currents(m1.i_d, m1.i_q, m1.v_d, m1.v_q, k1.p * m1.omega, k1.L, k1.psi, k1.h_L, m1.q_R)
    m2.i_d, m2.i_q = motors.currents(m2.i_d, m2.i_q, m2.v_d, m2.v_q, k2.p * m2.omega, k2.L, k2.psi, k2.h_L, m2.q_R)

    delta_1, delta_2 = m1.theta * c.per_N - axis.theta, m2.theta * c.per_N - axis.theta
    if c.uneven:
        delta_1 += mechanics.transmission_error(m1.theta * c.per_reducer, c)
        delta_2 += mechanics.transmission_error(m2.theta * c.per_reducer + SECOND_PINION_OFFSET_RAD, c)
    half_1 = half_2 = c.half_lash
    if axis.toothless:
        half_1 += mechanics.tooth_gap(m1.theta * c.per_reducer, axis.teeth[0], c.pinion_ratio)
        half_2 += mechanics.tooth_gap(m2.theta * c.per_reducer, axis.teeth[1], c.pinion_ratio)
    mesh_1 = mechanics.mesh_torque(delta_1, m1.omega * c.per_N - axis.omega, c.k, c.c, half_1)
    mesh_2 = mechanics.mesh_torque(delta_2, m2.omega * c.per_N - axis.omega, c.k, c.c, half_2)
    bearing, axis.z = mechanics.lugre(
        axis.z, axis.omega, c.T_c, c.T_sc, c.per_v2, c.sigma_0, c.h_sigma_0, c.sigma_1_h, c.h)
    stop = mechanics.buffer_torque(axis.theta, axis.omega, c.stop_lower, c.stop_upper, c.k_stop, c.c_stop)

    if c.flexible:
        on_base = c.base_share * axis.deck
        axis.dish, axis.omega_dish, twist = mechanics.swing(
            axis.dish, axis.omega_dish, axis.theta, axis.omega, external - on_base, c.k_dish, c.c_dish, c.h,
            axis.h_J_dish)
        external = on_base + twist

    T_1, T_2 = k1.K_t * m1.i_q - mesh_1 * c.per_N, k2.K_t * m2.i_q - mesh_2 * c.per_N
    if c.uneven:
        T_1 += motors.cogging(m1.theta, k1.T_cog, k1.cogs)
        T_2 += motors.cogging(m2.theta, k2.T_cog, k2.cogs)
    m1.omega = motors.speed(m1.omega, T_1, k1.T_c, k1.per_v, k1.h_J, k1.q_B)
    m2.omega = motors.speed(m2.omega, T_2, k2.T_c, k2.per_v, k2.h_J, k2.q_B)
    if axis.braked:
        m1.omega, m2.omega = motors.braked(m1.omega, k1.h_brake_J), motors.braked(m2.omega, k2.h_brake_J)
    axis.omega = (axis.omega + axis.h_J * (mesh_1 + mesh_2 + external + stop - bearing)) * axis.q_B

    m1.theta += c.h * m1.omega
    m2.theta += c.h * m2.omega
    axis.theta += c.h * axis.omega


@compiled
def read(axis: State, constants: Constants, outputs: Outputs) -> None:
    """Write the present outputs of the axis."""
    m1, m2, k1, k2 = axis.motor_1, axis.motor_2, constants.motor_1, constants.motor_2
    axis_control.read(axis, constants, _load_counts(axis, constants), _measured_speed(m1, k1), _measured_speed(m2, k2),
                      outputs)
    outputs.load_position = axis.dish if constants.flexible else axis.theta
    outputs.load_velocity = axis.omega_dish if constants.flexible else axis.omega
    outputs.true_torque[0] = k1.K_t * m1.i_q
    outputs.true_torque[1] = k2.K_t * m2.i_q
