"""The program track in segments: messages that an operator sends one after the other while the track is followed.

A segment is one table. Two segments without a gap, a time in which rows are missing, are joined to one piece. A
turnaround is the motion of the axes from the last row of one segment to the first row of the next.
"""
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from acu_tracker.program.program_track import NO_TRACK, ProgramTrack, ProgramTrackError, checked
from pedestal_common.graph.topics import AXES
from pedestal_common.quantities import Message, Pairs, RadiansPerSecond, RadiansPerSecond2, Seconds, Times

MAX_GAP_INTERVALS = 3.0
"""Longest time between two segments that counts as no gap, in row intervals. The row interval is the shorter of two
times: between the last two rows of the earlier segment, and between the first two rows of the later one."""


class TurnaroundError(ProgramTrackError):
    """Error of a segment whose first row the axes cannot reach in time; the message names axis, value and limit."""


class DuePiece(NamedTuple):
    """The piece that is due at a stamp."""
    piece: ProgramTrack
    # True if the stamp is between the end of the piece before and the beginning of this piece, where rows are missing
    in_gap: bool
    until: Seconds  # end of this piece, from which on the next piece is due; inf: no next piece


class Segments:
    """The pieces of a program track, in order of time; inside a piece there is no gap. limits: (rate, acceleration) of
    each axis, which a turnaround must not exceed."""

    def __init__(self, limits: Sequence[tuple[RadiansPerSecond, RadiansPerSecond2]]) -> None:
        self._limits = limits
        self._pieces: list[ProgramTrack] = []

    def append(self, times: Times, angles: Pairs, now: Seconds, followed: bool) -> None:
        """Take a segment; for a wrong one raise ProgramTrackError and change nothing. If a mode follows the track
        (followed), turnarounds are checked.

        A segment that begins at `now` or before is a new program and replaces all pieces. A later segment replaces the
        rows from its first row on. The later segment is joined to the rows before it unless there is a gap.
        """
        new = checked(times, angles)
        if new.times[0] <= now:
            self._pieces = [new]
            return
        # A single row gives no path.
        kept = [rows for rows in (_rows(piece, now, new.times[0]) for piece in self._pieces) if len(rows.times) >= 2]
        if kept:
            last = kept[-1]
            if followed:
                self._check_turnaround(last, new)
            interval = min(last.times[-1] - last.times[-2], new.times[1] - new.times[0])
            if new.times[0] - last.times[-1] <= MAX_GAP_INTERVALS * interval:
                kept.pop()
                new = checked(np.append(last.times, new.times), np.vstack((last.angles, new.angles)))
        self._pieces = [*kept, new]

    def _check_turnaround(self, before: ProgramTrack, after: ProgramTrack) -> None:
        """Raise TurnaroundError if the mean rate or acceleration of an axis on the way exceeds its limit."""
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

    def at(self, t: Seconds) -> DuePiece:
        """Return the DuePiece at t: the first piece that has not ended, or the last piece."""
        for number, piece in enumerate(self._pieces):
            if t < piece.times[-1] or number + 1 == len(self._pieces):
                more = number + 1 < len(self._pieces)
                return DuePiece(piece, number > 0 and t < piece.times[0], piece.times[-1] if more else math.inf)
        return DuePiece(NO_TRACK, False, math.inf)


def rows(message: Message) -> tuple[Times, Pairs]:
    """Return (times since the stamp, angles) of a JointTrajectory; raise ValueError for a missing axis or position."""
    if not set(AXES) <= set(message.joint_names):
        raise ValueError(f'joint_names {message.joint_names}: must hold {" and ".join(AXES)}')
    columns = [message.joint_names.index(axis) for axis in AXES]
    for row, point in enumerate(message.points):
        if len(point.positions) != len(message.joint_names):
            raise ValueError(f'row {row}: {len(point.positions)} positions; must be {len(message.joint_names)}')
    times = [point.time_from_start.sec + point.time_from_start.nanosec * 1e-9 for point in message.points]
    angles = [[point.positions[column] for column in columns] for point in message.points]
    return np.array(times), np.reshape(angles, (-1, len(columns)))


def _rows(piece: ProgramTrack, begin: Seconds, end: Seconds) -> ProgramTrack:
    """Return the rows of a piece from three rows before `begin` to the last row before `end`; of an ended one the last
    three. The slope at a row follows from this row and its two neighbours. Three rows before `begin` therefore keep
    the path at `begin` unchanged, and the last three rows of a piece that has ended keep the slope at its end."""
    first = max(min(int(np.searchsorted(piece.times, begin)), len(piece.times)) - 3, 0)
    last = int(np.searchsorted(piece.times, end))
    return ProgramTrack(piece.times[first:last], piece.angles[first:last])


def _rate(piece: ProgramTrack, row: int, i: int) -> RadiansPerSecond:
    """Return the mean rate of axis i from a row of a piece to the next row."""
    distance = piece.angles[row + 1, i] - piece.angles[row, i]
    distance = math.remainder(distance, 2.0 * math.pi) if i == 0 else distance
    return distance / (piece.times[row + 1] - piece.times[row])
