"""The rules of the operator's page without a server: who is served, dead men, the event log, the sky."""
import json
import math
from time import monotonic, sleep

import numpy as np
import pytest

from pedestal_common.geometry import line_of_sight
from pedestal_common.geometry.geodesy import STATION_NAMES
from pedestal_common.wire import messages
from pedestal_common.wire.commands import Command, Reply
from pedestal_operator.page import page_log, page_passes, page_security, page_server, page_sky, page_state
from pedestal_operator.page.page_requests import JOG_TIMEOUT_S, MAX_STATE_AGE_S, PAGE_REPLY_TIMEOUT_S, PageRequests
from pedestal_operator.page.page_security import Access, Refused, Request
from pedestal_operator.remote_node import Requests

GOOD = Request('127.0.0.1:8080', '', '', '', '/', False)


@pytest.fixture
def access():
    return Access('127.0.0.1', 8080)


def cookie_of(access, host='127.0.0.1:8080'):
    return f'{access.cookie(host)}={access.tokens["operator"]}'


def status(access, **changes):
    """200 or what a request is refused with."""
    request = GOOD._replace(**changes)
    try:
        access.role(request if 'cookie' in changes else request._replace(cookie=cookie_of(access, request.host)))
    except Refused as refused:
        return refused.status
    return 200


def test_who_is_served(access):
    for host in ('127.0.0.1:8080', 'LOCALHOST:8080', '[::1]:8080', '127.0.0.1', 'localhost:80', '127.0.0.1:9090'):
        for origin in (f'http://{host}', f'https://{host}'):
            assert status(access, host=host) == 200, host
            assert status(access, host=host, origin=origin, changes_state=True) == 200, origin
    for host in ('', 'evil.example:8080', 'evil.example', '127.0.0.1:8080.evil.example', '127.1:8080', '127.0.0.1:',
                 '127.0.0.1:8080:80', '127.0.0.1:123456', '127.0.0.1@evil.example', '[::1', '::1'):
        assert status(access, host=host) == 400, host
    for origin in ('http://evil.example', 'null', 'http://127.0.0.1:8081', 'http://127.0.0.1', 'http://localhost:8080',
                   'ws://127.0.0.1:8080'):
        assert status(access, origin=origin) == status(access, origin=origin, changes_state=True) == 403, origin
    assert status(access, changes_state=True) == 403  # a web socket says where it is from
    for cookie in ('', 'a', f'{access.cookie(GOOD.host)}=', f'{access.cookie(GOOD.host)}=\udcff',
                   'other=' + access.tokens['operator'], 'x' * 100_000):
        assert status(access, cookie=cookie) == 401, cookie[:50]
    assert status(access, cookie='', token=access.tokens['monitor']) == 200
    assert status(access, cookie='', token=access.tokens['monitor'], path='/history') == 401
    assert status(access, token='wrong') == 401


@pytest.mark.parametrize('address', ('127.0.0.1', '192.0.2.1', '0.0.0.0'))
def test_a_name_of_the_server_is_served_through_a_proxy_and_another_name_is_not(address):
    access = Access(address, 8080, ('antenna.example', '2001:db8::7'))
    for host in ('antenna.example', 'Antenna.Example:443', 'antenna.example:8443', '[2001:db8::7]:8443'):
        for origin in (f'http://{host}', f'https://{host}'):
            assert status(access, host=host, origin=origin, changes_state=True) == 200, origin
            assert status(access, host=host, origin=origin, changes_state=True, cookie='') == 401
        for origin in ('https://evil.example', f'https://{host}.evil.example', 'https://antenna.example:1'):
            assert status(access, host=host, origin=origin, changes_state=True) == 403, origin
    for host in ('evil.example', 'antenna.example.evil.example', 'x.antenna.example', 'antenna.example:x'):
        assert status(access, host=host, origin=f'https://{host}', changes_state=True) == 400, host


def test_a_refusal_names_the_address_and_the_parameter(access):
    with pytest.raises(Refused, match='evil.example.*http://127.0.0.1:8080/.*`names`'):
        access.role(GOOD._replace(host='evil.example'))
    with pytest.raises(Refused) as refused:
        access.role(GOOD._replace(host='x\n\x1b' * 1000))
    assert refused.value.reason.isprintable() and len(refused.value.reason) < 400
    for name in ('https://antenna.example', 'antenna.example:8080', 'a b', 'fade:80'):
        with pytest.raises(ValueError, match=f'names: {name}: must be names of hosts'):
            Access('127.0.0.1', 8080, (name,))


def test_each_server_and_role_has_a_token_of_its_own(access):
    tokens = [*access.tokens.values(), *Access('127.0.0.1', 8080).tokens.values()]
    assert len(set(tokens)) == 6 and min(map(len, tokens)) >= 32
    assert [access.role(GOOD._replace(token=access.tokens[role])) for role in page_security.PAGE_ROLES] == [
        *page_security.PAGE_ROLES]
    assert len({access.cookie(host) for host in ('localhost', 'localhost:1', '[::1]:2')}) == 3  # ports share cookies
    with pytest.raises(Refused):
        Access('192.0.2.1', 8080).role(GOOD)                                    # not served as 127.0.0.1


def test_roles():
    assert page_security.refusal_reason('monitor', 'stop', {}) == ''
    assert page_security.refusal_reason('monitor', 'standby', {}) and page_security.refusal_reason('monitor', 'rate',
                                                                                                   {})
    assert page_security.refusal_reason('operator', 'take', {}) == page_security.refusal_reason('operator', 'stow',
                                                                                                {}) == ''
    assert page_security.refusal_reason('operator', 'take', {'role': 'supervisor'})
    assert page_security.refusal_reason('supervisor', 'take', {'role': 'supervisor'}) == ''


class Desk:
    """Asks with an antenna behind it that grants, refuses, or is silent. asked: [(who, verb, arguments)]."""

    class Client:
        role = 'operator'

        def __str__(self):
            return 'anna@page'

    def __init__(self, *grants):
        self.requests, self.asked, self.told = Requests('test'), [], []
        self.grants, self.mode, self.client = list(grants), 'rate', self.Client()
        self.asks = PageRequests(self._ask, self.requests.replied, lambda client, message: self.told.append(message),
                                 lambda: self.mode == 'rate')

    def _ask(self, who, verb, arguments):
        command = self.requests.add(verb, who, arguments)
        self.asked.append((who, verb, dict(arguments)))
        granted = self.grants.pop(0) if self.grants else True
        if granted is not None:
            self.requests.take(command, Reply(granted, 'so it is'))
        return command.number

    def take(self, message, now, age=0.0):
        self.asks.take((self.client, message, age), now)
        self.asks.look(now)


def test_a_jog_ends_in_silence_too_late_and_with_its_page():
    for end in (lambda desk: desk.asks.look(10.0 + JOG_TIMEOUT_S + 0.01), lambda desk: desk.take(None, 10.1),
                lambda desk: desk.take({'jog': [1.0, 0]}, 10.1, MAX_STATE_AGE_S + 0.01),
                lambda desk: desk.take({'jog': [0, 0]}, 10.1)):
        desk = Desk()
        desk.take({'jog': [1.0, -2.0]}, 10.0)
        assert desk.asked == [('anna@page', 'rate', {'azimuth': math.radians(1.0), 'elevation': math.radians(-2.0)})]
        desk.asks.look(10.0 + 0.9 * JOG_TIMEOUT_S)
        assert len(desk.asked) == 1
        end(desk)
        assert desk.asked[1:] == [('anna@page', 'rate', {'azimuth': 0.0, 'elevation': 0.0})]
        desk.asks.look(20.0)
        assert len(desk.asked) == 2


def test_the_end_of_a_jog_disturbs_no_other_mode():
    desk = Desk()
    desk.take({'jog': [1.0, 0.0]}, 10.0)
    desk.mode = 'stow'
    desk.asks.look(11.0)
    assert len(desk.asked) == 1


def test_a_stop_that_is_refused_or_not_answered_becomes_standby():
    for grant, later in ((False, 0.0), (None, PAGE_REPLY_TIMEOUT_S + 0.1)):
        desk = Desk(grant, True)
        desk.take({'ask': 'stop', 'id': 1}, 10.0)
        desk.asks.look(10.0 + later)
        desk.asks.look(10.0 + later)
        assert [verb for _, verb, _ in desk.asked] == ['stop', 'standby']
        assert [told['granted'] for told in desk.told] == [False, True]


def test_the_log_says_a_jog_once_and_what_changes():
    log = page_log.Log()
    for t in np.arange(10.0, 14.0, 0.2):
        log.replied(t, Command('rate', 'anna'), Reply(True, 'mode is rate'))
    log.replied(14.0, Command('stow', 'anna'), Reply(False, 'refused: no'))
    for text in ('enabled', 'enabled', 'emergency stop'):
        log.text(15.0, 'adu/state', text)
    log.alarms(16.0, [{'name': 'drive silent', 'state': 'unacknowledged'}])
    log.alarms(17.0, [])
    assert [(line['text'], line['bad']) for line in log.lines] == [
        ('rate: mode is rate', False), ('stow: refused: no', True), ('enabled', False), ('emergency stop', True),
        ('drive silent: unacknowledged', True), ('drive silent: normal', False)]


def test_what_is_no_number_is_null():
    assert page_server.encoded({'a': math.nan, 'b': [math.inf, 1.5], 'c': (None, 'x')}) == (
        '{"a":null,"b":[null,1.5],"c":[null,"x"]}')


def test_the_sky_of_a_deck_is_that_of_the_earth():
    """A level deck that points east sees north to port; one that lies on its side sees its mast at the horizon."""
    deck = page_sky.Deck(line_of_sight.quaternion(0.0, 0.0, 0.0))
    azimuth, elevation = deck.seen(-90.0, 20.0)
    assert (azimuth + 180.0) % 360.0 - 180.0 == pytest.approx(0.0, abs=1e-3) and elevation == pytest.approx(20.0)
    assert page_sky.Deck(line_of_sight.quaternion(math.pi / 2, 0.0, 0.0)).seen(0.0, 90.0)[1] == pytest.approx(0.0)
    assert page_sky.Deck(None).seen(400.0, 20.0) == [400.0, 20.0]
    assert np.ptp([azimuth for azimuth, _ in page_sky.Deck(None).sector(10.0, 50.0, 30.0)]) == pytest.approx(40.0)


def test_a_pass_of_a_program_track():
    points = []
    for time, azimuth, elevation in ((0, 3.0, -0.1), (10, 3.2, 0.5), (20, 3.4, 0.8), (30, 3.6, -0.2)):
        point = messages.trajectory_point(2)
        point.positions[:] = azimuth, elevation
        point.time_from_start = messages.Duration(sec=time, nanosec=0)
        points.append(point)
    path = page_sky.path(messages.program_track(points), 1000.0)
    [found] = page_sky.passage(path, '1.5')
    assert (found['aos'], found['los'], found['loss']) == (1010.0, 1020.0, '1.5')
    assert found['highest'] == pytest.approx(math.degrees(0.8), abs=0.1)
    assert found['travel'] == pytest.approx(math.degrees(0.2), abs=0.1)
    assert page_sky.path(messages.program_track(points[:1]), 0.0) is None and page_sky.passage(None, '') == []


def test_the_past_of_the_beam_is_where_it_moved():
    past = page_sky.BeamHistory(600.0)
    for t in range(100):
        past.add(float(t), [0.2 * t, 20.0])
    past.add(100.0, [math.nan, math.nan])
    assert len(past.places) == 50 and past.places[0] == [0.0, 20.0]
    past.add(698.0, [20.0, 30.0])
    assert past.places == [[0.2 * 98, 20.0], [20.0, 30.0]]


class Station:
    """An antenna ashore with the elements of the ISS, at a time [s UTC]."""
    LINES = {'line_1': '1 25544U 98067A   19343.69339541  .00001764  00000-0  38792-4 0  9991',
             'line_2': '2 25544  51.6439 211.2001 0007417  17.6667  85.6398 15.50103472202482'}
    DIAGNOSTICS = {'acu': LINES, 'tracking_receiver': {}}
    PLACE = dict(zip((f'prediction.station.{name}' for name in STATION_NAMES), (47.4, 8.5, 500.0)))

    def __init__(self, now, diagnostics=DIAGNOSTICS, **configuration):
        self.now, self._diagnostics, self.configuration = now, diagnostics, {**self.PLACE, **configuration}

    def diagnostics_of(self, node):
        return self._diagnostics[node]


SKYFIELD = 1575909336.7, 1575909988.3, 1575915162.3, 1575915710.2
"""Rises and sets [s UTC] of the next two passes above 10 deg after 2019-12-09T16:30, by skyfield's find_events with
UT1 = UTC."""


def coming(antenna):
    """Return the result of page_passes.UpcomingPasses after its search."""
    looked = page_passes.UpcomingPasses()
    deadline = monotonic() + 60.0
    while not looked.look(antenna) and monotonic() < deadline:
        sleep(0.01)
    looked.close()
    return looked.look(antenna)


def test_the_next_passes_are_those_of_skyfield_in_the_time_of_the_graph():
    """By the elements of the control unit, and in a simulation of another day also by those of the satellite."""
    begin = 1575909000.0
    simulated = {f'target.leo_pass.{name}': line for name, line in Station.LINES.items()} | {'target.kind': 'leo_pass'}
    day, start = {'graph.start': 2 * 10**18}, '2019-12-09T16:30:00Z'
    for antenna in (Station(begin), Station(2e9 + 10.0, **day, **{'prediction.start_time': start}),
                    Station(2e9 + 10.0, {'acu': {}, 'tracking_receiver': {'stamp_0_utc': start}}, **day, **simulated)):
        found, ahead = coming(antenna), 2e9 - begin if antenna.now > 2e9 else 0.0
        times = [each[name] for each in found[:2] for name in ('aos', 'los')]
        assert times == pytest.approx([t + ahead for t in SKYFIELD], abs=0.5)
        assert len(found) == page_passes.MAX_PASSES and all(each['highest'] >= 10.0 for each in found)


@pytest.mark.parametrize(('changes', 'text'), (
    ({}, '47.40 N 8.50 E, 500 m: the default'),
    ({'prediction.station.latitude_deg': -33.9}, '33.90 S 8.50 E, 500 m'),
    ({'prediction.station.height': math.nan}, 'not given')))
def test_the_sky_names_the_position_of_the_antenna(changes, text):
    antenna = Station(1575909000.0, {'acu': {}}, **changes)
    antenna.present, antenna.path, antenna.pointing_model = lambda topic: False, None, None
    assert page_state.sky(antenna, ())['station'] == text
    assert (page_passes.pass_query(Station(1575909000.0, **changes)) is None) == (text == 'not given')
    antenna.configuration.clear()       # the control unit has not yet answered
    assert page_state.sky(antenna, ())['station'] == ''


def test_without_elements_station_or_utc_no_pass_is_looked_for():
    assert page_passes.pass_query(Station(1575909000.0, {'acu': {}})) is None
    assert page_passes.pass_query(Station(100.0)) is None
    antenna = Station(1575909000.0)
    del antenna.configuration['prediction.station.height']
    assert page_passes.pass_query(antenna) is None
    old = page_passes.pass_query(Station(1575909000.0 + 40.0 * 86400.0))
    # elements of 40 days ago
    assert page_passes.upcoming_passes(old) == []


def test_the_night_of_a_station_is_taken_only_in_its_form():
    row = {'case': 'ISS/1', 'begin': 1.0, 'end': 2, 'max_elevation_deg': 30.5, 'state': 'queued', 'text': ''}
    text = json.dumps({'now': 'waits', 'passes': [row]})
    assert page_state.night(text) == {'now': 'waits', 'passes': [
        {'case': 'ISS/1', 'begin': 1.0, 'end': 2.0, 'highest': 30.5, 'state': 'queued', 'text': ''}]}
    assert page_state.night('{"now": "", "passes": []}') == {'now': '', 'passes': []}
    for wrong in ('', '[]', 'null', '{"now": ""}', '[' * 100_000, text.replace('queued', 'eaten'),
                  text.replace('1.0', '"x"'), text.replace('30.5', 'null'), text.replace('"state"', '"stat"')):
        assert page_state.night(wrong) is None, wrong[:40]
