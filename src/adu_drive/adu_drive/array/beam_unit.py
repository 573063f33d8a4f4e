"""Unit of one beam of an array. `beam_steering_node` runs one for each beam."""
import math
import typing
from collections.abc import Iterable, Mapping

import numpy as np

from adu_drive.array import electronic_beam
from adu_drive.array.params import BeamParameters
from drive_law.angle_drive import DRIVE_STATE_TOPIC, EMERGENCY_STOP_TEXT, ENABLED_TEXT, REFERENCE_TOPIC, AngleDrive
from pedestal_common.compiled import compiled
from pedestal_common.graph import nodes, topics
from pedestal_common.node.unit import LEVEL_ERROR, LEVEL_OK, LEVEL_WARN, Diagnosis
from pedestal_common.quantities import AnyRecord, Bit, Floats, Nanoseconds, Records, Stamps
from pedestal_common.record import Record
from pedestal_common.wire.records import NO_STAMP

JOINT_STATES_TOPIC, DRIVE_TRUTH_TOPIC, CLOCK_TOPIC = 'joint_states', 'adu/truth', 'clock'

STATE_CODE_ENABLED, STATE_CODE_DISABLED, STATE_CODE_EMERGENCY_STOP = (
    AngleDrive.STATE_TEXTS.index(text) for text in (ENABLED_TEXT, 'disabled', EMERGENCY_STOP_TEXT))
"""Codes of the texts of adu/state."""


class Switches(Record, align=False):
    """Switches of a beam."""
    wanted: Bit             # 1 at the start and after a request to enable; 0 after a request to disable
    emergency: Bit          # 1 while an emergency stop is latched
    stamp: Nanoseconds      # of the last step
    invalid: Bit            # 1 if a command since the last diagnosis was invalid


class UnitRecord(Record):
    """All data of a beam."""
    state: electronic_beam.State
    constants: electronic_beam.Constants
    inputs: electronic_beam.Inputs
    outputs: electronic_beam.Outputs
    switches: Switches


class Memory(typing.NamedTuple):
    """Memory of a beam."""
    record: Records         # UnitRecord (1,)


@compiled
def condition(switches: Switches) -> int:
    """Return the code of adu/state."""
    if switches.emergency:
        return STATE_CODE_EMERGENCY_STOP
    return STATE_CODE_ENABLED if switches.wanted else STATE_CODE_DISABLED


@compiled
def decode(beam_inputs: electronic_beam.Inputs, switches: Switches, command: AnyRecord) -> None:
    """Write a command into the inputs of the beam, at the stamp of the last step."""
    beam_inputs.stamp_ns = switches.stamp
    beam_inputs.due = 1 if command.stamp != NO_STAMP and condition(switches) == STATE_CODE_ENABLED else 0
    if beam_inputs.due == 1:
        beam_inputs.command_stamp_ns = command.stamp
        beam_inputs.position[0], beam_inputs.position[1] = command.position[0], command.position[1]


@compiled
def encode(beam_outputs: electronic_beam.Outputs, switches: Switches, stamp: Nanoseconds, outputs: AnyRecord) -> None:
    """Write the outputs of the beam into the records of its messages. A beam has no rate and no torque, and its
    reported angles are the true ones."""
    joints, truth = outputs[JOINT_STATES_TOPIC], outputs[DRIVE_TRUTH_TOPIC]
    joints.stamp = truth.stamp = outputs[CLOCK_TOPIC].stamp = stamp
    for i in range(2):
        joints.position[i] = truth.position[i] = beam_outputs.position[i]
    outputs[DRIVE_STATE_TOPIC] = condition(switches)


@compiled
def law(memory: Memory, stamp: Nanoseconds, inputs: AnyRecord, outputs: AnyRecord) -> None:
    """Advance from t_k-1 to t_k with the command of step k - 1. A beam that is not enabled ignores commands, and
    discards commands that are still delayed."""
    record = memory.record[0]
    if record.switches.stamp != NO_STAMP:
        decode(record.inputs, record.switches, inputs[REFERENCE_TOPIC])
        if condition(record.switches) != STATE_CODE_ENABLED:
            record.state.released = record.state.written
        electronic_beam.step(record.state, record.constants, record.inputs, record.outputs)
        record.switches.invalid |= record.outputs.invalid_command
    record.switches.stamp = stamp
    encode(record.outputs, record.switches, stamp, outputs)


@compiled
def laws(memory: Memory, stamps: Stamps, inputs: Records, outputs: Records) -> None:
    """Apply `law` to each element of arrays."""
    for k in range(len(stamps)):
        law(memory, stamps[k], inputs[k], outputs[k])


class Beam(AngleDrive):
    """One beam. The motion of the ship has no effect on a beam."""
    NODE, LAWS = nodes.ARRAY_DRIVE, {Memory: (law, laws)}
    parameters: BeamParameters
    memory: Memory

    def __init__(self, parameters: BeamParameters, reads: Iterable[str]) -> None:
        super().__init__(parameters, reads)
        p = parameters
        switches = Switches.of(wanted=1, stamp=NO_STAMP)
        constants = electronic_beam.constants(p.period, p.transport_delay, p.command_timeout * p.period)
        state = electronic_beam.initial_state(p.initial_azimuth, p.initial_elevation)
        self.memory = Memory(UnitRecord.of(constants=constants, switches=switches, state=state))
        electronic_beam.read(self.parts['state'], self.parts['outputs'])

    @property
    def condition_code(self) -> int:
        """Present code of STATE_TEXTS, also between two steps."""
        return condition(self.parts['switches'])

    def diagnose(self) -> Diagnosis:
        """Return the Diagnosis: ERROR in an emergency stop or after an invalid command, WARN while disabled."""
        outputs, switches = self.parts['outputs'], self.parts['switches']
        invalid, switches['invalid'] = switches['invalid'], 0
        values = [*((f'{axis}_deg', f'{math.degrees(angle):.4f}')
                    for axis, angle in zip(topics.AXES, outputs['position'])), ('state', self.condition)]
        if self.condition != ENABLED_TEXT:
            return Diagnosis(LEVEL_ERROR if switches['emergency'] else LEVEL_WARN, self.condition, values)
        if invalid:
            limit = electronic_beam.MAX_COMMAND_ANGLE_RAD
            return Diagnosis(LEVEL_ERROR, f'{REFERENCE_TOPIC} holds NaN or infinity, is not within +-{limit:g} rad, '
                             'or is not newer than the previous command: the beam stays', values)
        if outputs['stale']:
            limit = self.parameters.command_timeout * self.parameters.period
            return Diagnosis(LEVEL_ERROR, f'no new {REFERENCE_TOPIC} for {limit:g} s: the beam stays', values)
        return Diagnosis(LEVEL_OK, 'following', values)

    @staticmethod
    def idle(numbers: Mapping[str, Floats]) -> str:
        """Return the reason why a recording does not exercise a beam, '' if it does."""
        angles = numbers[REFERENCE_TOPIC][:, :2]        # Columns: two positions, then two rates.
        return '' if len(angles) and np.ptp(angles, axis=0).any() else 'the beam was never steered'
