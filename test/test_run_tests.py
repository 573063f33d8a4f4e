"""What fails beside other tests runs once more, alone; a test that then passes is named as unsteady."""
import pathlib
import shutil
import subprocess
import sys

import pytest
from shared import PATIENCE

HOME = pathlib.Path(__file__).parents[1]

TIMES = """
import os
import pathlib

def times(name):
    "Count the calls of a name over all runs."
    with open(name, 'a') as file:
        file.write('.')
    return len(pathlib.Path(name).read_text())
"""


@pytest.fixture
def run(tmp_path):
    """run({file: content}, *options) -> CompletedProcess of run_tests.py with two workers."""
    for module in ('conftest.py', 'test/guard.py', 'test/not_judged.py'):
        shutil.copy(HOME / module, tmp_path)

    def start(files, *options):
        (tmp_path / 'pytest.ini').write_text('[pytest]\nphase_timeout = 100\naddopts = --import-mode=importlib\n'
                                             'pythonpath = .\n')
        for name, content in files.items():
            (tmp_path / name).write_text(TIMES + content)
        return subprocess.run(
            [sys.executable, HOME / 'test' / 'run_tests.py', '--numprocesses', '2', '--dist', 'loadfile', *options],
            cwd=tmp_path, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=PATIENCE)
    return start


PASSES = 'def test_passes(): assert times("passes") == 1\n'
FAILS = 'def test_fails(): assert times("fails") > 9\n'
UNSTEADY = 'def test_first():\n    print("the load is", times("unsteady"))\n    assert times("unsteady") > 2\n'
CRASHES = 'def test_crashes():\n    if times("crashes") <= {}: os._exit(3)\n'


@pytest.mark.thorough
def test_a_run_without_failure_is_not_repeated(run):
    done = run({'test_a.py': PASSES, 'test_b.py': PASSES.replace('"passes"', '"other"')})
    assert done.returncode == 0 and done.stdout.count('2 passed') == 1 and 'alone' not in done.stdout, done.stdout


@pytest.mark.thorough
def test_an_unsteady_test_is_named_with_both_outputs_and_one_that_fails_twice_fails(run):
    done = run({'test_a.py': FAILS + UNSTEADY, 'test_b.py': PASSES})
    assert done.returncode == 1 and 'unsteady: test_a.py::test_fails' not in done.stdout, done.stdout
    beside, alone = done.stdout.partition('\nunsteady: test_a.py::test_first\n')[2].split('--- alone\n')
    assert 'assert 2 > 2' in beside and 'the load is 1' in beside and '[call: failed]' in beside
    assert 'the load is 3' in alone and '[call: passed]' in alone
    assert '2 failed, 0 not judged, 0 not reached: these tests run once more, alone' in done.stdout


@pytest.mark.thorough
def test_only_named_files_and_what_failed_in_them_run(run):
    """An option with a value is no file."""
    files = {'test_a.py': FAILS + PASSES, 'test_b.py': PASSES, 'test_c.py': FAILS}
    done = run(files, '--ignore', 'test_c.py', '-k', 'fails', 'test_a.py')
    assert done.returncode == 1 and done.stdout.count('= 1 failed in') == 2, done.stdout


@pytest.mark.thorough
def test_a_failed_set_up_and_tear_down_run_once_more(run):
    content = """
import pytest

@pytest.fixture
def before(): assert times('before') == 2

@pytest.fixture
def after():
    yield
    assert times('after') == 2

def test_before(before): pass
def test_after(after): pass
"""
    done = run({'test_a.py': content})
    assert done.returncode == 0, done.stdout
    assert 'unsteady: test_a.py::test_before' in done.stdout and 'unsteady: test_a.py::test_after' in done.stdout
    assert '[teardown: failed]' in done.stdout


@pytest.mark.thorough
def test_a_parameter_may_hold_any_text(run):
    content = 'import pytest\n@pytest.mark.parametrize("x", ["a::b", "[/c d]"])\n' + (
        'def test_a(x): assert times(str(ord(x[0]))) > 1\n')
    done = run({'test_a.py': content})
    assert done.returncode == 0 and done.stdout.count('\nunsteady: ') == 2, done.stdout


UNJUDGED = """
import pytest

def test_{0}():
    reason = 'not judged: 7 steps lost'
    outcome = {1}[times('{0}') - 1]
    pytest.skip(reason) if outcome == 'skip' else print(outcome)
    assert outcome == 'pass'
"""


@pytest.mark.thorough
@pytest.mark.parametrize('first, second, code, said', [
    ('skip', 'pass', 0, 'unsteady: test_a.py::test_a\n'),
    ('skip', 'skip', 0, 'not judged: test_a.py::test_a: 7 steps lost\n'),
    ('skip', 'fail', 1, 'FAILED test_a.py::test_a'),
    ('fail', 'skip', 1, 'failed beside other tests, and not judged alone: test_a.py::test_a\n')])
def test_what_is_not_judged_runs_once_more(run, first, second, code, said):
    done = run({'test_a.py': UNJUDGED.format('a', [first, second])})
    assert done.returncode == code and said in done.stdout.partition('once more, alone')[2], done.stdout


@pytest.mark.parametrize('restarts, not_reached', [(3, 0), (0, 1)])
def test_a_crash_costs_no_other_test(run, restarts, not_reached):
    """Also where xdist replaces no worker: the second run reaches the tests that the first did not."""
    done = run({'test_a.py': 'def test_before(): pass\n' + CRASHES.format(1) + PASSES},
               '--max-worker-restart', str(restarts))
    assert done.returncode == 0 and f'1 failed, 0 not judged, {not_reached} not reached' in done.stdout, done.stdout
    assert "crashed while running 'test_a.py::test_crashes'" in done.stdout.partition('unsteady: ')[2]
    assert 'unsteady: test_a.py::test_passes' not in done.stdout


@pytest.mark.thorough
def test_a_test_that_always_crashes_fails_and_the_others_run(run, tmp_path):
    done = run({'test_a.py': PASSES + CRASHES.format(99) + UNSTEADY + FAILS}, '--max-worker-restart', '3')
    assert done.returncode == 1 and 'unsteady: test_a.py::test_first' in done.stdout, done.stdout
    assert len((tmp_path / 'crashes').read_text()) == 2 and len((tmp_path / 'fails').read_text()) == 2


@pytest.mark.thorough
def test_a_file_that_cannot_be_imported_fails(run):
    done = run({'test_a.py': 'import no_such_module\n', 'test_b.py': PASSES})
    assert done.returncode not in (0, 5) and 'no_such_module' in done.stdout, done.stdout


@pytest.mark.thorough
@pytest.mark.parametrize('options, code', [(('-k', 'nothing'), 5), (('--no-such-option',), 4)])
def test_the_exit_code_without_a_failure_is_that_of_the_first_run(run, options, code):
    assert run({'test_a.py': PASSES}, *options).returncode == code


@pytest.mark.thorough
def test_a_second_run_without_the_test_is_no_success(run):
    """As of a test whose name changes from run to run."""
    content = 'import pytest\n@pytest.mark.parametrize("x", [times("name")])\ndef test_a(x): assert False\n'
    done = run({'test_a.py': content}, '-n0')
    assert done.returncode != 0, done.stdout


def test_a_run_that_stops_at_a_failure_is_red_even_if_the_failure_is_unsteady(run):
    done = run({'test_a.py': UNSTEADY, 'test_b.py': FAILS}, '-x', '--numprocesses', '0')
    assert done.returncode == 1 and 'alone' not in done.stdout, done.stdout


@pytest.mark.thorough
def test_a_test_that_is_skipped_alone_has_not_passed(run):
    skips = 'import pytest\ndef test_skips():\n    if times("skips") == 1: assert False\n    pytest.skip("alone")\n'
    done = run({'test_a.py': skips})
    assert done.returncode == 1 and 'did not run alone: test_a.py::test_skips' in done.stdout, done.stdout


@pytest.mark.thorough
def test_a_name_of_a_test_may_contain_slashes(run):
    unsteady = ('import pytest\n@pytest.mark.parametrize("url", ["http://a//b"])\ndef test_url(url):\n'
                '    assert times("url") > 1\n')
    done = run({'test_a.py': unsteady})
    assert done.returncode == 0 and 'unsteady: test_a.py::test_url[http://a//b]' in done.stdout, done.stdout
