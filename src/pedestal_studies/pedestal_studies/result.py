"""What the studies share: the runs of their cases, and the result that `pedestal study` prints and draws."""
import dataclasses
import functools
import pathlib
from collections.abc import Callable, Collection, Hashable
from typing import TypeAlias, TypeVar

import matplotlib
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from pedestal_bringup.loop.closed_loop import Run
from pedestal_common.quantities import Floats, Row
from pedestal_results.report import figures
from pedestal_workbench.trials import monte_carlo
from pedestal_workbench.trials.monte_carlo import Pool, Progress

Drawings: TypeAlias = dict[str, Callable[[], Figure]]   # {name of a figure: function that draws it}
Metrics: TypeAlias = dict[str, tuple[float, str]]       # {metric: (value, unit)}
Item: TypeAlias = tuple[str, int, int]  # of a batch: case, number of the first run, number of runs

FIRST_SEED = 1  # seed of run 0 of each case

_Case = TypeVar('_Case', bound=Hashable)


def of_cases(measured: Callable[[_Case, int], ArrayLike], cases: Collection[_Case], runs: int, pool: Pool | None,
            progress: Progress, size: int = 5) -> dict[_Case, Floats]:
    """Return {case: array (runs, ...) of measured(case, run)} for runs 0, 1, ... of each case.

    measured: function of a module. pool: None for this process. size: runs that one worker makes at a time.
    """
    return (pool or monte_carlo.Pool(1)).of_cases(functools.partial(_batch, measured), cases, runs, size, progress)


def _batch(measured: Callable[[_Case, int], ArrayLike], item: tuple[_Case, int, int]) -> Floats:
    case, first, count = item
    return np.array([measured(case, run) for run in range(first, first + count)])


def seeds(runs: int) -> str:
    """Return the sentence on the seeds of a study of this many runs."""
    return f'Seeds {FIRST_SEED} to {FIRST_SEED + runs - 1}.'


@dataclasses.dataclass
class Result:
    """Result of a study."""
    rows: list[Row]
    figures: Drawings
    remarks: list[str] = dataclasses.field(default_factory=list)    # sentences
    shown: list[Row] | None = None  # the printed rows, if all rows are too many for a terminal; None for all rows


def legend(figure: Figure) -> Figure:
    """Return the figure with one legend below all panels, where it covers no curve; every label occurs once."""
    handles: dict[str, Artist] = {}
    for axes in figure.axes:
        for handle, label in zip(*axes.get_legend_handles_labels()):
            handles.setdefault(label, handle)
    longest = max(map(len, handles))
    columns = max(1, min(len(handles), int(figure.get_figwidth() / (0.6 + 0.075 * longest))))
    figure.legend(handles.values(), handles.keys(), loc='outside lower center', ncols=columns)
    return figure


def draw_torques(axes: Axes, record: Run) -> None:
    """Draw the torque [Nm] of both azimuth motors of a run over time."""
    for i, (colour, style) in enumerate(((figures.MOTOR_1_COLOUR, '-'), (figures.MOTOR_2_COLOUR, '--'))):
        axes.plot(record.t, record['adu/motor_states']['effort'][:, i], style, color=colour, label=f'motor {i + 1}')


def save(draw: Callable[[], Figure], *paths: pathlib.Path) -> None:
    """Draw a figure once into files, with the same bytes every time."""
    with matplotlib.rc_context({**figures.MATPLOTLIB_STYLE, 'svg.hashsalt': paths[0].stem}):
        figure = draw()
        figures.tidy(figure)
        for path in paths:
            figures.store(figure, path)
