"""State of the antenna as the page, the console and `pedestal status` show it, and the screen of the console."""
import math
import types

import pytest

from pedestal_common.geometry import pointing_report
from pedestal_common.graph import nodes
from pedestal_common.wire import messages
from pedestal_operator import console, state
from pedestal_operator.antenna import Antenna
from pedestal_operator.page import page_security
from pedestal_operator.remote_node import Requests

HEALTHY = {'mode': 'rate', 'reason': 'command', 'fallback': 'coast', 'control': '', 'drive': 'enabled',
           'coasting': '0', 'azimuth limit_s': '12.4', 'elevation limit_s': 'inf'}

FAULT = {'drive': 'fault: azimuth encoder jump, azimuth following error, elevation encoder disagreement',
         'control': 'berta@page 127.0.0.1', 'refused tle': 'no elements'}
REPLY = 'reset: refused: the cause of uncommanded motion is still there, and the antenna has not come to rest yet'


def alarm(name, condition, cause=''):
    values = {'state': condition, 'priority': 'high', 'cause': cause, 'action': f'mend {name}', 'raised_s': '3.000'}
    return types.SimpleNamespace(name=name, message=f'meaning of {name}', values=[
        messages.KeyValue(key=key, value=value) for key, value in values.items()])


class Station(Antenna):
    """An antenna whose messages and their ages [s] a test chooses."""

    def __init__(self, diagnostics=None, alarms=(), rates=(0.0, 0.0), ages=None):
        self.beam, self.texts, self.alarms = '', {}, list(alarms)
        self._ages = {'acu': 0.1, 'adu': 0.1, 'joint_states': 0.0} | (ages or {})
        self.numbers = {'joint_states': (0.5, 0.6, *map(math.radians, rates))}
        values = [messages.KeyValue(key=key, value=value)
                  for key, value in {**HEALTHY, **(diagnostics or {})}.items()]
        self.status = {'acu': types.SimpleNamespace(values=values, level=0, message='rate (command)'),
                       'adu': types.SimpleNamespace(values=[], level=0, message='enabled')}
        self.status = {name: status for name, status in self.status.items() if self._ages[name] < math.inf}

    def age(self, name):
        return self._ages.get(name, math.inf)


def test_a_healthy_antenna():
    header = state.header(Station())
    assert {name: shown.text for name, shown in header.items()} == {
        'mode': 'rate', 'reason': 'command', 'drive': 'enabled', 'control': 'none', 'fallback': 'coast',
        'link': 'live'}
    assert all(shown.level == '' for shown in header.values())
    assert state.axis_states(Station(rates=(0.0, 0.3))) == [('limit in 12 s', 'warn'), ('moving', '')]
    assert state.axis_states(Station({'elevation limited': 'rate'}))[1] == ('rate limited', 'warn')
    assert state.first_alarm(Station()) is None and state.node_reports(Station()) == []
    assert state.header(Station({'coasting': '1'}))['reason'].text == 'command, coasting'


@pytest.mark.parametrize('drive, ages', [('silent', {'joint_states': 0.9}), ('enabled', {'joint_states': 5.2}),
                                         ('unknown', {'joint_states': math.inf})])
def test_a_silent_drive_is_silent_in_every_place(drive, ages):
    """Also before the control unit reports the silence, and before the first angle arrived."""
    station = Station({'drive': drive, 'azimuth limit_s': '0.0'}, ages=ages)
    header = state.header(station)
    assert header['link'] == ('no adu', 'bad')
    assert state.axis_states(station) == [('silent', 'bad')] * 2
    assert header['drive'] == {'silent': ('silent for 1 s', 'bad'), 'enabled': ('silent for 5 s', 'bad'),
                               'unknown': ('unknown', 'bad')}[drive]


@pytest.mark.parametrize(('mode', 'progress', 'text', 'expected'), (
    ('stow', 'stowing', 'stow', 'stowing'), ('stow', 'stowed', 'stow', 'stowed'), ('stow', 'stowed', 'rate', 'rate')))
def test_the_mode_is_shown_with_its_progress_until_another_mode_begins(mode, progress, text, expected):
    """The mode arrives at once, its progress with the next diagnostics."""
    station = Station({'mode': mode, 'progress': progress})
    station.texts['acu/mode'] = text
    assert state.header(station)['mode'].text == expected


def test_the_alarms_of_the_control_unit_are_reported_while_they_need_an_action():
    listed = [alarm('steps lost', 'acknowledged'), alarm('time jump', 'returned unacknowledged', 'steps lost'),
              alarm('INS lost', 'shelved'), alarm('diverged', 'latched unacknowledged')]
    assert state.alarm_reports(Station(alarms=listed)) == [
        (name, f'high, {condition}: meaning of {name} -> mend {name}')
        for name, condition in (('steps lost', 'acknowledged'), ('diverged', 'latched unacknowledged'))]
    assert state.alarm_reports(Station(alarms=listed, ages={'acu': 9.0})) == []


def test_a_silent_control_unit_has_no_mode_and_no_commands():
    station = Station({'control': 'anna@page 127.0.0.1'}, ages={'acu': 12.2})
    header = state.header(station)
    assert header['mode'] == ('unknown', 'bad') and header['reason'] == ('last: rate, 12 s ago', 'bad')
    assert header['link'] == ('no ACU', 'bad') and header['control'] == ('unknown', 'bad')
    for holds in (True, False):
        refused = state.refusals(station, holds)        # the drive is commanded without the control unit, too
        assert set(state.OPERATOR_COMMANDS) - set(refused) == set(nodes.DRIVE_SERVICES)
        assert set(refused.values()) == {'the control unit is silent'}
    assert ('acu', 'silent') in state.node_reports(station)
    assert state.header(Station(ages={'acu': math.inf, 'adu': math.inf}))['drive'] == ('unknown', 'bad')


@pytest.mark.parametrize('control, holds, may_take, expected', [
    ('', True, False, {'release': 'control is free', 'tle': 'no elements',
                        'allow': 'no program has requested control'}),
    ('anna', True, False, {'take': 'you are in control', 'tle': 'no elements',
                            'allow': 'no program has requested control'}),
])
def test_the_holder_is_refused_by_the_mode_only(control, holds, may_take, expected):
    assert state.refusals(Station({'control': control, 'refused tle': 'no elements'}), holds, may_take) == expected


def test_another_client_may_command_standby_and_a_supervisor_may_take_control():
    station = Station({'control': 'anna', 'refused tle': 'no elements'})
    refused, supervisor = state.refusals(station, False), state.refusals(station, False, may_take=True)
    assert set(state.OPERATOR_COMMANDS) - set(refused) == {'standby', 'adu/emergency_stop'}
    assert set(state.OPERATOR_COMMANDS) - set(supervisor) == {'standby', 'take', 'adu/emergency_stop'}
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


class Remote(Station):
    """A Station that keeps the requests of a console."""

    def __init__(self, *arguments, **named):
        super().__init__(*arguments, **named)
        self.who, self._requests, self.sent = 'anna', Requests('test'), []

    def request(self, verb, arguments=None):
        self.sent.append(verb)
        return self._requests.add(verb, self.who, arguments).number

    def replied(self, number):
        return self._requests.replied(number)

    def connect_drive(self):
        pass


def made(*arguments, **named):
    """(Remote, its Console)"""
    remote = Remote(*arguments, **named)
    return remote, console.Console(types.SimpleNamespace(remote=remote))


def texts(shown, size):
    lines = [line.plain for line in shown.screen(*size)]
    assert len(lines) <= size[1]
    return '\n'.join(line[:size[0]] for line in lines)


@pytest.mark.parametrize('size', [(80, 24), (60, 20)])
@pytest.mark.parametrize('first', ['drive fault', 'an alarm with a long name and a long meaning'])
def test_mode_alarm_reply_and_keys_are_on_every_screen(size, first):
    listed = [alarm(first, 'unacknowledged'), *(alarm(f'signal lost {i}', 'acknowledged', first) for i in range(9))]
    _, shown = made(FAULT, alarms=listed)
    shown.last_reply = REPLY
    text = texts(shown, size)
    assert text.startswith('RATE  command\n') and f'9 more alarms, first HIGH {first[:20]}' in text
    assert f'-> mend {first}' in text.replace('\n', ' ') and 'has not come to rest yet' in text.replace('\n', ' ')
    for key, (_, doc) in console.KEY_COMMANDS.items():
        assert f'[{key}] {doc}' in text
    assert '[q] quit' in text and 'drive fault: azimuth encoder jump' in text and 'control berta' in text


def test_a_silent_control_unit_is_not_shown_as_healthy():
    text = texts(made(ages={'acu': 12.3})[1], (60, 20))
    assert text.startswith('UNKNOWN  last: rate, 12 s ago\n') and 'alarms unknown' in text and 'no alarm' not in text


def test_a_silent_drive_has_no_angles_of_now():
    text = texts(made({'drive': 'silent'}, ages={'joint_states': 4.0})[1], (60, 20))
    assert 'drive silent for 4 s' in text and 'link no adu' in text and text.count('silent') == 3


@pytest.mark.parametrize('key, command, control, sent', [
    ('s', 'stop', 'berta', True), ('b', 'standby', 'berta', True), ('g', 'program', 'berta', False),
    ('x', 'adu/emergency_stop', 'berta', True), ('f', 'adu/reset_faults', 'berta', False),
    ('f', 'adu/reset_faults', 'anna', True), ('g', 'program', '', True),
    ('g', 'program', 'anna', True), ('\x1b[A', 'rate', 'x', False)])
def test_a_key_whose_command_would_be_refused_shows_the_reason_instead(key, command, control, sent):
    remote, shown = made({'control': control})
    shown.press(key, 1.0)
    shown.update(1.0)
    assert remote.sent == [command] * sent
    assert shown.last_reply == ('' if sent else f'{"jog" if command == "rate" else command}: held by {control}')


def test_the_operator_sees_the_direction_on_the_sky_and_the_encoders():
    """With P1 0.3 and P7 -0.2 deg the azimuth encoder shows 0.3 deg too much, the elevation encoder 0.2 too little."""
    station = Station(ages={'acu/reference': 0.0})
    station.numbers['acu/reference'] = (0.5, 0.6, 0.0, 0.0)
    encoders = math.degrees(0.5), math.degrees(0.6)
    assert station.directions('joint_states') == station.encoder_angles('joint_states') == pytest.approx(encoders)
    assert not any('encoder' in str(line) for line in console._axis_lines(station))
    station.texts['acu/pointing'] = pointing_report.Report('', 'north.yaml', '', 0.0, {'p1': 0.3, 'p7': -0.2}).text
    assert station.encoder_angles('joint_states') == pytest.approx(encoders)
    sky = encoders[0] - 0.3, encoders[1] + 0.2
    assert station.directions('joint_states') == pytest.approx(sky, abs=1e-9)
    rows = {(row.group, row.name): row.value for row in state.rows(station)}
    for i, axis in enumerate(('azimuth', 'elevation')):
        assert rows['angle', axis] == rows['commanded', axis] == pytest.approx(sky[i])
        assert rows['encoder', axis] == pytest.approx(encoders[i]) and rows['deviation', axis] == 0.0
    assert any('encoder [deg]' in str(line) for line in console._axis_lines(station))
    station.texts['acu/pointing'] = 'no report'
    assert station.directions('joint_states') == pytest.approx(encoders)
