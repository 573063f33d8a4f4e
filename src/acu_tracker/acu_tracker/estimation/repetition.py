"""Detection of a receiver that repeats its message while the beam moves.

Measured errors have noise and change with the direction of the beam. Errors that stay equal while the beam moves are
therefore repeated, and the filter must not use them.
"""

from pedestal_common.compiled import compiled
from pedestal_common.quantities import Pair, Vector3
from pedestal_common.record import Record


class Repetition(Record):
    """Last message of the receiver."""
    message: Vector3  # cross-elevation error, elevation error [rad] and C/N0 [dB-Hz]
    at: Pair  # deck angles (azimuth, elevation) of the beam when these numbers came for the first time [rad]


REPETITION_TRAVEL_RAD = 3e-3  # travel of the beam within which the message must change [rad]


@compiled
def take(s, u, at):
    """Take an error of the receiver; return True if it is repeated.

    s: record of Repetition; u: record of signals.Inputs.dtype; at: Pointing of the beam at the error.
    """
    if u.cross_elevation != s.message[0] or u.elevation != s.message[1] or u.cn0_dbhz != s.message[2]:
        s.message[0], s.message[1], s.message[2] = u.cross_elevation, u.elevation, u.cn0_dbhz
        s.at[0], s.at[1] = at.A, at.E
        return False
    return max(abs(at.A - s.at[0]), abs(at.E - s.at[1])) > REPETITION_TRAVEL_RAD
