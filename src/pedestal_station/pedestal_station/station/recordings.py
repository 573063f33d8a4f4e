"""Recordings of a night: for each pass a recorder as a child process, and after it the proof, a process of its own
that verifies the bag and writes its report. One proof runs at a time, so that it takes little from the antenna."""
import contextlib
import dataclasses
import itertools
import math
import os
import pathlib
import re
import signal
import sys
import time
from collections.abc import Iterable, Mapping

from pedestal_bringup.graph import pass_recorder
from pedestal_bringup.graph.child import Child
from pedestal_bringup.graph.pass_recorder import log_of
from pedestal_bringup.graph.processes import exit_description
from pedestal_common.quantities import Seconds, Value

STOP_TIMEOUT_S = 20.0  # time that a recorder has to end, before it is killed [s]
PROOF_TIMEOUT_S = 300.0  # longest time of a proof [s]
MAX_STARTS = 5  # largest number of starts of the recorder of a pass
PROOF_NICENESS = 10
REPORT_NAME = 'report.html'  # file of the report in a bag
UNSAFE_PATTERN = re.compile(r'[^\w.+-]+')  # characters of a case that its folder replaces by _


@dataclasses.dataclass
class _Recording:
    """Recording of a pass, with its recorder or with its proof."""
    case: str
    bag: pathlib.Path
    process: Child
    stop: Seconds = math.inf    # monotonic time by which the process must have ended, infinite while it records
    starts: int = 1


class Recordings:
    """Recordings in a folder. parameters: {name: value} of each recorder; arguments: those for ROS 2, such as the
    namespace."""

    def __init__(self, folder: pathlib.Path, parameters: Mapping[str, Value], arguments: Iterable[str] = ()) -> None:
        self._folder, self._parameters, self._arguments = folder.resolve(), parameters, tuple(arguments)
        self._recorders: list[_Recording] = []
        self._unproved: list[tuple[str, pathlib.Path]] = []
        self._proof: _Recording | None = None

    @property
    def busy(self) -> bool:
        """True while a recording or a proof is left."""
        return bool(self._recorders or self._unproved or self._proof)

    def begin(self, case: str) -> pathlib.Path:
        """Start the recorder of a pass in a folder that does not exist yet. Return the folder. Raises OSError."""
        name = UNSAFE_PATTERN.sub('_', case)
        self._folder.mkdir(parents=True, exist_ok=True)
        names = itertools.chain([name], (f'{name}-{k}' for k in itertools.count(2)))
        bag = next(bag for bag in map(self._folder.joinpath, names) if not (bag.exists() or log_of(bag).exists()))
        self._recorders.append(_Recording(case, bag, self._recorder(bag)))
        return bag

    def end(self, case: str) -> None:
        """End the recorder of a pass, so that its bag is complete."""
        for each in self._recorders:
            if each.case == case:
                each.process.send_signal(signal.SIGTERM)
                each.stop = time.monotonic() + STOP_TIMEOUT_S

    def poll(self) -> list[tuple[str, str]]:
        """Start dead recorders again, prove ended recordings, and return [(case, text)] of what has happened."""
        found = [(each.case, text) for each in list(self._recorders) if (text := self._watched(each))]
        proof = self._proof
        if proof and (code := _ended(proof)) is not None:
            self._proof = None
            found.append((proof.case, f'{proof.bag}: {_proved(proof.bag, code)}'))
        if self._unproved and not self._proof:
            case, bag = self._unproved.pop(0)
            try:
                process = pass_recorder.logged_child([sys.executable, '-m', __name__, str(bag)], bag)
                self._proof = _Recording(case, bag, process, time.monotonic() + PROOF_TIMEOUT_S)
            except OSError as error:
                found.append((case, f'{bag}: no report: {error}'))
        return found

    def _watched(self, each: _Recording) -> str:
        """Handle the end of a recorder; return a text about one that has died."""
        code = _ended(each)
        if code is None:
            return ''
        died = f'its recorder {exit_description(code)}'
        if each.stop == math.inf and each.starts < MAX_STARTS:
            each.starts += 1
            with contextlib.suppress(OSError):      # the next look tries again
                each.process = self._recorder(each.bag)
            return f'{died}: starts again'
        self._recorders.remove(each)
        self._unproved.append((each.case, each.bag))
        return '' if each.stop < math.inf else f'{died}: not recorded any more, {log_of(each.bag)}'

    def prove_rest(self) -> None:
        """Prove the bags without a report: those of a station that was killed."""
        known = [bag for _, bag in self._unproved] + [each.bag for each in (*self._recorders, self._proof) if each]
        self._unproved += [(bag.name, bag) for bag in sorted(self._folder.glob('*')) if bag.is_dir()
                           and bag not in known and log_of(bag).exists() and not (bag / REPORT_NAME).exists()]

    def close(self) -> None:
        """End all processes in order, without further proofs."""
        left = [each for each in (*self._recorders, self._proof) if each]
        for each in left:
            each.process.send_signal(signal.SIGTERM)
            each.stop = time.monotonic() + STOP_TIMEOUT_S
        while left := [each for each in left if _ended(each) is None]:
            time.sleep(0.01)

    def _recorder(self, bag: pathlib.Path) -> Child:
        return pass_recorder.start(bag, self._parameters, self._arguments)


def _ended(each: _Recording) -> int | None:
    """Return the exit code of a process, None while it runs; kill one that should have ended."""
    if time.monotonic() > each.stop:
        each.process.kill()
    return each.process.poll()


def _proved(bag: pathlib.Path, code: int) -> str:
    """Return the last line of a proof, by its exit code."""
    with contextlib.suppress(OSError, IndexError):
        if code == 0:
            return log_of(bag).read_text(errors='replace').splitlines()[-1]
    return f'no report: the process {exit_description(code)}, {log_of(bag)}'


def prove(bag: pathlib.Path) -> str:
    """Verify a bag and write its report; return a line on it."""
    from pedestal_recording.bag import load
    from pedestal_recording.verify import verify
    from pedestal_results.report import page
    try:
        check = verify(load(bag))
        problems = [*check.problems, *(f'{topic.name}: {problem}' for topic in check.topics
                                       for problem in topic.problems)]
        return f'{"complete" if check.complete else f"NOT complete: {problems[0]}"}, {page.write(bag).name}'
    except (ValueError, OSError, RuntimeError) as error:
        return f'no report: {error}'


if __name__ == '__main__':
    os.nice(PROOF_NICENESS)
    print(prove(pathlib.Path(sys.argv[1])), flush=True)
