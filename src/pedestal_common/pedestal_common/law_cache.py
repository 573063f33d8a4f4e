"""Law cache: folders of compiled laws, one for each package, from which `compiled` loads the laws.

The name of a folder contains a digest of the sources on which the laws of the package depend. Changed code therefore
gets a new folder, and all checkouts with the same sources share one. Numba's own cache does not notice a change of a
called function in another file (numba documentation, "Notes on Caching").
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
"""Packages of the nodes that have laws. Such a package is called a column: its laws call only laws of the same package
and of pedestal_common."""

UPPER_PACKAGES = ('pedestal_hardware', 'pedestal_bringup', 'pedestal_analysis', 'pedestal_studies')
"""Packages above the columns; their laws may also call the laws of the columns, and of the packages that stand earlier
in this tuple."""

MAX_CACHE_AGE_DAYS = 7.0
"""Time without use after which a folder or file of the cache is deleted [days]."""
_ROOT = pathlib.Path(getattr(numba.config, 'CACHE_DIR', '') or user_cache_dir()) / 'pedestal'
if not _ROOT.is_absolute():
    # Without a home folder, as in a container, '~' is not expanded.
    _ROOT = pathlib.Path(tempfile.gettempdir()) / f'pedestal-{os.getuid()}'


def digest(packages) -> str:
    """Return a digest of the code of packages, without docstrings and comments, and of numba's version."""
    return _sha((package, _digest_of(package).encode()) for package in packages)


def _digest_of(package):
    """Return the digest of the code of one package.

    Because parsing the sources of all packages takes more than a second, the digest is stored in a file whose name is
    a digest of their bytes. After an edit of one package, only the sources of this package are parsed again.
    """
    sources = list(_sources(package))
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


def _sources(package):
    """Yield (name, bytes) of each module of a package."""
    spec = importlib.util.find_spec(package) if package != '__main__' else None
    if spec is not None and spec.origin is not None:
        folder = pathlib.Path(spec.origin).parent
        for path in sorted(folder.rglob('*.py')):
            yield f'{package}/{path.relative_to(folder)}', path.read_bytes()


def _sha(named):
    """Return a digest of [(name, bytes)] and of numba's version."""
    sha = hashlib.sha256(numba.__version__.encode())
    for name, content in named:
        sha.update(f'{name} {len(content)}\n'.encode() + content)
    return sha.hexdigest()[:16]


def _code_of(source) -> bytes:
    """Return the syntax tree of a module without docstrings, comments and line numbers."""
    tree = ast.parse(source)
    for node in ast.walk(tree):
        if isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)):
            # The text below a constant is its docstring: a statement that is only a text is never code.
            node.body = [part for part in node.body if not _is_text(part)]
    return ast.dump(tree).encode()


def _is_text(statement):
    return (isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant)
            and isinstance(statement.value.value, str))


def _path_of(package) -> pathlib.Path:
    """Return the path of the folder of a package, whose name contains the digest of its present sources."""
    # The laws of a package that is in neither tuple, such as a test, may call the laws of all packages in them.
    below = () if package == 'pedestal_common' or package in COLUMN_PACKAGES else (
        *COLUMN_PACKAGES, *(UPPER_PACKAGES[:UPPER_PACKAGES.index(package)] if package in UPPER_PACKAGES
                            else UPPER_PACKAGES))
    return _ROOT / f'{package}-{digest(("pedestal_common", *below, package))}'


@functools.cache
def _folder_of(package) -> str | None:
    """Return the folder of the laws of a package, None if it cannot be written.

    The folder is named after the sources of the package, and of all packages whose laws its laws may call. Folders and
    files of the cache that were not used for MAX_CACHE_AGE_DAYS are deleted.
    """
    try:
        _ROOT.mkdir(parents=True, exist_ok=True)    # first, because the digest has no use without a cache
        folder = _path_of(package)
        folder.mkdir(exist_ok=True)
        os.utime(folder)
        for other in _ROOT.iterdir():
            if time.time() - other.stat().st_mtime > MAX_CACHE_AGE_DAYS * 86400:
                shutil.rmtree(other) if other.is_dir() else other.unlink()
    except OSError:
        return None
    return str(folder) if os.access(folder, os.W_OK) else None


def folder(thing) -> str | None:
    """Return the folder for the package of a law or a class; None if the folder cannot be written."""
    return _folder_of(thing.__module__.partition('.')[0])


@contextlib.contextmanager
def locked_file(path):
    """Hold the lock of a file, as a context; other processes wait for the lock."""
    with path.open('w') as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield


class _Place(UserProvidedCacheLocator):
    """Place of a law in the cache, in the form that numba expects.

    Its folder is named after the module, not after the path of the file. A checkout therefore finds the laws that
    another checkout of the same sources has compiled. The place contains neither a line number nor the bytes of the
    file, because an edited docstring changes both. The name of the package's folder already identifies the code.
    """

    def __init__(self, law, file):
        super().__init__(law, file)
        self._cache_path = os.path.join(folder(law), law.__module__)
        # The qualified name of a law that is made inside a function contains '<locals>'.
        self._code = law.__code__ if '<' in law.__qualname__ else None

    def get_source_stamp(self):
        """Return None, in place of numba's stamp of the source file."""

    def get_disambiguator(self):
        """Return a text that distinguishes laws of the same name. Laws that are made inside one function have one
        name, and may have different code."""
        if self._code is None:
            return '0'
        constants = [value for value in self._code.co_consts if not inspect.iscode(value)]
        return _sha([('law', repr((self._code.co_code, self._code.co_names, constants)).encode())])

    @classmethod
    def from_function(cls, law, file):
        """Return the place of a law, for numba."""
        return cls(law, file)


class Contents(CompileResultCacheImpl):
    """Conversion of a compiled law to the form that is saved, and back; overridden for laws that are kept as LLVM code
    without machine code (law._Translated)."""
    _locator_classes = [_Place]


class Cache(FunctionCache):
    """Cache of a law, with a lock for saving and a faster loading than numba's cache.

    To save code, numba reads the index, chooses the name of a file, writes the index and then the code. Without the
    lock, two processes that save one law for two signatures at once may lose an entry, or mix up the two codes.

    To load a law, numba first prepares its compiler, which takes a third of a second and imports all of scipy.linalg.
    This class initialises only numba's run-time library (NRT). The compiler is prepared at the first compilation.
    """
    _impl_class = Contents

    def load_overload(self, sig, target_context):
        """Return a law for these types; None where it is not cached."""
        rtsys.initialize(target_context)
        with self._guard_against_spurious_io_errors():
            return self._load_overload(sig, target_context)

    def _save_overload(self, sig, data):
        """Save a law, except after an edit of its sources since this process chose the folder. This avoids new code
        in the folder of the old sources."""
        path = pathlib.Path(self.cache_path)
        if path.parent != _path_of(path.name.partition('.')[0]):
            return
        with locked_file(path.with_name('index.lock')):
            super()._save_overload(sig, data)
