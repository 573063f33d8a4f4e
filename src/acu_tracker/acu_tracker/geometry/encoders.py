"""The angles of the load encoders of both axes in the last steps, interpolated to any instant among these steps."""
import math
from collections import namedtuple
from typing import Annotated

from acu_tracker.geometry.history import HISTORY_LENGTH, History, bracket, interpolated, push
from pedestal_common.compiled import compiled
from pedestal_common.quantities import Floats


class Encoders(History):
    """History of the encoder angles."""
    sample: Annotated[Floats, (HISTORY_LENGTH, 4)]      # azimuth, elevation [rad], then their rates [rad/s]


Pointing = namedtuple('Pointing', 'A E dA dE')
"""Angles of the antenna [rad] and their rates [rad/s]: of the encoders, or of the beam in deck angles on the sky."""


@compiled
def take(s, stamp, position, velocity):
    """Take angles (2,) [rad] and rates (2,) [rad/s] of a step into the history;
    return False if they are not finite."""
    valid = math.isfinite(position[0] + position[1] + velocity[0] + velocity[1])
    if valid:
        row = push(s, stamp)
        for i in range(2):
            s.sample[row, i], s.sample[row, 2 + i] = position[i], velocity[i]
    return valid


@compiled
def at(s, t):
    """Return (True if the history covers t [s], the Pointing at t, of NaN if it does not)."""
    older, newer, fraction = bracket(s, t)
    rows, known = (older, newer, fraction), older >= 0
    if not known:
        return known, Pointing(math.nan, math.nan, math.nan, math.nan)
    return known, Pointing(interpolated(s, rows, 0), interpolated(s, rows, 1), interpolated(s, rows, 2),
                           interpolated(s, rows, 3))


@compiled
def taken(s, stamp):
    """Return True if the encoders of the step at this stamp [s] are in the history."""
    return s.count > 0 and s.stamp[s.newest] == stamp
