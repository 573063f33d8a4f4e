"""The records of all alarms: delays, causes, first-out, and what an operator asks of them.

A consequence stands under its cause while the cause is told: found when either is raised within CAUSE_WINDOW_S of the
other, or while the cause is there. Only what stands under nothing is annunciated (see report).
"""
import numpy as np

from acu_tracker.alarms import machine, table
from pedestal_common.compiled import compiled

ALARM_COUNT = len(table.ALARMS)

ALARM_DTYPE = np.dtype([('state', 'i8'), ('active', 'i8'), ('since', 'f8'), ('raised', 'f8'), ('first', 'i8'),
                        ('parent', 'i8'), ('until', 'f8')], align=True)
"""state: of machine.STATES; active: whether its condition is there, delays over; since: stamp until which the
condition was as `active` says [s]; raised: stamp at which it was raised last [s]; first: whether it was the first of
its burst; parent: index of the alarm that it is a consequence of, NO_ALARM; until: stamp at which a shelved one comes
back
[s]."""

ALARM_LIST_DTYPE = np.dtype([('alarm', ALARM_DTYPE, (ALARM_COUNT,)), ('burst', 'f8'), ('revision', 'i8')], align=True)
"""burst: stamp at which a burst of alarms began [s]; revision: counts the changes of what is told."""

NO_ALARM = -1

FIRST_OUT_WINDOW_S = 1.0
"""Time [s] within which the alarms after the first one belong to its burst."""

CAUSE_WINDOW_S = 5.0
"""Time [s] within which an alarm is taken for the consequence of another, whichever is raised first."""

MAX_SHELVING_TIME_S = 86400.0
"""Time for which an alarm may be shelved [s]: a day."""


def initialise(s):
    """Nothing is wrong. s: view of ALARM_LIST_DTYPE, as everywhere here; nothing has been told."""
    s['alarm']['state'] = machine.State.NORMAL
    s['alarm']['parent'] = NO_ALARM
    s['alarm']['since'] = s['alarm']['raised'] = s['burst'] = -np.inf
    s['revision'] = 1


@compiled
def restart(s, t):
    """After a gap between steps [s]: the delays begin anew."""
    for i in range(ALARM_COUNT):
        s.alarm[i].since = t


@compiled
def _parent(s, i, t):
    """The first cause of alarm i that is told and is there, or was raised CAUSE_WINDOW_S ago at most; NO_ALARM."""
    for j in range(i):
        cause = s.alarm[j]
        if table.CAUSE_BITS[i] >> j & 1 and machine.IS_ANNUNCIATED[cause.state] and (
                cause.active or t - cause.raised <= CAUSE_WINDOW_S):
            return j
    return NO_ALARM


@compiled
def _raised(s, i, t):
    """Alarm i has been raised: whether it is the first, what it stands under, what stands under it."""
    a = s.alarm[i]
    a.first = t - s.burst > FIRST_OUT_WINDOW_S
    if a.first:
        s.burst = t
    a.raised, a.parent = t, _parent(s, i, t)
    for k in range(i + 1, ALARM_COUNT):
        other = s.alarm[k]
        if (table.CAUSE_BITS[k] >> i & 1 and other.parent == NO_ALARM and machine.IS_ANNUNCIATED[other.state]
                and t - other.raised <= CAUSE_WINDOW_S):
            other.parent = i


@compiled
def _enter(s, i, state, t):
    """Alarm i goes into another of machine.STATES."""
    a = s.alarm[i]
    if machine.IS_LISTED[a.state] or machine.IS_LISTED[state]:
        s.revision += 1
    a.state = state
    if state == machine.State.UNACKNOWLEDGED:
        _raised(s, i, t)


@compiled
def apply_event(s, i, event, t):
    """An event of machine.EVENTS for alarm i at t [s]; whether its state takes it."""
    before = s.alarm[i].state
    after = machine.next_state(before, event, table.LATCHED_FLAGS[i])
    if after != before and after != machine.EVENT_REFUSED:
        _enter(s, i, after, t)
    return after != machine.EVENT_REFUSED


@compiled
def _delayed(a, on, t, delay):
    """Take whether the condition of a record is there at t [s]; it must be for a delay [s] before that counts."""
    if on == a.active:
        a.since = t
    elif t - a.since >= delay:
        a.active, a.since = on, t


@compiled
def update(s, t, conditions, judged):
    """One step at t [s]: the bits of the conditions that are there, and of the alarms that are judged now."""
    for i in range(ALARM_COUNT):
        a = s.alarm[i]
        on, means = conditions & judged & 1 << i != 0, judged & 1 << i != 0
        usual = machine.State.NORMAL if means else machine.State.SUPPRESSED_BY_DESIGN
        if not on and a.active == 0 and a.state == usual:
            a.since = t     # nothing is wrong, as nearly always: what follows would change no more
            continue
        _delayed(a, on, t, table.ON_DELAYS_S[i] if on else table.OFF_DELAYS_S[i])
        if a.state == machine.State.SHELVED and t >= a.until:
            apply_event(s, i, machine.Event.UNSHELVE, t)
        apply_event(s, i, machine.Event.RELEASE if means else machine.Event.SUPPRESS, t)
        apply_event(s, i, machine.Event.RAISE if a.active else machine.Event.CLEAR, t)


@compiled
def active_parent(s, i):
    """Index of the alarm that alarm i stands under now, NO_ALARM."""
    parent = s.alarm[i].parent
    if parent != NO_ALARM and machine.IS_ANNUNCIATED[s.alarm[parent].state]:
        return parent
    return NO_ALARM


@compiled
def acknowledge(s, i, t):
    """Acknowledge alarm i and all that stands under it; whether there was anything to acknowledge."""
    done = apply_event(s, i, machine.Event.ACKNOWLEDGE, t)
    for k in range(i + 1, ALARM_COUNT):
        top = k
        while top != NO_ALARM and top != i:
            top = active_parent(s, top)
        if top == i:
            done |= apply_event(s, k, machine.Event.ACKNOWLEDGE, t)
    return done


@compiled
def shelve(s, i, t, seconds):
    """Put alarm i away until t + seconds, whatever its state."""
    s.alarm[i].until = t + seconds
    s.revision += 1
    apply_event(s, i, machine.Event.SHELVE, t)


@compiled
def persisting_alarm(s, without):
    """Index of a latched alarm whose cause is still there, NO_ALARM; without: bits of those that are not asked
    about."""
    for i in range(ALARM_COUNT):
        if table.LATCHED_FLAGS[i] and not without >> i & 1 and s.alarm[i].active and machine.IS_ANNUNCIATED[s.alarm[i].state]:
            return i
    return NO_ALARM


@compiled
def set_condition(s, i, there, t):
    """Whether the condition of alarm i is there is known at t [s] without its delays."""
    s.alarm[i].active = there
    apply_event(s, i, machine.Event.RAISE if there else machine.Event.CLEAR, t)


@compiled
def reset(s, t):
    """End the latched states; whether there was one. To be called when nothing `persists`."""
    done = False
    for i in range(ALARM_COUNT):
        if machine.IS_LATCHED[s.alarm[i].state]:
            done |= apply_event(s, i, machine.Event.RESET, t)
    return done
