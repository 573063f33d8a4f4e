"""What holds for every test: it ends processes by signals, none of its phases lasts for ever, and its session leaves
no process behind."""
import faulthandler
import itertools
import os
import signal

import guard
import not_judged
import pytest

# A shell starts a command in the background with SIGINT ignored, and nohup one with SIGHUP ignored. The processes of
# the tests would inherit this. `pedestal` itself keeps ignoring what its parent ignores (pedestal/stop.py): a script
# that starts it with & must not lose it to a Ctrl-C, and ends it by SIGTERM.
for number, handler in ((signal.SIGINT, signal.default_int_handler), (signal.SIGHUP, signal.SIG_DFL)):
    if signal.getsignal(number) is signal.SIG_IGN:
        signal.signal(number, handler)

STDERR = pytest.StashKey()
GUARD = pytest.StashKey()

STATION = ('test/test_live.py', 'test/test_rotctld.py', 'test/test_page.py')
"""The files whose tests share the graph of the fixture station, in their order: the first finds it in standby, and the
last kills a server of it, and ends it."""


def pytest_addoption(parser):
    """The limit of pyproject.toml."""
    parser.addini('phase_timeout', 'seconds after which a set-up, call or tear-down ends the process with its stacks')


def pytest_configure(config):
    """Keep the standard error that is not captured."""
    config.stash[STDERR] = os.dup(2)


def pytest_sessionstart(session):
    """Start the guard of the session. The workers of xdist are among the processes that it kills."""
    if not hasattr(session.config, 'workerinput'):
        session.config.stash[GUARD] = guard.Guard()


def pytest_terminal_summary(terminalreporter, config):
    """Name the tests that are not judged. Kill and name the processes that the tests leave behind: all fixtures and
    workers have ended before."""
    not_judged.summarize(terminalreporter)
    leftovers = config.stash[GUARD].clear()
    if leftovers:
        terminalreporter.section('left behind and killed')
        for process in leftovers:
            terminalreporter.line(process)


def pytest_unconfigure(config):
    """End the guard."""
    if GUARD in config.stash:
        config.stash[GUARD].end()


SWEEP_CASES = 4
"""Number of cases from which a parametrised test is a sweep."""


def _mark_inside_of_sweeps(items):
    """The first and the last case of a sweep are its corners; the others are thorough.

    A test whose cases are different things, such as nodes or files, has the marker `every_case`.
    """
    for _, cases in itertools.groupby(items, lambda item: (item.parent, getattr(item, 'originalname', item.name))):
        cases = list(cases)
        if len(cases) >= SWEEP_CASES and not cases[0].get_closest_marker('every_case'):
            for item in cases[1:-1]:
                item.add_marker(pytest.mark.thorough)


@pytest.hookimpl(tryfirst=True)     # before the tests are chosen by their markers
def pytest_collection_modifyitems(items):
    """The files of STATION come first, in their order."""
    _mark_inside_of_sweeps(items)
    ranks = {file: rank - len(STATION) for rank, file in enumerate(STATION)}
    items.sort(key=lambda item: ranks.get(item.nodeid.partition('::')[0], 0))


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config, log):
    """A worker takes whole files, and those of STATION as one."""
    from xdist.scheduler import LoadFileScheduling

    class Scheduling(LoadFileScheduling):
        def _split_scope(self, nodeid):
            file = super()._split_scope(nodeid)
            return STATION if file in STATION else file

        def remove_node(self, node):
            """Return the test with which a worker crashed, and give the tests after it to other workers. xdist would
            repeat the test in each new worker, and would wait for finished files."""
            files = self.assigned_work[node]
            crashed = next((test for tests in files.values() for test, done in tests.items() if not done), None)
            for file, tests in list(files.items()):
                if crashed in tests:
                    tests[crashed] = True
                if all(tests.values()):
                    del files[file]
            super().remove_node(node)
            return crashed
    return Scheduling(config, log) if config.getvalue('dist') == 'loadfile' else None


def _within_its_limit(item):
    """pytest-timeout guards a test until its first failure only, and interrupts Python code only. This is a thread of
    C: it also ends a tear-down after a failure, and a call that never comes back from a library. xdist names the test
    and goes on in a new process."""
    faulthandler.dump_traceback_later(float(item.config.getini('phase_timeout')), exit=True,
                                      file=item.config.stash[STDERR])
    try:
        return (yield)
    finally:
        faulthandler.cancel_dump_traceback_later()


pytest_runtest_setup = pytest_runtest_call = pytest_runtest_teardown = pytest.hookimpl(wrapper=True, tryfirst=True)(
    _within_its_limit)


@pytest.fixture
def pedestal(capsys, monkeypatch, tmp_path):
    """pedestal(*arguments) -> (exit code, what it printed, what it complained), in this process and in tmp_path."""
    from pedestal import cli
    monkeypatch.setattr(signal, 'signal', lambda *_: None)
    monkeypatch.chdir(tmp_path)

    def call(*arguments):
        code = cli.main(list(map(str, arguments)))
        said = capsys.readouterr()
        return code, said.out, said.err
    return call
