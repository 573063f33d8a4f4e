"""Sequence of an acceptance: each requirement is performed, measured, judged and kept, in the order of the file.

The file results.json in the folder of the acceptance keeps each result as soon as it is known. A sequence that was
interrupted, also by a loss of power, continues there with the first requirement without a result.
"""
import contextlib
import dataclasses
import datetime
import json
import math
import pathlib
from collections.abc import Callable, Sequence
from typing import NamedTuple, TypeAlias

import numpy as np

from pedestal_bringup.graph import pass_recorder
from pedestal_common.quantities import Json
from pedestal_common.text_files import files
from pedestal_recording import bag_files
from pedestal_workbench.acceptance import figure
from pedestal_workbench.acceptance.exercise import BreachError, Exercise, LateError, Performed, Performer, StoppedError
from pedestal_workbench.acceptance.judgement import FAILED, Judged, judged
from pedestal_workbench.acceptance.method import Measured
from pedestal_workbench.acceptance.specification import Requirement, Specification

Planned: TypeAlias = tuple[str, Exercise, int]     # a performance: the arguments of Performer.perform
RESULTS_FILE, LOCK_FILE, SIGNALS_FOLDER = 'results.json', 'results.lock', 'signals'  # in the folder of the acceptance
COMPLETE = 'came to its end'     # end of a session that has performed all requirements
MAX_RESULTS_BYTES = 50_000_000  # largest size of the file of results [bytes]
MAX_RUNS = 5  # of an exercise, whose commands were late in all others
SEED_STEP = 1000  # between the seeds of repetitions, so that sequences with neighbouring seeds share no noise


class Kept(NamedTuple):
    """Result of a requirement, as the folder of the acceptance keeps it."""
    name: str                               # of the requirement
    judged: Judged
    bags: tuple[tuple[str, str], ...]       # (path in the folder, sha256) of the files of its recordings
    begun: str                              # UTC
    session: int                            # number of the run of the verb that measured it, from 1 on


class Session(NamedTuple):
    """Run of the sequence with a folder."""
    begun: str                              # UTC
    parameters: str                         # SHA-256 of those of the antenna
    end: str = 'interrupted'                # COMPLETE, or how it ended


def run(specification: Specification, exercises: Sequence[Exercise], performer: Performer, folder: pathlib.Path,
        seed: int, report: Callable[[Kept], None]) -> list[Kept]:
    """Perform the requirements without a result in the folder, and return all results. Requirements with the same
    exercise share its recordings. exercises: of the requirements, as Specification.exercises returns them; report:
    called with each result, also with those of earlier sessions.

    An alarm, or an antenna outside the envelope, fails the requirement. Because its cause may last, the sequence then
    goes on only with a run of its own for each exercise. The folder keeps how the sequence ended. Raises ValueError
    before anything moves for the folder of another specification, StoppedError if the antenna was stopped.
    """
    folder.mkdir(parents=True, exist_ok=True)
    with open(folder / LOCK_FILE, 'w') as stream:
        files.lock(stream, f'{folder}: another acceptance is using this folder')
        results = _Results(folder, specification, performer.antenna.sha256)
        for kept in results.kept:
            report(kept)
        names = [kept.name for kept in results.kept]
        left = [(requirement, exercise) for requirement, exercise in zip(specification.requirements, exercises)
                if requirement.name not in names]
        planned = _planned(left, seed)
        expected = {each[0]: each for of_one in planned for each in of_one}
        for name in expected:
            pass_recorder.set_aside(folder / name, 'interrupted')
        made: dict[str, Performed | BreachError] = {}
        try:
            performer.expect([*expected.values()])
            for i, (requirement, _) in enumerate(left):
                kept = _result(requirement, planned[i], performer, folder, made, len(results.sessions))
                results.keep(kept)
                report(kept)
                if kept.judged.breached and not performer.own_runs:
                    raise StoppedError(kept.judged.reason)
                later = {name for of_one in planned[i + 1:] for name, *_ in of_one}
                made = {name: each for name, each in made.items() if name in later}     # frees the other recordings
            results.end(COMPLETE)
        except (StoppedError, KeyboardInterrupt) as error:
            results.end(f'stopped: {str(error) or "by an operator"}')
            raise
    return results.kept


def _planned(left: Sequence[tuple[Requirement, Exercise]], seed: int) -> list[list[Planned]]:
    """Return the performances of each requirement. Requirements with equal exercises share them."""
    shared: dict[str, list[Planned]] = {}
    of_each = []
    for requirement, exercise in left:
        found = shared.setdefault(_key(exercise), [])
        found += [(f'{requirement.file_name}-{i + 1}', exercise, seed + SEED_STEP * i)
                  for i in range(len(found), requirement.repetitions)]
        of_each.append(found[:requirement.repetitions])
    return of_each


def _result(requirement: Requirement, planned: Sequence[Planned], performer: Performer, folder: pathlib.Path,
            made: dict[str, Performed | BreachError], session: int) -> Kept:
    """Perform, measure and judge a requirement. made: performances so far, by name; new ones are added."""
    begun, measured, reason, breach = _now(), list[Measured](), '', ''
    bags: list[pathlib.Path | None] = []
    for name, exercise, seed in planned:
        try:
            found = made[name] if name in made else _performed(performer, folder, name, exercise, seed)
        except BreachError as error:
            found = error
        made[name] = found
        if isinstance(found, BreachError):
            bags.append(folder / name)
            breach = str(found)
            break
        if not bags:
            figure.keep_signal(found, folder / SIGNALS_FOLDER / f'{requirement.file_name}.csv')
        bags.append(found.bag)
        try:
            measured.append(requirement.method.measure(found, requirement.arguments))
        except ValueError as error:
            reason = str(error)
    verdict = Judged(math.nan, math.nan, FAILED, tuple(measured), breach) if breach else judged(
        requirement, measured, reason)
    sums = tuple((str(file.relative_to(folder.resolve())), files.sha256(file))
                 for bag in bags if bag and bag.exists() for file in bag_files.locate(bag.resolve()))
    return Kept(requirement.name, verdict, sums, begun, session)


def _performed(performer: Performer, folder: pathlib.Path, name: str, exercise: Exercise, seed: int) -> Performed:
    """Make an exercise, and make it again after one with late commands. Raises StoppedError."""
    for _ in range(MAX_RUNS - 1):
        with contextlib.suppress(LateError):
            return performer.perform(name, exercise, seed)
        pass_recorder.set_aside(folder / name, 'late')
    return performer.perform(name, exercise, seed)


def _key(exercise: Exercise) -> str:
    """Return a text that equal exercises have in common."""
    return json.dumps(dataclasses.asdict(exercise), sort_keys=True, default=np.ndarray.tolist)


class _Results:
    """Results in a folder. Raises ValueError for a broken file, and for that of another specification."""
    kept: list[Kept]
    sessions: list[Session]

    def __init__(self, folder: pathlib.Path, specification: Specification, parameters: str) -> None:
        self._file, self.kept, self.sessions = folder / RESULTS_FILE, [], []
        self._sha256 = specification.sha256
        if self._file.exists():
            self.kept, self.sessions, before = read(folder)
            if before != self._sha256:
                raise ValueError(f'{self._file}: holds results of another specification; choose a new folder')
        self.sessions.append(Session(_now(), parameters))
        self._write()

    def end(self, text: str) -> None:
        """Keep how the session ended."""
        self.sessions[-1] = self.sessions[-1]._replace(end=text)
        self._write()

    def keep(self, kept: Kept) -> None:
        """Add a result, and write the file."""
        self.kept.append(kept)
        self._write()

    def _write(self) -> None:
        results = [{**kept._asdict(), 'judged': kept.judged._asdict()} for kept in self.kept]
        files.replace_text(self._file, json.dumps({'specification_sha256': self._sha256,
                                                   'sessions': self.sessions, 'results': results}, indent=1) + '\n')


def utc_text(at: datetime.datetime) -> str:
    """Return a UTC as text, to the second."""
    return f'{at:%Y-%m-%dT%H:%M:%SZ}'


def _now() -> str:
    return utc_text(datetime.datetime.now(datetime.timezone.utc))


def read(folder: pathlib.Path) -> tuple[list[Kept], list[Session], str]:
    """Return (results, runs of the sequence, SHA-256 of the specification) of a folder. Raises ValueError for a broken
    file."""
    file = folder / RESULTS_FILE
    try:
        content = json.loads(files.read_text(file, MAX_RESULTS_BYTES))
        return (list(map(_kept, content['results'])), [Session(*one) for one in content['sessions']],
                content['specification_sha256'])
    except (ValueError, KeyError, TypeError) as error:
        raise ValueError(f'{file}: is no file of results: {error!r}') from None


def _kept(content: dict[str, Json]) -> Kept:
    found = content['judged']
    repetitions = tuple(Measured(*one) for one in found['repetitions'])
    return Kept(**{**content, 'judged': Judged(**{**found, 'repetitions': repetitions}),
                   'bags': tuple(map(tuple, content['bags']))})
