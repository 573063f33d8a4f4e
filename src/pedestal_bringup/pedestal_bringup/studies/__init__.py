"""Studies: the compiled closed loop measured against what a paper claims and against our own targets.

A study is a module of this folder. The first line of its docstring says what it is; `run(progress)` returns its
rigs.rows.Result and may call progress(fraction done, what comes next). A study of many runs has a default number RUNS
and is `run(progress, runs=RUNS, pool=None)`: pool is a monte_carlo.Pool; without one the runs are made in this
process. `rigs` holds what several studies use. A case that is a scenario with parameters can be run through the nodes
as well: `pedestal run SCENARIO --param ...`.
"""
import ast
import importlib
import pathlib
import pkgutil

NAMES = tuple(module.name.replace('_', '-') for module in pkgutil.iter_modules(__path__) if not module.ispkg)


def study(name):
    """The module of a study; name must be one of NAMES."""
    return importlib.import_module(f'{__name__}.{name.replace("-", "_")}')


def descriptions():
    """{name of a study: one line}, read from the files: to import them all takes two seconds."""
    files = {name: pathlib.Path(__file__).with_name(f'{name.replace("-", "_")}.py') for name in NAMES}
    return {name: ast.get_docstring(ast.parse(file.read_text())).partition('\n')[0] for name, file in files.items()}
