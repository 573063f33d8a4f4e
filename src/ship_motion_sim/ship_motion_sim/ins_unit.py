"""The unit of the INS: from IMU data to attitude, deck rate and the state of the alignment.

The INS of the method `model` publishes no ins/state. The INS of every other method aligns itself.
"""
import math
import typing
from collections.abc import Iterable, Mapping

import numpy as np

from pedestal_common.compiled import compiled
from pedestal_common.graph import nodes
from pedestal_common.injection import schedule, table
from pedestal_common.injection.schedule import Simulated
from pedestal_common.node.unit import LEVEL_ERROR, LEVEL_OK, LEVEL_WARN, Diagnosis
from pedestal_common.quantities import AnyRecord, Bit, Floats, Nanoseconds, Records, Stamps
from pedestal_common.record import Record
from pedestal_common.wire.records import NO_STAMP
from ship_motion_sim import aligning_ins, injected, ins, navigator
from ship_motion_sim.params import InsParameters

IMU_RAW_TOPIC, ATTITUDE_TOPIC = 'ship/imu/data_raw', 'ship/imu/data'
INS_STATE_TOPIC, INS_ERROR_TOPIC = 'ins/state', 'ins/error'


class InsRecord(Record, open=True):
    """All data of an INS."""
    state: ins.State | aligning_ins.State
    constants: ins.Constants | aligning_ins.Constants
    inputs: ins.Inputs
    outputs: ins.Outputs
    error_published: Bit                # 1 if the INS publishes ins/error
    row: int                            # row of the noise `normals` for the next step
    worst: int                          # highest status since the last diagnosis
    schedule: schedule.Schedule         # of the injected faults
    injected: injected.InsInjected      # those in force


class ModelRecord(InsRecord):
    """All data of the INS of method `model`."""
    state: ins.State
    constants: ins.Constants


class AligningRecord(InsRecord):
    """All data of an INS that aligns."""
    state: aligning_ins.State
    constants: aligning_ins.Constants


class ModelMemory(typing.NamedTuple):
    """Memory of the INS of method `model`."""
    record: Records     # ModelRecord (1,)
    normals: Floats     # (steps, INS_NORMALS_PER_STEP), noise of the next steps


class AligningMemory(typing.NamedTuple):
    """Memory of an aligning INS. Because the types differ, a run with the method `model` does not compile its law."""
    record: Records     # AligningRecord (1,)
    normals: Floats     # as in ModelMemory


@compiled
def decode(inputs: ins.Inputs, raw: AnyRecord) -> None:
    """Set the inputs of the INS from the record raw of an IMU message."""
    inputs.stamp_ns = raw.stamp
    for i in range(3):
        inputs.angular_velocity[i] = raw.angular_velocity[i]
        inputs.linear_acceleration[i] = raw.linear_acceleration[i]


@compiled
def encode(result: ins.Outputs, error_published: Bit, outputs: AnyRecord) -> None:
    """Set the records of the messages from the result of the INS; error_published: 1 if it publishes ins/error."""
    data, changes = outputs[ATTITUDE_TOPIC], outputs[INS_ERROR_TOPIC]
    data.stamp = result.stamp_ns if result.due == 1 else NO_STAMP
    for i in range(4):
        data.orientation[i] = result.quaternion[i]
    for i in range(3):
        data.angular_velocity[i] = result.angular_velocity[i]
        data.linear_acceleration[i] = result.linear_acceleration[i]
        data.orientation_variance[i] = result.variance[i]
        changes.position[i], changes.velocity[i] = result.noise[i], result.walk[i]
    changes.stamp = data.stamp if error_published else NO_STAMP
    outputs[INS_STATE_TOPIC] = result.stage


@compiled
def begin(unit: InsRecord, stamp: Nanoseconds, raw: AnyRecord) -> None:
    """Prepare a step: apply the injected faults and read the inputs."""
    if schedule.pending(unit.schedule, stamp):
        injected.apply_due_ins_faults(unit, stamp)
    decode(unit.inputs, raw)


@compiled
def end(unit: InsRecord, stamp: Nanoseconds, outputs: AnyRecord) -> None:
    """Finish a step: set its messages."""
    unit.row += 1
    unit.worst = max(unit.worst, unit.outputs.status)
    encode(unit.outputs, unit.error_published, outputs)
    if unit.schedule.pending != 0:
        injected.corrupt_ins(unit.injected, stamp, outputs)


@compiled
def model_law(memory: ModelMemory, stamp: Nanoseconds, inputs: AnyRecord, outputs: AnyRecord) -> None:
    """Execute one step of method `model` at a stamp."""
    unit = memory.record[0]
    begin(unit, stamp, inputs[IMU_RAW_TOPIC])
    ins.step(unit.state, unit.constants, unit.inputs, unit.outputs, memory.normals[unit.row])
    end(unit, stamp, outputs)


@compiled
def aligning_law(memory: AligningMemory, stamp: Nanoseconds, inputs: AnyRecord, outputs: AnyRecord) -> None:
    """Execute one step of an INS that aligns at a stamp."""
    unit = memory.record[0]
    begin(unit, stamp, inputs[IMU_RAW_TOPIC])
    aligning_ins.step(unit.state, unit.constants, unit.inputs, unit.outputs, memory.normals[unit.row])
    end(unit, stamp, outputs)


@compiled
def model_laws(memory: ModelMemory, stamps: Stamps, inputs: Records, outputs: Records) -> None:
    """Execute `model_law` for each row of arrays."""
    for k in range(len(stamps)):
        model_law(memory, stamps[k], inputs[k], outputs[k])


@compiled
def aligning_laws(memory: AligningMemory, stamps: Stamps, inputs: Records, outputs: Records) -> None:
    """Execute `aligning_law` for each row of arrays."""
    for k in range(len(stamps)):
        aligning_law(memory, stamps[k], inputs[k], outputs[k])


class Ins(Simulated):
    """The INS."""
    NODE = nodes.row('ins')
    VERBS = table.INJECT_COMMANDS[NODE.name]
    LAWS = {ModelMemory: (model_law, model_laws), AligningMemory: (aligning_law, aligning_laws)}
    parameters: InsParameters
    memory: ModelMemory | AligningMemory

    def __init__(self, parameters: InsParameters, reads: Iterable[str]) -> None:
        super().__init__(parameters, reads)
        self._noise = nodes.noise(parameters.seed, self.NODE.name)
        normals = np.zeros((1, ins.INS_NORMALS_PER_STEP))
        model = parameters.method == 'model'
        constants = ins.constants(parameters) if model else aligning_ins.constants(parameters)
        faults = {'schedule': schedule.empty(), 'injected': injected.initial(int(constants['latency_ns'][0]))}
        if model:
            record = ModelRecord.of(state=ins.initial_state(), constants=constants, **faults)
            self.memory = ModelMemory(record, normals)
        else:
            record = AligningRecord.of(state=aligning_ins.initial_state(constants), constants=constants,
                                       **faults)
            self.memory = AligningMemory(record, normals)
        self.parts['error_published'] = parameters.error_told
        rate_noise = parameters.rate_noise if model else 0.0     # In a message, a covariance of zeros means unknown.
        self.messages[ATTITUDE_TOPIC].angular_velocity_covariance = (np.eye(3) * rate_noise**2).ravel()

    def block(self, steps: int) -> ModelMemory | AligningMemory:
        """Return the memory with noise (steps, INS_NORMALS_PER_STEP) drawn for the next steps."""
        self.parts['row'] = 0
        return self.memory._replace(normals=self._noise.standard_normal((steps, ins.INS_NORMALS_PER_STEP)))

    def diagnose(self) -> Diagnosis:
        """Return the Diagnosis: ERROR after a status other than OK since the last one, WARN while the INS aligns."""
        outputs, status = self.parts['outputs'], int(self.parts['worst'])
        self.parts['worst'] = 0
        stage, sigma, p = int(outputs['stage']), outputs['variance']**0.5, self.parameters
        values = [('latency_s', f'{p.latency:g}')]
        known = self.parts['state']['released'] > 0     # True after the first published attitude
        if known:
            values.append(('heading_error_rms_rad', f'{sigma[2]:g}'))
        if stage != ins.NO_STAGE:
            values += [('method', p.method), ('state', navigator.STAGES[stage])]
            if known:
                values.append(('level_error_rms_rad', f'{sigma[0]:g}'))
        if stage == navigator.STAGE_ALIGNED:
            values += [(f'velocity_{axis}', f'{v:.3f}') for axis, v in zip(('east', 'north', 'up'),
                                                                           outputs['velocity'])]
        if status:
            return Diagnosis(LEVEL_ERROR, ins.INS_STATUS_TEXTS[status], values)
        if stage == navigator.STAGE_ALIGNING:
            heading, aligned = (math.degrees(x) for x in (sigma[2], p.alignment.aligned_sigma))
            progress = f'heading known to {heading:.2g} deg (1 sigma)' if known else 'heading unknown'
            return Diagnosis(LEVEL_WARN, f'aligning: {progress}, navigation begins at {aligned:.2g} deg', values)
        return Diagnosis(LEVEL_OK, 'navigating', values)

    @staticmethod
    def idle(numbers: Mapping[str, Floats]) -> str:
        """Return a reason if the attitude never changed: such a recording does not exercise the INS."""
        attitude = numbers.get(ATTITUDE_TOPIC, ())
        return '' if len(attitude) and np.ptp(attitude, axis=0).any() else 'the ship never moved'
