"""The INS between its messages: what it makes of those it hears, and what it puts into those it says.

The node answers one message at a time, a recomputed bag all of them at once, through the same code.
"""
import numpy as np

from pedestal_common import messages, noise, records
from pedestal_common.compiled import compiled
from pedestal_common.records import NEVER
from ship_motion_sim import aligning_ins, ins, navigator

RAW, DATA, STATE = 'ship/imu/data_raw', 'ship/imu/data', 'ins/state'
HEARD, SAID = records.of(RAW), records.of(DATA, more=(STATE,))


class Ins:
    """The INS of an InsParameters.

    heard, said: the records (1,) of one step; messages: {topic: message} it says; WORDS: {topic: function from its
    code in `said` to its text}. Method model never says how it is: its code is NO_STAGE.
    """
    HEARD, SAID, WORDS = HEARD, SAID, {STATE: navigator.STAGES.__getitem__}

    def __init__(self, params, _on_ship=True):
        if params.method == 'model':
            self._answers, self.constants, self.state = model_answers, ins.constants(params), ins.initial_state()
        else:
            self._answers, self.constants = aligning_answers, aligning_ins.constants(params)
            self.state = aligning_ins.initial_state(self.constants)
        self.inputs, self.outputs = np.zeros(1, ins.INPUTS), np.zeros(1, ins.OUTPUTS)
        self.heard, self.said = np.zeros(1, HEARD), np.zeros(1, SAID)
        self.rng = noise.generator(params.seed, 'ins')
        data = messages.imu('base_link')
        data.orientation_covariance = np.zeros(9)
        rate_noise = params.rate_noise if params.method == 'model' else 0.0     # zeros: unknown
        data.angular_velocity_covariance = (np.eye(3) * rate_noise**2).ravel()
        self.messages = {DATA: data}
        self.followers, self.events = {}, {}

    def prepare(self):
        """Compile what answers."""
        self._answers(self.state.copy(), self.constants, self.inputs.copy(), self.outputs.copy(),
                      np.zeros((1, ins.NORMALS)), self.heard, self.said.copy())

    def answer(self):
        """Answer `heard` with `said`."""
        self.answers(self.heard, self.said)

    def answers(self, heard, said):
        """The same for many steps, records (n,)."""
        self._answers(self.state, self.constants, self.inputs, self.outputs,
                      self.rng.standard_normal((len(heard), ins.NORMALS)), heard, said)


@compiled
def hear(u, raw):
    """Record of an IMU message -> inputs of the INS."""
    u.stamp_ns = raw.stamp
    for i in range(3):
        u.angular_velocity[i], u.linear_acceleration[i] = raw.angular_velocity[i], raw.linear_acceleration[i]


@compiled
def say(o, said):
    """Outputs of the INS -> records of its messages."""
    data = said[DATA]
    data.stamp = o.stamp_ns if o.due == 1 else NEVER
    for i in range(4):
        data.orientation[i] = o.quaternion[i]
    for i in range(3):
        data.angular_velocity[i], data.linear_acceleration[i] = o.angular_velocity[i], o.linear_acceleration[i]
        data.orientation_variance[i] = o.variance[i]
    said[STATE] = o.stage


@compiled
def model_answers(state, constants, inputs, outputs, normals, heard, said):
    """Step by step: said[k] answers heard[k]."""
    for k in range(len(heard)):
        hear(inputs[0], heard[k][RAW])
        ins.step(state, constants, inputs, outputs, normals[k])
        say(outputs[0], said[k])


@compiled
def aligning_answers(state, constants, inputs, outputs, normals, heard, said):
    """The same of an INS that aligns: a function of its own, so that a run with the model compiles only that."""
    for k in range(len(heard)):
        hear(inputs[0], heard[k][RAW])
        aligning_ins.step(state, constants, inputs, outputs, normals[k])
        say(outputs[0], said[k])
