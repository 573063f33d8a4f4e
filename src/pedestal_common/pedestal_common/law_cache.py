"""Law cache: a folder of files, one for each compiled law and set of argument types, from which `compiled` loads laws.

The name of a file contains a digest of everything on which the compiled code depends (law_key). A changed law
therefore gets another file, all checkouts with equal laws share one, and no file is ever changed. The content of a
file is not trusted: a file that is cut, empty or foreign is compiled again.
"""
import contextlib
import fcntl
import functools
import hashlib
import os
import pathlib
import pickle
import re
import sys
import tempfile
import time
from collections.abc import Iterator

import llvmlite
import numba
import numpy
from numba.core.registry import cpu_target
from numba.core.serialize import dumps
from numba.misc.appdirs import user_cache_dir

from pedestal_common.law_key import digest

MAX_CACHE_AGE_DAYS = 30.0  # time without use after which a file of the cache is deleted [days]
TOUCH_PERIOD_S = 86400.0  # time after which the use of a file is noted again [s]
_REPORTED_VARIABLE = 'PEDESTAL_LAW_CACHE_REPORTED'  # environment variable that is set after the report of a failure
DIGEST_BYTES = 32  # length of the digest of its content at the beginning of a file [bytes]

_ROOT = pathlib.Path(getattr(numba.config, 'CACHE_DIR', '') or user_cache_dir()) / 'pedestal'
if not _ROOT.is_absolute():
    # Without a home folder, as in a container, '~' is not expanded.
    _ROOT = pathlib.Path(tempfile.gettempdir()) / f'pedestal-{os.getuid()}'


_OWN_NAME = re.compile(r'.+-[0-9a-f]{32}(\.lock)?|\.law-.+')
"""Names of the files that this module makes; nothing else in the folder is deleted."""


@functools.cache
def _machine() -> str:
    """Return a text that identifies what compiles: Python, libraries and processor."""
    processor = cpu_target.target_context.codegen().magic_tuple()
    return repr((sys.version_info[:2], numba.__version__, llvmlite.__version__, numpy.__version__, processor,
                 *(getattr(numba.config, option) for option in ('OPT', 'BOUNDSCHECK'))))


def file(name: str, *identity: str) -> pathlib.Path:
    """Return the path of the file of a thing with this name and identity, which may not exist."""
    return _ROOT / f'{name.replace("<", "(").replace(">", ")")}-{digest((_machine(), *identity))}'


def _seal(path: pathlib.Path, content: bytes) -> bytes:
    """Return the digest that proves that a content is whole, and that it belongs to the name of this file."""
    return hashlib.sha256(path.name.encode() + content).digest()


def load(path: pathlib.Path) -> object:
    """Return the content of a file; None if there is no such file, or if it is damaged."""
    with contextlib.suppress(OSError):
        data = path.read_bytes()
        if data[:DIGEST_BYTES] == _seal(path, data[DIGEST_BYTES:]):
            with contextlib.suppress(OSError):      # a folder that another user owns
                if time.time() - path.stat().st_mtime > TOUCH_PERIOD_S:
                    os.utime(path)
            # The digest guards against damage. The folder belongs to the user, as the program does.
            with contextlib.suppress(Exception):    # of a class that no longer exists
                return pickle.loads(data[DIGEST_BYTES:])
    return None


def save(path: pathlib.Path, content: object) -> None:
    """Write a file at once, so that no process reads a part of it. If that fails, write one line to stderr."""
    data = dumps(content)
    try:
        _ROOT.mkdir(mode=0o700, parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(dir=_ROOT, prefix='.law-', delete=False) as written:
            try:
                written.write(_seal(path, data) + data)
                written.flush()
                os.replace(written.name, path)
            except OSError:
                os.unlink(written.name)
                raise
    except OSError as error:
        _report(error.strerror or str(error))
    else:
        _remove_old_files()


def _report(reason: str) -> None:
    """Write one line to stderr for this process and its children, which all have the same cache."""
    if _REPORTED_VARIABLE not in os.environ:
        os.environ[_REPORTED_VARIABLE] = '1'
        print(f'the law cache {_ROOT} cannot be written ({reason}): each process compiles its laws; set '
              'NUMBA_CACHE_DIR to a folder that can be written', file=sys.stderr)


@functools.cache
def _remove_old_files() -> None:
    """Delete the files that were not used for MAX_CACHE_AGE_DAYS, once in a process that saves."""
    for path in _ROOT.iterdir():
        with contextlib.suppress(OSError):
            if _OWN_NAME.fullmatch(path.name) and time.time() - path.stat().st_mtime > MAX_CACHE_AGE_DAYS * 86400:
                path.unlink()


@contextlib.contextmanager
def lock(path: pathlib.Path) -> Iterator[None]:
    """Hold the lock of a file of the cache, as a context; other processes wait. Without a folder there is no lock."""
    name = path.with_name(f'{path.name}.lock')
    with contextlib.ExitStack() as stack:
        with contextlib.suppress(OSError):      # some file systems have no locks
            _ROOT.mkdir(mode=0o700, parents=True, exist_ok=True)
            held = stack.enter_context(name.open('w'))
            fcntl.flock(held, fcntl.LOCK_EX)
            # A copy of this process made by fork would keep the lock. A process that waits for the deleted file finds
            # the law when it gets the lock.
            stack.callback(fcntl.flock, held, fcntl.LOCK_UN)
            stack.callback(name.unlink, missing_ok=True)
        yield
