"""Nobody trusts the law cache: whatever is in its folder, a law gives its own result and no traceback."""
import os
import pathlib
import pickle
import random
import subprocess
import sys

import pytest

from pedestal_common import law_cache

LAWS = """
from pedestal_common.compiled import compiled, separate

@separate
def inner(x):
    return 2.0 * x

@compiled
def called(x):
    return inner(x) + 1.0

@compiled
def law(x):
    return x * called(x[0])
"""
RESULT = '[3. 6.] 7.0\n'
"""Standard output of a process that calls two of the LAWS."""


@pytest.fixture
def cache(tmp_path: pathlib.Path) -> pathlib.Path:
    """Return the path of an empty cache beside the module `cached_laws`."""
    (tmp_path / 'cached_laws.py').write_text(LAWS)
    return tmp_path / 'cache'


def run(cache: pathlib.Path, before: str = '') -> subprocess.CompletedProcess[str]:
    """Return an ended process that called two of the LAWS. before: code that runs first."""
    environment = {**os.environ, 'NUMBA_CACHE_DIR': str(cache),
                   'PYTHONPATH': os.pathsep.join([str(cache.parent), *filter(None, sys.path)])}
    code = (f'{before}\nimport numpy; from cached_laws import called, law; '
            'print(law(numpy.array([1.0, 2.0])), called(3.0))')
    return subprocess.run([sys.executable, '-c', code], env=environment, capture_output=True, text=True, timeout=240.0)


def files(cache: pathlib.Path) -> list[pathlib.Path]:
    """Return the paths of the files of a cache, after a first run has filled it."""
    assert (done := run(cache)).stdout == RESULT and done.stderr == ''
    found = sorted(path for path in (cache / 'pedestal').iterdir() if path.suffix != '.lock')
    # The translations of three laws, and the executables of all three: `inner` is separate.
    assert len(found) == 6
    return found


def truncated(path: pathlib.Path) -> None:
    path.write_bytes(path.read_bytes()[:-100])


def empty(path: pathlib.Path) -> None:
    path.write_bytes(b'')


def damaged(path: pathlib.Path) -> None:
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)


def foreign(path: pathlib.Path) -> None:
    path.write_bytes(random.Random(1).randbytes(10_000))


def of_another_class(path: pathlib.Path) -> None:
    law_cache.save(path, pathlib.Path)


def of_no_class(path: pathlib.Path) -> None:
    content = pickle.dumps(pathlib.PurePosixPath('/')).replace(b'pathlib', b'pathlix')
    path.write_bytes(law_cache._seal(path, content) + content)


def folder(path: pathlib.Path) -> None:
    path.unlink()
    path.mkdir()


@pytest.mark.parametrize('change', (truncated, foreign, *(
    pytest.param(change, marks=pytest.mark.thorough)
    for change in (empty, damaged, of_another_class, of_no_class, folder))))
def test_a_bad_file_is_compiled_anew(cache, change):
    for path in files(cache):
        change(path)
    done = run(cache)
    assert (done.stdout, done.returncode) == (RESULT, 0) and len(done.stderr.splitlines()) <= 1


@pytest.mark.thorough
def test_a_file_under_the_name_of_another_is_never_taken_for_it(cache):
    """The file of each law gets the content of the next one of its form."""
    found = files(cache)
    contents = [path.read_bytes() for path in found]
    for path, content in zip(found, contents[1:] + contents[:1]):
        path.write_bytes(content)
    done = run(cache)
    assert (done.stdout, done.stderr, done.returncode) == (RESULT, '', 0)


def test_a_cache_that_cannot_be_written_costs_one_line(cache):
    cache.write_text('a file where the folder would be')
    done = run(cache)
    assert done.stdout == RESULT
    assert done.stderr.splitlines() == [f'the law cache {cache}/pedestal cannot be written (Not a directory): each '
                                        'process compiles its laws; set NUMBA_CACHE_DIR to a folder that can be '
                                        'written']


def test_a_full_disk_costs_one_line_and_leaves_no_part_of_a_file(cache):
    """The limit of the size of a file stands for the end of the disk: a write ends in the middle."""
    limit = 'import resource; resource.setrlimit(resource.RLIMIT_FSIZE, (2000, 2000))'
    done = run(cache, limit)
    assert done.stdout == RESULT
    assert done.stderr.splitlines() == [f'the law cache {cache}/pedestal cannot be written (File too large): each '
                                        'process compiles its laws; set NUMBA_CACHE_DIR to a folder that can be '
                                        'written']
    assert [path.stat().st_size for path in (cache / 'pedestal').iterdir() if path.suffix != '.lock'] == []


@pytest.mark.thorough
def test_files_that_nobody_used_for_a_month_are_removed(cache):
    old = files(cache)[0]
    os.utime(old, (0, 0))
    other = cache / 'pedestal' / 'README.md'     # the folder of the cache may hold the files of a user
    other.touch()
    os.utime(other, (0, 0))
    (cache.parent / 'cached_laws.py').write_text(LAWS.replace('+ 1.0', '+ 1.0 + 0.0'))
    assert run(cache).stdout == RESULT
    left = {path.name for path in (cache / 'pedestal').iterdir()}
    assert other.name in left and old.name not in left


@pytest.mark.thorough
def test_the_use_of_a_file_keeps_it(cache):
    found = files(cache)
    for path in found:
        os.utime(path, (0, 0))
    run(cache)
    # The process loads the three executables, and no translation.
    assert [path.stat().st_mtime > 0 for path in found].count(True) == 3
