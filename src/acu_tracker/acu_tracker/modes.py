"""The mode machine: which target the antenna follows, and why. A pure transition function over one table."""
import typing
from collections import namedtuple

from pedestal_common.compiled import compiled


class Mode(typing.NamedTuple):
    """A row of TABLE.

    doc: what the axes do; entry: when it can be entered; exit: when it ends by itself. needs, ends: of Conditions, the
    one without which it cannot be entered and the one without which it ends, '' for none. follows: it follows a target
    through the sky, for which the deck's attitude must be known; by_level: it goes by the level of the signal about
    the expected place of the target; fallback: the mode it falls back on when its target ends, of `program` the mode
    whose table was followed last; handover: the mode it hands over to by itself, once that can be entered. Both are
    names, '' for none. table: it follows a table of directions; pinned: the stow pins may be in.
    predicted: the method of prediction.Predictor that makes its table; button: the page has one among the modes.
    """
    name: str
    doc: str
    entry: str
    exit: str = ''
    needs: str = ''
    ends: str = ''
    follows: bool = False
    by_level: bool = False
    fallback: str = ''
    handover: str = ''
    table: bool = False
    pinned: bool = False
    predicted: str = ''
    button: bool = True


TABLE = (
    Mode('standby', 'rate command 0', 'always; after a fault'),
    Mode('stop', 'the axes stand where they come to rest', 'encoders valid', button=False),
    Mode('stow', 'the stow angles; with `stow_pins` the pins go in once the axes stand there',
         'encoders valid, angles inside the limits', needs='stow', pinned=True),
    Mode('unstow', 'rate command 0; the stow pins go out', 'encoders valid, a stow pin is not out',
         'to `standby` when both are out', needs='pin', ends='pin', pinned=True),
    Mode('preset', 'the preset angles', 'encoders valid, angles inside the limits', needs='preset'),
    Mode('rate', 'the rates of the last ask `rate`, for 0.5 s; nobody asks again: the axes stand', 'encoders valid',
         button=False),
    Mode('slave', 'the direction of the last ask `slave`, in earth angles, moved on by its rates',
         'a direction was given and holds, 1 s by default', 'to `stop` when it holds no longer',
         needs='direction', ends='direction', follows=True, fallback='stop', button=False),
    Mode('program', 'the time-tagged table', 'the table is there, valid now and inside the limits',
         'to `autotrack` after `lock_count` accepted errors; to `standby` past its end, or where rows are missing',
         needs='program', ends='program', follows=True, handover='autotrack', table=True),
    Mode('tle', 'a satellite by its elements', 'there are elements, not older than `prediction.oldest`; the satellite '
         'is above the horizon and inside the limits',
         'to `autotrack` after `lock_count` accepted errors; to `standby` when it has set',
         needs='tle', ends='tle', follows=True, handover='autotrack', table=True, predicted='satellite'),
    Mode('sun', 'the sun, to calibrate the pointing', 'the sun is above the horizon and inside the limits',
         'to `standby` when it has set', needs='sun', ends='sun', follows=True, table=True, predicted='sun'),
    Mode('autotrack', 'the filtered target, through short losses the prediction of the filter',
         'receiver locked, filter converged',
         'after `coast_time` without an error, or once the estimate is uncertain by half a beamwidth, to the fallback '
         'chosen beforehand, diverged to the table, in a side lobe to `acquire`; to `standby` where that cannot be '
         'entered',
         needs='lock', ends='track', follows=True, fallback='program'),
    Mode('search', 'a pattern about the expected place of the target: the last place, a small area, the full one',
         'not after `diverged`', 'to `acquire` where the level has passed a peak; after `search.rounds` to the table, '
         'or to `standby` without one',
         needs='slope', ends='level', follows=True, by_level=True, fallback='program', handover='acquire'),
    Mode('acquire', 'the place of the highest level, a look around it for a main lobe, a small circle to check the '
         'slopes of the errors', 'not after `diverged`',
         'to `autotrack` once the slopes are right and the receiver is locked; to `search` without a signal there; '
         'diverged, to `standby`, where a slope is wrong',
         needs='slope', ends='level', follows=True, by_level=True, fallback='search', handover='autotrack'),
    Mode('steptrack', 'the highest level, found by steps to either side', 'always', 'to `search` without a signal',
         ends='level', follows=True, by_level=True, fallback='search'))
"""Another mode is a row here; a condition of its own is one of Conditions, what it asks of the axes is in guidance."""

MODES = tuple(row.name for row in TABLE)
(STANDBY, STOP, STOW, UNSTOW, PRESET, RATE, SLAVE, PROGRAM, TLE, SUN, AUTOTRACK, SEARCH, ACQUIRE,
 STEPTRACK) = range(len(MODES))
FOLLOWS = tuple(row.follows for row in TABLE)
BY_LEVEL = tuple(row.by_level for row in TABLE)
BY_TABLE = tuple(row.table for row in TABLE)
_PINNED = tuple(row.pinned for row in TABLE)
NEVER = -1
_FALLBACK = tuple(MODES.index(row.fallback) if row.fallback else STANDBY for row in TABLE)

FALLBACKS = {'coast': AUTOTRACK, 'memory': STOP, 'program': PROGRAM, 'tle': TLE, 'search': SEARCH, 'preset': PRESET,
             'standby': STANDBY}
"""{what can be chosen for the loss of the track: the mode it is}; coast is to stay in autotrack on the filter alone,
memory to stand where the target was seen last, program to go back to the table that was followed last."""

FALLBACK_OF = {mode: name for name, mode in FALLBACKS.items()}

_HANDOVER = tuple(MODES.index(row.handover) if row.handover else NEVER for row in TABLE)

REASONS = ('none', 'requested', 'locked', 'signal lost', 'encoder invalid', 'attitude invalid', 'no program track',
           'before program track', 'after program track', 'receiver not locked', 'outside limits', 'unknown mode',
           'stamp does not advance', 'drive not ready', 'INS aligning', 'blocked', 'keyhole', 'silence',
           'moves unasked', 'diverged', 'no direction', 'found', 'not found', 'wrong slope', 'side lobe',
           'stow pins not out', 'stow pin failed', 'stow pins in', 'stow pins out', 'no elements',
           'elements too old', 'below the horizon', 'gap in the program track', 'UTC unknown', 'drive frozen')
(NONE, REQUESTED, LOCKED, SIGNAL_LOST, ENCODER_INVALID, ATTITUDE_INVALID, NO_PROGRAM, BEFORE_PROGRAM,
 AFTER_PROGRAM, NOT_LOCKED, OUTSIDE_LIMITS, UNKNOWN_MODE, BAD_STAMP, DRIVE_NOT_READY, INS_ALIGNING,
 BLOCKED, KEYHOLE, SILENCE, MOVES_UNASKED, DIVERGED, NO_DIRECTION, FOUND, NOT_FOUND, WRONG_SLOPE,
 SIDE_LOBE, PINNED, PIN_FAILED, PINS_IN, PINS_OUT, NO_ELEMENTS, TOO_OLD, BELOW_HORIZON,
 PROGRAM_GAP, NO_UTC, DRIVE_FROZEN) = range(len(REASONS))

NO_REQUEST, REFUSED, ACCEPTED = -1, 0, 1


Conditions = namedtuple('Conditions', 'nothing stow pin preset direction program tle sun lock slope track level')
"""Of each condition of a mode NONE, or the reason that it does not hold.

nothing: always holds; stow, preset: these angles can be pointed at; pin: one is not out; direction: one was given and
holds; program, tle, sun: the table can be followed; lock: autotrack can begin; slope: nothing has diverged; track:
autotrack has its target; level: so has a mode that goes by the level."""

_NEEDS, _ENDS = (tuple(Conditions._fields.index(name or 'nothing') for name in names)
                 for names in zip(*((row.needs, row.ends) for row in TABLE)))

Situation = namedtuple('Situation', 'encoder_valid drive attitude pins handover table chosen conditions')
"""What a change of mode is decided by.

drive: NONE, or why it follows no commands; a mode that runs ends with it, and none begins without it. attitude: NONE
or why it is not known; pins: NONE or why the stow pins forbid the axes to move; handover: whether a mode may hand over
by itself; table: the mode whose table was followed last; chosen: the mode for the loss of the track, AUTOTRACK: none;
conditions: the Conditions."""


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
    if now.pins != NONE:
        return NONE if _PINNED[request] and now.pins == PINNED else now.pins
    if now.drive != NONE:
        return now.drive
    if FOLLOWS[request] and now.attitude != NONE:
        return now.attitude
    return now.conditions[_NEEDS[request]]


@compiled
def _end(mode, now):
    """Why a mode ends in a Situation, NONE if it goes on. A table that leads outside the limits cannot be entered, but
    is not ended by that."""
    why = now.conditions[_ENDS[mode]]
    return NONE if BY_TABLE[mode] and why == OUTSIDE_LIMITS else why


@compiled
def next_mode(mode, request, now):
    """The Decision of one step in a Situation; request: a mode or NO_REQUEST."""
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
    if now.pins != NONE:
        stays = _PINNED[mode] and now.pins == PINNED
        return Decision(mode, why, result) if stays else Decision(STANDBY, now.pins, result)
    if now.drive != NONE and mode != UNSTOW:
        return Decision(STANDBY, now.drive, result)
    if FOLLOWS[mode] and now.attitude != NONE:
        return Decision(STANDBY, now.attitude, result)
    handover, end = _HANDOVER[mode], _end(mode, now)
    if now.handover and handover != NEVER and now.conditions[_NEEDS[handover]] == NONE:
        return Decision(handover, LOCKED if handover == AUTOTRACK else FOUND, result)
    if end == NONE:
        return Decision(mode, why, result)
    fallback = ACQUIRE if end == SIDE_LOBE else _FALLBACK[mode]
    if mode == AUTOTRACK and end == SIGNAL_LOST:
        if now.chosen == AUTOTRACK:
            return Decision(mode, end, result)
        fallback = now.chosen
    if fallback == PROGRAM:
        fallback = now.table
    return Decision(fallback if now.conditions[_NEEDS[fallback]] == NONE else STANDBY, end, result)
