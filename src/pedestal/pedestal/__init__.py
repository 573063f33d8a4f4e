"""The tracking antenna as a library: load a scenario, change its parameters, run it, look at its numbers; no ROS.

>>> import pedestal
>>> scenario = pedestal.load('leo_pass', duration=6.0)
>>> run = pedestal.run(scenario.changed({'acu.azimuth.filter.kind': 'imm'}))
>>> joints = run['joint_states']
>>> joints['azimuth.position'].shape, joints.units['azimuth.position']
((1201,), 'rad')
>>> run.results['pointing_rms_deg'] < 0.05
True

The numbers of a run are those of `pedestal run` of the same scenario, parameters and seed, to the last bit: the same
compiled laws, in the order of the graph. The first run compiles them, which takes some minutes once.
"""
import importlib
import typing

if typing.TYPE_CHECKING:
    from pedestal.ensemble import Trials, trials
    from pedestal.recording import Run, Table, read_bag, run
    from pedestal.scenario import Scenario, load, scenarios

_MODULES = {'Trials': 'ensemble', 'trials': 'ensemble', 'Run': 'recording', 'Table': 'recording',
            'read_bag': 'recording', 'run': 'recording', 'Scenario': 'scenario', 'load': 'scenario',
            'scenarios': 'scenario'}

__all__ = ['Run', 'Scenario', 'Table', 'Trials', 'load', 'read_bag', 'run', 'scenarios', 'trials']


def __getattr__(name):
    """Import the module of a name when it is used: the command, which lives here too, starts without them."""
    if name not in _MODULES:
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    return getattr(importlib.import_module(f'{__name__}.{_MODULES[name]}'), name)


def __dir__():
    return sorted({*globals(), *__all__})
