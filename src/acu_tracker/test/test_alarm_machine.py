"""The states of an alarm: every cell of (state, event), and the records of all alarms under any story."""
import itertools

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule

from acu_tracker.alarms import annunciator, machine, report, table

N, U, A, R, LU, LA, SH, SU = machine.ALARM_STATES
EXPECTED = {
    N: {'raise': U, 'clear': N, 'shelve': SH, 'suppress': SU, 'release': N},
    U: {'raise': U, 'clear': (R, LU), 'acknowledge': A, 'shelve': SH, 'suppress': U, 'release': U},
    A: {'raise': A, 'clear': (N, LA), 'shelve': SH, 'suppress': A, 'release': A},
    R: {'raise': U, 'clear': R, 'acknowledge': N, 'shelve': SH, 'suppress': R, 'release': R},
    LU: {'raise': U, 'clear': LU, 'acknowledge': LA, 'reset': R, 'shelve': SH, 'suppress': LU, 'release': LU},
    LA: {'raise': U, 'clear': LA, 'reset': N, 'shelve': SH, 'suppress': LA, 'release': LA},
    SH: {'raise': SH, 'clear': SH, 'shelve': SH, 'unshelve': N, 'suppress': SH, 'release': SH},
    SU: {'raise': SU, 'clear': SU, 'shelve': SH, 'suppress': SU, 'release': N}}
"""ANSI/ISA-18.2-2016, figure 3, and what this house adds; a pair: not latched, latched; a missing event: refused."""


@pytest.mark.parametrize(('state', 'event', 'latched'), [*itertools.product(machine.ALARM_STATES, machine.ALARM_EVENTS,
                                                                            (0, 1))])
def test_every_cell(state, event, latched):
    after = machine.next_state(machine.ALARM_STATES.index(state), machine.ALARM_EVENTS.index(event), latched)
    expected = EXPECTED[state].get(event)
    if isinstance(expected, tuple):
        expected = expected[latched]
    assert (None if after == machine.EVENT_REFUSED else machine.ALARM_STATES[after]) == expected


def test_causes_stand_before_their_consequences_and_the_critical_are_few():
    for i, alarm in enumerate(table.ALARMS):
        assert all(table.ALARM_INDEX[name] < i for name in alarm.cause), alarm.name
        assert alarm.priority in table.ALARM_PRIORITIES and alarm.judged in table.JUDGED_CASES
        assert alarm.meaning and alarm.action
    assert len(set(table.ALARM_NAMES)) == len(table.ALARM_NAMES) < 63
    kinds = {name.removeprefix('azimuth ').removeprefix('elevation '): row.priority
             for name, row in zip(table.ALARM_NAMES, table.ALARMS)}
    assert sum(priority == 'critical' for priority in kinds.values()) <= 0.2 * len(kinds)


EVERY = (1 << annunciator.ALARM_COUNT) - 1


class List:
    """The records of all alarms, stepped from Python."""

    def __init__(self):
        self.record = annunciator.AlarmList.zeros()
        annunciator.initialise(self.s)
        self.t = 0.0
        self.step()

    @property
    def s(self):
        return self.record[0]

    def step(self, *names, seconds=0.0, judged=EVERY):
        """Steps of 0.1 s (one at least) with the conditions of these alarms."""
        bits = sum(1 << table.ALARM_INDEX[name] for name in names)
        for _ in range(max(round(seconds / 0.1), 1)):
            self.t += 0.1
            annunciator.update(self.s, self.t, bits, judged)
        return self

    def ask(self, law, name, *arguments):
        return law(self.s, table.ALARM_INDEX[name], *arguments)

    def state(self, name):
        return machine.ALARM_STATES[self.s['alarm'][table.ALARM_INDEX[name]]['state']]

    def names(self, indices):
        return [table.ALARM_NAMES[i] for i in indices]


def test_delays_on_and_off():
    a = List()
    assert a.step('receiver silent', seconds=0.9).state('receiver silent') == N
    assert a.step().step('receiver silent', seconds=0.9).state('receiver silent') == N
    assert a.step('receiver silent', seconds=0.3).state('receiver silent') == U
    assert a.step(seconds=0.8).state('receiver silent') == U
    assert a.step(seconds=0.4).state('receiver silent') == R


def test_a_latched_alarm_waits_for_its_reset():
    a = List().step('azimuth encoder jump')
    assert a.state('azimuth encoder jump') == U
    assert annunciator.persisting_alarm(a.s, 0) == table.ALARM_INDEX['azimuth encoder jump']
    a.step(seconds=2.0)
    assert a.state('azimuth encoder jump') == LU and annunciator.persisting_alarm(a.s, 0) == annunciator.NO_ALARM
    assert a.ask(annunciator.acknowledge, 'azimuth encoder jump', a.t) and a.state('azimuth encoder jump') == LA
    assert annunciator.reset(a.s, a.t) and a.state('azimuth encoder jump') == N
    assert not annunciator.reset(a.s, a.t)


def test_a_reset_before_the_acknowledgement_leaves_it_to_be_acknowledged():
    a = List().step('azimuth encoder jump').step(seconds=2.0)
    assert annunciator.reset(a.s, a.t) and a.state('azimuth encoder jump') == R


def test_shelved_until_its_end_and_judged_anew():
    a = List().step('INS lost')
    a.ask(annunciator.shelve, 'INS lost', a.t, 5.0)
    assert a.step('INS lost', seconds=4.0).state('INS lost') == SH and report.annunciated(a.s) == []
    assert a.names(report.listed(a.s)) == ['INS lost']
    assert not a.ask(annunciator.acknowledge, 'INS lost', a.t)
    assert a.step('INS lost', seconds=2.0).state('INS lost') == U
    a.ask(annunciator.shelve, 'INS lost', a.t, 5.0)
    assert a.step(seconds=6.0).state('INS lost') == N
    a.ask(annunciator.shelve, 'INS lost', a.t, 500.0)
    assert a.ask(annunciator.apply_event, 'INS lost', machine.Event.UNSHELVE, a.t) and a.step().state('INS lost') == N


def test_what_is_not_judged_returns_and_is_then_suppressed():
    bit = 1 << table.ALARM_INDEX['receiver silent']
    a = List().step('receiver silent', seconds=2.0)
    a.step('receiver silent', seconds=2.0, judged=EVERY & ~bit)
    assert a.state('receiver silent') == R
    a.ask(annunciator.acknowledge, 'receiver silent', a.t)
    assert a.step('receiver silent', judged=EVERY & ~bit).state('receiver silent') == SU
    assert a.step().state('receiver silent') == N


@pytest.mark.parametrize('order', (
    (('azimuth brake not released', 0.5), ('azimuth immobile', 0.3), ('drive fault', 0.0)),
    (('drive fault', 0.0), ('azimuth immobile', 0.3), ('azimuth brake not released', 0.5))))
def test_consequences_stand_under_their_cause_whichever_comes_first(order):
    a, there = List(), []
    for name, delay in order:
        there.append(name)
        a.step(*there, seconds=delay + 0.2)
    assert a.names(report.annunciated(a.s)) == ['azimuth brake not released']
    assert a.ask(annunciator.acknowledge, 'azimuth brake not released', a.t)
    assert {a.state(name) for name, _ in order} == {A}
    a.step('drive fault', seconds=2.0)                     # the cause has gone, its consequence stands for itself
    assert a.names(report.annunciated(a.s)) == ['drive fault']


def test_the_first_of_a_burst_is_marked():
    a = List().step('azimuth encoder jump').step('azimuth encoder jump', 'drive fault').step(
        'azimuth encoder jump', 'drive fault', 'emergency stop')
    a.step('azimuth encoder jump', 'drive fault', 'emergency stop', seconds=1.5)
    a.step('azimuth encoder jump', 'drive fault', 'emergency stop', 'INS lost')
    assert a.names(i for i in range(annunciator.ALARM_COUNT) if a.s['alarm'][i]['first']) == [
        'INS lost', 'azimuth encoder jump']


def test_what_is_raised_long_after_stands_for_itself():
    a = List().step('azimuth encoder jump').step(seconds=8.0).step('drive fault')
    assert set(a.names(report.annunciated(a.s))) == {'azimuth encoder jump', 'drive fault'}


def test_the_message_tells_what_to_do():
    a = List().step('azimuth encoder jump', 'drive fault')
    a.ask(annunciator.shelve, 'time jump', a.t, 60.0)
    told = report.message(a.s, {table.ALARM_INDEX['drive fault']: 'fault: azimuth encoder disagreement'},
                          {table.ALARM_INDEX['time jump']: 'known'})
    rows = {status.name: {value.key: value.value for value in status.values} for status in told.status}
    assert list(rows) == ['azimuth encoder jump', 'drive fault', 'time jump']
    assert rows['azimuth encoder jump'] == {
        'state': U, 'priority': 'high', 'annunciated': '1', 'raised_s': '0.200', 'first_out': '1', 'cause': '',
        'action': table.ALARMS[table.ALARM_INDEX['azimuth encoder jump']].action}
    assert rows['drive fault']['cause'] == 'azimuth encoder jump' and rows['drive fault']['annunciated'] == '0'
    assert rows['drive fault']['detail'] == 'fault: azimuth encoder disagreement'
    assert (rows['time jump']['shelved_until_s'], rows['time jump']['shelved_reason']) == ('60.200', 'known')
    assert [status.level for status in told.status] == [2, 2, 0]


class Story(RuleBasedStateMachine):
    """Whatever comes and goes, and whatever is asked for."""

    @initialize()
    def begin(self):
        self.list, self.there = List(), frozenset()

    @rule(there=st.frozensets(st.sampled_from(table.ALARM_NAMES)), steps=st.integers(1, 30))
    def go_on(self, there, steps):
        self.there = there
        self.list.step(*there, seconds=0.1 * steps)

    @rule(name=st.sampled_from(table.ALARM_NAMES))
    def acknowledge(self, name):
        waits = machine.AWAITS_ACKNOWLEDGEMENT[self.list.s['alarm'][table.ALARM_INDEX[name]]['state']]
        done = self.list.ask(annunciator.acknowledge, name, self.list.t)
        assert done or not waits
        assert not machine.AWAITS_ACKNOWLEDGEMENT[self.list.s['alarm'][table.ALARM_INDEX[name]]['state']]

    @rule(name=st.sampled_from(table.ALARM_NAMES), seconds=st.floats(0.1, 10.0))
    def shelve(self, name, seconds):
        self.list.ask(annunciator.shelve, name, self.list.t, seconds)
        assert self.list.state(name) == SH

    @rule(name=st.sampled_from(table.ALARM_NAMES))
    def unshelve(self, name):
        taken = self.list.ask(annunciator.apply_event, name, machine.Event.UNSHELVE, self.list.t)
        assert taken == (self.list.state(name) == N) or self.list.state(name) != SH
        self.list.step(*self.there)     # in which it is raised again where its condition is still there

    @rule()
    def reset(self):
        if annunciator.persisting_alarm(self.list.s, 0) == annunciator.NO_ALARM:
            annunciator.reset(self.list.s, self.list.t)
            assert not any(machine.IS_LATCHED[alarm['state']] for alarm in self.list.s['alarm'])

    @rule()
    def wait(self):
        """Nothing is wrong for long: all has returned, and an acknowledgement of everything and a reset clear it."""
        self.list.step(seconds=25.0)
        self.there = frozenset()
        for name in table.ALARM_NAMES:
            self.list.ask(annunciator.acknowledge, name, self.list.t)
        assert annunciator.persisting_alarm(self.list.s, 0) == annunciator.NO_ALARM
        annunciator.reset(self.list.s, self.list.t)
        assert report.listed(self.list.s) == []

    @invariant()
    def nothing_is_lost_and_no_storm_comes_through(self):
        s = self.list.s
        first, listed = report.annunciated(s), report.listed(s)
        assert len(first) <= 10 and len(set(listed)) == len(listed) and listed[:len(first)] == first
        assert {i for i in range(annunciator.ALARM_COUNT) if machine.IS_LISTED[s['alarm'][i]['state']]} == set(listed)
        for i, alarm in enumerate(s['alarm']):
            assert 0 <= alarm['state'] < len(machine.ALARM_STATES)
            assert not machine.IS_LATCHED[alarm['state']] or table.LATCHED_FLAGS[i]
            above = annunciator.active_parent(s, i)
            assert above < i and (above == annunciator.NO_ALARM or table.CAUSE_BITS[i] >> above & 1)
            if alarm['active']:
                assert alarm['state'] in map(machine.ALARM_STATES.index, (U, A, SH))


Story.TestCase.settings = settings(max_examples=30, stateful_step_count=30, deadline=None, database=None,
                                   derandomize=True)
TestStory = Story.TestCase
