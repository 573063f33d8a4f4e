"""The records of all alarms: delays, causes, first-out, and what an operator asks of them.

A consequence stands under its cause while the cause is told: found when either is raised within CAUSE_TIME of the
other, or while the cause is there. Only what stands under nothing is annunciated (see report).
"""
import numpy as np

from acu_tracker.alarms import machine, table
from pedestal_common.compiled import compiled

COUNT = len(table.ALARMS)

ALARM = np.dtype([('state', 'i8'), ('active', 'i8'), ('since', 'f8'), ('raised', 'f8'), ('first', 'i8'),
                  ('parent', 'i8'), ('until', 'f8')], align=True)
"""state: of machine.STATES; active: whether its condition is there, delays over; since: stamp until which the
condition was as `active` says [s]; raised: stamp at which it was raised last [s]; first: whether it was the first of
its burst; parent: index of the alarm that it is a consequence of, NONE; until: stamp at which a shelved one comes back
[s]."""

ALARMS = np.dtype([('alarm', ALARM, (COUNT,)), ('burst', 'f8'), ('revision', 'i8')], align=True)
"""burst: stamp at which a burst of alarms began [s]; revision: counts the changes of what is told."""

NONE = -1

FIRST_OUT = 1.0
"""Time [s] within which the alarms after the first one belong to its burst."""

CAUSE_TIME = 5.0
"""Time [s] within which an alarm is taken for the consequence of another, whichever is raised first."""

LONGEST_SHELVED = 86400.0
"""Time for which an alarm may be shelved [s]: a day."""


def initialise(s):
    """Nothing is wrong. s: view of ALARMS, as everywhere here; nothing has been told."""
    s['alarm']['state'] = machine.State.NORMAL
    s['alarm']['parent'] = NONE
    s['alarm']['since'] = s['alarm']['raised'] = s['burst'] = -np.inf
    s['revision'] = 1


@compiled
def restart(s, t):
    """After a gap between steps [s]: the delays begin anew."""
    for i in range(COUNT):
        s.alarm[i].since = t


@compiled
def _parent(s, i, t):
    """The first cause of alarm i that is told and is there, or was raised CAUSE_TIME ago at most; NONE."""
    for j in range(i):
        cause = s.alarm[j]
        if table.CAUSES[i] >> j & 1 and machine.ANNUNCIATED[cause.state] and (
                cause.active or t - cause.raised <= CAUSE_TIME):
            return j
    return NONE


@compiled
def _raised(s, i, t):
    """Alarm i has been raised: whether it is the first, what it stands under, what stands under it."""
    a = s.alarm[i]
    a.first = t - s.burst > FIRST_OUT
    if a.first:
        s.burst = t
    a.raised, a.parent = t, _parent(s, i, t)
    for k in range(i + 1, COUNT):
        other = s.alarm[k]
        if (table.CAUSES[k] >> i & 1 and other.parent == NONE and machine.ANNUNCIATED[other.state]
                and t - other.raised <= CAUSE_TIME):
            other.parent = i


@compiled
def _enter(s, i, state, t):
    """Alarm i goes into another of machine.STATES."""
    a = s.alarm[i]
    if machine.LISTED[a.state] or machine.LISTED[state]:
        s.revision += 1
    a.state = state
    if state == machine.State.UNACKNOWLEDGED:
        _raised(s, i, t)


@compiled
def put(s, i, event, t):
    """An event of machine.EVENTS for alarm i at t [s]; whether its state takes it."""
    before = s.alarm[i].state
    after = machine.next_state(before, event, table.LATCHED[i])
    if after != before and after != machine.REFUSED:
        _enter(s, i, after, t)
    return after != machine.REFUSED


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
    for i in range(COUNT):
        a = s.alarm[i]
        on, means = conditions & judged & 1 << i != 0, judged & 1 << i != 0
        usual = machine.State.NORMAL if means else machine.State.SUPPRESSED_BY_DESIGN
        if not on and a.active == 0 and a.state == usual:
            a.since = t     # nothing is wrong, as nearly always: what follows would change no more
            continue
        _delayed(a, on, t, table.ON_DELAY[i] if on else table.OFF_DELAY[i])
        if a.state == machine.State.SHELVED and t >= a.until:
            put(s, i, machine.Event.UNSHELVE, t)
        put(s, i, machine.Event.RELEASE if means else machine.Event.SUPPRESS, t)
        put(s, i, machine.Event.RAISE if a.active else machine.Event.CLEAR, t)


@compiled
def above(s, i):
    """Index of the alarm that alarm i stands under now, NONE."""
    parent = s.alarm[i].parent
    if parent != NONE and machine.ANNUNCIATED[s.alarm[parent].state]:
        return parent
    return NONE


@compiled
def acknowledge(s, i, t):
    """Acknowledge alarm i and all that stands under it; whether there was anything to acknowledge."""
    done = put(s, i, machine.Event.ACKNOWLEDGE, t)
    for k in range(i + 1, COUNT):
        top = k
        while top != NONE and top != i:
            top = above(s, top)
        if top == i:
            done |= put(s, k, machine.Event.ACKNOWLEDGE, t)
    return done


@compiled
def shelve(s, i, t, seconds):
    """Put alarm i away until t + seconds, whatever its state."""
    s.alarm[i].until = t + seconds
    s.revision += 1
    put(s, i, machine.Event.SHELVE, t)


@compiled
def persists(s, without):
    """Index of a latched alarm whose cause is still there, NONE; without: bits of those that are not asked about."""
    for i in range(COUNT):
        if table.LATCHED[i] and not without >> i & 1 and s.alarm[i].active and machine.ANNUNCIATED[s.alarm[i].state]:
            return i
    return NONE


@compiled
def know(s, i, there, t):
    """Whether the condition of alarm i is there is known at t [s] without its delays."""
    s.alarm[i].active = there
    put(s, i, machine.Event.RAISE if there else machine.Event.CLEAR, t)


@compiled
def reset(s, t):
    """End the latched states; whether there was one. To be called when nothing `persists`."""
    done = False
    for i in range(COUNT):
        if machine.LATCHED[s.alarm[i].state]:
            done |= put(s, i, machine.Event.RESET, t)
    return done
