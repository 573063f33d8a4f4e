"""Decorators that compile every law, and the marks by which processes know that the laws of a unit are compiled.

The arithmetic is strict IEEE 754 (no fastmath): a law gives the same bits wherever it is inlined. A study, a node and
a recomputed bag therefore agree exactly, and NaN keeps its meaning on the topics.
"""
import contextlib
import pathlib

import numba

from pedestal_common import law_cache
from pedestal_common.law import Law


def done_file(owner, form='') -> pathlib.Path | None:
    """Return the path of a mark: a file that exists once the laws of a class are in the law cache. None without a law
    cache.

    owner: the class, such as the type of a unit's memory; form: text that distinguishes several sets of laws of one
    class, '' for a single set.
    """
    folder = law_cache.folder(owner)
    return pathlib.Path(folder, f'{owner.__module__}.{owner.__name__}{form}.done') if folder else None


def is_compiled(unit) -> bool:
    """Return True if the laws of a unit are in the law cache. The type of its memory identifies the laws."""
    mark = done_file(type(unit.memory))
    return mark is not None and mark.exists()


@contextlib.contextmanager
def compiled_once(unit):
    """Hold a lock during the first call of the laws of a unit, as a context.

    If several processes start with an empty cache, one compiles the laws. The others wait and then load the laws from
    the cache, so four beams start as fast as one.
    """
    mark = done_file(type(unit.memory))
    if mark is None or mark.exists():
        yield
        return
    with law_cache.locked_file(mark.with_suffix('.lock')):
        yield
        mark.touch()


def _law(law, **options):
    if numba.config.DISABLE_JIT:     # for a debugger: the laws run as plain Python
        return law
    dispatcher = Law(law, targetoptions={'nopython': True, 'error_model': 'numpy', **options})
    dispatcher.enable_caching()
    return dispatcher


def compiled(law):
    """Compile a law, as decorator. Division by zero gives inf or NaN as in numpy, never an exception."""
    return _law(law)


def inlined(law):
    """Compile a small law as `compiled` does, and inline it into its callers, as decorator.

    A loop over the lanes of the drive (trials that are computed together) becomes vector instructions only if its laws
    are inlined. A bank of filters is also faster.
    """
    return _law(law, forceinline=True)


@compiled
def assign(target, source):
    """Copy the array source into target, both (n, m). This replaces `target[:] = source`, because numba takes three
    seconds to compile numpy's check of the shapes."""
    for i in range(target.shape[0]):
        for j in range(target.shape[1]):
            target[i, j] = source[i, j]
