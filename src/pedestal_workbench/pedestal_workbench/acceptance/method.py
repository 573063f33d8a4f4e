"""Method of acceptance: what a row of the table of methods states."""
import math
from collections.abc import Callable, Mapping
from typing import NamedTuple, TypeAlias

import numpy as np

from pedestal_common.quantities import Floats
from pedestal_common.wire.commands import Argument
from pedestal_results.intervals import half_width, pseudo_values
from pedestal_workbench.acceptance.exercise import Antenna, Exercise, Performed

Arguments: TypeAlias = Mapping[str, float | str]    # of a method, by name; angles in degrees


class Measured(NamedTuple):
    """Result of one exercise."""
    value: float
    uncertainty: float      # half width of its interval of 95 % from this exercise alone, 0 if not known

    def widened(self, half: float) -> 'Measured':
        """Return the result with an independent uncertainty in addition."""
        return self._replace(uncertainty=math.hypot(self.uncertainty, half))


def of_parts(parts: list[Floats], statistic: Callable[[Floats], float],
             growth: Callable[[Floats], float] = lambda _: 1.0) -> Measured:
    """Return a statistic of the joined parts, with the jackknife over them. growth: factor on the half width, from the
    pseudo-values."""
    def joined(kept: list[Floats]) -> float:
        return float(statistic(np.concatenate(kept)))
    values = pseudo_values(parts, joined)
    return Measured(joined(parts), half_width(values) * growth(values))


NEVER = Measured(math.inf, 0.0)     # time until an event that does not come


class Method(NamedTuple):
    """Row of methods.METHODS: a method of acceptance."""
    name: str
    doc: str                            # what it excites and what it measures, in one sentence
    unit: str                           # of the measured value
    better: str                         # word of a limit that makes sense: '<=', '>=' or '+-'
    arguments: tuple[Argument, ...]
    exercise: Callable[[Antenna, Arguments], Exercise]      # raises ValueError for what the antenna cannot do
    measure: Callable[[Performed, Arguments], Measured]     # raises ValueError for a recording that cannot be judged
