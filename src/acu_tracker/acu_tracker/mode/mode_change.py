"""State of the mode machine: the mode of the control unit, its reason and the pending request.

Only this module writes the state.
"""

from typing import TYPE_CHECKING

from acu_tracker import modes
from acu_tracker.modes import Mode, Reason
from pedestal_common.compiled import compiled
from pedestal_common.quantities import Bit, Records
from pedestal_common.record import Record

if TYPE_CHECKING:
    from acu_tracker.params import AcuParameters


class ModeState(Record):
    """State of the mode machine."""
    now: int        # code of the present mode
    # code of modes.REASONS: why the mode was entered, a request was refused, or the receiver has no signal
    reason: int
    pending: int    # mode that is entered as soon as its conditions hold, or NO_REQUEST
    begins: Bit     # 1 until the mode sends its first command to the axes
    table: int      # mode whose table was followed last: program, tle or sun
    fallback: int   # mode chosen for the loss of the track


def initialise(state: Records, params: 'AcuParameters') -> None:
    """Begin in standby with the initial mode of the parameters pending."""
    state['pending'] = modes.MODES.index(params.initial_mode)
    state['table'] = Mode.PROGRAM
    choose(state, params.fallback)


def choose(state: Records, name: str) -> None:
    """Choose the mode after the loss of the track, by its name in modes.FALLBACK_MODES."""
    state['fallback'] = modes.FALLBACK_MODES[name]


@compiled
def change(state: ModeState, now: modes.Situation, request: int) -> int:
    """Run the mode machine in a Situation `now`; request: a mode or NO_REQUEST. Return the result of the request.

    acu_tracker/modes.py defines the results.
    """
    mode, reason, result = modes.next_mode(state.now, request, now)
    if result == modes.REQUEST_ACCEPTED:
        state.pending = modes.NO_REQUEST
    if modes.FOLLOWS_TABLE[mode]:
        state.table = mode
    if reason != Reason.NONE:
        state.reason = reason
    if mode != state.now:
        state.now, state.begins = mode, 1
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
def mark_stowed(state: ModeState) -> None:
    """Replace the reason `requested` of the mode stow by `stow pins in`: the pins have gone in."""
    if state.reason == Reason.REQUESTED:
        state.reason = Reason.PINS_IN
