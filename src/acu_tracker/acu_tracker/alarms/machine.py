"""State machine of one alarm: its states, the events that change them, and the table of the transitions.

The states are those of ANSI/ISA-18.2-2016, section 6.2 (IEC 62682). Only an alarm that latches by its row of
`alarms.table` enters a latched state. `annunciator` applies the events.
"""
import numpy as np

from pedestal_common.codes import codes
from pedestal_common.compiled import compiled

ALARM_STATES = ('normal', 'unacknowledged', 'acknowledged', 'returned unacknowledged', 'latched unacknowledged',
                'latched acknowledged', 'shelved', 'suppressed by design')
State = codes(ALARM_STATES)

ALARM_EVENTS = ('raise', 'clear', 'acknowledge', 'reset', 'shelve', 'unshelve', 'suppress', 'release')
Event = codes(ALARM_EVENTS)
"""Events: the condition is present (raise) or absent (clear) in this step; the alarm has no meaning in this mode
(suppress), or has one again (release); the others are commands of the operator."""

EVENT_REFUSED = -1  # code in the place of the next state, for an event that a state does not accept

# The states in the order of ALARM_STATES, and x for an event that is refused.
_N, _U, _A, _R, _LU, _LA, _SH, _SU, _x = (*range(len(ALARM_STATES)), EVENT_REFUSED)

# Next state of an alarm that does not latch: STATE_TRANSITIONS[state, event]. An active alarm is not suppressed at
# once: its condition counts as absent, the alarm returns to normal when it has been acknowledged, and is suppressed
# then.
STATE_TRANSITIONS = np.array((
    # raise, clear, acknowledge, reset, shelve, unshelve, suppress, release
    (_U, _N, _x, _x, _SH, _x, _SU, _N),        # normal
    (_U, _R, _A, _x, _SH, _x, _U, _U),         # unacknowledged
    (_A, _N, _x, _x, _SH, _x, _A, _A),         # acknowledged
    (_U, _R, _N, _x, _SH, _x, _R, _R),         # returned unacknowledged
    (_U, _LU, _LA, _R, _SH, _x, _LU, _LU),     # latched unacknowledged
    (_U, _LA, _x, _N, _SH, _x, _LA, _LA),      # latched acknowledged
    (_SH, _SH, _x, _x, _SH, _N, _SH, _SH),     # shelved
    (_SU, _SU, _x, _x, _SH, _x, _SU, _N),      # suppressed by design
))

IS_LISTED = (False, True, True, True, True, True, True, False)          # in the published list
IS_ANNUNCIATED = (False, True, True, True, True, True, False, False)    # in the published list, and not shelved
AWAITS_ACKNOWLEDGEMENT = (False, True, False, True, True, False, False, False)
IS_LATCHED = (False, False, False, False, True, True, False, False)     # the state ends only by a reset


@compiled
def next_state(state: int, event: int, latched: int) -> int:
    """Return the state after an event, or EVENT_REFUSED; latched: 1 for an alarm that latches by its row."""
    if latched and event == Event.CLEAR:
        if state == State.UNACKNOWLEDGED:
            return State.LATCHED_UNACKNOWLEDGED
        if state == State.ACKNOWLEDGED:
            return State.LATCHED_ACKNOWLEDGED
    return STATE_TRANSITIONS[state, event]
