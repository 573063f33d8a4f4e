"""The annunciator: it keeps the state of all alarms, and decides which alarms an operator sees as causes.

The conditions of a step become alarms after their delays. The first alarm of a burst is marked (first-out), because it
often shows the cause of the burst.

By the table an alarm may be the consequence of another alarm, its parent. The alarm stands under its parent in two
cases: the condition of the parent is present, or both were raised within CAUSE_WINDOW_S. Only an alarm without a
parent is annunciated (`report`).

s: record of AlarmList; i: index of an alarm in table.ALARMS; t: stamp of the step [s].
"""
from collections.abc import Sequence
from typing import Annotated

import numpy as np

from acu_tracker.alarms import machine, table
from pedestal_common.compiled import compiled
from pedestal_common.record import Record

ALARM_COUNT = len(table.ALARMS)


class Alarm(Record):
    """State of an alarm."""
    state: int  # index in machine.ALARM_STATES
    active: int  # 1 if its condition is present, after the delays
    since: float  # last stamp at which the condition was as `active` states [s]
    raised: float  # stamp at which the alarm was last raised [s]
    first: int  # 1 if it was the first alarm of its burst
    parent: int  # index of the alarm under which it stands, or NO_ALARM
    until: float  # stamp at which a shelved alarm returns [s]


class AlarmList(Record):
    """State of all alarms."""
    alarm: Annotated[Sequence[Alarm], (ALARM_COUNT,)]
    burst: float  # stamp at which the last burst of alarms began [s]
    revision: int  # number of changes of the published list


NO_ALARM = -1  # index that stands for no alarm
FIRST_OUT_WINDOW_S = 1.0  # time after the first alarm of a burst within which other alarms belong to the burst [s]

CAUSE_WINDOW_S = 5.0
"""Longest time between two alarms, in either order, in which the one counts as the consequence of the other [s]."""

MAX_SHELVING_TIME_S = 86400.0  # longest time for which an alarm may be shelved [s]: a day


def initialise(s):
    """Begin with every alarm in the state normal and no list published; s: view of AlarmList."""
    s['alarm']['state'] = machine.State.NORMAL
    s['alarm']['parent'] = NO_ALARM
    s['alarm']['since'] = s['alarm']['raised'] = s['burst'] = -np.inf
    s['revision'] = 1


@compiled
def restart(s, t):
    """Restart the delays at t [s], after a gap between steps."""
    for i in range(ALARM_COUNT):
        s.alarm[i].since = t


@compiled
def _parent(s, i, t):
    """Return the index of the parent of alarm i, or NO_ALARM.

    The parent is the first possible cause in the table that is listed, not shelved, and present or raised within
    CAUSE_WINDOW_S.
    """
    for j in range(i):
        cause = s.alarm[j]
        if table.CAUSE_BITS[i] >> j & 1 and machine.IS_ANNUNCIATED[cause.state] and (
                cause.active or t - cause.raised <= CAUSE_WINDOW_S):
            return j
    return NO_ALARM


@compiled
def _raised(s, i, t):
    """Note that alarm i has been raised: set its first-out mark and its parent.

    Alarm i also becomes the parent of its recent consequences, if these have no parent yet.
    """
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
    """Put alarm i into another state of machine.ALARM_STATES."""
    a = s.alarm[i]
    if machine.IS_LISTED[a.state] or machine.IS_LISTED[state]:
        s.revision += 1
    a.state = state
    if state == machine.State.UNACKNOWLEDGED:
        _raised(s, i, t)


@compiled
def apply_event(s, i, event, t):
    """Apply an event of machine.ALARM_EVENTS to alarm i at t [s]. Return True if its state accepts the event."""
    before = s.alarm[i].state
    after = machine.next_state(before, event, table.LATCHED_FLAGS[i])
    if after != before and after != machine.EVENT_REFUSED:
        _enter(s, i, after, t)
    return after != machine.EVENT_REFUSED


@compiled
def _delayed(a, on, t, delay):
    """Set a.active to `on` (the condition is present or not at t) after it has been so for a delay [s].

    a: record of Alarm.
    """
    if on == a.active:
        a.since = t
    elif t - a.since >= delay:
        a.active, a.since = on, t


@compiled
def update(s, t, conditions, judged):
    """Run one step at t [s].

    conditions: bits of the alarms whose condition is present; judged: bits of the alarms that have a meaning in this
    step. The other alarms are suppressed.
    """
    for i in range(ALARM_COUNT):
        a = s.alarm[i]
        on, is_judged = conditions & judged & 1 << i != 0, judged & 1 << i != 0
        usual = machine.State.NORMAL if is_judged else machine.State.SUPPRESSED_BY_DESIGN
        if not on and a.active == 0 and a.state == usual:
            # This avoids the work below in the usual case, in which nothing would change.
            a.since = t
            continue
        _delayed(a, on, t, table.ON_DELAYS_S[i] if on else table.OFF_DELAYS_S[i])
        if a.state == machine.State.SHELVED and t >= a.until:
            apply_event(s, i, machine.Event.UNSHELVE, t)
        apply_event(s, i, machine.Event.RELEASE if is_judged else machine.Event.SUPPRESS, t)
        apply_event(s, i, machine.Event.RAISE if a.active else machine.Event.CLEAR, t)


@compiled
def active_parent(s, i):
    """Return the index of the parent of alarm i, if the parent is listed and not shelved, else NO_ALARM."""
    parent = s.alarm[i].parent
    if parent != NO_ALARM and machine.IS_ANNUNCIATED[s.alarm[parent].state]:
        return parent
    return NO_ALARM


@compiled
def acknowledge(s, i, t):
    """Acknowledge alarm i and all alarms that stand under it. Return True if one of them waited for it."""
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
    """Shelve alarm i, in any state, for some seconds from t [s] on."""
    s.alarm[i].until = t + seconds
    s.revision += 1
    apply_event(s, i, machine.Event.SHELVE, t)


@compiled
def persisting_alarm(s, without):
    """Return the index of a latching alarm whose condition is still present, or NO_ALARM.

    without: bits of the alarms that are not considered.
    """
    for i in range(ALARM_COUNT):
        alarm = s.alarm[i]
        if table.LATCHED_FLAGS[i] and not without >> i & 1 and alarm.active and machine.IS_ANNUNCIATED[alarm.state]:
            return i
    return NO_ALARM


@compiled
def set_condition(s, i, there, t):
    """Set the condition of alarm i at t [s] without its delays; there: True if the condition is present."""
    s.alarm[i].active = there
    apply_event(s, i, machine.Event.RAISE if there else machine.Event.CLEAR, t)


@compiled
def reset(s, t):
    """Reset the latched alarms. Return True if there was one.

    The caller must make sure before that no latched alarm has its condition (`persisting_alarm`).
    """
    done = False
    for i in range(ALARM_COUNT):
        if machine.IS_LATCHED[s.alarm[i].state]:
            done |= apply_event(s, i, machine.Event.RESET, t)
    return done
