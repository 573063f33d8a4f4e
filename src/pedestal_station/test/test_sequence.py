"""The sequence of a night, step by step: every branch of the state machine, without ROS and without a clock."""
import json

import numpy as np
import pytest

from pedestal_common.geometry.geodesy import StationParameters
from pedestal_common.geometry.orbit import TargetError
from pedestal_common.wire.commands import Command, Reply
from pedestal_station.outputs.file import MAX_PASSES, Contact, epoch_of, orbit_of, utc_text
from pedestal_station.station import progress, requests, sequence
from pedestal_station.station.sequence import Aim, Fresh, Inputs, Rules
from tracking_receiver_sim.params import LeoPassParameters

DEFAULT = LeoPassParameters()
ISS = {'line_1': DEFAULT.line_1, 'line_2': DEFAULT.line_2}
ZERO = epoch_of(ISS) + 43200.0      # UTC of second 0 of these tests
ANTENNA = requests.Antenna(StationParameters(), (-270.0, 270.0), 14.0)
RULES = Rules(lead=120.0, gap=600.0, park='')


def contact(case, begin, end, taken=True, elements=ISS, track=()):
    return Contact(case, case.partition('/')[0], '25544', elements, track, ZERO + begin, ZERO + end, 10.0,
                   20.0, 50.0, taken, '' if taken else 'lost to B/1')


class Night:
    """A night under test. Its control unit grants every command, unless a step gives another reply."""

    def __init__(self, *contacts, now=0.0, rules=RULES):
        self.state = sequence.PassSequence(contacts, rules, ANTENNA, ZERO + now)
        self.given = {'present': True, 'mode': 'standby', 'elements': ISS}
        self.lines, self.commands, self.records = [], [], []

    def step(self, now, reply=None, once=None, **given):
        """Make a step at a second; given: inputs that stay; once: inputs of this step."""
        self.given |= given
        if self.state.pending and reply is None:
            reply = Reply(True, f'mode is {self.state.pending.verb}')
        if reply and reply.granted:
            self.given['mode'] = self.state.pending.verb
        result = self.state.step(Inputs(ZERO + now, reply=reply, **{**self.given, **(once or {})}))
        self.lines += result.lines
        self.records += result.records
        self.commands += [self.state.pending.verb] if self.state.pending else []
        return result

    def until(self, end, begin, **given):
        """Make a step every second."""
        for now in range(begin, end + 1):
            result = self.step(now, **given)
        return result

    def ask(self, now, verb, **arguments):
        """The reply to a command of anna."""
        [(_, reply)] = self.step(now, once={'commands': [Command(verb, 'anna', '1', arguments)]}).replies
        return reply

    @property
    def states(self):
        return {entry.contact.case: entry.state for entry in self.state.entries}

    def text(self, case):
        return next(entry.text for entry in self.state.entries if entry.contact.case == case)


def test_a_night_of_two_passes_from_the_park_to_the_stow():
    night = Night(contact('A/1', 1000, 1060), contact('B/1', 1100, 1160))
    night.until(10, 0)
    assert night.commands == ['stow'] and night.state.now.startswith('next: A/1 at ')
    night.step(880.5)
    assert night.states == {'A/1': 'running', 'B/1': 'queued'} and night.commands == ['stow', 'preset']
    night.until(994, 881)
    assert night.commands[2:] == [] and night.records == [('begin', 'A/1')]
    assert night.state.now.startswith('points to A/1, begin ')
    night.until(1000, 995)
    assert night.commands[2:] == ['tle'] and night.state.now.startswith('acquires A/1 until ')
    night.until(1060, 1001, mode='autotrack', tracking=True)
    assert night.states == {'A/1': 'done', 'B/1': 'running'} and night.records[1:] == [('end', 'A/1')]
    assert night.text('A/1') == 'on the target for 60 of 60 s'
    night.until(1160, 1061, tracking=True)
    assert night.commands[3:] == ['preset', 'tle', 'stow'] and night.records[2:] == [('begin', 'B/1'), ('end', 'B/1')]
    night.step(1165)
    assert not night.state.over
    night.step(1170, progress='stowed')
    assert night.state.over and night.lines[-1] == 'stowed'
    assert night.state.now == 'over' and set(night.states.values()) == {'done'}
    assert night.ask(1171, 'insert', case='A/1').text == 'refused: the night is over' and night.commands[6:] == []


def test_an_antenna_with_a_park_waits_there_and_one_that_waits_briefly_stays():
    night = Night(contact('A/1', 1000, 1060), rules=RULES._replace(park='zenith'))
    assert night.step(0) and night.state.pending == Aim('preset', {'point': 'zenith'})
    night = Night(contact('A/1', 500, 560))
    night.until(379, 0)
    assert night.commands == []


def test_a_pass_without_a_signal_fails_and_the_next_one_runs():
    night = Night(contact('A/1', 200, 260), contact('B/1', 270, 330))
    night.until(330, 0)
    assert night.states == {'A/1': 'failed', 'B/1': 'failed'} and night.text('A/1') == 'no signal'


def test_a_refused_mode_is_commanded_again_to_the_end_and_said_once():
    night = Night(contact('A/1', 200, 260))
    refused = Reply(False, 'refused: outside limits; mode is preset')
    for now in range(190, 262):
        night.step(now, reply=refused if night.state.pending and night.state.pending.verb == 'tle' else None)
    assert night.commands.count('tle') > 20 and night.lines.count(f'tle: {refused.text}') == 1
    assert night.states == {'A/1': 'failed'} and night.text('A/1') == refused.text


def test_a_mode_that_ends_by_itself_is_commanded_again():
    night = Night(contact('A/1', 200, 260))
    night.until(210, 190)
    before = len(night.commands)
    night.step(211, mode='standby', progress='standby')
    assert night.commands[before:] == ['tle']
    assert 'the mode is standby: tle is commanded again' in night.lines
    night.until(220, 212)
    night.step(221, elements={})      # a control unit that was started again lacks the elements
    assert night.commands[before:] == ['tle', 'tle']


def test_an_alarm_ends_a_pass_and_one_that_clears_does_not():
    night = Night(contact('A/1', 200, 260))
    night.until(210, 190)
    night.until(214, 211, alarm='diverged')
    night.until(220, 215, alarm='')
    assert night.states == {'A/1': 'running'}
    night.until(227, 221, alarm='drive: emergency stop')
    assert night.text('A/1') == 'alarm: drive: emergency stop; on the target for 0 of 60 s'
    assert night.records == [('begin', 'A/1'), ('end', 'A/1')]


def test_stow_pins_go_out_before_the_antenna_moves():
    night = Night(contact('A/1', 200, 260))
    night.step(190)
    night.step(191, reply=Reply(False, 'refused: stow pins not out; mode is stow'))
    assert night.commands == ['preset', 'unstow']
    night.until(194, 192)
    assert night.commands == ['preset', 'unstow', 'preset']


def test_who_has_control_keeps_it_and_the_station_goes_on_when_it_is_free():
    night = Night(contact('A/1', 200, 260), contact('B/1', 500, 540), contact('C/1', 600, 640))
    night.until(205, 190, tracking=True)
    before = len(night.commands)
    night.until(230, 206, holder='bert', mode='stop', tracking=False)
    assert night.commands[before:] == [] and night.state.now == 'waits: control is with bert' and not night.state.held
    night.step(231, holder='')
    assert night.commands[before:] == ['tle'] and night.lines[-1] == 'goes on'
    night.until(260, 232)
    assert night.states['A/1'] == 'done'
    night.until(560, 261, holder='bert')
    assert night.states['B/1'] == 'skipped' and night.text('B/1') == 'its time went by: control is with bert'
    night.until(640, 561, holder='', tracking=True)
    assert night.states['C/1'] == 'done'


def test_a_pass_under_control_of_another_to_its_end_has_failed():
    night = Night(contact('A/1', 200, 260))
    night.until(190, 180)
    night.until(261, 191, holder='bert')
    assert night.text('A/1') == 'control is with bert'


def test_a_mode_of_another_client_holds_the_station_until_resume():
    night = Night(contact('A/1', 200, 260))
    night.until(205, 190)
    night.step(206, mode='stop', once={'interference': 'bert commanded stop'})
    before = len(night.commands)
    night.until(220, 207)
    assert night.commands[before:] == [] and night.state.now == 'holds until `resume`: bert commanded stop'
    assert night.ask(221, 'hold').text == 'refused: the station holds already: bert commanded stop'
    assert night.ask(222, 'resume') == Reply(True, 'the station goes on') and night.commands[before:] == ['tle']
    assert not night.ask(223, 'resume').granted
    assert night.ask(224, 'hold', reason='rain').granted and night.state.held == 'anna: rain'


def test_a_silent_control_unit_is_awaited():
    night = Night(contact('A/1', 200, 260))
    night.step(190, present=False)
    assert night.state.pending is None and night.lines == ['waits: the control unit is silent']
    night.step(191, present=True)
    assert night.commands[-1] == 'preset'


def test_an_operator_skips_the_pass_under_way_the_next_or_a_named_one():
    night = Night(contact('A/1', 200, 260), contact('B/1', 300, 360), contact('C/1', 400, 460))
    night.until(195, 190)
    assert night.ask(196, 'skip').text == 'A/1 is skipped' and night.records[-1] == ('end', 'A/1')
    assert night.ask(197, 'skip', case='C/1').granted and night.states['C/1'] == 'skipped'
    assert night.ask(198, 'skip', case='C/1').text == 'refused: case = C/1: is skipped'
    assert night.ask(199, 'skip', case='D/1').text == 'refused: case = D/1: must be one of A/1, B/1, C/1'
    assert night.ask(200, 'skip').text == 'B/1 is skipped'
    assert "unknown command 'jump'" in night.ask(200, 'jump').text
    assert night.ask(201, 'skip').text == 'refused: no pass is queued' and night.text('B/1') == 'by anna'


def test_a_dropped_pass_is_inserted_and_takes_the_time_of_others():
    night = Night(contact('A/1', 200, 260), contact('B/1', 250, 300, taken=False), contact('C/1', 290, 330))
    assert night.states['B/1'] == 'dropped' and night.text('B/1') == 'lost to B/1'
    assert night.ask(10, 'insert', case='B/1').text == 'B/1 is queued'
    assert night.states == {'A/1': 'dropped', 'B/1': 'queued', 'C/1': 'dropped'}
    assert night.text('A/1') == 'lost to B/1'
    assert night.ask(11, 'insert', case='B/1').text == 'refused: case = B/1: is queued'
    night.until(245, 130)
    assert night.ask(246, 'insert', case='C/1').text == (
        'refused: C/1 overlaps B/1, which is under way; skip that first')
    assert night.ask(400, 'insert', case='A/1').text.startswith('refused: A/1: its time was over at ')


def up(begin):
    """First second from `begin` on at which the ISS is 10 deg high for a minute."""
    times = np.arange(begin, begin + 86400.0, 10.0)
    enu = orbit_of(ISS, ANTENNA.station).enu(ZERO + times)
    high = np.degrees(np.arctan2(enu[:, 2], np.hypot(enu[:, 0], enu[:, 1]))) > 10.0
    return int(times[np.flatnonzero(high[:-6] & high[6:])[0]])


def test_a_pass_of_other_elements_is_inserted_at_a_turn_within_the_travel():
    now = up(1000)
    night = Night(contact('A/1', 200, 260))
    times = {name: utc_text(ZERO + when) for name, when in (('begin', now), ('end', now + 60))}
    assert night.ask(10, 'insert', **ISS, **times, name='STATION').text == 'STATION/1 is queued'
    entry = night.state.entries[-1]
    assert entry.inserted and entry.contact.number == '25544' and -180.0 <= entry.contact.azimuth_deg <= 180.0
    assert night.ask(11, 'insert', **ISS, **times).text == '25544/1 is queued'      # in place of the first
    assert night.states['STATION/1'] == 'dropped'
    night.state.entries *= MAX_PASSES
    assert 'passes, must be at most 5000' in night.ask(12, 'insert', **ISS, **times).text


@pytest.mark.parametrize('arguments, reason', [
    ({}, 'must have either case, or elements'),
    ({'case': 'A/1', 'begin': '2019-12-10T00:00:00'}, 'case = A/1 and begin are given'),
    ({'line_1': 'x', 'begin': 'now', 'end': 'now'}, 'elements = line_1: must be line_1 and line_2, or omm'),
    ({**ISS, 'begin': '0001-01-01T00:00:00+23:00', 'end': 'x'}, "begin = '0001-01-01"),
    ({**ISS, 'begin': 'soon', 'end': 'x'}, "begin = 'soon': must be UTC"),
    ({**ISS, 'begin': '2019-12-10T00:00:00', 'end': '2019-12-09T00:00:00'}, 'must be after begin'),
    ({**ISS, 'line_1': 'x' * 69, 'begin': '2019-12-10T00:00:00', 'end': '2019-12-10T00:01:00'}, 'TLE line 1'),
    ({**ISS, 'begin': '2019-12-10T00:00:00', 'end': '2019-12-10T00:01:00'}, 'is below the horizon from'),
    ({**ISS, 'begin': '2019-12-10T00:00:00', 'end': '2019-12-10T00:01:00', 'name': 'x' * 101}, '1 to 100'),
    ({'colour': 'red'}, "unknown argument 'colour'")])
def test_what_cannot_be_inserted_is_refused_by_name(arguments, reason):
    with pytest.raises((ValueError, TargetError), match=reason.replace('(', r'\(')):
        requests.request(Command('insert', 'anna', '1', arguments), ANTENNA)


def test_windows_in_the_past_and_old_elements_are_refused():
    old = 15 * 86400
    night = Night(contact('A/1', -100, -40), contact('B/1', old, old + 60), contact('C/1', old + 70, old + 130))
    assert night.text('A/1').startswith('refused: its time was over at ')
    night.step(old - 10)
    assert night.states == {'A/1': 'skipped', 'B/1': 'failed', 'C/1': 'failed'} and 'must be at most 14' in night.text(
        'B/1')
    assert not night.ask(old - 9, 'insert', case='B/1').granted
    aged = Night(contact('A/1', 4 * 86400, 4 * 86400 + 60))
    assert 'above 3 days for a low satellite' in aged.text('A/1')


def test_fresher_elements_replace_those_of_queued_passes_only():
    line = ISS['line_1'].replace('19343.69339541', '19344.19339541')
    fresher = {'line_1': line[:68] + str(sum(int(c) if c.isdigit() else c == '-' for c in line[:68]) % 10),
               'line_2': ISS['line_2']}
    night = Night(contact('A/1', 100, 160), contact('B/1', 200, 260), contact('C/1', 300, 360, elements={}, track=(
        (0.0, 0.0, 0.0), (1.0, 0.0, 0.0))))
    night.step(10)
    night.step(11, once={'fresh': (Fresh('25544', fresher, 'new.tle'), Fresh('1', fresher, 'x'))})
    assert [entry.contact.elements for entry in night.state.entries] == [ISS, fresher, {}]
    assert night.lines[-1] == ('B/1: elements of new.tle, 0.0 days old at the pass, in place of 0.5')
    night.step(12, once={'fresh': (Fresh('25544', ISS, 'old.tle'),)})
    assert night.state.entries[1].contact.elements == fresher


def test_an_object_with_a_track_is_followed_by_program():
    night = Night(contact('A/1', 100, 160, elements={}, track=((0.0, 0.0, 0.0), (1.0, 0.0, 0.0))))
    night.until(99, 90)
    assert night.commands == ['preset', 'program']


def test_a_station_that_cannot_stow_ends_and_says_so():
    night = Night(contact('A/1', 100, 160))
    night.until(160, 90)
    night.until(165, 161, holder='bert')
    night.step(480)
    assert night.state.over and night.lines[-1] == 'not stowed: control is with bert'


def test_the_progress_continues_a_pass_under_way_and_keeps_what_is_over(tmp_path):
    file = progress.file_of(tmp_path / 'night.json')
    contacts = (contact('A/1', 200, 260), contact('B/1', 300, 360), contact('C/1', 500, 560),
                contact('D/1', 600, 660), contact('E/1', 700, 760, taken=False))
    night = Night(*contacts)
    night.until(310, 190, tracking=True)
    night.ask(311, 'skip', case='D/1')
    night.ask(311.5, 'insert', case='E/1')
    now = up(5000)
    assert night.ask(312, 'insert', **ISS, begin=utc_text(ZERO + now), end=utc_text(ZERO + now + 60)).granted
    progress.save(file, night.state)
    again = sequence.PassSequence(contacts, RULES, ANTENNA, ZERO + 320.0)
    progress.resume(again, file, ZERO + 320.0)
    assert {entry.contact.case: entry.state for entry in again.entries} == {
        'A/1': 'done', 'B/1': 'running', 'C/1': 'queued', 'D/1': 'skipped', 'E/1': 'queued', '25544/1': 'queued'}
    assert again.entries[1].tracked == pytest.approx(12.0, abs=1.5)
    night.state = again
    night.until(361, 321, mode='standby')
    assert night.states['B/1'] == 'done' and night.records[-2:] == [('begin', 'B/1'), ('end', 'B/1')]
    late = sequence.PassSequence(contacts, RULES, ANTENNA, ZERO + 400.0)
    progress.resume(late, file, ZERO + 400.0)
    assert late.entries[1].state == 'failed' and late.entries[1].text == 'the station was off at its end'
    file.write_text('{"pedestal_station": 1')
    with pytest.raises(ValueError, match='holds no progress of a night'):
        progress.resume(night.state, file, ZERO)


def test_the_published_night_names_each_pass():
    night = Night(contact('A/1', 200, 260))
    night.step(0)
    assert json.loads(progress.night_text(night.state)) == {
        'passes': [{'case': 'A/1', 'begin': ZERO + 200.0, 'end': ZERO + 260.0, 'max_elevation_deg': 50.0,
                    'state': 'queued', 'text': ''}], 'now': night.state.now}
