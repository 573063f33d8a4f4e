"""The key of a law changes with everything on which the compiled code depends, and with nothing else."""
import importlib.util
import sys

import pytest

from pedestal_common import law

SOURCE = """
import collections
import enum
import typing

import numba
import numpy as np
from numba.extending import intrinsic, overload

from pedestal_common.compiled import compiled, inlined, separate
from pedestal_common.law import by_type
from pedestal_common.law_key import template

FACTOR = 2.0
TABLE = np.arange(3000.0)
RECORD = np.zeros(1, [('numbers', 'f8', 2000)])[0]

class Mode(enum.Enum):
    A = 1
    B = 2

class Pair(typing.NamedTuple):
    first: float
    second: float

CHOSEN = Mode.A

@compiled
def leaf(x):
    return x + FACTOR

@separate
def apart(x, y):
    made = x + y
    return made

@numba.njit
def foreign(x):
    return x * FACTOR

def known(x):
    raise NotImplementedError

@overload(known)
def _known(x):
    return lambda x: FACTOR * x

template(known)

def chosen(x):
    raise NotImplementedError

LAWS = [leaf, foreign]
by_type(chosen, lambda kind: LAWS[0])

def enclosed(number):
    @compiled
    def law(x):
        return x * number
    return law

@compiled
def law(x, by=1.0):
    \"\"\"Return a number.\"\"\"
    return BODY
"""

def key(tmp_path, body, *edit):
    """Return the key of `law` with a body, in a module whose source is edited."""
    source = SOURCE.replace('BODY', body)
    if edit:
        assert edit[0] in source
        source = source.replace(*edit)
    path = tmp_path / 'keyed.py'
    path.write_text(source)
    spec = importlib.util.spec_from_loader('keyed', None)
    module = importlib.util.module_from_spec(spec)
    sys.modules['keyed'] = module
    law._SEPARATE.pop('keyed.apart', None)      # of the last module, as in a new process
    exec(compile(source, str(path), 'exec'), vars(module))
    return module.law.key


@pytest.mark.parametrize(('body', 'edit'), (
    ('leaf(x)', ('x + FACTOR', 'x - FACTOR')), ('leaf(x)', ('FACTOR = 2.0', 'FACTOR = 3.0')),
    ('leaf(x)', ('@compiled\ndef leaf', '@inlined\ndef leaf')),
    ('leaf(x)', ('@compiled\ndef leaf', '@separate\ndef leaf')),
    ('x * TABLE[5]', ('arange(3000.0)', 'arange(3000.0)[::-1].copy()')), ('x', ('by=1.0', 'by=2.0')),
    ('RECORD.numbers[0]', ('RECORD = np.zeros(1', 'RECORD = np.ones(1')),
    ('x if CHOSEN == Mode.A else 0.0', ('CHOSEN = Mode.A', 'CHOSEN = Mode.B')),
    ('Pair(x, x).first', ('first: float\n    second', 'second: float\n    first')),
    ('foreign(x)', ('FACTOR = 2.0', 'FACTOR = 3.0')), ('foreign(x)', ('x * FACTOR', 'x / FACTOR')),
    ('known(x)', ('FACTOR = 2.0', 'FACTOR = 3.0')), ('known(x)', ('FACTOR * x', 'FACTOR / x')),
    ('chosen(x)', ('LAWS[0]', 'LAWS[1]')), ('chosen(x)', ('x + FACTOR', 'x - FACTOR')),
    ('apart(x, x)', ('apart(x, y)', 'apart(x, *y)')), ('apart(x, x)', ('apart(x, y)', 'apart(y, x)'))))
def test_an_edit_changes_the_key(tmp_path, body, edit):
    assert key(tmp_path, body) != key(tmp_path, body, *edit)


@pytest.mark.parametrize(('body', 'edit'), (
    ('leaf(x)', ('"""Return a number."""', '"""Return another number."""')),
    ('leaf(x)', ('    """Return a number."""\n', '')),
    ('leaf(x)', ('@compiled\ndef leaf', '# comment\n@compiled\ndef leaf')),
    ('leaf(x)', ('class Mode', 'UNUSED = 1.0\n\nclass Mode')), ('leaf(x)', ('x * FACTOR', 'x / FACTOR')),
    ('apart(x, x)', ('made = x + y', 'made = x - y')),
    ('apart(x, x)', ('made = x + y', 'other = y\n    made = x + other'))))
def test_an_edit_elsewhere_does_not_change_the_key(tmp_path, body, edit):
    assert key(tmp_path, body) == key(tmp_path, body, *edit)


def test_a_law_that_a_function_makes_has_the_key_of_its_values(tmp_path):
    key(tmp_path, 'x')
    enclosed = sys.modules['keyed'].enclosed
    assert enclosed(1.0).key == enclosed(1.0).key != enclosed(2.0).key
