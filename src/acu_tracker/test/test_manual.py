"""Stop, manual rates and slave of the control unit on an ideal axis; who is in control."""

import numpy as np
import pytest

from acu_tracker.alarms.table import ALARM_NAMES
from acu_tracker.guidance import manual
from acu_tracker.operating.commands import Authority
from acu_tracker.params import AcuParameters
from pedestal_common.parameters import ParameterError, build
from pedestal_common.wire import messages
from pedestal_common.wire.commands import Command

T = 0.005


@pytest.fixture
def axes(Axes):
    return Axes().run(0.1)


def test_a_jog_goes_at_its_rate_and_stands_when_nobody_asks_again(axes):
    for _ in range(10):
        assert axes.ask('rate', azimuth=0.2, elevation=-0.1).granted
        axes.run(0.2)
    assert axes.mode == 'rate' and axes.rate == pytest.approx([0.2, -0.1], abs=1e-3)
    axes.run(manual.RATE_REQUEST_TIMEOUT_S - 0.2)
    assert axes.rate == pytest.approx([0.2, -0.1], abs=1e-3)
    ended = len(axes.rates)
    axes.run(1.0)
    rates = np.array(axes.rates[ended:])
    assert rates[30:] == pytest.approx(0.0, abs=2e-3) and axes.mode == 'rate'
    assert rates[:, 0].min() > -0.02 and rates[:, 1].max() < 0.02                    # it does not swing back


def test_stop_brings_a_moving_antenna_to_a_stand_without_turning_back(axes):
    axes.ask('rate', azimuth=1.0)
    axes.run(0.4)
    assert axes.ask('stop').granted
    begun = len(axes.rates)
    axes.run(2.0)
    rates = np.array(axes.rates[begun:])
    assert axes.mode == 'stop' and rates[:, 0].min() > -0.05 and np.abs(rates[-100:]).max() < 1e-4
    limit = axes.unit.parameters.azimuth.limits.acceleration
    assert np.abs(np.diff(rates[:, 0])).max() <= limit * T * (1.0 + 1e-9)


def test_a_jog_ends_at_the_limit_of_the_travel(axes):
    high = axes.unit.parameters.elevation.limits.high
    for _ in range(20):
        axes.ask('rate', elevation=0.5)
        axes.run(0.2)
    assert np.array(axes.angles)[:, 1].max() < high + 1e-3 and axes.angle[1] == pytest.approx(high, abs=1e-3)


def test_slave_follows_what_is_told_and_stops_when_nothing_is(axes):
    def told(t):
        return 0.4 + 0.1 * t, 0.7 + 0.02 * t
    assert axes.ask('slave', azimuth=0.4, elevation=0.7).granted
    for _ in range(40):
        t = axes.k * T
        axes.ask('slave', azimuth=told(t)[0], elevation=told(t)[1], azimuth_rate=0.1, elevation_rate=0.02)
        axes.run(0.1)
    assert axes.mode == 'slave' and axes.angle == pytest.approx(told(axes.k * T), abs=2e-3)
    axes.run(1.2)
    assert axes.mode == 'stop' and axes.unit.diagnose().message == 'stop (no direction)'


def test_what_is_refused_changes_nothing(axes):
    axes.ask('preset', azimuth=0.5, elevation=0.9)
    axes.run(3.0)
    for verb, arguments in (('preset', {'azimuth': 11.0}), ('preset', {'point': 'nowhere'}),
                            ('rate', {'azimuth': 'x'}), ('autotrack', {}), ('offset', {'time': 'late'}),
                            ('fallback', {'mode': 'hope'})):
        reply = axes.ask(verb, **arguments)
        assert not reply.granted and 'refused' in reply.text, verb
    axes.run(1.0)
    assert axes.mode == 'preset' and axes.angle == pytest.approx([0.5, 0.9], abs=1e-4)


def test_named_points(Axes):
    axes = Axes(points='home 0.2 0.5; up 0.0 1.5').run(0.1)
    assert axes.ask('preset', point='up').granted
    axes.run(4.0)
    assert axes.angle == pytest.approx([0.0, 1.5], abs=1e-4)
    for text in ('home 1', 'home a b', 'home 0 0; home 1 1', 'home 99 0'):
        with pytest.raises(ParameterError, match='points'):
            AcuParameters(points=text)


def test_an_offset_shifts_the_program_as_it_runs(axes):
    axes.unit.followed.segments.append([-50.0, 100.0], [[0.05, 0.35], [0.8, 1.1]], 0.0, False)
    axes.unit.update_tables()
    assert axes.ask('program').granted
    axes.run(2.0)
    assert axes.angle == pytest.approx(np.array([0.3, 0.6]) + 0.005 * axes.k * T, abs=1e-4)
    assert axes.ask('offset', time=4.0, azimuth=0.01).granted
    axes.run(2.0)
    assert axes.angle == pytest.approx(np.array([0.31, 0.6]) + 0.005 * (axes.k * T - 4.0), abs=1e-4)


def test_one_holder_at_a_time(Axes):
    axes = Axes().run(0.1)
    ask = axes.unit.command
    assert ask(Command('preset', 'anna')).granted                                     # nobody is in control
    assert ask(Command('take', 'anna')).text == 'control is with anna'
    for command in (Command('preset', 'bert'), Command('take', 'bert'), Command('release', 'bert'),
                    Command('acu/preset', 'service'), Command('fallback', '', '', {'mode': 'memory'})):
        reply = ask(command)
        assert not reply.granted and reply.text == 'refused: control is held by anna'
    assert ask(Command('preset', 'anna')).granted
    assert ask(Command('stop', 'bert')).granted and ask(Command('acu/standby', 'service')).granted
    assert dict(axes.unit.diagnose().values)['control'] == 'anna'
    assert ask(Command('take', 'carl', '', {'role': 'supervisor'})).text == 'control is with carl, taken from anna'
    assert not ask(Command('preset', 'anna')).granted
    assert ask(Command('release', 'carl')).granted and ask(Command('preset', 'bert')).granted


def test_a_program_takes_the_antenna_from_a_pass_only_if_an_operator_has_allowed_it(Axes):
    axes = Axes(**{'prediction.station.latitude_deg': 39.742476, 'prediction.station.longitude_deg': -105.1786,
                   'prediction.station.height': 1830.0, 'prediction.start_time': '2003-10-17T19:30:30'}).run(0.1)
    ask, program = axes.unit.command, 'rotctld 4533 from 127.0.0.1:40000'

    def take(who=program):
        return ask(Command('take', who, '', {'role': 'program'}))

    def requester():
        return dict(axes.unit.diagnose().values)['requester']
    assert take().granted and ask(Command('preset', program)).granted and ask(Command('release', program)).granted
    assert ask(Command('sun', 'anna')).granted
    axes.run(0.1)
    again = program[:-1] + '1'                  # the next connection of the program
    reply = take(again)
    assert reply.text == 'refused: an operator must allow rotctld 4533 from 127.0.0.1: the antenna is in sun'
    assert not ask(Command('preset', again)).granted and not ask(Command('preset', program)).granted
    assert ask(Command('stop', program)).granted and ask(Command('sun', 'anna')).granted
    axes.run(0.1)
    assert not take().granted and requester() == 'rotctld 4533 from 127.0.0.1'
    assert ask(Command('allow', 'anna')).granted and requester() == '' and take().granted
    assert ask(Command('preset', program)).granted and ask(Command('release', program)).granted
    assert ask(Command('sun', 'anna')).granted  # a pass begins: allowed no longer
    axes.run(0.1)
    assert not take().granted and ask(Command('take', 'anna')).granted
    assert 'control is held by anna' in take().text
    assert not ask(Command('allow', program)).granted and not ask(Command('allow', 'bert')).granted
    assert ask(Command('allow', 'anna', '', {'client': 'rotctld 4533 from 127.0.0.1'})).granted
    assert take().text == f'control is with {program}, taken from anna'


def test_nobody_without_a_name_takes_control():
    with pytest.raises(ValueError, match='must have a name'):
        Authority().take('', 'operator', 'standby', 0)


def test_the_ramp_of_a_jog_keeps_the_shapers_acceleration(Axes):
    p = build(AcuParameters, {}).azimuth
    axes = Axes().run(0.1)
    axes.ask('rate', azimuth=0.5)
    axes.run(0.3)
    assert np.abs(np.diff(np.array(axes.rates)[:, 0])).max() / T < p.shaper.acceleration


def segment(begin, rows, azimuth, rate=0.01):
    """An acu/program_track of rows a second apart from `begin` [s] and an azimuth [rad] on."""
    points = []
    for i in range(rows):
        point = messages.trajectory_point(2)
        point.positions[:] = azimuth + rate * i, 0.6
        point.time_from_start = messages.Duration(sec=begin + i, nanosec=0)
        points.append(point)
    return messages.program_track(points)


def raised(axes):
    """Names of the alarms of the program whose condition is there."""
    names = {ALARM_NAMES[i] for i in np.flatnonzero(axes.unit.alarms['alarm']['active'])}
    return {name for name in names if name.startswith('program')}


def test_a_program_in_segments_goes_on_and_what_is_wrong_with_it_has_a_name(Axes):
    axes = Axes().run(0.1)
    axes.unit.decode('acu/program_track', segment(2, 3, 0.3))
    assert axes.ask('program').text == 'refused: before program track; mode is standby'
    assert raised(axes.run(0.1)) == {'program too early'}
    axes.run(2.0)
    assert axes.ask('program').granted and raised(axes.run(1.0)) == set()
    axes.unit.decode('acu/program_track', segment(5, 3, 0.33))                      # appended while it runs
    axes.unit.decode('acu/program_track', segment(20, 2, 0.4))
    axes.run(2.5)                                                                   # on the second segment
    assert axes.mode == 'program' and axes.angle[0] == pytest.approx(0.3 + 0.01 * (axes.k * T - 2.0), abs=1e-4)
    with pytest.raises(ValueError, match='turnaround too fast: azimuth'):
        axes.unit.decode('acu/program_track', segment(6, 3, 3.3))
    assert 'program turnaround' in raised(axes.run(0.1)) and axes.mode == 'program'
    axes.run(2.0)
    assert axes.mode == 'standby' and axes.unit.diagnose().message == 'standby (gap in the program track)'
    assert raised(axes) == {'program gap', 'program turnaround'}
    axes.run(12.5)
    assert axes.ask('program').granted                                              # the third one has begun
    axes.run(1.0)
    assert axes.unit.diagnose().message == 'standby (after program track)' and 'program ended' in raised(axes)


def test_the_own_prediction_is_another_table_with_its_offset(Axes):
    """The sun of NREL/TP-560-34302, see test_prediction."""
    axes = Axes(**{'prediction.start_time': '2003-10-17T19:30:30', 'prediction.station.latitude_deg': 39.742476,
                   'prediction.station.longitude_deg': -105.1786, 'prediction.station.height': 1830.14}).run(0.1)
    assert axes.ask('tle').text == 'refused: no elements; mode is standby'
    assert axes.ask('sun').granted
    axes.run(5.0)
    moved = np.array([194.34024 - 360.0, 39.872046])
    assert np.degrees(axes.angle) == pytest.approx(moved, abs=0.03)
    assert axes.ask('offset', elevation=0.002).granted
    axes.run(1.0)
    assert np.degrees(axes.angle[1]) == pytest.approx(moved[1] + np.degrees(0.002), abs=0.03)
    assert axes.mode == 'sun'


@pytest.mark.parametrize(('rate', 'floor'), ((-0.3, '-1 0.5; 1 0.5'), (0.3, '-1 -0.5; 0.5 -0.5; 0.6 1.2; 1 1.2')))
def test_a_jog_against_the_floor_has_no_dead_time_on_the_way_back(rate, floor, Axes):
    axis = 'elevation' if rate < 0.0 else 'azimuth'
    i, axes = int(rate < 0.0), Axes(floor=floor, **{'elevation.limits.high': 1.1, 'elevation.stow': 1.0}).run(0.1)
    for _ in range(10):
        axes.ask('rate', **{axis: rate})
        axes.run(0.2)
    assert abs(axes.rate[i]) < 1e-3
    stood = axes.angle[i]
    axes.ask('rate', **{axis: -rate})
    axes.run(0.3)
    assert (axes.angle[i] - stood) / -rate == pytest.approx(0.3, abs=0.1)
