"""Whether the receiver says the same again and again though the beam moves: what it measures has noise, and changes
with the beam."""
import numpy as np

from pedestal_common.compiled import compiled

REPETITION_DTYPE = np.dtype([('said', 'f8', (3,)), ('at', 'f8', (2,))], align=True)
"""said: errors [rad] and C/N0 [dB-Hz]; at: deck angles [rad] of the beam when they were said first."""

REPETITION_TRAVEL_RAD = 3e-3
"""Way of the beam [rad] on which they must change."""


@compiled
def take(s, u, at):
    """Take an error of signals.INPUTS that was measured at a Pointing of the beam; whether it is a repetition."""
    if u.cross_elevation != s.said[0] or u.elevation != s.said[1] or u.cn0_dbhz != s.said[2]:
        s.said[0], s.said[1], s.said[2] = u.cross_elevation, u.elevation, u.cn0_dbhz
        s.at[0], s.at[1] = at.A, at.E
        return False
    return max(abs(at.A - s.at[0]), abs(at.E - s.at[1])) > REPETITION_TRAVEL_RAD
