"""Distributions by which trials vary a parameter: `pedestal trials --vary NODE.KEY=KIND(numbers)`. With an x at the
end, NODE.KEY=KIND(numbers)x, a distribution draws a factor of the value in the scenario. Each draw is the quantile of
a number u between 0 and 1, which is random or a coordinate of a point of a Sobol sequence."""
import re
from collections.abc import Callable
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import yaml
from numpy.typing import NDArray
from scipy import special

from pedestal_common.parameters import did_you_mean
from pedestal_common.quantities import Floats, Json
from pedestal_common.text_files import plain_yaml

Values: TypeAlias = NDArray[Any]  # numbers, or the values of a `choice`, which may be texts


class Kind(NamedTuple):
    """A kind of distribution: a row of DISTRIBUTION_KINDS."""
    usage: str                  # text of its syntax
    arguments: int | None       # their number, None for one or more
    quantile: Callable[[Floats, tuple[Json, ...]], Values]  # quantile(u (n,), arguments) returns values (n,)
    # low and high, or all options of a `choice`, which must be in the range of the parameter; None without bounds
    extremes: Callable[[tuple[Json, ...]], tuple[Json, ...] | None]


DISTRIBUTION_KINDS: dict[str, Kind] = {
    'uniform': Kind('uniform(low, high)', 2, lambda u, ends: ends[0] + u * (ends[1] - ends[0]), lambda ends: ends),
    'normal': Kind('normal(mean, sigma)', 2, lambda u, moments: moments[0] + special.ndtri(u) * moments[1],
                   lambda moments: None),
    'choice': Kind('choice(a, b, ...)', None,
                   lambda u, options: np.array(options, object)[(u * len(options)).astype(int)],
                   lambda options: options),
}

_TEXT_PATTERN = re.compile(r'(\w+)\((.*)\)(x?)')  # name, arguments, x for a factor


class Distribution(NamedTuple):
    """The distribution of one parameter."""
    text: str       # as the user gave it
    kind: str       # key of DISTRIBUTION_KINDS
    arguments: tuple[Json, ...]     # numbers of the distribution, or the values of a `choice`
    factor: bool    # True if a draw is a factor of the value in the scenario

    def draw(self, u: Floats, whole: bool = False) -> Values:
        """Return values (n,) at the numbers u (n,) between 0 and 1. whole: True for an integer parameter, for which a
        uniform distribution includes low and high."""
        if whole and self.kind == 'uniform':
            low, high = self.arguments
            return np.floor(low + u * (high - low + 1.0))
        return DISTRIBUTION_KINDS[self.kind].quantile(u, self.arguments)

    @property
    def extremes(self) -> tuple[Json, ...] | None:
        """Values (or factors) that bound or list all draws, see Kind.extremes; None without bounds."""
        return DISTRIBUTION_KINDS[self.kind].extremes(self.arguments)


def parse(text: str) -> Distribution:
    """Return the distribution of a text such as 'normal(1, 0.1)x'. Raises ValueError."""
    match = _TEXT_PATTERN.fullmatch(text.strip())
    usage = ', '.join(kind.usage for kind in DISTRIBUTION_KINDS.values())
    if not match:
        raise ValueError(f'{text!r}: must be one of {usage}; a factor has an x at the end')
    name, inside, factor = match[1], match[2], bool(match[3])
    if name not in DISTRIBUTION_KINDS:
        raise ValueError(f'{text!r}:{did_you_mean(name, DISTRIBUTION_KINDS)} must be one of {usage}')
    try:
        arguments = tuple(plain_yaml.parse(part) for part in inside.split(','))
    except yaml.YAMLError as error:
        raise ValueError(f'{text!r}: {plain_yaml.problem(error)}') from None
    expected = DISTRIBUTION_KINDS[name].arguments
    if None in arguments or expected not in (None, len(arguments)):
        raise ValueError(f'{text!r}: must be {DISTRIBUTION_KINDS[name].usage}')
    if name != 'choice' or factor:
        arguments = tuple(_number(text, value) for value in arguments)
    if name == 'uniform' and not arguments[0] < arguments[1]:
        raise ValueError(f'{text!r}: low must be below high')
    if name == 'normal' and not arguments[1] > 0.0:
        raise ValueError(f'{text!r}: sigma must be above 0')
    return Distribution(text.strip(), name, arguments, factor)


def _number(text: str, value: Json) -> float:
    """Return a value as a finite float. text: distribution as given, for the ValueError."""
    try:
        number = float('nan' if isinstance(value, bool) else value)
    except (TypeError, ValueError):
        number = float('nan')
    if not np.isfinite(number):
        raise ValueError(f'{text!r}: {value!r} must be a number')
    return number
