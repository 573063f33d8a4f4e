"""The cache of compiled laws, shared by processes that start together."""
import os
import shutil
import subprocess
import sys

import pytest

LAW = """
import sys
import time
import typing

import numpy
from numba.core.caching import IndexDataCacheFile

from pedestal_common.compiled import compiled, compiled_once

@compiled
def law(x):
    return x.sum() + x.mean()

class Memory(typing.NamedTuple):
    pass

class Unit:
    memory = Memory()

    def prepare(self):
        law(numpy.ones(3))

if __name__ == '__main__':
    from one_law import law as module
    unit = module.Unit()
    if len(sys.argv) > 1:
        read = IndexDataCacheFile._load_index
        IndexDataCacheFile._load_index = lambda index: (read(index), time.sleep(1.0))[0]
        module.law(numpy.ones(3, sys.argv[1]))
    else:
        with compiled_once(unit):
            unit.prepare()
    print(sum(module.law.stats.cache_misses.values()))
"""

TYPES = ('f8', 'f4', 'i8')


def environment(folder, cache):
    return {**os.environ, 'XDG_CACHE_HOME': str(cache),
            'PYTHONPATH': os.pathsep.join([str(folder), *filter(None, sys.path)])}


def compilations(folder, cache, arguments):
    """How often each of the processes with these arguments, which start together, compiled the law."""
    processes = [subprocess.Popen([sys.executable, '-m', 'one_law.law', *argument], env=environment(folder, cache),
                                  stdout=subprocess.PIPE, text=True) for argument in arguments]
    return [int(process.communicate(timeout=120.0)[0]) for process in processes]


@pytest.fixture
def folder(tmp_path):
    """With a package `one_law`."""
    (tmp_path / 'one_law').mkdir()
    (tmp_path / 'one_law' / '__init__.py').touch()
    (tmp_path / 'one_law' / 'law.py').write_text(LAW)
    return tmp_path


def test_one_of_many_compiles(folder):
    assert sorted(compilations(folder, folder / 'cache', [()] * 4)) == [0, 0, 0, 1]
    assert compilations(folder, folder / 'cache', [()]) == [0]


def test_what_is_in_the_cache_is_loaded_without_what_compiles(tmp_path):
    """To import which takes longer than everything else; it is there for what is compiled afterwards."""
    code = ('import sys, numba, numpy; from pedestal_common.compiled import assign; x = numpy.zeros((2, 2)); '
            'assign(x, x); print(sum(assign.stats.cache_misses.values()), "scipy.linalg" in sys.modules); '
            'numba.njit(lambda x: assign(x, 1.0 + x))(x); print(x.sum())')
    for said in ('1 True\n4.0\n', '0 False\n4.0\n'):
        done = subprocess.run([sys.executable, '-c', code], capture_output=True, text=True, timeout=120.0,
                              env=environment(tmp_path, tmp_path / 'cache'))
        assert (done.stdout, done.stderr) == (said, '')


def test_a_checkout_finds_what_another_of_the_same_sources_compiled(folder):
    """And not what was compiled of others."""
    law = folder / 'one_law' / 'law.py'
    assert compilations(folder, folder / 'cache', [()]) == [1]
    shutil.copytree(folder / 'one_law', folder / 'elsewhere' / 'one_law')
    assert compilations(folder / 'elsewhere', folder / 'cache', [()]) == [0]
    law.write_text(law.read_text() + '# changed')
    assert compilations(folder, folder / 'cache', [()]) == [1]


def test_laws_saved_at_once_are_all_kept(folder):
    """Of one law for several signatures, whose index is one file."""
    types = [(name,) for name in TYPES]
    assert compilations(folder, folder / 'cache', types) == [1] * len(types)
    assert compilations(folder, folder / 'cache', types) == [0] * len(types)


def test_without_a_cache_everyone_compiles(folder):
    (folder / 'cache').touch()
    assert compilations(folder, folder / 'cache', [()] * 2) == [1, 1]
