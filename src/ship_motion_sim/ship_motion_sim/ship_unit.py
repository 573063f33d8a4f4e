"""The unit of the ship and its IMU: from the clock of the drive to the truth of the ship and the data of its IMU."""
import typing
from collections.abc import Iterable, Mapping

import numpy as np

from pedestal_common.compiled import compiled
from pedestal_common.graph import nodes
from pedestal_common.injection import schedule, table
from pedestal_common.injection.schedule import Simulated
from pedestal_common.node.unit import LEVEL_ERROR, LEVEL_OK, LEVEL_WARN, Diagnosis
from pedestal_common.quantities import AnyRecord, Floats, Nanoseconds, Records, Stamps
from pedestal_common.record import Record
from pedestal_common.wire.records import NO_STAMP
from ship_motion_sim import imu, injected, motion
from ship_motion_sim.imu import Inputs as ImuInputs
from ship_motion_sim.imu import Outputs as ImuOutputs
from ship_motion_sim.params import ShipMotionParameters

SHIP_TRUTH_TOPIC, IMU_RAW_TOPIC = 'ship/truth', 'ship/imu/data_raw'

NOMINAL_PERIOD_S = 5e-3  # assumed length of the first IMU sample [s]


class UnitRecord(Record):
    """All data of the ship and its IMU."""
    ship: motion.Constants
    truth: motion.Truth
    imu_state: imu.State
    imu: imu.Constants
    imu_inputs: ImuInputs
    imu_outputs: ImuOutputs
    last: Nanoseconds                   # stamp of the last step
    row: int                            # row of the noise `normals` for the next step
    schedule: schedule.Schedule         # of the injected faults
    injected: injected.ImuInjected      # those in force


class Memory(typing.NamedTuple):
    """Memory of the ship."""
    record: Records     # UnitRecord (1,)
    normals: Floats     # (steps, IMU_NORMALS_PER_STEP), noise of the next steps


@compiled
def encode(truth: motion.Truth, imu_outputs: imu.Outputs, stamp: Nanoseconds, outputs: AnyRecord) -> None:
    """Set the records of the messages at a stamp from the truth of the ship and the outputs of its IMU."""
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
def law(memory: Memory, stamp: Nanoseconds, inputs: AnyRecord, outputs: AnyRecord) -> None:
    """Execute one step at a stamp."""
    unit = memory.record[0]
    if schedule.pending(unit.schedule, stamp):
        injected.apply_due_imu_faults(unit, stamp)
    unit.imu_inputs.t = stamp * 1e-9
    unit.imu_inputs.dt = (stamp - unit.last) * 1e-9 if unit.last != NO_STAMP else NOMINAL_PERIOD_S
    unit.last = stamp
    motion.truth(unit.ship, unit.imu_inputs.t, unit.truth)
    imu.step(unit.imu_state, unit.imu, unit.ship, unit.imu_inputs, unit.truth, unit.imu_outputs,
             memory.normals[unit.row])
    unit.row += 1
    encode(unit.truth, unit.imu_outputs, stamp, outputs)
    if unit.schedule.pending != 0:
        injected.corrupt_imu(unit.injected, stamp, outputs)


@compiled
def laws(memory: Memory, stamps: Stamps, inputs: Records, outputs: Records) -> None:
    """Execute `law` for each row of arrays."""
    for k in range(len(stamps)):
        law(memory, stamps[k], inputs[k], outputs[k])


class ShipMotion(Simulated):
    """The ship and its IMU."""
    NODE, LAWS = nodes.row('ship_motion'), {Memory: (law, laws)}
    VERBS = table.INJECT_COMMANDS[NODE.name]
    parameters: ShipMotionParameters
    memory: Memory

    def __init__(self, parameters: ShipMotionParameters, reads: Iterable[str]) -> None:
        super().__init__(parameters, reads)
        self._noise = nodes.noise(parameters.imu.seed, self.NODE.name)
        record = UnitRecord.of(ship=motion.constants(parameters.ship), imu_state=imu.initial_state(),
                               imu=imu.constants(parameters), last=NO_STAMP, schedule=schedule.empty())
        self.memory = Memory(record, np.zeros((1, imu.IMU_NORMALS_PER_STEP)))

    def block(self, steps: int) -> Memory:
        """Return the memory with noise (steps, IMU_NORMALS_PER_STEP) drawn for the next steps."""
        self.parts['row'] = 0
        return self.memory._replace(normals=self._noise.standard_normal((steps, imu.IMU_NORMALS_PER_STEP)))

    @property
    def recording_ended(self) -> bool:
        """True if the last step lies past the end of a recorded motion."""
        ship = self.parts['ship']
        return ship['pieces'] > 0 and self.parts['last'] * 1e-9 > ship['breaks'][ship['pieces'] - 1]

    def diagnose(self) -> Diagnosis:
        """Return the Diagnosis: ERROR if truth or IMU is not valid, WARN past the end of a recorded motion."""
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
    def idle(numbers: Mapping[str, Floats]) -> str:
        """Return a reason if neither truth nor IMU changed: such a recording does not exercise the unit."""
        moved = any(len(numbers[name]) and np.ptp(numbers[name], axis=0).any()
                    for name in (SHIP_TRUTH_TOPIC, IMU_RAW_TOPIC) if name in numbers)
        return '' if moved else 'the ship never moved'
