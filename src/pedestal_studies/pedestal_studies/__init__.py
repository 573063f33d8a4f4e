"""Studies: the compiled closed loop measured against what a paper claims and against our own targets.

A study is a module of one of ROOMS. The first line of its docstring says what it is; `run(progress)` returns its
rigs.rows.Result and may call progress(fraction done, what comes next). A study of many runs has a default number RUNS
and is `run(progress, runs=RUNS, pool=None)`: pool is a monte_carlo.Pool; without one the runs are made in this
process. `rigs` holds what several studies use. A case that is a scenario with parameters can be run through the nodes
as well: `pedestal run SCENARIO --param ...`.
"""
import ast
import importlib
import pathlib

ROOMS = 'papers', 'system'
_FILES = {file.stem.replace('_', '-'): file for room in ROOMS
          for file in pathlib.Path(__file__).with_name(room).glob('[a-z]*.py')}
NAMES = tuple(sorted(_FILES))


def study(name):
    """The module of a study; name must be one of NAMES."""
    return importlib.import_module(f'{__name__}.{_FILES[name].parent.name}.{_FILES[name].stem}')


def descriptions():
    """{name of a study: one line}, read from the files: to import them all takes two seconds."""
    return {name: ast.get_docstring(ast.parse(_FILES[name].read_text())).partition('\n')[0] for name in NAMES}
