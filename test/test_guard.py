"""A session of pytest leaves no process behind: killed, interrupted, or at its ordinary end."""
import pathlib
import re
import shutil
import signal
import subprocess
import sys
import time

import limited
import pytest
from shared import PATIENCE, PEDESTAL

HOME = pathlib.Path(__file__).parents[1]

SLEEPS = """
import subprocess
import time

def test_leaves_a_process():
    subprocess.Popen(['setsid', 'sleep', '600'])
    subprocess.Popen(['env', '-u', 'HOME', 'sleep', '601'], start_new_session=True)
    {ending}
"""
"""A test file whose processes leave its process group."""

RUNS = f"""
import subprocess
import time

def test_runs_a_graph(tmp_path):
    subprocess.Popen({PEDESTAL!r} + ('run', 'leo_pass', '--bag', str(tmp_path / 'bag')), start_new_session=True)
    {{ending}}
"""
"""A test file with the nodes of a graph, which are copies of `pedestal run`."""

WAITS = "open('begun', 'w').close()\n    time.sleep(600)"


@pytest.fixture
def begin(tmp_path, domain_id, monkeypatch):
    """begin(test file, *options) -> Popen of pytest, which has the session's domain."""
    monkeypatch.setenv('ROS_DOMAIN_ID', str(domain_id))
    for module in ('conftest.py', 'test/guard.py', 'test/not_judged.py'):
        shutil.copy(HOME / module, tmp_path)
    (tmp_path / 'pytest.ini').write_text('[pytest]\nphase_timeout = 400\n')
    begun = []

    def start(content, *options):
        (tmp_path / 'test_content.py').write_text(content)
        begun.append(subprocess.Popen(
            [sys.executable, '-m', 'pytest', '--basetemp', tmp_path / 'base', *options], cwd=tmp_path,
            stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
            start_new_session=True))
        return begun[-1]

    yield start
    for process in begun:
        limited.kill_tree(process)


def _until(condition):
    """Wait until a condition is true, and return whether it became true in time."""
    end = time.monotonic() + PATIENCE
    while not (value := condition()) and time.monotonic() < end:
        time.sleep(0.05)
    return value


def _below(process):
    """Return {pid: time of its start} of the processes below a Popen, except its guard."""
    return {pid: _start(pid) for _depth, pid in limited.descendants(process.pid)
            if b'guard.py' not in pathlib.Path(f'/proc/{pid}/cmdline').read_bytes()}


def _start(pid):
    """Return the time of the start of a process, which a later one of the same pid does not have; None without it."""
    try:
        state, *fields = pathlib.Path(f'/proc/{pid}/stat').read_text().rpartition(')')[2].split()
    except OSError:
        return None
    return None if state == 'Z' else fields[18]


def _gone(processes):
    return all(_start(pid) != start for pid, start in processes.items())


@pytest.mark.thorough
@pytest.mark.parametrize('options', [(), ('--numprocesses', '1')], ids=['alone', 'xdist'])
@pytest.mark.parametrize('number', [signal.SIGKILL, signal.SIGINT], ids=['killed', 'interrupted'])
def test_a_session_that_is_ended_leaves_no_process(begin, tmp_path, number, options):
    session = begin(SLEEPS.format(ending=WAITS), *options)
    assert _until((tmp_path / 'begun').exists), session.communicate()[0]
    left = _below(session)
    assert len(left) == 2 + len(options) // 2, left
    session.send_signal(number)
    session.wait(PATIENCE)
    assert _until(lambda: _gone(left))


@pytest.mark.thorough
def test_a_killed_session_leaves_no_node(begin, tmp_path):
    ending = "while not list(tmp_path.glob('bag/*.mcap')): time.sleep(0.1)\n    " + WAITS
    session = begin(RUNS.format(ending=ending))
    assert _until((tmp_path / 'begun').exists), limited.kill_tree(session) or session.communicate()[0]
    left = _below(session)
    assert len(left) > 5, left
    session.kill()
    assert _until(lambda: _gone(left))


@pytest.mark.thorough
def test_what_is_left_at_an_ordinary_end_is_killed_and_named(begin):
    session = begin(SLEEPS.format(ending='pass'), '--numprocesses', '1')
    said, _ = session.communicate(timeout=PATIENCE)
    assert session.returncode == 0 and '1 passed' in said
    named = re.search(r'left behind and killed =+\n(\d+) (.*)\n(\d+) (.*)\n', said)
    assert named and sorted([named[2], named[4]]) == ['sleep 600', 'sleep 601'], said
    assert _start(named[1]) is _start(named[3]) is None


@pytest.mark.thorough
def test_a_session_that_leaves_no_process_names_none(begin):
    said, _ = begin('import subprocess\ndef test(): subprocess.run(["sleep", "0.1"])').communicate(timeout=PATIENCE)
    assert '1 passed' in said and 'left behind' not in said


@pytest.mark.thorough
def test_the_guard_of_an_inner_session_outlives_the_outer_one(begin, tmp_path):
    """The outer guard kills the inner session, which then cannot end its own processes."""
    inner = """
import subprocess, sys, time
def test_outer(tmp_path):
    (tmp_path / 'test_inner.py').write_text(open('inner').read())
    subprocess.run([sys.executable, '-m', 'pytest', '-s', tmp_path / 'test_inner.py', '--rootdir', '.', '--confcutdir',
                    '.', '--basetemp', tmp_path / 'below'])
"""
    (tmp_path / 'inner').write_text(SLEEPS.format(ending=WAITS))
    session = begin(inner)
    assert _until((tmp_path / 'begun').exists), limited.kill_tree(session) or session.communicate()[0]
    left = _below(session)
    assert len(left) == 3, left
    session.kill()
    assert _until(lambda: _gone(left))
