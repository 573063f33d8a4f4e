"""Codes: numbers that stand for names, for example of modes or faults, in laws and on topics."""
import re
from collections import namedtuple
from collections.abc import Collection, Iterable, Iterator
from typing import Any, Protocol, cast


class Codes(Protocol):
    """A named tuple of numbers, whose names a table states."""

    def __getattr__(self, name: str) -> int:
        """Return the number of a name in capitals."""

    def __getitem__(self, index: int) -> int:
        """Return the number at an index."""

    def __iter__(self) -> Iterator[int]:
        """Return an iterator over the numbers."""

    def __len__(self) -> int:
        """Return how many names there are."""


def codes(names: Collection[str]) -> Codes:
    """Return a named tuple with the index of each name, under that name in capitals: codes(('a b', 'c')).A_B is 0."""
    return _named(names, range(len(names)))


def bits(names: Collection[str]) -> Codes:
    """Return a named tuple with a number of one bit (1, 2, 4 ...) for each name: bits(('a b', 'c')).C is 2."""
    return _named(names, (1 << i for i in range(len(names))))


def _named(names: Iterable[str], numbers: Iterable[int]) -> Codes:
    make: Any = namedtuple      # mypy wants fields that it knows
    return cast(Codes, make('Codes', [re.sub(r'\W', '_', name).upper() for name in names])(*numbers))
