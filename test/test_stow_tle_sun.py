"""A pass by the antenna's own prediction, the sun, stow and unstow with pins: one run of the graph in lockstep, its
closed loop, its recomputation; what happens without them."""
import math

import numpy as np
import pytest

from acu_tracker import modes
from acu_tracker.alarms.table import ALARM_NAMES
from pedestal.console import EXIT_FAILED_RUN
from pedestal_bringup.loop import closed_loop
from pedestal_bringup.scenario import scenario
from pedestal_common.wire import commands, messages
from pedestal_common.wire.commands import Command
from pedestal_recording import bag as bags

START = '2019-12-10T14:15:25'
"""At the culmination of a pass of 38 deg, with the sun above the horizon."""

LINES = tuple(line.replace(' ', '_') for line in (
    '1 25544U 98067A   19343.69339541  .00001764  00000-0  38792-4 0  9991',
    '2 25544  51.6439 211.2001 0007417  17.6667  85.6398 15.50103472202482'))

SECONDS = 17.0
COMMANDS = (f'0.5 tle; 1 tle line_1={LINES[0]} line_2={LINES[1]}; 4 sun; 7 stow; 12 preset; 13 unstow; 14 preset '
            'azimuth=0.1')
PINS = ('adu.stow_pins=true', 'adu.pins.travel_time=0.5', 'adu.pins.timeout=1')
GIVEN = ('scenario.program.source=none', f'tracking_receiver.target.leo_pass.start_time={START}',
         f'acu.prediction.start_time={START}', 'acu.initial_mode=standby', 'acu.tracker.lock_count=20',
         f'acu.commands={COMMANDS}', *PINS)


def replies(path):
    """[(step [s], Command, Reply)] of a recording."""
    return [(log / 1e9, *commands.of_reply(messages.deserialize(data, 'diagnostic_msgs/msg/DiagnosticStatus')))
            for _, log, _, data in bags.read(path).raw('acu/command_result')]


@pytest.fixture(scope='module')
def recorded(start_run):
    run = start_run('leo_pass', '--duration', str(SECONDS), *(word for text in GIVEN for word in ('--param', text)))
    result = run.finish()
    assert result.returncode == EXIT_FAILED_RUN, result.stderr
    return run.bag


@pytest.mark.thorough
def test_what_is_asked_is_granted_or_says_why_not(recorded):
    told = [(at, command.verb, reply.granted, reply.text) for at, command, reply in replies(recorded)]
    assert told == [
        (0.5, 'tle', False, 'refused: no elements; mode is standby'), (1.0, 'tle', True, 'mode is tle'),
        (4.0, 'sun', True, 'mode is sun'), (7.0, 'stow', True, 'mode is stow'),
        (12.0, 'preset', False, 'refused: stow pins not out; mode is stow'), (13.0, 'unstow', True, 'mode is unstow'),
        (14.0, 'preset', True, 'mode is preset')]
    table = bags.read(recorded).table('acu/mode')
    assert table['data'] == ['standby', 'tle', 'autotrack', 'sun', 'stow', 'unstow', 'standby', 'preset']


@pytest.mark.thorough
def test_it_tracks_what_it_predicted(recorded):
    """By the elements the receiver has within a second what it needs to track; the sun stands where it did."""
    modes_told = bags.read(recorded).table('acu/mode')
    assert modes_told['t'][2] - modes_told['t'][1] < 2.0
    table = bags.read(recorded).table('joint_states')
    at = np.searchsorted(table['t'], 6.99)
    # 47.4 N, 8.5 E: two hours and 50 minutes after the local noon of 11:18 UTC, at a declination of -22.9 deg.
    assert math.degrees(table['azimuth.position'][at]) % 360.0 == pytest.approx(220.6, abs=0.3)
    assert math.degrees(table['elevation.position'][at]) == pytest.approx(9.2, abs=0.3)


@pytest.mark.thorough
def test_the_pins_go_in_once_it_stands_and_out_before_it_moves(recorded):
    bag = bags.read(recorded)
    pins, asked, states = bag.table('adu/stow_pins'), bag.table('acu/stow_pins'), bag.table('adu/state')
    assert pins['data'] == ['azimuth out, elevation out', 'azimuth moving, elevation moving',
                            'azimuth in, elevation in', 'azimuth moving, elevation moving',
                            'azimuth out, elevation out']
    assert asked['data'] == ['in', 'out'] and asked['t'][1] == 13.0
    assert [state for state in states['data'] if state == 'disabled'] == ['disabled']
    table = bag.table('joint_states')
    held = (table['t'] >= pins['t'][1]) & (table['t'] < pins['t'][4])
    assert np.ptp(table['azimuth.position'][held]) < 1e-4 and np.ptp(table['elevation.position'][held]) < 1e-4
    command = bag.table('acu/rate_command')
    assert (command['azimuth.velocity'][np.searchsorted(command['t'], pins['t'][1]):
                                        np.searchsorted(command['t'], pins['t'][4])] == 0.0).all()


@pytest.mark.thorough
def test_closed_loop_and_recomputation_are_the_same_to_the_last_bit(recorded, differences, pedestal):
    loop = closed_loop.Loop(scenario.load('leo_pass', [*GIVEN], duration=SECONDS, pacing='lockstep'))
    assert differences(loop.run(), bags.read(recorded)) == {}
    for node in ('acu', 'adu'):
        code, said, _ = pedestal('recompute', recorded, '--node', node, '--absolute', 0, '--relative', 0)
        assert code == 0 and said.splitlines()[-1] == f'{node}: identical'


def looped(seconds, *given):
    """(Run, units) of the closed loop of leo_pass."""
    loop = closed_loop.Loop(scenario.load('leo_pass', [*GIVEN, *given], duration=seconds, pacing='lockstep'))
    return loop.run(), loop.units


def test_a_stuck_pin_is_a_fault_of_the_drive_and_an_alarm():
    run, units = looped(9.0, 'acu.commands=0.1 stow', 'adu.inject=0 pin_stuck axis=elevation')
    assert modes.MODES[run['acu/mode'][-1]] == 'standby' and units['adu'].condition == 'fault: elevation stow pin'
    alarms = units['acu'].alarms['alarm']
    raised = {ALARM_NAMES[i]: (alarms[i]['first'], alarms[i]['parent']) for i in np.flatnonzero(alarms['active'])}
    assert raised['elevation stow pin'][0] and 'azimuth stow pin' not in raised
    assert ALARM_NAMES[raised['drive fault'][1]] == 'elevation stow pin'
    assert units['acu'].command(Command('unstow')).text == 'refused: stow pin failed; mode is standby'
    assert units['adu'].command(Command('adu/reset_faults')).granted


def test_pins_that_never_answer_raise_the_alarm():
    """The drive's holes are not where the control unit stows."""
    run, units = looped(9.0, 'acu.commands=0.1 stow', 'adu.pins.azimuth=1', 'acu.stow_timeout=2')
    alarms = units['acu'].alarms['alarm']
    assert {ALARM_NAMES[i] for i in np.flatnonzero(alarms['active'])} == {'azimuth stow pin', 'elevation stow pin'}
    assert (run['acu/rate_command']['velocity'][-1] == 0.0).all() and modes.MODES[run['acu/mode'][-1]] == 'stow'


def test_a_satellite_that_is_down_says_when_it_rises():
    _, units = looped(0.5, "acu.commands=''", f'acu.prediction.start_time={START.replace("14:15", "13:50")}')
    said = units['acu'].command(Command('tle', arguments=dict(zip(('line_1', 'line_2'), LINES)))).text
    assert said.startswith('refused: below the horizon, next rise at 2019-12-10T14:1') and said.endswith('standby')
    assert units['acu'].command(Command('tle')).text == 'refused: no elements; mode is standby'    # nothing changed
    assert units['acu'].command(Command('elements', arguments=dict(zip(('line_1', 'line_2'), LINES)))).granted
    assert 'below the horizon' in units['acu'].command(Command('tle')).text
    assert 'checksum' in units['acu'].command(Command('elements', arguments={
        'line_1': LINES[0][:-1] + '0', 'line_2': LINES[1]})).text


def test_what_falls_back_on_its_elements_goes_on_by_them():
    """The carrier fades for good: after coast_time the fallback, here the table that was followed, is taken."""
    run, _ = looped(9.0, f'acu.commands=1 tle line_1={LINES[0]} line_2={LINES[1]}', 'acu.tracker.coast_time=1',
                    'tracking_receiver.inject=4 fade depth=60')
    said = run['acu/mode']
    told = [modes.MODES[code] for code in said[np.flatnonzero(np.diff(said, prepend=-1))]]
    assert told == ['standby', 'tle', 'autotrack', 'tle']
    last = run.where(run.t > 8.5)
    assert np.degrees(np.hypot(*last.truth['error'].T)).max() < 0.02
