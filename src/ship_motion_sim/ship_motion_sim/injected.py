"""The faults that can be injected into IMU and INS: what each of them breaks."""
import numpy as np

from pedestal_common.compiled import compiled
from pedestal_common.geometry.line_of_sight import quaternion
from pedestal_common.geometry.quaternion import product
from pedestal_common.graph.steps import SECOND
from pedestal_common.injection import schedule, spoil, table
from pedestal_common.wire.records import NEVER

IMU_MESSAGES, INS_MESSAGES = spoil.codes('ship_motion'), spoil.codes('ins')
IMU_BIAS = table.code('ship_motion', 'bias')
DELAY, BIAS, JUMP, CLOCK_STEP = (table.code('ins', name) for name in ('delay', 'bias', 'ins_jump', 'clock_step'))

IMU = np.dtype([('rate', 'f8', (3,)), ('force', 'f8', (3,)), ('said', spoil.SPOILT)], align=True)
"""rate [rad/s], force [m/s2]: added to what it feels, FLU; said: what spoils it."""

INS = np.dtype([('latency_ns', 'i8'), ('clock_ns', 'i8'), ('rate', 'f8', (3,)), ('turn', 'f8', (3,)),
                ('said', spoil.SPOILT)], align=True)
"""latency_ns: of the INS when nothing is broken; clock_ns: added to its stamps; rate:
added to the deck rate, FLU [rad/s]; turn: roll, pitch and yaw added to its attitude [rad]; said: what spoils it."""

RAW, DATA, CHANGES = 'ship/imu/data_raw', 'ship/imu/data', 'ins/error'


def initial(latency_ns) -> np.ndarray:
    """INS (1,) of a latency [ns]: nothing is broken."""
    e = np.zeros(1, INS)
    e['latency_ns'] = latency_ns
    return e


@compiled
def turned(q, roll, pitch, yaw):
    """Quaternion (x, y, z, w) of a deck of attitude q (4,) that is turned by roll and pitch about its own axes and by
    yaw about the vertical [rad]."""
    return product(quaternion(0.0, 0.0, yaw), product(q, quaternion(roll, pitch, 0.0)))


@compiled
def take_imu(m, stamp):
    """Mend the IMU, then break what is broken in the step of a stamp [ns]; m: ship_unit.RECORD."""
    e = m.injected
    for i in range(3):
        e.rate[i] = e.force[i] = 0.0
    spoil.restore(e.said)
    schedule.begin(m.schedule)
    for i in range(schedule.SLOTS):
        row = m.schedule.row[i]
        if schedule.in_force(m.schedule, row, stamp):
            _break_imu(e, row.fault, row.values)


@compiled
def _break_imu(e, fault, values):
    spoil.apply(e.said, IMU_MESSAGES, fault, values)
    if fault == IMU_BIAS:
        e.rate[int(values[0])] += values[1]
        e.force[int(values[0])] += values[2]


@compiled
def spoil_imu(e, stamp, outputs):
    """What the IMU says of a step, spoilt."""
    raw = outputs[RAW]
    for i in range(3):
        raw.angular_velocity[i] += e.rate[i]
        raw.linear_acceleration[i] += e.force[i]
        if e.said.sigma > 0.0:
            raw.angular_velocity[i] += spoil.noise(e.said, stamp, i)
    spoil.numbers(e.said, raw.angular_velocity, 0)
    spoil.numbers(e.said, raw.linear_acceleration, 3)
    if e.said.drop != 0:
        raw.stamp = NEVER


@compiled
def take_ins(m, stamp):
    """Mend the INS, then break what is broken in the step of a stamp [ns]; m: record of ins_unit."""
    e = m.injected
    m.constants.latency_ns = e.latency_ns
    e.clock_ns = 0
    for i in range(3):
        e.rate[i] = e.turn[i] = 0.0
    spoil.restore(e.said)
    schedule.begin(m.schedule)
    for i in range(schedule.SLOTS):
        row = m.schedule.row[i]
        if schedule.in_force(m.schedule, row, stamp):
            _break_ins(m.constants, e, row.fault, row.values)


@compiled
def _break_ins(c, e, fault, values):
    spoil.apply(e.said, INS_MESSAGES, fault, values)
    if fault == DELAY:
        c.latency_ns += round(values[0] * SECOND)
    elif fault == BIAS:
        e.rate[int(values[0])] += values[1]
    elif fault == JUMP:
        e.turn[0] += values[0]
        e.turn[1] += values[1]
        e.turn[2] -= values[2]      # heading grows clockwise
    elif fault == CLOCK_STEP:
        e.clock_ns += round(values[0] * SECOND)


@compiled
def spoil_ins(e, stamp, outputs):
    """What the INS says of a step, spoilt."""
    data = outputs[DATA]
    roll, pitch, yaw = e.turn[0], e.turn[1], e.turn[2]
    if e.said.sigma > 0.0:
        roll += spoil.noise(e.said, stamp, 0)
        pitch += spoil.noise(e.said, stamp, 1)
        yaw += spoil.noise(e.said, stamp, 2)
    q = turned(data.orientation, roll, pitch, yaw)
    for i in range(4):
        data.orientation[i] = q[i]
    for i in range(3):
        data.angular_velocity[i] += e.rate[i]
    spoil.numbers(e.said, data.orientation, 0)
    spoil.numbers(e.said, data.angular_velocity, 4)
    if data.stamp != NEVER:
        data.stamp = NEVER if e.said.drop != 0 else data.stamp + e.clock_ns
    if outputs[CHANGES].stamp != NEVER:
        outputs[CHANGES].stamp = data.stamp
