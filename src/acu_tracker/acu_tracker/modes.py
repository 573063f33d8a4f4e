"""Mode machine: a pure transition function over one table decides which target the antenna follows, and why."""
from collections import namedtuple

from pedestal_common.codes import codes
from pedestal_common.compiled import compiled
from pedestal_common.graph.modes import MODE_ROWS, MODES

Mode = codes(MODES)
"""Codes of the modes. The tables below hold a value for each mode, from its row of MODE_ROWS."""
FOLLOWS_TARGET = tuple(row.follows for row in MODE_ROWS)
USES_SIGNAL_LEVEL = tuple(row.by_level for row in MODE_ROWS)
FOLLOWS_TABLE = tuple(row.table for row in MODE_ROWS)
_ALLOWED_WHEN_PINNED = tuple(row.pinned for row in MODE_ROWS)
NO_HANDOVER = -1
"""Code for a mode without a hand-over."""
_FALLBACK = tuple(MODES.index(row.fallback) if row.fallback else Mode.STANDBY for row in MODE_ROWS)

FALLBACK_MODES = {'coast': Mode.AUTOTRACK, 'memory': Mode.STOP, 'program': Mode.PROGRAM, 'tle': Mode.TLE,
                  'search': Mode.SEARCH, 'preset': Mode.PRESET, 'standby': Mode.STANDBY}
"""{choice for the loss of the track: mode}.

`coast` stays in autotrack on the prediction of the filter. `memory` stops where the target was seen last. `program`
returns to the table that was followed last.
"""

FALLBACK_NAMES = {mode: name for name, mode in FALLBACK_MODES.items()}

_HANDOVER = tuple(MODES.index(row.handover) if row.handover else NO_HANDOVER for row in MODE_ROWS)

REASON_TEXTS = dict(
    NONE='none', REQUESTED='requested', LOCKED='locked', SIGNAL_LOST='signal lost',
    ENCODER_INVALID='encoder invalid', ATTITUDE_INVALID='attitude invalid', NO_PROGRAM='no program track',
    BEFORE_PROGRAM='before program track', AFTER_PROGRAM='after program track', NOT_LOCKED='receiver not locked',
    OUTSIDE_LIMITS='outside limits', UNKNOWN_MODE='unknown mode', BAD_STAMP='stamp does not advance',
    DRIVE_NOT_READY='drive not ready', INS_ALIGNING='INS aligning', BLOCKED='blocked', KEYHOLE='keyhole',
    SILENCE='silence', UNCOMMANDED_MOTION='uncommanded motion', DIVERGED='diverged', NO_DIRECTION='no direction',
    FOUND='found', NOT_FOUND='not found', WRONG_SLOPE='wrong slope', SIDE_LOBE='side lobe',
    PINNED='stow pins not out', PIN_FAILED='stow pin failed', PINS_IN='stow pins in', PINS_OUT='stow pins out',
    NO_ELEMENTS='no elements', TOO_OLD='elements too old', BELOW_HORIZON='below the horizon',
    PROGRAM_GAP='gap in the program track', NO_UTC='UTC unknown', DRIVE_FROZEN='drive frozen',
    TURN='azimuth turn')
"""{name of a reason: its text in replies and diagnostics}."""

REASONS = tuple(REASON_TEXTS.values())
Reason = codes(REASON_TEXTS)

NO_REQUEST, REQUEST_REFUSED, REQUEST_ACCEPTED = -1, 0, 1
"""Results of a request; NO_REQUEST is also the request of a step without one."""


Conditions = namedtuple('Conditions', 'nothing stow pin preset direction program tle sun lock slope track level')
"""For each condition of a mode: NONE, or the reason why the condition does not hold.

nothing    always holds
stow       the stow angles can be reached
pin        at least one stow pin is not out
preset     the preset angles can be reached
direction  a direction was commanded and is valid
program, tle, sun  the table can be followed
lock       autotrack can begin
slope      autotrack has not diverged
track      autotrack has its target
level      the running mode, which uses the signal level, has neither failed nor lost its signal
"""

# Index in Conditions of the condition that the entry of each mode needs, and of the condition whose loss ends it.
_NEEDS, _ENDS = (tuple(Conditions._fields.index(name or 'nothing') for name in names)
                 for names in zip(*((row.needs, row.ends) for row in MODE_ROWS)))

Situation = namedtuple('Situation', 'encoder_valid drive attitude pins handover table chosen conditions')
"""Facts that decide on a change of mode.

encoder_valid  the encoders of this step are valid
drive      NONE, or why the drive follows no commands; ends a running mode, and no mode begins
attitude   NONE, or why the attitude is not known
pins       NONE, or why the stow pins forbid motion
handover   a mode may hand over by itself
table      mode whose table was followed last
chosen     mode for the loss of the track; AUTOTRACK: stay in autotrack
conditions  the Conditions
"""


Decision = namedtuple('Decision', 'mode reason result')
"""Mode from now on, its reason and the result of a request.

reason is NONE where nothing happened; result is NO_REQUEST, REQUEST_REFUSED or REQUEST_ACCEPTED.
"""


@compiled
def obstacle(request, now):
    """Return the reason why a mode cannot be entered in a Situation, or NONE."""
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
    """Return the reason why a mode ends in a Situation, or NONE.

    A table that leads outside the limits cannot be entered, but a running mode continues on it.
    """
    why = now.conditions[_ENDS[mode]]
    return Reason.NONE if FOLLOWS_TABLE[mode] and why == Reason.OUTSIDE_LIMITS else why


@compiled
def next_mode(mode, request, now):
    """Return the Decision of one step in a Situation; request: a mode or NO_REQUEST."""
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
