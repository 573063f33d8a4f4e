"""Decorators that compile every law. The arithmetic is strict IEEE 754 (no fastmath): a law gives the same bits
wherever it is inlined, so study, node and recomputed bag agree exactly, and NaN keeps its meaning on the topics."""
from collections.abc import Callable
from typing import Protocol, TypeVar, cast

import numba

from pedestal_common.law import Law
from pedestal_common.quantities import Pairs

_F = TypeVar('_F', bound=Callable[..., object])


class Prepared(Protocol):
    """What has laws to prepare: a unit."""

    @property
    def last_prepared(self) -> tuple[Callable[..., object], tuple[object, ...]]:
        """Law that is compiled last, and its arguments."""


def is_compiled(unit: Prepared) -> bool:
    """Return True if the laws of a unit are in the law cache."""
    law, arguments = unit.last_prepared
    return numba.config.DISABLE_JIT or cast(Law, law).is_cached(*arguments)


def _law(law: _F, separate: bool = False, **options: bool) -> _F:
    if numba.config.DISABLE_JIT:     # for a debugger: the laws run as plain Python
        return law
    made = Law(law, targetoptions={'nopython': True, 'error_model': 'numpy', **options}, separate=separate)
    return cast(_F, made)       # a Law is called as the function is


def compiled(law: _F) -> _F:
    """Compile a law, as decorator. Division by zero gives inf or NaN as in numpy, never an exception."""
    return _law(law)


def separate(law: _F) -> _F:
    """Compile a large law into machine code of its own, as decorator. After an edit of the law its callers are not
    compiled again, and laws that share it contain it once."""
    return _law(law, separate=True)


def inlined(law: _F) -> _F:
    """Compile a small law as `compiled` does, and inline it into its callers, as decorator. Loops over the lanes of
    the drive become vector instructions only if their laws are inlined; a bank of filters is faster too."""
    return _law(law, forceinline=True)


@compiled
def assign(target: Pairs, source: Pairs) -> None:
    """Copy the array source into target. This replaces `target[:] = source`, because numba takes three seconds to
    compile numpy's check of the shapes."""
    for i in range(target.shape[0]):
        for j in range(target.shape[1]):
            target[i, j] = source[i, j]
