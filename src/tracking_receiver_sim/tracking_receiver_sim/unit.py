"""The tracking receiver between its messages: what it makes of those it hears, and what it puts into those it says.

The node answers one step at a time, a recomputed bag all of them at once, through the same `answers`.
"""
import numpy as np

from pedestal_common import line_of_sight, messages, noise, records
from pedestal_common.compiled import compiled
from pedestal_common.records import NEVER
from tracking_receiver_sim import receiver, target

JOINTS, SHIP, ERROR, TARGET = 'joint_states', 'ship/truth', 'tracking_receiver/angle_error', 'target/truth'
RATE, RANGE = 'tracking_receiver/angle_rate', 'tracking_receiver/range'
HEARD, SAID = records.of(JOINTS, SHIP), records.of(ERROR, RATE, RANGE, TARGET)

BLOCK = 2000
"""Steps whose noise is drawn at once."""


class TrackingReceiver:
    """The receiver of a TrackingReceiverNodeParameters; on_ship: it hears where its deck is.

    heard, said: the records (1,) of one step; messages: {topic: message} it says; followers: {topic: latency [s]} that
    a step waits for.
    """
    HEARD, SAID, WORDS = HEARD, SAID, {}

    def __init__(self, params, on_ship):
        self.target = target.build(params.target, params.duration)
        self.constants = receiver.constants(params, params.period, self.target)
        self.state = receiver.initial_state()
        self.inputs, self.outputs = np.zeros(1, receiver.INPUTS), np.zeros(1, receiver.OUTPUTS)
        self.inputs[0]['mat_ed'] = line_of_sight.ashore_matrix()
        self.heard, self.said = np.zeros(1, HEARD), np.zeros(1, SAID)
        self.rng = noise.generator(params.seed, 'tracking_receiver')
        self.normals = receiver.normals_per_step(params)
        self.messages = {ERROR: messages.vector3_stamped('beam')}
        if params.receiver.rate.measured:
            self.messages[RATE] = messages.vector3_stamped('beam')
        if params.receiver.ranging.measured:
            self.messages[RANGE] = messages.range_message('beam', params.antenna.beamwidth)
        self.messages[TARGET] = messages.odometry('earth', 'target')
        self.followers = {SHIP: 0.0} if on_ship else {}
        self.events = {}

    def prepare(self):
        """Compile `answers`."""
        answers(self.state.copy(), self.constants, self.inputs.copy(), self.outputs.copy(), self.target.breaks,
                self.target.coefficients, np.zeros((1, self.normals)), self.heard, self.said.copy())

    def answer(self):
        """Answer `heard` with `said`."""
        self.answers(self.heard, self.said)

    def answers(self, heard, said):
        """The same for many steps, records (n,)."""
        for first in range(0, len(heard), BLOCK):
            part = slice(first, first + BLOCK)
            answers(self.state, self.constants, self.inputs, self.outputs, self.target.breaks,
                    self.target.coefficients, self.rng.standard_normal((len(heard[part]), self.normals)), heard[part],
                    said[part])


@compiled
def hear(u, joints, ship):
    """Records of the messages of a step -> inputs of the receiver; the ship stays where it was until the next."""
    u.stamp_ns = joints.stamp
    u.azimuth, u.elevation = joints.position[0], joints.position[1]
    u.azimuth_rate, u.elevation_rate = joints.velocity[0], joints.velocity[1]
    u.valid = 1
    if ship.stamp != NEVER:
        q = ship.orientation
        line_of_sight.rotation(q[0], q[1], q[2], q[3], u.mat_ed)
        for i in range(3):
            u.position[i] = ship.position[i]
            u.twist_linear[i], u.twist_angular[i] = ship.twist_linear[i], ship.twist_angular[i]


@compiled
def say(o, c, stamp, error, rate, distance, target_truth):
    """Outputs of the receiver -> records of its messages."""
    error.stamp = o.stamp_ns if o.due == 1 else NEVER
    error.vector[0], error.vector[1], error.vector[2] = o.cross_elevation, o.elevation, o.cn0_dbhz
    rate.stamp = error.stamp if c.rate_measured != 0 else NEVER
    rate.vector[0], rate.vector[1], rate.vector[2] = o.rate[0], o.rate[1], c.rate_sigma
    distance.stamp = error.stamp if c.range_measured != 0 else NEVER
    distance.range[0], distance.variance[0] = o.range, c.range_variance
    target_truth.stamp = stamp
    target_truth.orientation[3] = 1.0
    for i in range(3):
        target_truth.position[i], target_truth.twist_linear[i] = o.target_position[i], o.target_velocity[i]


@compiled
def answers(state, constants, inputs, outputs, breaks, coefficients, normals, heard, said):
    """Step by step: said[k] answers heard[k]."""
    for k in range(len(heard)):
        h, y = heard[k], said[k]
        hear(inputs[0], h[JOINTS], h[SHIP])
        receiver.step(state, constants, inputs, outputs, breaks, coefficients, normals[k])
        say(outputs[0], constants[0], h[JOINTS].stamp, y[ERROR], y[RATE], y[RANGE], y[TARGET])
