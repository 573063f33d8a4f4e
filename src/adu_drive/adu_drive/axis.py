"""One axis: encoders, speed loop, two current loops, two motors, gear train and load.

drive_unit.step calls `speed_control`, `current_control` and `plant_step` at their own periods. The package defines the
symbols.
"""
import math
from typing import Annotated, cast

from adu_drive.controller import encoder, faults, loops
from adu_drive.params import (
    SPEED_LOOP_PERIOD_S,
    AxisParameters,
    CurrentLoopParameters,
    GearTrainParameters,
    MotorParameters,
    ThermalParameters,
)
from adu_drive.plant import mechanics, motors
from pedestal_common.compiled import compiled, inlined
from pedestal_common.law import Law
from pedestal_common.quantities import (
    Amperes,
    Bit,
    Ints,
    KilogramMeters2,
    NewtonMeters,
    Pair,
    Radians,
    RadiansPerSecond,
    RadiansPerSecond2,
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


class MotorConstants(Record):
    """A motor with its current loop; psi, K_t and R are true values, psi_hat and K_t_hat values in the controller."""
    p: float                # pole pairs
    psi: float              # [Wb]
    L: float                # [H]
    K_t: float              # [Nm/A]
    h_L: float
    h_R_L: float            # at 20 degrees C
    rise: float             # alpha dT: relative rise of the resistance at thermal load 1
    per_rated: float        # 1 / T_rated
    heat_gain: float
    h_brake_J: RadiansPerSecond     # h T / J of the brake
    T_c: NewtonMeters
    per_v: float
    h_J: float
    q_B: float
    T_cog: NewtonMeters     # amplitude of the cogging
    cogs: float             # its periods in a turn
    psi_hat: float
    K_t_hat: float
    per_K_t_hat: float
    gain: float             # of the current sensor
    offset: Amperes
    K_p: float              # of the current loop
    K_iT: float
    v_max: Volts
    limit: NewtonMeters     # largest torque reference
    per_rad: float          # of the motor encoder
    rad: Radians
    speed: RadiansPerSecond     # of one count in a speed-loop period


class Constants(Record):
    """An axis. The docstrings of the laws define their constants. The names follow these rules:

    per_X            1 / X; per_2N = 1 / (2 N)
    h_X, h_R_L       h / X, h R / L; h_sigma_0 = h sigma_0; sigma_1_h = sigma_1 / h; h in h_J_shaft: speed-loop period
    q_B              factor of an implicit step with viscous friction: 1 / (1 + h B / J)
    K_iT             integral gain times the period of its loop
    X_gain           share of the way to its input that a first-order lag moves in a period: 1 - exp(-period / lag)
    rad, per_rad     angle of an encoder count [rad], counts per rad
    X_hat            value in the controller; the true value has no suffix
    """
    motor_1: MotorConstants
    motor_2: MotorConstants
    N: float
    per_N: float
    per_2N: float
    per_rad: float          # of the load encoder
    rad: Radians
    K_p: float              # of the speed loop
    K_iT: float
    K_d: float
    independent: Bit        # 1: a speed loop for each motor
    l_1: float
    l_2: float
    h_J_shaft: float
    T_b: NewtonMeters
    out: NewtonMeters       # see loops.bias_constants
    per_fade: float
    bias_gain: float
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
    encoder: encoder.Errors
    rate_max: RadiansPerSecond
    a: RadiansPerSecond2
    ramp: RadiansPerSecond      # change of the rate in a speed-loop period at the deceleration a
    lower: Radians              # ends of travel
    upper: Radians
    K: float                    # see loops.approach_rate
    stop_lower: Radians         # places of the mechanical end stops
    stop_upper: Radians
    k_stop: float               # [Nm/rad]
    c_stop: float               # [Nms/rad]
    faults: faults.Limits


class MotorState(Record):
    """A motor with its current loop."""
    i_d: Amperes
    i_q: Amperes
    i_ref: Amperes
    v_d: Volts
    v_q: Volts
    sum_d: Volts                # integral parts of the current loop
    sum_q: Volts
    omega: RadiansPerSecond
    theta: Radians
    count: int                  # of the encoder, at the last speed-loop period
    measured: RadiansPerSecond
    sum: NewtonMeters           # integral part of the speed loop
    torque_ref: NewtonMeters
    limited: Bit                # 1 if the voltages were limited since the last speed-loop period
    inhibited: Bit              # 1 while the inverter is off
    heat: float                 # thermal load
    q_R: float                  # 1 / (1 + h R / L) of the warm winding


class State(Record):
    """An axis."""
    motor_1: MotorState
    motor_2: MotorState
    theta: Radians
    omega: RadiansPerSecond
    z: Radians
    h_J: float                  # of the base, constant over a control period, as q_B and h_J_dish
    q_B: float
    h_J_dish: float
    dish: Radians
    omega_dish: RadiansPerSecond
    external: NewtonMeters      # torque on the load, constant over a control period; it includes `deck`
    # Part of `external` from the motion of the deck and of the other axis. Base and dish get it in proportion to their
    # inertia.
    deck: NewtonMeters
    commanded_rate: RadiansPerSecond    # command that is executed in a speed-loop period
    commanded_torque: NewtonMeters
    bias: NewtonMeters
    rate: RadiansPerSecond      # reference of the speed loop: the commanded rate within ramp and travel
    omega_hat: RadiansPerSecond
    d_hat: NewtonMeters
    torque_limited: Bit         # 1 if it was so in this control period; voltage_limited and end_stop too
    voltage_limited: Bit
    end_stop: Bit
    stopping: Bit               # 1 if the axis was not enabled in the control period: it ramped to standstill, or held
    faults: int                 # latched fault word, see faults.AXIS_FAULTS
    present: int                # faults whose cause was present in this period
    late: int                   # successive speed-loop periods with a rate error above that of the following error
    ramping: Bit                # 1 from a stop on, until a ramp with `limits.deceleration` has led to the command
    braked: Bit
    reading: float              # counts of the load encoder at t_k
    # injected faults:
    motor_lost: Annotated[Ints, (2,)]   # 1 for a motor whose amplifier is off and reports it
    jump: float                 # error of the load encoder [counts]
    stuck: Bit                  # 1 if the reading of the load encoder is stuck
    brake_stuck: int            # one of BRAKE_CONDITIONS
    toothless: Bit              # 1 if a pinion has lost a tooth
    teeth: Pair                 # number of teeth of the pinion that has lost one, else 0
    gust: NewtonMeters          # torque on the load in addition to the wind


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
    # True angle and rate of the beam (of the dish, if the structure is flexible), unknown to the controllers.
    load_position: Radians
    load_velocity: RadiansPerSecond
    true_torque: Pair           # K_t i_q of motors 1 and 2 [Nm], for tests; never published


def _motor_constants(m: MotorParameters, loop: CurrentLoopParameters, heat: ThermalParameters, per_rad: float,
                     h: Seconds, period: Seconds) -> Records:
    """per_rad: counts of the motor encoder per rad; h: sub-step of the plant; period: of the speed loop."""
    w = 2.0 * math.pi * loop.bandwidth
    R, psi = m.resistance * (1.0 + m.drift.resistance), m.flux_linkage * (1.0 + m.drift.flux_linkage)
    return MotorConstants.of(p=m.pole_pairs, psi=psi, L=m.inductance, K_t=1.5 * m.pole_pairs * psi,
                             h_L=h / m.inductance, h_R_L=h * R / m.inductance,
                             rise=motors.COPPER_COEFFICIENT_PER_K * heat.rise, per_rated=1.0 / heat.rated_torque,
                             heat_gain=1.0 - math.exp(-period / heat.time_constant), h_brake_J=h * m.brake / m.inertia,
                             T_c=m.friction, per_v=1.0 / m.friction_speed, h_J=h / m.inertia,
                             q_B=1.0 / (1.0 + h * m.viscous / m.inertia), T_cog=m.cogging, cogs=m.cogging_per_turn,
                             psi_hat=m.flux_linkage, K_t_hat=m.torque_constant, per_K_t_hat=1.0 / m.torque_constant,
                             gain=1.0 + m.drift.current_gain, offset=m.drift.current_offset, K_p=w * m.inductance,
                             K_iT=w * m.resistance * CURRENT_LOOP_PERIOD_S, v_max=m.voltage, limit=m.torque_limit,
                             per_rad=per_rad, rad=1.0 / per_rad, speed=1.0 / per_rad / period)


def _dish(p: AxisParameters) -> tuple[KilogramMeters2, float, float]:
    """Return inertia, stiffness [Nm/rad] and damping [Nms/rad] of the dish, the flexible part of the load."""
    J_dish = p.structure.inertia_share * p.load.inertia
    return J_dish, *mechanics.spring_and_damper(J_dish, p.structure.frequency, p.structure.damping)


def constants(p: AxisParameters, h: Seconds, varying: bool = False,
              period: Seconds = SPEED_LOOP_PERIOD_S) -> Records:
    """Return the Constants (1,) of an axis for a plant sub-step h, computed once.

    varying: True if the inertia of the load varies; `change_inertia` then sets it before each control period. period:
    of the speed loop.
    """
    per_rad = 2.0 ** p.encoder.load_bits / (2.0 * math.pi)
    motor_per_rad = 2.0 ** p.encoder.motor_bits / (2.0 * math.pi)
    g, N = p.gear_train, p.gear_train.ratio
    J_shaft = 0.5 * (p.motor_1.inertia + p.motor_2.inertia + p.speed_loop.load_inertia / N ** 2)
    T_b, out, per_fade = loops.bias_constants(p.bias)
    J_dish, k_dish, c_dish = _dish(p)
    J_base = p.load.inertia - J_dish
    final, emergency, buffer = p.limits.switches
    l_1, l_2 = loops.observer_gains(p.speed_loop.disturbance_observer, period)
    trips = faults.Limits.of(
        current_2=p.faults.overcurrent ** 2, omega=N * p.faults.overspeed, disagreement=p.faults.encoder_disagreement,
        error=N * p.faults.following_error, late_periods=math.ceil(p.faults.following_time / period - 1e-6),
        heat=p.faults.overtemperature, final_low=p.limits.lower - final, final_high=p.limits.upper + final,
        emergency_low=p.limits.lower - emergency, emergency_high=p.limits.upper + emergency)
    return Constants.of(motor_1=_motor_constants(p.motor_1, p.current_loop, p.thermal, motor_per_rad, h, period),
                        motor_2=_motor_constants(p.motor_2, p.current_loop, p.thermal, motor_per_rad, h, period), N=N,
                        per_N=1.0 / N, per_2N=0.5 / N, per_rad=per_rad, rad=1.0 / per_rad,
                        K_p=p.speed_loop.proportional, K_iT=p.speed_loop.integral * period,
                        K_d=p.speed_loop.differential_damping, independent=p.speed_loop.structure == 'independent',
                        l_1=l_1, l_2=l_2, h_J_shaft=period / J_shaft, T_b=T_b, out=out, per_fade=per_fade,
                        bias_gain=1.0 - math.exp(-period / p.bias.lag) if p.bias.lag > 0.0 else 1.0, k=g.stiffness,
                        c=g.damping, half_lash=0.5 * g.lash, pinion_ratio=g.pinion_ratio,
                        uneven=g.runout + g.tooth_error + p.motor_1.cogging + p.motor_2.cogging > 0.0, runout=g.runout,
                        tooth_error=g.tooth_error, teeth=g.pinion_teeth, per_reducer=1.0 / g.reducer_ratio,
                        flexible=J_dish > 0.0, k_dish=k_dish, c_dish=c_dish, h_J_dish=h / J_dish if J_dish else 0.0,
                        base_share=1.0 - p.structure.inertia_share, varying=varying, h=h, J=p.load.inertia,
                        B=p.load.viscous, h_J=h / J_base, q_B=1.0 / (1.0 + h * p.load.viscous / J_base),
                        unbalance=p.load.unbalance, T_c=p.friction.coulomb,
                        T_sc=p.friction.breakaway - p.friction.coulomb, per_v2=p.friction.stribeck_rate ** -2,
                        sigma_0=p.friction.stiffness, h_sigma_0=h * p.friction.stiffness,
                        sigma_1_h=p.friction.damping / h, encoder=encoder.errors(p.encoder.error),
                        rate_max=p.limits.rate, a=p.limits.deceleration, ramp=p.limits.deceleration * period,
                        lower=p.limits.lower, upper=p.limits.upper, K=p.limits.approach,
                        stop_lower=p.limits.lower - buffer, stop_upper=p.limits.upper + buffer,
                        k_stop=p.limits.buffer_stiffness, c_stop=p.limits.buffer_damping, faults=trips)


def _motor_at_rest(m: MotorParameters, g: GearTrainParameters, T: NewtonMeters, total: NewtonMeters, theta: Radians,
                   per_rad: float) -> Records:
    """Return the MotorState (1,) of a motor that makes T at standstill with its pinion on the flank, load at theta.

    total: part of T from the integral of the speed loop; per_rad: counts of the motor encoder per rad.
    """
    i_ref = T / m.torque_constant
    i_q = (i_ref - m.drift.current_offset) / (1.0 + m.drift.current_gain)
    v_q = m.resistance * (1.0 + m.drift.resistance) * i_q
    made = m.torque_constant * (1.0 + m.drift.flux_linkage) * i_q
    flank = math.copysign(0.5 * g.lash, made) if made != 0.0 else 0.0
    angle = g.ratio * (theta + flank + made * g.ratio / g.stiffness)
    return MotorState.of(i_q=i_q, i_ref=i_ref, v_q=v_q, sum_q=v_q, theta=angle,
                         count=cast(Law, encoder.counts).py_func(angle, per_rad), sum=total, torque_ref=T, q_R=1.0)


def initial_state(p: AxisParameters, theta: Radians, external: NewtonMeters) -> Records:
    """Return the State (1,) of an axis at rest at theta, in balance with an external torque."""
    per_rad = 2.0 ** p.encoder.motor_bits / (2.0 * math.pi)
    _, k_dish, _ = _dish(p)
    T = -0.5 * external / p.gear_train.ratio
    observed = p.speed_loop.disturbance_observer > 0.0
    total = 0.0 if observed else T
    T_b = cast(Law, loops.scheduled_bias).py_func(T, *loops.bias_constants(p.bias))
    return State.of(motor_1=_motor_at_rest(p.motor_1, p.gear_train, T + T_b, total, theta, per_rad),
                    motor_2=_motor_at_rest(p.motor_2, p.gear_train, T - T_b, total, theta, per_rad), theta=theta,
                    dish=theta + external / k_dish if k_dish else theta, external=external, bias=T_b,
                    d_hat=-T if observed else 0.0, brake_stuck=BRAKE_WORKING)


@inlined
def load_counts(axis: State, constants: Constants) -> float:
    """Return the reading of the load encoder [counts]."""
    if axis.stuck:
        return axis.reading
    return encoder.counts(encoder.reading(axis.theta, constants.encoder), constants.per_rad) + axis.jump


@inlined
def _measured_speed(motor: MotorState, constants: MotorConstants) -> RadiansPerSecond:
    """Return the motor speed: encoder difference over a speed-loop period (0.25 ms old on average)."""
    return (encoder.counts(motor.theta, constants.per_rad) - motor.count) * constants.speed


@inlined
def read_motor_sensors(motor: MotorState, constants: MotorConstants) -> None:
    """Measure the speed of a motor and advance its thermal load by a speed-loop period."""
    motor.measured = _measured_speed(motor, constants)
    motor.heat = motors.thermal_load(motor.heat, constants.K_t * motor.i_q, constants.per_rated, constants.heat_gain)
    motor.count = int(encoder.counts(motor.theta, constants.per_rad))


@inlined
def _measured_torque(motor: MotorState, constants: MotorConstants) -> NewtonMeters:
    """Return the torque from the current sensor and the torque constant in the controller."""
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
    """Set the torque references of both motors for the rate axis.rate. Return True if a motor is at its limit.

    omega: mean motor speed; feed_forward: torque added to the demand of each motor. A single working motor makes the
    torque of both, up to its limit.
    """
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
    """Return the square of the measured current [A2]."""
    i_d, i_q = constants.gain * motor.i_d, constants.gain * motor.i_q + constants.offset
    return i_d * i_d + i_q * i_q


@inlined
def _supervise(axis: State, constants: Constants, omega: RadiansPerSecond, free: bool) -> None:
    """Set the faults that the drive measures.

    omega: mean motor speed; free: True if the motors may turn. Only a free motor can have a following error.
    """
    c, m1, m2, k1, k2 = constants, axis.motor_1, axis.motor_2, constants.motor_1, constants.motor_2
    axis.late = faults.late(axis.late, c.N * axis.rate - omega, c.faults.error) if free else 0
    axis.present |= faults.measured_faults(
        max(_squared_current(m1, k1), _squared_current(m2, k2)),
        max(abs(m1.measured), abs(m2.measured)),
        c.rad * load_counts(axis, c) - c.encoder.zero - c.per_2N * (k1.rad * m1.count + k2.rad * m2.count),
        axis.late, max(m1.heat, m2.heat), axis.faults, c.faults)
    axis.present |= faults.lost_motor_faults(axis.motor_lost)
    axis.present |= faults.end_switch_faults(axis.theta, c.per_N * omega, c.faults)
    axis.faults |= axis.present


@inlined
def _remove_torque(axis: State, omega: RadiansPerSecond, free: bool) -> None:
    """Remove the torque of both motors.

    free: True while no brake holds the motors; the integrals are then cleared. Behind closed brakes the integrals
    stay, because the motors need them when the brakes open. omega: mean motor speed.
    """
    m1, m2 = axis.motor_1, axis.motor_2
    m1.torque_ref = m2.torque_ref = m1.i_ref = m2.i_ref = 0.0
    m1.inhibited = m2.inhibited = axis.stopping = axis.ramping = 1
    axis.rate, axis.bias, axis.omega_hat = 0.0, 0.0, omega
    if free:
        m1.sum = m2.sum = axis.d_hat = 0.0


@inlined
def speed_control(axis: State, constants: Constants, rate: RadiansPerSecond, torque: NewtonMeters, enable: Bit,
                  powered: bool, free: bool) -> None:
    """Run one speed-loop period: compute the current references of both motors from a command.

    rate, torque   commanded rate and feed-forward torque of the load
    enable         1 to follow the command, 0 to stop and hold
    powered        True if the motors may make torque
    free           True if no brake holds the motors
    """
    m1, m2, k1, k2 = axis.motor_1, axis.motor_2, constants.motor_1, constants.motor_2
    read_motor_sensors(m1, k1)
    read_motor_sensors(m2, k2)
    control_measured(axis, constants, 0.5 * (realised_torque(m1, k1) + realised_torque(m2, k2)), rate, torque, enable,
                     powered, free)


@inlined
def control_measured(axis: State, constants: Constants, made: NewtonMeters, rate: RadiansPerSecond,
                     torque: NewtonMeters, enable: Bit, powered: bool, free: bool) -> None:
    """Run one speed-loop period with the speeds, counts and thermal loads of the motors that the state contains.

    made: mean torque that the motors have made since the last period; other arguments: as of `speed_control`.
    """
    c, m1, m2, k1, k2 = constants, axis.motor_1, axis.motor_2, constants.motor_1, constants.motor_2
    omega = mean_motor_speed(axis, m1.measured, m2.measured)
    _supervise(axis, c, omega, powered and free)
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
    position = c.rad * load_counts(axis, c)
    axis.rate = min(max(wanted, -loops.approach_rate(position - c.lower, c.K, c.a)),
                 loops.approach_rate(c.upper - position, c.K, c.a))
    if axis.rate != wanted:
        feed_forward = 0.0
        axis.end_stop = 1

    limited = _torque_control(axis, c, omega, feed_forward - axis.d_hat)
    m1.i_ref = m1.torque_ref * k1.per_K_t_hat
    m2.i_ref = m2.torque_ref * k2.per_K_t_hat

    axis.torque_limited |= limited
    axis.voltage_limited |= m1.limited | m2.limited
    m1.limited = 0
    m2.limited = 0


@compiled
def begin_period(axis: State, constants: Constants, grip: bool) -> None:
    """Begin a control period: brakes, winding temperatures, constant inertia, and cleared flags.

    grip: True if the brakes grip by their command; a stuck brake ignores it.
    """
    c, m1, m2, k1, k2 = constants, axis.motor_1, axis.motor_2, constants.motor_1, constants.motor_2
    if not c.varying:
        axis.h_J, axis.q_B, axis.h_J_dish = c.h_J, c.q_B, c.h_J_dish
    axis.braked = 1 if grip else 0
    if axis.brake_stuck != BRAKE_WORKING:
        axis.braked = 1 if axis.brake_stuck == BRAKE_STUCK_ON else 0
    m1.q_R = motors.resistive_damping(k1.h_R_L, k1.rise, m1.heat)
    m2.q_R = motors.resistive_damping(k2.h_R_L, k2.rise, m2.heat)
    axis.torque_limited = axis.voltage_limited = axis.end_stop = axis.stopping = axis.present = 0


@inlined
def current_control(motor: MotorState, constants: MotorConstants) -> None:
    """Run one current-loop period of one motor: compute the phase voltages from the current reference.

    The inverter of an inhibited motor is off. Its current is then 0, even if the current sensor has an offset, and its
    open terminals show the back-EMF. The model omits the diodes, which empty the inductance within a millisecond.
    """
    k = constants
    v_d, v_q, sum_d, sum_q, limited = loops.voltages(
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
    """Set the inertia J of a varying load, base and dish.

    The share of the base in the inertia and the spring of the dish stay constant.
    """
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
    """Write the present outputs of the axis: values of its sensors and controllers, and the true load."""
    c, m1, m2, k1, k2 = constants, axis.motor_1, axis.motor_2, constants.motor_1, constants.motor_2
    axis.reading = load_counts(axis, c)
    outputs.position = c.rad * axis.reading
    outputs.motor_position[0] = k1.rad * encoder.counts(m1.theta, k1.per_rad)
    outputs.motor_position[1] = k2.rad * encoder.counts(m2.theta, k2.per_rad)
    outputs.motor_velocity[0] = _measured_speed(m1, k1)
    outputs.motor_velocity[1] = _measured_speed(m2, k2)
    outputs.velocity = c.per_N * mean_motor_speed(axis, outputs.motor_velocity[0], outputs.motor_velocity[1])
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
    outputs.load_position = axis.dish if c.flexible else axis.theta
    outputs.load_velocity = axis.omega_dish if c.flexible else axis.omega
    outputs.true_torque[0] = k1.K_t * m1.i_q
    outputs.true_torque[1] = k2.K_t * m2.i_q
