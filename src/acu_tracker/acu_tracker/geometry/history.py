"""Stamped samples of the last steps, interpolated to any instant among these steps; and those of the load encoders."""
import math
from typing import Annotated, NamedTuple

from pedestal_common.compiled import compiled
from pedestal_common.quantities import Floats, Pair, Radians, RadiansPerSecond, Seconds
from pedestal_common.record import Record

HISTORY_LENGTH = 64  # number of samples in a history

MAX_DELAY_STEPS = HISTORY_LENGTH - 4
"""Longest delay for which a history holds the sample [steps]. Four steps are a margin for stamps between the steps and
ahead of them."""


class History(Record, open=True):
    """Ring buffer of HISTORY_LENGTH rows. A subclass declares how many numbers a row has."""
    stamp: Annotated[Floats, (HISTORY_LENGTH,)]     # time of each row [s]
    sample: Floats          # (HISTORY_LENGTH, width)
    newest: int             # row of the last sample
    count: int              # number of rows in use


@compiled
def push(history: History, stamp: Seconds) -> int:
    """Append a stamp newer than all others; return the row of its sample, which the caller fills."""
    history.newest = (history.newest + 1) % HISTORY_LENGTH
    history.stamp[history.newest] = stamp
    history.count = min(history.count + 1, HISTORY_LENGTH)
    return history.newest


@compiled
def bracket(history: History, t: Seconds) -> tuple[int, int, float]:
    """Return (older row, newer row, fraction) of the samples around t; both rows are -1 if t is outside the history.
    The fraction runs from 0 at the older row to 1 at the newer row."""
    newer = history.newest
    if history.count == 0 or not t <= history.stamp[newer]:
        return -1, -1, 0.0
    if t == history.stamp[newer]:
        return newer, newer, 0.0
    for _ in range(history.count - 1):
        older = (newer - 1) % HISTORY_LENGTH
        if history.stamp[older] <= t:
            return older, newer, (t - history.stamp[older]) / (history.stamp[newer] - history.stamp[older])
        newer = older
    return -1, -1, 0.0


@compiled
def interpolated(history: History, rows: tuple[int, int, float], column: int) -> float:
    """Return the number in a column, interpolated linearly; rows: a valid result of `bracket`."""
    i, j, f = rows
    a, b = history.sample[i, column], history.sample[j, column]
    return a + f * (b - a)


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
def take_encoders(history: Encoders, stamp: Seconds, position: Pair, velocity: Pair) -> bool:
    """Take angles [rad] and rates [rad/s] of a step into the history; return False if they are not finite."""
    valid = math.isfinite(position[0] + position[1] + velocity[0] + velocity[1])
    if valid:
        row = push(history, stamp)
        for i in range(2):
            history.sample[row, i], history.sample[row, 2 + i] = position[i], velocity[i]
    return valid


@compiled
def encoders_at(history: Encoders, t: Seconds) -> tuple[bool, Pointing]:
    """Return (True if the history covers t, the Pointing at t, of NaN if it does not)."""
    older, newer, fraction = bracket(history, t)
    rows, known = (older, newer, fraction), older >= 0
    if not known:
        return known, Pointing(math.nan, math.nan, math.nan, math.nan)
    return known, Pointing(interpolated(history, rows, 0), interpolated(history, rows, 1),
                           interpolated(history, rows, 2), interpolated(history, rows, 3))


@compiled
def encoders_taken(history: Encoders, stamp: Seconds) -> bool:
    """Return True if the encoders of the step at this stamp are in the history."""
    return history.count > 0 and history.stamp[history.newest] == stamp
