"""Injected faults of the drive and its plant: their effects on the record and the messages of a drive.

Argument m is the record of a drive (unit.Record), s the state of one axis.
"""

from adu_drive import axis
from pedestal_common.codes import codes
from pedestal_common.compiled import compiled
from pedestal_common.injection import message_faults, schedule, table
from pedestal_common.quantities import Pair
from pedestal_common.record import Record

DRIVE_MESSAGE_FAULT_CODES = message_faults.codes('adu')
Fault = codes([fault.name for fault in table.INJECTED_FAULTS['adu']])

STUCK_BRAKE_CONDITIONS = axis.BRAKE_STUCK_ON, axis.BRAKE_STUCK_OFF
"""Conditions of a stuck brake, in the order of the choices of the fault `brake_stuck`."""


class DriveInjected(Record):
    """Active faults of messages."""
    bias: Pair  # bias of the rates in joint_states [rad/s]
    # fault of joint_states and, for a frozen drive, of adu/motor_states; its field `drop` is 1 while commands are lost
    message_fault: message_faults.MessageFault


JOINT_STATES_TOPIC, MOTOR_STATES_TOPIC = 'joint_states', 'adu/motor_states'


@compiled
def _clear_faults(s):
    """Clear the injected faults of an axis."""
    s.motor_lost[0] = s.motor_lost[1] = s.stuck = s.toothless = 0
    s.jump = s.gust = s.teeth[0] = s.teeth[1] = 0.0
    s.brake_stuck = axis.BRAKE_WORKING


@compiled
def _apply_fault(m, fault, values):
    """Apply a fault to the record of the drive.

    values: the arguments of the fault in the order of its row of table.INJECTED_FAULTS. The first argument is the
    axis, except for faults of the whole drive, such as `delay`.
    """
    i = int(values[0])
    s, c = (m.state.azimuth, m.constants.azimuth) if i == 0 else (m.state.elevation, m.constants.elevation)
    message_faults.apply(m.injected.message_fault, DRIVE_MESSAGE_FAULT_CODES, fault, values)
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
        m.state.pins.stuck[i] = 1
    elif fault == Fault.DELAY:
        m.state.late_ticks = round(values[0] / m.constants.period * m.constants.speed_ticks)
    elif fault == Fault.BIAS:
        m.injected.bias[i] += values[1]


@compiled
def apply_due_faults(m, stamp):
    """Clear all faults, then apply the faults that are active at a stamp [ns]."""
    e = m.injected
    _clear_faults(m.state.azimuth)
    _clear_faults(m.state.elevation)
    message_faults.clear(e.message_fault)
    m.state.late_ticks = m.state.pins.stuck[0] = m.state.pins.stuck[1] = 0
    e.bias[0] = e.bias[1] = 0.0
    schedule.begin(m.schedule)
    for i in range(schedule.MAX_ACTIVE_FAULTS):
        row = m.schedule.row[i]
        if schedule.in_force(m.schedule, row, stamp):
            _apply_fault(m, row.fault, row.values)


@compiled
def corrupt_messages(e, stamp, outputs):
    """Apply the active message faults e (DriveInjected) to the messages of a step at a stamp [ns].

    A frozen drive repeats 18 stored numbers. The last argument of message_faults.numbers is the index of the first
    one.
    """
    joints, motors = outputs[JOINT_STATES_TOPIC], outputs[MOTOR_STATES_TOPIC]
    for i in range(2):
        joints.velocity[i] += e.bias[i]
        if e.message_fault.sigma > 0.0:
            joints.position[i] += message_faults.noise(e.message_fault, stamp, i)
    message_faults.numbers(e.message_fault, joints.position, 0)
    message_faults.numbers(e.message_fault, joints.velocity, 2)
    message_faults.numbers(e.message_fault, joints.effort, 4)
    if e.message_fault.freeze != 0:
        message_faults.numbers(e.message_fault, motors.position, 6)
        message_faults.numbers(e.message_fault, motors.velocity, 10)
        message_faults.numbers(e.message_fault, motors.effort, 14)
