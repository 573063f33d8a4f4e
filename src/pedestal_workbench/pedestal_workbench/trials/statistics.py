"""Statistics over trials: percentiles, rates and sensitivities of the results, each with its 95 % interval.

percentile   The interval comes from order statistics (scipy.stats.quantile_test), and holds for any distribution.
rate         Share of the trials for which a statement is true, with the interval of Clopper and Pearson (Biometrika 26
             (1934) 404).
sensitivity  Dependence of a result on a varied parameter. For a parameter with numbers it is Spearman's rank
             correlation r, from -1 to 1, with the interval of Bonett and Wright (Psychometrika 65 (2000) 23) for n
             trials, tanh(artanh r -+ 1.96 sqrt((1 + r^2 / 2) / (n - 3))).
             A parameter whose values are texts has no order. Its sensitivity is eta squared, from 0 to 1: the share of
             the variance of the result's ranks that the texts explain (Tomczak, Tomczak, Trends in Sport Sciences 1
             (2014) 19), (H - k + 1) / (n - k). H is the statistic of Kruskal and Wallis, k the number of different
             texts. The interval is that of an analysis of variance of the ranks, by its noncentral F distribution
             (Steiger, Psychological Methods 9 (2004) 164).
"""
import collections
import math
import re
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
from scipy import optimize, stats

from pedestal_common.graph import nodes
from pedestal_common.parameters import did_you_mean
from pedestal_common.quantities import Bools, Coverage, Estimate, Floats, Ints, Row
from pedestal_results import intervals, mode_pointing, results, verdict
from pedestal_results.intervals import Target
from pedestal_workbench.trials.table import Table

PERCENTILES = (1, 5, 25, 50, 75, 95, 99)  # reported percentiles [%]
Z = float(stats.norm.ppf(0.5 + 0.5 * intervals.CONFIDENCE_LEVEL))
"""Standard normal quantile of the two-sided confidence level: 1.96 for 95 % [-]."""


WHY = 'why'
"""Name of the column with the verdict on a trial that did not track, '' for a trial that tracked; one per beam."""


class Question(NamedTuple):
    """A statement on a result that is true or false for each trial; a trial without the result does not meet it."""
    name: str
    result: str
    target: Target | None = None    # None: the trial has the result

    @property
    def text(self) -> str:
        """The statement, such as 'loss_s < 1'."""
        return f'{self.result} {self.target.text}' if self.target else self.result

    def holds(self, values: Floats) -> Bools:
        """Return True where the statement is true for the values (n,) of the result."""
        met = [self.target is None or self.target.meets(value) for value in values.tolist()]
        return np.isfinite(values) & np.array(met, bool)


TRIAL_QUESTIONS = (
    Question('locked', 'lock_time_s'),
    Question('tracked', 'evaluated_time_s', Target.parse('> 0')),   # the run reached settled autotrack
    Question('never_lost', 'loss_s', Target.parse('<= 0')),     # never further off than half a beamwidth
    Question('aligned', 'aligned_s'),
    *(Question(f'{result.name}_met', result.name, Target.parse(result.target))
      for result in results.RESULTS if result.target and result.part not in ('run', 'supervised')),
)


_REQUIRED = re.compile(r'\s*(\S+)\s*(<=|>=|<|>)\s*(\S+)\s*')  # name of the result, sign, limit


def check_result(option: str, name: str, known: Iterable[str]) -> None:
    """Raise ValueError unless a name is in `known`, the names of the results, with or without the name of a beam.
    option: with its value, for the text of the error."""
    if name not in known and name not in map(nodes.plain, known):
        raise ValueError(f'{option}: no trial has a result {name!r};{did_you_mean(name, known)} '
                         '`pedestal run --all --explain` explains the results')


def requirement(text: str, known: Iterable[str]) -> Question:
    """Return the criterion of the user (--require) of a text such as 'pointing_max_deg < 0.1'. Raises ValueError for a
    result that is not `known`."""
    match = _REQUIRED.fullmatch(text)
    usage = f"--require {text!r}: must be RESULT < LIMIT, with <, <=, > or >=, such as 'pointing_max_deg < 0.1'"
    if not match:
        raise ValueError(usage)
    name, sign, limit = match.groups()
    check_result(f'--require {text!r}', name, known)
    if math.isnan(number(limit)):
        raise ValueError(usage)
    return Question(f'require({name} {sign} {limit})', name, Target.parse(f'{sign} {limit}'))


def number(text: str) -> float:
    """Return the number in a text, NaN if the text is no number."""
    try:
        return float(text)
    except ValueError:
        return math.nan


def of_all(case: str, table: Table, requirements: Iterable[Question] = ()) -> list[Row]:
    """Return the rows of --json of a table of trials."""
    return [*of_results(case, table), *of_requirements(case, table, requirements), *of_questions(case, table),
            *of_sensitivity(case, table)]


def _share(question: Question, case: str, table: Table, name: str) -> Row:
    holds = question.holds(table.column(name))
    return intervals.estimated(case_of(case, name)[0], f'{question.name}/rate',
                               rate(int(np.sum(holds)), len(holds)), '%', len(holds))


def of_requirements(case: str, table: Table, requirements: Iterable[Question]) -> list[Row]:
    """Return the rows of the rate at which trials meet each criterion, with the fields of coverage_fields."""
    return [{**_share(required, case, table, name),
             **coverage_fields(table, name, np.isfinite(table.column(name)))}
            for required in requirements for name in table.results if required.result in (name, nodes.plain(name))]


def percentile(values: Floats, share: float) -> Estimate:
    """Return a percentile `share` [%] of values (n,), with its 95 % interval. An end is NaN if n is too small for it.
    """
    interval = stats.quantile_test(values, p=share / 100.0).confidence_interval(intervals.CONFIDENCE_LEVEL)
    return np.percentile(values, share), interval.low, interval.high


def rate(count: int, n: int) -> Estimate:
    """Return the share [%] of `count` out of n trials, with its 95 % interval."""
    interval = stats.binomtest(count, n).proportion_ci(intervals.CONFIDENCE_LEVEL, method='exact')
    return 100.0 * count / n, 100.0 * interval.low, 100.0 * interval.high


def rank_correlation(x: Floats, y: Floats) -> Estimate:
    """Return Spearman's rank correlation r of x and y (n,), with its 95 % interval. All are NaN if x or y does not
    vary; the interval is NaN for n below four."""
    n = len(x)
    if n < 2 or not (np.ptp(x) > 0.0 and np.ptp(y) > 0.0):
        return math.nan, math.nan, math.nan
    r = float(stats.spearmanr(x, y).statistic)
    if n < 4:
        return r, math.nan, math.nan
    middle, half = math.atanh(min(max(r, -1.0 + 1e-12), 1.0 - 1e-12)), Z * math.sqrt((1.0 + 0.5 * r * r) / (n - 3))
    return r, math.tanh(middle - half), math.tanh(middle + half)


def eta_squared(x: Floats, y: Floats) -> Estimate:
    """Return eta squared of the ranks of y (n,) over the categories x (n,), with its 95 % interval. All are NaN if x
    or y does not vary, or if each trial has a category of its own; the interval is NaN if the categories explain
    everything."""
    n, kinds = len(x), np.unique(x)
    k = len(kinds)
    if not 1 < k < n or not np.ptp(y) > 0.0:
        return math.nan, math.nan, math.nan
    h = float(stats.kruskal(*(y[x == kind] for kind in kinds)).statistic)
    share = min(max((h - k + 1) / (n - k), 0.0), 1.0)
    unexplained = 1.0 - h / (n - 1)
    if unexplained < 1e-12:
        return share, math.nan, math.nan
    f = (1.0 - unexplained) / (k - 1) / (unexplained / (n - k))

    def bound(probability: float) -> float:
        """Return the eta squared for which the noncentral F distribution is below f with a probability."""
        def excess(noncentrality: float) -> float:
            return stats.ncf.cdf(f, k - 1, n - k, noncentrality) - probability
        high = 1.0
        if stats.f.cdf(f, k - 1, n - k) < probability:
            return 0.0
        while excess(high) > 0.0:
            high *= 2.0
        noncentrality = optimize.brentq(excess, 1e-9, high)
        return noncentrality / (noncentrality + n)

    return share, bound(0.5 + 0.5 * intervals.CONFIDENCE_LEVEL), bound(0.5 - 0.5 * intervals.CONFIDENCE_LEVEL)


def unit(name: str) -> str:
    """Return the unit of a result by its column in a table of trials, such as beam_2/loss_s."""
    return results.RESULT_BY_NAME[nodes.plain(name)].unit


def case_of(case: str, name: str) -> tuple[str, str]:
    """Return (case, metric) of the rows for a column of a table; the case contains the beam, as in `pedestal run`."""
    beam, plain = nodes.beam_of(name), nodes.plain(name)
    return f'{case}/{beam}'.rstrip('/'), plain


def coverage_fields(table: Table, name: str, known: Bools) -> Coverage:
    """Return the fields of a row of --json that state how many trials have a result. `of`: number of all trials;
    `left_out`: {first word of the column `why`: number of trials}. known: mask (n,) of the trials with the result."""
    words = collections.Counter(why.partition(':')[0] or 'not measured'
                                for why, is_known in zip(table.text(why_column(name)), known) if not is_known)
    return {'of': known.size, 'left_out': dict(words.most_common())}


def why_column(name: str) -> str:
    """Return the name of the column WHY for the beam of a column of results."""
    return f'{nodes.beam_of(name)}/{WHY}'.lstrip('/')


def coverage(row: Row) -> str:
    """Return the text of the number of trials behind a row, such as '23 of 24, 1 tripped'."""
    if row.get('of', row['runs']) == row['runs']:
        return str(row['runs'])
    reasons = [f'{count} {word}' for word, count in row['left_out'].items()]
    return ', '.join((f'{row["runs"]} of {row["of"]}', *reasons))


def failures(table: Table) -> str:
    """Return one line on the trials that failed, '' for none."""
    words = [text.partition(':')[0] for name in table.texts for text in table.text(name)]
    count = collections.Counter(word for word in words if word in verdict.FAILURE_WORDS)
    listed = ', '.join(f'{number} {word}' for word, number in count.most_common())
    return f'{sum(count.values())} of {len(words)} runs failed: {listed}; column `{WHY}` of the table' if count else ''


def of_results(case: str, table: Table) -> list[Row]:
    """Return the rows of mean, smallest value, percentiles and largest value of each result, with coverage_fields."""
    found: list[Row] = []
    for name in table.measured_results:
        values = table.column(name)
        known = np.isfinite(values)
        fields = coverage_fields(table, name, known)
        values = values[known]
        own, metric = case_of(case, name)
        if not values.size:
            continue
        estimates = {'mean': intervals.interval(values), 'min': (values.min(), math.nan, math.nan),
                     **{f'p{share:02d}': percentile(values, share) for share in PERCENTILES},
                     'max': (values.max(), math.nan, math.nan)}
        found += [{**intervals.estimated(own, f'{metric}/{key}', estimate, unit(name), values.size), **fields}
                  for key, estimate in estimates.items()]
    return found


def of_questions(case: str, table: Table) -> list[Row]:
    """Return the rows of the rates of TRIAL_QUESTIONS over all trials."""
    return [_share(question, case, table, name) for name in table.measured_results
            for question in TRIAL_QUESTIONS if question.result == nodes.plain(name)]


def of_sensitivity(case: str, table: Table) -> list[Row]:
    """Return the rows of the sensitivity of each result to each varied parameter: eta_squared for a parameter of
    texts, else rank_correlation. A result that does not vary has no row."""
    found = []
    varied = {name: (eta_squared if table.categories(name) else rank_correlation, table.column(name))
              for name in table.varied}
    for name in table.measured_results:
        own, metric = case_of(case, name)
        values = table.column(name)
        known = np.isfinite(values)
        for parameter, (measure, given) in varied.items():
            estimate = measure(given[known], values[known])
            if math.isfinite(estimate[0]):
                found.append(intervals.estimated(own, f'{metric}/{measure.__name__}({parameter})', estimate, '',
                                                 int(known.sum())))
    return found


def larger_is_better(name: str) -> bool:
    """Return True if a larger value of a result is better, by the sign of its target."""
    return (results.RESULT_BY_NAME[nodes.plain(name)].target or '').startswith('>')


def ranking(name: str, values: Floats) -> Ints:
    """Return the indices of the values (n,) of a result, from the worst to the best; NaN is the worst."""
    badness = -values if larger_is_better(name) else values
    return np.argsort(-np.where(np.isfinite(badness), badness, math.inf), kind='stable')


DEFAULT_RANKING = ('pointing_rms_deg', *(f'{mode}_pointing_rms_deg' for mode in mode_pointing.FOLLOWED_DIRECTIONS),
                   'azimuth_following_rms_deg')
"""Results that rank the trials without --by: the first one that every side has, else the first one of any side."""


def ranked_by(tables: Sequence[Table], result: str | None = None) -> str:
    """Return the column of the result that ranks the trials of several sides: that of `result`, even if all its values
    are NaN, or None for one of DEFAULT_RANKING. Raises ValueError if no trial has the result."""
    known = list(dict.fromkeys(column for table in tables for column in table.measured_results))
    shares = [(column, sum(bool(np.isfinite(table.column(column)).any()) for table in tables))
              for name in ((result,) if result else DEFAULT_RANKING) for column in known
              if name in (column, nodes.plain(column))]
    for least in (len(tables), 1, 0 if result else 1):
        for column, sides in shares:
            if sides >= least:
                return column
    if not result:
        raise ValueError('no trial ever tracked its target or followed a command: try a longer --duration, or choose '
                         f'a result with --by: {", ".join(known)}')
    raise ValueError(f'--by {result}: no trial has this result;{did_you_mean(result, known)} must be one '
                     f'of {", ".join(known)}')
