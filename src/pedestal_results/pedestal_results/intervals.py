"""Rows of a --json file: results, their confidence intervals over independent runs, their targets, and their texts."""
import math
from collections.abc import Callable
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import stdtrit

from pedestal_common.quantities import Estimate, Floats, Row

_P = TypeVar('_P')      # part of the runs

CONFIDENCE_LEVEL = 0.95  # confidence level of the interval of a mean [-]


def interval(values: ArrayLike, level: float = CONFIDENCE_LEVEL) -> Estimate:
    """Return the Estimate of the mean of a result in n independent runs.

        low, high = mean -+ t_(n-1) s / sqrt(n)

        s         standard deviation of the values
        t_(n-1)   quantile of Student's t with n - 1 degrees of freedom, for the confidence level

    All are NaN if a value is not finite; low and high of one run are NaN.
    """
    values = np.asarray(values, float)
    n, mean = len(values), float(np.mean(values))
    if n < 2:
        return mean, math.nan, math.nan
    half = float(stdtrit(n - 1, 0.5 * (1.0 + level)) * np.std(values, ddof=1) / math.sqrt(n))
    return mean, mean - half, mean + half


def half_width(values: ArrayLike) -> float:
    """Return the half width of the `interval` of the mean of values."""
    _, low, high = interval(values)
    return 0.5 * (high - low)


def pseudo_values(parts: list[_P], statistic: Callable[[list[_P]], float | Floats]) -> Floats:
    """Return values for `interval` of a statistic that is taken over all runs together, such as an rms.

    parts: n about equal parts of the runs. The method is Tukey's jackknife (Efron and Stein, Annals of Statistics 9
    (1981) 586):

        value i = n theta - (n - 1) theta_-i

        theta, theta_-i   statistic of all parts; statistic of all parts except i
    """
    n, whole = len(parts), statistic(parts)
    return np.array([n * whole - (n - 1) * statistic(parts[:i] + parts[i + 1:]) if n > 1 else whole
                     for i in range(n)])


def single(case: str, metric: str, value: float, unit: str = '', target: str | None = None,
           paper: float | None = None) -> Row:
    """Return the Row of one number, which is None if the number could not be measured. An integer stays one."""
    return {'case': case, 'metric': metric, 'value': value if math.isfinite(value) else None, 'unit': unit,
            'paper': paper, 'target': target}


def row(case: str, metric: str, value: ArrayLike, unit: str = '', paper: float | None = None,
        target: str | None = None, runs: int | None = None) -> Row:
    """Return the Row of a number, or of the values of n random runs.

    For values, the Row states their mean, its interval and the number of runs. This number is n, or `runs` if each
    value belongs to several runs.
    """
    values = np.asarray(value, float)
    if values.ndim:
        return estimated(case, metric, interval(values), unit, runs or len(values), paper, target)
    return single(case, metric, float(values), unit, target, paper)


def estimated(case: str, metric: str, estimate: Estimate, unit: str, runs: int, paper: float | None = None,
              target: str | None = None) -> Row:
    """Return the Row of an estimate from a number of runs."""
    value, low, high = estimate
    return {**single(case, metric, float(value), unit, target, paper), 'ci_low': _finite(low),
            'ci_high': _finite(high), 'runs': runs}


def _finite(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


_COMPARISONS: dict[str, Callable[[float, float, float], bool]] = {
    '<=': lambda value, first, last: value <= last, '>=': lambda value, first, last: value >= last,
    '<': lambda value, first, last: value < last, '>': lambda value, first, last: value > last,
    '+-': lambda value, first, last: abs(value - first) <= last,
    'to': lambda value, first, last: first <= value <= last}


class Target(NamedTuple):
    """Required value of a result."""
    text: str       # '<= 1', '>= 1', '< 1', '> 1', '1 +- 0.1' or '1 to 2'
    word: str       # key of _COMPARISONS
    first: float    # number before the word, NaN for none
    last: float     # number after the word

    @classmethod
    def parse(cls, text: str) -> 'Target':
        """Return the target of a text."""
        *first, word, last = text.split()
        return cls(text, word, float(first[0]) if first else math.nan, float(last))

    @property
    def ends(self) -> tuple[float, float]:
        """Smallest and largest value that meet the target."""
        if self.word == '+-':
            return self.first - self.last, self.first + self.last
        low = self.last if self.word.startswith('>') else self.first
        return -math.inf if math.isnan(low) else low, math.inf if self.word.startswith('>') else self.last

    def meets(self, value: float | None) -> bool:
        """Return True if a value meets the target; None does not."""
        return value is not None and bool(_COMPARISONS[self.word](value, self.first, self.last))


def missed(row: Row) -> bool:
    """Return True if a Row misses its target. Of a random value, the whole interval must meet the target."""
    judged = (row['ci_low'], row['ci_high']) if 'runs' in row else (row['value'],)
    return row['target'] is not None and not all(map(Target.parse(row['target']).meets, judged))


def number(value: float | None) -> str:
    """Return a number of a Row as text, '-' for None."""
    return '-' if value is None else f'{value:.4g}'


def interval_text(row: Row) -> str:
    """Return the confidence interval of a Row as text, '' for a single number."""
    return f'{number(row["ci_low"])} to {number(row["ci_high"])}' if 'runs' in row else ''


def measured(value: float) -> str:
    """Return a result of a run as text: four digits, but all digits of a large whole number."""
    if not math.isfinite(value):
        return 'not measured'
    return f'{value:,.0f}' if abs(value) >= 1e4 and value == int(value) else number(value)
