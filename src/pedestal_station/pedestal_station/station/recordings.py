"""Recordings of a night: for each pass a recorder as a child process, and after it the process of its proof."""
import itertools
import json
import pathlib
import re
import signal
import sys
import time
from collections.abc import Iterable, Mapping
from typing import NamedTuple

from pedestal_bringup.graph.child import Child
from pedestal_bringup.graph.processes import exit_description
from pedestal_common.node import run
from pedestal_common.quantities import Seconds, Value

STOP_TIMEOUT_S = 20.0  # time that a recorder has to end, before it is killed [s]
MAX_STARTS = 5  # largest number of starts of the recorder of a pass
REPORT_NAME = 'report.html'  # file of the report in a bag
UNSAFE_PATTERN = re.compile(r'[^\w.+-]+')  # characters of a case that its folder replaces by _


class _Recording(NamedTuple):
    """Recording of a pass."""
    case: str
    bag: pathlib.Path
    process: Child
    starts: int
    stop: Seconds | None = None     # monotonic time by which the recorder must have ended, None while it records


class Recordings:
    """Recordings in a folder. parameters: {name: value} of each recorder; arguments: for ROS 2, as the namespace."""

    def __init__(self, folder: pathlib.Path, parameters: Mapping[str, Value], arguments: Iterable[str] = ()) -> None:
        self._folder, self._parameters, self._arguments = folder.resolve(), parameters, tuple(arguments)
        self._recorders: list[_Recording] = []
        self._proofs: list[_Recording] = []

    @property
    def busy(self) -> bool:
        """True while a process runs."""
        return bool(self._recorders or self._proofs)

    def begin(self, case: str) -> pathlib.Path:
        """Start the recorder of a pass in a folder that does not exist yet. Return the folder. Raises OSError."""
        name = UNSAFE_PATTERN.sub('_', case)
        self._folder.mkdir(parents=True, exist_ok=True)
        bag = next(bag for bag in (self._folder / f'{name}{suffix}' for suffix in
                                   itertools.chain([''], (f'-{k}' for k in itertools.count(2))))
                   if not (bag.exists() or self._log(bag).exists()))
        self._recorders.append(_Recording(case, bag, self._recorder(bag), 1))
        return bag

    def end(self, case: str) -> None:
        """Let the recorder of a pass end in order."""
        self._recorders = [self._stopped(each) if each.case == case else each for each in self._recorders]

    def poll(self) -> list[tuple[str, str]]:
        """Start dead recorders again, prove ended recordings, and return [(case, text)] of each finished proof."""
        reports: list[tuple[str, str]] = []
        for each in list(self._recorders):
            code = each.process.poll()
            if code is None:
                if each.stop is not None and time.monotonic() > each.stop:
                    each.process.kill()
                continue
            self._recorders.remove(each)
            if each.stop is not None:
                self._prove(each.case, each.bag)
            elif each.starts < MAX_STARTS:
                self._recorders.append(each._replace(process=self._recorder(each.bag), starts=each.starts + 1))
                reports.append((each.case, f'its recorder {exit_description(code)}: started again'))
            else:
                reports.append((each.case, f'its recorder {exit_description(code)}: not recorded any more, '
                                           f'{self._log(each.bag)}'))
        for each in list(self._proofs):
            if (code := each.process.poll()) is not None:
                self._proofs.remove(each)
                reports.append((each.case, self._proved(each.bag, code)))
        return reports

    def prove_rest(self) -> None:
        """Prove the bags without a report: those of a station that was killed."""
        known = [each.bag for each in (*self._recorders, *self._proofs)]
        for bag in sorted(path for path in self._folder.glob('*') if path.is_dir() and path not in known):
            if self._log(bag).exists() and not (bag / REPORT_NAME).exists():
                self._prove(bag.name, bag)

    def _prove(self, case: str, bag: pathlib.Path) -> None:
        command = [sys.executable, '-m', 'pedestal_station.station.proof', str(bag)]
        self._proofs.append(_Recording(case, bag, self._child(command, bag), 1))

    def close(self) -> None:
        """End all processes in order, without further proofs."""
        self._recorders = [self._stopped(each) for each in self._recorders]
        for each in (*self._recorders, *self._proofs):
            each.process.send_signal(signal.SIGTERM)
        end = time.monotonic() + STOP_TIMEOUT_S
        while self._recorders or self._proofs:
            for running in (self._recorders, self._proofs):
                running[:] = [each for each in running if each.process.poll() is None]
                if time.monotonic() > end:
                    for each in running:
                        each.process.kill()
            time.sleep(0.01)

    def _stopped(self, each: _Recording) -> _Recording:
        each.process.send_signal(signal.SIGTERM)
        return each._replace(stop=time.monotonic() + STOP_TIMEOUT_S)

    def _recorder(self, bag: pathlib.Path) -> Child:
        values = [f'{name}:={value}' for name, value in {'bag': bag, **self._parameters}.items()]
        return self._child(run.command('pass_recorder_node', *(self._arguments or ('--ros-args',)),
                                       *(word for value in values for word in ('-p', value))), bag)

    def _child(self, command: list[str], bag: pathlib.Path) -> Child:
        with open(self._log(bag), 'ab') as output:
            process = Child(command, output.fileno(), None)
        process.begin()
        return process

    @staticmethod
    def _log(bag: pathlib.Path) -> pathlib.Path:
        return bag.with_name(bag.name + '.log')

    def _proved(self, bag: pathlib.Path, code: int) -> str:
        for line in reversed(self._log(bag).read_text(errors='replace').splitlines()):
            if line.startswith('{"complete"'):
                return str(json.loads(line)['text'])
        return f'{bag}: no report: the process {exit_description(code)}, {self._log(bag)}'
