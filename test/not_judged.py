"""Steps that a drive in realtime lost during a test, and the tests that are therefore not judged.

A graph in realtime keeps its promises if its machine lets its processes run. On a machine that others share, it
counts the steps that it loses. A test that fails while its graph loses steps is skipped with the reason
"not judged: N steps lost". A test that fails without a lost step fails.

A test that itself keeps a drive from its steps has a mark:

    @pytest.mark.excused_by('missed_steps')     excused only by steps that the drive itself began too late, because the
                                                test holds the commands back
    @pytest.mark.excused_by(None)               never excused, because the test holds the drive itself up
"""
import dataclasses
import pathlib
import shutil
import subprocess
import tempfile
import time
import typing
from collections.abc import Callable, Generator, Iterable

import pytest

REASON = 'not judged: '
FAILURE = 'failure that is not judged'
SKIPPED = 'Skipped: '
"""Begin of the text of pytest for each skip."""

LAST_COUNT_TIME_S = 10.0
"""Longest wait for the count of a moment, which the drive publishes each second [s]."""

Count = tuple[int, str, dict[str, int]]
"""(stamp [ns], node, {name of a count: value}) of the diagnostics of a drive."""


def counts_of(array: typing.Any) -> list[Count]:
    """Return the counts in a DiagnosticArray."""
    from pedestal_common.wire import messages
    stamp, found = messages.nanoseconds(array.header.stamp), []
    for status in array.status:
        values = {value.key: int(value.value) for value in status.values
                  if value.key in ('lost_steps', 'missed_steps') and value.value.isdecimal()}
        if values:
            found.append((stamp, status.name, values))
    return found


def lost(counts: Iterable[Count], key: str, since: int) -> int:
    """Return the number of steps lost from a time on [ns], 0 for all. key: name of the count.

    A node that starts again counts from 0. If no count is older than the time, the first one is the beginning.
    """
    total, newest = 0, dict[str, int]()
    for stamp, node, values in counts:
        value = values.get(key, 0)
        before = newest.get(node, value if since else 0)
        if stamp >= since:
            total += value - before if value >= before else value
        newest[node] = value
    return total


@dataclasses.dataclass
class Graph:
    """A graph whose drive counts lost steps.

    runs      function that returns True while the graph runs, or while a client is open that reads its diagnostics
    counts    function of a time [ns] that returns the counts of the graph, up to this time if it still runs
    users     function of a test that returns True if the test uses the graph
    """
    runs: Callable[[], bool]
    counts: Callable[[int], Iterable[Count]]
    users: Callable[[pytest.Function], bool]


class Watch:
    """Plugin of pytest that watches the graphs of a session."""

    def __init__(self) -> None:
        self._graphs: list[Graph] = []
        self._running: list[Graph] = []
        self._fixtures: list[pytest.FixtureDef] = []
        self._item: pytest.Function | None = None
        self._begin = 0

    @pytest.hookimpl(wrapper=True)
    def pytest_fixture_setup(self, fixturedef: pytest.FixtureDef) -> Generator[None, object, object]:
        """Note the fixture that begins."""
        self._fixtures.append(fixturedef)
        try:
            return (yield)
        finally:
            self._fixtures.pop()

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_runtest_setup(self, item: pytest.Function) -> Generator[None, object, object]:
        """Note the test that begins, and the graphs that run."""
        self._item = item
        self._running = [graph for graph in self._graphs if graph.runs()]
        self._begin = time.time_ns()
        return (yield)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_makereport(self, item: pytest.Function, call: pytest.CallInfo) -> Generator[
            None, pytest.TestReport, pytest.TestReport]:
        """Turn the failure of a test whose graph lost steps into a skip."""
        report = yield
        if report.failed and call.when != 'teardown' and call.excinfo and _is_excusable(call.excinfo.value):
            count = self._lost(item, call.when)
            if count:
                _excuse(report, item, count, call.excinfo.value)
        return report

    def add(self, runs: Callable[[], bool], counts: Callable[[int], Iterable[Count]]) -> None:
        """Watch a graph of the fixture that begins, or else of the test that runs. Arguments as of Graph."""
        fixture, test = self._fixtures[-1] if self._fixtures else None, self._item

        def users(item: pytest.Function) -> bool:
            if fixture is None or fixture.scope == 'function':
                return item is test
            return fixture.argname in item.fixturenames and item.nodeid.startswith(fixture.baseid)
        self._graphs.append(Graph(runs, counts, users))

    def _lost(self, item: pytest.Function, when: str) -> int:
        """Return the number of steps that the graphs of a test lost in the test. when: phase of the test.

        The largest number counts, because the recording of a run and its clients count the same steps.
        Of a graph that began or ended in the test, or ended before it, all steps count, because the test judges its
        whole run. So do all steps where a set-up fails, because the failure is that of all tests with the fixture.
        """
        mark = item.get_closest_marker('excused_by')
        key = mark.args[0] if mark else 'lost_steps'
        most = 0
        for graph in self._graphs if key else ():
            if graph.users(item):
                part = when == 'call' and graph in self._running and graph.runs()
                most = max(most, lost(graph.counts(time.time_ns()), key, self._begin if part else 0))
        return most


def recorded(bag: pathlib.Path, process: subprocess.Popen) -> Callable[[int], list[Count]]:
    """Return the function `counts` of a graph that is recorded in a bag."""
    def counts(until: int) -> list[Count]:
        end = time.monotonic() + LAST_COUNT_TIME_S
        while True:
            found = _in_copy(bag)
            if process.poll() is not None or time.monotonic() > end or (found and found[-1][0] > until):
                return found
            time.sleep(0.5)
    return counts


def _in_copy(bag: pathlib.Path) -> list[Count]:
    """Return the counts in a bag so far, of which the recorder may write the next part."""
    from pedestal_common.wire import messages
    from pedestal_recording import bag as bags
    with tempfile.TemporaryDirectory() as folder:
        try:
            shutil.copytree(bag, pathlib.Path(folder, 'bag'))
            diagnostics = list(bags.load(pathlib.Path(folder, 'bag')).raw('diagnostics'))
        except (OSError, shutil.Error, KeyError, bags.BagError):      # nothing is recorded
            return []
    return [count for *_, data in diagnostics
            for count in counts_of(messages.deserialize(data, 'diagnostic_msgs/msg/DiagnosticArray'))]


def _is_excusable(error: BaseException) -> bool:
    """Return True for an error of a test that judges or waits. playwright has a TimeoutError of its own."""
    return (isinstance(error, (AssertionError, pytest.fail.Exception, subprocess.TimeoutExpired))
            or type(error).__name__ == 'TimeoutError')


def _excuse(report: pytest.TestReport, item: pytest.Function, count: int, error: BaseException) -> None:
    """Make the report of a failure that of a skip, and keep the failure as a section of the report."""
    report.sections.append((FAILURE, report.longreprtext))
    summary = (str(error).splitlines() or [''])[0][:100]
    path, line, _ = item.location
    report.outcome = 'skipped'
    report.longrepr = (path, line or 0, f'{SKIPPED}{REASON}{count} steps lost: {type(error).__name__}: {summary}')


def reason(report: pytest.TestReport) -> str:
    """Return the reason for which a test is not judged, '' for another test."""
    if report.skipped and isinstance(report.longrepr, tuple):
        text = report.longrepr[2].removeprefix(SKIPPED)
        return text.removeprefix(REASON) if text.startswith(REASON) else ''
    return ''


def summarize(terminalreporter: pytest.TerminalReporter) -> None:
    """Print the tests of a session that are not judged: the output of each, then the list."""
    reports = [report for report in terminalreporter.stats.get('skipped', ()) if reason(report)]
    if reports:
        terminalreporter.section('not judged')
    for report in reports:
        for title, text in report.sections:
            terminalreporter.line(f'--- {report.nodeid}: {title}\n{text}')
    for report in reports:
        terminalreporter.line(f'{REASON}{report.nodeid}: {reason(report)}')
