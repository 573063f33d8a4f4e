"""State of the antenna as the page, the console and `pedestal status` show it."""
import math
import types

import pytest

from pedestal_common.wire import messages
from pedestal_operator import state
from pedestal_operator.antenna import Antenna
from pedestal_operator.page import page_security

HEALTHY = {'mode': 'rate', 'reason': 'command', 'fallback': 'coast', 'control': '', 'drive': 'enabled', 'coasting': '0',
           'azimuth limit_s': '12.4', 'elevation limit_s': 'inf'}


def alarm(name, condition, cause=''):
    values = {'state': condition, 'priority': 'high', 'cause': cause, 'action': f'mend {name}', 'raised_s': '3.000'}
    return types.SimpleNamespace(name=name, message=f'meaning of {name}', values=[
        messages.KeyValue(key=key, value=value) for key, value in values.items()])


class Station(Antenna):
    """An antenna whose messages and their ages [s] a test chooses."""

    def __init__(self, acu=None, alarms=(), rates=(0.0, 0.0), **ages):
        self.beam, self.texts, self.alarms = '', {}, list(alarms)
        self._ages = {'acu': 0.1, 'adu': 0.1, 'joint_states': 0.0} | ages
        self.numbers = {'joint_states': (0.5, 0.6, *map(math.radians, rates))}
        values = [messages.KeyValue(key=key, value=value) for key, value in {**HEALTHY, **(acu or {})}.items()]
        self.status = {'acu': types.SimpleNamespace(values=values, level=0, message='rate (command)'),
                       'adu': types.SimpleNamespace(values=[], level=0, message='enabled')}
        self.status = {name: status for name, status in self.status.items() if self._ages[name] < math.inf}

    def age(self, name):
        return self._ages.get(name, math.inf)


def test_a_healthy_antenna():
    header = state.header(Station())
    assert {name: shown.text for name, shown in header.items()} == {
        'mode': 'rate', 'reason': 'command', 'drive': 'enabled', 'control': 'none', 'fallback': 'coast', 'link': 'live'}
    assert all(shown.level == '' for shown in header.values())
    assert state.axis_states(Station(rates=(0.0, 0.3))) == [('limit in 12 s', 'warn'), ('moving', '')]
    assert state.axis_states(Station({'elevation limited': 'rate'}))[1] == ('rate limited', 'warn')
    assert state.first_alarm(Station()) is None and state.node_reports(Station()) == []
    assert state.header(Station({'coasting': '1'}))['reason'].text == 'command, coasting'


@pytest.mark.parametrize('drive, ages', [('silent', {'joint_states': 0.9}), ('enabled', {'joint_states': 5.2}),
                                         ('unknown', {'joint_states': math.inf})])
def test_a_silent_drive_is_silent_in_every_place(drive, ages):
    """Also before the control unit reports the silence, and before the first angle arrived."""
    station = Station({'drive': drive, 'azimuth limit_s': '0.0'}, **ages)
    header = state.header(station)
    assert header['link'] == ('no adu', 'bad')
    assert state.axis_states(station) == [('silent', 'bad')] * 2
    assert header['drive'] == {'silent': ('silent for 1 s', 'bad'), 'enabled': ('silent for 5 s', 'bad'),
                               'unknown': ('unknown', 'bad')}[drive]


def test_a_silent_control_unit_has_no_mode_and_no_commands():
    station = Station(acu={'control': 'anna@page 127.0.0.1'}, **{'acu': 12.2})
    header = state.header(station)
    assert header['mode'] == ('unknown', 'bad') and header['reason'] == ('last: rate, 12 s ago', 'bad')
    assert header['link'] == ('no ACU', 'bad') and header['control'] == ('unknown', 'bad')
    for holds in (True, False):
        assert state.refusals(station, holds) == dict.fromkeys(state.OPERATOR_COMMANDS, 'the control unit is silent')
    assert ('acu', 'silent') in state.node_reports(station)
    assert state.header(Station(acu=None, **{'acu': math.inf, 'adu': math.inf}))['drive'] == ('unknown', 'bad')


@pytest.mark.parametrize('control, holds, may_take, expected', [
    ('', True, False, {'release': 'control is free', 'tle': 'no elements'}),
    ('anna', True, False, {'take': 'you are in control', 'tle': 'no elements'}),
])
def test_the_holder_is_refused_by_the_mode_only(control, holds, may_take, expected):
    assert state.refusals(Station({'control': control, 'refused tle': 'no elements'}), holds, may_take) == expected


def test_another_client_may_command_standby_and_a_supervisor_may_take_control():
    station = Station({'control': 'anna', 'refused tle': 'no elements'})
    refused, supervisor = state.refusals(station, False), state.refusals(station, False, may_take=True)
    assert set(state.OPERATOR_COMMANDS) - set(refused) == {'standby'}
    assert set(state.OPERATOR_COMMANDS) - set(supervisor) == {'standby', 'take'}
    assert set(refused.values()) == {'held by anna'}


def test_a_monitor_may_send_no_command_of_the_list():
    assert set(page_security.refusals('monitor')) == set(state.OPERATOR_COMMANDS)
    assert page_security.refusals('operator') == page_security.refusals('supervisor') == {}


def test_the_first_alarm_is_the_first_unacknowledged_one():
    listed = [alarm('drive fault', 'acknowledged'), alarm('signal lost', 'unacknowledged', 'drive fault'),
              alarm('INS lost', 'shelved')]
    first = state.first_alarm(Station(alarms=listed))
    assert (first['name'], first['action'], first['raised_s']) == ('signal lost', 'mend signal lost', 3.0)
    assert state.first_alarm(Station(alarms=listed[:1]))['name'] == 'drive fault'
    assert state.first_alarm(Station(alarms=listed[2:])) is None
