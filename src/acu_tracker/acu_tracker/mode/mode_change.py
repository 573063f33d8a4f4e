"""The mode of the control unit, its reason, and what waits: every change of them."""
import numpy as np

from acu_tracker import modes
from acu_tracker.modes import Mode, Reason
from pedestal_common.compiled import compiled

MODE_DTYPE = np.dtype([('now', 'i8'), ('reason', 'i8'), ('pending', 'i8'), ('begins', 'i8'), ('table', 'i8'),
                       ('fallback', 'i8')], align=True)
"""now: the mode; reason: of modes.REASONS; pending: the request that waits, NO_REQUEST; begins: 1 until the axes are
sent where it wants them first; table: the mode whose table was followed last; fallback: the one chosen for the loss of
the track."""


def initialise(m, params):
    """Standby, the initial mode of AcuParameters pending; m: view of MODE."""
    m['pending'] = modes.MODES.index(params.initial_mode)
    m['table'] = Mode.PROGRAM
    choose(m, params.fallback)


def choose(m, name):
    """Choose what follows the loss of the track, by its name; m: view of MODE."""
    m['fallback'] = modes.FALLBACK_MODES[name]


@compiled
def change(m, now, request):
    """Run the mode machine in a Situation with a `request` or NO_REQUEST: its result."""
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
    """Begin the mode anew."""
    m.begins = 1


@compiled
def mark_started(m):
    """Note that the axes were sent where the mode wants them."""
    m.begins = 0


@compiled
def set_pending(m, request):
    """Let a request wait, or NO_REQUEST."""
    m.pending = request


@compiled
def continue_in(m, mode):
    """Go on in a mode after a silence: the one before, or STANDBY."""
    if mode != m.now:
        m.now, m.reason = mode, Reason.SILENCE


@compiled
def set_outage_reason(m, reason):
    """Take the reason of an outage, NONE: there is none any more."""
    if reason != Reason.NONE or m.reason == Reason.BLOCKED or m.reason == Reason.KEYHOLE:
        m.reason = reason


@compiled
def mark_stowed(m):
    """Note that the pins are in, where that was requested."""
    if m.reason == Reason.REQUESTED:
        m.reason = Reason.PINS_IN
