"""Comparison of two scenarios, or of two settings of one, trial by trial; a pair has the same seed and draws.

gain   improvement of the mean of A over that of B, [%] of B:

           100 (1 - mean a / mean b),       for a result with larger values preferred 100 (mean a / mean b - 1),

       with a 95 % interval by the jackknife (Efron and Stein, Annals of Statistics 9 (1981) 586)
wins   share of the pairs in which A is better, with a 95 % interval by Clopper and Pearson; equal values are no win
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
        return [name for name in self.a.measured_results if name in self.b.measured_results]

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
    """Return (gain, low, high) [%] of a over b (n,), neither below 0; larger: True if larger values are better."""
    def gain_of_sums(sum_a, sum_b):
        return 100.0 * (sum_a / sum_b - 1.0 if larger else 1.0 - sum_a / sum_b)

    n, whole = len(a), gain_of_sums(a.sum(), b.sum())
    # Pseudo-values of the jackknife: n times the gain of all pairs, minus n - 1 times the gain without one pair.
    pseudo_values = n * whole - (n - 1) * gain_of_sums(a.sum() - a, b.sum() - b)
    _, low, high = interval(pseudo_values)
    return whole, low, high


def wins(a, b, larger):
    """Return (share, low, high) [%] of the pairs in which a is better than b (n,)."""
    return statistics.rate(int(np.sum(a > b if larger else a < b)), len(a))


def has_gain(result, a, b):
    """Return True if a gain in percent of b is meaningful.

    A gain needs at least two pairs, and at least two values of b above 0. There is no gain for dB or negative values,
    because a ratio has no meaning on these scales.
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
    larger = statistics.larger_is_better(by)
    if has_gain(by, a, b):
        (value, low, high), unit = gain(a, b, larger), '%'
    else:
        (value, low, high), unit = interval(a - b if larger else b - a), statistics.unit(by)
    half = 0.5 * (high - low)
    share, least, most = wins(a, b, larger)
    pairs = f'{by}, {len(a)} pairs, 95 % interval'
    if low <= 0.0 <= high:
        return (f'{sides.name_a} is neither better nor worse than {sides.name_b}: by {value:.2g} +- {half:.2g} {unit} '
                f'({pairs}); it wins in {share:.0f} % ({least:.0f} to {most:.0f} %) of the pairs.')
    word = 'better' if value > 0.0 else 'worse'
    return (f'{sides.name_a} is {word} than {sides.name_b} by {abs(value):.2g} +- {half:.2g} {unit} ({pairs}), and '
            f'wins in {share:.0f} % ({least:.0f} to {most:.0f} %) of the pairs.')
