"""The decorators of every compiled law.

Strict IEEE arithmetic (no fastmath): a law gives the same bits wherever it is inlined, so a study, a
node and a recomputed bag agree exactly, and NaN keeps its meaning on the topics.
"""
import contextlib
import pathlib

import numba

from pedestal_common import law_cache
from pedestal_common.law import Law


def done(kind, form='') -> pathlib.Path | None:
    """The file that says that the laws of a class, in a form of them, are in the cache; None where there is none."""
    folder = law_cache.folder(kind)
    return pathlib.Path(folder, f'{kind.__module__}.{kind.__name__}{form}.done') if folder else None


def is_compiled(unit) -> bool:
    """Whether the laws of a unit, which its memory tells apart, are in the cache."""
    mark = done(type(unit.memory))
    return mark is not None and mark.exists()


@contextlib.contextmanager
def compiled_once(unit):
    """Around the first call of the laws of a unit: of the processes that start with a cold cache one compiles them,
    the others wait for it and find them there. Four beams start as fast as one."""
    mark = done(type(unit.memory))
    if mark is None or mark.exists():
        yield
        return
    with law_cache.locked_file(mark.with_suffix('.lock')):
        yield
        mark.touch()


def _law(law, **options):
    if numba.config.DISABLE_JIT:
        return law
    dispatcher = Law(law, targetoptions={'nopython': True, 'error_model': 'numpy', **options})
    dispatcher.enable_caching()
    return dispatcher


def compiled(law):
    """Decorator of a law. Division by zero gives inf or NaN as in numpy, never an exception."""
    return _law(law)


def inlined(law):
    """Decorator of a small law: `compiled`, and made part of whoever calls it. Without that no loop over lanes of the
    drive becomes vectors, and a bank of filters is slower."""
    return _law(law, forceinline=True)


@compiled
def assign(target, source):
    """target[:, :] = source; numpy's own check of the shapes takes numba three seconds to compile."""
    for i in range(target.shape[0]):
        for j in range(target.shape[1]):
            target[i, j] = source[i, j]
