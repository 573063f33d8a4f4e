"""By hand from a terminal: `pedestal status`, `mode`, `ask` and `operate` on a running realtime graph."""
import json
import math
import os
import pty
import re
import select
import subprocess
import time

import limited
import pytest
from shared import PEDESTAL

from pedestal_common.wire import commands, messages
from pedestal_recording import bag as bags

pytestmark = pytest.mark.thorough

ARROW_RIGHT = b'\x1b[C'
ISS = {'OBJECT_NAME': 'ISS (ZARYA)', 'OBJECT_ID': '1998-067A', 'CENTER_NAME': 'EARTH', 'REF_FRAME': 'TEME',
       'TIME_SYSTEM': 'UTC', 'MEAN_ELEMENT_THEORY': 'SGP4', 'EPOCH': '2019-12-09T16:38:29.363424',
       'MEAN_MOTION': '15.50103472', 'ECCENTRICITY': '0.0007417', 'INCLINATION': '51.6439',
       'RA_OF_ASC_NODE': '211.2001', 'ARG_OF_PERICENTER': '17.6667', 'MEAN_ANOMALY': '85.6398', 'EPHEMERIS_TYPE': '0',
       'NORAD_CAT_ID': '25544', 'BSTAR': '0.000038792', 'MEAN_MOTION_DOT': '0.00001764', 'MEAN_MOTION_DDOT': '0'}
BURST = tuple(str(number) for number in range(40))


def replies(path):
    """[(Command, Reply)] of a recording."""
    return [commands.of_reply(messages.deserialize(data, 'diagnostic_msgs/msg/DiagnosticStatus'))
            for *_, data in bags.read(path).raw('acu/command_result')]


@pytest.fixture(scope='module', params=('uav_flyby', 'ship_pass'))
def running(request, start_run, connect, patient):
    """(Run in realtime ashore or on a ship, its Client) from the moment in which it tracks. Its pass has its middle in
    the middle of the run: in a longer one the satellite would have to rise first."""
    run = start_run(request.param, '--duration', '240', '--pacing', 'realtime', '--param', 'adu.stow_pins=true',
                    '--param', 'adu.pins.travel_time=0.5', *patient)
    client = connect(run.domain_id)
    client.read('acu/mode')
    client.read('joint_states')
    client.read('diagnostics')
    client.until(lambda: client.heard['acu/mode'] and client.heard['acu/mode'][-1].data == 'autotrack',
                 told=lambda: client.said(-20))
    yield run, client
    run.interrupt()


@pytest.fixture
def terminal(running, run_process):
    """terminal(*arguments) -> CompletedProcess of `pedestal` beside the running graph."""
    return lambda *arguments: run_process([*PEDESTAL, *arguments], 60.0, ROS_DOMAIN_ID=str(running[0].domain_id))


def mode(client, name):
    client.until(lambda: client.heard['acu/mode'][-1].data == name, 20.0)


def test_one_shot_verbs_ask_wait_and_say(running, terminal, tmp_path):
    run, client = running
    said = terminal('mode', 'preset', '--az', '20', '--el', '35', '--wait')
    first, last = said.stdout.splitlines()
    assert (said.returncode, first) == (0, 'acu: mode is preset, moving'), said.stderr
    assert last.startswith('acu: preset, reached after ')
    assert f'graph: domain {run.domain_id}, scenario ' in said.stderr
    mode(client, 'preset')
    refused = terminal('mode', 'preset', '--el', '1000')
    assert refused.returncode == 1
    assert refused.stdout.startswith('acu: refused: outside limits, elevation 1000.00 deg: must be -')
    assert terminal('mode', 'preset', '20', '35').returncode == 0
    assert client.heard['acu/mode'][-1].data == 'preset'
    assert '30: must be azimuth and elevation [deg]' in terminal('mode', 'preset', '30').stderr
    assert '--hold 5: must be' in terminal('mode', 'preset', '20', '35', '--hold', '5').stderr
    assert terminal('ask', 'take', '--who', 'anna').returncode == 0
    assert 'control is held by anna' in terminal('mode', 'program', '--who', 'bert').stdout
    assert terminal('mode', 'stop', '--who', 'bert').returncode == 0
    mode(client, 'stop')
    assert terminal('ask', 'fallback', 'mode=memory', '--who', 'anna').returncode == 0
    elements = tmp_path / 'iss.omm'
    elements.write_text('CCSDS_OMM_VERS = 2.0\n' + ''.join(f'{key} = {value}\n' for key, value in ISS.items()))
    assert terminal('ask', 'elements', '--tle', str(elements), '--who', 'anna').stdout == (
        'acu: elements of satellite 25544\n')
    refused = terminal('mode', 'tle', '--tle', str(elements), '--who', 'anna')
    assert refused.returncode == 1 and refused.stdout.startswith('acu: refused: ')
    file = tmp_path / 'status.json'
    terminal('status', '--json', str(file))
    rows = {(row['case'], row['metric']): row['value'] for row in json.loads(file.read_text())['rows']}
    assert rows['acu', 'mode'] == 'stop' and rows['acu', 'control'] == 'anna' and rows['acu', 'fallback'] == 'memory'
    assert rows['angle', 'elevation'] == pytest.approx(rows['commanded', 'elevation'], abs=0.2)
    assert terminal('ask', 'release', '--who', 'anna').returncode == 0
    printed = json.loads(terminal('status', '--json').stdout)
    assert ('acu', 'mode', 'stop') in [(row['case'], row['metric'], row['value']) for row in printed['rows']]


def test_a_held_rate_lasts_as_long_as_the_program_and_no_longer(running, terminal):
    _, client = running
    client.until(lambda: client.heard['joint_states'])
    began = client.heard['joint_states'][-1].position[0]

    def turned():
        return client.heard['joint_states'][-1].position[0] - began > math.radians(0.5)    # at least half of the time
    for _ in range(5):  # refused in the moment in which a busy machine holds the drive up
        done = terminal('mode', 'rate', '--az', '0.5', '--hold', '2')
        if done.returncode == 0:
            break
    assert (done.returncode, done.stdout) == (0, 'acu: mode is rate\n'), done.stderr
    client.until(turned, 20.0)
    client.until(lambda: abs(client.heard['joint_states'][-1].velocity[0]) < 1e-3)


@pytest.fixture
def console(running, environment):
    """(Popen, descriptor of the terminal) of `pedestal operate`."""
    screen, theirs = pty.openpty()
    process = subprocess.Popen([*PEDESTAL, 'operate', '--who', 'hand'], stdin=theirs, stdout=theirs, stderr=theirs,
                               start_new_session=True, env={**environment, 'ROS_DOMAIN_ID': str(running[0].domain_id),
                                                            'TERM': 'xterm', 'COLUMNS': '120'})
    yield process, screen
    limited.kill_tree(process)
    os.close(theirs)
    os.close(screen)


def test_the_console_stops_jogs_while_a_key_is_held_and_quits(running, console):
    _, client = running
    process, screen = console
    client.until(lambda: client.heard['joint_states'])
    shown = b''

    def watch(condition, seconds=60.0):
        nonlocal shown
        deadline = time.monotonic() + seconds
        while not condition():
            assert time.monotonic() < deadline, shown[-2000:]
            if select.select([screen], [], [], 0.01)[0]:
                shown += os.read(screen, 65536)
            client.spin(0.01)

    def press(key, name):
        # Refused, and to be asked again, in the moment in which a busy machine holds the drive up.
        while client.heard['acu/mode'][-1].data != name:
            os.write(screen, key)
            asked = time.monotonic()
            watch(lambda asked=asked: client.heard['acu/mode'][-1].data == name or time.monotonic() > asked + 1.0)
    watch(lambda: b'jog' in shown)
    press(b'b', 'standby')
    press(b's', 'stop')
    began = client.heard['joint_states'][-1].position[0]
    deadline = time.monotonic() + 60.0
    while client.heard['acu/mode'][-1].data != 'rate' or client.heard['joint_states'][-1].position[0] < began + 0.005:
        assert time.monotonic() < deadline, shown[-2000:]
        os.write(screen, ARROW_RIGHT)
        held = time.monotonic() + 0.05
        watch(lambda held=held: time.monotonic() > held)
    watch(lambda: abs(client.heard['joint_states'][-1].velocity[0]) < 1e-3)               # the key was let go
    os.write(screen, b'q')
    watch(lambda: process.poll() == 0)


def test_the_antenna_is_stowed_with_its_pins_and_unstowed(running, terminal):
    _, client = running
    client.read('adu/stow_pins')

    def pins(where):
        client.until(lambda: client.heard['adu/stow_pins'] and client.heard['adu/stow_pins'][-1].data == (
            f'azimuth {where}, elevation {where}'))
    pins('out')
    stowed = terminal('mode', 'stow', '--wait')
    assert stowed.returncode == 0 and 'acu: mode is stowing\nacu: stowed after ' in stowed.stdout
    pins('in')
    refused = terminal('mode', 'preset', '--az', '10')
    assert (refused.returncode, refused.stdout) == (1, 'acu: refused: stow pins not out; mode is stow\n')
    assert terminal('mode', 'unstow').returncode == 0
    pins('out')
    mode(client, 'standby')


def test_the_drive_is_commanded_and_replies(running, terminal):
    """An emergency stop is open to everyone. Only a reset of the drive ends it, once the axes stand."""
    assert terminal('ask', 'take', '--who', 'anna').returncode == 0
    refused = terminal('drive', 'disable', '--who', 'bert')
    assert (refused.returncode, refused.stdout) == (1, 'adu: refused: control is held by anna\n')
    assert terminal('drive', 'emergency_stop', '--who', 'bert').stdout == 'adu: drive is emergency stop\n'
    assert terminal('ask', 'release', '--who', 'anna').returncode == 0
    refused = terminal('drive', 'enable')
    assert refused.returncode == 1 and 'an emergency stop is latched' in refused.stdout
    assert 'only `pedestal drive reset_faults` ends an emergency stop' in terminal('ask', 'reset').stdout
    assert re.search('^alarm +emergency stop: high, ', terminal('status').stdout, re.MULTILINE)
    deadline = time.monotonic() + 60.0
    while (reset := terminal('drive', 'reset_faults')).returncode != 0:
        assert 'the axes still move' in reset.stdout and time.monotonic() < deadline
    assert terminal('drive', 'disable').returncode == terminal('drive', 'enable').returncode == 0


def test_every_request_of_a_burst_is_replied_to(running):
    _, client = running
    client.write('acu/command')
    client.read('acu/command_result')
    for number in BURST:
        client.publish('acu/command', commands.message(commands.Command('release', 'burst', number)))
    client.until(lambda: set(BURST) <= {status.message for status in client.heard['acu/command_result']})


def test_everything_asked_is_in_the_recording_with_who_asked(running):
    run, _ = running
    run.interrupt()
    asked = {(command.verb, command.who, reply.granted) for command, reply in replies(run.bag)}
    assert {('take', 'anna', True), ('program', 'bert', False), ('stop', 'bert', True), ('stop', 'hand', True),
            ('rate', 'hand', True)} <= asked
    burst = [command.number for command, _ in replies(run.bag) if command.who == 'burst']
    assert sorted(burst) == sorted(BURST)


def test_without_a_graph_it_is_said_in_one_line(run_process, reserve_domain, one_line):
    for arguments in (('status',), ('mode', 'stop')):
        done = run_process([*PEDESTAL, *arguments, '--timeout', '1'], 60.0, ROS_DOMAIN_ID=str(reserve_domain()))
        assert done.returncode == 1 and 'is a graph running?' in one_line(done.stderr)
    done = run_process([*PEDESTAL, 'operate'], 60.0)
    assert done.returncode == 2 and 'needs a terminal' in one_line(done.stderr)


def test_live_commands_are_answered_recorded_and_recomputed(start_run, connect, patient, pedestal):
    """In realtime, by topic and by service, from two who are strangers to the graph."""
    run = start_run('uav_flyby', '--duration', '240', '--pacing', 'realtime', *patient)
    operator = connect(run.domain_id)
    operator.write('acu/command')
    operator.read('acu/command_result')
    operator.read('acu/mode')
    operator.until(lambda: operator.heard['acu/mode'] and operator.heard['acu/mode'][-1].data == 'autotrack')
    asked = (commands.Command('preset', 'anna', '1', {'azimuth': '0.2', 'elevation': '0.4'}),
             commands.Command('preset', 'anna', '2', {'azimuth': 'nan'}),
             commands.Command('dance', 'anna', '3'))
    for command in asked:
        operator.publish('acu/command', commands.message(command))
        operator.until(lambda command=command: any(status.message == command.number
                                                   for status in operator.heard['acu/command_result']))
    assert operator.trigger('acu/program')[0]
    assert run.interrupt().returncode == 130
    told = [(command.verb, command.who, reply.granted) for command, reply in replies(run.bag)]
    assert told == [('preset', 'anna', True), ('preset', 'anna', False), ('dance', 'anna', False),
                    ('acu/program', 'service', True)]
    assert len(list(bags.read(run.bag).raw('acu/command'))) == 3
    assert 'preset azimuth=0.2 elevation=0.4 requested at' in pedestal('recompute', run.bag, '--node', 'acu')[1]
