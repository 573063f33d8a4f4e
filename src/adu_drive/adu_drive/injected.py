"""The faults that can be injected into the drive and its plant: what each of them breaks."""
import numpy as np

from adu_drive import axis
from pedestal_common.compiled import compiled
from pedestal_common.injection import schedule, spoil, table

MESSAGES = spoil.codes('adu')
MOTOR_LOSS, ENCODER_JUMP, ENCODER_STUCK, BRAKE_STUCK, LOST_TOOTH, GUST, PIN_STUCK, DELAY, BIAS = (
    table.code('adu', name) for name in ('motor_loss', 'encoder_jump', 'encoder_stuck', 'brake_stuck', 'lost_tooth',
                                         'gust', 'pin_stuck', 'delay', 'bias'))

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
    if fault == MOTOR_LOSS:
        s.motor_lost[int(values[1])] = 1
    elif fault == ENCODER_JUMP:
        s.jump += round(values[1] * c.per_rad)
    elif fault == ENCODER_STUCK:
        s.stuck = 1
    elif fault == BRAKE_STUCK:
        s.brake_stuck = STUCK[int(values[1])]
    elif fault == LOST_TOOTH:
        s.teeth[int(values[1])], s.toothless = values[2], 1
    elif fault == GUST:
        s.gust += values[1]
    elif fault == PIN_STUCK:
        m.state.pins.stuck[i] = 1
    elif fault == DELAY:
        m.state.late_ticks = round(values[0] / m.constants.period * m.constants.speed_ticks)
    elif fault == BIAS:
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
