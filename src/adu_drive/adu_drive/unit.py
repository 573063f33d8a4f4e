"""The drive unit between its messages: what it makes of those it hears, and what it puts into those it says.

The node takes one step at a time, a recomputed bag all of them at once, through the same `say` and `advance`.
"""
import math

import numpy as np

from adu_drive import drive_state, drive_unit
from pedestal_common import messages, records
from pedestal_common.compiled import compiled
from pedestal_common.records import NEVER

CLOCK, COMMAND, SHIP, JOINTS, MOTORS = 'clock', 'acu/rate_command', 'ship/truth', 'joint_states', 'adu/motor_states'
STATE = 'adu/state'
HEARD, SAID = records.of(JOINTS, COMMAND, SHIP), records.of(JOINTS, CLOCK, MOTORS, more=(STATE,))
"""The joint states it hears are its own, of which it takes the stamp: t_k of the step that follows."""

MEMORY = np.dtype([('command_stamp', 'i8'), ('truth_stamp', 'i8'), ('deck_rate', 'f8', (3,)), ('timeout', 'i8'),
                   ('begun', 'i8')])
"""Stamps of the last command and of the last truth with a finite rate (FLU, rad/s); age at which a command is stale
[ns]; answers: 1 once the first step was said."""


class Adu:
    """The drive of an AduNodeParameters; on_ship: it hears how its deck turns.

    heard, said: the records (1,) of one step; messages: {topic: message} it says; followers: {topic: latency [s]} that
    a step waits for; WORDS: {topic: function from its code in `said` to its text}; SERVICES: what it can be asked for.
    """
    HEARD, SAID, WORDS, COMMAND = HEARD, SAID, {STATE: drive_state.described}, COMMAND
    SERVICES = tuple(drive_state.REQUESTS)

    def __init__(self, params, on_ship):
        self.constants, self.state = drive_unit.constants(params), drive_unit.initial_state(params)
        self.inputs, self.outputs = np.zeros(1, drive_unit.INPUTS), np.zeros(1, drive_unit.OUTPUTS)
        drive_unit.read(self.state, self.constants, self.outputs)
        self.memory = np.zeros(1, MEMORY)
        self.memory['command_stamp'] = self.memory['truth_stamp'] = NEVER
        self.memory['timeout'] = round(params.command_timeout * params.period * 1e9)
        self.heard, self.said, self.last = np.zeros(1, HEARD), np.zeros(1, SAID), np.zeros(1, HEARD)
        self.remembers = self.state, self.inputs, self.outputs, self.memory, self.last
        self.messages = {JOINTS: messages.joint_state(messages.AXES), MOTORS: messages.joint_state(messages.MOTORS),
                         CLOCK: messages.Clock(clock=messages.Time(sec=0, nanosec=0))}
        self.followers = {COMMAND: 0.0, **({SHIP: 0.0} if on_ship else {})}
        self.events = {}

    def prepare(self):
        """Compile `say`, `advance` and `ask`."""
        state, outputs = self.state.copy(), self.outputs.copy()
        say(outputs, self.heard, self.said.copy())
        advance(state, self.constants, self.inputs.copy(), outputs, self.memory.copy(), self.heard)
        drive_unit.request(state, self.constants, outputs, drive_state.DISABLE)

    def say(self):
        """Put what is at the stamp of `heard` into `said`."""
        say(self.outputs, self.heard, self.said)

    def advance(self):
        """One period on from the stamp of `heard`, obeying it; whether the command in force is stale."""
        return advance(self.state, self.constants, self.inputs, self.outputs, self.memory, self.heard)

    def condition(self):
        """The text of adu/state as it is now, also between two steps."""
        return drive_state.described(int(self.outputs[0]['condition']))

    def refusal(self, service):
        """Ask for one of SERVICES between two steps: '' when granted, else why not."""
        answer = drive_unit.request(self.state, self.constants, self.outputs, drive_state.REQUESTS[service])
        return '' if answer == drive_state.GRANTED else drive_state.REFUSALS[answer]

    def request(self, service):
        """The same; True when granted."""
        return not self.refusal(service)

    def services_to(self, text):
        """The services that bring adu/state to a text."""
        o = self.outputs[0]
        tripped, stopped = 'fault' in text, 'emergency stop' in text
        latched = o['emergency'] or o['azimuth']['faults'] | o['elevation']['faults']
        wanted = {'adu/emergency_stop': stopped and not o['emergency'],
                  'adu/reset_faults': latched and not tripped and not stopped,
                  'adu/disable': text in ('stopping', 'disabled') and o['wanted'],
                  'adu/enable': text in ('releasing brakes', 'enabled') and not o['wanted']}
        return [service for service, due in wanted.items() if due]

    def answers(self, heard, said):
        """Many steps, records (n,): `advance` by what was heard last, then `say`."""
        answers(self.state, self.constants, self.inputs, self.outputs, self.memory, self.last, heard, said)


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
    said[0][STATE] = y.condition


@compiled
def hear(u, m, stamp, command, ship):
    """Records of the messages of a step -> inputs of the drive; whether the command in force is stale."""
    if command.stamp != NEVER:
        m.command_stamp = command.stamp
        u.azimuth.rate, u.elevation.rate = command.velocity[0], command.velocity[1]
        u.azimuth.torque, u.elevation.torque = command.effort[0], command.effort[1]
    stale = m.command_stamp == NEVER or stamp - m.command_stamp > m.timeout
    u.enable = 0 if stale else 1
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
def answers(state, constants, inputs, outputs, memory, last, heard, said):
    """Step by step; what is asked for before heard[k] comes between the answer to heard[k - 1] and the next."""
    for k in range(len(heard)):
        if memory[0].begun:
            advance(state, constants, inputs, outputs, memory, last)
        say(outputs, heard[k:k + 1], said[k:k + 1])
        last[0] = heard[k]
        memory[0].begun = 1
