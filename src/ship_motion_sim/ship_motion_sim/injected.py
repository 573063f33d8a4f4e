"""Injected faults of IMU and INS: their effects on the records and messages of both units."""
import numpy as np

from pedestal_common.compiled import compiled
from pedestal_common.geometry.line_of_sight import quaternion
from pedestal_common.geometry.quaternion import product
from pedestal_common.graph.steps import NS_PER_SECOND
from pedestal_common.injection import message_faults, schedule, table
from pedestal_common.quantities import Vector3
from pedestal_common.record import Record
from pedestal_common.wire.records import NO_STAMP

IMU_MESSAGE_FAULT_CODES, INS_MESSAGE_FAULT_CODES = message_faults.codes('ship_motion'), message_faults.codes('ins')
IMU_BIAS_CODE = table.code('ship_motion', 'bias')
INS_DELAY_CODE, INS_BIAS_CODE, INS_JUMP_CODE, INS_CLOCK_STEP_CODE = (
    table.code('ins', name) for name in ('delay', 'bias', 'ins_jump', 'clock_step'))


class ImuInjected(Record):
    """Faults of the IMU. rate [rad/s], force [m/s2]: offsets of its data, FLU; message_fault: faults of its messages."""
    rate: Vector3
    force: Vector3
    message_fault: message_faults.MessageFault


class InsInjected(Record):
    """Faults of the INS.

    latency_ns      latency without a fault
        clock_ns        offset of the stamps
        rate            offset of the deck rate, FLU [rad/s]
        turn            roll, pitch and yaw added to the attitude [rad]
        message_fault   faults of the messages
    """
    latency_ns: int
    clock_ns: int
    rate: Vector3
    turn: Vector3
    message_fault: message_faults.MessageFault


IMU_RAW_TOPIC, ATTITUDE_TOPIC, INS_ERROR_TOPIC = 'ship/imu/data_raw', 'ship/imu/data', 'ins/error'


def initial(latency_ns) -> np.ndarray:
    """Return InsInjected (1,) without a fault, for a latency [ns]."""
    e = InsInjected.zeros()
    e['latency_ns'] = latency_ns
    return e


@compiled
def turned(q, roll, pitch, yaw):
    """Return the quaternion (x, y, z, w) of a deck of attitude q (4,), turned by roll and pitch about the deck axes
    and by yaw about the vertical [rad]."""
    return product(quaternion(0.0, 0.0, yaw), product(q, quaternion(roll, pitch, 0.0)))


@compiled
def apply_due_imu_faults(m, stamp):
    """Clear all faults of the IMU, then apply those in force at a stamp [ns]; m: record of ship_unit.Record."""
    e = m.injected
    for i in range(3):
        e.rate[i] = e.force[i] = 0.0
    message_faults.clear(e.message_fault)
    schedule.begin(m.schedule)
    for i in range(schedule.MAX_ACTIVE_FAULTS):
        row = m.schedule.row[i]
        if schedule.in_force(m.schedule, row, stamp):
            _apply_imu_fault(e, row.fault, row.values)


@compiled
def _apply_imu_fault(e, fault, values):
    """Add a fault to the record e of ImuInjected; values: its arguments, in the order of injection/table.py."""
    message_faults.apply(e.message_fault, IMU_MESSAGE_FAULT_CODES, fault, values)
    if fault == IMU_BIAS_CODE:
        e.rate[int(values[0])] += values[1]
        e.force[int(values[0])] += values[2]


@compiled
def corrupt_imu(e, stamp, outputs):
    """Corrupt the IMU message of a step, according to the record e of ImuInjected."""
    raw = outputs[IMU_RAW_TOPIC]
    for i in range(3):
        raw.angular_velocity[i] += e.rate[i]
        raw.linear_acceleration[i] += e.force[i]
        if e.message_fault.sigma > 0.0:
            raw.angular_velocity[i] += message_faults.noise(e.message_fault, stamp, i)
    # Each number of a message has an index, at which a freeze stores it: rates 0 to 2, forces 3 to 5.
    message_faults.numbers(e.message_fault, raw.angular_velocity, 0)
    message_faults.numbers(e.message_fault, raw.linear_acceleration, 3)
    if e.message_fault.drop != 0:
        raw.stamp = NO_STAMP


@compiled
def apply_due_ins_faults(m, stamp):
    """Clear all faults of the INS, then apply those in force at a stamp [ns]; m: record of ins_unit."""
    e = m.injected
    m.constants.latency_ns = e.latency_ns
    e.clock_ns = 0
    for i in range(3):
        e.rate[i] = e.turn[i] = 0.0
    message_faults.clear(e.message_fault)
    schedule.begin(m.schedule)
    for i in range(schedule.MAX_ACTIVE_FAULTS):
        row = m.schedule.row[i]
        if schedule.in_force(m.schedule, row, stamp):
            _apply_ins_fault(m.constants, e, row.fault, row.values)


@compiled
def _apply_ins_fault(c, e, fault, values):
    """Add a fault to the constants c of the INS and to the record e of InsInjected; values: its arguments, in
    the order of injection/table.py."""
    message_faults.apply(e.message_fault, INS_MESSAGE_FAULT_CODES, fault, values)
    if fault == INS_DELAY_CODE:
        c.latency_ns += round(values[0] * NS_PER_SECOND)
    elif fault == INS_BIAS_CODE:
        e.rate[int(values[0])] += values[1]
    elif fault == INS_JUMP_CODE:
        e.turn[0] += values[0]
        e.turn[1] += values[1]
        e.turn[2] -= values[2]      # A heading grows clockwise, yaw counterclockwise.
    elif fault == INS_CLOCK_STEP_CODE:
        e.clock_ns += round(values[0] * NS_PER_SECOND)


@compiled
def corrupt_ins(e, stamp, outputs):
    """Corrupt the messages of the INS of a step, according to the record e of InsInjected."""
    data = outputs[ATTITUDE_TOPIC]
    roll, pitch, yaw = e.turn[0], e.turn[1], e.turn[2]
    if e.message_fault.sigma > 0.0:
        roll += message_faults.noise(e.message_fault, stamp, 0)
        pitch += message_faults.noise(e.message_fault, stamp, 1)
        yaw += message_faults.noise(e.message_fault, stamp, 2)
    q = turned(data.orientation, roll, pitch, yaw)
    for i in range(4):
        data.orientation[i] = q[i]
    for i in range(3):
        data.angular_velocity[i] += e.rate[i]
    # Indices at which a freeze stores the numbers: orientation 0 to 3, rates 4 to 6.
    message_faults.numbers(e.message_fault, data.orientation, 0)
    message_faults.numbers(e.message_fault, data.angular_velocity, 4)
    if data.stamp != NO_STAMP:
        data.stamp = NO_STAMP if e.message_fault.drop != 0 else data.stamp + e.clock_ns
    if outputs[INS_ERROR_TOPIC].stamp != NO_STAMP:
        outputs[INS_ERROR_TOPIC].stamp = data.stamp
