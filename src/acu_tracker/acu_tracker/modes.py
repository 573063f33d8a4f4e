"""The mode machine: it decides in each step in which mode the control unit is, and why.

A row of pedestal_common.graph.modes.MODE_ROWS describes each mode. `next_mode` is a pure function of the present mode,
of a request and of the Situation, which control_unit makes. Only this module writes the ModeState.
"""
from typing import TYPE_CHECKING, NamedTuple

from pedestal_common.codes import codes
from pedestal_common.compiled import compiled
from pedestal_common.graph.modes import MODE_ROWS as MODE_ROWS
from pedestal_common.graph.modes import MODES as MODES
from pedestal_common.quantities import Bit, Records
from pedestal_common.record import Record

if TYPE_CHECKING:
    from acu_tracker.params import AcuParameters

Mode = codes(MODES)  # codes of the modes. Each tuple below holds one value for each mode, from its row of MODE_ROWS.
FOLLOWS_TARGET = tuple(row.follows for row in MODE_ROWS)
USES_SIGNAL_LEVEL = tuple(row.by_level for row in MODE_ROWS)
FOLLOWS_TABLE = tuple(row.table for row in MODE_ROWS)
_ALLOWED_WHEN_PINNED = tuple(row.pinned for row in MODE_ROWS)
NO_HANDOVER = -1
# Mode after the end of each mode, and mode to which it hands over by itself, or NO_HANDOVER.
_FALLBACK = tuple(MODES.index(row.fallback) if row.fallback else Mode.STANDBY for row in MODE_ROWS)
_HANDOVER = tuple(MODES.index(row.handover) if row.handover else NO_HANDOVER for row in MODE_ROWS)

FALLBACK_MODES = {'coast': Mode.AUTOTRACK, 'memory': Mode.STOP, 'program': Mode.PROGRAM, 'tle': Mode.TLE,
                  'search': Mode.SEARCH, 'preset': Mode.PRESET, 'standby': Mode.STANDBY}
"""{name of a fallback, the choice for the loss of the track: its mode}.

`coast` stays in autotrack on the prediction of the filter. `memory` stops where the target was seen last. `program`
returns to the table that was followed last.
"""

FALLBACK_NAMES = {mode: name for name, mode in FALLBACK_MODES.items()}  # {mode: name of the fallback}

REASON_TEXTS = dict(    # {name of a reason: its text in replies and diagnostics}
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
    TURN='azimuth turn', NO_POSITION='position of the antenna not given',
    DEPARTED='departed from the program')
REASONS = tuple(REASON_TEXTS.values())  # in the order of their codes
Reason = codes(REASON_TEXTS)

# Results of a request. NO_REQUEST is also the value of `request` in a step without a request.
NO_REQUEST, REQUEST_REFUSED, REQUEST_ACCEPTED = -1, 0, 1


class Conditions(NamedTuple):
    """Conditions of the modes: Reason.NONE if the condition holds, otherwise the reason why it does not hold."""
    nothing: int    # always holds
    stow: int       # the stow angles can be reached
    pin: int        # at least one stow pin is not out
    preset: int     # the preset angles can be reached
    direction: int  # a direction for the mode slave was commanded and is valid
    program: int    # the table of the mode program, tle or sun can be followed
    tle: int
    sun: int
    lock: int       # autotrack can begin
    slope: int      # autotrack has not diverged
    track: int      # autotrack has its target
    level: int      # the running mode uses the signal level, and has neither failed nor lost its signal


# For each mode: index in Conditions of the condition for its entry, and of the condition whose loss ends the mode.
_NEEDS, _ENDS = (tuple(Conditions._fields.index(name or 'nothing') for name in names)
                 for names in zip(*((row.needs, row.ends) for row in MODE_ROWS)))


class Situation(NamedTuple):
    """Facts that decide on a change of mode."""
    encoder_valid: bool     # True if the encoders of this step are valid
    drive: int      # Reason.NONE, or why the axes may not be driven; the running mode then ends, and no mode begins
    attitude: int   # Reason.NONE, or why the attitude of the deck is not known
    pins: int       # Reason.NONE, or why the stow pins forbid motion
    handover: bool  # True if the running mode may hand over to another mode by itself
    table: int      # mode whose table was followed last
    chosen: int     # fallback: mode after the loss of the track; AUTOTRACK: stay in autotrack
    conditions: Conditions


class Decision(NamedTuple):
    """Decision of a step."""
    mode: int       # from now on
    reason: int     # why the mode has changed, or a request was refused; Reason.NONE if neither happened
    result: int     # of the request: NO_REQUEST, REQUEST_REFUSED or REQUEST_ACCEPTED


@compiled
def obstacle(request: int, now: Situation) -> int:
    """Return the reason why a requested mode cannot be entered in a Situation `now`, or Reason.NONE."""
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
def next_mode(mode: int, request: int, now: Situation) -> Decision:
    """Return the Decision of one step in a Situation `now`; mode: the present mode; request: a mode or NO_REQUEST."""
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
    handover, end = _HANDOVER[mode], now.conditions[_ENDS[mode]]
    if FOLLOWS_TABLE[mode] and end == Reason.OUTSIDE_LIMITS:
        # A mode cannot begin on a table that is outside the limits at present, but a running mode continues on it.
        end = Reason.NONE
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


class ModeState(Record):
    """State of the mode machine."""
    now: int        # code of the present mode
    reason: int     # why the mode was entered, a request was refused, or the receiver has no signal
    pending: int    # mode that is entered as soon as its conditions hold, or NO_REQUEST
    begins: Bit     # 1 until the mode sends its first command to the axes
    arrived: Bit    # 1: the axes have reached the target of the mode
    table: int      # mode whose table was followed last: program, tle or sun
    fallback: int   # mode chosen for the loss of the track


def initialise(state: Records, params: 'AcuParameters') -> None:
    """Begin in standby with the initial mode of the parameters pending."""
    state['pending'] = MODES.index(params.initial_mode)
    state['table'] = Mode.PROGRAM
    choose(state, params.fallback)


def choose(state: Records, name: str) -> None:
    """Choose the mode after the loss of the track, by its name in FALLBACK_MODES."""
    state['fallback'] = FALLBACK_MODES[name]


@compiled
def change(state: ModeState, now: Situation, request: int) -> int:
    """Run the mode machine in a Situation `now`; request: a mode or NO_REQUEST. Return the result of the request."""
    mode, reason, result = next_mode(state.now, request, now)
    if result == REQUEST_ACCEPTED:
        state.pending = NO_REQUEST
    if FOLLOWS_TABLE[mode]:
        state.table = mode
    if reason != Reason.NONE:
        state.reason = reason
    if mode != state.now:
        state.now, state.begins, state.arrived = mode, 1, 0
    return result


@compiled
def restart(state: ModeState) -> None:
    """Let the present mode begin again."""
    state.begins = 1


@compiled
def mark_started(state: ModeState) -> None:
    """Note that the mode has commanded the axes."""
    state.begins = 0


@compiled
def watch_arrival(state: ModeState, distance: float) -> None:
    """Note whether the axes have reached the target of the mode. distance: distance from the target, 1 where it still
    counts as reached. An axis that has arrived leaves its target at twice this distance."""
    state.arrived = distance <= (2.0 if state.arrived else 1.0)


@compiled
def set_pending(state: ModeState, request: int) -> None:
    """Set the pending mode; request: a mode or NO_REQUEST."""
    state.pending = request


@compiled
def continue_in(state: ModeState, mode: int) -> None:
    """Continue after a silence (a time without steps) in a mode: the mode before the silence, or STANDBY."""
    if mode != state.now:
        state.now, state.reason = mode, Reason.SILENCE


@compiled
def set_outage_reason(state: ModeState, reason: int) -> None:
    """Set the reason of an outage of the receiver, or NONE without an outage.

    NONE replaces only a reason that this function has set.
    """
    if (reason != Reason.NONE or state.reason == Reason.BLOCKED or state.reason == Reason.KEYHOLE
            or state.reason == Reason.TURN):
        state.reason = reason


@compiled
def mark_stowed(state: ModeState, stowed: bool) -> None:
    """Note in the mode stow of an antenna with stow pins whether the pins are in, which is its arrival. The reason
    `stow pins in` then replaces the reason `requested`."""
    if state.now == Mode.STOW:
        state.arrived = stowed
    if stowed and state.reason == Reason.REQUESTED:
        state.reason = Reason.PINS_IN
