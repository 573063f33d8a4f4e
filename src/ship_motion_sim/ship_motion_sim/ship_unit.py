"""The unit of the ship and its IMU: the drive's clock in, the ship's truth and what its IMU feels out."""
import typing

import numpy as np

from pedestal_common.compiled import compiled
from pedestal_common.graph import nodes, noise
from pedestal_common.injection import schedule, table
from pedestal_common.injection.simulated import Simulated
from pedestal_common.node.unit import LEVEL_ERROR, LEVEL_OK, LEVEL_WARN, Diagnosis, joined
from pedestal_common.wire.records import NO_STAMP
from ship_motion_sim import imu, injected
from ship_motion_sim.sea import motion

SHIP_TRUTH_TOPIC, IMU_RAW_TOPIC = 'ship/truth', 'ship/imu/data_raw'

NOMINAL_PERIOD_S = 5e-3
"""What the IMU takes for the length of its first sample [s]."""


RECORD_DTYPE = np.dtype([('ship', motion.CONSTANTS_DTYPE), ('truth', motion.OUTPUTS_DTYPE),
                         ('imu_state', imu.STATE_DTYPE),
                         ('imu', imu.CONSTANTS_DTYPE), ('imu_inputs', imu.INPUTS_DTYPE), ('felt', imu.OUTPUTS_DTYPE),
                         ('last', 'i8'),
                         ('row', 'i8'), ('schedule', schedule.SCHEDULE_DTYPE),
                         ('injected', injected.IMU_INJECTED_DTYPE)], align=True)
"""last: stamp of the last step [ns]; row: of the noise that the next step takes."""


class Memory(typing.NamedTuple):
    """All the ship works on: the noise of the next steps."""
    record: np.ndarray
    normals: np.ndarray


@compiled
def encode(truth, felt, stamp, outputs):
    """Truth of the ship and what its IMU feels -> records of the messages."""
    pose, raw = outputs[SHIP_TRUTH_TOPIC], outputs[IMU_RAW_TOPIC]
    pose.stamp = raw.stamp = stamp
    raw.orientation[3], raw.orientation_variance[0] = 1.0, -1.0     # REP 145: no orientation
    for i in range(4):
        pose.orientation[i] = truth.quaternion[i]
    for i in range(3):
        pose.position[i], pose.twist_linear[i] = truth.position[i], truth.velocity_deck[i]
        pose.twist_angular[i] = truth.angular_velocity[i]
        raw.angular_velocity[i], raw.linear_acceleration[i] = felt.angular_velocity[i], felt.linear_acceleration[i]


@compiled
def law(memory, stamp, inputs, outputs):
    """Step k."""
    m = memory.record[0]
    if schedule.pending(m.schedule, stamp):
        injected.apply_due_imu_faults(m, stamp)
    m.imu_inputs.t = stamp * 1e-9
    m.imu_inputs.dt = (stamp - m.last) * 1e-9 if m.last != NO_STAMP else NOMINAL_PERIOD_S
    m.last = stamp
    motion.truth(m.ship, m.imu_inputs.t, m.truth)
    imu.step(m.imu_state, m.imu, m.ship, m.imu_inputs, m.truth, m.felt, memory.normals[m.row])
    m.row += 1
    encode(m.truth, m.felt, stamp, outputs)
    if m.schedule.pending != 0:
        injected.corrupt_imu(m.injected, stamp, outputs)


@compiled
def laws(memory, stamps, inputs, outputs):
    """`law` over arrays."""
    for k in range(len(stamps)):
        law(memory, stamps[k], inputs[k], outputs[k])


class ShipMotion(Simulated):
    """The ship and its IMU of a ShipMotionParameters."""
    NODE, LAWS = nodes.row('ship_motion'), {Memory: (law, laws)}
    VERBS = table.INJECT_COMMANDS[NODE.name]

    def __init__(self, parameters, reads):
        super().__init__(parameters, reads)
        self._noise = noise.generator(parameters.imu.seed, self.NODE.name)
        self.memory = Memory(joined(RECORD_DTYPE, ship=motion.constants(parameters.ship),
                                    imu_state=imu.initial_state(),
                                    imu=imu.constants(parameters), last=NO_STAMP,
                                    schedule=schedule.empty()),
                             np.zeros((1, imu.IMU_NORMALS_PER_STEP)))

    def block(self, steps):
        """The memory with the IMU's noise (steps, NORMALS) drawn for the next steps."""
        self.parts['row'] = 0
        return self.memory._replace(normals=self._noise.standard_normal((steps, imu.IMU_NORMALS_PER_STEP)))

    @property
    def over(self):
        """Whether the last step lies past the end of a recorded motion."""
        ship = self.parts['ship']
        return ship['pieces'] > 0 and self.parts['last'] * 1e-9 > ship['breaks'][ship['pieces'] - 1]

    def diagnose(self):
        """ERROR where truth or IMU is not valid, WARN past the end of a recorded motion; values: roll and pitch."""
        truth, felt = self.parts['truth'], self.parts['felt']
        values = [(f'{name}_deg', f'{np.degrees(truth[name]):.3f}') for name in ('roll', 'pitch')]
        for status, names in ((truth['status'], motion.MOTION_STATUS_TEXTS), (felt['status'], imu.IMU_STATUS_TEXTS)):
            if status:
                return Diagnosis(LEVEL_ERROR, names[status], values)
        if self.over:
            return Diagnosis(LEVEL_WARN, 'the recorded motion is over, the deck is at rest', values)
        return Diagnosis(LEVEL_OK, 'under way', values)

    @staticmethod
    def idle(numbers):
        """Not exercised where neither the truth nor the IMU ever changed."""
        moved = any(len(numbers[name]) and np.ptp(numbers[name], axis=0).any() for name in (SHIP_TRUTH_TOPIC,
                                                                                            IMU_RAW_TOPIC)
                    if name in numbers)
        return '' if moved else 'the ship never moved'
