"""The cache of compiled laws, shared by processes that start together."""
import os
import subprocess
import sys

import pytest

LAW = """
from pedestal_common.compiled import compiled, compiled_once

@compiled
def law(x):
    return x.sum() + x.mean()

class Unit:
    def prepare(self):
        import numpy
        law(numpy.ones(3))

if __name__ == '__main__':
    from one_law import law as module
    unit = module.Unit()
    with compiled_once(unit):
        unit.prepare()
    print(sum(module.law.stats.cache_misses.values()))
"""


def compilations(folder, cache, count):
    """How often each of `count` processes that start together compiled the law."""
    environment = {**os.environ, 'XDG_CACHE_HOME': str(cache),
                   'PYTHONPATH': os.pathsep.join([str(folder), *filter(None, sys.path)])}
    processes = [subprocess.Popen([sys.executable, '-m', 'one_law.law'], env=environment, stdout=subprocess.PIPE,
                                  text=True) for _ in range(count)]
    return [int(process.communicate(timeout=120.0)[0]) for process in processes]


@pytest.fixture
def folder(tmp_path):
    """With a package `one_law`."""
    (tmp_path / 'one_law').mkdir()
    (tmp_path / 'one_law' / '__init__.py').touch()
    (tmp_path / 'one_law' / 'law.py').write_text(LAW)
    return tmp_path


def test_one_of_many_compiles(folder):
    assert sorted(compilations(folder, folder / 'cache', 4)) == [0, 0, 0, 1]
    assert compilations(folder, folder / 'cache', 1) == [0]


def test_without_a_cache_everyone_compiles(folder):
    (folder / 'cache').touch()
    assert compilations(folder, folder / 'cache', 2) == [1, 1]
