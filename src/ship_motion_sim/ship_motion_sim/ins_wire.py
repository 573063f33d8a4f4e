"""The INS between its messages: what it makes of those it hears, and what it puts into those it says.

The node answers one message at a time, a recomputed bag all of them at once, through the same `answers`.
"""
import numpy as np

from pedestal_common import messages, noise, records
from pedestal_common.compiled import compiled
from pedestal_common.records import NEVER
from ship_motion_sim import ins

RAW, DATA = 'ship/imu/data_raw', 'ship/imu/data'
HEARD, SAID = records.of(RAW), records.of(DATA)


class Ins:
    """The INS of an InsParameters.

    heard, said: the records (1,) of one step; messages: {topic: message} it says.
    """
    HEARD, SAID, WORDS = HEARD, SAID, {}

    def __init__(self, params, _on_ship=True):
        self.constants = ins.constants(params)
        self.state = ins.initial_state()
        self.inputs, self.outputs = np.zeros(1, ins.INPUTS), np.zeros(1, ins.OUTPUTS)
        self.heard, self.said = np.zeros(1, HEARD), np.zeros(1, SAID)
        self.rng = noise.generator(params.seed, 'ins')
        data = messages.imu('base_link')
        data.orientation_covariance = np.diag(attitude_variance(params)).ravel()
        data.angular_velocity_covariance = (np.eye(3) * params.rate_noise**2).ravel()
        self.messages = {DATA: data}
        self.followers, self.events = {}, {}

    def prepare(self):
        """Compile `answers`."""
        answers(self.state.copy(), self.constants, self.inputs.copy(), self.outputs.copy(), np.zeros((1, ins.NORMALS)),
                self.heard, self.said.copy())

    def answer(self):
        """Answer `heard` with `said`."""
        self.answers(self.heard, self.said)

    def answers(self, heard, said):
        """The same for many steps, records (n,)."""
        answers(self.state, self.constants, self.inputs, self.outputs,
                self.rng.standard_normal((len(heard), ins.NORMALS)), heard, said)


def attitude_variance(p):
    """Variance of roll, pitch and heading [rad2] that the INS declares."""
    return (p.roll_bias**2 + p.tilt_wander**2 + p.tilt_noise**2, p.pitch_bias**2 + p.tilt_wander**2 + p.tilt_noise**2,
            p.heading_bias**2 + p.heading_wander**2 + p.heading_noise**2)


@compiled
def answers(state, constants, inputs, outputs, normals, heard, said):
    """Step by step: said[k] answers heard[k]."""
    u, o = inputs[0], outputs[0]
    for k in range(len(heard)):
        raw, data = heard[k][RAW], said[k][DATA]
        u.stamp_ns = raw.stamp
        for i in range(3):
            u.angular_velocity[i], u.linear_acceleration[i] = raw.angular_velocity[i], raw.linear_acceleration[i]
        ins.step(state, constants, inputs, outputs, normals[k])
        data.stamp = o.stamp_ns if o.due == 1 else NEVER
        for i in range(4):
            data.orientation[i] = o.quaternion[i]
        for i in range(3):
            data.angular_velocity[i], data.linear_acceleration[i] = o.angular_velocity[i], o.linear_acceleration[i]
