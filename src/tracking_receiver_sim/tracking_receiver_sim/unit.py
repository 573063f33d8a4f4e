"""The unit of the tracking receiver: from the true beam and the truth of the ship to the measurements of the
receiver."""
import math
from collections.abc import Iterable, Mapping
from typing import NamedTuple

import numpy as np

from pedestal_common.compiled import compiled
from pedestal_common.geometry import line_of_sight
from pedestal_common.graph import nodes
from pedestal_common.injection import schedule, table
from pedestal_common.injection.schedule import Simulated
from pedestal_common.node.unit import LEVEL_ERROR, LEVEL_OK, LEVEL_WARN, Diagnosis
from pedestal_common.quantities import AnyRecord, Floats, Nanoseconds, Records, Stamps, Times
from pedestal_common.record import Record
from pedestal_common.wire.records import NO_STAMP
from receiver_law import detector
from tracking_receiver_sim import injected, receiver, target
from tracking_receiver_sim.injected import ANGLE_ERROR_TOPIC, ANGLE_RATE_TOPIC, RANGE_TOPIC
from tracking_receiver_sim.params import TrackingReceiverNodeParameters

DRIVE_TRUTH_TOPIC, SHIP_TRUTH_TOPIC, TARGET_TRUTH_TOPIC = 'adu/truth', 'ship/truth', 'target/truth'

FAULT_STATUSES = (receiver.Status.NO_TARGET, receiver.Status.NO_BEAM, receiver.Status.STAMP_ORDER)


class ReceiverRecord(Record):
    """Record of the unit."""
    state: receiver.State
    constants: receiver.Constants
    inputs: receiver.Inputs
    outputs: receiver.Outputs
    row: int            # row of the noise `normals` for the next step
    fault: int          # last status of FAULT_STATUSES since the last diagnosis, LOCKED if there was none
    schedule: schedule.Schedule
    injected: injected.Injected


class Memory(NamedTuple):
    """All data of the receiver."""
    record: Records         # (1,) of ReceiverRecord
    breaks: Times           # track of the target, see target.Target
    coefficients: Floats
    normals: Floats         # (steps, receiver.normals_per_step), noise of the next steps


@compiled
def decode(known: receiver.Inputs, stamp: Nanoseconds, beam: AnyRecord, ship: AnyRecord) -> None:
    """Set the inputs of the receiver. Without a new ship/truth they keep the last one."""
    known.stamp_ns = stamp
    known.azimuth, known.elevation = beam.position[0], beam.position[1]
    known.azimuth_rate, known.elevation_rate = beam.velocity[0], beam.velocity[1]
    known.valid = 1
    if ship.stamp != NO_STAMP:
        q = ship.orientation
        line_of_sight.rotation(q[0], q[1], q[2], q[3], known.mat_ed)
        for i in range(3):
            known.position[i] = ship.position[i]
            known.twist_linear[i], known.twist_angular[i] = ship.twist_linear[i], ship.twist_angular[i]


@compiled
def encode_truth(result: receiver.Outputs, stamp: Nanoseconds, truth: AnyRecord) -> None:
    """Set the record of target/truth from the outputs of the receiver."""
    truth.stamp = stamp
    truth.orientation[3] = 1.0
    for i in range(3):
        truth.position[i], truth.twist_linear[i] = result.target_position[i], result.target_velocity[i]


@compiled
def encode(result: receiver.Outputs, constants: receiver.Constants, stamp: Nanoseconds, outputs: AnyRecord) -> None:
    """Set the records of the messages from the outputs of the receiver."""
    error, rate = outputs[ANGLE_ERROR_TOPIC], outputs[ANGLE_RATE_TOPIC]
    distance = outputs[RANGE_TOPIC]
    error.stamp = result.stamp_ns if result.due == 1 else NO_STAMP
    error.vector[0], error.vector[1], error.vector[2] = result.cross_elevation, result.elevation, result.cn0_dbhz
    rate.stamp = error.stamp if constants.rate_measured != 0 else NO_STAMP
    rate.vector[0], rate.vector[1], rate.vector[2] = result.rate[0], result.rate[1], constants.rate_sigma
    distance.stamp = error.stamp if constants.range_measured != 0 else NO_STAMP
    distance.range[0], distance.variance[0] = result.range, constants.range_variance
    encode_truth(result, stamp, outputs[TARGET_TRUTH_TOPIC])


@compiled
def law(memory: Memory, stamp: Nanoseconds, inputs: AnyRecord, outputs: AnyRecord) -> None:
    """Execute one step at a stamp."""
    m = memory.record[0]
    if schedule.pending(m.schedule, stamp):
        injected.apply_due_faults(m, stamp)
    decode(m.inputs, stamp, inputs[DRIVE_TRUTH_TOPIC], inputs[SHIP_TRUTH_TOPIC])
    receiver.step(m.state, m.constants, m.inputs, m.outputs, memory.breaks, memory.coefficients,
                  memory.normals[m.row])
    m.row += 1
    if m.outputs.status in FAULT_STATUSES:
        m.fault = m.outputs.status
    encode(m.outputs, m.constants, stamp, outputs)
    if m.schedule.pending != 0:
        injected.corrupt_messages(m.injected, stamp, outputs)


@compiled
def laws(memory: Memory, stamps: Stamps, inputs: Records, outputs: Records) -> None:
    """Execute `law` for each row of arrays."""
    for k in range(len(stamps)):
        law(memory, stamps[k], inputs[k], outputs[k])


class TrackingReceiver(Simulated):
    """The receiver of a TrackingReceiverNodeParameters."""
    NODE, LAWS = nodes.row('tracking_receiver'), {Memory: (law, laws)}
    VERBS = table.INJECT_COMMANDS[NODE.name]

    def __init__(self, parameters: TrackingReceiverNodeParameters, reads: Iterable[str]) -> None:
        super().__init__(parameters, reads)
        self.target = target.build(parameters.target, parameters.duration, parameters.receiver.horizon_mask)
        self._noise = nodes.noise(parameters.seed, self.NODE.name)
        self._air, = self._noise.spawn(1)
        constants = receiver.constants(parameters, parameters.period, self.target)
        record = ReceiverRecord.of(state=receiver.initial_state(), constants=constants,
                                   schedule=schedule.empty(), injected=injected.initial(constants))
        record['fault'] = receiver.Status.LOCKED
        record['inputs']['mat_ed'] = line_of_sight.ashore_matrix()
        self.memory = Memory(record, self.target.breaks, self.target.coefficients,
                             np.zeros((1, receiver.normals_per_step(parameters))))
        if RANGE_TOPIC in self.messages:
            self.messages[RANGE_TOPIC].field_of_view = parameters.antenna.beamwidth

    def block(self, steps: int) -> Memory:
        """Return the memory with noise drawn for the next steps. The scintillation has a random generator of its own,
        so that the noise of the receiver is equal with and without it."""
        self.parts['row'] = 0
        receiver_count = int(self.parts['constants']['first_scintillation_normal'])
        total_count = self.memory.normals.shape[1]
        drawn = self._noise.standard_normal((steps, receiver_count))
        if total_count > receiver_count:
            drawn = np.hstack((drawn, self._air.standard_normal((steps, total_count - receiver_count))))
        return self.memory._replace(normals=drawn)

    def diagnose(self) -> Diagnosis:
        """Return the Diagnosis: ERROR after a status of FAULT_STATUSES since the last one, WARN while not locked."""
        outputs, fault = self.parts['outputs'], int(self.parts['fault'])
        self.parts['fault'] = receiver.Status.LOCKED
        status, p = int(outputs['status']), self.parameters
        sigma = detector.angle_noise(p.antenna, p.receiver, float(outputs['cn0_dbhz']), p.period)
        values = [('cn0_dbhz', f'{outputs["cn0_dbhz"]:.2f}'), ('locked', str(int(outputs['locked']))),
                  ('target', p.target.kind), ('angle_noise_deg', f'{math.degrees(sigma):.4g}')]
        values += self.target.values
        if fault in FAULT_STATUSES:
            return Diagnosis(LEVEL_ERROR, receiver.STATUS_TEXT_BY_CODE[fault], values)
        return Diagnosis(LEVEL_OK if status == receiver.Status.LOCKED else LEVEL_WARN,
                         receiver.STATUS_TEXT_BY_CODE[status], values)

    @staticmethod
    def idle(numbers: Mapping[str, Floats]) -> str:
        """Return a reason if no error is finite: such a recording does not exercise the receiver."""
        return '' if np.isfinite(numbers[ANGLE_ERROR_TOPIC][:, 0]).any() else 'the receiver never locked'
