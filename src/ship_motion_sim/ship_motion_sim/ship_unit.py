"""The unit of the ship and its IMU: from the clock of the drive to the truth of the ship and the data of its IMU."""
import typing

import numpy as np

from pedestal_common.compiled import compiled
from pedestal_common.graph import nodes, noise
from pedestal_common.injection import schedule, table
from pedestal_common.injection.simulated import Simulated
from pedestal_common.node.unit import LEVEL_ERROR, LEVEL_OK, LEVEL_WARN, Diagnosis, joined
from pedestal_common.record import Record
from pedestal_common.wire.records import NO_STAMP
from ship_motion_sim import imu, injected
from ship_motion_sim.sea import motion

SHIP_TRUTH_TOPIC, IMU_RAW_TOPIC = 'ship/truth', 'ship/imu/data_raw'

NOMINAL_PERIOD_S = 5e-3  # assumed length of the first IMU sample [s]


class UnitRecord(Record):
    """Record of the unit. last: stamp of the last step [ns]; row: row of the noise `normals` for the next step."""
    ship: motion.Constants
    truth: motion.Truth
    imu_state: imu.State
    imu: imu.Constants
    imu_inputs: imu.Inputs
    imu_outputs: imu.Outputs
    last: int
    row: int
    schedule: schedule.Schedule
    injected: injected.ImuInjected


class Memory(typing.NamedTuple):
    """All data of the ship. record: (1,) of Record; normals: (steps, IMU_NORMALS_PER_STEP), noise of the next
    steps."""
    record: np.ndarray
    normals: np.ndarray


@compiled
def encode(truth, imu_outputs, stamp, outputs):
    """Set the records of the messages at a stamp [ns] from the truth of the ship and the outputs of its IMU."""
    pose, raw = outputs[SHIP_TRUTH_TOPIC], outputs[IMU_RAW_TOPIC]
    pose.stamp = raw.stamp = stamp
    raw.orientation[3], raw.orientation_variance[0] = 1.0, -1.0     # REP 145: no orientation
    for i in range(4):
        pose.orientation[i] = truth.quaternion[i]
    for i in range(3):
        pose.position[i], pose.twist_linear[i] = truth.position[i], truth.velocity_deck[i]
        pose.twist_angular[i] = truth.angular_velocity[i]
        raw.angular_velocity[i] = imu_outputs.angular_velocity[i]
        raw.linear_acceleration[i] = imu_outputs.linear_acceleration[i]


@compiled
def law(memory, stamp, inputs, outputs):
    """Execute one step at a stamp [ns]."""
    m = memory.record[0]
    if schedule.pending(m.schedule, stamp):
        injected.apply_due_imu_faults(m, stamp)
    m.imu_inputs.t = stamp * 1e-9
    m.imu_inputs.dt = (stamp - m.last) * 1e-9 if m.last != NO_STAMP else NOMINAL_PERIOD_S
    m.last = stamp
    motion.truth(m.ship, m.imu_inputs.t, m.truth)
    imu.step(m.imu_state, m.imu, m.ship, m.imu_inputs, m.truth, m.imu_outputs, memory.normals[m.row])
    m.row += 1
    encode(m.truth, m.imu_outputs, stamp, outputs)
    if m.schedule.pending != 0:
        injected.corrupt_imu(m.injected, stamp, outputs)


@compiled
def laws(memory, stamps, inputs, outputs):
    """Execute `law` for each row of arrays."""
    for k in range(len(stamps)):
        law(memory, stamps[k], inputs[k], outputs[k])


class ShipMotion(Simulated):
    """The ship and its IMU of a ShipMotionParameters."""
    NODE, LAWS = nodes.row('ship_motion'), {Memory: (law, laws)}
    VERBS = table.INJECT_COMMANDS[NODE.name]

    def __init__(self, parameters, reads):
        super().__init__(parameters, reads)
        self._noise = noise.generator(parameters.imu.seed, self.NODE.name)
        record = joined(UnitRecord.dtype, ship=motion.constants(parameters.ship), imu_state=imu.initial_state(),
                        imu=imu.constants(parameters), last=NO_STAMP, schedule=schedule.empty())
        self.memory = Memory(record, np.zeros((1, imu.IMU_NORMALS_PER_STEP)))

    def block(self, steps):
        """Return the memory with noise (steps, IMU_NORMALS_PER_STEP) drawn for the next steps."""
        self.parts['row'] = 0
        return self.memory._replace(normals=self._noise.standard_normal((steps, imu.IMU_NORMALS_PER_STEP)))

    @property
    def recording_ended(self):
        """True if the last step lies past the end of a recorded motion."""
        ship = self.parts['ship']
        return ship['pieces'] > 0 and self.parts['last'] * 1e-9 > ship['breaks'][ship['pieces'] - 1]

    def diagnose(self):
        """Return the Diagnosis, with roll and pitch as its values.

    The level is ERROR if truth or IMU is not valid, and WARN past the end of a recorded motion.
    """
        truth = self.parts['truth']
        values = [(f'{name}_deg', f'{np.degrees(truth[name]):.3f}') for name in ('roll', 'pitch')]
        for status, texts in ((truth['status'], motion.MOTION_STATUS_TEXTS),
                              (self.parts['imu_outputs']['status'], imu.IMU_STATUS_TEXTS)):
            if status:
                return Diagnosis(LEVEL_ERROR, texts[status], values)
        if self.recording_ended:
            return Diagnosis(LEVEL_WARN, 'the recorded motion has ended, the deck is at rest', values)
        return Diagnosis(LEVEL_OK, 'under way', values)

    @staticmethod
    def idle(numbers):
        """Return a reason if neither truth nor IMU changed: such a recording does not exercise the unit."""
        moved = any(len(numbers[name]) and np.ptp(numbers[name], axis=0).any()
                    for name in (SHIP_TRUTH_TOPIC, IMU_RAW_TOPIC) if name in numbers)
        return '' if moved else 'the ship never moved'
