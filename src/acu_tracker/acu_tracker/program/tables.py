"""The tables of directions that a mode may follow: the program, a satellite by its elements, the sun."""
import math
import typing

import numpy as np

from acu_tracker import modes
from acu_tracker.program.program_track import NO_TRACK, ProgramTrack
from pedestal_common.compiled import compiled


class Tables(typing.NamedTuple):
    """One ProgramTrack for each mode that follows a table."""
    program: ProgramTrack
    tle: ProgramTrack
    sun: ProgramTrack


NO_TABLES = Tables(NO_TRACK, NO_TRACK, NO_TRACK)


def shifted(track, offset):
    """A ProgramTrack with an offset (time [s], azimuth, elevation [rad]); not beyond the zenith."""
    if not any(offset):
        return track
    time, *angles = offset
    moved = track.angles + angles
    moved[:, 1] = np.clip(moved[:, 1], -0.5 * math.pi, 0.5 * math.pi)
    return ProgramTrack(track.times + time, moved)


@compiled
def of_mode(tables, mode):
    """The table that a mode follows; of one that follows none the program."""
    if mode == modes.TLE:
        return tables.tle
    if mode == modes.SUN:
        return tables.sun
    return tables.program
