"""The angles of the load encoders of both axes in the last steps, interpolated to any instant among these steps."""
import math
from typing import Annotated, NamedTuple

from acu_tracker.geometry.history import HISTORY_LENGTH, History, bracket, interpolated, push
from pedestal_common.compiled import compiled
from pedestal_common.quantities import Floats, Pair, Radians, RadiansPerSecond, Seconds


class Encoders(History):
    """History of the encoder angles."""
    sample: Annotated[Floats, (HISTORY_LENGTH, 4)]      # azimuth, elevation [rad], then their rates [rad/s]


class Pointing(NamedTuple):
    """Angles of the antenna and their rates: of the encoders, or of the beam in deck angles on the sky."""
    A: Radians
    E: Radians
    dA: RadiansPerSecond
    dE: RadiansPerSecond


@compiled
def take(history: Encoders, stamp: Seconds, position: Pair, velocity: Pair) -> bool:
    """Take angles [rad] and rates [rad/s] of a step into the history; return False if they are not finite."""
    valid = math.isfinite(position[0] + position[1] + velocity[0] + velocity[1])
    if valid:
        row = push(history, stamp)
        for i in range(2):
            history.sample[row, i], history.sample[row, 2 + i] = position[i], velocity[i]
    return valid


@compiled
def at(history: Encoders, t: Seconds) -> tuple[bool, Pointing]:
    """Return (True if the history covers t, the Pointing at t, of NaN if it does not)."""
    older, newer, fraction = bracket(history, t)
    rows, known = (older, newer, fraction), older >= 0
    if not known:
        return known, Pointing(math.nan, math.nan, math.nan, math.nan)
    return known, Pointing(interpolated(history, rows, 0), interpolated(history, rows, 1),
                           interpolated(history, rows, 2), interpolated(history, rows, 3))


@compiled
def taken(history: Encoders, stamp: Seconds) -> bool:
    """Return True if the encoders of the step at this stamp are in the history."""
    return history.count > 0 and history.stamp[history.newest] == stamp
