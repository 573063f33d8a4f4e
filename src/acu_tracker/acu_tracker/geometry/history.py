"""Stamped samples of the last steps, and their interpolation to an instant; used for the encoders and the attitude."""
from typing import Annotated

from pedestal_common.compiled import compiled
from pedestal_common.quantities import Floats, Seconds
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
    """Return (older row, newer row, fraction) of the samples around the instant t.

    The fraction runs from 0 at the older row to 1 at the newer row. Both rows are -1 if t is outside the history.
    """
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
    """Return the number in a column, interpolated linearly; rows: a result of `bracket` with valid rows."""
    i, j, f = rows
    a, b = history.sample[i, column], history.sample[j, column]
    return a + f * (b - a)
