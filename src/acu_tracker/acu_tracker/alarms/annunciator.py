"""The annunciator: it keeps the state of all alarms, and decides which alarms an operator sees as causes.

The conditions of a step become alarms after their delays. The first alarm of a burst is marked (first-out), because it
often shows the cause of the burst.

By the table an alarm may be the consequence of another alarm, its parent. The alarm stands under its parent in two
cases: the condition of the parent is present, or both were raised within CAUSE_WINDOW_S. Only an alarm without a
parent is annunciated (`report`). i: index of an alarm in table.ALARMS.
"""
from collections.abc import Sequence
from typing import Annotated

import numpy as np

from acu_tracker.alarms import machine, table
from pedestal_common.compiled import compiled
from pedestal_common.quantities import Bit, Records, Seconds
from pedestal_common.record import Record

ALARM_COUNT = len(table.ALARMS)


class Alarm(Record):
    """State of an alarm."""
    state: int      # index in machine.ALARM_STATES
    active: Bit     # 1 if its condition is present, after the delays
    since: Seconds  # last stamp at which the condition was as `active` states
    raised: Seconds     # stamp at which the alarm was last raised
    first: Bit      # 1 if it was the first alarm of its burst
    parent: int     # index of the alarm under which it stands, or NO_ALARM
    until: Seconds  # stamp at which a shelved alarm returns


class AlarmList(Record):
    """State of all alarms."""
    alarm: Annotated[Sequence[Alarm], (ALARM_COUNT,)]   # in the order of table.ALARMS
    burst: Seconds  # stamp at which the last burst of alarms began
    revision: int   # number of changes of the published list


NO_ALARM = -1  # index that stands for no alarm
FIRST_OUT_WINDOW_S = 1.0  # time after the first alarm of a burst within which other alarms belong to the burst [s]

# Longest time between two alarms, in either order, in which the one counts as the consequence of the other [s].
CAUSE_WINDOW_S = 5.0
MAX_SHELVING_TIME_S = 86400.0  # longest time for which an alarm may be shelved [s]: a day


def initialise(alarms: Records) -> None:
    """Begin with every alarm in the state normal."""
    alarms['alarm']['state'] = machine.State.NORMAL
    alarms['alarm']['parent'] = NO_ALARM
    alarms['alarm']['since'] = alarms['alarm']['raised'] = alarms['burst'] = -np.inf
    alarms['revision'] = 1


@compiled
def restart(alarms: AlarmList, t: Seconds) -> None:
    """Restart the delays at t, after a gap between steps."""
    for i in range(ALARM_COUNT):
        alarms.alarm[i].since = t


@compiled
def _parent(alarms: AlarmList, i: int, t: Seconds) -> int:
    # The parent is the first possible cause in the table that is listed, not shelved, and present or recent.
    for j in range(i):
        cause = alarms.alarm[j]
        if table.CAUSE_BITS[i] >> j & 1 and machine.IS_ANNUNCIATED[cause.state] and (
                cause.active or t - cause.raised <= CAUSE_WINDOW_S):
            return j
    return NO_ALARM


@compiled
def _raised(alarms: AlarmList, i: int, t: Seconds) -> None:
    """Set the first-out mark and the parent of alarm i, and make alarm i the parent of its recent consequences."""
    alarm = alarms.alarm[i]
    alarm.first = t - alarms.burst > FIRST_OUT_WINDOW_S
    if alarm.first:
        alarms.burst = t
    alarm.raised, alarm.parent = t, _parent(alarms, i, t)
    for k in range(i + 1, ALARM_COUNT):
        other = alarms.alarm[k]
        if (table.CAUSE_BITS[k] >> i & 1 and other.parent == NO_ALARM and machine.IS_ANNUNCIATED[other.state]
                and t - other.raised <= CAUSE_WINDOW_S):
            other.parent = i


@compiled
def _enter(alarms: AlarmList, i: int, state: int, t: Seconds) -> None:
    alarm = alarms.alarm[i]
    if machine.IS_LISTED[alarm.state] or machine.IS_LISTED[state]:
        alarms.revision += 1
    alarm.state = state
    if state == machine.State.UNACKNOWLEDGED:
        _raised(alarms, i, t)


@compiled
def apply_event(alarms: AlarmList, i: int, event: int, t: Seconds) -> bool:
    """Apply an event of machine.ALARM_EVENTS to an alarm. Return True if its state accepts the event."""
    before = alarms.alarm[i].state
    after = machine.next_state(before, event, table.LATCHED_FLAGS[i])
    if after != before and after != machine.EVENT_REFUSED:
        _enter(alarms, i, after, t)
    return after != machine.EVENT_REFUSED


@compiled
def update(alarms: AlarmList, t: Seconds, conditions: int, judged: int) -> None:
    """Run one step at t.

    conditions: bits of the alarms whose condition is present; judged: bits of the alarms that have a meaning in this
    step. The other alarms are suppressed.
    """
    for i in range(ALARM_COUNT):
        alarm = alarms.alarm[i]
        on, is_judged = conditions & judged & 1 << i != 0, judged & 1 << i != 0
        usual = machine.State.NORMAL if is_judged else machine.State.SUPPRESSED_BY_DESIGN
        if not on and alarm.active == 0 and alarm.state == usual:
            # This avoids the work below in the usual case, in which nothing would change.
            alarm.since = t
            continue
        if on == alarm.active:
            alarm.since = t
        elif t - alarm.since >= (table.ON_DELAYS_S[i] if on else table.OFF_DELAYS_S[i]):
            alarm.active, alarm.since = on, t
        if alarm.state == machine.State.SHELVED and t >= alarm.until:
            apply_event(alarms, i, machine.Event.UNSHELVE, t)
        apply_event(alarms, i, machine.Event.RELEASE if is_judged else machine.Event.SUPPRESS, t)
        apply_event(alarms, i, machine.Event.RAISE if alarm.active else machine.Event.CLEAR, t)


@compiled
def active_parent(alarms: AlarmList, i: int) -> int:
    """Return the index of the parent, if the parent is listed and not shelved, else NO_ALARM."""
    parent = alarms.alarm[i].parent
    if parent != NO_ALARM and machine.IS_ANNUNCIATED[alarms.alarm[parent].state]:
        return parent
    return NO_ALARM


@compiled
def acknowledge(alarms: AlarmList, i: int, t: Seconds) -> bool:
    """Acknowledge an alarm and all alarms that stand under it. Return True if one of them waited for it."""
    done = apply_event(alarms, i, machine.Event.ACKNOWLEDGE, t)
    for k in range(i + 1, ALARM_COUNT):
        top = k
        while top != NO_ALARM and top != i:
            top = active_parent(alarms, top)
        if top == i:
            done |= apply_event(alarms, k, machine.Event.ACKNOWLEDGE, t)
    return done


@compiled
def shelve(alarms: AlarmList, i: int, t: Seconds, seconds: Seconds) -> None:
    """Shelve an alarm, in any state, for some seconds from t on."""
    alarms.alarm[i].until = t + seconds
    alarms.revision += 1
    apply_event(alarms, i, machine.Event.SHELVE, t)


@compiled
def persisting_alarm(alarms: AlarmList, without: int) -> int:
    """Return a latching alarm whose condition is still present, or NO_ALARM; without: bits of alarms that are ignored.
    """
    for i in range(ALARM_COUNT):
        alarm = alarms.alarm[i]
        if table.LATCHED_FLAGS[i] and not without >> i & 1 and alarm.active and machine.IS_ANNUNCIATED[alarm.state]:
            return i
    return NO_ALARM


@compiled
def raised_after(alarms: AlarmList, t: Seconds) -> bool:
    """Return True if an alarm was raised after t."""
    for i in range(ALARM_COUNT):
        if alarms.alarm[i].raised > t:
            return True
    return False


@compiled
def set_condition(alarms: AlarmList, i: int, there: bool, t: Seconds) -> None:
    """Set the condition of an alarm at t without its delays; there: True if the condition is present."""
    alarms.alarm[i].active = there
    apply_event(alarms, i, machine.Event.RAISE if there else machine.Event.CLEAR, t)


@compiled
def reset(alarms: AlarmList, t: Seconds) -> bool:
    """Reset the latched alarms. Return True if there was one.

    The caller must make sure before that no latched alarm has its condition (`persisting_alarm`).
    """
    done = False
    for i in range(ALARM_COUNT):
        if machine.IS_LATCHED[alarms.alarm[i].state]:
            done |= apply_event(alarms, i, machine.Event.RESET, t)
    return done
