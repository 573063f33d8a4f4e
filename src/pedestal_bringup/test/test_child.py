"""Children of a process that has one thread, of one that has more, and where a copy can have no name of its own: what
they are and how they end."""
import contextlib
import json
import os
import pathlib
import subprocess
import sys
import time

import pytest

PARENT = """
import os, pathlib, signal, sys, threading, time
from pedestal_bringup.graph import child as children
from pedestal_bringup.graph.child import Child

def start(rehearse=lambda: None):
    with open('log', 'ab') as log:
        return Child([sys.executable, '-m', 'one_node', 'a word', '--x'], log.fileno(), rehearse)

if {nameless}:
    prctl = children._libc.prctl
    children._libc.prctl = lambda option, *rest: -1 if option == children.PR_SET_MM else prctl(option, *rest)
if {threads}:
    threading.Thread(target=time.sleep, args=(60.0,), daemon=True).start()
"""

NODE = """
import json, os, pathlib, signal, sys, time

def main():
    here = pathlib.Path('/proc/self')
    print(json.dumps({'argv': sys.argv[1:], 'line': (here / 'cmdline').read_text().split('\\0'), 'comm':
                      (here / 'comm').read_text(), 'session': os.getsid(0) == os.getpid(), 'parent': os.getppid(),
                      'input': os.readlink('/proc/self/fd/0'), 'rehearsed': 'REHEARSED' in os.environ,
                      'handlers': [signal.getsignal(number) for number in (signal.SIGTERM, signal.SIGHUP)],
                      'masked': list(signal.pthread_sigmask(signal.SIG_BLOCK, ())),
                      'open': sorted(os.readlink(f'/proc/self/fd/{name}') for name in os.listdir('/proc/self/fd')
                                     if int(name) > 2 and os.path.exists(f'/proc/self/fd/{name}'))}, default=str))
    print('it said', file=sys.stderr)
    return 7

if __name__ == '__main__':
    sys.exit(main())
"""


@pytest.fixture(params=['alone', 'with threads', 'nameless'])
def parent(request, tmp_path):
    """run(code, node=NODE) -> (CompletedProcess of a parent that starts children of a node, their log)."""
    def run(code, node=NODE, before=None):
        (tmp_path / 'one_node.py').write_text(node)
        made = PARENT.format(threads=request.param == 'with threads', nameless=request.param == 'nameless')
        done = subprocess.run([sys.executable, '-c', made + code], cwd=tmp_path, preexec_fn=before, text=True,
                              env={**os.environ, 'PYTHONPATH': str(tmp_path)}, capture_output=True, timeout=60.0)
        return done, (tmp_path / 'log').read_text()
    run.copies = request.param == 'alone'
    return run


def test_a_child_is_what_a_new_interpreter_is(parent):
    """But for what it rehearsed."""
    done, log = parent("""
signal.signal(signal.SIGTERM, signal.default_int_handler)
signal.signal(signal.SIGHUP, signal.SIG_IGN)
shut, other = open('/dev/null'), os.pipe()
os.set_inheritable(shut.fileno(), True)
child = start(lambda: os.environ.update(REHEARSED='yes'))
assert child.poll() is None
child.begin()
assert child.wait(30.0) == child.poll() == child.returncode == 7
child.send_signal(signal.SIGTERM)
print(os.getpid(), sys.executable)
""")
    pid, interpreter = done.stdout.split()
    assert (done.returncode, done.stderr) == (0, '')
    said, told = sorted(log.splitlines())
    assert said == 'it said'
    assert json.loads(told) == {
        'argv': ['a word', '--x'], 'line': [interpreter, '-m', 'one_node', 'a word', '--x', ''],
        'comm': pathlib.Path(interpreter).name[:15] + '\n', 'session': True, 'parent': int(pid), 'input': '/dev/null',
        'rehearsed': parent.copies, 'masked': [], 'open': [], 'handlers': [0, 1]}


def test_it_waits_as_long_as_it_is_held(parent):
    done, log = parent("""
child = start()
time.sleep(0.5)
print(child.poll(), os.stat('log').st_size)
child.send_signal(signal.SIGTERM)
print(child.wait())
child.begin()
""")
    assert (done.stdout, done.stderr, log) == ('None 0\n-15\n', '', '')


def test_it_ends_with_a_parent_that_is_killed(parent):
    """Also while it is held."""
    done, _ = parent("""
held, begun = start(), start()
begun.begin()
print(held.pid, begun.pid, flush=True)
time.sleep(0.5)
os.kill(os.getpid(), signal.SIGKILL)
""", NODE.replace('return 7', 'time.sleep(60.0)'))
    assert done.returncode == -9
    deadline = time.monotonic() + 30.0
    for pid in done.stdout.split():
        with contextlib.suppress(FileNotFoundError):
            while pathlib.Path(f'/proc/{pid}/cmdline').read_text():  # a zombie has none
                assert time.monotonic() < deadline
                time.sleep(0.01)


@pytest.mark.parametrize('node, expected', [
    ('import nothing_like_it', "No module named 'nothing_like_it'"),
    (NODE.replace('return 7', '1 / 0'), 'ZeroDivisionError: division by zero')], ids=['import', 'main'])
def test_one_that_fails_says_why(parent, node, expected):
    done, log = parent("""
child = start()
child.begin()
print(child.wait())
""", node)
    assert (done.stdout, done.stderr) == ('1\n', '')
    assert 'Traceback' in log and f'{expected}\n' in log


@pytest.mark.parametrize('end, code', [('return None', 0), ('sys.exit(3)', 3), ("sys.exit('no')", 1)])
def test_its_exit_code_is_that_of_an_interpreter(parent, end, code):
    done, _ = parent('child = start()\nchild.begin()\nprint(child.wait())', NODE.replace('return 7', end))
    assert done.stdout == f'{code}\n'


def test_a_child_whose_log_is_full_does_not_come_back_as_its_parent(parent):
    done, _ = parent("""
with open('log', 'w') as log, open('/dev/full', 'w') as full:
    child = Child([sys.executable, '-m', 'one_node'], full.fileno(), lambda: None)
try:
    child.begin()
    print(child.wait() != 0)
finally:
    print('once')
""")
    assert done.stdout == 'True\nonce\n'


def test_a_child_of_a_process_without_standard_input_has_its_log(parent):
    done, log = parent('child = start()\nchild.begin()\nprint(child.wait())', before=lambda: os.close(0))
    assert done.stdout == '7\n' and 'it said\n' in log


def test_what_fails_in_the_rehearsal_is_not_told(parent):
    done, log = parent("""
child = start(lambda: 1 / 0)
child.begin()
print(child.wait())
""")
    assert done.stdout == '7\n' and 'Traceback' not in log


def test_waiting_for_it_has_an_end(parent):
    done, _ = parent("""
import subprocess
child = start()
try:
    child.wait(0.1)
except subprocess.TimeoutExpired as error:
    print(error.timeout)
child.kill()
print(child.wait(30.0))
""")
    assert done.stdout == '0.1\n-9\n'
