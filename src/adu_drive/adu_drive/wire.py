"""The drive unit between its messages: what it makes of those it hears, and what it puts into those it says.

The node takes one step at a time, a recomputed bag all of them at once, through the same `say` and `advance`.
"""
import math

import numpy as np

from adu_drive import drive_unit
from pedestal_common import messages, records
from pedestal_common.compiled import compiled
from pedestal_common.records import NEVER

CLOCK, COMMAND, SHIP, JOINTS, MOTORS = 'clock', 'acu/rate_command', 'ship/truth', 'joint_states', 'adu/motor_states'
HEARD, SAID = records.of(JOINTS, COMMAND, SHIP), records.of(JOINTS, CLOCK, MOTORS)
"""The joint states it hears are its own, of which it takes the stamp: t_k of the step that follows."""

MEMORY = np.dtype([('command_stamp', 'i8'), ('truth_stamp', 'i8'), ('deck_rate', 'f8', (3,)), ('timeout', 'i8'),
                   ('emergency', 'i8')])
"""Stamps of the last command and of the last truth with a finite rate (FLU, rad/s); age at which a command is stale
[ns]; 1 from an emergency stop on."""


class Adu:
    """The drive of an AduNodeParameters; on_ship: it hears how its deck turns.

    heard, said: the records (1,) of one step; messages: {topic: message} it says; followers: {topic: latency [s]} that
    a step waits for.
    """
    HEARD, SAID, CODES = HEARD, SAID, {}

    def __init__(self, params, on_ship):
        self.constants, self.state = drive_unit.constants(params), drive_unit.initial_state(params)
        self.inputs, self.outputs = np.zeros(1, drive_unit.INPUTS), np.zeros(1, drive_unit.OUTPUTS)
        drive_unit.read(self.state, self.constants, self.outputs)
        self.memory = np.zeros(1, MEMORY)
        self.memory['command_stamp'] = self.memory['truth_stamp'] = NEVER
        self.memory['timeout'] = round(params.command_timeout * params.period * 1e9)
        self.heard, self.said = np.zeros(1, HEARD), np.zeros(1, SAID)
        self.messages = {JOINTS: messages.joint_state(messages.AXES), MOTORS: messages.joint_state(messages.MOTORS),
                         CLOCK: messages.Clock(clock=messages.Time(sec=0, nanosec=0))}
        self.followers = {COMMAND: 0.0, **({SHIP: 0.0} if on_ship else {})}
        self.events = {}

    def prepare(self):
        """Compile `say` and `advance`."""
        say(self.outputs, self.heard, self.said.copy())
        advance(self.state.copy(), self.constants, self.inputs.copy(), self.outputs.copy(), self.memory.copy(),
                self.heard)

    def say(self):
        """Put what is at the stamp of `heard` into `said`."""
        say(self.outputs, self.heard, self.said)

    def advance(self):
        """One period on from the stamp of `heard`, obeying it; whether the command in force is stale."""
        return advance(self.state, self.constants, self.inputs, self.outputs, self.memory, self.heard)

    def answers(self, heard, said):
        """Both for many steps, records (n,)."""
        answers(self.state, self.constants, self.inputs, self.outputs, self.memory, heard, said)


@compiled
def say(outputs, heard, said):
    """Outputs of the drive -> records of its messages."""
    y, joints, motors = outputs[0], said[0][JOINTS], said[0][MOTORS]
    joints.stamp = motors.stamp = said[0][CLOCK].stamp = heard[0][JOINTS].stamp
    for i in range(2):
        axis = y.azimuth if i == 0 else y.elevation
        joints.position[i], joints.velocity[i], joints.effort[i] = axis.position, axis.velocity, axis.torque
        for j in range(2):
            motors.position[2 * i + j] = axis.motor_position[j]
            motors.velocity[2 * i + j] = axis.motor_velocity[j]
            motors.effort[2 * i + j] = axis.motor_torque[j]


@compiled
def hear(u, m, stamp, command, ship):
    """Records of the messages of a step -> inputs of the drive; whether the command in force is stale."""
    if command.stamp != NEVER:
        m.command_stamp = command.stamp
        u.azimuth.rate, u.elevation.rate = command.velocity[0], command.velocity[1]
        u.azimuth.torque, u.elevation.torque = command.effort[0], command.effort[1]
    stale = m.command_stamp == NEVER or stamp - m.command_stamp > m.timeout
    u.enable = 0 if stale or m.emergency == 1 else 1
    if ship.stamp != NEVER:
        w, last = ship.twist_angular, m.truth_stamp
        # The deck's angular acceleration, from two successive truths and their stamps.
        if last != NEVER and ship.stamp > last:
            for i in range(3):
                u.base_acceleration[i] = (w[i] - m.deck_rate[i]) / ((ship.stamp - last) * 1e-9)
        if math.isfinite(w[0]) and math.isfinite(w[1]) and math.isfinite(w[2]) and ship.stamp != last:
            m.truth_stamp = ship.stamp
            for i in range(3):
                m.deck_rate[i] = w[i]
    return stale


@compiled
def advance(state, constants, inputs, outputs, memory, heard):
    """From t_k to t_k+1; whether the command in force is stale."""
    h = heard[0]
    stale = hear(inputs[0], memory[0], h[JOINTS].stamp, h[COMMAND], h[SHIP])
    drive_unit.step(state, constants, inputs, outputs)
    return stale


@compiled
def answers(state, constants, inputs, outputs, memory, heard, said):
    for k in range(len(heard)):
        say(outputs, heard[k:k + 1], said[k:k + 1])
        advance(state, constants, inputs, outputs, memory, heard[k:k + 1])
