"""Runs of the Python library: `pedestal.run` runs a scenario in memory, `pedestal.read_bag` reads a recording. Both
return a Run."""
from __future__ import annotations

import functools
import pathlib
import typing
from collections.abc import Callable, Iterator, Mapping

import numpy as np

from pedestal.scenario import Scenario
from pedestal_bringup.loop import memory_recording
from pedestal_common.graph import layouts
from pedestal_common.parameters import did_you_mean
from pedestal_recording import bag as bags
from pedestal_results import results, tracking
from pedestal_results.recorded_run import RecordedRun
from pedestal_results.report import run_figures

if typing.TYPE_CHECKING:
    import pandas
    from matplotlib.axes import Axes

class Panel(typing.NamedTuple):
    """A figure that Run.plot draws."""
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

POINTING_UNITS = {'t': 's', 'cross_elevation': 'rad', 'elevation': 'rad', 'range': 'm'}


class Table(Mapping[str, np.ndarray]):
    """Named arrays of equal length, {column: array (n,)}, with a row for each message. units: {column: unit}, '' for
    none. Column 't' is the time of the measurement [s]."""

    def __init__(self, arrays: Mapping[str, np.ndarray], units: Mapping[str, str]) -> None:
        self._arrays, self.units = dict(arrays), dict(units)

    def __getitem__(self, column: str) -> np.ndarray:
        return self._arrays[column]

    def __iter__(self) -> Iterator[str]:
        return iter(self._arrays)

    def __len__(self) -> int:
        return len(self._arrays)

    def to_pandas(self) -> pandas.DataFrame:
        """Return the table as a pandas.DataFrame. Its `attrs` hold the units. Needs pandas."""
        import pandas
        frame = pandas.DataFrame(self._arrays)
        frame.attrs.update(self.units)
        return frame

    def __repr__(self) -> str:
        columns = ', '.join(f'{name} [{self.units[name]}]' if self.units[name] else name for name in self)
        return f'Table({columns})'


class Run:
    """A run: run[topic] is the Table of a topic. name: name of the scenario or of the recording; beam: '' for an
    antenna with a single beam, and for the first beam of a recording."""

    def __init__(self, source: memory_recording.MemoryRecording | bags.Bag, name: str, beam: str = '') -> None:
        self._source, self.name, self.beam = source, name, beam
        self._run = RecordedRun(source)

    @property
    def topics(self) -> tuple[str, ...]:
        """Names of the topics with numbers or texts, which form a table.

        `diagnostics` and `acu/program_track` form none, because their messages differ in length.

        >>> pedestal.run(pedestal.load('leo_pass', duration=1.0)).topics[:3]
        ('clock', 'joint_states', 'adu/truth')
        """
        return tuple(name for name in self._source.topics if name not in ('diagnostics', 'acu/program_track'))

    def __getitem__(self, topic: str) -> Table:
        """Return the Table of a topic. Raises KeyError for a missing topic.

        >>> scenario = pedestal.load('leo_pass', {'acu.commands': '0.5 standby'}, duration=1.0)
        >>> replies = pedestal.run(scenario)['acu/command_result']
        >>> replies['name'].tolist(), replies['values'].tolist()
        (['standby'], ['granted=true; reply=mode is standby'])
        """
        if topic not in self.topics:
            hint = '; pedestal export writes its texts' if topic in self._source.topics else ''
            raise KeyError(f'{topic!r} forms no table of {self.name}{hint}; there are {", ".join(self.topics)}')
        arrays = {name: np.asarray(values) for name, values in self._source.table(topic).items()}
        kind = self._source.topics[topic]
        return Table(arrays, {name: 's' if name == 't' else layouts.unit(topic, kind, name) for name in arrays})

    @property
    def tracking(self) -> tracking.Tracking:
        """Measured and true values at the steps of the drive, from which all results are computed."""
        return self._run.tracking

    @property
    def pointing(self) -> Table:
        """True pointing error at the steps of the drive: target minus beam, in cross-elevation and in elevation.

        range: distance to the target.

        >>> pedestal.run(pedestal.load('leo_pass', duration=1.0)).pointing
        Table(t [s], cross_elevation [rad], elevation [rad], range [m])
        """
        run = self.tracking
        return Table({'t': run.t, 'cross_elevation': run.error[:, 0], 'elevation': run.error[:, 1],
                      'range': run.range}, POINTING_UNITS)

    @functools.cached_property
    def results(self) -> dict[str, float]:
        """Results of the recording as in `pedestal run`, {name: value}; a name ends with its unit.

        >>> round(pedestal.run(pedestal.load('leo_pass', duration=4.0)).results['lock_time_s'], 2)
        1.08
        """
        return {name: float(value) for name, (value, _) in results.measured(self._run.parts).items()}

    @property
    def verdict(self) -> str:
        """Sentence on the run as in `pedestal run`: the share that was tracked, or the reason why not.

        >>> pedestal.run(pedestal.load('leo_pass', {'acu.initial_mode': 'standby'}, duration=1.0)).verdict
        'no target was to be tracked: standby 100 %'
        """
        return self._run.verdict.text

    def plot(self, figure: str, axes: Axes) -> None:
        """Draw a figure of the report on axes of the caller; recording.PANELS lists the figures.

        Raises KeyError for an unknown figure, ValueError for wrong axes or for missing data in the run.

        >>> from matplotlib.figure import Figure
        >>> axes = Figure().subplots()
        >>> pedestal.run(pedestal.load('leo_pass', duration=4.0)).plot('pointing elevation', axes)
        >>> axes.get_ylabel()
        'error [deg]'
        """
        if figure not in PANELS:
            raise KeyError(f'unknown figure {figure!r};{did_you_mean(figure, PANELS)} there are {", ".join(PANELS)}')
        panel = PANELS[figure]
        lack = self._run.lacks(panel.needs)
        if lack:
            raise ValueError(f'{figure}: {lack}')
        if panel.polar != (axes.name == 'polar'):
            raise ValueError(f'{figure}: axes are {axes.name}, must be {"polar" if panel.polar else "rectilinear"}')
        panel.draw(axes, self._run)


def run(scenario: Scenario, beam: str = '') -> Run:
    """Run a scenario in memory. beam: name of a beam of several, '' for the first.

    Two runs of equal scenarios give equal numbers. The lockstep recording of `pedestal run` has the same numbers.
    Raises ValueError for an unknown beam.

    >>> first, second = (pedestal.run(pedestal.load('leo_pass', duration=1.0, seed=2)) for _ in range(2))
    >>> bool((first['joint_states']['azimuth.position'] == second['joint_states']['azimuth.position']).all())
    True
    """
    chosen = beam or scenario.beams[0]
    if chosen not in scenario.beams:
        raise ValueError(f'beam {beam!r}: must be one of {", ".join(scenario.beams)}')
    return Run(memory_recording.record(scenario.checked, chosen), scenario.name, chosen)


def read_bag(path: str | pathlib.Path, beam: str = '') -> Run:
    """Return the Run of a recording, a folder or an .mcap file. beam: name of a beam of several, '' for the first.
    Raises ValueError with one line for an unreadable recording."""
    view = bags.read(path, beam)
    return Run(view, view.metadata.get('scenario', pathlib.Path(path).stem), beam)
