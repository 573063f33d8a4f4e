"""Run pytest, and run the tests that fail or are not judged (not_judged.py) once more, alone.

    python test/run_tests.py [ARGUMENT OF PYTEST ...]

A test that fails beside other tests and does not fail alone is unsteady. This program prints such a test with the
output of both runs, so that the second run hides no fault. The exit code is that of the last run.

The second run also contains the tests that the first run did not reach, because too many of its workers crashed.
"""
import json
import os
import pathlib
import sys
import tempfile

import not_judged
import pytest

AGAIN = '--again'
"""First argument of the second run; a file of the first run follows."""

ALONE = ('--numprocesses', '1')
"""One test after another. The worker is a process of its own, so that a test that crashes does not end the run."""


class Outcomes:
    """Plugin of pytest that notes the result of each test.

    reports     {test: [(phase, outcome, output)]}
    unjudged    tests that are not judged
    collected   all tests
    options     arguments of pytest without the files to test
    root        folder to which the names of the tests are relative
    """

    def __init__(self) -> None:
        self.reports: dict[str, list[tuple[str, str, str]]] = {}
        self.unjudged: list[str] = []
        self.collected: list[str] = []
        self.options: list[str] = []
        self.root = pathlib.Path()
        self.crashed = False

    def pytest_configure(self, config: pytest.Config) -> None:
        """Note the arguments and the folder."""
        self.root = config.rootpath
        self.options = [argument for argument in config.invocation_params.args
                        if argument not in config.option.file_or_dir]

    @pytest.hookimpl(optionalhook=True)
    def pytest_xdist_node_collection_finished(self, ids: list[str]) -> None:
        """Note the tests, of which each worker has the same."""
        self.collected = ids

    def pytest_collection_finish(self, session: pytest.Session) -> None:
        """Note the tests of a session without workers."""
        self.collected = [item.nodeid for item in session.items] or self.collected

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Note a phase of a test. xdist reports a crash of a worker as a failure without a phase."""
        # xdist adds the name of the worker to a report without a failure.
        failure = report.longreprtext if report.outcome != 'passed' else ''
        if not_judged.reason(report):
            self.unjudged.append(report.nodeid)
        output = '\n'.join([failure, *(f'{title}:\n{text}' for title, text in report.sections)])
        self.reports.setdefault(report.nodeid, []).append((report.when, report.outcome, output.strip()))
        self.crashed |= report.when == '???'

    def pytest_collectreport(self, report: pytest.CollectReport) -> None:
        """Note a file that cannot be imported as if it was a test."""
        if report.failed:
            self.reports[report.nodeid] = [('collect', 'failed', report.longreprtext)]

    def failed(self) -> list[str]:
        """Return the tests with a failure in a phase."""
        return [test for test, phases in self.reports.items() if any(phase[1] == 'failed' for phase in phases)]

    def missing(self) -> list[str]:
        """Return the tests that the run did not reach, because of a crash or of an option such as -x."""
        return [test for test in self.collected if test not in self.reports]


def _text(phases: list[tuple[str, str, str]]) -> str:
    """Return the outcome of each phase of a test with its output."""
    return '\n'.join(f'[{when}: {outcome}]\n{output}' if output else f'[{when}: {outcome}]'
                     for when, outcome, output in phases)


def _first(arguments: list[str]) -> int:
    """Run pytest with arguments. Replace this process by the second run if tests failed or are not judged, otherwise
    return the exit code."""
    outcomes = Outcomes()
    code = pytest.main(arguments, [outcomes])
    failed, unjudged = outcomes.failed(), outcomes.unjudged
    repeated = [*failed, *(test for test in unjudged if test not in failed)]
    missing = outcomes.missing()
    if code not in (pytest.ExitCode.OK, pytest.ExitCode.TESTS_FAILED) or not repeated:
        return int(code)
    if missing and not outcomes.crashed:
        return int(code) or int(pytest.ExitCode.TESTS_FAILED)
    with tempfile.NamedTemporaryFile('w', prefix='first-run-', suffix='.json', delete=False) as file:
        json.dump({test: outcomes.reports.get(test, []) for test in (*repeated, *missing)}, file)
    print(f'\n{len(failed)} failed, {len(unjudged)} not judged, {len(missing)} not reached: these tests run once '
          'more, alone', flush=True)
    # No process is left that waits: a signal to this process ends the second run.
    os.execv(sys.executable, [sys.executable, __file__, AGAIN, file.name, *outcomes.options, *ALONE,
                              *(f'{outcomes.root}/{test}' for test in (*repeated, *missing))])


def _second(path: str, arguments: list[str]) -> int:
    """Run pytest with arguments, print the unsteady tests, and return the exit code. path: file of the first run."""
    with open(path) as file:
        first = json.load(file)
    os.remove(path)
    outcomes = Outcomes()
    code = int(pytest.main(arguments, [outcomes]))
    failed, unjudged = outcomes.failed(), outcomes.unjudged
    for test, phases in first.items():
        if test not in outcomes.reports:
            print(f'not run again: {test}')
            code = code or int(pytest.ExitCode.TESTS_FAILED)
        elif test in unjudged and any(phase[1] == 'failed' for phase in phases):
            print(f'failed beside other tests, and not judged alone: {test}')
            code = code or int(pytest.ExitCode.TESTS_FAILED)
        elif test in failed or test in unjudged:
            pass
        elif not any(when == 'call' and outcome == 'passed' for when, outcome, _ in outcomes.reports[test]):
            print(f'failed beside other tests, and did not run alone: {test}')
            code = code or int(pytest.ExitCode.TESTS_FAILED)
        elif phases:
            print(f'\nunsteady: {test}\n--- beside other tests\n{_text(phases)}\n--- alone\n'
                  f'{_text(outcomes.reports[test])}', flush=True)
    return code


def main(arguments: list[str]) -> int:
    """Return the exit code of a run of pytest with arguments."""
    if arguments[:1] == [AGAIN]:
        return _second(arguments[1], arguments[2:])
    return _first(arguments)


if __name__ == '__main__':
    sys.exit(main(sys.argv[1:]))
