"""Realtime: the steady timer, the latest command, and what a drive does when its commands stop or are nonsense."""
import json
import os
import re
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from pedestal_common.graph import nodes
from pedestal_common.wire import commands, messages
from pedestal_recording import bag as bags
from pedestal_recording.bag import load
from pedestal_recording.verify import verify

pytestmark = pytest.mark.thorough

PAUSE = 1.6
"""Drive time [s] for which the ACU of the run stands still: longer than a second, so a diagnostic falls in it."""


SOON = 30.0
"""Seconds in which a drive does what it is told, also on a machine that is busy with other tests."""

TIMEOUT = 40
"""Periods until a command is stale: a busy machine may hold the commander up for longer than the 10 of the default."""


@pytest.fixture(scope='module')
def run(start_run, connect):
    """A realtime run whose ACU is stopped for a while on the way to the target: run.stopped, run.resumed [s]."""
    run = start_run('leo_pass', '--pacing', 'realtime', '--duration', '6', '--param', 'acu.azimuth.shaper.rate=0.3',
                    '--param', 'scenario.priority=10')
    client = connect(run.domain_id)
    client.read('joint_states')
    heard = client.heard['joint_states']

    def stamp():
        return messages.nanoseconds(heard[-1].header.stamp) * 1e-9
    client.until(lambda: heard and abs(heard[-1].velocity[0]) > 0.2)
    run.policies = {node: os.sched_getscheduler(pid) for node, pid in run.pids().items()}
    run.signal('acu', signal.SIGSTOP)
    run.stopped = stamp()
    client.until(lambda: stamp() >= run.stopped + PAUSE)
    run.resumed = stamp()
    run.signal('acu', signal.SIGCONT)
    client.close()
    run.result = run.finish()
    start = bags.read(run.bag).start * 1e-9
    run.stopped, run.resumed = run.stopped - start, run.resumed - start
    return run


@pytest.mark.excused_by('missed_steps')
def test_a_run_goes_at_the_pace_of_the_clock(run):
    assert run.result.returncode == 3, run.result.stderr
    assert re.search(r'^pedestal: the drive lost \d+ of 1200 steps, more than 1%: '
                     r'load [0-9.]+ on \d+ cores; end other programs or use a machine with more cores$',
                     run.result.stderr, re.MULTILINE)
    rows = {row['metric']: row['value'] for row in json.loads(run.json.read_text())['rows']}
    assert 0.0 < rows['realtime_factor'] < 1.02
    assert rows['lost_steps'] > 200
    assert verify(load(run.bag)).complete


def test_a_run_names_the_position_and_no_value_of_a_real_antenna(run):
    assert run.result.stdout.startswith('antenna at 47.40 N 8.50 E, 500 m: the default\n')
    logs = ''.join(path.read_text() for path in run.log.glob('*.log'))
    assert 'ready, waits for' in logs and 'the default' not in logs and 'not given' not in logs


def test_who_has_a_step_to_make_goes_first(run):
    if subprocess.run([sys.executable, '-c', 'import os; os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(10))'],
                      stderr=subprocess.DEVNULL, timeout=60.0).returncode:
        pytest.skip('this machine allows no priority')
    assert {node for node, policy in run.policies.items() if policy == os.SCHED_RR} == {'adu', 'acu',
                                                                                      'tracking_receiver'}


@pytest.mark.excused_by('missed_steps')
def test_stale_commands_stop_the_axes(run):
    table = bags.read(run.bag).table('joint_states')
    rate = np.hypot(table['azimuth.velocity'], table['elevation.velocity'])
    t = table['t']
    assert rate[t <= run.stopped + 1e-3].max() > 0.2
    assert rate[(t > run.stopped + 0.8) & (t < run.resumed)].max() < 2e-3
    assert rate[t > run.resumed + 0.1].max() > 0.1


@pytest.mark.excused_by('missed_steps')
def test_the_drive_says_that_commands_are_stale(run):
    bag = bags.read(run.bag)
    said = [status for _, _, _, data in bag.raw('diagnostics')
            for status in messages.deserialize(data, 'diagnostic_msgs/msg/DiagnosticArray').status
            if status.name == 'adu' and 'no new acu/rate_command for 0.05 s: stopping' in status.message]
    assert said and {status.level for status in said} == {2}


class Commander:
    """Answers every joint state with a rate command, as an ACU would."""

    def __init__(self, client):
        self.client = client
        self.rates = 0.0, 0.0
        client.write('acu/rate_command')
        client.read('diagnostics')
        client.read('joint_states', self.answer)
        client.read('adu/state')
        client.until(lambda: client.heard['joint_states'])

    def answer(self, joints):
        if self.rates is not None:
            self.send(messages.nanoseconds(joints.header.stamp), self.rates)

    def send(self, stamp, rates):
        command = messages.template('joint_states')
        messages.put_stamp(command.header.stamp, stamp)
        command.velocity[:] = rates
        self.client.publish('acu/rate_command', command)

    @property
    def last(self):
        return self.client.heard['joint_states'][-1]

    @property
    def state(self):
        return self.client.heard['adu/state'][-1].data

    @property
    def stamp(self):
        return messages.nanoseconds(self.last.header.stamp)

    def rests(self, seconds):
        """Stands, and still does `seconds` later."""
        self.moves_at(0.0, 0.0)
        end = time.monotonic() + seconds
        self.client.until(lambda: time.monotonic() > end)
        self.moves_at(0.0, 0.0)

    def moves_at(self, azimuth, elevation):
        self.client.until(
            lambda: np.allclose(self.last.velocity, (azimuth, elevation), atol=5e-3), SOON,
            lambda: f'asked for {self.rates}, moves at {list(self.last.velocity)}; {self.state}; '
                    f'said: {self.client.said(-5)}')


def test_before_the_graph_begins_the_drive_is_not_silent(start_node, connect):
    begins = time.time_ns() + 12_000_000_000
    client = connect(start_node('acu', '-p', f'graph.start:={begins}').domain_id)
    client.read('diagnostics')

    def told(after):
        return [status for array in client.heard['diagnostics'] for status in array.status
                if status.name == 'acu' and (messages.nanoseconds(array.header.stamp) > begins) == after]
    client.until(lambda: any('no joint_states' in status.message for status in told(True)))
    assert not any('no joint_states' in status.message for status in told(False))


def test_the_last_step_before_a_silence_is_answered_in_it(start_node, connect):
    """Its error never comes: who was killed had no time to say where the beam is."""
    client = connect(start_node('acu').domain_id)
    client.write('joint_states')
    client.read('acu/rate_command')
    answers = client.heard['acu/rate_command']
    angles = messages.template('joint_states')
    while len(answers) < 10:
        messages.put_stamp(angles.header.stamp, last := time.time_ns())
        client.publish('joint_states', angles)
        client.spin(0.01)
    client.until(lambda: messages.nanoseconds(answers[-1].header.stamp) == last, SOON)


@pytest.mark.excused_by(None)
def test_a_drive_that_is_too_slow_for_its_steps_hears_its_other_events(start_node, connect):
    """As many beams as there may be, each a step every millisecond, on a core that others are busy on too."""
    node = start_node('beam_steering', '-p', 'period:=0.001', '-p', f'graph.beams:={nodes.MAX_BEAMS}')
    client = connect(node.domain_id)
    client.read('diagnostics')
    core = {min(os.sched_getaffinity(0))}
    for thread in os.listdir(f'/proc/{node.process.pid}/task'):
        os.sched_setaffinity(int(thread), core)
    # Each in a session of its own, else the kernel gives all of them as much as the drive alone.
    busy = [subprocess.Popen([sys.executable, '-c', f'import os; os.sched_setaffinity(0, {core})\nwhile True: pass'],
                             start_new_session=True) for _ in range(2)]
    try:
        first, end = len(client.heard['diagnostics']), time.monotonic() + 12.0
        client.until(lambda: time.monotonic() > end)
    finally:
        for process in busy:
            process.kill()
            process.wait()
    told = [status for array in client.heard['diagnostics'][first:] for status in array.status]
    values = {value.key: value.value for status in told for value in status.values}
    assert int(values['missed_steps']) > 1000
    assert len(told) >= 8, f'{len(told)} diagnostics in 12 s, one a second'


def test_a_drive_whose_run_is_over_hears_what_it_is_told_until_its_axes_stand(start_node, connect):
    """Its last step finds them on their way; at 0.02 rad/s2 they take 10 s to stand."""
    over = time.time_ns() + 25_000_000_000
    node = start_node('adu', '-p', f'graph.start:={over - 20_000_000_000}', '-p', 'duration:=20.0',
                      '-p', 'azimuth.limits.deceleration:=0.02', '-p', 'brakes.stop_time:=60.0',
                      '-p', f'command_timeout:={TIMEOUT}', '-p', 'initial_elevation:=0.8')
    commander = Commander(connect(node.domain_id))
    commander.rates = 0.2, 0.0
    commander.moves_at(0.2, 0.0)
    commander.client.until(lambda: commander.stamp > over and commander.state == 'stopping')
    assert commander.client.trigger('adu/emergency_stop') == (True, 'drive is emergency stop')
    assert node.finish().returncode == 0


@pytest.fixture(scope='module')
def drive(start_node, connect):
    """A drive alone, with brakes so weak that a stop takes a second, under a commander."""
    node = start_node('adu', '-p', 'initial_elevation:=0.8', '-p', 'azimuth.limits.deceleration:=0.2',
                      '-p', 'azimuth.faults.overspeed:=0.4', '-p', 'brakes.stop_time:=10.0',
                      '-p', f'command_timeout:={TIMEOUT}')
    commander = Commander(connect(node.domain_id))
    yield commander
    node.process.send_signal(signal.SIGINT)
    assert node.finish(15.0).stderr == ''


@pytest.mark.excused_by('missed_steps')
def test_the_latest_command_wins(drive):
    drive.rates = 0.1, 0.05
    drive.moves_at(0.1, 0.05)
    stamp = drive.stamp
    drive.rates = None
    drive.send(stamp - 1, (0.3, 0.0))
    drive.rates = -0.1, 0.0
    drive.moves_at(-0.1, 0.0)


def test_a_command_from_the_past_is_refused(drive):
    drive.rates = 0.1, 0.0
    drive.moves_at(0.1, 0.0)
    drive.send(0, (2.0, 1.0))
    status = drive.client.diagnosed('acu/rate_command: 2 dropped: stale: ')
    assert status.level == 1
    drive.moves_at(0.1, 0.0)


def test_a_command_from_the_future_is_refused(drive):
    drive.rates = 0.1, 0.0
    drive.send(drive.stamp + 100_000_000_000, (2.0, 1.0))
    drive.client.diagnosed('acu/rate_command: 1 dropped: future: ')
    drive.moves_at(0.1, 0.0)


@pytest.mark.parametrize('value', [np.nan, np.inf])
def test_a_command_that_is_no_number_is_named(drive, value):
    drive.rates = 0.1, 0.0
    drive.moves_at(0.1, 0.0)
    drive.rates = value, 0.0
    assert drive.client.diagnosed('acu/rate_command holds NaN or infinity').level == 2
    drive.rates = 0.1, 0.0
    drive.moves_at(0.1, 0.0)


@pytest.mark.excused_by('missed_steps')
def test_silence_stops_the_axes_with_a_diagnostic(drive):
    drive.rates = 0.2, 0.0
    drive.moves_at(0.2, 0.0)
    start, late = drive.last.position[0], TIMEOUT * 0.005
    drive.rates = None
    assert drive.client.diagnosed(f'no new acu/rate_command for {late:g} s: stopping').level == 2
    drive.moves_at(0.0, 0.0)
    # Controlled: the way of a stop at 0.2 rad/s2 from 0.2 rad/s, and of the time before it.
    assert drive.last.position[0] - start == pytest.approx(0.1 + 0.2 * late, rel=0.3)


def test_emergency_stop_and_reset(drive):
    drive.rates = 0.2, 0.0
    drive.moves_at(0.2, 0.0)
    assert drive.client.trigger('adu/emergency_stop') == (
        True, 'drive is emergency stop')
    assert drive.client.trigger('adu/reset_faults') == (
        False, 'refused: the axes still move; drive is emergency stop')
    assert drive.client.trigger('adu/enable') == (
        False, 'refused: an emergency stop is latched (adu/reset_faults); drive is emergency stop')
    drive.client.diagnosed('emergency stop')
    drive.rests(0.3)
    assert drive.client.trigger('adu/reset_faults') == (True, 'drive is releasing brakes')
    drive.moves_at(0.2, 0.0)


def test_a_fault_is_latched_told_and_reset_by_service(drive):
    drive.rates = 0.5, 0.0
    assert drive.client.diagnosed('fault: azimuth overspeed').level == 2
    drive.client.until(lambda: drive.state == 'fault: azimuth overspeed', SOON)
    drive.rates = 0.1, 0.0
    assert drive.client.trigger('adu/enable') == (
        False, 'refused: a fault is latched (adu/reset_faults); drive is fault: azimuth overspeed')
    assert drive.client.trigger('adu/reset_faults') == (
        False, 'refused: the axes still move; drive is fault: azimuth overspeed')
    drive.rests(0.5)
    assert drive.client.trigger('adu/reset_faults') == (True, 'drive is releasing brakes')
    drive.moves_at(0.1, 0.0)
    assert drive.state == 'enabled'


def test_disable_and_enable(drive):
    drive.rates = 0.1, 0.0
    drive.moves_at(0.1, 0.0)
    assert drive.client.trigger('adu/disable') == (True, 'drive is stopping')
    drive.moves_at(0.0, 0.0)
    drive.client.until(lambda: drive.state == 'disabled', SOON)
    assert drive.client.trigger('adu/enable') == (True, 'drive is releasing brakes')
    drive.moves_at(0.1, 0.0)
    assert drive.state == 'enabled'


def test_a_live_fault_breaks_the_drive_and_is_told_and_recorded(start_run, connect, patient):
    run = start_run('uav_flyby', '--duration', '240', '--pacing', 'realtime', *patient)
    somebody = connect(run.domain_id)
    somebody.write('adu/inject')
    for topic in ('adu/injected', 'adu/state', 'acu/mode'):
        somebody.read(topic)
    somebody.until(lambda: somebody.heard['acu/mode'] and somebody.heard['acu/mode'][-1].data == 'autotrack')
    for command in (commands.Command('encoder_jump', 'anna', '1', {'size': '0.02', 'duration': '0.5'}),
                    commands.Command('encoder_jump', 'anna', '2', {'size': '9'})):
        somebody.publish('adu/inject', commands.message(command))
        somebody.until(lambda command=command: any(status.message == command.number
                                                   for status in somebody.heard['adu/injected']))
    somebody.until(lambda: any(said.data == 'fault: azimuth encoder disagreement'
                               for said in somebody.heard['adu/state']))
    somebody.until(lambda: somebody.heard['acu/mode'][-1].data == 'standby')
    assert run.interrupt().returncode == 130
    bag = bags.read(run.bag)
    replies = [commands.of_reply(message) for *_, message in bag.messages('adu/injected')]
    told = [(command.verb, command.who, command.number, reply.granted, reply.text)
            for command, reply in replies if command.who == 'anna']
    assert [row[:4] for row in told] == [('encoder_jump', 'anna', '1', True), ('encoder_jump', 'anna', '2', False)]
    assert told[0][4].startswith('encoder_jump from the step after ') and told[0][4].endswith(' s on, for 0.5 s')
    assert 'size = 9 rad: must be -3.2 to 3.2' in told[1][4]
    assert len(list(bag.raw('adu/inject'))) == 2
