"""Two scenarios, or two settings of one, compared trial by trial: pairs have the same seed and the same draws.

gain   how much better A is than B in the mean, [%] of B:

           100 (1 - mean a / mean b),       of a result of which more is better 100 (mean a / mean b - 1),

       with the interval of its jackknife (Efron and Stein, Annals of Statistics 9 (1981) 586)
wins   in how many pairs A is the better one, by Clopper and Pearson; a draw is no win
"""
import typing

import numpy as np

from pedestal_analysis.results.intervals import estimated, interval
from pedestal_analysis.trials import statistics


class Sides(typing.NamedTuple):
    """Names of the two that are compared, and their table.Tables."""
    name_a: str
    name_b: str
    a: object
    b: object

    @property
    def case(self):
        """The case of its rows."""
        return f'{self.name_a} against {self.name_b}'

    @property
    def results(self):
        """The results that both have."""
        return [name for name in self.a.there if name in self.b.there]

    def pairs(self, result):
        """The values a, b (n,) of a result in the trials in which both have it."""
        both = self.a.column(result), self.b.column(result)
        known = np.isfinite(both).all(axis=0)
        return both[0][known], both[1][known]


def names(plan_a, plan_b):
    """What the sides of two plan.Plans are called: the scenario, and the changes that the other one does not have."""
    return tuple(' '.join((own.name, *(change for change in own.overrides if change not in other.overrides)))
                 for own, other in ((plan_a, plan_b), (plan_b, plan_a)))


def gain(a, b, larger):
    """(gain, low, high) [%] of a over b (n,), both above 0; larger: whether more is better."""
    def of(sum_a, sum_b):
        return 100.0 * (sum_a / sum_b - 1.0 if larger else 1.0 - sum_a / sum_b)

    n, whole = len(a), of(a.sum(), b.sum())
    _, low, high = interval(n * whole - (n - 1) * of(a.sum() - a, b.sum() - b))
    return whole, low, high


def wins(a, b, larger):
    """(share, low, high) [%] of the pairs in which a is better than b (n,)."""
    return statistics.rate(int(np.sum(a > b if larger else a < b)), len(a))


def has_gain(result, a, b):
    """Whether a share of b says something: of a ratio scale, measured in two pairs at least and never in all zero."""
    return len(a) > 1 and statistics.unit(result) != 'dB' and min(a.min(), b.min()) >= 0.0 and np.sum(b > 0.0) > 1


def rows(sides):
    """The rows of difference a - b, gain and wins of every result that both Sides have."""
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
    """One sentence on who is better by a result."""
    a, b = sides.pairs(by)
    if len(a) < 2:
        return f'{sides.case}: {by} was measured in {len(a)} pairs, which decides nothing.'
    larger, unit = statistics.larger_is_better(by), '%'
    value, low, high = gain(a, b, larger) if has_gain(by, a, b) else interval(a - b if larger else b - a)
    if not has_gain(by, a, b):
        unit = statistics.unit(by)
    half = 0.5 * (high - low)
    share, least, most = wins(a, b, larger)
    pairs = f'{by}, {len(a)} pairs, 95 % interval'
    if low <= 0.0 <= high:
        return (f'{sides.name_a} is neither better nor worse than {sides.name_b}: by {value:.2g} +- {half:.2g} {unit} '
                f'({pairs}); it wins in {share:.0f} % ({least:.0f} to {most:.0f} %).')
    word = 'better' if value > 0.0 else 'worse'
    return (f'{sides.name_a} is {word} than {sides.name_b} by {abs(value):.2g} +- {half:.2g} {unit} ({pairs}), and '
            f'wins in {share:.0f} % ({least:.0f} to {most:.0f} %).')
