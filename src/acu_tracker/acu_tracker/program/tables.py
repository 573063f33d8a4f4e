"""The tables of directions that a mode may follow: the program track, a predicted satellite (tle), the sun.

`unit.Acu` keeps the Tables up to date; the law of the control unit reads them.
"""
import math
from typing import NamedTuple

import numpy as np

from acu_tracker import modes
from acu_tracker.program.program_track import NO_TRACK, ProgramTrack
from pedestal_common.compiled import compiled
from pedestal_common.quantities import Radians, Seconds

TABLE_MODES = tuple(row for row in modes.MODE_ROWS if row.table)
"""Rows of modes.MODE_ROWS of the modes that follow a table."""


class Tables(NamedTuple):
    """A table for each mode that follows one, in the order of TABLE_MODES."""
    program: ProgramTrack
    tle: ProgramTrack
    sun: ProgramTrack


NO_TABLES = Tables(*(NO_TRACK for _ in TABLE_MODES))  # tables without a row

TABLE_INDEX = tuple(TABLE_MODES.index(row) if row.table else 0 for row in modes.MODE_ROWS)
"""Index in Tables of the table of each mode; 0, the program, for a mode that follows none."""


def shifted(track: ProgramTrack, offset: tuple[Seconds, Radians, Radians]) -> ProgramTrack:
    """Return a ProgramTrack with an offset (time, azimuth, elevation) added to each row.

    The shifted elevations are limited to the zenith.
    """
    if not any(offset):
        return track
    time, *angles = offset
    moved = track.angles + angles
    moved[:, 1] = np.clip(moved[:, 1], -0.5 * math.pi, 0.5 * math.pi)
    return ProgramTrack(track.times + time, moved)


@compiled
def of_mode(tables: Tables, mode: int) -> ProgramTrack:
    """Return the table that a mode follows; for a mode that follows no table, return the program."""
    return tables[TABLE_INDEX[mode]]
