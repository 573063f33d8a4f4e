"""Injected faults of IMU and INS: their effects on the records and messages of both units."""
from typing import Protocol

from pedestal_common.compiled import compiled
from pedestal_common.geometry.line_of_sight import quaternion
from pedestal_common.geometry.quaternion import product
from pedestal_common.graph.steps import NS_PER_SECOND
from pedestal_common.injection import message_faults, schedule, table
from pedestal_common.quantities import AnyRecord, Floats, Nanoseconds, Quaternion, Radians, Records, Vector3
from pedestal_common.record import Record
from pedestal_common.wire.records import NO_STAMP
from ship_motion_sim import ins

IMU_MESSAGE_FAULT_CODES, INS_MESSAGE_FAULT_CODES = message_faults.codes('ship_motion'), message_faults.codes('ins')
IMU_BIAS_CODE = table.code('ship_motion', 'bias')
INS_DELAY_CODE, INS_BIAS_CODE, INS_JUMP_CODE, INS_CLOCK_STEP_CODE = (
    table.code('ins', name) for name in ('delay', 'bias', 'ins_jump', 'clock_step'))


class ImuInjected(Record):
    """Faults of the IMU in force."""
    rate: Vector3               # offset of its rate, FLU [rad/s]
    force: Vector3              # offset of its specific force, FLU [m/s2]
    message_fault: message_faults.MessageFault


class InsInjected(Record):
    """Faults of the INS in force."""
    latency_ns: Nanoseconds     # without a fault
    clock_ns: Nanoseconds       # offset of the stamps
    rate: Vector3               # offset of the deck rate, FLU [rad/s]
    turn: Vector3               # roll, pitch and yaw added to the attitude [rad]
    message_fault: message_faults.MessageFault


class FaultyImu(Protocol):
    """Record of an IMU with injected faults."""
    schedule: schedule.Schedule
    injected: ImuInjected


class FaultyIns(Protocol):
    """Record of an INS with injected faults."""
    schedule: schedule.Schedule
    injected: InsInjected

    @property
    def constants(self) -> ins.LateIns:
        """Constants, whose latency a fault changes."""


IMU_RAW_TOPIC, ATTITUDE_TOPIC, INS_ERROR_TOPIC = 'ship/imu/data_raw', 'ship/imu/data', 'ins/error'


def initial(latency_ns: Nanoseconds) -> Records:
    """Return the InsInjected (1,) without a fault."""
    return InsInjected.of(latency_ns=latency_ns)


@compiled
def turned(q: Quaternion, roll: Radians, pitch: Radians, yaw: Radians) -> tuple[float, float, float, float]:
    """Return the quaternion (x, y, z, w) of a deck of attitude q, turned by roll and pitch about the deck axes and by
    yaw about the vertical."""
    return product(quaternion(0.0, 0.0, yaw), product(q, quaternion(roll, pitch, 0.0)))


@compiled
def apply_due_imu_faults(imu: FaultyImu, stamp: Nanoseconds) -> None:
    """Clear all faults of the IMU, then apply those in force at a stamp."""
    faults = imu.injected
    for i in range(3):
        faults.rate[i] = faults.force[i] = 0.0
    message_faults.clear(faults.message_fault)
    schedule.begin(imu.schedule)
    for i in range(schedule.MAX_ACTIVE_FAULTS):
        row = imu.schedule.row[i]
        if schedule.in_force(imu.schedule, row, stamp):
            _apply_imu_fault(faults, row.fault, row.values)


@compiled
def _apply_imu_fault(faults: ImuInjected, fault: int, values: Floats) -> None:
    message_faults.apply(faults.message_fault, IMU_MESSAGE_FAULT_CODES, fault, values)
    if fault == IMU_BIAS_CODE:
        faults.rate[int(values[0])] += values[1]
        faults.force[int(values[0])] += values[2]


@compiled
def corrupt_imu(faults: ImuInjected, stamp: Nanoseconds, outputs: AnyRecord) -> None:
    """Corrupt the IMU message of a step."""
    raw = outputs[IMU_RAW_TOPIC]
    for i in range(3):
        raw.angular_velocity[i] += faults.rate[i]
        raw.linear_acceleration[i] += faults.force[i]
        if faults.message_fault.sigma > 0.0:
            raw.angular_velocity[i] += message_faults.noise(faults.message_fault, stamp, i)
    # Each number of a message has an index, at which a freeze stores it: rates 0 to 2, forces 3 to 5.
    message_faults.numbers(faults.message_fault, raw.angular_velocity, 0)
    message_faults.numbers(faults.message_fault, raw.linear_acceleration, 3)
    if faults.message_fault.drop != 0:
        raw.stamp = NO_STAMP


@compiled
def apply_due_ins_faults(unit: FaultyIns, stamp: Nanoseconds) -> None:
    """Clear all faults of the INS, then apply those in force at a stamp."""
    faults = unit.injected
    unit.constants.latency_ns = faults.latency_ns
    faults.clock_ns = 0
    for i in range(3):
        faults.rate[i] = faults.turn[i] = 0.0
    message_faults.clear(faults.message_fault)
    schedule.begin(unit.schedule)
    for i in range(schedule.MAX_ACTIVE_FAULTS):
        row = unit.schedule.row[i]
        if schedule.in_force(unit.schedule, row, stamp):
            _apply_ins_fault(unit.constants, faults, row.fault, row.values)


@compiled
def _apply_ins_fault(constants: ins.LateIns, faults: InsInjected, fault: int, values: Floats) -> None:
    message_faults.apply(faults.message_fault, INS_MESSAGE_FAULT_CODES, fault, values)
    if fault == INS_DELAY_CODE:
        constants.latency_ns += round(values[0] * NS_PER_SECOND)
    elif fault == INS_BIAS_CODE:
        faults.rate[int(values[0])] += values[1]
    elif fault == INS_JUMP_CODE:
        faults.turn[0] += values[0]
        faults.turn[1] += values[1]
        faults.turn[2] -= values[2]      # A heading grows clockwise, yaw counterclockwise.
    elif fault == INS_CLOCK_STEP_CODE:
        faults.clock_ns += round(values[0] * NS_PER_SECOND)


@compiled
def corrupt_ins(faults: InsInjected, stamp: Nanoseconds, outputs: AnyRecord) -> None:
    """Corrupt the messages of the INS of a step."""
    data = outputs[ATTITUDE_TOPIC]
    roll, pitch, yaw = faults.turn[0], faults.turn[1], faults.turn[2]
    if faults.message_fault.sigma > 0.0:
        roll += message_faults.noise(faults.message_fault, stamp, 0)
        pitch += message_faults.noise(faults.message_fault, stamp, 1)
        yaw += message_faults.noise(faults.message_fault, stamp, 2)
    q = turned(data.orientation, roll, pitch, yaw)
    for i in range(4):
        data.orientation[i] = q[i]
    for i in range(3):
        data.angular_velocity[i] += faults.rate[i]
    # Indices at which a freeze stores the numbers: orientation 0 to 3, rates 4 to 6.
    message_faults.numbers(faults.message_fault, data.orientation, 0)
    message_faults.numbers(faults.message_fault, data.angular_velocity, 4)
    if data.stamp != NO_STAMP:
        data.stamp = NO_STAMP if faults.message_fault.drop != 0 else data.stamp + faults.clock_ns
    if outputs[INS_ERROR_TOPIC].stamp != NO_STAMP:
        outputs[INS_ERROR_TOPIC].stamp = data.stamp
