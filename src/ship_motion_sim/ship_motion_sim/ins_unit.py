"""The unit of the INS: IMU data in; attitude, deck rate and the state of the alignment out.

Method `model` has the true attitude with stated errors and never publishes a state; the others align by themselves.
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

(IMU_RAW_TOPIC, ATTITUDE_TOPIC, INS_STATE_TOPIC, INS_ERROR_TOPIC) = ('ship/imu/data_raw', 'ship/imu/data', 'ins/state',
                                                                     'ins/error')


def _record_of(state, constants):
    """The record of an INS. error_told: whether it says how its error changes; row: of the noise that the next step
    takes; worst: the highest status since the last diagnosis."""
    return np.dtype([('state', state), ('constants', constants), ('inputs', ins.INPUTS_DTYPE),
                     ('outputs', ins.OUTPUTS_DTYPE),
                     ('error_told', 'i8'), ('row', 'i8'), ('worst', 'i8'), ('schedule', schedule.SCHEDULE_DTYPE),
                     ('injected', injected.INS_INJECTED_DTYPE)], align=True)


MODEL_RECORD_DTYPE = _record_of(ins.STATE_DTYPE, ins.CONSTANTS_DTYPE)
ALIGNING_RECORD_DTYPE = _record_of(aligning_ins.STATE_DTYPE, aligning_ins.CONSTANTS_DTYPE)


class ModelMemory(typing.NamedTuple):
    """All the INS of method `model` works on: the noise of the next steps."""
    record: np.ndarray
    normals: np.ndarray


class AligningMemory(typing.NamedTuple):
    """All an aligning INS works on; a type of its own, so that a run with the model does not compile its law."""
    record: np.ndarray
    normals: np.ndarray


@compiled
def decode(u, raw):
    """Record of an IMU message -> inputs of the INS."""
    u.stamp_ns = raw.stamp
    for i in range(3):
        u.angular_velocity[i], u.linear_acceleration[i] = raw.angular_velocity[i], raw.linear_acceleration[i]


@compiled
def encode(o, error_told, outputs):
    """Outputs of the INS -> records of its messages; error_told: whether it says how its error changes."""
    data, changes = outputs[ATTITUDE_TOPIC], outputs[INS_ERROR_TOPIC]
    data.stamp = o.stamp_ns if o.due == 1 else NO_STAMP
    for i in range(4):
        data.orientation[i] = o.quaternion[i]
    for i in range(3):
        data.angular_velocity[i], data.linear_acceleration[i] = o.angular_velocity[i], o.linear_acceleration[i]
        data.orientation_variance[i] = o.variance[i]
        changes.position[i], changes.velocity[i] = o.noise[i], o.walk[i]
    changes.stamp = data.stamp if error_told else NO_STAMP
    outputs[INS_STATE_TOPIC] = o.stage


@compiled
def begin(m, stamp, raw):
    """Before a step: break what is broken in it, and read its inputs; m: record of either INS."""
    if schedule.pending(m.schedule, stamp):
        injected.apply_due_ins_faults(m, stamp)
    decode(m.inputs, raw)


@compiled
def end(m, stamp, outputs):
    """After a step: publish its outputs."""
    m.row += 1
    m.worst = max(m.worst, m.outputs.status)
    encode(m.outputs, m.error_told, outputs)
    if m.schedule.pending != 0:
        injected.corrupt_ins(m.injected, stamp, outputs)


@compiled
def model_law(memory, stamp, inputs, outputs):
    """Step k of method `model`."""
    m = memory.record[0]
    begin(m, stamp, inputs[IMU_RAW_TOPIC])
    ins.step(m.state, m.constants, m.inputs, m.outputs, memory.normals[m.row])
    end(m, stamp, outputs)


@compiled
def aligning_law(memory, stamp, inputs, outputs):
    """Step k of an INS that aligns."""
    m = memory.record[0]
    begin(m, stamp, inputs[IMU_RAW_TOPIC])
    aligning_ins.step(m.state, m.constants, m.inputs, m.outputs, memory.normals[m.row])
    end(m, stamp, outputs)


@compiled
def model_laws(memory, stamps, inputs, outputs):
    """`model_law` over arrays."""
    for k in range(len(stamps)):
        model_law(memory, stamps[k], inputs[k], outputs[k])


@compiled
def aligning_laws(memory, stamps, inputs, outputs):
    """`aligning_law` over arrays."""
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
        faults = {'schedule': schedule.empty(),
                  'injected': injected.initial(constants['latency_ns'])}
        if model:
            self.memory = ModelMemory(joined(MODEL_RECORD_DTYPE, state=ins.initial_state(), constants=constants,
                                             **faults),
                                      normals)
        else:
            self.memory = AligningMemory(joined(ALIGNING_RECORD_DTYPE, state=aligning_ins.initial_state(constants),
                                                constants=constants, **faults), normals)
        self.parts['error_told'] = parameters.error_told
        rate_noise = parameters.rate_noise if model else 0.0     # zeros: unknown
        self.messages[ATTITUDE_TOPIC].angular_velocity_covariance = (np.eye(3) * rate_noise**2).ravel()

    def block(self, steps):
        """The memory with noise (steps, NORMALS) drawn for the next steps."""
        self.parts['row'] = 0
        return self.memory._replace(normals=self._noise.standard_normal((steps, ins.INS_NORMALS_PER_STEP)))

    def diagnose(self):
        """ERROR with the worst status since the last diagnosis, WARN while it aligns; values: its own 1 sigmas."""
        outputs, status = self.parts['outputs'], int(self.parts['worst'])
        self.parts['worst'] = 0
        stage, sigma, p = int(outputs['stage']), outputs['variance']**0.5, self.parameters
        values = [('latency_s', f'{p.latency:g}')]
        known = self.parts['state']['released'] > 0
        if known:
            values.append(('heading_error_rms_rad', f'{sigma[2]:g}'))
        if stage != ins.NO_STAGE:
            values += [('method', p.method), ('state', navigator.STAGES[stage])]
            if known:
                values.append(('level_error_rms_rad', f'{sigma[0]:g}'))
        if stage == navigator.STAGE_NAVIGATING:
            values += [(f'velocity_{axis}', f'{v:.3f}') for axis, v in zip(('east', 'north', 'up'),
                                                                           outputs['velocity'])]
        if status:
            return Diagnosis(LEVEL_ERROR, ins.INS_STATUS_TEXTS[status], values)
        if stage == navigator.STAGE_ALIGNING:
            heading, wanted = (math.degrees(x) for x in (sigma[2], p.alignment.aligned_sigma))
            so_far = f'heading known to {heading:.2g} deg (1 sigma)' if known else 'heading not known yet'
            return Diagnosis(LEVEL_WARN, f'aligning: {so_far}, navigates from {wanted:.2g} deg on', values)
        return Diagnosis(LEVEL_OK, 'navigating', values)

    @staticmethod
    def idle(numbers):
        """Not exercised where the attitude never changed."""
        moved = (ATTITUDE_TOPIC in numbers and len(numbers[ATTITUDE_TOPIC]) and np.ptp(numbers[ATTITUDE_TOPIC],
                                                                                       axis=0).any())
        return '' if moved else 'the ship never moved'
