"""The one decorator of every compiled law.

Strict IEEE arithmetic (no fastmath): a law gives the same bits wherever it is inlined, so a study, a
node and a recomputed bag agree exactly, and NaN keeps its meaning on the topics.

Numba's cache does not see that a callee in another file changed (numba documentation, "Notes on
Caching"), so the cache lives in a folder named after all sources of the product. It holds what any checkout of
them compiled.
"""
import contextlib
import fcntl
import functools
import hashlib
import importlib.util
import os
import pathlib
import shutil
import tempfile
import time

import numba
from numba.core.caching import CompileResultCacheImpl, FunctionCache, UserProvidedCacheLocator
from numba.core.runtime import rtsys
from numba.misc.appdirs import user_cache_dir

COLUMNS = ('ship_motion_sim', 'tracking_receiver_sim', 'acu_tracker', 'adu_drive')
KEPT_DAYS = 7.0
_ROOT = pathlib.Path(numba.config.CACHE_DIR or user_cache_dir()) / 'pedestal'
if not _ROOT.is_absolute():
    # A user without a home, as in a container: '~' stays as it is.
    _ROOT = pathlib.Path(tempfile.gettempdir()) / f'pedestal-{os.getuid()}'


def digest(packages) -> str:
    """Of the sources of packages and the version of the compiler."""
    sha = hashlib.sha256(numba.__version__.encode())
    for package in packages:
        spec = importlib.util.find_spec(package) if package != '__main__' else None
        if spec is not None and spec.origin is not None:
            for path in sorted(pathlib.Path(spec.origin).parent.rglob('*.py')):
                sha.update(path.read_bytes())
    return sha.hexdigest()[:16]


@functools.cache
def _folder_of(package) -> str | None:
    """The cache of one package's laws: named after its own sources and all it may call."""
    columns = () if package == 'pedestal_common' else (package,) if package in COLUMNS else COLUMNS
    folder = _ROOT / f'{package}-{digest(("pedestal_common", *columns, package))}'
    try:
        folder.mkdir(parents=True, exist_ok=True)
        os.utime(folder)
        for other in _ROOT.iterdir():
            if time.time() - other.stat().st_mtime > KEPT_DAYS * 86400:
                shutil.rmtree(other, ignore_errors=True)
    except OSError:
        return None
    return str(folder) if os.access(folder, os.W_OK) else None


def _cache_folder(thing):
    """The cache of the package that a law or a type is of; None where there is none."""
    return _folder_of(thing.__module__.partition('.')[0])


def done(kind, form='') -> pathlib.Path | None:
    """The file that says that the laws of a class, in a form of them, are in the cache; None where there is none."""
    folder = _cache_folder(kind)
    return pathlib.Path(folder, f'{kind.__module__}.{kind.__name__}{form}.done') if folder else None


def is_compiled(unit) -> bool:
    """Whether the laws of a unit, which its memory tells apart, are in the cache."""
    mark = done(type(unit.memory))
    return mark is not None and mark.exists()


@contextlib.contextmanager
def _alone(path):
    """Hold the lock of a file, which other processes wait for."""
    with path.open('w') as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield


@contextlib.contextmanager
def compiled_once(unit):
    """Around the first call of the laws of a unit: of the processes that start with a cold cache one compiles them,
    the others wait for it and find them there. Four beams start as fast as one."""
    mark = done(type(unit.memory))
    if mark is None or mark.exists():
        yield
        return
    with _alone(mark.with_suffix('.lock')):
        yield
        mark.touch()


class _Place(UserProvidedCacheLocator):
    """The folder of a law is named after its module, not after the path of its file: a checkout finds what another of
    the same sources has compiled."""

    def __init__(self, law, file):
        super().__init__(law, file)
        self._cache_path = os.path.join(_cache_folder(law), law.__module__)

    @classmethod
    def from_function(cls, law, file):
        return cls(law, file)


class _Contents(CompileResultCacheImpl):
    _locator_classes = (_Place,)


class _Cache(FunctionCache):
    """Of two processes that save a law for two signatures at once one may lose its entry, or find the other's code
    under it: numba reads the index, chooses a name, writes the index and then the code. Here one waits.

    To load a law numba makes ready to compile, for a third of a second and with all of scipy.linalg. What is loaded
    asks for its runtime only; who compiles makes ready by himself."""
    _impl_class = _Contents

    def load_overload(self, signature, target):
        rtsys.initialize(target)
        with self._guard_against_spurious_io_errors():
            return self._load_overload(signature, target)

    def _save_overload(self, signature, data):
        with _alone(pathlib.Path(self.cache_path).with_name('index.lock')):
            super()._save_overload(signature, data)


def compiled(law):
    """Decorator of a law. Division by zero gives inf or NaN as in numpy, never an exception. Nobody calls a law from
    C: without the wrappers for it a tenth of the time to compile is saved."""
    dispatcher = numba.njit(error_model='numpy', no_cfunc_wrapper=True)(law)
    if _cache_folder(law) is not None:
        dispatcher._cache = _Cache(law)
    return dispatcher


def inlined(law):
    """Decorator of a small law: `compiled`, and made part of whoever calls it. Without that no loop over lanes of the
    drive becomes vectors, and a bank of filters is slower."""
    dispatcher = compiled(law)
    dispatcher.targetoptions['forceinline'] = True
    return dispatcher


@compiled
def assign(target, source):
    """target[:, :] = source; numpy's own check of the shapes takes numba three seconds to compile."""
    for i in range(target.shape[0]):
        for j in range(target.shape[1]):
            target[i, j] = source[i, j]
