"""Codes: numbers that stand for names, for example of modes or faults, in laws and on topics."""
import re
from collections import namedtuple


def codes(names):
    """Return a named tuple with the index of each name, under that name in capitals: codes(('a b', 'c')).A_B is 0."""
    return _named(names, range(len(names)))


def bits(names):
    """Return a named tuple with a number of one bit (1, 2, 4 ...) for each name: bits(('a b', 'c')).C is 2."""
    return _named(names, (1 << i for i in range(len(names))))


def _named(names, numbers):
    return namedtuple('Codes', [re.sub(r'\W', '_', name).upper() for name in names])(*numbers)
