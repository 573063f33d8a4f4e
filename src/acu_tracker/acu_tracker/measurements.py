"""Checks of the inputs of a step: encoders, attitude of the ship, error of the receiver, preset.

Valid inputs go into the state of the control unit. For invalid inputs the functions return flags, which are bits of
signals.INVALID_INPUTS.
"""
import math
from typing import TYPE_CHECKING

from acu_tracker import signals
from acu_tracker.estimation import target
from acu_tracker.estimation.filters import measurement
from acu_tracker.estimation.params import ErrorMatrixParameters, ReceiverModelParameters
from acu_tracker.geometry import attitude, attitude_error, direction, encoders
from acu_tracker.geometry.azimuth_turn import MAX_OFFSET_BEAMWIDTHS
from acu_tracker.signals import Inputs, Outputs
from pedestal_common.compiled import compiled
from pedestal_common.quantities import Radians

if TYPE_CHECKING:
    from acu_tracker.params import SharedParameters

UNKNOWN_POINTING = encoders.Pointing(math.nan, math.nan, math.nan, math.nan)
"""Result of error_at in the place of the Pointing of the beam, if no error is used."""


@compiled
def take_encoders(history: encoders.Encoders, inputs: Inputs) -> int:
    """Take the encoder angles of this step. Return signals.Flag.ENCODER if they are invalid, else 0."""
    taken = inputs.encoder_valid and encoders.take(history, inputs.stamp, inputs.position, inputs.velocity)
    return 0 if taken else signals.Flag.ENCODER


@compiled
def take_attitude(deck: attitude.DeckAttitude, params: 'SharedParameters', inputs: Inputs) -> tuple[int, bool]:
    """Take the attitude of this step, and the statistics of its error that the INS publishes.

    Return (flags of invalid values, True if the attitude is a new one).
    """
    if not inputs.stabilised:
        return 0, False
    flags = 0
    if inputs.attitude_error_came and not attitude_error.take(deck.error, inputs.attitude_noise, inputs.attitude_walk):
        flags = signals.Flag.ATTITUDE_ERROR
    if not inputs.attitude_valid:
        return flags | signals.Flag.ATTITUDE, False
    outcome = attitude.take(deck, params, inputs.stamp, inputs.attitude_stamp, inputs.quaternion, inputs.deck_rate,
                            inputs.aligning)
    return flags | (signals.Flag.ATTITUDE if outcome == attitude.SAMPLE_INVALID else 0), outcome == attitude.SAMPLE_NEW


@compiled
def correct_error(matrix: ErrorMatrixParameters, inputs: Inputs) -> None:
    """Multiply the error of a new message of the receiver with the matrix of its calibration.

    The rates of the error come from a tachometer, and stay as they are.
    """
    if inputs.error_came:
        x, e = inputs.cross_elevation, inputs.elevation
        inputs.cross_elevation, inputs.elevation = matrix.xx * x + matrix.xe * e, matrix.ex * x + matrix.ee * e


@compiled
def _wrong_level(history: encoders.Encoders, inputs: Inputs) -> int:
    """Return the flag of a message of the receiver with an invalid signal level or stamp, else 0.

    The modes that use the signal level use it also while the receiver is not locked.
    """
    if not inputs.error_came:
        return 0
    if not math.isfinite(inputs.cn0_dbhz):
        return signals.Flag.ERROR
    known, _ = encoders.at(history, inputs.error_stamp)
    return 0 if known else signals.Flag.ERROR_STAMP


@compiled
def error_at(history: encoders.Encoders, receiver: ReceiverModelParameters, inputs: Inputs, uses_level: bool,
             intended_offset: Radians) -> tuple[int, bool, encoders.Pointing]:
    """Return (flags of the receiver's message, True if its error is used, the Pointing of the beam at the error).

    uses_level       True if the mode uses the signal level
    intended_offset  angle by which the beam is off the target on purpose; no error is used if it is too large

    The receiver error is a weighted mean of samples; each sample is target minus beam. The mean of the target belongs
    to the instant receiver.age before the stamp of the error. The mean of the beam belongs to the instant
    receiver.beam_age before this stamp. The two ages may differ, because an electronic beam jumps from step to step
    (docs/graph.md, Age of the error). The pointing between two steps is interpolated linearly. For an axis of constant
    rate this is exact, whatever the weights of the samples are.
    """
    wrong = _wrong_level(history, inputs) if uses_level else 0
    if wrong or not inputs.error_valid:
        return wrong, False, UNKNOWN_POINTING
    if not math.isfinite(inputs.cross_elevation + inputs.elevation + inputs.cn0_dbhz):
        return signals.Flag.ERROR, False, UNKNOWN_POINTING
    if intended_offset > MAX_OFFSET_BEAMWIDTHS * receiver.beamwidth:
        return 0, False, UNKNOWN_POINTING
    known, pointing = encoders.at(history, inputs.error_stamp - receiver.beam_age)
    return 0 if known else signals.Flag.ERROR_STAMP, known, pointing


@compiled
def write_innovation(outputs: Outputs, outcome: int, innovation: measurement.Innovation) -> int:
    """Write the Innovation of an error to the outputs. Return the flag of the outcome, 0 for an accepted error.

    outcome: of target.take.
    """
    for i in range(2):
        axis = innovation.axis[i]
        outputs.innovation[i], outputs.rate_innovation[i], outputs.nis[i] = axis.nu, axis.rate, measurement.nis(axis)
        outputs.innovation_sigma[i] = math.nan if math.isnan(outputs.nis[0]) else math.sqrt(axis.S)
    if outcome == target.OUTCOME_NO_ATTITUDE:
        return signals.Flag.ATTITUDE
    if outcome == target.OUTCOME_STALE:
        return signals.Flag.ERROR_STAMP
    if outcome == target.OUTCOME_NOISY:
        return signals.Flag.ERROR_NOISY
    return signals.Flag.ERROR_GATED if outcome == target.OUTCOME_GATED else 0


@compiled
def take_preset(preset: direction.Direction, inputs: Inputs) -> int:
    """Take a new preset, if one has come. Return signals.Flag.PRESET if it is not finite, else 0."""
    if not inputs.preset_valid:
        return 0
    if not math.isfinite(inputs.preset[0] + inputs.preset[1]):
        return signals.Flag.PRESET
    direction.put(preset, inputs.preset)
    return 0
