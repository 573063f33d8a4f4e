"""Laws in random order: what a process gets from a law does not depend on what it, or another process, loaded before.

Every sequence runs in a process of its own that has loaded no law. The sequences share one law cache, from which files
are removed now and then, so that a law is sometimes loaded and sometimes compiled.
"""
import os
import pathlib
import pickle
import random
import traceback

import numpy as np
import pytest
from numba.core import types as numba_types

from pedestal_common import law_cache
from pedestal_common.compiled import compiled, inlined, separate
from pedestal_common.geometry import quaternion
from pedestal_common.law import by_type

SEQUENCE_COUNT = 200
CALLS_PER_SEQUENCE = 4
REMOVED_EVERY = 20
"""Number of sequences after which some files of the cache are removed."""

Record = np.dtype([('a', 'f8'), ('b', 'f8', 3), ('n', 'i8')])


@compiled
def twice(x):
    return x + x


@inlined
def power(x):
    return x**3


@separate
def shared(x):
    return twice(x) * x


@separate
def pair(x):
    return shared(x), twice(x)


@compiled
def array_of(x):
    """Return a new array, whose type is a constant of the wrapper for Python."""
    return np.array([[x, x], [x, x]]).T


@compiled
def both(x):
    first, second = pair(x)
    return first + power(second), array_of(x)


@compiled
def scaled(x, factor=2):
    made = np.empty_like(x)
    for i in range(len(x)):
        made[i] = shared(x[i]) * factor
    return made


@compiled
def summed(x):
    return scaled(x).sum() + x[0] // 2


@compiled
def updated(record):
    record.a += shared(record.b[0])
    record.n = int(record.a) % 7
    return record.a, record.n, record.b.copy()


@separate
def checked(x):
    if x < 0:
        raise ValueError('below zero')
    return str(int(x)), array_of(x)


def kind_of(x):
    raise NotImplementedError


by_type(kind_of, lambda kind: shared if kind in (numba_types.float64, numba_types.float32) else twice)


@compiled
def by_kind(x):
    return kind_of(x), array_of(x)


def _record():
    record = np.zeros(1, Record)
    record['a'], record['b'] = 1.5, (0.25, 2.0, 3.0)
    return record[0]


NUMBERS = 2.5, np.float32(1.25), 3, np.int32(5), 1.5 + 0.5j
VECTORS = tuple(np.arange(1.0, 6.0).astype(kind) for kind in ('f8', 'f4', 'i8'))
QUATERNIONS = np.array([[1.0, 0.0, 0.0, 0.0], [0.6, 0.8, 0.0, 0.0]]).T
CALLS = [*((law, (x,)) for law in (twice, power, shared, pair, array_of, both) for x in NUMBERS),
         *((law, (x,)) for law in (checked, by_kind) for x in NUMBERS[:4]),
         *((law, (x,)) for law in (scaled, summed) for x in VECTORS), (updated, (_record,)),
         (quaternion.product, (QUATERNIONS, QUATERNIONS)), (quaternion.product, (QUATERNIONS[:, 0].copy(),) * 2)]
"""Laws with the arguments of a call from Python; an argument that is a function makes the argument."""


def bytes_of(value: object) -> bytes:
    """Return a result as bytes, with its types."""
    if isinstance(value, tuple):
        return b'(' + b','.join(map(bytes_of, value)) + b')'
    array = np.asarray(value)
    return f'{type(value).__name__} {array.dtype} {array.shape} '.encode() + array.tobytes()


def results(cache: pathlib.Path, calls: list[int]) -> list[bytes]:
    """Return the results of CALLS with these numbers, made one after the other by a new process.

    The process is a fork of this one, which has imported the laws and loaded none of them.
    """
    reading, writing = os.pipe()
    child = os.fork()
    if not child:
        try:
            law_cache._ROOT = cache
            found = [bytes_of(law(*(argument() if callable(argument) else argument for argument in arguments)))
                     for law, arguments in (CALLS[number] for number in calls)]
            os.write(writing, pickle.dumps(found))
        except BaseException:
            os.write(writing, pickle.dumps(traceback.format_exc()))
        finally:
            os._exit(0)
    os.close(writing)
    with open(reading, 'rb') as pipe:
        said = pipe.read()
    _, status = os.waitpid(child, 0)
    found = pickle.loads(said) if said else f'the process ended with status {status}'
    assert isinstance(found, list), f'calls {calls}: {found}'
    return found


@pytest.fixture(scope='module')
def alone(tmp_path_factory: pytest.TempPathFactory) -> list[bytes]:
    """Return the result of each of CALLS in a process with an empty cache of its own."""
    return [results(tmp_path_factory.mktemp('alone'), [number])[0] for number in range(len(CALLS))]


def test_there_are_thirty_laws_and_types():
    assert len(CALLS) >= 30


def test_the_order_of_laws_changes_no_byte(alone, tmp_path):
    chosen = random.Random(48)
    for number in range(SEQUENCE_COUNT):
        if number % REMOVED_EVERY == 0 and tmp_path.exists():
            kept = sorted(tmp_path.iterdir())
            for path in chosen.sample(kept, len(kept) // 8):
                path.unlink()
        calls = [chosen.randrange(len(CALLS)) for _ in range(CALLS_PER_SEQUENCE)]
        assert results(tmp_path, calls) == [alone[call] for call in calls], f'sequence {number}: calls {calls}'
