"""The mode machine: which target the antenna follows, and why. A pure transition function over one table."""
from collections import namedtuple

from pedestal_common.codes import codes
from pedestal_common.compiled import compiled
from pedestal_common.graph.modes import MODE_ROWS, MODES

Mode = codes(MODES)
FOLLOWS_TARGET = tuple(row.follows for row in MODE_ROWS)
USES_SIGNAL_LEVEL = tuple(row.by_level for row in MODE_ROWS)
FOLLOWS_TABLE = tuple(row.table for row in MODE_ROWS)
_ALLOWED_WHEN_PINNED = tuple(row.pinned for row in MODE_ROWS)
NO_HANDOVER = -1
_FALLBACK = tuple(MODES.index(row.fallback) if row.fallback else Mode.STANDBY for row in MODE_ROWS)

FALLBACK_MODES = {'coast': Mode.AUTOTRACK, 'memory': Mode.STOP, 'program': Mode.PROGRAM, 'tle': Mode.TLE,
                  'search': Mode.SEARCH, 'preset': Mode.PRESET, 'standby': Mode.STANDBY}
"""{what can be chosen for the loss of the track: the mode it is}; coast is to stay in autotrack on the filter alone,
memory to stand where the target was seen last, program to go back to the table that was followed last."""

FALLBACK_NAMES = {mode: name for name, mode in FALLBACK_MODES.items()}

_HANDOVER = tuple(MODES.index(row.handover) if row.handover else NO_HANDOVER for row in MODE_ROWS)

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

NO_REQUEST, REQUEST_REFUSED, REQUEST_ACCEPTED = -1, 0, 1


Conditions = namedtuple('Conditions', 'nothing stow pin preset direction program tle sun lock slope track level')
"""Of each condition of a mode NONE, or the reason that it does not hold.

nothing: always holds; stow, preset: these angles can be pointed at; pin: one is not out; direction: one was given and
holds; program, tle, sun: the table can be followed; lock: autotrack can begin; slope: nothing has diverged; track:
autotrack has its target; level: so has a mode that goes by the level."""

_NEEDS, _ENDS = (tuple(Conditions._fields.index(name or 'nothing') for name in names)
                 for names in zip(*((row.needs, row.ends) for row in MODE_ROWS)))

Situation = namedtuple('Situation', 'encoder_valid drive attitude pins handover table chosen conditions')
"""What a change of mode is decided by.

drive: NONE, or why it follows no commands; a mode that runs ends with it, and none begins without it. attitude: NONE
or why it is not known; pins: NONE or why the stow pins forbid the axes to move; handover: whether a mode may hand over
by itself; table: the mode whose table was followed last; chosen: the mode for the loss of the track, AUTOTRACK: none;
conditions: the Conditions."""


Decision = namedtuple('Decision', 'mode reason result')
"""The mode from now on; reason: NONE where nothing happened; result: NO_REQUEST, REQUEST_REFUSED or
REQUEST_ACCEPTED."""


@compiled
def obstacle(request, now):
    """Why a mode cannot be entered in a Situation, NONE if it can."""
    if request == Mode.STANDBY:
        return Reason.NONE
    if request < Mode.STANDBY or request >= len(FOLLOWS_TARGET):
        return Reason.UNKNOWN_MODE
    if not now.encoder_valid:
        return Reason.ENCODER_INVALID
    if now.pins != Reason.NONE:
        return Reason.NONE if _ALLOWED_WHEN_PINNED[request] and now.pins == Reason.PINNED else now.pins
    if now.drive != Reason.NONE:
        return now.drive
    if FOLLOWS_TARGET[request] and now.attitude != Reason.NONE:
        return now.attitude
    return now.conditions[_NEEDS[request]]


@compiled
def _end(mode, now):
    """Why a mode ends in a Situation, NONE if it goes on. A table that leads outside the limits cannot be entered, but
    is not ended by that."""
    why = now.conditions[_ENDS[mode]]
    return Reason.NONE if FOLLOWS_TABLE[mode] and why == Reason.OUTSIDE_LIMITS else why


@compiled
def next_mode(mode, request, now):
    """The Decision of one step in a Situation; request: a mode or NO_REQUEST."""
    why, result = Reason.NONE, NO_REQUEST
    if request != NO_REQUEST:
        why = obstacle(request, now)
        if why == Reason.NONE:
            return Decision(request, Reason.REQUESTED, REQUEST_ACCEPTED)
        result = REQUEST_REFUSED
    if mode == Mode.STANDBY:
        return Decision(mode, why, result)
    if not now.encoder_valid:
        return Decision(Mode.STANDBY, Reason.ENCODER_INVALID, result)
    if now.pins != Reason.NONE:
        stays = _ALLOWED_WHEN_PINNED[mode] and now.pins == Reason.PINNED
        return Decision(mode, why, result) if stays else Decision(Mode.STANDBY, now.pins, result)
    if now.drive != Reason.NONE and mode != Mode.UNSTOW:
        return Decision(Mode.STANDBY, now.drive, result)
    if FOLLOWS_TARGET[mode] and now.attitude != Reason.NONE:
        return Decision(Mode.STANDBY, now.attitude, result)
    handover, end = _HANDOVER[mode], _end(mode, now)
    if now.handover and handover != NO_HANDOVER and now.conditions[_NEEDS[handover]] == Reason.NONE:
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
