"""Where compiled laws are kept: a folder named after all sources of the product, which any checkout of them shares.

Numba's cache does not see that a callee in another file changed (numba documentation, "Notes on Caching").
"""
import ast
import contextlib
import fcntl
import functools
import hashlib
import importlib.util
import inspect
import os
import pathlib
import shutil
import tempfile
import time

import numba
from numba.core.caching import CompileResultCacheImpl, FunctionCache, UserProvidedCacheLocator
from numba.core.runtime import rtsys
from numba.misc.appdirs import user_cache_dir

COLUMN_PACKAGES = ('ship_motion_sim', 'tracking_receiver_sim', 'acu_tracker', 'adu_drive')
UPPER_PACKAGES = ('pedestal_bringup', 'pedestal_analysis', 'pedestal_studies')
"""Packages with laws above the columns; a law may call those of the packages before its own."""

MAX_CACHE_AGE_DAYS = 7.0
_ROOT = pathlib.Path(numba.config.CACHE_DIR or user_cache_dir()) / 'pedestal'
if not _ROOT.is_absolute():
    # A user without a home, as in a container: '~' stays as it is.
    _ROOT = pathlib.Path(tempfile.gettempdir()) / f'pedestal-{os.getuid()}'


def digest(packages) -> str:
    """Return a digest of the code of packages, without docstrings and comments, and of the compiler's version.

    To parse all sources takes 0.4 s, so the digest is kept in a file that is named after their bytes.
    """
    sources = list(_sources(packages))
    kept = _ROOT / f'digest-{_sha(sources)}'
    with contextlib.suppress(OSError):
        return kept.read_text()
    of_code = _sha((name, _code_of(source)) for name, source in sources)
    with contextlib.suppress(OSError):
        _ROOT.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile('w', dir=_ROOT, delete=False) as written:
            written.write(of_code)
        os.replace(written.name, kept)
    return of_code


def _sources(packages):
    """(name, bytes) of each module of packages."""
    for package in packages:
        spec = importlib.util.find_spec(package) if package != '__main__' else None
        if spec is not None and spec.origin is not None:
            folder = pathlib.Path(spec.origin).parent
            for path in sorted(folder.rglob('*.py')):
                yield f'{package}/{path.relative_to(folder)}', path.read_bytes()


def _sha(named):
    sha = hashlib.sha256(numba.__version__.encode())
    for name, content in named:
        sha.update(f'{name} {len(content)}\n'.encode() + content)
    return sha.hexdigest()[:16]


def _code_of(source) -> bytes:
    """The syntax tree of a module without docstrings, comments and line numbers."""
    tree = ast.parse(source)
    for node in ast.walk(tree):
        if isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)):
            # The text below a constant is its docstring: no text that stands alone is code.
            node.body = [part for part in node.body if not _is_text(part)]
    return ast.dump(tree).encode()


def _is_text(statement):
    return (isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant)
            and isinstance(statement.value.value, str))


@functools.cache
def _folder_of(package) -> str | None:
    """The cache of one package's laws: named after its own sources and all it may call."""
    below = () if package == 'pedestal_common' or package in COLUMN_PACKAGES else (
        *COLUMN_PACKAGES, *(UPPER_PACKAGES[:UPPER_PACKAGES.index(package)] if package in UPPER_PACKAGES
                            else UPPER_PACKAGES))
    folder = _ROOT / f'{package}-{digest(("pedestal_common", *below, package))}'
    try:
        folder.mkdir(parents=True, exist_ok=True)
        os.utime(folder)
        for other in _ROOT.iterdir():
            if time.time() - other.stat().st_mtime > MAX_CACHE_AGE_DAYS * 86400:
                shutil.rmtree(other) if other.is_dir() else other.unlink()
    except OSError:
        return None
    return str(folder) if os.access(folder, os.W_OK) else None


def folder(thing) -> str | None:
    """The cache of the package that a law or a type is of; None where there is none."""
    return _folder_of(thing.__module__.partition('.')[0])


@contextlib.contextmanager
def locked_file(path):
    """Hold the lock of a file, which other processes wait for."""
    with path.open('w') as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield


class _Place(UserProvidedCacheLocator):
    """The folder of a law is named after its module, not after the path of its file: a checkout finds what another of
    the same sources has compiled. The place of a law has neither a line number nor the bytes of its file, which an
    edited docstring changes; the folder of the package stands for its code."""

    def __init__(self, law, file):
        super().__init__(law, file)
        self._cache_path = os.path.join(folder(law), law.__module__)
        self._code = law.__code__ if '<' in law.__qualname__ else None

    def get_source_stamp(self):
        """Return nothing; numba asks for the bytes of the file."""

    def get_disambiguator(self):
        """Return what tells laws of one name apart: those that one function makes may have other code."""
        if self._code is None:
            return '0'
        constants = [value for value in self._code.co_consts if not inspect.iscode(value)]
        return _sha([('law', repr((self._code.co_code, self._code.co_names, constants)).encode())])

    @classmethod
    def from_function(cls, law, file):
        """The place of a law; numba asks for it."""
        return cls(law, file)


class Contents(CompileResultCacheImpl):
    """What is kept of a law; overridden where that is no executable."""
    _locator_classes = (_Place,)


class Cache(FunctionCache):
    """Of two processes that save a law for two signatures at once one may lose its entry, or find the other's code
    under it: numba reads the index, chooses a name, writes the index and then the code. Here one waits.

    To load a law numba makes ready to compile, for a third of a second and with all of scipy.linalg. What is loaded
    asks for its runtime only; who compiles makes ready by himself."""
    _impl_class = Contents

    def load_overload(self, sig, target_context):
        """A law for these types; None where it is not kept."""
        rtsys.initialize(target_context)
        with self._guard_against_spurious_io_errors():
            return self._load_overload(sig, target_context)

    def _save_overload(self, sig, data):
        with locked_file(pathlib.Path(self.cache_path).with_name('index.lock')):
            super()._save_overload(sig, data)
