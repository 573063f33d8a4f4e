"""A drive that trips, in the graph: the ACU falls to standby, everybody can read why, and the recording holds it. Its
alarm and those of other faults are told, acknowledged and shelved by commands."""
import numpy as np
import pytest

from acu_tracker.alarms import report, table
from acu_tracker.modes import Mode
from pedestal.console import EXIT_FAILED_RUN
from pedestal_bringup.loop import closed_loop
from pedestal_bringup.scenario import scenario
from pedestal_recording import bag as bags
from pedestal_recording.bag import load
from pedestal_recording.verify import verify

TRIP = ['adu.azimuth.faults.overspeed=1.5',
        'acu.commands=1.0 acknowledge alarm=drive_fault; 1.2 shelve alarm=drive_fault seconds=60 reason=tests; '
        '1.4 unshelve alarm=drive_fault; 1.6 reset']
"""The sine of 0.87 rad at 0.4 Hz wants 2.2 rad/s."""


@pytest.fixture(scope='module')
def tripped(start_run):
    run = start_run('servo_sine', '--duration', '2.0', '--param', TRIP[0], '--param', TRIP[1])
    result = run.finish()
    assert result.returncode == EXIT_FAILED_RUN, result.stderr
    return bags.read(run.bag)


@pytest.mark.thorough
def test_the_recording_is_complete_and_says_why(tripped):
    assert verify(load(tripped.path)).complete
    states, told = tripped.table('adu/state'), tripped.table('acu/mode')
    assert list(states['data']) == ['enabled', 'fault: azimuth overspeed']
    assert list(told['data']) == ['program', 'standby']
    assert states['t'][1] == pytest.approx(told['t'][1], abs=1e-9)             # in the very step in which it trips
    last = [message for *_, message in tripped.messages('diagnostics')][-5:]
    drive = [status for array in last for status in array.status if status.name == 'adu'][0]
    said = {pair.key: pair.value for pair in drive.values}
    assert (drive.level, drive.message) == (2, 'fault: azimuth overspeed')
    assert (said['azimuth faults'], said['elevation faults'], said['brakes']) == ('overspeed', '', 'on')


@pytest.mark.thorough
def test_it_stands(tripped):
    assert np.ptp(tripped.table('joint_states')['azimuth.position'][-200:]) < 1e-6


def lists(bag):
    """[(t, {alarm: {key: text}})] of acu/alarms."""
    return [(array.header.stamp.sec + array.header.stamp.nanosec * 1e-9,
             {status.name: {value.key: value.value for value in status.values} for status in array.status})
            for *_, array in bag.messages('acu/alarms')]


@pytest.mark.thorough
def test_the_list_is_told_whenever_it_changes_and_obeys(tripped):
    told = lists(tripped)
    assert told[0] == (0.0, {})
    fault = [(t, rows['drive fault']) for t, rows in told if 'drive fault' in rows]
    assert fault[0][1]['state'] == 'unacknowledged' and fault[0][1]['annunciated'] == '1'
    assert fault[0][1]['detail'] == 'fault: azimuth overspeed' and fault[0][1]['action']
    states = tripped.table('adu/state')
    assert fault[0][0] == pytest.approx(states['t'][1], abs=1e-9)               # in the very step in which it trips
    of = {row['state']: t for t, row in reversed(fault)}
    assert of['acknowledged'] == pytest.approx(1.0) and of['shelved'] == pytest.approx(1.2)
    assert fault[-1][1]['state'] == 'unacknowledged' and fault[-1][0] == pytest.approx(1.4)
    assert next(row for _, row in fault if row['state'] == 'shelved')['shelved_reason'] == 'tests'


@pytest.mark.thorough
def test_the_closed_loop_trips_and_tells_it_at_the_same_steps(tripped, differences):
    run = closed_loop.Loop(scenario.load('servo_sine', TRIP, duration=2.0)).run()
    assert differences(run, tripped) == {}
    assert len(run.table('acu/alarms')['t']) == len(lists(tripped))


def under_way(*faults, duration=9.0):
    """The Run of a flyby with faults in its nodes at 6 s, in autotrack, and its control unit."""
    loop = closed_loop.Loop(scenario.load('uav_flyby', list(faults), duration=duration))
    return loop.run(), loop.units['acu']


def annunciated(acu):
    return {table.ALARM_NAMES[i] for i in report.annunciated(acu.alarms)}


def raised(acu):
    """Names of the alarms that were raised."""
    return {name for name, alarm in zip(table.ALARM_NAMES, acu.alarms['alarm']) if np.isfinite(alarm['raised'])}


@pytest.mark.parametrize(('axis', 'motor'), (('azimuth', 1), ('elevation', 2)))
def test_with_one_motor_of_a_pair_it_tracks_on_and_says_so(axis, motor):
    run, acu = under_way(f'adu.inject=6 motor_loss axis={axis} motor={motor}', duration=20.0)
    assert list(run.table('adu/state')['data']) == ['enabled', f'enabled: {axis} motor lost']
    assert run['acu/mode'][-1] == Mode.AUTOTRACK
    assert np.hypot(*run.truth['error'][run.t > 7.0].T).max() < 0.25 * 0.0175           # a quarter of the beamwidth
    assert annunciated(acu) == {f'{axis} motor lost'}


@pytest.mark.parametrize(('fault', 'first', 'others'), (
    ('encoder_jump axis=azimuth size=0.02', 'azimuth encoder jump', {'drive fault'}),
    ('encoder_stuck axis=azimuth', 'azimuth encoder stuck', {'drive fault'}),
    ('brake_stuck axis=azimuth state=on', 'azimuth brake not released', set()),
    ('bias axis=azimuth size=0.05', 'azimuth encoder disagreement', set())))
def test_a_fault_is_told_with_its_consequences_under_it(fault, first, others):
    _, acu = under_way(f'adu.inject=6 {fault}')
    assert first in annunciated(acu) and raised(acu) >= {first, *others} and not annunciated(acu) & others


@pytest.mark.parametrize(('fault', 'expected'), (('nan', 'signal lost'), ('freeze', 'receiver silent')))
def test_a_receiver_without_numbers_or_with_the_same_again_is_told(fault, expected):
    _, acu = under_way(f'tracking_receiver.inject=6 {fault}')
    assert expected in annunciated(acu)


TO_270_DEG = ['acu.initial_mode=preset', 'acu.azimuth.preset=4.71238898', 'adu.initial_azimuth=3.5',
              'adu.initial_elevation=0.7']
"""A preset at the end of the travel, reached after 0.6 s."""

NOT_RELEASED = {'azimuth brake not released', 'elevation brake not released'}


@pytest.mark.parametrize('gust', (
    '4 gust torque=3000 duration=2', '4 gust torque=-3500 duration=2', '0 gust torque=-4000 duration=5',
    '4 gust axis=elevation torque=3500 duration=2'))
def test_a_gust_that_the_motors_hold_is_no_brake(gust):
    """Gusts on an axis that holds its place, and against a slew."""
    loop = closed_loop.Loop(scenario.load('leo_pass', [*TO_270_DEG, f'adu.inject={gust}'], duration=7.0))
    run = loop.run()
    assert np.abs(run['joint_states']['effort']).max() > 3400.0 and run['acu/mode'][-1] == Mode.PRESET
    assert not raised(loop.units['acu']) & NOT_RELEASED


@pytest.mark.parametrize('inject', ('6 gust torque=4000 duration=3', '6 gust torque=-4000 duration=3'))
def test_a_gust_while_the_target_is_followed_is_no_brake(inject):
    run, acu = under_way(f'adu.inject={inject}', duration=12.0)
    assert run['acu/mode'][-1] == Mode.AUTOTRACK and not raised(acu) & NOT_RELEASED


@pytest.mark.parametrize('onset', (0.0, 0.3))
def test_brakes_that_drag_on_a_slew_are_told(onset):
    loop = closed_loop.Loop(scenario.load('leo_pass', [
        *TO_270_DEG, f'adu.inject={onset} brake_stuck axis=azimuth state=on'], duration=1.3))
    loop.run()
    assert 'azimuth brake not released' in raised(loop.units['acu'])


DRAG = ['acu.initial_mode=preset', 'acu.azimuth.preset=4.0', 'adu.initial_azimuth=0.0', 'adu.initial_elevation=0.7',
        'acu.azimuth.shaper.rate=0.1']


@pytest.mark.parametrize(('brake', 'expected'), ((28.6, True), (18.7, False)))
def test_brakes_that_drag_with_61_times_the_friction_are_told(brake, expected):
    """The brakes of both motors hold 128 Nm of load torque per Nm: 61 and 40 times the friction of 60 Nm."""
    loop = closed_loop.Loop(scenario.load('leo_pass', [
        *DRAG, *(f'adu.azimuth.motor_{i}.brake={brake}' for i in (1, 2)),
        'adu.inject=1 brake_stuck axis=azimuth state=on'], duration=13.0))
    loop.run()
    assert ('azimuth brake not released' in raised(loop.units['acu'])) == expected


@pytest.mark.parametrize(('name', 'rate'), (('leo_pass', 0.002), ('station_real', 0.002), ('station_real', 0.1)))
def test_an_axis_that_loses_its_commands_on_a_ramp_is_told(name, rate):
    loop = closed_loop.Loop(scenario.load(name, [*DRAG[:-1], f'acu.azimuth.shaper.rate={rate}',
                                                 'adu.inject=3 drop duration=5'], duration=8.0))
    loop.run()
    assert raised(loop.units['acu']) == {'azimuth following error'}


def runaways(run):
    alarms = run.units['acu'].parts['state']['supervision']['alarms']['alarm']
    return {name: float(alarm['raised']) for name, alarm in zip(table.ALARM_NAMES, alarms)
            if 'runaway' in name and np.isfinite(alarm['raised'])}


def slewing(scenario_name, axis, rate, seed, duration, *overrides):
    """Closed loop of a scenario whose axis moves at a rate [rad/s] by commands from 0.5 s on."""
    commands = '; '.join(f'{at} rate {axis}={rate}' for at in np.arange(0.5, duration, 0.5))
    return closed_loop.Loop(scenario.load(scenario_name, [
        'acu.initial_mode=standby', f'acu.commands={commands}', 'adu.initial_azimuth=-1', 'adu.initial_elevation=0.1',
        *overrides], seed=seed, duration=duration))


DROPS = [('uav_flyby', 'azimuth', 0.5), ('uav_flyby', 'azimuth', -1.0), ('ship_terminal_1m2', 'elevation', 0.3)]


@pytest.mark.parametrize('name, axis, rate', DROPS)
def test_a_drive_that_stops_without_commands_overshoots_and_is_no_runaway(name, axis, rate):
    run = slewing(name, axis, rate, 1, 2.0, 'adu.inject=1.2 drop duration=0.6').run()
    velocity = run['joint_states']['velocity'][:, 0 if axis == 'azimuth' else 1]
    assert (np.sign(rate) * velocity[240:]).min() < -0.05 and runaways(run) == {}


@pytest.mark.thorough
@pytest.mark.parametrize('name', ['uav_flyby', 'uav_tracker_3m', 'ship_terminal_1m2'])
def test_no_stop_without_commands_is_a_runaway(name):
    for seed in range(1, 7):
        for axis, rates in (('azimuth', (0.3, -0.5, 0.7, -1.0)), ('elevation', (0.3, 0.5, 0.85))):
            for rate in rates:
                begin = 1.2 + 0.0137 * seed
                run = slewing(name, axis, rate, seed, 2.0, f'adu.inject={begin} drop duration=0.5').run()
                assert runaways(run) == {}, (seed, axis, rate)


@pytest.mark.parametrize('rate, steps', [(0.1, 2), (0.5, 6), (-1.0, 9)])
def test_a_motor_that_turns_the_wrong_way_is_told_at_once(rate, steps):
    """The torque constants of both motors change their sign while the axis moves."""
    loop = slewing('uav_flyby', 'azimuth', rate, 1, 2.5)

    def reverse(made):
        if made == 400:
            for motor in ('motor_1', 'motor_2'):
                loop.units['adu'].parts['constants']['azimuth'][motor]['K_t'] *= -1.0
        return 400 - made if made < 400 else 1000
    told = runaways(loop.run(watch=reverse))
    assert 0.0 < told['azimuth runaway'] - 2.0 <= steps * 0.005 + 1e-9
