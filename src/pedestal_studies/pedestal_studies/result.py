"""The result of a study, which its function `run` returns and `pedestal study` prints and draws."""
import dataclasses
from collections.abc import Callable
from typing import TypeAlias

from matplotlib.figure import Figure

from pedestal_common.quantities import Row

Drawings: TypeAlias = dict[str, Callable[[], Figure]]   # {name of a figure: function that draws it}
Metrics: TypeAlias = dict[str, tuple[float, str]]       # {metric: (value, unit)}
Item: TypeAlias = tuple[str, int, int]  # of a batch: case, number of the first run, number of runs


@dataclasses.dataclass
class Result:
    """Result of a study."""
    rows: list[Row]
    figures: Drawings
    remarks: list[str] = dataclasses.field(default_factory=list)    # sentences
    shown: list[Row] | None = None  # the printed rows, if all rows are too many for a terminal; None for all rows
