"""Studies: the compiled closed loop measured against the claims of papers and against our own targets.

`pedestal study NAME` runs a study, a module of STUDIES. The first line of its docstring describes the study. Its
function `run(progress)` returns a result.Result. In a study of many runs the function is `run(progress,
runs=DEFAULT_RUNS, pool=None)`. A case is one configuration that a study measures, such as a filter on a motion. If it
is a scenario with changed parameters, `pedestal run SCENARIO --param ...` runs it with separate nodes.
"""
import ast
import importlib
import pathlib
import types

STUDIES = {  # {folder: its modules that are studies}; a name has hyphens for the underscores of its module
    'p000_ma': ('backlash', 'bode', 'filter_families', 'servo'),
    'p001_zhou_yang_qin': ('alignment', 'alignment_speed'),
    'p002_jia': ('phased_array',),
    'p003_lin_wu_zhu': ('feedforward_speed', 'imm_feedforward', 'manoeuvre', 'pareto'),
    'p004_li_chen_wang': ('rate_measurement', 'telemetry_flight'),
    'system': ('acquisition', 'budget', 'calibration', 'consistency', 'faults', 'filters', 'night',
               'scenarios', 'structure', 'target_filters', 'wrong_slope')}

_STUDY_MODULES = {module.replace('_', '-'): f'{folder}.{module}'
                  for folder, modules in STUDIES.items() for module in modules}
STUDY_NAMES = tuple(sorted(_STUDY_MODULES))


def study(name: str) -> types.ModuleType:
    """Return the module of a study; name must be one of STUDY_NAMES."""
    return importlib.import_module(f'{__name__}.{_STUDY_MODULES[name]}')


def descriptions() -> dict[str, str]:
    """Return {name of a study: first line of its docstring}.

    Because the import of all studies would take two seconds, the lines are read from the files.
    """
    here = pathlib.Path(__file__).parent
    files = {name: here / f'{_STUDY_MODULES[name].replace(".", "/")}.py' for name in STUDY_NAMES}
    docstrings = {name: ast.get_docstring(ast.parse(file.read_text())) or '' for name, file in files.items()}
    return {name: text.partition('\n')[0] for name, text in docstrings.items()}
