"""The unit of the INS: from IMU data to attitude, deck rate and the state of the alignment.

The INS of the method `model` is the true attitude with parametrised errors; it publishes no ins/state. The INS of
every other method aligns itself.
"""
import math
import typing

import numpy as np

from pedestal_common.compiled import compiled
from pedestal_common.graph import nodes, noise
from pedestal_common.injection import schedule, table
from pedestal_common.injection.simulated import Simulated
from pedestal_common.node.unit import LEVEL_ERROR, LEVEL_OK, LEVEL_WARN, Diagnosis, joined
from pedestal_common.wire.records import NO_STAMP
from ship_motion_sim import injected
from ship_motion_sim.navigation import aligning_ins, ins, navigator

IMU_RAW_TOPIC, ATTITUDE_TOPIC = 'ship/imu/data_raw', 'ship/imu/data'
INS_STATE_TOPIC, INS_ERROR_TOPIC = 'ins/state', 'ins/error'


def _record_of(state, constants):
    """Return the dtype of the record of an INS, from the dtypes of its state and constants.

    error_published: 1 if the INS publishes ins/error; row: row of the noise `normals` for the next step; worst:
    highest status since the last diagnosis.
    """
    return np.dtype([('state', state), ('constants', constants), ('inputs', ins.Inputs.dtype),
                     ('outputs', ins.Outputs.dtype), ('error_published', 'i8'), ('row', 'i8'), ('worst', 'i8'),
                     ('schedule', schedule.Schedule.dtype), ('injected', injected.InsInjected.dtype)], align=True)


MODEL_RECORD_DTYPE = _record_of(ins.State, ins.Constants.dtype)
ALIGNING_RECORD_DTYPE = _record_of(aligning_ins.State, aligning_ins.Constants.dtype)


class ModelMemory(typing.NamedTuple):
    """All data of the INS of method `model`.

    record: (1,) of MODEL_RECORD_DTYPE; normals: (steps, INS_NORMALS_PER_STEP), noise of the next steps.
    """
    record: np.ndarray
    normals: np.ndarray


class AligningMemory(typing.NamedTuple):
    """All data of an aligning INS, with fields as those of ModelMemory.

    Because the types differ, a run with the method `model` does not compile the law of an aligning INS.
    """
    record: np.ndarray
    normals: np.ndarray


@compiled
def decode(u, raw):
    """Set the inputs u of the INS from the record raw of an IMU message."""
    u.stamp_ns = raw.stamp
    for i in range(3):
        u.angular_velocity[i], u.linear_acceleration[i] = raw.angular_velocity[i], raw.linear_acceleration[i]


@compiled
def encode(o, error_published, outputs):
    """Set the records of the messages from the outputs o of the INS; error_published: 1 if it publishes ins/error."""
    data, changes = outputs[ATTITUDE_TOPIC], outputs[INS_ERROR_TOPIC]
    data.stamp = o.stamp_ns if o.due == 1 else NO_STAMP
    for i in range(4):
        data.orientation[i] = o.quaternion[i]
    for i in range(3):
        data.angular_velocity[i], data.linear_acceleration[i] = o.angular_velocity[i], o.linear_acceleration[i]
        data.orientation_variance[i] = o.variance[i]
        changes.position[i], changes.velocity[i] = o.noise[i], o.walk[i]
    changes.stamp = data.stamp if error_published else NO_STAMP
    outputs[INS_STATE_TOPIC] = o.stage


@compiled
def begin(m, stamp, raw):
    """Prepare a step: apply the injected faults and read the inputs; m: record of either INS."""
    if schedule.pending(m.schedule, stamp):
        injected.apply_due_ins_faults(m, stamp)
    decode(m.inputs, raw)


@compiled
def end(m, stamp, outputs):
    """Finish a step: set its messages; m: record of either INS."""
    m.row += 1
    m.worst = max(m.worst, m.outputs.status)
    encode(m.outputs, m.error_published, outputs)
    if m.schedule.pending != 0:
        injected.corrupt_ins(m.injected, stamp, outputs)


@compiled
def model_law(memory, stamp, inputs, outputs):
    """Execute one step of method `model` at a stamp [ns]."""
    m = memory.record[0]
    begin(m, stamp, inputs[IMU_RAW_TOPIC])
    ins.step(m.state, m.constants, m.inputs, m.outputs, memory.normals[m.row])
    end(m, stamp, outputs)


@compiled
def aligning_law(memory, stamp, inputs, outputs):
    """Execute one step of an INS that aligns at a stamp [ns]."""
    m = memory.record[0]
    begin(m, stamp, inputs[IMU_RAW_TOPIC])
    aligning_ins.step(m.state, m.constants, m.inputs, m.outputs, memory.normals[m.row])
    end(m, stamp, outputs)


@compiled
def model_laws(memory, stamps, inputs, outputs):
    """Execute `model_law` for each row of arrays."""
    for k in range(len(stamps)):
        model_law(memory, stamps[k], inputs[k], outputs[k])


@compiled
def aligning_laws(memory, stamps, inputs, outputs):
    """Execute `aligning_law` for each row of arrays."""
    for k in range(len(stamps)):
        aligning_law(memory, stamps[k], inputs[k], outputs[k])


class Ins(Simulated):
    """The INS of an InsParameters."""
    NODE = nodes.row('ins')
    VERBS = table.INJECT_COMMANDS[NODE.name]
    LAWS = {ModelMemory: (model_law, model_laws), AligningMemory: (aligning_law, aligning_laws)}

    def __init__(self, parameters, reads):
        super().__init__(parameters, reads)
        self._noise = noise.generator(parameters.seed, self.NODE.name)
        normals = np.zeros((1, ins.INS_NORMALS_PER_STEP))
        model = parameters.method == 'model'
        constants = ins.constants(parameters) if model else aligning_ins.constants(parameters)
        faults = {'schedule': schedule.empty(), 'injected': injected.initial(constants['latency_ns'])}
        if model:
            record = joined(MODEL_RECORD_DTYPE, state=ins.initial_state(), constants=constants, **faults)
            self.memory = ModelMemory(record, normals)
        else:
            record = joined(ALIGNING_RECORD_DTYPE, state=aligning_ins.initial_state(constants), constants=constants,
                            **faults)
            self.memory = AligningMemory(record, normals)
        self.parts['error_published'] = parameters.error_told
        rate_noise = parameters.rate_noise if model else 0.0     # In a message, a covariance of zeros means unknown.
        self.messages[ATTITUDE_TOPIC].angular_velocity_covariance = (np.eye(3) * rate_noise**2).ravel()

    def block(self, steps):
        """Return the memory with noise (steps, INS_NORMALS_PER_STEP) drawn for the next steps."""
        self.parts['row'] = 0
        return self.memory._replace(normals=self._noise.standard_normal((steps, ins.INS_NORMALS_PER_STEP)))

    def diagnose(self):
        """Return the Diagnosis, with the estimated 1 sigmas of the INS among its values.

        The level is ERROR after a status other than OK since the last diagnosis, and WARN while the INS aligns.
        """
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
    def idle(numbers):
        """Return a reason if the attitude never changed: such a recording does not exercise the INS."""
        attitude = numbers.get(ATTITUDE_TOPIC, ())
        return '' if len(attitude) and np.ptp(attitude, axis=0).any() else 'the ship never moved'
