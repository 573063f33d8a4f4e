"""Studies: the compiled closed loop measured against what a paper claims and against our own targets.

Each module named in NAMES is one study: the first line of its docstring says what it is, and `run(progress) -> Result`
does it, where progress(fraction, text) may be called with the share that is done and what comes next.
`experiment` holds what they share. A case is a scenario and parameters: `pedestal run SCENARIO --param ...` takes the
same through the graph of nodes.
"""
import importlib

NAMES = ('servo', 'backlash', 'bode')


def study(name):
    """The module of a study; name must be one of NAMES."""
    return importlib.import_module(f'{__name__}.{name}')


def descriptions():
    """{name: one line}."""
    return {name: study(name).__doc__.partition('\n')[0] for name in NAMES}
