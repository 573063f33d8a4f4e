"""The mode machine: which target the antenna follows, and why. A pure transition function over one table."""
import typing
from collections import namedtuple

from pedestal_common.codes import codes
from pedestal_common.compiled import compiled


class Row(typing.NamedTuple):
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
    Row('standby', 'rate command 0', 'always; after a fault'),
    Row('stop', 'the axes stand where they come to rest', 'encoders valid', button=False),
    Row('stow', 'the stow angles; with `stow_pins` the pins go in once the axes stand there',
        'encoders valid, angles inside the limits', needs='stow', pinned=True),
    Row('unstow', 'rate command 0; the stow pins go out', 'encoders valid, a stow pin is not out',
        'to `standby` when both are out', needs='pin', ends='pin', pinned=True),
    Row('preset', 'the preset angles', 'encoders valid, angles inside the limits', needs='preset'),
    Row('rate', 'the rates of the last ask `rate`, for 0.5 s; nobody asks again: the axes stand', 'encoders valid',
        button=False),
    Row('slave', 'the direction of the last ask `slave`, in earth angles, moved on by its rates',
        'a direction was given and holds, 1 s by default', 'to `stop` when it holds no longer',
        needs='direction', ends='direction', follows=True, fallback='stop', button=False),
    Row('program', 'the time-tagged table', 'the table is there, valid now and inside the limits',
        'to `autotrack` after `lock_count` accepted errors; to `standby` past its end, or where rows are missing',
        needs='program', ends='program', follows=True, handover='autotrack', table=True),
    Row('tle', 'a satellite by its elements', 'there are elements, not older than `prediction.oldest`; the satellite '
        'is above the horizon and inside the limits',
        'to `autotrack` after `lock_count` accepted errors; to `standby` when it has set',
        needs='tle', ends='tle', follows=True, handover='autotrack', table=True, predicted='satellite'),
    Row('sun', 'the sun, to calibrate the pointing', 'the sun is above the horizon and inside the limits',
        'to `standby` when it has set', needs='sun', ends='sun', follows=True, table=True, predicted='sun'),
    Row('autotrack', 'the filtered target, through short losses the prediction of the filter',
        'receiver locked, filter converged',
        'after `coast_time` without an error, or once the estimate is uncertain by half a beamwidth, to the fallback '
        'chosen beforehand, diverged to the table, in a side lobe to `acquire`; to `standby` where that cannot be '
        'entered',
        needs='lock', ends='track', follows=True, fallback='program'),
    Row('search', 'a pattern about the expected place of the target: the last place, a small area, the full one',
        'not after `diverged`', 'to `acquire` where the level has passed a peak; after `search.rounds` to the table, '
        'or to `standby` without one',
        needs='slope', ends='level', follows=True, by_level=True, fallback='program', handover='acquire'),
    Row('acquire', 'the place of the highest level, a look around it for a main lobe, a small circle to check the '
        'slopes of the errors', 'not after `diverged`',
        'to `autotrack` once the slopes are right and the receiver is locked; to `search` without a signal there; '
        'diverged, to `standby`, where a slope is wrong',
        needs='slope', ends='level', follows=True, by_level=True, fallback='search', handover='autotrack'),
    Row('steptrack', 'the highest level, found by steps to either side', 'always', 'to `search` without a signal',
        ends='level', follows=True, by_level=True, fallback='search'))
"""Another mode is a row here; a condition of its own is one of Conditions, what it asks of the axes is in guidance."""

MODES = tuple(row.name for row in TABLE)
Mode = codes(MODES)
FOLLOWS = tuple(row.follows for row in TABLE)
BY_LEVEL = tuple(row.by_level for row in TABLE)
BY_TABLE = tuple(row.table for row in TABLE)
_PINNED = tuple(row.pinned for row in TABLE)
NEVER = -1
_FALLBACK = tuple(MODES.index(row.fallback) if row.fallback else Mode.STANDBY for row in TABLE)

FALLBACKS = {'coast': Mode.AUTOTRACK, 'memory': Mode.STOP, 'program': Mode.PROGRAM, 'tle': Mode.TLE,
             'search': Mode.SEARCH, 'preset': Mode.PRESET, 'standby': Mode.STANDBY}
"""{what can be chosen for the loss of the track: the mode it is}; coast is to stay in autotrack on the filter alone,
memory to stand where the target was seen last, program to go back to the table that was followed last."""

FALLBACK_OF = {mode: name for name, mode in FALLBACKS.items()}

_HANDOVER = tuple(MODES.index(row.handover) if row.handover else NEVER for row in TABLE)

REASON_TEXTS = dict(
    NONE='none', REQUESTED='requested', LOCKED='locked', SIGNAL_LOST='signal lost',
    ENCODER_INVALID='encoder invalid', ATTITUDE_INVALID='attitude invalid', NO_PROGRAM='no program track',
    BEFORE_PROGRAM='before program track', AFTER_PROGRAM='after program track', NOT_LOCKED='receiver not locked',
    OUTSIDE_LIMITS='outside limits', UNKNOWN_MODE='unknown mode', BAD_STAMP='stamp does not advance',
    DRIVE_NOT_READY='drive not ready', INS_ALIGNING='INS aligning', BLOCKED='blocked', KEYHOLE='keyhole',
    SILENCE='silence', MOVES_UNASKED='moves unasked', DIVERGED='diverged', NO_DIRECTION='no direction',
    FOUND='found', NOT_FOUND='not found', WRONG_SLOPE='wrong slope', SIDE_LOBE='side lobe',
    PINNED='stow pins not out', PIN_FAILED='stow pin failed', PINS_IN='stow pins in', PINS_OUT='stow pins out',
    NO_ELEMENTS='no elements', TOO_OLD='elements too old', BELOW_HORIZON='below the horizon',
    PROGRAM_GAP='gap in the program track', NO_UTC='UTC unknown', DRIVE_FROZEN='drive frozen')
"""What is said of each reason, by its name."""

REASONS = tuple(REASON_TEXTS.values())
Reason = codes(REASON_TEXTS)

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
    if request == Mode.STANDBY:
        return Reason.NONE
    if request < Mode.STANDBY or request >= len(FOLLOWS):
        return Reason.UNKNOWN_MODE
    if not now.encoder_valid:
        return Reason.ENCODER_INVALID
    if now.pins != Reason.NONE:
        return Reason.NONE if _PINNED[request] and now.pins == Reason.PINNED else now.pins
    if now.drive != Reason.NONE:
        return now.drive
    if FOLLOWS[request] and now.attitude != Reason.NONE:
        return now.attitude
    return now.conditions[_NEEDS[request]]


@compiled
def _end(mode, now):
    """Why a mode ends in a Situation, NONE if it goes on. A table that leads outside the limits cannot be entered, but
    is not ended by that."""
    why = now.conditions[_ENDS[mode]]
    return Reason.NONE if BY_TABLE[mode] and why == Reason.OUTSIDE_LIMITS else why


@compiled
def next_mode(mode, request, now):
    """The Decision of one step in a Situation; request: a mode or NO_REQUEST."""
    why, result = Reason.NONE, NO_REQUEST
    if request != NO_REQUEST:
        why = obstacle(request, now)
        if why == Reason.NONE:
            return Decision(request, Reason.REQUESTED, ACCEPTED)
        result = REFUSED
    if mode == Mode.STANDBY:
        return Decision(mode, why, result)
    if not now.encoder_valid:
        return Decision(Mode.STANDBY, Reason.ENCODER_INVALID, result)
    if now.pins != Reason.NONE:
        stays = _PINNED[mode] and now.pins == Reason.PINNED
        return Decision(mode, why, result) if stays else Decision(Mode.STANDBY, now.pins, result)
    if now.drive != Reason.NONE and mode != Mode.UNSTOW:
        return Decision(Mode.STANDBY, now.drive, result)
    if FOLLOWS[mode] and now.attitude != Reason.NONE:
        return Decision(Mode.STANDBY, now.attitude, result)
    handover, end = _HANDOVER[mode], _end(mode, now)
    if now.handover and handover != NEVER and now.conditions[_NEEDS[handover]] == Reason.NONE:
        return Decision(handover, Reason.LOCKED if handover == Mode.AUTOTRACK else Reason.FOUND, result)
    if end == Reason.NONE:
        return Decision(mode, why, result)
    fallback = Mode.ACQUIRE if end == Reason.SIDE_LOBE else _FALLBACK[mode]
    if mode == Mode.AUTOTRACK and end == Reason.SIGNAL_LOST:
        if now.chosen == Mode.AUTOTRACK:
            return Decision(mode, end, result)
        fallback = now.chosen
    if fallback == Mode.PROGRAM:
        fallback = now.table
    return Decision(fallback if now.conditions[_NEEDS[fallback]] == Reason.NONE else Mode.STANDBY, end, result)
