"""Codes of names: one of several names as a number, which laws compare and topics carry."""
import re
from collections import namedtuple


def codes(names):
    """Return the index of each name, under that name in capitals: codes(('a b', 'c')).A_B is 0."""
    return _named(names, range(len(names)))


def bits(names):
    """Return the bit of each name, under the same names as in `codes`: bits(('a b', 'c')).C is 2."""
    return _named(names, (1 << i for i in range(len(names))))


def _named(names, numbers):
    return namedtuple('Codes', [re.sub(r'\W', '_', name).upper() for name in names])(*numbers)
