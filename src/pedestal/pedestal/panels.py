"""Figures of the report that `Run.plot` of the Python library draws on matplotlib axes of the caller."""
from __future__ import annotations

import functools
import typing
from collections.abc import Callable

from pedestal_common.parameters import did_you_mean
from pedestal_results.recorded_run import RecordedRun
from pedestal_results.report import run_figures

if typing.TYPE_CHECKING:
    from matplotlib.axes import Axes


class Panel(typing.NamedTuple):
    """A figure."""
    draw: Callable[[Axes, RecordedRun], None]
    needs: tuple[str, ...]  # names of the required parts of RecordedRun
    polar: bool = False     # True if the figure needs polar axes


PANELS: dict[str, Panel] = {
    'pointing cross-elevation': Panel(functools.partial(run_figures.draw_pointing, i=0), ('truth',)),
    'pointing elevation': Panel(functools.partial(run_figures.draw_pointing, i=1), ('truth',)),
    'error cross-elevation': Panel(functools.partial(run_figures.draw_errors, i=0), ('truth', 'lock')),
    'error elevation': Panel(functools.partial(run_figures.draw_errors, i=1), ('truth', 'lock')),
    'azimuth': Panel(run_figures.draw_azimuth, ('truth',)),
    'torques azimuth': Panel(functools.partial(run_figures.draw_torques, axis='azimuth'), ('motors',)),
    'torques elevation': Panel(functools.partial(run_figures.draw_torques, axis='elevation'), ('motors',)),
    'carrier': Panel(run_figures.draw_carrier, ('receiver',)),
    'sky': Panel(run_figures.draw_sky, ('truth',), polar=True),
}
"""Figures of Run.plot, {name: Panel}."""


def draw(name: str, axes: Axes, data: RecordedRun) -> None:
    """Draw a panel of PANELS on axes. Raises KeyError, ValueError."""
    if name not in PANELS:
        raise KeyError(f'unknown figure {name!r};{did_you_mean(name, PANELS)} there are {", ".join(PANELS)}')
    panel = PANELS[name]
    lack = data.lacks(panel.needs)
    if lack:
        raise ValueError(f'{name}: {lack}')
    if panel.polar != (axes.name == 'polar'):
        raise ValueError(f'{name}: axes are {axes.name}, must be {"polar" if panel.polar else "rectilinear"}')
    panel.draw(axes, data)
