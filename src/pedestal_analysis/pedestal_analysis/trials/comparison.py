"""Comparison of two scenarios, or of two settings of one, trial by trial; a pair has the same seed and draws.

gain   improvement of the mean of A over that of B, [%] of B:

           100 (1 - mean a / mean b),       for a result with larger values preferred 100 (mean a / mean b - 1),

       with the interval of its jackknife (Efron and Stein, Annals of Statistics 9 (1981) 586)
wins   share of the pairs in which A is better, by Clopper and Pearson; equal values are no win
"""
import typing

import numpy as np

from pedestal_analysis.results.intervals import estimated, interval
from pedestal_analysis.trials import statistics


class Sides(typing.NamedTuple):
    """Names and table.Tables of the two compared sides."""
    name_a: str
    name_b: str
    a: object
    b: object

    @property
    def case(self):
        """Case of the rows."""
        return f'{self.name_a} against {self.name_b}'

    @property
    def results(self):
        """Names of the results that both sides have."""
        return [name for name in self.a.there if name in self.b.there]

    def pairs(self, result):
        """Return the values a, b (n,) of a result in the trials in which both sides have the result."""
        both = self.a.column(result), self.b.column(result)
        known = np.isfinite(both).all(axis=0)
        return both[0][known], both[1][known]


def names(plan_a, plan_b):
    """Return the names of the sides of two plan.Plans: the scenario, and the overrides that only this side has."""
    return tuple(' '.join((own.name, *(change for change in own.overrides if change not in other.overrides)))
                 for own, other in ((plan_a, plan_b), (plan_b, plan_a)))


def gain(a, b, larger):
    """Return (gain, low, high) [%] of a over b (n,), both above 0; larger: True if larger values are better."""
    def of(sum_a, sum_b):
        return 100.0 * (sum_a / sum_b - 1.0 if larger else 1.0 - sum_a / sum_b)

    n, whole = len(a), of(a.sum(), b.sum())
    _, low, high = interval(n * whole - (n - 1) * of(a.sum() - a, b.sum() - b))
    return whole, low, high


def wins(a, b, larger):
    """Return (share, low, high) [%] of the pairs in which a is better than b (n,)."""
    return statistics.rate(int(np.sum(a > b if larger else a < b)), len(a))


def has_gain(result, a, b):
    """Return True if a gain in percent of b is meaningful.

    It needs a ratio scale, at least two pairs, and at least two values of b above 0.
    """
    return len(a) > 1 and statistics.unit(result) != 'dB' and min(a.min(), b.min()) >= 0.0 and np.sum(b > 0.0) > 1


def rows(sides):
    """Return the rows of difference a - b, gain and wins of each result that both Sides have."""
    found = []
    for name in sides.results:
        a, b = sides.pairs(name)
        if not len(a):
            continue
        case, metric = statistics.case_of(sides.case, name)
        larger = statistics.larger_is_better(name)
        found.append(estimated(case, f'{metric}/difference', interval(a - b), statistics.unit(name), len(a)))
        if has_gain(name, a, b):
            found.append(estimated(case, f'{metric}/gain', gain(a, b, larger), '%', len(a)))
        found.append(estimated(case, f'{metric}/wins', wins(a, b, larger), '%', len(a)))
    return found


def sentence(sides, by):
    """Return one sentence on which side is better by a result."""
    a, b = sides.pairs(by)
    if len(a) < 2:
        return f'{sides.case}: {by} was measured in {len(a)} pairs, which are too few for a comparison.'
    larger, unit = statistics.larger_is_better(by), '%'
    value, low, high = gain(a, b, larger) if has_gain(by, a, b) else interval(a - b if larger else b - a)
    if not has_gain(by, a, b):
        unit = statistics.unit(by)
    half = 0.5 * (high - low)
    share, least, most = wins(a, b, larger)
    pairs = f'{by}, {len(a)} pairs, 95 % interval'
    if low <= 0.0 <= high:
        return (f'{sides.name_a} is neither better nor worse than {sides.name_b}: by {value:.2g} +- {half:.2g} {unit} '
                f'({pairs}); it wins in {share:.0f} % ({least:.0f} to {most:.0f} %) of the pairs.')
    word = 'better' if value > 0.0 else 'worse'
    return (f'{sides.name_a} is {word} than {sides.name_b} by {abs(value):.2g} +- {half:.2g} {unit} ({pairs}), and '
            f'wins in {share:.0f} % ({least:.0f} to {most:.0f} %) of the pairs.')
