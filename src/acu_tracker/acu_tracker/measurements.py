"""Checks of the inputs of a step: encoders, attitude of the ship, preset.

Valid inputs go into the state of the control unit. For invalid inputs the functions return flags, which are bits of
signals.INVALID_INPUTS.
"""
import math
from typing import TYPE_CHECKING

from acu_tracker import signals
from acu_tracker.geometry import attitude, direction, history
from acu_tracker.signals import Inputs
from pedestal_common.compiled import compiled

if TYPE_CHECKING:
    from acu_tracker.params import SharedParameters


@compiled
def take_encoders(encoders: history.Encoders, inputs: Inputs) -> int:
    """Take the encoder angles of this step. Return signals.Flag.ENCODER if they are invalid, else 0."""
    taken = inputs.encoder_valid and history.take_encoders(encoders, inputs.stamp, inputs.position, inputs.velocity)
    return 0 if taken else signals.Flag.ENCODER


@compiled
def take_attitude(deck: attitude.DeckAttitude, params: 'SharedParameters', inputs: Inputs) -> tuple[int, bool]:
    """Take the attitude of this step, and the statistics of its error that the INS publishes.

    Return (flags of invalid values, True if the attitude is a new one).
    """
    if not inputs.stabilised:
        return 0, False
    flags = 0
    if inputs.attitude_error_came and not attitude.take_statistics(deck.error, inputs.attitude_noise,
                                                                   inputs.attitude_walk):
        flags = signals.Flag.ATTITUDE_ERROR
    if not inputs.attitude_valid:
        return flags | signals.Flag.ATTITUDE, False
    outcome = attitude.take(deck, params, inputs.stamp, inputs.attitude_stamp, inputs.quaternion, inputs.deck_rate,
                            inputs.aligning)
    return flags | (signals.Flag.ATTITUDE if outcome == attitude.SAMPLE_INVALID else 0), outcome == attitude.SAMPLE_NEW


@compiled
def take_preset(preset: direction.Direction, inputs: Inputs) -> int:
    """Take a new preset, if one has come. Return signals.Flag.PRESET if it is not finite, else 0."""
    if not inputs.preset_valid:
        return 0
    if not math.isfinite(inputs.preset[0] + inputs.preset[1]):
        return signals.Flag.PRESET
    direction.put(preset, inputs.preset)
    return 0
