"""`pedestal run` in realtime: who dies is started again, the run ends in order, and nobody is left behind."""
import re
import signal
import subprocess
import time

import kills
import pytest

from pedestal_bringup.graph import reaper
from pedestal_common.wire import messages
from pedestal_recording import bag as bags

pytestmark = pytest.mark.thorough

NODES = ('tracking_receiver', 'acu', 'adu', 'recorder')


def wait_until(condition, seconds):
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, f'not within {seconds:g} s'
        time.sleep(0.05)


@pytest.fixture(scope='module')
def begun(start_run, patient):
    """begun(prefix of its command) -> a realtime Run that records."""
    def begin(prefix=()):
        run = start_run('leo_pass', '--pacing', 'realtime', '--all', *patient, prefix=prefix)
        wait_until(lambda: run.bag.exists() and run.recorded(1), 180.0)
        return run
    return begin


def test_a_run_that_is_told_to_end_does_so_in_order_with_a_result(begun):
    """Also one that a script runs in the background, where a shell has SIGINT ignored."""
    run = begun(('sh', '-c', 'trap "" INT; exec "$@"', 'sh'))
    wait_until(run.recorded, 60.0)
    run.process.send_signal(signal.SIGTERM)
    result = run.finish()
    assert result.returncode == 130
    assert result.stderr == f'pedestal: stopped; the recorded part is in {run.bag}\n'
    assert 'restarts' in result.stdout
    assert run.pids() == {}
    assert bags.load(run.bag).damage == ''


def test_the_diagnostics_of_others_are_not_the_business_of_a_run(start_run, connect):
    """Not even that they cease, for which a node of its own is killed."""
    run = start_run('leo_pass', '--pacing', 'realtime', '--param', 'scenario.restart.silence=3')
    wait_until(lambda: run.bag.exists() and run.recorded(1), 180.0)
    client = connect(run.domain_id, 'gps')
    client.write('diagnostics')
    said = messages.DiagnosticStatus(level=0, name='gps', message='', hardware_id='', values=[])
    client.publish('diagnostics', messages.DiagnosticArray(header=messages.header(''), status=[said]))
    time.sleep(5.0)
    assert run.process.poll() is None
    run.process.send_signal(signal.SIGTERM)
    result = run.finish()
    assert result.returncode == 130 and 'gps' not in result.stderr


@pytest.mark.excused_by('missed_steps')
def test_who_dies_is_started_again_until_all_is_as_before(begun, connect):
    """Each node in its turn, the drive too: the target is tracked again, and recorded in a new file."""
    run = begun()
    client = connect(run.domain_id)
    watcher = kills.Watcher(client.node, client.executor)
    assert watcher.recovery(time.monotonic())
    for node in NODES:
        watcher.forget(node)
        since = time.monotonic()
        run.signal(node, signal.SIGKILL)
        assert watcher.recovery(since, node), (node, watcher.mode, watcher.heard)
    run.process.send_signal(signal.SIGINT)
    result = run.finish()
    assert result.returncode == 130
    said = [line for line in result.stderr.splitlines() if 'starting it again' in line]
    assert said == [f'pedestal: {node} died by signal SIGKILL: starting it again, 1 of 5 within 60 s'
                    for node in NODES]
    assert re.search(r'restarts +│ +4 ', result.stdout)
    assert sorted(path.name for path in run.bag.glob('*.mcap')) == ['bag_0.mcap', 'bag_1.mcap']


@pytest.mark.excused_by('missed_steps')
def test_nobody_outlives_a_killed_run(begun):
    """Not even a node that is stopped and so does not hear that it shall end."""
    run = begun()
    assert set(run.pids()) == set(NODES)
    run.signal('acu', signal.SIGSTOP)
    run.process.kill()
    wait_until(lambda: run.pids() == {}, reaper.GRACE_PERIOD_S + 10.0)
    assert bags.load(run.bag).damage == ''


def test_a_node_that_always_dies_is_given_up(start_run):
    """Where the bag shall be is a file: the recorder ends at once, however often it is started."""
    run = start_run('leo_pass', '--pacing', 'realtime', '--param', 'scenario.restart.attempts=2', '--param',
                    'scenario.restart.delay=0.1')
    wait_until(lambda: run.log.exists(), 60.0)
    run.bag.touch()
    result = run.finish()
    assert result.returncode == 1
    said = result.stderr.splitlines()
    assert [line for line in said if 'starting it again' in line] == said[:2]
    assert re.match(r'pedestal: recorder ended with exit code 1 \(recorder.* error: .*/bag.*\): starting it again, 1 '
                    'of 2 within 60 s', said[0])
    assert said[2].startswith('pedestal: error: recorder ended with exit code 1, after 2 starts within 60 s; its last '
                              'log lines')
    assert run.pids() == {}


FULL = """mount -t tmpfs -o size=4m tmpfs "$0" || exit
(until [ -s "$0/bag/bag_0.mcap" ]; do sleep 0.1; done; cat /dev/zero > "$0/filler") 2> /dev/null &
exec "$@"
"""
"""A disk of its own for a run, which is full to the last byte as soon as something is recorded."""


def test_the_cause_of_an_end_is_kept_on_a_full_disk(start_run, tmp_path):
    alone = ('unshare', '--mount', 'sh', '-c', FULL, tmp_path)
    if subprocess.run([*alone[:4], 'mount -t tmpfs tmpfs "$0"', tmp_path], capture_output=True,
                      timeout=60.0).returncode != 0:
        pytest.skip('this machine mounts nothing')
    result = start_run('leo_pass', bag=tmp_path / 'bag', prefix=alone).finish()
    assert result.returncode == 1
    assert re.search(r'^  \| recorder: error: .*bag_0.mcap: No space left on device$', result.stderr, re.MULTILINE)
