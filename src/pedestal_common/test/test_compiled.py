"""The cache of compiled laws, shared by processes that start together."""
import os
import shutil
import subprocess
import sys

import pytest
from numba.core import types

from pedestal_common import law_cache
from pedestal_common.compiled import compiled, inlined, separate
from pedestal_common.law import by_type

LAW = """
import sys
import time

import numpy

from pedestal_common.compiled import compiled
from pedestal_common.law import Law

@compiled
def law(x):
    return x[0] + x[1]

if __name__ == '__main__':
    from one_law import law as module
    translate = Law._translate
    Law._translate = lambda *law: (time.sleep(1.0), translate(*law))[1]
    module.law(numpy.ones(3, *sys.argv[1:]))
    print(sum(module.law.stats.cache_misses.values()))
"""

TYPES = ('f8', 'f4')


def environment(folder, cache):
    """Of a process that has the law cache in the folder `cache`, and that reads each module from its source.

    A .pyc file is valid for a source of the same length and the same second; an edit by a test may change neither.
    """
    return {**os.environ, 'NUMBA_CACHE_DIR': str(cache), 'PYTHONDONTWRITEBYTECODE': '1',
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


@pytest.mark.thorough
def test_one_of_many_compiles(folder):
    assert sorted(compilations(folder, folder / 'cache', [()] * 3)) == [0, 0, 1]


@pytest.mark.thorough
def test_what_is_in_the_cache_is_loaded_without_what_compiles(tmp_path):
    """To import which takes longer than everything else; it is there for what is compiled afterwards."""
    code = ('import sys, numba, numpy; from pedestal_common.compiled import assign; x = numpy.zeros((2, 2)); '
            'assign(x, x); print(sum(assign.stats.cache_misses.values()), "scipy.linalg" in sys.modules); '
            'numba.njit(lambda x: assign(x, 1.0 + x))(x); print(x.sum())')
    for said in ('1 True\n4.0\n', '0 False\n4.0\n'):
        done = subprocess.run([sys.executable, '-c', code], capture_output=True, text=True, timeout=120.0,
                              env=environment(tmp_path, tmp_path / 'cache'))
        assert (done.stdout, done.stderr) == (said, '')


@pytest.mark.thorough
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


def test_a_law_has_the_key_of_the_source_that_was_read(folder):
    """The source is edited after the process has read it and before the process saves the compiled law."""
    code = ('import numpy, pathlib, one_law.law; path = pathlib.Path(one_law.law.__file__); '
            'path.write_text(path.read_text().replace("x[1]", "x[2]")); print(one_law.law.law(numpy.arange(3.0)))')

    def said():
        return subprocess.run([sys.executable, '-c', code], env=environment(folder, folder / 'cache'), check=True,
                              capture_output=True, text=True, timeout=120.0).stdout

    assert [said(), said()] == ['1.0\n', '2.0\n']


@pytest.mark.thorough
def test_laws_saved_at_once_are_all_kept(folder):
    """Of one law for several types."""
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


@pytest.mark.thorough
def test_laws_translated_by_different_processes_keep_their_own_functions_of_numba(folder):
    """Numba gives its powers of floats and of integers the same symbol if each is the first in its process."""
    (folder / 'one_law' / 'powers.py').write_text(POWERS)
    for call, value in (('real(1.5, 3)', 3.375), ('whole(7, 3)', 343), ('total(1.5, 7, 3)', 346.375),
                        ('(real(1.5, 3), whole(7, 3), total(1.5, 7, 3))', (3.375, 343, 346.375))):
        done = subprocess.run([sys.executable, '-c', f'from one_law.powers import *; print({call})'],
                              env=environment(folder, folder / 'cache'), stdout=subprocess.PIPE, text=True,
                              timeout=120.0)
        assert done.stdout == f'{value}\n'


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


@pytest.mark.thorough
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


def test_an_edit_of_a_separate_law_compiles_that_law_only(tmp_path):
    """Its caller, which another process compiled, calls the new law; a new type of the result compiles it again."""
    package = tmp_path / 'two_laws'
    package.mkdir()
    (package / '__init__.py').touch()
    called = package / 'called.py'
    called.write_text('from pedestal_common.compiled import separate\n\n\n'
                      '@separate\ndef called(x):\n    return 2.0 * x\n')
    (package / 'law.py').write_text(CALLER)

    def said():
        done = subprocess.run([sys.executable, '-m', 'two_laws.law'], capture_output=True, text=True, timeout=120.0,
                              env=environment(tmp_path, tmp_path / 'cache'))
        assert not done.stderr
        return done.stdout.strip()

    assert [said(), said()] == ['5.0 law called', '5.0']
    called.write_text(called.read_text().replace('2.0', '3.0'))
    assert [said(), said()] == ['7.0 called', '7.0']
    called.write_text(called.read_text().replace('3.0', '3j'))
    assert [said(), said()] == ['(1+6j) called law', '(1+6j)']


NAMELESS = """
import collections
import typing
from pedestal_common.compiled import compiled

pair = collections.namedtuple('Pair', 'first second')(2.0, 3.0)

class Known(typing.NamedTuple):
    value: float

@compiled
def law(of, x):
    return of.first * x + of.second

@compiled
def caller(of, known):
    return law(of, known.value)

@compiled
def same(of, x):
    return of
"""


@pytest.mark.thorough
def test_a_named_tuple_without_a_name_in_its_module_is_no_other_in_the_next_process(tmp_path):
    """Pickle would make another class of it."""
    (tmp_path / 'nameless.py').write_text(NAMELESS)
    code = ('from nameless import *; print(law(pair, 2.0), caller(pair, Known(1.0)), same(Known(1.0), 1), '
            'type(same(pair, 1)) is type(pair))')
    for _ in range(3):
        done = subprocess.run([sys.executable, '-c', code], capture_output=True, text=True, timeout=120.0,
                              env=environment(tmp_path, tmp_path / 'cache'))
        assert (done.stdout, done.stderr) == ('7.0 5.0 Known(value=1.0) True\n', '')


def test_a_unit_is_compiled_if_its_separate_laws_are(tmp_path, monkeypatch):
    monkeypatch.setattr(law_cache, '_ROOT', tmp_path)
    assert not around.is_cached(2.0)
    around(2.0)
    assert around.is_cached(2.0)
    next(path for path in tmp_path.iterdir() if '.apart-' in path.name and len(path.read_bytes()) > 5000).unlink()
    assert not around.is_cached(2.0)


@separate
def apart(x):
    return x * x


@compiled
def around(x):
    return apart(x) + 1.0


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
