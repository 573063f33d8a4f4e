"""Method of acceptance: what a row of the table of methods states."""
import math
from collections.abc import Callable, Mapping
from typing import NamedTuple, TypeAlias

from pedestal_common.wire.commands import Argument
from pedestal_workbench.acceptance.exercise import Antenna, Exercise, Performed

Arguments: TypeAlias = Mapping[str, float | str]    # of a method, by name; angles in degrees


class Measured(NamedTuple):
    """Result of one exercise."""
    value: float
    uncertainty: float      # half width of its interval of 95 % from this exercise alone, 0 if not known


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
