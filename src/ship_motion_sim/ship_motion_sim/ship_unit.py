"""The ship between its messages: what it makes of the clock, and what it puts into the messages it says.

The node answers one tick at a time, a recomputed bag all of them at once, through the same `answers`.
"""
import numpy as np

from pedestal_common import messages, noise, records
from pedestal_common.compiled import compiled
from pedestal_common.records import NEVER
from ship_motion_sim import imu, motion

CLOCK, TRUTH, RAW = 'clock', 'ship/truth', 'ship/imu/data_raw'
HEARD, SAID = records.of(CLOCK), records.of(TRUTH, RAW)

NOMINAL_PERIOD = 5e-3
"""What the IMU takes for the length of its first sample [s]."""


class ShipMotion:
    """The ship and its IMU of a ShipMotionParameters.

    heard, said: the records (1,) of one step; messages: {topic: message} it says.
    """
    HEARD, SAID, WORDS = HEARD, SAID, {}

    def __init__(self, params, _on_ship=True):
        self.ship, self.imu = motion.constants(params.ship), imu.constants(params)
        self.inputs, self.truth = np.zeros(1, motion.INPUTS), np.zeros(1, motion.OUTPUTS)
        self.imu_state = imu.initial_state()
        self.imu_inputs, self.felt = np.zeros(1, imu.INPUTS), np.zeros(1, imu.OUTPUTS)
        self.last = np.full(1, NEVER)
        self.heard, self.said = np.zeros(1, HEARD), np.zeros(1, SAID)
        self.rng = noise.generator(params.imu.seed, 'ship_motion')
        self.messages = {TRUTH: messages.odometry('earth', 'base_link'), RAW: messages.imu('base_link')}
        self.followers, self.events = {}, {}

    def prepare(self):
        """Compile `answers`; until the first tick, the truth is that of stamp 0."""
        answers(self.last.copy(), self.ship, self.inputs, self.truth, self.imu_state.copy(), self.imu, self.imu_inputs,
                self.felt, np.zeros((1, imu.NORMALS)), self.heard, self.said.copy())

    def over(self):
        """Whether the last tick lies past the end of a recorded motion."""
        ship = self.ship[0]
        return ship['pieces'] > 0 and self.last[0] * 1e-9 > ship['breaks'][ship['pieces'] - 1]

    def answer(self):
        """Answer `heard` with `said`."""
        self.answers(self.heard, self.said)

    def answers(self, heard, said):
        """The same for many steps, records (n,)."""
        answers(self.last, self.ship, self.inputs, self.truth, self.imu_state, self.imu, self.imu_inputs, self.felt,
                self.rng.standard_normal((len(heard), imu.NORMALS)), heard, said)


@compiled
def answers(last, ship, inputs, truth, imu_state, imu_constants, imu_inputs, felt, normals, heard, said):
    """Tick by tick: said[k] answers heard[k]; last (1,): stamp of the tick before [ns]."""
    o, f = truth[0], felt[0]
    for k in range(len(heard)):
        stamp = heard[k][CLOCK].stamp
        inputs[0].t = imu_inputs[0].t = stamp * 1e-9
        imu_inputs[0].dt = (stamp - last[0]) * 1e-9 if last[0] != NEVER else NOMINAL_PERIOD
        last[0] = stamp
        motion.step(ship, inputs, truth)
        imu.step(imu_state, imu_constants, ship, imu_inputs, truth, felt, normals[k])
        pose, raw = said[k][TRUTH], said[k][RAW]
        pose.stamp = raw.stamp = stamp
        raw.orientation[3], raw.orientation_variance[0] = 1.0, -1.0     # REP 145: no orientation
        for i in range(4):
            pose.orientation[i] = o.quaternion[i]
        for i in range(3):
            pose.position[i], pose.twist_linear[i], pose.twist_angular[i] = (
                o.position[i], o.velocity_deck[i], o.angular_velocity[i])
            raw.angular_velocity[i], raw.linear_acceleration[i] = f.angular_velocity[i], f.linear_acceleration[i]
