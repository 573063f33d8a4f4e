"""Detection of a receiver that repeats its message while the beam moves.

Measured errors have noise and change with the direction of the beam. Errors that stay equal while the beam moves are
therefore repeated, and the filter must not use them.
"""
import numpy as np

from pedestal_common.compiled import compiled

REPETITION_DTYPE = np.dtype([('message', 'f8', (3,)), ('at', 'f8', (2,))], align=True)
"""Last message of the receiver.

message  cross-elevation error, elevation error [rad] and C/N0 [dB-Hz]
at       deck angles (azimuth, elevation) of the beam when these numbers came for the first time [rad]
"""

REPETITION_TRAVEL_RAD = 3e-3  # travel of the beam within which the message must change [rad]


@compiled
def take(s, u, at):
    """Take an error of the receiver; return True if it is repeated.

    s: record of REPETITION_DTYPE; u: record of signals.INPUTS_DTYPE; at: Pointing of the beam at the error.
    """
    if u.cross_elevation != s.message[0] or u.elevation != s.message[1] or u.cn0_dbhz != s.message[2]:
        s.message[0], s.message[1], s.message[2] = u.cross_elevation, u.elevation, u.cn0_dbhz
        s.at[0], s.at[1] = at.A, at.E
        return False
    return max(abs(at.A - s.at[0]), abs(at.E - s.at[1])) > REPETITION_TRAVEL_RAD
