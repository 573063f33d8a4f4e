"""`pedestal.trials` of the Python library: many runs of a scenario with varied parameters, and their results."""
from __future__ import annotations

import pathlib
import tempfile
from collections.abc import Iterator, Mapping

import numpy as np

from pedestal.scenario import Scenario
from pedestal_common.quantities import Floats, Ints, Row
from pedestal_workbench.trials import comparison, monte_carlo, statistics
from pedestal_workbench.trials.experiment import Experiment, Found, Side
from pedestal_workbench.trials.plan import plan


def trials(scenario: Scenario, runs: int = 100, vary: Mapping[str, str] | None = None, *, sobol: bool = False,
           workers: int | None = None, folder: str | pathlib.Path | None = None) -> Trials:
    """Run trials of a scenario, each with its own seed.

    runs      number of trials
    vary      {'node.key': distribution}: uniform(low, high), normal(mean, sigma) or choice(a, b, ...); an x after the
              distribution multiplies the value of the scenario by the drawn number
    sobol     True to take the drawn numbers from a Sobol sequence, whose points fill the ranges evenly, instead of
              independent random numbers
    workers   number of processes, None for one per core
    folder    folder in which the table of the trials is kept; a second call with the same folder continues a stopped
              call. None: the table is not kept

    Raises ValueError for a wrong argument, before the first trial.

    >>> scenario = pedestal.load('leo_pass', duration=4.0)
    >>> made = pedestal.trials(scenario, 3, {'adu.azimuth.load.inertia': 'normal(1, 0.1)x'}, workers=1)
    >>> made['pointing_rms_deg'].shape, made.parameters['adu.azimuth.load.inertia'].shape
    ((3,), (3,))
    """
    made = plan(scenario.variant, runs, [f'{name}={text}' for name, text in (vary or {}).items()], sobol)
    with tempfile.TemporaryDirectory() as temporary, monte_carlo.Pool(workers) as pool:
        return Trials(Experiment([Side(made)], folder or temporary).run(pool))


class Trials(Mapping[str, Floats]):
    """Finished trials as a mapping {name of a result: its values (runs,)}, NaN for a trial without this result."""

    def __init__(self, found: Found) -> None:
        self._plan, self._table = found.plan, found.table

    def __getitem__(self, result: str) -> Floats:
        if result not in self._table.measured_results:
            raise KeyError(f'no trial has {result!r}; must be one of {", ".join(self._table.measured_results)}')
        return self._table.column(result)

    def __iter__(self) -> Iterator[str]:
        return iter(self._table.measured_results)

    def __len__(self) -> int:
        return len(self._table.measured_results)

    @property
    def seeds(self) -> Ints:
        """Seeds (runs,) of the trials."""
        return self._table.column('seed').astype(int)

    @property
    def parameters(self) -> dict[str, Floats]:
        """Varied parameters {'node.key': values (runs,)}. A parameter with texts has the numbers 0, 1, ... of its
        texts, in the order of their first trial."""
        return {name: self._table.column(name) for name in self._table.varied}

    @property
    def units(self) -> dict[str, str]:
        """Units {result: unit}."""
        return {name: statistics.unit(name) for name in self}

    def summary(self) -> list[Row]:
        """Return the rows of `pedestal trials --json`: percentiles, rates and sensitivities with their intervals.

        >>> rows = pedestal.trials(pedestal.load('leo_pass', duration=4.0), 2, workers=1).summary()
        >>> {row['metric']: row['value'] for row in rows}['tracked/rate']
        100.0
        """
        return statistics.of_all(self._plan.name, self._table)

    def worst(self, by: str = 'pointing_rms_deg', count: int = 10) -> list[str]:
        """Return the `pedestal run` commands that repeat the worst trials with separate nodes, the worst first.

        by: name of the result that ranks the trials; count: largest number of commands.

        >>> pedestal.trials(pedestal.load('leo_pass', duration=4.0, seed=7), 1, workers=1).worst()
        ['pedestal run leo_pass --seed 7 --duration 4.0']
        """
        places = statistics.ranking(by, self[by])[:count].tolist()
        return [self._plan.command(place) for place in places]

    def against(self, other: Trials, by: str = 'pointing_rms_deg') -> str:
        """Return a sentence that compares a result of these trials with that of other trials. Trial i of both has the
        same seed, so the comparison is made in pairs. Raises ValueError for different seeds."""
        if not np.array_equal(self.seeds, other.seeds):
            raise ValueError('the trials have different seeds and cannot be paired')
        name, other_name = comparison.names(self._plan, other._plan)
        return comparison.unchanged(self._plan, other._plan) or comparison.sentence(
            comparison.Sides(name, other_name, self._table, other._table), by)
