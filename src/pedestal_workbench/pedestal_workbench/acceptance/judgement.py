"""Judgement of a requirement: value, uncertainty and verdict."""
from typing import NamedTuple

from pedestal_workbench.acceptance.method import Measured

PASSED, INCONCLUSIVE, FAILED = 1.0, 0.5, 0.0    # verdicts, as in the rows of --json


class Judged(NamedTuple):
    """A judged requirement."""
    value: float            # mean over the repetitions
    uncertainty: float      # half width of the interval at the confidence of the requirement
    verdict: float          # PASSED, INCONCLUSIVE or FAILED
    repetitions: tuple[Measured, ...]
