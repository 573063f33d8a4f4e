"""Runs: what was said on every topic, as named arrays, from memory or from a recording."""
from __future__ import annotations

import functools
import pathlib
import typing
from collections.abc import Iterator, Mapping

import numpy as np

from pedestal.panels import draw
from pedestal.scenario import Scenario
from pedestal_analysis.report import run_data
from pedestal_analysis.results import results, tracking
from pedestal_bringup.loop import memory_recording
from pedestal_common.graph import layouts
from pedestal_recording import bag as bags

if typing.TYPE_CHECKING:
    from matplotlib.axes import Axes

POINTING_COLUMNS = {'t': ('t', 's'), 'cross_elevation': ('cross_elevation', 'rad'), 'elevation': ('elevation_error',
                                                                                                  'rad'),
                    'range': ('range', 'm')}
"""{column: (field of tracking.Tracking, unit)} of Run.pointing."""


class Table(Mapping[str, np.ndarray]):
    """Named arrays of equal length, a row each message: {column: array (n,)}; units {column: unit}, '' for none.

    't' [s] is when it was measured.
    """

    def __init__(self, arrays: Mapping[str, np.ndarray], units: Mapping[str, str]) -> None:
        self._arrays, self.units = dict(arrays), dict(units)

    def __getitem__(self, column: str) -> np.ndarray:
        return self._arrays[column]

    def __iter__(self) -> Iterator[str]:
        return iter(self._arrays)

    def __len__(self) -> int:
        return len(self._arrays)

    def __repr__(self) -> str:
        columns = ', '.join(f'{name} [{self.units[name]}]' if self.units[name] else name for name in self)
        return f'Table({columns})'


class Run:
    """A run: run[topic] is the Table of a topic.

    name: of the scenario or the recording; beam: of several, else ''.
    """

    def __init__(self, source: memory_recording.MemoryRecording | bags.Bag, name: str, beam: str = '') -> None:
        self._source, self.name, self.beam = source, name, beam

    @property
    def topics(self) -> tuple[str, ...]:
        """Names of the topics that have numbers or texts.

        >>> pedestal.run(pedestal.load('leo_pass', duration=1.0)).topics[:3]
        ('clock', 'joint_states', 'adu/truth')
        """
        return tuple(name for name in self._source.topics if name not in ('diagnostics', 'acu/program_track'))

    def __getitem__(self, topic: str) -> Table:
        """The Table of a topic. Raises KeyError for one that is not there."""
        if topic not in self.topics:
            raise KeyError(f'{topic!r} is not in {self.name}; there are {", ".join(self.topics)}')
        arrays = {name: np.asarray(values) for name, values in self._source.table(topic).items()}
        kind = self._source.topics[topic]
        return Table(arrays, {name: 's' if name == 't' else layouts.unit(topic, kind, name) for name in arrays})

    @functools.cached_property
    def tracking(self) -> tracking.Tracking:
        """The run against the truth on the drive's steps, as every result is measured on it."""
        return tracking.read(self._source)

    @property
    def pointing(self) -> Table:
        """True pointing error on the drive's steps: cross_elevation, elevation [rad], the target off the beam.

        >>> pedestal.run(pedestal.load('leo_pass', duration=1.0)).pointing
        Table(t [s], cross_elevation [rad], elevation [rad], range [m])
        """
        return Table({name: np.asarray(getattr(self.tracking, field)) for name,
                      (field, _) in POINTING_COLUMNS.items()},
                     {name: unit for name, (_, unit) in POINTING_COLUMNS.items()})

    @functools.cached_property
    def results(self) -> dict[str, float]:
        """{name: value} of the results that `pedestal run` prints of the recording; the unit is the end of a name.

        >>> round(pedestal.run(pedestal.load('leo_pass', duration=4.0)).results['lock_time_s'], 2)
        1.08
        """
        return {name: float(value) for name, (value, _) in results.measured(results.of_bag(self._source)).items()}

    def plot(self, figure: str, axes: Axes) -> None:
        """Draw one of the report's figures on axes of the caller's; panels.PANELS says which there are.

        Raises KeyError for an unknown one, ValueError where the run lacks what it shows.

        >>> from matplotlib.figure import Figure
        >>> axes = Figure().subplots()
        >>> pedestal.run(pedestal.load('leo_pass', duration=4.0)).plot('pointing elevation', axes)
        >>> axes.get_ylabel()
        'error [deg]'
        """
        draw(figure, axes, self._data)

    @functools.cached_property
    def _data(self) -> run_data.RunData:
        return run_data.read(self._source)


def run(scenario: Scenario, beam: str = '') -> Run:
    """Run a scenario in memory; beam: of several, '' for the first.

    Equal scenarios give equal numbers, those of the lockstep recording of `pedestal run`.

    >>> first, second = (pedestal.run(pedestal.load('leo_pass', duration=1.0, seed=2)) for _ in range(2))
    >>> bool((first['joint_states']['azimuth.position'] == second['joint_states']['azimuth.position']).all())
    True
    """
    chosen = beam or scenario.beams[0]
    if chosen not in scenario.beams:
        raise ValueError(f'beam {beam!r}: must be one of {", ".join(scenario.beams)}')
    return Run(memory_recording.record(scenario.checked, chosen), scenario.name, chosen)


def read_bag(path: str | pathlib.Path, beam: str = '') -> Run:
    """The Run of a recording, a folder or an .mcap file; beam: of several, '' for the first.

    Raises ValueError, one line, for what cannot be read.
    """
    view = bags.read(path, beam)
    return Run(view, view.metadata.get('scenario', pathlib.Path(path).stem), beam)
