"""Law of `drive_node`: from the reports of four drives to their commands, once per control period.

The law contains no control of its own. It writes the measured values of the drives into the state of a drive of two
axes (drive_law), calls the functions of that package, and turns their torques into commands:

    offset = T - K_p (N rate - omega)

T is the torque of a motor that the speed loop demands. A drive with the proportional gain K_p adds K_p (N rate -
omega_i) itself. In the mean of both motors, the sum is this torque; the difference of both speeds is damped by K_p / 2
in addition. Integral, bias, feed-forward and disturbance observer stay here.

This is the control `velocity`. With the control `drive`, motor 1 has its whole speed loop in its drive, and motor 2
follows the measured torque of motor 1, smoothed: T_2 = T_1 - 2 T_b. Without the smoothing the axis would oscillate,
because the torque of motor 2 comes one period late and motor 2 has no damping of its own. The gains in the constants
are then 0; limits of rate and travel, bias schedule and faults stay here. With the control `torque` each drive makes
the torque T.

An axis has the number 0 (azimuth) or 1 (elevation).
"""
import math
from typing import Annotated, TypeAlias

from drive_law import axis_control, drive_state, faults, loops, rate_drive
from pedestal_common.compiled import compiled
from pedestal_common.quantities import (
    AnyRecord,
    Bit,
    Floats,
    Hertz,
    Ints,
    Nanoseconds,
    NewtonMeters,
    Pair,
    Radians,
    RadiansPerSecond,
    Records,
)
from pedestal_common.record import Record
from pedestal_common.wire.records import NO_STAMP
from pedestal_hardware import cia402, errors, pdo
from pedestal_hardware.params import CONTROLS

N_DRIVES = pdo.DRIVE_COUNT

OfDrives: TypeAlias = Annotated[Floats, (N_DRIVES,)]
CodesOfDrives: TypeAlias = Annotated[Ints, (N_DRIVES,)]     # codes, counts, or numbers in the units of the drives
CodesOfAxes: TypeAlias = Annotated[Ints, (2,)]

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

class Drives(Record):
    """Data of the drives, in their own units."""
    status: CodesOfDrives           # status to inputs: last report (pdo.REPORT_DTYPE)
    velocity: CodesOfDrives
    torque: CodesOfDrives
    position: CodesOfDrives
    error: CodesOfDrives
    mode: CodesOfDrives
    load: CodesOfDrives
    inputs: CodesOfDrives
    reported: CodesOfDrives         # 1 if the report is of this period
    controlword: CodesOfDrives      # of the next command
    target: CodesOfDrives           # target velocity of the next command
    offset: CodesOfDrives           # torque offset of the next command
    state: CodesOfDrives            # code of cia402.STATE_NAMES, the last state that a statusword has stated
    age: CodesOfDrives              # periods since the last report
    away: CodesOfDrives             # periods in which the drive is not enabled although it should be
    been_up: CodesOfDrives          # 1 once the drive was enabled
    known: CodesOfDrives            # 1 if `zero` is known
    ready: CodesOfDrives            # 1 while the bus exchanges data with the drive and its settings are verified;
                                    # written by the node
    reset_left: CodesOfDrives       # periods left for the reset of a fault; 0 as soon as the drive has left its fault
    zero: OfDrives                  # angle of the motor at angle 0 of the axis [rad]
    interlock: Bit                  # 1 while a drive reports its interlock
    angle_known: CodesOfAxes        # 1 for an axis whose angle has been measured
    moved: CodesOfAxes              # 1 after the first angle
    held: CodesOfAxes               # 1 after drives in the mode of torque have held an axis without reports
    since: CodesOfAxes              # periods since the last measured angle
    rate: Pair                      # of each axis by its load encoder [rad/s]
    followed: Pair                  # torque of motor 1 that motor 2 follows with the control `drive`, smoothed [Nm]
    angle: Pair                     # of each axis [rad]; without reports by its commanded rate


class Scales(Record):
    """Units of the drives, and constants of the law."""
    position: OfDrives              # of one step, on the motor shaft [rad]; negative for a reversed motor
    velocity: OfDrives              # likewise [rad/s]
    torque: OfDrives                # likewise [Nm]
    load: Pair                      # of one step of the load encoder [rad]
    load_zero: Pair                 # angle of the axis at the zero of its load encoder [rad]
    K_p: Pair                       # gain of the constants of each axis, for two motors
    K_iT: Pair                      # likewise
    per_period: Hertz               # 1 / period
    lost_periods: int               # .._periods: limits of times
    enable_periods: int
    reset_periods: int
    leave_periods: int
    blind_periods: int
    control: int                    # index of params.CONTROLS
    follow_gain: float              # share of the way that `followed` moves in a period


class ServoRecord(Record):
    """All data of the node."""
    state: drive_state.State
    constants: drive_state.Constants
    inputs: drive_state.Inputs
    outputs: drive_state.Outputs
    link: rate_drive.Link
    drives: Drives
    scales: Scales


@compiled
def _lost_bit(motor: int) -> int:
    return faults.Bit.MOTOR_1_LOST if motor == 0 else faults.Bit.MOTOR_2_LOST


@compiled
def _measure_motor(motor: axis_control.MotorState, constants: axis_control.MotorConstants, angle: Radians,
                   speed: RadiansPerSecond, torque: NewtonMeters) -> None:
    motor.theta, motor.measured = angle, speed
    motor.count = int(axis_control.counts(angle, constants.per_rad))
    motor.i_q = torque * constants.per_K_t_hat
    motor.heat = faults.thermal_load(motor.heat, torque, constants.per_rated, constants.heat_gain)


@compiled
def _copy_motor(motor: axis_control.MotorState, other: axis_control.MotorState) -> None:
    """Write the motion of the other motor of the axis into the state of a motor that reports nothing."""
    motor.theta, motor.measured, motor.count, motor.i_q = other.theta, other.measured, other.count, 0.0


@compiled
def _note_reports(drives: Drives) -> None:
    drives.interlock = 0
    for drive in range(N_DRIVES):
        drives.age[drive] = 0 if drives.reported[drive] and drives.ready[drive] else drives.age[drive] + 1
        if drives.reported[drive]:
            code = cia402.state(drives.status[drive])
            if code != cia402.UNKNOWN_STATE:
                drives.state[drive] = code
            if drives.inputs[drive] & INPUT_INTERLOCK:
                drives.interlock = 1


@compiled
def _measure_axis(of_axis: axis_control.State, constants: axis_control.Constants, drives: Drives, scales: Scales,
                  number: int) -> None:
    """Write the measured values of an axis into its state.

    The load encoder is wired to the drive of motor 1. While this drive is lost, the angle of the axis follows from
    motor 2. The values of both drives are taken together. This avoids a disagreement between values of different
    times.
    """
    first, second = 2 * number, 2 * number + 1
    motor_1, motor_2 = of_axis.motor_1, of_axis.motor_2
    drives.since[number] += 1
    for drive in (first, second):
        if 0 < drives.age[drive] <= scales.lost_periods:
            return
    before = of_axis.theta
    if drives.age[first] == 0:
        of_axis.theta = scales.load[number] * drives.load[first] + scales.load_zero[number]
    for drive in (first, second):
        if drives.age[drive] == 0:
            drives.angle_known[number] |= drive == first
            angle = scales.position[drive] * drives.position[drive]
            if not drives.known[drive] and drives.angle_known[number]:
                drives.zero[drive], drives.known[drive] = angle - constants.N * of_axis.theta, 1
            shaft = angle - drives.zero[drive] if drives.known[drive] else constants.N * of_axis.theta
            _measure_motor(motor_1 if drive == first else motor_2,
                           constants.motor_1 if drive == first else constants.motor_2, shaft,
                           scales.velocity[drive] * drives.velocity[drive],
                           scales.torque[drive] * drives.torque[drive])
    if drives.age[first] > scales.lost_periods and drives.age[second] == 0:
        of_axis.theta = constants.per_N * motor_2.theta
        _copy_motor(motor_1, motor_2)
    elif drives.age[second] > scales.lost_periods and drives.age[first] == 0:
        _copy_motor(motor_2, motor_1)
    turned = of_axis.theta - before
    drives.rate[number] = turned * scales.per_period / drives.since[number] if drives.moved[number] else 0.0
    drives.moved[number] = drives.angle_known[number]
    drives.angle[number], drives.since[number] = of_axis.theta, 0


@compiled
def read(records: Records) -> None:
    """Write the present outputs."""
    record = records[0]
    state, constants, outputs = record.state, record.constants, record.outputs
    for number in range(2):
        of_axis, of_constants, measured = ((state.azimuth, constants.azimuth, outputs.azimuth) if number == 0 else
                                           (state.elevation, constants.elevation, outputs.elevation))
        axis_control.read(of_axis, of_constants, axis_control.counts(of_axis.theta, of_constants.per_rad),
                          of_axis.motor_1.measured, of_axis.motor_2.measured, measured)
        if not record.drives.angle_known[number]:
            measured.position = math.nan
    drive_state.read(state, constants, outputs)


@compiled
def measure(records: Records, stamp: Nanoseconds, messages: AnyRecord) -> None:
    """Take the reports of the drives and write the messages of the step."""
    record = records[0]
    state, constants, outputs = record.state, record.constants, record.outputs
    drives, scales = record.drives, record.scales
    _note_reports(drives)
    _measure_axis(state.azimuth, constants.azimuth, drives, scales, 0)
    _measure_axis(state.elevation, constants.elevation, drives, scales, 1)
    read(records)
    if record.link.stamp != NO_STAMP and outputs.invalid_command:
        record.link.invalid = rate_drive.INVALID_COMMAND
    record.link.stamp = stamp
    rate_drive.encode_measured(outputs, stamp, messages)


@compiled
def _moves_out(commanded: RadiansPerSecond, measured: RadiansPerSecond) -> bool:
    return commanded > faults.MIN_OUTWARD_RATE_RAD_S or measured > MAX_RATE_OF_LASH_RAD_S


@compiled
def _note_faults(of_axis: axis_control.State, drives: Drives, scales: Scales, number: int, phase: int) -> None:
    for motor in range(2):
        drive = 2 * number + motor
        drives.reset_left[drive] = max(drives.reset_left[drive] - 1, 0)
        # The reset may include a reset of the communication, during which the drive reports nothing.
        of_axis.motor_lost[motor] = drives.age[drive] > scales.lost_periods and drives.reset_left[drive] == 0
        if drives.age[drive] != 0:
            continue
        state = drives.state[drive]
        if state == cia402.State.FAULT or state == cia402.State.FAULT_REACTION_ACTIVE:
            drives.been_up[drive] = 0
            if drives.reset_left[drive] == 0:
                of_axis.faults |= errors.fault_of(drives.error[drive], motor)
        elif drives.ready[drive]:
            drives.reset_left[drive] = 0
        # The switches belong to the directions of the drive. A reversed motor exchanges those of the axis.
        sign = -1.0 if scales.position[drive] < 0.0 else 1.0
        commanded, measured = sign * of_axis.rate, sign * drives.rate[number]
        if drives.inputs[drive] & INPUT_POSITIVE_LIMIT and _moves_out(commanded, measured) or (
                drives.inputs[drive] & INPUT_NEGATIVE_LIMIT and _moves_out(-commanded, -measured)):
            of_axis.faults |= faults.Bit.FINAL_LIMIT
            of_axis.present |= faults.Bit.FINAL_LIMIT
        if phase != drive_state.PHASE_ENABLED and phase != drive_state.PHASE_RELEASING_BRAKES:
            drives.away[drive] = drives.been_up[drive] = 0
        elif state == cia402.State.OPERATION_ENABLED:
            drives.away[drive], drives.been_up[drive] = 0, phase == drive_state.PHASE_ENABLED
        else:
            drives.away[drive] += 1
            if drives.away[drive] > (MAX_AWAY_PERIODS if drives.been_up[drive] else scales.enable_periods):
                of_axis.faults |= _lost_bit(motor)
    if scales.control == CONTROL_DRIVE and (of_axis.faults & faults.Bit.MOTOR_1_LOST or of_axis.motor_lost[0]):
        of_axis.faults |= faults.Bit.MOTOR_2_LOST     # motor 2 has no speed loop of its own


@compiled
def _is_up(of_axis: axis_control.State, drives: Drives, number: int, periods: int) -> bool:
    """Return True if every drive of an axis that is not lost is enabled by a report of at most this age."""
    for motor in range(2):
        drive = 2 * number + motor
        enabled = drives.age[drive] <= periods and drives.state[drive] == cia402.State.OPERATION_ENABLED
        if not of_axis.faults & _lost_bit(motor) and not enabled:
            return False
    return True


@compiled
def _goal(state: drive_state.State, of_axis: axis_control.State, drives: Drives, scales: Scales, drive: int) -> int:
    if of_axis.faults & _lost_bit(drive % 2) or faults.removes_torque(of_axis.faults):
        return cia402.GOAL_OFF
    if state.phase == drive_state.PHASE_DISABLED:
        # A drive closes its brake at standstill, after a quick stop later than the phases state. It then leaves by
        # itself.
        leaves = (drives.controlword[drive] == cia402.COMMAND_SWITCH_ON
                  and drives.state[drive] == cia402.State.OPERATION_ENABLED)
        return cia402.GOAL_SWITCHED_ON if leaves and state.age < scales.leave_periods else cia402.GOAL_OFF
    if state.phase == drive_state.PHASE_ENGAGING_BRAKES:
        return cia402.GOAL_SWITCHED_ON
    if state.phase == drive_state.PHASE_STOPPING and state.emergency:
        return cia402.GOAL_QUICK_STOP
    return cia402.GOAL_ENABLED


@compiled
def _demanded_torque(state: drive_state.State, of_axis: axis_control.State, constants: axis_control.Constants,
                     drives: Drives, scales: Scales, drive: int) -> NewtonMeters:
    number, motor = drive // 2, drive % 2
    demanded = of_axis.motor_1.torque_ref if motor == 0 else of_axis.motor_2.torque_ref
    if scales.control == CONTROL_TORQUE:
        return demanded
    if scales.control == CONTROL_VELOCITY:
        omega = axis_control.mean_motor_speed(of_axis, of_axis.motor_1.measured, of_axis.motor_2.measured)
        return demanded - constants.K_p * (constants.N * of_axis.rate - omega)
    if motor == 1:
        return drives.followed[number] - 2.0 * of_axis.bias
    if not state.following or of_axis.ramping or of_axis.end_stop:
        return 0.0
    return of_axis.commanded_torque * constants.per_2N * (2.0 if of_axis.faults & faults.Bit.MOTOR_2_LOST else 1.0)


@compiled
def _controlword(state: drive_state.State, drives: Drives, drive: int, goal: int) -> int:
    if drives.reset_left[drive] and drives.state[drive] == cia402.State.FAULT:
        # The rising edge resets the fault.
        word = cia402.CONTROL_RESET if drives.controlword[drive] & cia402.CONTROL_RESET == 0 else 0
    else:
        word = cia402.controlword(drives.state[drive], goal)
    if goal == cia402.GOAL_ENABLED and (state.phase == drive_state.PHASE_RELEASING_BRAKES or drives.held[drive // 2]):
        word |= cia402.CONTROL_HALT
    return word


@compiled
def _command_drive(state: drive_state.State, of_axis: axis_control.State, constants: axis_control.Constants,
                   drives: Drives, scales: Scales, drive: int, alive: bool, kept: bool) -> None:
    """Write the command of a drive. alive: True if the axis is under control; kept: True if the torque keeps its last
    value. Otherwise the command is 0."""
    goal = _goal(state, of_axis, drives, scales, drive)
    drives.controlword[drive] = _controlword(state, drives, drive, goal)
    if goal != cia402.GOAL_ENABLED or not (alive or kept):
        drives.target[drive], drives.offset[drive] = 0, 0
        return
    drives.target[drive] = _whole(constants.N * of_axis.rate / scales.velocity[drive], 2.0 ** 31 - 1.0)
    if alive:
        torque = _demanded_torque(state, of_axis, constants, drives, scales, drive)
        drives.offset[drive] = _whole(torque / scales.torque[drive], 2.0 ** 15 - 1.0)


@compiled
def _keep_rate(of_axis: axis_control.State, constants: axis_control.Constants, drives: Drives, scales: Scales,
               number: int) -> None:
    """Advance the angle of an axis by a period without reports, and keep its rate, reduced before an end of travel."""
    drives.angle[number] += of_axis.rate / scales.per_period
    angle = drives.angle[number]
    down = max(loops.approach_rate(angle - constants.lower, constants.K, constants.a), 0.0)
    up = max(loops.approach_rate(constants.upper - angle, constants.K, constants.a), 0.0)
    of_axis.rate = min(max(of_axis.rate, -down), up)


@compiled
def _whole(x: float, largest: float) -> int:
    return int(math.floor(min(max(x, -largest), largest) + 0.5))


@compiled
def _control_axis(state: drive_state.State, of_axis: axis_control.State, constants: axis_control.Constants,
                  drives: Drives, scales: Scales, number: int) -> None:
    motor_1, motor_2 = of_axis.motor_1, of_axis.motor_2
    first, second = 2 * number, 2 * number + 1
    _note_faults(of_axis, drives, scales, number, state.phase)
    # In the phase before, the drives hold the motors by themselves.
    alive = _is_up(of_axis, drives, number, 1) and state.phase < drive_state.PHASE_DISABLED
    # Without new reports the axis keeps its last command, until a report arrives or a motor is lost.
    kept = (not alive and _is_up(of_axis, drives, number, scales.lost_periods)
            and state.phase < drive_state.PHASE_DISABLED)
    motor_1.limited = 1 if drives.status[first] & cia402.STATUS_LIMIT else 0
    motor_2.limited = 1 if drives.status[second] & cia402.STATUS_LIMIT else 0
    made = 0.5 * constants.motor_1.K_t_hat * (motor_1.i_q + motor_2.i_q)
    if scales.control == CONTROL_TORQUE:
        # A single motor gets the torque of both. With the whole gain it would oscillate at the delay of this node.
        share = 0.5 if of_axis.faults & faults.MOTORS_LOST_BITS else 1.0
        constants.K_p, constants.K_iT = share * scales.K_p[number], share * scales.K_iT[number]
    if alive and drives.held[number]:
        # The drives have stopped the axis meanwhile: the law begins at its rate, and ramps to the command.
        of_axis.rate = constants.per_N * axis_control.mean_motor_speed(of_axis, motor_1.measured, motor_2.measured)
        of_axis.ramping = 1
        drives.held[number] = 0
    if kept:
        _keep_rate(of_axis, constants, drives, scales, number)
        blind = max(drives.age[first], drives.age[second]) > scales.blind_periods
        drives.held[number] |= 1 if scales.control == CONTROL_TORQUE and blind else 0
    else:
        feed_forward = of_axis.commanded_torque
        if scales.control == CONTROL_DRIVE:
            # The demand that fades the bias is the torque that the drives make.
            motor_1.sum, motor_2.sum, feed_forward = made, made, 0.0
            torque_1 = constants.motor_1.K_t_hat * motor_1.i_q
            drives.followed[number] += scales.follow_gain * (torque_1 - drives.followed[number])
        axis_control.control(of_axis, constants, axis_control.counts(of_axis.theta, constants.per_rad), made,
                             of_axis.commanded_rate, feed_forward, state.following, alive, not state.braked)
    for drive in (first, second):
        _command_drive(state, of_axis, constants, drives, scales, drive, alive, kept)


@compiled
def control(records: Records, stamp: Nanoseconds, messages: AnyRecord) -> None:
    """Compute the commands of the drives from their last reports and the messages of the step before.

    A record itself as argument would cost 90 us, because numba would examine all its fields in each call. stamp: time
    of the coming exchange.
    """
    record = records[0]
    state, constants, inputs, outputs = record.state, record.constants, record.inputs, record.outputs
    drives, scales = record.drives, record.scales
    if record.link.stamp == NO_STAMP:
        state.k = stamp // record.link.period
    else:
        rate_drive.take_command(inputs, record.link, messages[rate_drive.RATE_COMMAND_TOPIC])
    outputs.invalid_command = 0 if drive_state.receive_command(state, inputs, True) else 1
    if drives.interlock:
        state.emergency = 1
    up = _is_up(state.azimuth, drives, 0, 1) and _is_up(state.elevation, drives, 1, 1)
    state.braked = drive_state.advance(state, constants, inputs.pins, up)
    axis_control.begin_period(state.azimuth)
    axis_control.begin_period(state.elevation)
    drive_state.apply_command(state, constants, inputs, 0)
    _control_axis(state, state.azimuth, constants.azimuth, drives, scales, 0)
    _control_axis(state, state.elevation, constants.elevation, drives, scales, 1)
    state.k += 1
