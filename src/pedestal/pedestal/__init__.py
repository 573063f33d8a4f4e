"""Library of the tracking antenna without ROS: load a scenario, change its parameters, run it, read its numbers, and
filter measured angles.

>>> import pedestal
>>> scenario = pedestal.load('leo_pass', duration=6.0)
>>> run = pedestal.run(scenario.changed({'acu.azimuth.filter.kind': 'ca'}))
>>> joints = run['joint_states']
>>> joints['azimuth.position'].shape, joints.units['azimuth.position']    # 6 s in steps of 5 ms
((1201,), 'rad')
>>> run.results['pointing_rms_deg'] < 0.05
True

A run gives the numbers of `pedestal run` in lockstep with the same scenario, parameters and seed, to the last bit. The
same compiled laws run, in the order in which the nodes run in a step of the lockstep. The first run compiles the laws,
which takes some minutes.
"""
import importlib
import typing

if typing.TYPE_CHECKING:
    from pedestal.ensemble import Trials, trials
    from pedestal.estimate import Filtered, filter
    from pedestal.recording import Run, Table, read_bag, run
    from pedestal.scenario import Scenario, load, scenarios

_MODULES = {'Trials': 'ensemble', 'trials': 'ensemble', 'Filtered': 'estimate', 'filter': 'estimate',
            'Run': 'recording', 'Table': 'recording', 'read_bag': 'recording', 'run': 'recording',
            'Scenario': 'scenario', 'load': 'scenario', 'scenarios': 'scenario'}

__all__ = ['Filtered', 'Run', 'Scenario', 'Table', 'Trials', 'filter', 'load', 'read_bag', 'run', 'scenarios',
           'trials']


def __getattr__(name: str) -> object:
    """Return a public name after importing its module. This avoids slow imports at the start of the command line."""
    if name not in _MODULES:
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    return getattr(importlib.import_module(f'{__name__}.{_MODULES[name]}'), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
