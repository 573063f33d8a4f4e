"""Law of `drive_node`: from the reports of four drives to their commands, once per control period.

The law contains no control of its own. It writes the measured values of the drives into the state of the antenna
drive unit (adu_drive), calls the functions of that unit, and turns their torques into commands:

    offset = T - K_p (N rate - omega)

T is the torque of a motor that the speed loop of the unit demands. A drive with the proportional gain K_p adds
K_p (N rate - omega_i) itself. In the mean of both motors, the sum is the torque of the unit; the difference of both
speeds is damped by K_p / 2 in addition. Integral, bias, feed-forward and disturbance observer stay here.

This is the control `velocity`. With the control `drive`, motor 1 has its whole speed loop in its drive, and motor 2
follows the measured torque of motor 1, smoothed:

    T_2 = T_1 - 2 T_b

Without the smoothing the axis would oscillate, because the torque of motor 2 comes one period late and motor 2 has no
damping of its own.

The gains in the constants of the unit are then 0; limits of rate and travel, bias schedule and faults stay here. With
the control `torque` each drive makes the torque T that the unit demands.

Arguments: m is the record of the node (Record), d its part `drives`, k its part `scales`.
"""
import math

import numpy as np

from adu_drive import axis, drive_state, drive_unit
from adu_drive import unit as adu_unit
from adu_drive.controller import encoder, faults, travel
from adu_drive.plant import thermal
from pedestal_common.compiled import compiled
from pedestal_common.wire.records import NO_STAMP
from pedestal_hardware import cia402, errors, pdo
from pedestal_hardware.params import CONTROLS

N_DRIVES = pdo.DRIVE_COUNT

INPUT_NEGATIVE_LIMIT, INPUT_POSITIVE_LIMIT, INPUT_INTERLOCK = 1, 2, 8
"""Bits of the digital inputs 60FD: limit switches in the directions of the drive, interlock (safe torque off)."""

MODE_CYCLIC_VELOCITY, MODE_CYCLIC_TORQUE = 9, 10
"""Modes of operation `cyclic synchronous velocity` and `cyclic synchronous torque` (6060, 6061)."""

CONTROL_VELOCITY, CONTROL_DRIVE, CONTROL_TORQUE = range(len(CONTROLS))  # indices of params.CONTROLS

MAX_BLIND_S = 0.01
"""Longest time for which a drive in the mode of torque keeps its torque without a report [s]; then it stops the axis
by itself, because only this law controls the speed."""

MAX_AWAY_PERIODS = 4  # number of periods after which an enabled drive that has left its state counts as lost

MAX_LEAVE_S = 0.5
"""Time in which a drive with a closing brake may still hold its motor after the axes are disabled [s]."""

MAX_RATE_OF_LASH_RAD_S = 0.01
"""Rate of an axis up to which a motion on a limit switch is that of the bias, which takes up the lash [rad/s]."""

DRIVES_DTYPE = np.dtype([
    *((name, 'i8', (N_DRIVES,)) for name in ('status', 'velocity', 'torque', 'position', 'error', 'mode', 'load',
                                             'inputs', 'reported')),
    *((name, 'i8', (N_DRIVES,)) for name in ('controlword', 'target', 'offset')),
    *((name, 'i8', (N_DRIVES,)) for name in ('state', 'age', 'away', 'been_up', 'known', 'ready',
                                             'reset_left')),
    ('zero', 'f8', (N_DRIVES,)), ('interlock', 'i8'),
    *((name, 'i8', (2,)) for name in ('angle_known', 'moved', 'held', 'since')),
    *((name, 'f8', (2,)) for name in ('rate', 'followed', 'angle'))], align=True)
"""Data of the drives, in their own units.

status ... inputs   last report (pdo.REPORT_DTYPE); reported: 1 if the report is of this period
controlword, target, offset    next command: controlword, target velocity, torque offset
state           code of cia402.STATE_NAMES, the last state that a statusword has stated
age             periods since the last report
away, been_up   periods in which the drive is not enabled although it should be; 1 once it was enabled
known, zero     1 if `zero` holds the angle of the motor [rad] at angle 0 of the axis
ready           1 while the bus exchanges data with the drive and its settings are verified; written by the node
reset_left      periods left for the reset of the fault of a drive; 0 as soon as the drive has left its fault
interlock       1 while a drive reports its interlock
angle_known     1 for an axis whose angle has been measured
moved, rate     1 after the first angle; rate of each axis by its load encoder [rad/s]
held            1 after drives in the mode of torque have held an axis without reports
followed        torque of motor 1 that motor 2 follows with the control `drive`, smoothed [Nm]
angle, since    angle of each axis [rad], without reports by its commanded rate; periods since its last measured angle
"""

SCALES_DTYPE = np.dtype([
    *((name, 'f8', (N_DRIVES,)) for name in ('position', 'velocity', 'torque')),
    *((name, 'f8', (2,)) for name in ('load', 'load_zero', 'K_p', 'K_iT')), ('per_period', 'f8'),
    *((f'{name}_periods', 'i8') for name in ('lost', 'enable', 'reset', 'leave', 'blind')), ('control', 'i8'),
    ('follow_gain', 'f8')], align=True)
"""Units of the drives.

position, velocity, torque    rad, rad/s and Nm on the motor shaft of one step, negative for a reversed motor
load, load_zero               rad of one step of the load encoder; angle of the axis at its zero [rad]
per_period, *_periods         1 / period [1/s]; limits of times in periods
control                       index of params.CONTROLS
K_p, K_iT                     gains of the constants of each axis, for two motors
follow_gain                   share of the way that `followed` moves in a period
"""

Record = np.dtype([('state', drive_unit.State.dtype), ('constants', drive_unit.Constants.dtype),
                         ('inputs', drive_unit.Inputs.dtype), ('outputs', drive_unit.Outputs.dtype),
                         ('link', adu_unit.Link.dtype), ('drives', DRIVES_DTYPE), ('scales', SCALES_DTYPE)],
                        align=True)


@compiled
def _bit(motor):
    """Return the fault bit of a lost motor of an axis (0 or 1)."""
    return faults.Bit.MOTOR_1_LOST if motor == 0 else faults.Bit.MOTOR_2_LOST


@compiled
def _measure_motor(motor, c, angle, speed, torque):
    """Write angle [rad], speed [rad/s] and torque [Nm] of a motor into its state. c: its constants."""
    motor.theta, motor.measured = angle, speed
    motor.count = encoder.counts(angle, c.per_rad)
    motor.i_q = torque * c.per_K_t_hat
    motor.heat = thermal.load(motor.heat, torque, c.per_rated, c.heat_gain)


@compiled
def _copy_motor(motor, other):
    """Write the motion of the other motor of the axis into the state of a motor that reports nothing."""
    motor.theta, motor.measured, motor.count, motor.i_q = other.theta, other.measured, other.count, 0.0


@compiled
def _note_reports(d):
    """Note age and state of each drive, and the interlock."""
    d.interlock = 0
    for i in range(N_DRIVES):
        d.age[i] = 0 if d.reported[i] and d.ready[i] else d.age[i] + 1
        if d.reported[i]:
            code = cia402.state(d.status[i])
            if code != cia402.UNKNOWN_STATE:
                d.state[i] = code
            if d.inputs[i] & INPUT_INTERLOCK:
                d.interlock = 1


@compiled
def _measure_axis(a, c, d, k, i):
    """Write the measured values of axis i (0, 1) into its state a. c: its constants.

    The load encoder is wired to the drive of motor 1. While this drive is lost, the angle of the axis follows from
    motor 2. The values of both drives are taken together. This avoids a disagreement between values of different
    times.
    """
    first, second = 2 * i, 2 * i + 1
    m1, m2 = a.motor_1, a.motor_2
    d.since[i] += 1
    for j in (first, second):
        if 0 < d.age[j] <= k.lost_periods:
            return
    before = a.theta
    if d.age[first] == 0:
        a.theta = k.load[i] * d.load[first] + k.load_zero[i]
    for j in (first, second):
        if d.age[j] == 0:
            d.angle_known[i] |= j == first
            angle = k.position[j] * d.position[j]
            if not d.known[j] and d.angle_known[i]:
                d.zero[j], d.known[j] = angle - c.N * a.theta, 1
            shaft = angle - d.zero[j] if d.known[j] else c.N * a.theta
            _measure_motor(m1 if j == first else m2, c.motor_1 if j == first else c.motor_2, shaft,
                           k.velocity[j] * d.velocity[j], k.torque[j] * d.torque[j])
    if d.age[first] > k.lost_periods and d.age[second] == 0:
        a.theta = c.per_N * m2.theta
        _copy_motor(m1, m2)
    elif d.age[second] > k.lost_periods and d.age[first] == 0:
        _copy_motor(m2, m1)
    d.rate[i] = (a.theta - before) * k.per_period / d.since[i] if d.moved[i] else 0.0
    d.moved[i] = d.angle_known[i]
    d.angle[i], d.since[i] = a.theta, 0


@compiled
def measure(records, stamp, outputs):
    """Take the reports of the drives and write the messages of the step with a stamp [ns]. records: as of `control`.
    """
    m = records[0]
    s, c, y, d, k = m.state, m.constants, m.outputs, m.drives, m.scales
    _note_reports(d)
    _measure_axis(s.azimuth, c.azimuth, d, k, 0)
    _measure_axis(s.elevation, c.elevation, d, k, 1)
    drive_unit.read(s, c, y)
    for i in range(2):
        a, axis_c, of_axis = ((s.azimuth, c.azimuth, y.azimuth) if i == 0 else
                              (s.elevation, c.elevation, y.elevation))
        of_axis.motor_velocity[0], of_axis.motor_velocity[1] = a.motor_1.measured, a.motor_2.measured
        of_axis.velocity = axis_c.per_N * axis.mean_motor_speed(a, a.motor_1.measured, a.motor_2.measured)
        if not d.angle_known[i]:
            of_axis.position = math.nan
    if m.link.stamp != NO_STAMP and y.invalid_command:
        m.link.invalid = adu_unit.INVALID_COMMAND
    m.link.stamp = stamp
    adu_unit.encode_measured(y, stamp, outputs)


@compiled
def _moves_out(commanded, measured):
    """Return True if an axis on a limit switch moves outwards, by its commanded or measured outward rate [rad/s]."""
    return commanded > faults.MIN_OUTWARD_RATE_RAD_S or measured > MAX_RATE_OF_LASH_RAD_S


@compiled
def _note_faults(a, d, k, i, phase):
    """Set the faults of axis i (0, 1) that its drives report."""
    for motor in range(2):
        j = 2 * i + motor
        d.reset_left[j] = max(d.reset_left[j] - 1, 0)
        # The reset may include a reset of the communication, during which the drive reports nothing.
        a.motor_lost[motor] = d.age[j] > k.lost_periods and d.reset_left[j] == 0
        if d.age[j] != 0:
            continue
        if d.state[j] == cia402.State.FAULT or d.state[j] == cia402.State.FAULT_REACTION_ACTIVE:
            d.been_up[j] = 0
            if d.reset_left[j] == 0:
                a.faults |= errors.fault_of(d.error[j], motor)
        elif d.ready[j]:
            d.reset_left[j] = 0
        # The switches belong to the directions of the drive. A reversed motor exchanges those of the axis.
        sign = -1.0 if k.position[j] < 0.0 else 1.0
        if d.inputs[j] & INPUT_POSITIVE_LIMIT and _moves_out(sign * a.rate, sign * d.rate[i]) or (
                d.inputs[j] & INPUT_NEGATIVE_LIMIT and _moves_out(-sign * a.rate, -sign * d.rate[i])):
            a.faults |= faults.Bit.FINAL_LIMIT
            a.present |= faults.Bit.FINAL_LIMIT
        if phase != drive_state.PHASE_ENABLED and phase != drive_state.PHASE_RELEASING_BRAKES:
            d.away[j] = d.been_up[j] = 0
        elif d.state[j] == cia402.State.OPERATION_ENABLED:
            d.away[j], d.been_up[j] = 0, phase == drive_state.PHASE_ENABLED
        else:
            d.away[j] += 1
            if d.away[j] > (MAX_AWAY_PERIODS if d.been_up[j] else k.enable_periods):
                a.faults |= _bit(motor)
    if k.control == CONTROL_DRIVE and (a.faults & faults.Bit.MOTOR_1_LOST or a.motor_lost[0]):
        a.faults |= faults.Bit.MOTOR_2_LOST     # motor 2 has no speed loop of its own


@compiled
def _is_up(a, d, i, periods):
    """Return True if every drive of axis i that is not lost is enabled by a report of at most this age."""
    for motor in range(2):
        j = 2 * i + motor
        if not a.faults & _bit(motor) and not (d.age[j] <= periods and d.state[j] == cia402.State.OPERATION_ENABLED):
            return False
    return True


@compiled
def _goal(s, a, d, k, j):
    """Return the goal of drive j of axis a in the present phase."""
    if a.faults & _bit(j % 2) or faults.removes_torque(a.faults):
        return cia402.GOAL_OFF
    if s.phase == drive_state.PHASE_DISABLED:
        # A drive closes its brake at standstill, after a quick stop later than the phases state. It then leaves by
        # itself.
        leaves = d.controlword[j] == cia402.COMMAND_SWITCH_ON and d.state[j] == cia402.State.OPERATION_ENABLED
        return cia402.GOAL_SWITCHED_ON if leaves and s.age < k.leave_periods else cia402.GOAL_OFF
    if s.phase == drive_state.PHASE_ENGAGING_BRAKES:
        return cia402.GOAL_SWITCHED_ON
    if s.phase == drive_state.PHASE_STOPPING and s.emergency:
        return cia402.GOAL_QUICK_STOP
    return cia402.GOAL_ENABLED


@compiled
def _demanded_torque(s, a, c, d, k, j):
    """Return the torque [Nm] in the command of drive j of axis a: torque offset, or target torque in a drive in the
    mode of torque."""
    i, motor = j // 2, j % 2
    demanded = a.motor_1.torque_ref if motor == 0 else a.motor_2.torque_ref
    if k.control == CONTROL_TORQUE:
        return demanded
    if k.control == CONTROL_VELOCITY:
        omega = axis.mean_motor_speed(a, a.motor_1.measured, a.motor_2.measured)
        return demanded - c.K_p * (c.N * a.rate - omega)
    if motor == 1:
        return d.followed[i] - 2.0 * a.bias
    if not s.following or a.ramping or a.end_stop:
        return 0.0
    return a.commanded_torque * c.per_2N * (2.0 if a.faults & faults.Bit.MOTOR_2_LOST else 1.0)


@compiled
def _command_drive(s, a, c, d, k, j, alive, kept):
    """Write the command of drive j of axis a. alive: True if the axis is under control; kept: True if the torque keeps
    its last value."""
    goal = _goal(s, a, d, k, j)
    control = cia402.controlword(d.state[j], goal)
    if d.reset_left[j] and d.state[j] == cia402.State.FAULT:
        control = cia402.CONTROL_RESET if d.controlword[j] & cia402.CONTROL_RESET == 0 else 0
    if goal == cia402.GOAL_ENABLED and s.phase == drive_state.PHASE_RELEASING_BRAKES:
        control |= cia402.CONTROL_HALT
    elif goal == cia402.GOAL_ENABLED and d.held[j // 2]:
        control |= cia402.CONTROL_HALT
    d.controlword[j] = control
    if goal != cia402.GOAL_ENABLED or not (alive or kept):
        d.target[j], d.offset[j] = 0, 0
        return
    d.target[j] = _whole(c.N * a.rate / k.velocity[j], 2.0 ** 31 - 1.0)
    if alive:
        d.offset[j] = _whole(_demanded_torque(s, a, c, d, k, j) / k.torque[j], 2.0 ** 15 - 1.0)


@compiled
def _keep_rate(a, c, d, k, i):
    """Advance the angle of axis i by a period without reports, and keep its rate, reduced before an end of travel."""
    d.angle[i] += a.rate / k.per_period
    down = max(travel.approach_rate(d.angle[i] - c.lower, c.K, c.a), 0.0)
    up = max(travel.approach_rate(c.upper - d.angle[i], c.K, c.a), 0.0)
    a.rate = min(max(a.rate, -down), up)


@compiled
def _whole(x, largest):
    """Return the nearest whole number within +-largest."""
    return int(math.floor(min(max(x, -largest), largest) + 0.5))


@compiled
def _control_axis(s, a, c, d, k, i):
    """Compute the commands of both drives of axis i with the speed loop of adu_drive."""
    m1, m2 = a.motor_1, a.motor_2
    _note_faults(a, d, k, i, s.phase)
    # In the phase before, the drives hold the motors by themselves.
    alive = _is_up(a, d, i, 1) and s.phase < drive_state.PHASE_DISABLED
    # Without new reports the axis keeps its last command, until a report arrives or a motor is lost.
    kept = not alive and _is_up(a, d, i, k.lost_periods) and s.phase < drive_state.PHASE_DISABLED
    m1.limited = 1 if d.status[2 * i] & cia402.STATUS_LIMIT else 0
    m2.limited = 1 if d.status[2 * i + 1] & cia402.STATUS_LIMIT else 0
    made = 0.5 * c.motor_1.K_t_hat * (m1.i_q + m2.i_q)
    if k.control == CONTROL_TORQUE:
        # A single motor gets the torque of both. With the whole gain it would oscillate at the delay of this node.
        share = 0.5 if a.faults & faults.MOTORS_LOST_BITS else 1.0
        c.K_p, c.K_iT = share * k.K_p[i], share * k.K_iT[i]
    if alive and d.held[i]:
        # The drives have stopped the axis meanwhile: the law begins at its rate, and ramps to the command.
        a.rate, a.ramping = c.per_N * axis.mean_motor_speed(a, m1.measured, m2.measured), 1
        d.held[i] = 0
    if kept:
        _keep_rate(a, c, d, k, i)
        blind = max(d.age[2 * i], d.age[2 * i + 1]) > k.blind_periods
        d.held[i] |= 1 if k.control == CONTROL_TORQUE and blind else 0
    else:
        feed_forward = a.commanded_torque
        if k.control == CONTROL_DRIVE:
            # The demand that fades the bias is the torque that the drives make.
            m1.sum, m2.sum, feed_forward = made, made, 0.0
            d.followed[i] += k.follow_gain * (c.motor_1.K_t_hat * m1.i_q - d.followed[i])
        axis.control_measured(a, c, made, a.commanded_rate, feed_forward, s.following, alive, not s.braked)
    for motor in range(2):
        _command_drive(s, a, c, d, k, 2 * i + motor, alive, kept)


@compiled
def control(records, stamp, inputs):
    """Compute the commands of the drives from their last reports and the messages of the step before.

    records: (1,) of Record. A record itself as argument would cost 90 us, because numba would examine all its
    fields in each call. stamp: time of the coming exchange [ns]; inputs: record of the topics.
    """
    m = records[0]
    s, c, u, y, d, k = m.state, m.constants, m.inputs, m.outputs, m.drives, m.scales
    if m.link.stamp == NO_STAMP:
        s.k = stamp // m.link.period
    else:
        adu_unit.take_command(u, m.link, inputs[adu_unit.RATE_COMMAND_TOPIC])
    y.invalid_command = 0 if drive_unit.receive_command(s, u, True) else 1
    if d.interlock:
        s.emergency = 1
    s.braked = drive_state.advance(s, c, u.pins, _is_up(s.azimuth, d, 0, 1) and _is_up(s.elevation, d, 1, 1))
    axis.begin_period(s.azimuth, c.azimuth, s.braked)
    axis.begin_period(s.elevation, c.elevation, s.braked)
    drive_unit.apply_command(s, c, u, 0)
    _control_axis(s, s.azimuth, c.azimuth, d, k, 0)
    _control_axis(s, s.elevation, c.elevation, d, k, 1)
    s.k += 1
