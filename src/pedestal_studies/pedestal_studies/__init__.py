"""Studies: the compiled closed loop measured against what a paper claims and against our own targets.

A study is a module of one of STUDY_FOLDERS. The first line of its docstring says what it is; `run(progress)` returns
its
rigs.rows.Result and may call progress(fraction done, what comes next). A study of many runs has a default number DEFAULT_RUNS
and is `run(progress, runs=DEFAULT_RUNS, pool=None)`: pool is a monte_carlo.Pool; without one the runs are made in this
process. `rigs` holds what several studies use. A case that is a scenario with parameters can be run through the nodes
as well: `pedestal run SCENARIO --param ...`.
"""
import ast
import importlib
import pathlib

STUDY_FOLDERS = 'papers', 'system'
_STUDY_FILES = {file.stem.replace('_', '-'): file for room in STUDY_FOLDERS
                for file in pathlib.Path(__file__).with_name(room).glob('[a-z]*.py')}
STUDY_NAMES = tuple(sorted(_STUDY_FILES))


def study(name):
    """The module of a study; name must be one of STUDY_NAMES."""
    return importlib.import_module(f'{__name__}.{_STUDY_FILES[name].parent.name}.{_STUDY_FILES[name].stem}')


def descriptions():
    """{name of a study: one line}, read from the files: to import them all takes two seconds."""
    return {name: ast.get_docstring(ast.parse(_STUDY_FILES[name].read_text())).partition('\n')[0] for name in STUDY_NAMES}
