"""The departure of the estimate from the program: it distinguishes wrong errors from a fade.

A receiver whose errors are too small and have the wrong sign drives the beam away, and no error is ever large. Behind
the beam the errors are noise, or those of a side lobe. The filter accepts them for 0.2 s, because the gain of the
receiver follows its level late, and makes the noise small. In this time the beam may move by 10 beamwidths.

The level falls in a fade too. The two differ in what comes first, if the program was right before:

    o       offset: direction of the estimate less that of the program, ENU unit vectors
    d       |o - o_f|, o_f: offset when the level began to fall, by FALL_DB below its recent maximum. Both are offsets
            from the present program, which may have replaced another one since

A beam that leaves its target has moved before its level is low: in closed loops d was mostly 0.5 to 0.7 beamwidths at
a drop of LOW_DB. In a fade the level comes first, and d was mostly below 0.3 beamwidths, also on targets that turned
at that moment. If d is above MIN_FIRST_BEAMWIDTHS at this drop, autotrack ends as soon as d reaches MAX_BEAMWIDTHS.
After MAX_COUNT such ends in succession the errors count as wrong (alarm `diverged`). Autotrack of more than
HOLD_TIME_S begins a new succession, of which its own end is the first, and so does a time of SUCCESSION_TIME_S.

A program that is further off than MAX_FALL_OFFSET_BEAMWIDTHS at the begin of the fall is no reference, such as the
plan of an aircraft that flies another way. A level that falls already when autotrack begins shows nothing, because the
target is at the edge of the beam.
"""
import math
from typing import TYPE_CHECKING

from acu_tracker.estimation import target
from acu_tracker.estimation.target import Target
from acu_tracker.geometry.vector import Vector, dot, line_of_sight, minus, vector
from acu_tracker.modes import Reason
from acu_tracker.program import program_track
from acu_tracker.program.program_track import ProgramTrack
from pedestal_common.compiled import compiled
from pedestal_common.quantities import DecibelHertz, Radians, Records, Seconds, Vector3
from pedestal_common.record import Record

if TYPE_CHECKING:
    from acu_tracker.control_unit import Constants


class Departure(Record):
    """State of the watch."""
    stamp: Seconds          # time of the last error
    level: DecibelHertz     # recent maximum of the C/N0
    drop: float             # level less the last C/N0 [dB]
    fell: Seconds           # time at which the level began to fall; NaN: it has not, or shows nothing
    sight: Vector3          # direction of the estimate at this time, ENU unit vector
    begun: Seconds          # begin of the mode
    count: int              # number of successive ends of autotrack by a departure
    last: Seconds           # time of the last one


FORGETTING_DB_PER_S = 6.0
"""Rate at which the maximum of the level is forgotten [dB/s]. The level of an aircraft that flies away falls more
slowly."""

FALL_DB, LOW_DB = 0.5, 3.0  # drops of the level with which its fall begins, and with which it is low [dB]
MIN_FIRST_BEAMWIDTHS = 0.35  # least d when the level becomes low [beamwidths]
MAX_BEAMWIDTHS = 1.0        # largest d of a low level in autotrack [beamwidths]

MAX_OFFSET_BEAMWIDTHS = 2.0
"""Largest offset of a program that is a reference in a coast, and largest departure in a coast [beamwidths]. The sigma
of an estimate that garbled errors have thrown stays small."""

MAX_FALL_OFFSET_BEAMWIDTHS = 3.0
"""Largest offset of a program that is a reference when the level begins to fall [beamwidths]. By then a wrong estimate
is already one beamwidth off."""

HOLD_TIME_S = 10.0  # longest autotrack that continues a succession of departures [s]
SUCCESSION_TIME_S = 60.0    # longest time between two departures of a succession [s]
MAX_COUNT = 2       # number of successive departures that show wrong errors


def initialise(record: Records) -> None:
    """Begin without a level."""
    record['stamp'] = record['level'] = -math.inf
    record['fell'] = math.nan


@compiled
def restart(state: Departure, t: Seconds) -> None:
    """Note that a mode begins at t."""
    state.begun, state.fell = t, math.nan


@compiled
def _offset(sight: Vector, program: ProgramTrack, t: Seconds) -> Vector:
    """Return a direction less that of the program at t, NaN without a program."""
    if program_track.status(program, t) != Reason.NONE:
        return Vector(math.nan, math.nan, math.nan)
    return minus(sight, line_of_sight(program_track.motion_at(program, t)).u)


@compiled
def _length(v: Vector) -> float:
    return math.sqrt(dot(v, v))


@compiled
def in_coast(target_: Target, constants: 'Constants', program: ProgramTrack, t: Seconds) -> Radians:
    """Return how far the estimate has departed from the program since the last accepted measurement; 0 without a
    program at one of the two times, or if it was no reference before."""
    before = _offset(target.sight(target_, constants.target, target_.stamp).u, program, target_.stamp)
    gone = _length(minus(_offset(target.sight(target_, constants.target, t).u, program, t), before))
    reference = _length(before) <= MAX_OFFSET_BEAMWIDTHS * constants.p.tracker.receiver.beamwidth
    return gone if reference and math.isfinite(gone) else 0.0


@compiled
def _beyond(state: Departure, target_: Target, constants: 'Constants', program: ProgramTrack, t: Seconds,
            beamwidths: float) -> bool:
    """Return True if d is larger than a number of beamwidths at t; False without a reference or a program."""
    beamwidth, before = constants.p.tracker.receiver.beamwidth, _offset(vector(state.sight), program, state.fell)
    gone = minus(_offset(target.sight(target_, constants.target, t).u, program, t), before)
    return _length(before) <= MAX_FALL_OFFSET_BEAMWIDTHS * beamwidth and _length(gone) > beamwidths * beamwidth


@compiled
def take_level(state: Departure, target_: Target, constants: 'Constants', program: ProgramTrack, closed: bool,
               stamp: Seconds, cn0: DecibelHertz) -> None:
    """Take the C/N0 of an error after the filter has taken the error. closed: True in autotrack."""
    T, before = max(stamp - state.stamp, 0.0), state.drop
    state.stamp, state.level = stamp, max(cn0, state.level - FORGETTING_DB_PER_S * T)
    state.drop = state.level - cn0
    # After a gap the estimate may be off because the target has turned.
    gap = max(T, stamp - target_.stamp) > constants.p.tracker.coast_after
    if gap or not closed or state.drop <= FALL_DB:
        state.fell = math.nan
    elif before <= FALL_DB:
        state.fell = target_.stamp
        state.sight[0], state.sight[1], state.sight[2] = target.sight(
            target_, constants.target, target_.stamp).u
    if before <= LOW_DB < state.drop and not (math.isfinite(state.fell) and _beyond(
            state, target_, constants, program, target_.stamp, MIN_FIRST_BEAMWIDTHS)):
        state.fell = math.nan


@compiled
def departed(state: Departure, target_: Target, constants: 'Constants', program: ProgramTrack, t: Seconds) -> bool:
    """Return True if autotrack has departed from the program at t."""
    return (state.drop > LOW_DB and math.isfinite(state.fell)
            and _beyond(state, target_, constants, program, t, MAX_BEAMWIDTHS))


@compiled
def note_end(state: Departure, t: Seconds, by_departure: bool) -> bool:
    """Note that autotrack ends at t. Return True if the errors of the receiver are wrong."""
    if t - state.begun > HOLD_TIME_S or t - state.last > SUCCESSION_TIME_S:
        state.count = 0
    if by_departure:
        state.count += 1
        state.last = t
    return state.count >= MAX_COUNT


@compiled
def release(state: Departure) -> None:
    """Set the count to 0 after a reset."""
    state.count = 0
