"""A node dies, falls silent, or the user stops the run: an error that names the node, and a bag that can be read."""
import re
import signal
import time

import numpy as np
import pytest

from pedestal_recording import bag as bags
from pedestal_recording.bag import load
from pedestal_recording.verify import verify

pytestmark = pytest.mark.thorough

NODES = ('tracking_receiver', 'acu', 'adu', 'recorder')
DEADLINE_S = 10
"""Six graphs start side by side on the machine's cores, beside other tests: each of them may be slow."""


def hurt(start_run, targets):
    """{target: run} of runs side by side for {target: signal}; as soon as one is well under way its target, a node or
    the command `pedestal` itself, gets the signal."""
    runs = {target: start_run('leo_pass', '--pacing', 'lockstep', '--duration', '200',
                              '--param', f'scenario.deadline={DEADLINE_S}')
            for target in targets}
    waiting = set(targets)
    deadline = time.monotonic() + 90.0
    while waiting:
        assert time.monotonic() < deadline, f'{waiting} did not start'
        for target in sorted(waiting):
            run = runs[target]
            if run.recorded():
                waiting.remove(target)
                if target == 'pedestal':
                    run.process.send_signal(targets[target])
                elif target == 'everything':
                    run.kill()
                else:
                    run.signal(target, targets[target])
        time.sleep(0.02)
    return runs


def finished(runs):
    return {target: (run, run.finish()) for target, run in runs.items()}


@pytest.fixture(scope='module')
def silent(start_run):
    """Runs that wait DEADLINE_S for a node, in which time those of `killed` run."""
    return hurt(start_run, dict.fromkeys(NODES, signal.SIGSTOP))


@pytest.fixture(scope='module')
def killed(silent, start_run):
    return finished(hurt(start_run, {**dict.fromkeys((*NODES, 'everything'), signal.SIGKILL),
                                     'pedestal': signal.SIGINT}))


@pytest.fixture(scope='module')
def stopped(silent):
    return finished(silent)


def assert_readable(run, damaged=False):
    bag = bags.load(run.bag)
    assert bool(bag.damage) == damaged
    stamps = bag.table('joint_states')['t']
    assert len(stamps) > 50
    assert np.array_equal(np.round(stamps / 0.005), np.arange(len(stamps)))


@pytest.mark.parametrize('node', NODES)
def test_a_killed_node_is_named(killed, node):
    run, result = killed[node]
    assert result.returncode == 1
    assert 'Traceback' not in result.stderr
    first = result.stderr.splitlines()[0]
    assert first.startswith(f'pedestal: error: {node} died by signal SIGKILL; its last log lines')
    assert str(run.log / f'{node}.log') in first
    assert '\n  | ' in result.stderr
    assert run.pids() == {}
    assert_readable(run, damaged=node == 'recorder')


@pytest.mark.parametrize('node', NODES)
def test_a_silent_node_is_named(stopped, node):
    run, result = stopped[node]
    assert result.returncode == 1
    assert 'Traceback' not in result.stderr
    assert re.match(rf'pedestal: error: {node} has fallen silent; its last log lines', result.stderr)
    assert run.pids() == {}
    assert_readable(run)


@pytest.mark.parametrize('target', ['recorder', 'everything'])
def test_what_a_kill_left_is_recovered(killed, target, pedestal):
    run, _ = killed[target]
    if target == 'everything':
        assert not (run.bag / 'metadata.yaml').exists()
    code, said, errors = pedestal('recover', run.bag)
    assert (code, errors) == (0, '') and 'the recording breaks off after' in said
    recovered = run.bag.with_name('bag-recovered')
    report = verify(load(recovered))
    assert report.complete and report.steps >= 200, report.lines()
    assert list(bags.read(recovered).raw()) == list(bags.load(run.bag).raw())
    assert bags.read(recovered).configuration == bags.load(run.bag).configuration


def test_ctrl_c_ends_in_order(killed):
    run, result = killed['pedestal']
    assert result.returncode == 130
    assert result.stderr == f'pedestal: stopped; the recorded part is in {run.bag}\n'
    assert run.pids() == {}
    assert_readable(run)
    assert verify(load(run.bag)).problems == []
