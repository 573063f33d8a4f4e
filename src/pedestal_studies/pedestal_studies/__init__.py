"""Studies: the compiled closed loop measured against the claims of papers and against our own targets.

`pedestal study NAME` runs a study. A study is a module of one of STUDY_FOLDERS. The first line of its docstring
describes the study. Its function `run(progress)` returns a rigs.rows.Result and may call progress(fraction done, text
of the next part). In a study of many runs the function is `run(progress, runs=DEFAULT_RUNS, pool=None)`, where pool is
a monte_carlo.Pool. Without a pool the runs are made in this process. `rigs` holds the parts that several studies use.

A case is one configuration that a study measures, such as a filter on a motion. If a case is a scenario with changed
parameters, `pedestal run SCENARIO --param ...` runs it with separate nodes.
"""
import ast
import importlib
import pathlib

STUDY_FOLDERS = 'papers', 'system'  # folders that hold one study in each module
_STUDY_FILES = {file.stem.replace('_', '-'): file for folder in STUDY_FOLDERS
                for file in pathlib.Path(__file__).with_name(folder).glob('[a-z]*.py')}
STUDY_NAMES = tuple(sorted(_STUDY_FILES))


def study(name):
    """Return the module of a study; name must be one of STUDY_NAMES."""
    return importlib.import_module(f'{__name__}.{_STUDY_FILES[name].parent.name}.{_STUDY_FILES[name].stem}')


def descriptions():
    """Return {name of a study: first line of its docstring}.

    Because the import of all studies would take two seconds, the lines are read from the files.
    """
    docstrings = {name: ast.get_docstring(ast.parse(_STUDY_FILES[name].read_text())) for name in STUDY_NAMES}
    return {name: text.partition('\n')[0] for name, text in docstrings.items()}
