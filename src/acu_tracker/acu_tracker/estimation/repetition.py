"""Detection of a receiver that repeats its message while the beam moves:
real errors have noise, and change with the beam."""
import numpy as np

from pedestal_common.compiled import compiled

REPETITION_DTYPE = np.dtype([('message', 'f8', (3,)), ('at', 'f8', (2,))], align=True)
"""message: errors [rad] and C/N0 [dB-Hz]; at: deck angles [rad] of the beam when this message first came."""

REPETITION_TRAVEL_RAD = 3e-3
"""Travel of the beam [rad] within which the message must change."""


@compiled
def take(s, u, at):
    """Take an error u (record of signals.INPUTS_DTYPE) that was measured at a Pointing of the beam;
    return True if it is a repetition."""
    if u.cross_elevation != s.message[0] or u.elevation != s.message[1] or u.cn0_dbhz != s.message[2]:
        s.message[0], s.message[1], s.message[2] = u.cross_elevation, u.elevation, u.cn0_dbhz
        s.at[0], s.at[1] = at.A, at.E
        return False
    return max(abs(at.A - s.at[0]), abs(at.E - s.at[1])) > REPETITION_TRAVEL_RAD
