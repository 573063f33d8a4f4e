"""The mode machine: which target the antenna follows, and why. A pure transition function over one table."""
import typing
from collections import namedtuple

from pedestal_common.compiled import compiled


class Mode(typing.NamedTuple):
    """A row of TABLE.

    doc: what the axes do; entry: when it can be entered; exit: when it ends by itself. follows: it follows a target
    through the sky, for which the deck's attitude must be known; fallback: the mode it falls back on when its target
    ends; handover: the mode it hands over to by itself, once that can be entered. Both are names, '' for none.
    """
    name: str
    doc: str
    entry: str
    exit: str = ''
    follows: bool = False
    fallback: str = ''
    handover: str = ''


TABLE = (
    Mode('standby', 'rate command 0', 'always; after a fault'),
    Mode('stow', 'the stow angles', 'encoders valid, angles inside the limits'),
    Mode('preset', 'the preset angles', 'encoders valid, angles inside the limits'),
    Mode('program', 'the time-tagged table', 'the table is there, valid now and inside the limits',
         'to `autotrack` after `lock_count` accepted errors; to `standby` past its end',
         follows=True, handover='autotrack'),
    Mode('autotrack', 'the filtered target, through short losses the prediction of the filter',
         'receiver locked, filter converged',
         'after `coast_time` without an error, or diverged, to `program`, or to `standby` without a program',
         follows=True, fallback='program'))
"""Another mode is a row here, its entries in `situation`, and what it asks of the axes in control_unit."""

MODES = tuple(row.name for row in TABLE)
STANDBY, STOW, PRESET, PROGRAM, AUTOTRACK = range(len(MODES))
FOLLOWS = tuple(row.follows for row in TABLE)
NEVER = -1
_FALLBACK = tuple(MODES.index(row.fallback) if row.fallback else STANDBY for row in TABLE)
_HANDOVER = tuple(MODES.index(row.handover) if row.handover else NEVER for row in TABLE)

REASONS = ('none', 'requested', 'locked', 'signal lost', 'encoder invalid', 'attitude invalid', 'no program track',
           'before program track', 'after program track', 'receiver not locked', 'outside limits', 'unknown mode',
           'stamp does not advance', 'drive not ready', 'INS aligning', 'blocked', 'keyhole', 'silence',
           'moves unasked', 'diverged')
(NONE, REQUESTED, LOCKED, SIGNAL_LOST, ENCODER_INVALID, ATTITUDE_INVALID, NO_PROGRAM, BEFORE_PROGRAM,
 AFTER_PROGRAM, NOT_LOCKED, OUTSIDE_LIMITS, UNKNOWN_MODE, BAD_STAMP, DRIVE_NOT_READY, INS_ALIGNING,
 BLOCKED, KEYHOLE, SILENCE, MOVES_UNASKED, DIVERGED) = range(len(REASONS))

NO_REQUEST, REFUSED, ACCEPTED = -1, 0, 1


Situation = namedtuple('Situation', 'encoder_valid drive_ready attitude obstacle end')
"""The conditions of a change of mode.

drive_ready: the drive follows commands; a mode that runs ends with it, and none begins without it. attitude: NONE
or why it is not known; obstacle: for each mode NONE or the reason that it cannot be entered; end: for each mode NONE
or the reason that it ends."""


@compiled
def situation(encoder_valid, drive_ready, attitude, stow, preset, program, autotrack, lost):
    """The Situation of these conditions.

    attitude, stow, preset, program, autotrack: NONE or the reason against each; lost: NONE or the reason that
    autotrack ends. A program that leads outside the limits cannot be entered, but is not ended by that.
    """
    ends = program if program != OUTSIDE_LIMITS else NONE
    return Situation(encoder_valid, drive_ready, attitude,
                     (NONE, stow, preset, program, autotrack),
                     (NONE, NONE, NONE, ends, lost))


Decision = namedtuple('Decision', 'mode reason result')
"""The mode from now on; reason: NONE where nothing happened; result: NO_REQUEST, REFUSED or ACCEPTED."""


@compiled
def obstacle(request, now):
    """Why a mode cannot be entered in a Situation, NONE if it can."""
    if request == STANDBY:
        return NONE
    if request < STANDBY or request >= len(FOLLOWS):
        return UNKNOWN_MODE
    if not now.encoder_valid:
        return ENCODER_INVALID
    if not now.drive_ready:
        return DRIVE_NOT_READY
    if FOLLOWS[request] and now.attitude != NONE:
        return now.attitude
    return now.obstacle[request]


@compiled
def next_mode(mode, request, now, handover):
    """The Decision of one step in a Situation; request: a mode or NO_REQUEST; handover: whether a mode may hand over
    by itself."""
    why, result = NONE, NO_REQUEST
    if request != NO_REQUEST:
        why = obstacle(request, now)
        if why == NONE:
            return Decision(request, REQUESTED, ACCEPTED)
        result = REFUSED
    if mode == STANDBY:
        return Decision(mode, why, result)
    if not now.encoder_valid:
        return Decision(STANDBY, ENCODER_INVALID, result)
    if not now.drive_ready:
        return Decision(STANDBY, DRIVE_NOT_READY, result)
    if FOLLOWS[mode] and now.attitude != NONE:
        return Decision(STANDBY, now.attitude, result)
    if handover and _HANDOVER[mode] != NEVER and now.obstacle[_HANDOVER[mode]] == NONE:
        return Decision(_HANDOVER[mode], LOCKED, result)
    if now.end[mode] != NONE:
        fallback = _FALLBACK[mode]
        return Decision(fallback if now.obstacle[fallback] == NONE else STANDBY, now.end[mode], result)
    return Decision(mode, why, result)
