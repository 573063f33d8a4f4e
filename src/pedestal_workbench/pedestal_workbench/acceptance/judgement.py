"""Judgement of a requirement: value, uncertainty and verdict."""
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.special import ndtri

from pedestal_results import intervals
from pedestal_workbench.acceptance.method import Measured
from pedestal_workbench.acceptance.specification import Requirement

PASSED, INCONCLUSIVE, FAILED = 1.0, 0.5, 0.0    # verdicts, as in the rows of --json


class Judged(NamedTuple):
    """A judged requirement."""
    value: float            # mean over the repetitions; NaN if it could not be measured, infinite for "never"
    uncertainty: float      # half width of the interval at the confidence of the requirement, NaN if not measured
    verdict: float          # PASSED, INCONCLUSIVE or FAILED
    repetitions: tuple[Measured, ...]
    reason: str = ''        # why the value could not be measured

    @property
    def breached(self) -> bool:
        """True if an alarm or an antenna outside its envelope ended an exercise."""
        return self.verdict == FAILED and math.isnan(self.value)


def judged(requirement: Requirement, repetitions: Sequence[Measured], reason: str = '') -> Judged:
    """Return the judgement of the repetitions of a requirement. reason: why one of them could not be measured.

        half width = sqrt((t_(n-1) s / sqrt(n))^2 + (z rms(u_i) / (1.96 sqrt(n)))^2)

        s     standard deviation of the values; this term is 0 for one repetition
        u_i   half width of repetition i from its own exercise, at 95 %, independent of the other repetitions
        z     quantile of the normal distribution for the confidence, 1.96 for 95 %

    The verdict is "passed" if the whole interval meets the limit, "failed" if none of it does. It is inconclusive if
    the limit is inside the interval, or if a repetition could not be measured.
    """
    values, own = np.array(repetitions, float).reshape(-1, 2).T
    value = float(np.mean(values)) if len(values) and not reason else math.nan
    half = 0.0
    if math.isfinite(value):
        mean, _, high = intervals.interval(values, requirement.confidence)
        levels = np.array([requirement.confidence, intervals.CONFIDENCE_LEVEL])
        z, z_95 = ndtri(0.5 * (1.0 + levels))
        half = math.hypot(high - mean if len(values) > 1 else 0.0, z / z_95 * math.hypot(*own) / len(own))
    if math.isnan(value) or math.isnan(half):
        return Judged(math.nan, math.nan, INCONCLUSIVE, tuple(repetitions), reason or 'no number for its uncertainty')
    meets, interval = requirement.limit.meets, (value - half, value + half)
    # Of the values in the interval, the middle of the range, or an end of the interval, meets the limit best.
    best = min(max(0.5 * sum(requirement.limit.ends), interval[0]), interval[1])
    verdict = PASSED if all(map(meets, interval)) else INCONCLUSIVE if meets(best) else FAILED
    return Judged(value, half, verdict, tuple(repetitions))
