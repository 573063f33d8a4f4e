"""State of the mode machine: the mode of the control unit, its reason and the pending request.

Only this module writes the state. m: record of ModeState, except where a function states a view of it.
"""

from acu_tracker import modes
from acu_tracker.modes import Mode, Reason
from pedestal_common.compiled import compiled
from pedestal_common.record import Record


class ModeState(Record):
    """State of the mode machine."""
    now: int  # code of the present mode
    # code of modes.REASONS: why the mode was entered, a request was refused, or the receiver has no signal
    reason: int
    pending: int  # mode that is entered as soon as its conditions hold, or NO_REQUEST
    begins: int  # 1 until the mode sends its first command to the axes
    table: int  # mode whose table was followed last: program, tle or sun
    fallback: int  # mode chosen for the loss of the track


def initialise(m, params):
    """Begin in standby with the initial mode of AcuParameters pending; m: view of ModeState."""
    m['pending'] = modes.MODES.index(params.initial_mode)
    m['table'] = Mode.PROGRAM
    choose(m, params.fallback)


def choose(m, name):
    """Choose the mode after the loss of the track, by its name in modes.FALLBACK_MODES; m: view of ModeState."""
    m['fallback'] = modes.FALLBACK_MODES[name]


@compiled
def change(m, now, request):
    """Run the mode machine in a Situation `now`; request: a mode or NO_REQUEST. Return the result of the request.

    acu_tracker/modes.py defines the results.
    """
    mode, reason, result = modes.next_mode(m.now, request, now)
    if result == modes.REQUEST_ACCEPTED:
        m.pending = modes.NO_REQUEST
    if modes.FOLLOWS_TABLE[mode]:
        m.table = mode
    if reason != Reason.NONE:
        m.reason = reason
    if mode != m.now:
        m.now, m.begins = mode, 1
    return result


@compiled
def restart(m):
    """Let the present mode begin again."""
    m.begins = 1


@compiled
def mark_started(m):
    """Note that the mode has commanded the axes."""
    m.begins = 0


@compiled
def set_pending(m, request):
    """Set the pending mode; request: a mode or NO_REQUEST."""
    m.pending = request


@compiled
def continue_in(m, mode):
    """Continue after a silence (a time without steps) in a mode: the mode before the silence, or STANDBY."""
    if mode != m.now:
        m.now, m.reason = mode, Reason.SILENCE


@compiled
def set_outage_reason(m, reason):
    """Set the reason of an outage of the receiver, or NONE without an outage.

    NONE replaces only a reason that this function has set.
    """
    if (reason != Reason.NONE or m.reason == Reason.BLOCKED or m.reason == Reason.KEYHOLE
            or m.reason == Reason.TURN):
        m.reason = reason


@compiled
def mark_stowed(m):
    """Replace the reason `requested` of the mode stow by `stow pins in`: the pins have gone in."""
    if m.reason == Reason.REQUESTED:
        m.reason = Reason.PINS_IN
