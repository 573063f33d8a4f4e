"""Injected faults of the drive and its plant: their effects on the record and the messages of a drive."""
from typing import Protocol

from adu_drive import axis, drive_unit
from drive_law.rate_drive import JOINT_STATES_TOPIC, MOTOR_STATES_TOPIC
from pedestal_common.codes import codes
from pedestal_common.compiled import compiled
from pedestal_common.injection import message_faults, schedule, table
from pedestal_common.quantities import AnyRecord, Floats, Nanoseconds, Pair
from pedestal_common.record import Record

DRIVE_MESSAGE_FAULT_CODES = message_faults.codes('adu')
Fault = codes([fault.name for fault in table.INJECTED_FAULTS['adu']])

STUCK_BRAKE_CONDITIONS = axis.BRAKE_STUCK_ON, axis.BRAKE_STUCK_OFF
"""Conditions of a stuck brake, in the order of the choices of the fault `brake_stuck`."""


class DriveInjected(Record):
    """Active faults of messages."""
    bias: Pair      # of the rates in joint_states [rad/s]
    # fault of joint_states and, for a frozen drive, of adu/motor_states; its field `drop` is 1 while commands are lost
    message_fault: message_faults.MessageFault


class FaultyDrive(Protocol):
    """Record of a drive with injected faults."""
    state: drive_unit.State
    constants: drive_unit.Constants
    schedule: schedule.Schedule
    injected: DriveInjected


@compiled
def _clear_faults(axis_state: axis.State) -> None:
    axis_state.motor_lost[0] = axis_state.motor_lost[1] = axis_state.stuck = axis_state.toothless = 0
    axis_state.jump = axis_state.gust = axis_state.teeth[0] = axis_state.teeth[1] = 0.0
    axis_state.brake_stuck = axis.BRAKE_WORKING


@compiled
def _apply_fault(drive: FaultyDrive, fault: int, values: Floats) -> None:
    """Apply a fault. values: its arguments in the order of its row of table.INJECTED_FAULTS, the axis first, except
    for a fault of the whole drive."""
    i = int(values[0])
    state, constants = drive.state, drive.constants
    s, c = (state.azimuth, constants.azimuth) if i == 0 else (state.elevation, constants.elevation)
    message_faults.apply(drive.injected.message_fault, DRIVE_MESSAGE_FAULT_CODES, fault, values)
    if fault == Fault.MOTOR_LOSS:
        s.motor_lost[int(values[1])] = 1
    elif fault == Fault.ENCODER_JUMP:
        s.jump += round(values[1] * c.per_rad)
    elif fault == Fault.ENCODER_STUCK:
        s.stuck = 1
    elif fault == Fault.BRAKE_STUCK:
        s.brake_stuck = STUCK_BRAKE_CONDITIONS[int(values[1])]
    elif fault == Fault.LOST_TOOTH:
        s.teeth[int(values[1])], s.toothless = values[2], 1
    elif fault == Fault.GUST:
        s.gust += values[1]
    elif fault == Fault.PIN_STUCK:
        state.pins.stuck[i] = 1
    elif fault == Fault.DELAY:
        state.late_ticks = round(values[0] / constants.period * constants.speed_ticks)
    elif fault == Fault.BIAS:
        drive.injected.bias[i] += values[1]


@compiled
def apply_due_faults(drive: FaultyDrive, stamp: Nanoseconds) -> None:
    """Clear all faults, then apply the faults that are active at a stamp."""
    state, faults = drive.state, drive.injected
    _clear_faults(state.azimuth)
    _clear_faults(state.elevation)
    message_faults.clear(faults.message_fault)
    state.late_ticks = state.pins.stuck[0] = state.pins.stuck[1] = 0
    faults.bias[0] = faults.bias[1] = 0.0
    schedule.begin(drive.schedule)
    for i in range(schedule.MAX_ACTIVE_FAULTS):
        row = drive.schedule.row[i]
        if schedule.in_force(drive.schedule, row, stamp):
            _apply_fault(drive, row.fault, row.values)


@compiled
def corrupt_messages(faults: DriveInjected, stamp: Nanoseconds, outputs: AnyRecord) -> None:
    """Apply the active message faults to the messages of a step. A frozen drive repeats 18 stored numbers. The last
    argument of message_faults.numbers is the index of the first one."""
    joints, motors = outputs[JOINT_STATES_TOPIC], outputs[MOTOR_STATES_TOPIC]
    for i in range(2):
        joints.velocity[i] += faults.bias[i]
        if faults.message_fault.sigma > 0.0:
            joints.position[i] += message_faults.noise(faults.message_fault, stamp, i)
    message_faults.numbers(faults.message_fault, joints.position, 0)
    message_faults.numbers(faults.message_fault, joints.velocity, 2)
    message_faults.numbers(faults.message_fault, joints.effort, 4)
    if faults.message_fault.freeze != 0:
        message_faults.numbers(faults.message_fault, motors.position, 6)
        message_faults.numbers(faults.message_fault, motors.velocity, 10)
        message_faults.numbers(faults.message_fault, motors.effort, 14)
