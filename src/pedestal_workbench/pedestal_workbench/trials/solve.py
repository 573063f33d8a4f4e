"""Search for the value of a parameter at which the mean of a result over trials reaches a limit: `pedestal trials
--solve PARAMETER --until 'RESULT = LIMIT'`.

First the trials run at GRID_COUNT values that fill the range of the parameter. If the limit lies between the means at
exactly one pair of neighbouring values, the search bisects this pair. Because a drive that trips has no result, it may
hide the limit. A search without such a pair therefore bisects between the values with a result and their neighbours
without a result.

The trials at all values have equal seeds and draws. Therefore the mean is a smooth function of the value, except where
the control law itself has a jump.
"""
import contextlib
import itertools
import math
import pathlib
from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple

import numpy as np

from pedestal_bringup.scenario import files
from pedestal_bringup.scenario.scenario import Scenario
from pedestal_bringup.scenario.sections import ScenarioError
from pedestal_common.graph import nodes
from pedestal_common.quantities import Row
from pedestal_results import intervals
from pedestal_workbench.trials import ensemble, statistics
from pedestal_workbench.trials import plan as plans
from pedestal_workbench.trials.monte_carlo import Pool
from pedestal_workbench.trials.plan import Plan
from pedestal_workbench.trials.table import Table

DEFAULT_RUNS = 12  # number of trials at each value, unless the user gives another
GRID_COUNT, MAX_BISECTIONS = 9, 12  # number of values that fill the range; largest number of bisections
BRACKET_TOLERANCE = 0.01
"""Distance of two neighbouring values, divided by the larger absolute value, below which the search ends [-]."""
MAX_LINEAR_RATIO = 20.0
"""Largest ratio of the ends of a positive range whose values have equal differences; a wider range has equal ratios
[-]."""
LOSS_RESULT, MAX_LOSS_S = 'loss_s', 0.1
"""Result that states for how long the target was lost after the lock, and mean above which the found value gets a
warning [s]."""
MIN_MEASURED_SHARE = 0.5
"""Smallest share of the trials at a value that must have the result, so that the mean at this value counts [-]."""


class Goal(NamedTuple):
    """Name of a result, and limit that its mean should reach."""
    result: str
    limit: float


class Range(NamedTuple):
    """Range of the search."""
    key: str        # parameter 'node.key'
    low: float
    high: float
    whole: bool     # True for an integer parameter
    unit: str


class Tried(NamedTuple):
    """Trials at one value of the parameter. The row is that of the mean (intervals.estimated), with the field
    `mean_loss_s`: mean time for which the target was lost [s], None where it is not measured."""
    value: float
    row: Row | None     # None if the scenario refused the value
    why: str            # text of the refusal, or ''
    measured: bool      # True if the mean counts, see MIN_MEASURED_SHARE

    @property
    def mean(self) -> float:
        """Mean of the result, NaN if it does not count."""
        value = self.row['value'] if self.row and self.measured else None
        return math.nan if value is None else value


class Solution(NamedTuple):
    """Outcome of a search."""
    value: float            # found value, or NaN
    tried: list[Tried]      # by rising value
    sentence: str           # the outcome


def goal(text: str, known: Iterable[str]) -> Goal:
    """Return the goal of a text such as 'pointing_rms_deg = 0.02'; known: names of results. Raises ValueError."""
    name, _, rest = map(str.strip, text.partition('='))
    limit = statistics.number(rest)
    if not (name and math.isfinite(limit)):
        raise ValueError(f"--until {text!r}: must be RESULT = LIMIT, such as 'pointing_rms_deg = 0.02'")
    statistics.check_result(f'--until {text!r}', name, known)
    return Goal(name, limit)


def search_range(text: str, chosen: Scenario) -> Range:
    """Return the range of a text NODE.KEY=LOW:HIGH, or that of the parameter for a text NODE.KEY. Raises ValueError.
    """
    key, equals, ends = text.partition('=')
    field = plans.field(chosen, key, '--solve')
    if field.type not in (int, float):
        raise ValueError(f'--solve {key}: must be a parameter with a number')
    low, high = (statistics.number(end) for end in ends.split(':', 1)) if ends.count(':') == 1 else (math.nan,) * 2
    if not equals:
        low, high = field.metadata.get('low', -math.inf), field.metadata.get('high', math.inf)
    if not (math.isfinite(low) and math.isfinite(high) and low < high):
        raise ValueError(f'--solve {text}: must be NODE.KEY=LOW:HIGH, LOW below HIGH')
    return Range(key, float(low), float(high), field.type is int, field.metadata.get('unit', ''))


def table_prefix(key: str) -> str:
    """Return the prefix of the file names of the tables of trials, for a search over the parameter `key`."""
    return f'solve_{key.replace("/", "_")}_'


def _in_ratios(wanted: Range) -> bool:
    return wanted.low > 0.0 and wanted.high / wanted.low > MAX_LINEAR_RATIO


def _grid(wanted: Range) -> list[float]:
    """Return the GRID_COUNT values that fill a range, in order; fewer for a short range of integers."""
    fill = np.geomspace if _in_ratios(wanted) else np.linspace
    values = fill(wanted.low, wanted.high, GRID_COUNT)
    values[[0, -1]] = wanted.low, wanted.high
    return list(dict.fromkeys(round(value) for value in values)) if wanted.whole else values.tolist()


class Search:
    """Search over a range for a goal. make_plan(overrides) returns the plan of the trials with these changed
    parameters. The folder gets one table for each value. progress: see ensemble.run_missing_trials."""

    def __init__(self, make_plan: Callable[[list[str]], Plan], wanted: Range, aim: Goal, folder: str | pathlib.Path,
                 pool: Pool, progress: Callable[[int, int], object] = lambda done, total: None) -> None:
        self._make_plan, self._wanted, self._aim = make_plan, wanted, aim
        self._folder, self._pool, self._progress = folder, pool, progress
        self.tried: list[Tried] = []

    def _try(self, values: Iterable[float]) -> list[Tried]:
        made, refused = {}, {}
        for value in values:
            try:
                made[value] = self._make_plan([files.override(self._wanted.key, value)])
            except ScenarioError as error:
                refused[value] = str(error)
        found = [Tried(value, None, text, False) for value, text in refused.items()]
        with contextlib.ExitStack() as stack:
            tables = [stack.enter_context(ensemble.open_table(
                plan, self._folder, f'{table_prefix(self._wanted.key)}{value!r}')) for value, plan in made.items()]
            if tables:
                ensemble.run_missing_trials(list(made.values()), tables, self._pool, self._progress)
        found += [self._tried(value, table) for value, table in zip(made, tables)]
        self.tried = sorted((*self.tried, *found), key=lambda one: one.value)
        return sorted(found, key=lambda one: one.value)

    def _tried(self, value: float, table: Table) -> Tried:
        name = next(name for name in table.results if self._aim.result in (name, nodes.plain(name)))
        values = table.column(name)
        known = np.isfinite(values)
        estimate = intervals.interval(values[known]) if known.any() else (math.nan,) * 3
        row: Row = {**intervals.estimated(f'{self._wanted.key}={value:.6g}', f'{nodes.plain(name)}/mean', estimate,
                                          statistics.unit(name), int(known.sum())),
                    **statistics.coverage_fields(table, name, known), 'mean_loss_s': _mean_loss(table, name)}
        return Tried(value, row, '', bool(known.mean() >= MIN_MEASURED_SHARE))

    def run(self) -> Solution:
        """Search and return the outcome."""
        wanted, aim = self._wanted, self._aim
        crossings = self._crossings(self._try(_grid(wanted))) or self._at_edges()
        what = f'{aim.result} = {aim.limit:g}'
        if not crossings:
            return self._never(what)
        if len(crossings) > 1:
            return self._unsteady(what, crossings)
        bisected = self._bisected(*crossings[0])
        if bisected is None:
            return self._unsteady(what, crossings)
        low, high = bisected
        if len(self._crossings(self.tried)) > 1:
            return self._unsteady(what, self._crossings(self.tried))
        slope = high.mean - low.mean
        value = low.value + (aim.limit - low.mean) / slope * (high.value - low.value) if slope else low.value
        value = round(value) if wanted.whole else value
        return Solution(value, self.tried, f'{wanted.key} = {value:.4g} {wanted.unit}'.rstrip()
                        + f': {what} is reached between {low.value:.4g} and {high.value:.4g}, with '
                        f'{reason(low)} trials{_losses(low, high)}{self._gaps()}')

    def _crossings(self, tried: Sequence[Tried]) -> list[tuple[Tried, Tried]]:
        """Return the pairs of neighbours whose means lie on different sides of the limit; a mean at the limit counts
        as above."""
        return [(a, b) for a, b in zip(tried, tried[1:]) if a.measured and b.measured
                and (a.mean < self._aim.limit) != (b.mean < self._aim.limit)]

    def _at_edges(self) -> list[tuple[Tried, Tried]]:
        """Bisect between each value with the result and a neighbouring value without the result. Return the first
        pairs of `_crossings` that appear."""
        for a, b in [(a, b) for a, b in zip(self.tried, self.tried[1:]) if a.measured != b.measured]:
            while (middle := self._middle(a, b)) is not None:
                one, = self._try([middle])
                if crossings := self._crossings(self.tried):
                    return crossings
                a, b = (one, b) if one.measured == a.measured else (a, one)
        return []

    def _middle(self, low: Tried, high: Tried) -> float | None:
        """Return the middle of two values, None if their distance is within BRACKET_TOLERANCE."""
        ratios = _in_ratios(self._wanted)
        middle = math.sqrt(low.value * high.value) if ratios else 0.5 * (low.value + high.value)
        middle = round(middle) if self._wanted.whole else float(f'{middle:.6g}')
        near = high.value - low.value <= BRACKET_TOLERANCE * max(abs(low.value), abs(high.value))
        return None if near or not low.value < middle < high.value else middle

    def _bisected(self, low: Tried, high: Tried) -> tuple[Tried, Tried] | None:
        """Return the narrowest pair around the limit, inside a pair of neighbours; None if most trials at a value
        between them have no result."""
        for _ in range(MAX_BISECTIONS):
            middle = self._middle(low, high)
            if middle is None:
                break
            one, = self._try([middle])
            if not one.measured:
                return None
            if (one.mean < self._aim.limit) == (low.mean < self._aim.limit):
                low = one
            else:
                high = one
        return low, high

    def _never(self, what: str) -> Solution:
        wanted, known = self._wanted, [one for one in self.tried if one.measured]
        text = f'{what} is not reached for {wanted.key} from {wanted.low:g} to {wanted.high:g} {wanted.unit}'.rstrip()
        if known:
            least, most = (choose(known, key=lambda one: one.mean) for choose in (min, max))
            text += f': the mean is {least.mean:.3g} at {least.value:.4g} to {most.mean:.3g} at {most.value:.4g}'
        return Solution(math.nan, self.tried, text + self._gaps())

    def _unsteady(self, what: str, crossings: Iterable[tuple[Tried, Tried]]) -> Solution:
        """Return the outcome for a result that reaches its limit at several values, or next to values without a
        result."""
        places = ', '.join(f'between {a.value:.4g} and {b.value:.4g}' for a, b in crossings)
        return Solution(math.nan, self.tried, f'{what} is not reached steadily: {places}{self._gaps()}')

    def _gaps(self) -> str:
        parts = []
        for measured, group in itertools.groupby(self.tried, key=lambda one: one.measured):
            values = [f'{one.value:.4g}' for one in group]
            if not measured:
                parts.append(f'at {values[0]}' if len(values) == 1 else f'from {values[0]} to {values[-1]}')
        return f'; most trials have no {self._aim.result} {", ".join(parts)}' if parts else ''


def _losses(low: Tried, high: Tried) -> str:
    """Return a warning if the trials at one of two values have lost the target after the lock, else ''."""
    known = [(one.row['mean_loss_s'], one.value) for one in (low, high) if one.row]
    lost, value = max(((lost, value) for lost, value in known if lost is not None), default=(0.0, math.nan))
    return f'; at {value:.4g} the target is lost for {lost:.3g} s of a run' if lost > MAX_LOSS_S else ''


def _mean_loss(table: Table, name: str) -> float | None:
    """Return the mean of loss_s for the beam of the result `name`; None if the trials do not measure it."""
    column = f'{nodes.beam_of(name)}/{LOSS_RESULT}'.lstrip('/')
    values = table.column(column) if column in table.results else np.full(1, math.nan)
    return float(np.nanmean(values)) if np.isfinite(values).any() else None


def reason(one: Tried) -> str:
    """Return the text on the trials at a value: the refusal of the value, or the number of trials with the result."""
    return statistics.coverage(one.row) if one.row else one.why
