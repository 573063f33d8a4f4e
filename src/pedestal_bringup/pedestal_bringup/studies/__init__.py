"""Studies: the compiled closed loop measured against what a paper claims and against our own targets.

Each name in NAMES is one study, its module spelled with underscores: the first line of its docstring says what it
is, and `run(progress) -> Result` does it, where progress(fraction, text) may be called with the share that is done and
what comes next. A study of many runs has its default number as RUNS and is `run(progress, runs=RUNS, pool=None)`: pool
is a monte_carlo.Pool, without one the runs are made in this process. `experiment` holds what they share. A case of the
others is a scenario and parameters: `pedestal run SCENARIO --param ...` takes the same through the graph of nodes.
"""
import importlib

NAMES = ('servo', 'backlash', 'bode', 'filters', 'manoeuvre', 'pareto', 'imm-feedforward', 'rate-measurement',
         'phased-array', 'alignment')


def study(name):
    """The module of a study; name must be one of NAMES."""
    return importlib.import_module(f'{__name__}.{name.replace("-", "_")}')


def descriptions():
    """{name: one line}."""
    return {name: study(name).__doc__.partition('\n')[0] for name in NAMES}
