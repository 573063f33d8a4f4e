"""Studies: the compiled closed loop measured against what a paper claims and against our own targets.

A study is a module of this folder. The first line of its docstring says what it is; `run(progress)` returns its
rigs.rows.Result and may call progress(fraction done, what comes next). A study of many runs has a default number RUNS
and is `run(progress, runs=RUNS, pool=None)`: pool is a monte_carlo.Pool; without one the runs are made in this
process. `rigs` holds what several studies use. A case that is a scenario with parameters can be run through the nodes
as well: `pedestal run SCENARIO --param ...`.
"""
import importlib
import pkgutil

NAMES = tuple(module.name.replace('_', '-') for module in pkgutil.iter_modules(__path__) if not module.ispkg)


def study(name):
    """The module of a study; name must be one of NAMES."""
    return importlib.import_module(f'{__name__}.{name.replace("-", "_")}')


def descriptions():
    """{name of a study: one line}."""
    return {name: study(name).__doc__.partition('\n')[0] for name in NAMES}
