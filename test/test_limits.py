"""What hangs is ended within its limit and named with its stacks: in a step of `.ci/run` and in a phase of a test.
Tests in the background end as in the foreground."""
import pathlib
import shutil
import subprocess
import sys

import limited
import pytest

HOME = pathlib.Path(__file__).parents[1]

HANGS = """
import ctypes
import subprocess

import pytest

def waits_for_itself():
    mutex = ctypes.create_string_buffer(64)
    library = ctypes.{}(None)
    library.pthread_mutex_lock(mutex)
    library.pthread_mutex_lock(mutex)

@pytest.fixture
def stuck():
    yield
    waits_for_itself()

def test_is_stuck_after_a_failure(stuck):
    print(subprocess.Popen(['setsid', 'sleep', '600']).pid, file=open('grandchild', 'w'))
    assert not 'what it is for'

def test_that_comes_after():
    pass
"""
"""A test file whose tear-down never comes back from a library, which CDLL calls without the GIL and PyDLL with it."""


def run(folder, library, limit, phase_timeout, *options):
    """CompletedProcess of HANGS under both limits [s], of which 600 is none."""
    for module in ('conftest.py', 'test/guard.py', 'test/not_judged.py'):
        shutil.copy(HOME / module, folder)
    (folder / 'pytest.ini').write_text(f'[pytest]\ntimeout = 1\nphase_timeout = {phase_timeout}\n')
    (folder / 'test_hangs.py').write_text(HANGS.format(library))
    return subprocess.run([sys.executable, HOME / 'test' / 'limited.py', str(limit), sys.executable, '-m', 'pytest',
                           '--numprocesses', '1', *options], cwd=folder, capture_output=True, text=True, timeout=120.0)


def is_gone(folder):
    """Whether the process in a session of its own, which the test began, runs no more."""
    return not pathlib.Path('/proc', (folder / 'grandchild').read_text().strip()).exists()


@pytest.mark.thorough
@pytest.mark.parametrize('library', ['CDLL', 'PyDLL'])
def test_a_phase_that_hangs_is_named_with_its_stack(tmp_path, library):
    done = run(tmp_path, library, 600, 3, '--max-worker-restart', '0')
    assert done.returncode == 1
    assert 'Timeout (0:00:03)!' in done.stderr and 'in waits_for_itself' in done.stderr and 'in stuck' in done.stderr
    assert "crashed while running 'test_hangs.py::test_is_stuck_after_a_failure'" in done.stdout
    assert is_gone(tmp_path)


@pytest.mark.thorough
def test_a_command_that_hangs_is_named_with_the_stacks_of_its_processes(tmp_path):
    if not limited.PY_SPY.exists():
        pytest.skip('py-spy is not installed')
    done = run(tmp_path, 'CDLL', 10, 600)
    assert done.returncode == limited.EXPIRED
    assert f'{sys.executable} -m pytest --numprocesses 1: not ended after 10 s' in done.stderr
    assert 'waits_for_itself (test_hangs.py:' in done.stderr and 'sleep 600' in done.stderr
    assert is_gone(tmp_path)


@pytest.mark.thorough
def test_tests_that_send_signals_pass_in_the_background():
    """Where a shell ignores SIGINT, and nohup SIGHUP, for all processes below."""
    done = subprocess.run(['nohup', 'sh', '-c', 'trap "" INT; exec "$@"', 'sh', sys.executable, '-m', 'pytest',
                           '--numprocesses', '1', '-p', 'no:cacheprovider', '-k', 'stopped_while_it_imports',
                           'src/pedestal/test/test_console.py'],
                          cwd=HOME, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=120.0)
    assert done.returncode == 0 and '3 passed' in done.stdout, done.stdout + done.stderr


def test_the_exit_code_is_that_of_the_command():
    for code, ends in ((0, 'exit 0'), (3, 'exit 3'), (137, 'kill -KILL $$')):
        assert subprocess.run([sys.executable, HOME / 'test' / 'limited.py', '60', 'sh', '-c', ends],
                              timeout=60.0).returncode == code
