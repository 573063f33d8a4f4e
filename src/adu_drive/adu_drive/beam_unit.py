"""A beam between its messages: what it makes of those it hears, and what it puts into those it says.

The node takes one step at a time, a recomputed bag all of them at once, through the same `say` and `advance`.
"""
import numpy as np

from adu_drive import electronic_beam
from pedestal_common import messages, records
from pedestal_common.compiled import compiled
from pedestal_common.records import NEVER

CLOCK, COMMAND, JOINTS, STATE = 'clock', 'acu/reference', 'joint_states', 'adu/state'
HEARD, SAID = records.of(JOINTS, COMMAND), records.of(JOINTS, CLOCK, more=(STATE,))
"""The joint states it hears are its own, of which it takes the stamp: t_k of the step that follows."""

ENABLED, DISABLED, EMERGENCY_STOP = range(3)
CONDITIONS = ('enabled', 'disabled', 'emergency stop')

MEMORY = np.dtype([('wanted', 'i8'), ('emergency', 'i8'), ('begun', 'i8')])
"""wanted: 0 when it was asked to be disabled; emergency: 1 while a stop is latched; begun: the first step was said."""


class Beam:
    """One beam of a BeamParameters; attributes as of wire.Adu. It does not feel the ship."""
    HEARD, SAID, WORDS, COMMAND = HEARD, SAID, {STATE: CONDITIONS.__getitem__}, COMMAND
    SERVICES = ('adu/enable', 'adu/disable', 'adu/emergency_stop', 'adu/reset_faults')

    def __init__(self, params, on_ship=False):
        self.constants = electronic_beam.constants(params.period, params.transport_delay,
                                                   params.command_timeout * params.period)
        self.state = electronic_beam.initial_state(params.initial_azimuth, params.initial_elevation)
        self.inputs, self.outputs = np.zeros(1, electronic_beam.INPUTS), np.zeros(1, electronic_beam.OUTPUTS)
        electronic_beam.read(self.state, self.outputs)
        self.memory = np.zeros(1, MEMORY)
        self.memory['wanted'] = 1
        self.heard, self.said, self.last = np.zeros(1, HEARD), np.zeros(1, SAID), np.zeros(1, HEARD)
        self.remembers = self.state, self.inputs, self.outputs, self.memory, self.last
        self.messages = {JOINTS: messages.joint_state(messages.AXES),
                         CLOCK: messages.Clock(clock=messages.Time(sec=0, nanosec=0))}
        self.followers = {COMMAND: 0.0}
        self.events = {}

    def prepare(self):
        """Compile `say` and `advance`."""
        say(self.outputs, self.memory, self.heard, self.said.copy())
        advance(self.state.copy(), self.constants, self.inputs.copy(), self.outputs.copy(), self.memory, self.heard)

    def say(self):
        """Put what is at the stamp of `heard` into `said`."""
        say(self.outputs, self.memory, self.heard, self.said)

    def advance(self):
        """One step on from the stamp of `heard`, obeying it; whether the command in force is stale."""
        return advance(self.state, self.constants, self.inputs, self.outputs, self.memory, self.heard)

    def condition(self):
        """The text of adu/state as it is now, also between two steps."""
        return CONDITIONS[condition(self.memory[0])]

    def refusal(self, service):
        """Ask for one of SERVICES between two steps: '' when granted, else why not. It acts in the next step."""
        m = self.memory[0]
        if service == 'adu/enable' and m['emergency']:
            return 'an emergency stop is latched (adu/reset_faults)'
        if service in ('adu/enable', 'adu/disable'):
            m['wanted'] = service == 'adu/enable'
        else:
            m['emergency'] = service == 'adu/emergency_stop'
        return ''

    def request(self, service):
        """The same; True when granted."""
        return not self.refusal(service)

    def services_to(self, text):
        """The services that bring adu/state to a text."""
        latched = self.memory[0]['emergency']
        if text == CONDITIONS[EMERGENCY_STOP]:
            return ['adu/emergency_stop']
        return [*(['adu/reset_faults'] if latched else []), 'adu/enable' if text == 'enabled' else 'adu/disable']

    def answers(self, heard, said):
        """Many steps, records (n,): `advance` by what was heard last, then `say`."""
        answers(self.state, self.constants, self.inputs, self.outputs, self.memory, self.last, heard, said)


@compiled
def condition(m):
    return EMERGENCY_STOP if m.emergency else ENABLED if m.wanted else DISABLED


@compiled
def say(outputs, memory, heard, said):
    """Outputs of the beam -> records of its messages; a beam has no rate and no torque."""
    joints = said[0][JOINTS]
    joints.stamp = said[0][CLOCK].stamp = heard[0][JOINTS].stamp
    for i in range(2):
        joints.position[i] = outputs[0].position[i]
    said[0][STATE] = condition(memory[0])


@compiled
def advance(state, constants, inputs, outputs, memory, heard):
    """From t_k to t_k+1; whether the command in force is stale. While it is not enabled it hears nothing, and what is
    on its way to it is lost."""
    h, u, m = heard[0], inputs[0], memory[0]
    command = h[COMMAND]
    u.stamp_ns = h[JOINTS].stamp
    u.due = 1 if command.stamp != NEVER and condition(m) == ENABLED else 0
    if u.due == 1:
        u.command_stamp_ns = command.stamp
        u.position[0], u.position[1] = command.position[0], command.position[1]
    if condition(m) != ENABLED:
        state[0].released = state[0].written
    electronic_beam.step(state, constants, inputs, outputs)
    return outputs[0].stale == 1


@compiled
def answers(state, constants, inputs, outputs, memory, last, heard, said):
    """Step by step; what is asked for before heard[k] comes between the answer to heard[k - 1] and the next."""
    for k in range(len(heard)):
        if memory[0].begun:
            advance(state, constants, inputs, outputs, memory, last)
        say(outputs, memory, heard[k:k + 1], said[k:k + 1])
        last[0] = heard[k]
        memory[0].begun = 1
