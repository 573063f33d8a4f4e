"""Sequence of an acceptance: each requirement is performed, measured, judged and kept, in the order of the file."""
from typing import NamedTuple

from pedestal_workbench.acceptance.judgement import Judged


class Kept(NamedTuple):
    """Result of a requirement, as the folder of the acceptance keeps it."""
    name: str                               # of the requirement
    judged: Judged
    bags: tuple[tuple[str, str], ...]       # (path in the folder, sha256), one for each repetition on nodes
    begun: str                              # UTC
    session: int                            # number of the run of the verb that measured it, from 1 on
