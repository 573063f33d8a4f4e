"""The law of the unit: it decodes the messages of a step, runs `control_unit.step`, and encodes the outputs."""
import math
from typing import NamedTuple

from acu_tracker import control_unit, signals
from acu_tracker.estimation import receiver_error
from acu_tracker.program import program_track
from pedestal_common.compiled import compiled
from pedestal_common.graph import topics
from pedestal_common.quantities import AnyRecord, Nanoseconds, Records, Stamps
from pedestal_common.record import Record
from pedestal_common.wire.inputs import taking
from pedestal_common.wire.records import NO_STAMP

JOINT_STATES_TOPIC, ATTITUDE_TOPIC = 'joint_states', 'ship/imu/data'
ANGLE_ERROR_TOPIC, ANGLE_RATE_TOPIC = 'tracking_receiver/angle_error', 'tracking_receiver/angle_rate'
RANGE_TOPIC, RATE_COMMAND_TOPIC = 'tracking_receiver/range', 'acu/rate_command'
ESTIMATE_TOPIC, REFERENCE_TOPIC, FILTER_TOPIC = 'acu/estimate', 'acu/reference', 'acu/filter'
MODE_TOPIC, KEYHOLE_TOPIC, BLOCKAGE_TOPIC, ALARMS_TOPIC = 'acu/mode', 'acu/keyhole', 'acu/blockage', 'acu/alarms'
DRIVE_STATE_TOPIC, INS_STATE_TOPIC, STOW_PINS_TOPIC = 'adu/state', 'ins/state', 'acu/stow_pins'
POINTING_TOPIC = 'acu/pointing'

# Number of the values of an axis on acu/filter; the last MODEL_COUNT are the probabilities of the motion models.
FILTER_COLUMN_COUNT, MODEL_COUNT = len(topics.FILTER_UNITS), len(topics.MOTION_MODELS)

# Code of the state `aligning`; an INS that has published no state, topics.NO_TEXT_CODE, counts as aligned.
INS_ALIGNING = topics.TOPIC_BY_NAME[INS_STATE_TOPIC].texts.index('aligning')


class UnitRecord(Record):
    """Records of the law."""
    state: control_unit.State
    constants: control_unit.Constants
    inputs: signals.Inputs
    outputs: signals.Outputs
    invalid: int    # bits of signals.INVALID_INPUTS that were set since the last diagnosis


class Memory(NamedTuple):
    """Memory of the law."""
    record: Records     # a UnitRecord (1,)
    tables: program_track.Tables   # tables that the modes follow


_take = taking(signals.INPUT_TOPICS)


@compiled
def decode(inputs: signals.Inputs, stamp: Nanoseconds, received: AnyRecord) -> None:
    """Convert the messages of a step into the inputs of the control unit.

    An attitude stays until the next one comes. A rate or a range is used only if an error has the same stamp.
    """
    _take(inputs, received)
    error, rate, distance = received[ANGLE_ERROR_TOPIC], received[ANGLE_RATE_TOPIC], received[RANGE_TOPIC]
    inputs.stamp, inputs.encoder_valid = stamp * 1e-9, 1
    inputs.error_valid = 1 if inputs.error_came and inputs.cross_elevation == inputs.cross_elevation else 0
    if rate.stamp == NO_STAMP or rate.stamp != error.stamp:
        inputs.error_rate[0] = inputs.error_rate[1] = math.nan
    if distance.stamp == NO_STAMP or distance.stamp != error.stamp:
        inputs.range = math.nan
    if received[ATTITUDE_TOPIC].stamp != NO_STAMP:
        inputs.attitude_valid = 1
    inputs.aligning = received[INS_STATE_TOPIC] == INS_ALIGNING
    inputs.drive_ready = inputs.drive <= signals.DRIVE_READY


@compiled
def encode(outputs: signals.Outputs, state: control_unit.State, stamp: Nanoseconds, sent: AnyRecord) -> None:
    """Convert the outputs of the control unit and the counts of its reports into its messages."""
    command, estimate, reference = sent[RATE_COMMAND_TOPIC], sent[ESTIMATE_TOPIC], sent[REFERENCE_TOPIC]
    command.stamp = estimate.stamp = reference.stamp = sent[FILTER_TOPIC].stamp = stamp
    for i in range(2):
        command.velocity[i], command.effort[i] = outputs.rate[i], outputs.torque[i]
        estimate.position[i], reference.position[i] = outputs.estimate[i, 0], outputs.reference[i, 0]
        estimate.velocity[i], reference.velocity[i] = outputs.estimate[i, 1], outputs.reference[i, 1]
        estimate.acceleration[i], reference.acceleration[i] = outputs.estimate[i, 2], outputs.reference[i, 2]
        # In the order of topics.FILTER.
        numbers = sent[FILTER_TOPIC].position[i * FILTER_COLUMN_COUNT:]
        numbers[0], numbers[1], numbers[2] = outputs.innovation[i], outputs.rate_innovation[i], outputs.nis[i]
        numbers[3], numbers[4] = math.sqrt(outputs.covariance[i, 0]), math.sqrt(outputs.covariance[i, 2])
        numbers[5] = outputs.covariance[i, 1] / (numbers[3] * numbers[4])
        numbers[6] = outputs.innovation_sigma[i]
        for j in range(MODEL_COUNT):
            numbers[FILTER_COLUMN_COUNT - MODEL_COUNT + j] = outputs.probability[i, j]
    lookahead = state.guidance.lookahead
    sent[MODE_TOPIC] = outputs.mode
    sent[KEYHOLE_TOPIC], sent[BLOCKAGE_TOPIC] = lookahead.forecasts - 1, lookahead.blockages - 1
    sent[ALARMS_TOPIC], sent[STOW_PINS_TOPIC] = outputs.alarms, outputs.pins
    sent[POINTING_TOPIC] = state.tracking.pointing.report


@compiled
def law(memory: Memory, stamp: Nanoseconds, inputs: AnyRecord, outputs: AnyRecord) -> None:
    """Run one step, as the law of a pedestal_common.node.unit.Unit."""
    record = memory.record[0]
    decode(record.inputs, stamp, inputs)
    receiver_error.correct_error(record.constants.p.tracker.matrix, record.inputs)
    control_unit.step(record.state, record.constants, record.inputs, record.outputs, memory.tables)
    record.inputs.preset_valid = 0
    record.invalid |= record.outputs.invalid_input
    encode(record.outputs, record.state, stamp, outputs)


@compiled
def laws(memory: Memory, stamps: Stamps, inputs: Records, outputs: Records) -> None:
    """Run `law` for arrays of stamps, inputs and outputs."""
    for k in range(len(stamps)):
        law(memory, stamps[k], inputs[k], outputs[k])
