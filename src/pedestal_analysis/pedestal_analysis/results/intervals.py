"""Confidence intervals of results over independent runs, their rows in a --json file, and targets of results.

The trials and the studies use this module.
"""
import math

import numpy as np
from scipy.special import stdtrit

CONFIDENCE_LEVEL = 0.95  # confidence level of the interval of a mean [-]


def interval(values):
    """Return (mean, low, high) of a result in n independent runs, from its values (n,): mean and confidence interval.

        low, high = mean -+ t_(n-1) s / sqrt(n)

        s         standard deviation of the values
        t_(n-1)   quantile of Student's t with n - 1 degrees of freedom, for CONFIDENCE_LEVEL

    All are NaN if a value is not finite; low and high of one run are NaN.
    """
    values = np.asarray(values, float)
    n, mean = len(values), float(np.mean(values))
    if n < 2:
        return mean, math.nan, math.nan
    half = float(stdtrit(n - 1, 0.5 * (1.0 + CONFIDENCE_LEVEL)) * np.std(values, ddof=1) / math.sqrt(n))
    return mean, mean - half, mean + half


def pseudo_values(parts, statistic):
    """Return values (n,) for `interval` of a statistic that is taken over all runs together, such as an rms.

    parts: n about equal parts of the runs; statistic(parts) -> number. The method is Tukey's jackknife (Efron and
    Stein, Annals of Statistics 9 (1981) 586):

        value i = n theta - (n - 1) theta_-i

        theta, theta_-i   statistic of all parts; statistic of all parts except i
    """
    n, whole = len(parts), statistic(parts)
    return np.array([n * whole - (n - 1) * statistic(parts[:i] + parts[i + 1:]) if n > 1 else whole
                     for i in range(n)])


def row(case, metric, value, unit='', paper=None, target=None, runs=None):
    """Return one row of a --json file.

    value: a number, or the values (n,) of n random runs. For values, the row states their mean, its interval and the
    number of runs. This number is n, or `runs` if each value belongs to several runs.
    paper: number that a paper prints, or None; target: text for `meets`, or None.
    """
    if np.ndim(value):
        return estimated(case, metric, interval(value), unit, runs or len(value), paper, target)
    return {'case': case, 'metric': metric, 'value': _finite(value), 'unit': unit, 'paper': paper, 'target': target}


def estimated(case, metric, estimate, unit, runs, paper=None, target=None):
    """Return the `row` of an estimate (value, low, high) from a number of runs; low, high: its confidence interval."""
    value, low, high = estimate
    return {**row(case, metric, value, unit, paper, target), 'ci_low': _finite(low), 'ci_high': _finite(high),
            'runs': runs}


def _finite(value):
    return float(value) if math.isfinite(value) else None


def meets(value, target):
    """Return True if a value meets a target: '<= 1', '>= 1', '< 1', '> 1', '1 +- 0.1' or '1 to 2'.

    The value None meets no target.
    """
    if value is None:
        return False
    first, word, last = ('', *target.split()) if len(target.split()) == 2 else target.split()
    last = float(last)
    return {'<=': lambda: value <= last, '>=': lambda: value >= last, '<': lambda: value < last,
            '>': lambda: value > last, '+-': lambda: abs(value - float(first)) <= last,
            'to': lambda: float(first) <= value <= last}[word]()


def missed(row):
    """Return True if a row misses its target. Of a random value, the whole interval must meet the target."""
    judged = ('ci_low', 'ci_high') if 'runs' in row else ('value',)
    return row['target'] is not None and not all(meets(row[key], row['target']) for key in judged)
