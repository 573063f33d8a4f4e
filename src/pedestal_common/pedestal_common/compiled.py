"""Decorators of every compiled law.

Arithmetic is strict IEEE (no fastmath): a law gives the same bits wherever it is inlined, so a study, a node and a
recomputed bag agree exactly, and NaN keeps its meaning on the topics.
"""
import contextlib
import pathlib

import numba

from pedestal_common import law_cache
from pedestal_common.law import Law


def done_file(owner, form='') -> pathlib.Path | None:
    """Return the file that exists once the laws of a class are cached; None without a law cache.

    owner: the class; form: text that distinguishes several sets of laws of one class, '' for a single set.
    """
    folder = law_cache.folder(owner)
    return pathlib.Path(folder, f'{owner.__module__}.{owner.__name__}{form}.done') if folder else None


def is_compiled(unit) -> bool:
    """Return True if the laws of a unit, which its memory identifies, are in the cache."""
    mark = done_file(type(unit.memory))
    return mark is not None and mark.exists()


@contextlib.contextmanager
def compiled_once(unit):
    """Hold the lock around the first call of the laws of a unit. Of the processes that start with a cold cache one
    compiles the laws; the others wait and find them in the cache, so four beams start as fast as one."""
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
    """Compile a small law as `compiled` does, and inline it into its callers, as decorator. Without this no loop over
    lanes of the drive becomes vectors, and a bank of filters is slower."""
    return _law(law, forceinline=True)


@compiled
def assign(target, source):
    """Copy source into target, both of two dimensions. Numba takes three seconds to compile numpy's own check of the
    shapes."""
    for i in range(target.shape[0]):
        for j in range(target.shape[1]):
            target[i, j] = source[i, j]
