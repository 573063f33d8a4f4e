"""The cache of compiled laws, shared by processes that start together."""
import contextlib
import os
import shutil
import subprocess
import sys

import pytest
from numba.core import types

from pedestal_common import law_cache
from pedestal_common.compiled import compiled, inlined
from pedestal_common.law import by_type

LAW = """
import sys
import time
import typing

import numpy
from numba.core.caching import IndexDataCacheFile

from pedestal_common.compiled import compiled, compiled_once
from pedestal_common.law import Law

@compiled
def law(x):
    return x[0] + x[1]

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
        write = IndexDataCacheFile._save_index
        IndexDataCacheFile._save_index = lambda *index: (time.sleep(1.0), write(*index))
        module.law(numpy.ones(3, sys.argv[1]))
    else:
        translate = Law._translate
        Law._translate = lambda *law: (time.sleep(1.0), translate(*law))[1]
        with compiled_once(unit):
            unit.prepare()
    print(sum(module.law.stats.cache_misses.values()))
"""

TYPES = ('f8', 'f4')


def environment(folder, cache):
    """Of a process that has a cache without laws, with the digests of the sources of the product."""
    with contextlib.suppress(OSError):
        (cache / 'pedestal').mkdir(parents=True)
        for kept in law_cache._ROOT.glob('digest-*'):
            shutil.copy(kept, cache / 'pedestal')
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
    assert sorted(compilations(folder, folder / 'cache', [()] * 3)) == [0, 0, 1]


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
    """Of the same but for docstrings and comments, and not what was compiled of others."""
    law = folder / 'one_law' / 'law.py'
    assert compilations(folder, folder / 'cache', [()]) == [1]
    shutil.copytree(folder / 'one_law', folder / 'elsewhere' / 'one_law')
    assert compilations(folder / 'elsewhere', folder / 'cache', [()]) == [0]
    law.write_text('"""A module."""\n# It holds one law.\n' + law.read_text().replace(
        'def law(x):', 'def law(x):\n    """Return a sum."""'))
    assert compilations(folder, folder / 'cache', [()]) == [0]
    law.write_text(law.read_text().replace('x[1]', 'x[2]'))
    assert compilations(folder, folder / 'cache', [()]) == [1]


def test_a_process_saves_no_law_of_sources_that_changed_under_it(folder):
    """The second module is imported after the edit, so its new law would be saved in the folder of the old sources."""
    (folder / 'one_law' / 'late.py').write_text(LAW)
    code = ('import numpy, pathlib, one_law.law; path = pathlib.Path(one_law.law.__file__).with_name("late.py"); '
            'text = path.read_text(); path.write_text(text.replace("x[1]", "x[2]")); import one_law.late; '
            'one_law.late.law(numpy.ones(3)); path.write_text(text)')
    subprocess.run([sys.executable, '-c', code], env=environment(folder, folder / 'cache'), check=True, timeout=120.0)
    saved = lambda: [str(path) for path in (folder / 'cache').rglob('*.nbc') if 'one_law' in str(path)]  # noqa: E731
    assert saved() == []
    assert compilations(folder, folder / 'cache', [()]) == [1] and saved()


def test_laws_saved_at_once_are_all_kept(folder):
    """Of one law for several signatures, whose index is one file."""
    types = [(name,) for name in TYPES]
    assert compilations(folder, folder / 'cache', types) == [1] * len(types)
    assert compilations(folder, folder / 'cache', types) == [0] * len(types)


POWERS = """
from pedestal_common.compiled import compiled

@compiled
def real(x, n):
    return x ** n

@compiled
def whole(x, n):
    return x ** n

@compiled
def total(x, i, n):
    return real(x, n) + whole(i, n)
"""


def test_laws_translated_by_different_processes_keep_their_own_functions_of_numba(folder):
    """Numba gives its powers of floats and of integers the same symbol if each is the first in its process."""
    (folder / 'one_law' / 'powers.py').write_text(POWERS)
    for call, value in (('real(1.5, 3)', 3.375), ('whole(7, 3)', 343), ('total(1.5, 7, 3)', 346.375),
                        ('(real(1.5, 3), whole(7, 3), total(1.5, 7, 3))', (3.375, 343, 346.375))):
        done = subprocess.run([sys.executable, '-c', f'from one_law.powers import *; print({call})'],
                              env=environment(folder, folder / 'cache'), stdout=subprocess.PIPE, text=True,
                              timeout=120.0)
        assert done.stdout == f'{value}\n'


def test_without_a_cache_everyone_compiles(folder):
    (folder / 'cache').touch()
    assert compilations(folder, folder / 'cache', [()] * 2) == [1, 1]


@compiled
def square(x):
    return x * x


@inlined
def cube(x):
    return x * square(x)


@compiled
def sum_of_powers(x):
    return cube(x) + square(x)


def test_only_what_python_calls_becomes_machine_code():
    assert sum_of_powers(3.0) == 36.0
    assert len(sum_of_powers.overloads) == 1 and not square.overloads and not cube.overloads
    assert (square(3.0), cube(2), sum_of_powers(1)) == (9.0, 8, 2)
    assert len(square.overloads) == 1


def test_a_law_that_a_function_makes_is_that_one():
    """Two of the same name and types, with other numbers in them."""
    def times(factor):
        @compiled
        def law(x):
            return factor * square(x)

        @compiled
        def called(x):
            return law(x)
        return called

    assert [times(factor)(2.0) for factor in (1.0, 3.0)] == [4.0, 12.0]


CALLER = """
import sys
from pedestal_common.compiled import compiled
from pedestal_common.law import Law
from two_laws.called import called

@compiled
def law(x):
    return called(x) + 1.0

if __name__ == '__main__':
    from two_laws import law as module
    translated, translate = [], Law._translate
    Law._translate = lambda law, args: (translated.append(law.py_func.__name__), translate(law, args))[1]
    print(module.law(2.0), *translated)
"""


def test_a_law_finds_what_another_process_translated_of_it(tmp_path):
    package = tmp_path / 'two_laws'
    package.mkdir()
    (package / '__init__.py').touch()
    (package / 'called.py').write_text('from pedestal_common.compiled import compiled, inlined\n\n\n'
                                       '@inlined\ndef inner(x):\n    return 2.0 * x\n\n\n'
                                       '@compiled\ndef called(x):\n    return inner(x) * x\n')
    (package / 'law.py').write_text(CALLER)

    def said(code):
        done = subprocess.run([sys.executable, *code], capture_output=True, text=True, timeout=120.0,
                              env=environment(tmp_path, tmp_path / 'cache'))
        assert not done.stderr
        return done.stdout.strip()

    assert said(['-c', 'from two_laws.called import called; print(called(2.0))']) == '8.0'
    assert said(['-m', 'two_laws.law']) == '9.0 law'
    assert said(['-m', 'two_laws.law']) == '9.0'


def by_kind(x):
    raise NotImplementedError


@compiled
def of_kinds(x, y):
    return by_kind(x) + by_kind(y)


by_type(by_kind, lambda kind: square if kind == types.float64 else cube)


def test_a_function_is_the_law_for_its_type():
    assert of_kinds(3.0, 2) == 17.0


STOPPED = """
import os
import signal
import typing

from numba.core.codegen import JITCodeLibrary
from pedestal_common.node import shell

made = JITCodeLibrary._object_compiled_hook

def told(cls, module, code):
    # As if it had come while LLVM was at work.
    if shell._compiling and not shell._stop:
        os.kill(os.getpid(), signal.SIGINT)
    made(module, code)

JITCodeLibrary._object_compiled_hook = classmethod(told)
import numba
from pedestal_common.compiled import compiled

numba.njit(lambda x: x)(1.0)    # imports what cannot be imported again by the call after the stop

@compiled
def law(x):
    return x + 1.0

class Memory(typing.NamedTuple):
    pass

class Unit:
    memory = Memory()

    def prepare(self):
        while True:
            law(2.0)

shell.stop_on_signals()
try:
    shell.Shell.prepare(None, Unit())
except shell.Stopped:
    print('stopped', law(2.0))
"""


def test_a_signal_while_machine_code_is_made_stops_the_node_and_loses_nothing(tmp_path):
    (tmp_path / 'stopped.py').write_text(STOPPED)
    done = subprocess.run([sys.executable, '-m', 'stopped'], capture_output=True, text=True, timeout=120.0,
                          env=environment(tmp_path, tmp_path / 'cache'))
    assert (done.stdout, done.stderr, done.returncode) == ('stopped 3.0\n', '', 0)


IGNORED = """
import os
import signal
import time
import typing
import weakref

from pedestal_common.node import shell

class Memory(typing.NamedTuple):
    pass

class Module:
    def __del__(self):
        if not callbacks:
            os.kill(os.getpid(), signal.SIGINT)

def callback(_reference):
    os.kill(os.getpid(), signal.SIGINT)

class Unit:
    memory = Memory()

    def prepare(self):
        module = Module()
        reference = weakref.ref(module, callback) if callbacks else None
        del module
        time.sleep(20.0)
        print('went on')

shell.stop_on_signals()
for callbacks in False, True:
    shell._stop.clear()
    try:
        shell.Shell.prepare(None, Unit())
    except shell.Stopped:
        print('stopped')
"""


def test_a_signal_in_a_destructor_or_in_a_weak_callback_stops_the_node():
    done = subprocess.run([sys.executable, '-c', IGNORED], capture_output=True, text=True, timeout=120.0)
    assert (done.stdout, done.stderr, done.returncode) == ('stopped\nstopped\n', '', 0)
