"""Experiment: the trials of one variant of a scenario, or of several sides that are compared trial by trial, from
their tables to the answers. `pedestal trials` prints the answers, its page draws them, and the Python library returns
them."""
import contextlib
import dataclasses
import functools
import math
import pathlib
from collections.abc import Callable, Sequence

from pedestal_common.quantities import Row
from pedestal_results import intervals
from pedestal_workbench.trials import comparison, ensemble, statistics
from pedestal_workbench.trials.comparison import Sides
from pedestal_workbench.trials.monte_carlo import Pool
from pedestal_workbench.trials.plan import Plan
from pedestal_workbench.trials.statistics import Question
from pedestal_workbench.trials.table import Table

WORST_TRIAL_COUNT, MIN_WORST_TRIAL_COUNT = 10, 3
"""Number of the worst trials of all sides whose commands are stated, and smallest number of a side."""


@dataclasses.dataclass(frozen=True)
class Side:
    """A side of an experiment; the page draws the worst trials of the first side."""
    plan: Plan
    label: str = ''         # by the user; '': the parameters in which the sides differ name the side
    table: str = 'trials'   # name of its table


class Experiment:
    """Trials of some sides, whose tables are in a folder. by: result that ranks the trials, None for the default;
    require: texts of criteria, such as 'loss_s < 1'. Raises ValueError for an unknown result."""

    def __init__(self, sides: Sequence[Side], folder: str | pathlib.Path, by: str | None = None,
                 require: Sequence[str] = ()) -> None:
        known = result_names(sides[0].plan)
        self.sides, self._by = sides, by
        self._required = [statistics.requirement(text, known) for text in require]
        if by:
            statistics.check_result(f'--by {by}', by, known)
        self.tables = [ensemble.open_table(side.plan, folder, side.table) for side in sides]

    @property
    def progress(self) -> tuple[int, int]:
        """(trials in the files of the tables, trials of all plans)."""
        return sum(table.count_in_file for table in self.tables), sum(side.plan.runs for side in self.sides)

    def run(self, pool: Pool, progress: Callable[[int, int], object] = lambda done, total: None) -> 'Found':
        """Run the trials that are not yet in the tables, and return the answers. Raises ValueError. progress: see
        ensemble.run_missing_trials."""
        with contextlib.ExitStack() as stack:
            for table in self.tables:
                stack.enter_context(table)
            ensemble.run_missing_trials([side.plan for side in self.sides], self.tables, pool, progress)
        return Found(self.sides, self.tables, self._by, self._required)


@dataclasses.dataclass(frozen=True)
class Found:
    """Answers of an experiment. Raises ValueError at the first use of the ranking if no trial has the result `by`."""
    sides: Sequence[Side]
    tables: Sequence[Table]
    by: str | None
    required: Sequence[Question]

    @property
    def plan(self) -> Plan:
        """Plan of the first side."""
        return self.sides[0].plan

    @property
    def table(self) -> Table:
        """Table of the first side."""
        return self.tables[0]

    @functools.cached_property
    def _differences(self) -> tuple[str, ...]:
        return comparison.names(*(side.plan for side in self.sides))

    @property
    def names(self) -> list[str]:
        """Name of each side: its label, else its difference."""
        return [side.label or text for side, text in zip(self.sides, self._differences)]

    @functools.cached_property
    def ranking(self) -> str:
        """Column of the result that ranks the trials and the sides."""
        return statistics.ranked_by(self.tables, self.by)

    @functools.cached_property
    def order(self) -> list[int]:
        """Numbers of the sides, the best side first."""
        return comparison.ranked(self.tables, self.ranking) if len(self.sides) > 1 else [0]

    def _pair(self, first: int, second: int) -> Sides:
        return Sides(self.names[first], self.names[second], self.tables[first], self.tables[second])

    def _described_pair(self, first: int, second: int) -> Sides:
        """Return two sides, whose names have the parameters in which these two differ behind their labels."""
        sides = self.sides[first], self.sides[second]
        name_a, name_b = (f'{side.label} ({text})' if side.label else text
                          for side, text in zip(sides, comparison.names(*(side.plan for side in sides))))
        return Sides(name_a, name_b, self.tables[first], self.tables[second])

    @property
    def best_two(self) -> Sides | None:
        """The two best sides; None for a single side."""
        return self._described_pair(*self.order[:2]) if len(self.sides) > 1 else None

    @functools.cached_property
    def rows(self) -> list[Row]:
        """Rows of --json."""
        pairs = [self._pair(0, other) for other in range(1, len(self.sides))]
        found = [row for pair in pairs for row in comparison.rows(pair)]
        for place in self.order:
            found += statistics.of_all(self.names[place], self.tables[place], self.required)
        return found

    @property
    def sentences(self) -> list[str]:
        """Sentences on the best side against each other side, then on the criteria."""
        best, *others = self.order
        plans = [side.plan for side in self.sides]
        return [*(comparison.unchanged(plans[best], plans[other])
                  or comparison.sentence(self._described_pair(best, other), self.ranking) for other in others),
                *(_met(required, row) for required in self.required for row in self.rows
                  if row['metric'] == f'{required.name}/rate')]

    @property
    def failures(self) -> list[str]:
        """A line on each side with trials that failed."""
        lines = [(name, statistics.failures(table)) for name, table in zip(self.names, self.tables)]
        return [f'{name}: {line}' for name, line in lines if line]

    @property
    def sensitivities(self) -> list[str]:
        """Lines with the sensitivity of the ranking result to each varied parameter, the strongest first. A line names
        its case if there are several."""
        # Because eta_squared is the square of a correlation, its square root is compared with a rank correlation.
        by = self.ranking.rpartition('/')[2]
        powers = {f'{by}/rank_correlation': 1.0, f'{by}/eta_squared': 0.5}
        found = [row for row in self.rows if row['metric'].partition('(')[0] in powers]
        several = len({row['case'] for row in found}) > 1
        return [f'{row["case"]}: ' * several
                + f'{row["metric"]}: {intervals.number(row["value"])} ({intervals.interval_text(row)})'
                for row in sorted(found, key=lambda row: -abs(row['value'] or 0.0)**powers[
                    row['metric'].partition('(')[0]])]

    def places(self, side: int = 0) -> list[int]:
        """Return the numbers of the trials of a side, the worst trial first."""
        return statistics.ranking(self.ranking, self.tables[side].column(self.ranking)).tolist()

    def worst(self, side: int = 0) -> list[int]:
        """Return the numbers of the worst trials of a side."""
        return self.places(side)[:max(WORST_TRIAL_COUNT // len(self.sides), MIN_WORST_TRIAL_COUNT)]

    @property
    def worst_lines(self) -> list[str]:
        """For each side a title and a line for each of its worst trials: result, command and verdict on it."""
        lines = []
        for side in self.order:
            table, plan = self.tables[side], self.sides[side].plan
            values, whys = table.column(self.ranking), table.text(statistics.why_column(self.ranking))
            of_side = f' of {self.names[side]}' if len(self.sides) > 1 else ''
            lines.append(f'the worst trials{of_side} by {self.ranking}:')
            lines += [f'{intervals.number(values[i] if math.isfinite(values[i]) else None):>10}  {plan.command(i)}'
                      + (f'  # {whys[i]}' if whys[i] else '') for i in self.worst(side)]
        return lines


def _met(required: Question, row: Row) -> str:
    """Return the line on a criterion in a case: the share of the trials that meet it, and those without the result."""
    count = round((row['value'] or 0.0) * row['runs'] / 100.0)
    left_out = ', '.join(f'{number} {word}' for word, number in row['left_out'].items())
    return (f'{row["case"]}: {required.text} in {count} of {row["runs"]} trials, {row["value"]:.3g} % '
            f'({intervals.interval_text(row)} %){f"; without the result: {left_out}" if left_out else ""}')


def result_names(plan: Plan) -> list[str]:
    """Return the names of the results of the trials of a plan, with the names of its beams."""
    return [f'{prefix}{result}' for prefix in plan.scenario(0).prefixes for result in ensemble.TRIAL_RESULTS]
