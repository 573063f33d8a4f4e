"""The faults that can be injected into the drive and its plant: what each of them breaks."""
import numpy as np

from adu_drive import axis
from pedestal_common.codes import codes
from pedestal_common.compiled import compiled
from pedestal_common.injection import schedule, spoil, table

MESSAGES = spoil.codes('adu')
Fault = codes([fault.name for fault in table.FAULTS['adu']])

STUCK = axis.STUCK_ON, axis.STUCK_OFF
"""By the option of brake_stuck."""

INJECTED = np.dtype([('bias', 'f8', (2,)), ('said', spoil.SPOILT)], align=True)
"""bias: of the rates on joint_states [rad/s]; said: what spoils joint_states and, frozen, adu/motor_states; said.drop
is 1 while no command is heard."""

JOINTS, MOTORS = 'joint_states', 'adu/motor_states'


@compiled
def _mend(s):
    """Nothing of an axis is broken."""
    s.motor_lost[0] = s.motor_lost[1] = s.stuck = s.toothless = 0
    s.jump = s.gust = s.teeth[0] = s.teeth[1] = 0.0
    s.brake_stuck = axis.WORKS


@compiled
def _break(m, fault, values):
    """What a fault does to the records of the drive (unit.RECORD)."""
    i = int(values[0])
    s, c = (m.state.azimuth, m.constants.azimuth) if i == 0 else (m.state.elevation, m.constants.elevation)
    spoil.apply(m.injected.said, MESSAGES, fault, values)
    if fault == Fault.MOTOR_LOSS:
        s.motor_lost[int(values[1])] = 1
    elif fault == Fault.ENCODER_JUMP:
        s.jump += round(values[1] * c.per_rad)
    elif fault == Fault.ENCODER_STUCK:
        s.stuck = 1
    elif fault == Fault.BRAKE_STUCK:
        s.brake_stuck = STUCK[int(values[1])]
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
def take(m, stamp):
    """Mend everything, then break what is broken in the step of a stamp [ns]."""
    e = m.injected
    _mend(m.state.azimuth)
    _mend(m.state.elevation)
    spoil.restore(e.said)
    m.state.late_ticks = m.state.pins.stuck[0] = m.state.pins.stuck[1] = 0
    e.bias[0] = e.bias[1] = 0.0
    schedule.begin(m.schedule)
    for i in range(schedule.SLOTS):
        row = m.schedule.row[i]
        if schedule.in_force(m.schedule, row, stamp):
            _break(m, row.fault, row.values)


@compiled
def spoil_messages(e, stamp, outputs):
    """What the drive says of a step, spoilt."""
    joints, motors = outputs[JOINTS], outputs[MOTORS]
    for i in range(2):
        joints.velocity[i] += e.bias[i]
        if e.said.sigma > 0.0:
            joints.position[i] += spoil.noise(e.said, stamp, i)
    spoil.numbers(e.said, joints.position, 0)
    spoil.numbers(e.said, joints.velocity, 2)
    spoil.numbers(e.said, joints.effort, 4)
    if e.said.freeze != 0:
        spoil.numbers(e.said, motors.position, 6)
        spoil.numbers(e.said, motors.velocity, 10)
        spoil.numbers(e.said, motors.effort, 14)
