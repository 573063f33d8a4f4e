"""The program track in segments, as they are received: appended while it runs, with gaps where rows are missing.

A turnaround is the motion of the axes from the last row of one segment to the first row of the next.
"""
import math
import typing

import numpy as np

from acu_tracker.program.program_track import NO_TRACK, ProgramTrack, ProgramTrackError, checked
from pedestal_common.graph.topics import AXES

MAX_GAP_INTERVALS = 3.0
"""Largest gap between two segments that are joined [row intervals]. The row interval is the shorter one of the last
interval of the earlier segment and the first interval of the later segment."""


class TurnaroundError(ProgramTrackError):
    """A segment that begins where the axes cannot be in time; the message names axis, value and limit."""


class DuePiece(typing.NamedTuple):
    """The piece to follow at a stamp.

    in_gap: True if rows are missing at the stamp, because the piece begins later; until: stamp [s] at which another
    piece follows, inf for none.
    """
    piece: ProgramTrack
    in_gap: bool
    until: float


class Segments:
    """The pieces of a program track without a gap, in order of time.

    limits: (rate [rad/s], acceleration [rad/s2]) of each axis, by which a turnaround between two segments is judged.
    """

    def __init__(self, limits):
        self._limits = limits
        self._pieces = []

    def append(self, times, angles, now, followed):
        """Take a segment. Raises ProgramTrackError, without a change.

        A segment that begins at `now` [s] or before is another program and replaces all pieces. A later segment
        replaces the rows from its first row on, and is joined to the rows before it unless there is a gap. `followed`:
        whether a mode follows the track, so that turnarounds are checked.
        """
        new = checked(times, angles)
        if new.times[0] <= now:
            self._pieces = [new]
            return
        # A single row gives no path.
        kept = [rows for rows in (_rows(piece, now, new.times[0]) for piece in self._pieces) if len(rows.times) >= 2]
        if kept:
            if followed:
                self._check_turnaround(kept[-1], new)
            interval = min(_last_interval(kept[-1]), new.times[1] - new.times[0])
            if new.times[0] - kept[-1].times[-1] <= MAX_GAP_INTERVALS * interval:
                last = kept.pop()
                new = checked(np.append(last.times, new.times), np.vstack((last.angles, new.angles)))
        self._pieces = [*kept, new]

    def _check_turnaround(self, before, after):
        """Raise TurnaroundError if the axes would exceed their rate or acceleration,
        on average between one segment and the next."""
        time = after.times[0] - before.times[-1]
        for i, axis in enumerate(AXES):
            max_rate, max_acceleration = self._limits[i]
            rate_before, rate_after = _rate(before, -2, i), _rate(after, 0, i)
            distance = after.angles[0, i] - before.angles[-1, i]
            rate = abs(math.remainder(distance, 2.0 * math.pi) if i == 0 else distance) / time
            acceleration = abs(rate_after - rate_before) / time
            if rate > max_rate:
                raise TurnaroundError(f'turnaround too fast: {axis} {math.degrees(rate):.4g} deg/s; must be at most '
                                      f'{math.degrees(max_rate):.4g} deg/s')
            if acceleration > max_acceleration:
                raise TurnaroundError(f'turnaround too fast: {axis} {math.degrees(acceleration):.4g} deg/s2; must be '
                                      f'at most {math.degrees(max_acceleration):.4g} deg/s2')

    def at(self, t):
        """Return the DuePiece at t [s]: the first piece that has not ended, or the last piece."""
        for number, piece in enumerate(self._pieces):
            if t < piece.times[-1] or number + 1 == len(self._pieces):
                more = number + 1 < len(self._pieces)
                return DuePiece(piece, number > 0 and t < piece.times[0], piece.times[-1] if more else math.inf)
        return DuePiece(NO_TRACK, False, math.inf)


def _rows(piece, begin, end):
    """Return the rows of a piece from three before `begin` [s], but at least its last three,
    to `end` [s] (exclusive).

    Because the slope at a row follows from its neighbours, three rows keep the path at `begin` as it was. Three rows
    also give the slope at the end of a piece.
    """
    first = max(min(int(np.searchsorted(piece.times, begin)), len(piece.times)) - 3, 0)
    last = int(np.searchsorted(piece.times, end))
    return ProgramTrack(piece.times[first:last], piece.angles[first:last])


def _last_interval(piece):
    """Return the time [s] between the last two rows of a piece."""
    return piece.times[-1] - piece.times[-2]


def _rate(piece, row, i):
    """Return the rate [rad/s] of axis i between a row of a piece and the next."""
    distance = piece.angles[row + 1, i] - piece.angles[row, i]
    distance = math.remainder(distance, 2.0 * math.pi) if i == 0 else distance
    return distance / (piece.times[row + 1] - piece.times[row])
