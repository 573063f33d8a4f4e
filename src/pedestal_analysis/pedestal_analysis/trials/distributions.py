"""The distributions a varied parameter is drawn from: one row each, by its quantile function.

A parameter is varied by a text NODE.KEY=KIND(numbers), the value itself, or NODE.KEY=KIND(numbers)x, a factor of what
the scenario says. Every draw is the quantile of a number u between 0 and 1, so that independent draws and the points
of a Sobol sequence go the same way.
"""
import re
import typing

import numpy as np
import yaml
from scipy import special

from pedestal_common.parameters import did_you_mean
from pedestal_common.text_files import plain_yaml


class Kind(typing.NamedTuple):
    """usage: how it is written; arguments: how many, None for one or more; quantile(u (n,), arguments) -> (n,);
    extremes(arguments) -> the values that decide whether it stays in a range, None where it has no ends."""
    usage: str
    arguments: int | None
    quantile: typing.Callable
    extremes: typing.Callable


DISTRIBUTION_KINDS = {
    'uniform': Kind('uniform(low, high)', 2, lambda u, ends: ends[0] + u * (ends[1] - ends[0]), lambda ends: ends),
    'normal': Kind('normal(mean, sigma)', 2, lambda u, moments: moments[0] + special.ndtri(u) * moments[1],
                   lambda moments: None),
    'choice': Kind('choice(a, b, ...)', None,
                   lambda u, options: np.array(options, object)[(u * len(options)).astype(int)],
                   lambda options: options),
}

_WRITTEN = re.compile(r'(\w+)\((.*)\)(x?)')


class VaryError(ValueError):
    """A --vary that says nothing that can be drawn; one line naming it."""


class Distribution(typing.NamedTuple):
    """text: as it was written; kind: of DISTRIBUTION_KINDS; arguments: numbers, of a choice any values; factor:
    whether it is a
    factor of what the scenario says."""
    text: str
    kind: str
    arguments: tuple
    factor: bool

    def draw(self, u, whole=False):
        """Values (n,) at u (n,) between 0 and 1; whole: of a parameter that is a whole number, low and high among
        them."""
        if whole and self.kind == 'uniform':
            low, high = self.arguments
            return np.floor(low + u * (high - low + 1.0))
        return DISTRIBUTION_KINDS[self.kind].quantile(u, self.arguments)

    @property
    def extremes(self):
        """The values that decide whether it stays in a range; None where it has no ends."""
        return DISTRIBUTION_KINDS[self.kind].extremes(self.arguments)


def parse(text) -> Distribution:
    """The Distribution that a text such as 'normal(1, 0.1)x' says. Raises VaryError."""
    match = _WRITTEN.fullmatch(text.strip())
    usage = ', '.join(kind.usage for kind in DISTRIBUTION_KINDS.values())
    if not match:
        raise VaryError(f'{text!r}: must be one of {usage}, for a factor with an x behind it')
    name, inside, factor = match[1], match[2], bool(match[3])
    if name not in DISTRIBUTION_KINDS:
        raise VaryError(f'{text!r}:{did_you_mean(name, DISTRIBUTION_KINDS)} there are {usage}')
    try:
        arguments = tuple(plain_yaml.parse(part) for part in inside.split(','))
    except yaml.YAMLError as error:
        raise VaryError(f'{text!r}: {plain_yaml.problem(error)}') from None
    expected = DISTRIBUTION_KINDS[name].arguments
    if None in arguments or expected not in (None, len(arguments)):
        raise VaryError(f'{text!r}: must be {DISTRIBUTION_KINDS[name].usage}')
    if name != 'choice' or factor:
        arguments = tuple(_number(text, value) for value in arguments)
    if name == 'uniform' and not arguments[0] < arguments[1]:
        raise VaryError(f'{text!r}: low must be below high')
    if name == 'normal' and not arguments[1] > 0.0:
        raise VaryError(f'{text!r}: sigma must be above 0')
    return Distribution(text.strip(), name, arguments, factor)


def _number(text, value):
    try:
        number = float('nan' if isinstance(value, bool) else value)
    except (TypeError, ValueError):
        number = float('nan')
    if not np.isfinite(number):
        raise VaryError(f'{text!r}: {value!r} must be a number')
    return number
