"""The program track in segments, as they are sent: appended while it runs, with gaps where rows are missing."""
import math

import numpy as np

from acu_tracker.program.program_track import NO_TRACK, ProgramTrack, ProgramTrackError, checked
from pedestal_common.graph.topics import AXES

MAX_GAP_INTERVALS = 3.0
"""A segment goes on with the one before where its first row is at most so many of their intervals, the shorter one,
later."""


class TurnaroundError(ProgramTrackError):
    """A segment begins where the axes cannot be in time; the message names axis, value and what is allowed."""


class Segments:
    """The pieces of a program track without a gap, in order of time.

    limits: (rate [rad/s], acceleration [rad/s2]) of each axis, by which a turnaround between two segments is judged.
    """

    def __init__(self, limits):
        self._limits = limits
        self._pieces = []

    def append(self, times, angles, now, followed):
        """Take a segment. One that begins now or before is another program and takes the place of all; one that begins
        later takes the place of the rows from its first one on, and goes on with those before where there is no gap.
        now: stamp [s]; followed: whether the track is, so that turnarounds count. Raises ProgramTrackError, and
        nothing is changed."""
        new = checked(times, angles)
        if new.times[0] <= now:
            self._pieces = [new]
            return
        kept = [rows for rows in (_rows(piece, now, new.times[0]) for piece in self._pieces) if len(rows.times) >= 2]
        if kept:
            if followed:
                self._check_turnaround(kept[-1], new)
            if new.times[0] - kept[-1].times[-1] <= MAX_GAP_INTERVALS * min(_last_interval(kept[-1]), new.times[1]
                                                                            - new.times[0]):
                last = kept.pop()
                new = checked(np.append(last.times, new.times), np.vstack((last.angles, new.angles)))
        self._pieces = [*kept, new]

    def _check_turnaround(self, before, after):
        """Raise TurnaroundError where the axes would have to turn or to accelerate faster than they are allowed to on
        their way from one segment to the next: at a constant acceleration in the mean."""
        time = after.times[0] - before.times[-1]
        for i, axis in enumerate(AXES):
            most_rate, most_acceleration = self._limits[i]
            left, came = _rate(before, -2, i), _rate(after, 0, i)
            way = after.angles[0, i] - before.angles[-1, i]
            rate = abs(math.remainder(way, 2.0 * math.pi) if i == 0 else way) / time
            acceleration = abs(came - left) / time
            if rate > most_rate:
                raise TurnaroundError(f'turnaround too fast: {axis} {rate:g} rad/s; must be at most {most_rate:g}')
            if acceleration > most_acceleration:
                raise TurnaroundError(f'turnaround too fast: {axis} {acceleration:g} rad/s2; must be at most '
                                      f'{most_acceleration:g}')

    def at(self, t):
        """(the piece to follow at t [s], whether rows are missing there, stamp [s] from which on another one is): the
        first that has not ended, or the last."""
        for number, piece in enumerate(self._pieces):
            if t < piece.times[-1] or number + 1 == len(self._pieces):
                more = number + 1 < len(self._pieces)
                return piece, number > 0 and t < piece.times[0], piece.times[-1] if more else math.inf
        return NO_TRACK, False, math.inf


def _rows(piece, begin, end):
    """The rows of a piece from three before `begin` [s], its last three at least, until before `end` [s]."""
    first = max(min(int(np.searchsorted(piece.times, begin)), len(piece.times)) - 3, 0)
    last = int(np.searchsorted(piece.times, end))
    return ProgramTrack(piece.times[first:last], piece.angles[first:last])


def _last_interval(piece):
    return piece.times[-1] - piece.times[-2]


def _rate(piece, row, i):
    """Rate [rad/s] of axis i between a row of a piece and the next."""
    way = piece.angles[row + 1, i] - piece.angles[row, i]
    return (math.remainder(way, 2.0 * math.pi) if i == 0 else way) / (piece.times[row + 1] - piece.times[row])
