"""Sequence of an acceptance: each requirement is performed, measured, judged and kept, in the order of the file."""
import datetime
import pathlib
from collections.abc import Callable
from typing import NamedTuple

from pedestal_workbench.acceptance import figure
from pedestal_workbench.acceptance.exercise import Performer
from pedestal_workbench.acceptance.judgement import Judged, judged
from pedestal_workbench.acceptance.specification import Specification


class Kept(NamedTuple):
    """Result of a requirement, as the folder of the acceptance keeps it."""
    name: str                               # of the requirement
    judged: Judged
    bags: tuple[tuple[str, str], ...]       # (path in the folder, sha256), one for each repetition on nodes
    begun: str                              # UTC
    session: int                            # number of the run of the verb that measured it, from 1 on


def run(specification: Specification, performer: Performer, folder: pathlib.Path, seed: int,
        report: Callable[[Kept], None]) -> list[Kept]:
    """Perform all requirements."""
    results = []
    for requirement in specification.requirements:
        begun, measured, reason = f'{datetime.datetime.now(datetime.timezone.utc):%Y-%m-%dT%H:%M:%SZ}', [], ''
        for i in range(requirement.repetitions):
            performed = performer.perform(f'{requirement.name}-{i + 1}', requirement.exercise(performer.antenna),
                                          seed + i)
            if i == 0:
                figure.keep_signal(performed, folder / 'signals' / f'{requirement.name}.csv')
            try:
                measured.append(requirement.method.measure(performed, requirement.arguments))
            except ValueError as error:
                reason = str(error)
        results.append(Kept(requirement.name, judged(requirement, measured, reason), (), begun, 1))
        report(results[-1])
    return results
