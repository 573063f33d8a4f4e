"""Detection of a receiver that repeats its message while the beam moves.

Measured errors have noise and change with the direction of the beam. Errors that stay equal while the beam moves are
therefore repeated, and the filter must not use them.
"""

from acu_tracker.geometry.encoders import Pointing
from acu_tracker.signals import Inputs
from pedestal_common.compiled import compiled
from pedestal_common.quantities import Pair, Vector3
from pedestal_common.record import Record


class Repetition(Record):
    """Last message of the receiver."""
    message: Vector3    # cross-elevation error, elevation error [rad] and C/N0 [dB-Hz]
    at: Pair            # deck angles of the beam when these numbers came for the first time [rad]


REPETITION_TRAVEL_RAD = 3e-3  # travel of the beam within which the message must change [rad]


@compiled
def take(state: Repetition, inputs: Inputs, at: Pointing) -> bool:
    """Take an error of the receiver; return True if it is repeated.

    at: direction of the beam at the error.
    """
    last = state.message
    if inputs.cross_elevation != last[0] or inputs.elevation != last[1] or inputs.cn0_dbhz != last[2]:
        last[0], last[1], last[2] = inputs.cross_elevation, inputs.elevation, inputs.cn0_dbhz
        state.at[0], state.at[1] = at.A, at.E
        return False
    return max(abs(at.A - state.at[0]), abs(at.E - state.at[1])) > REPETITION_TRAVEL_RAD
