"""repeat the experiments of the source papers and compare the numbers

Runs the compiled laws of all nodes in one process. Prints a table with remarks and draws the figures of the study.
"""
import argparse
import contextlib
import functools
import inspect
import pathlib
import sys
import types
import typing
from collections.abc import Callable

from pedestal.verbs import arguments
from pedestal_analysis import console
from pedestal_common.parameters import did_you_mean

if typing.TYPE_CHECKING:
    from pedestal_studies.rigs.rows import Result


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add name, output folder, number of runs and their processes."""
    parser.add_argument('name', nargs='?', metavar='NAME', help='name of the study; default: list the studies')
    console.add_json(parser)
    parser.add_argument('--output', type=pathlib.Path, metavar='DIR', help='output folder of the figures; default: '
                        'studies/NAME')
    parser.add_argument('--runs', type=int, metavar='N', help='number of runs of each case; default: set by the '
                        'study')
    arguments.add_vector(parser)
    parser.add_argument('--scenario', metavar='SCENARIO', help='scenario (name or .yaml file) whose plant '
                        'replaces the plant of the paper, for studies servo, backlash and bode')
    arguments.add_workers(parser)


def main(options: argparse.Namespace) -> int:
    """Run a study, print its table and remarks, draw its figures; without a name list the studies.

    Return the exit code, 2 for an unknown study.
    """
    import pedestal_studies
    if not options.name:
        for name in ('json', 'output', 'runs', 'vector', 'scenario', 'workers', 'scheduler'):
            if getattr(options, name) is not None:
                raise ValueError(f'--{name}: needs the NAME of a study')
        console.show_list(pedestal_studies.descriptions().items())
        return 0
    if options.name not in pedestal_studies.STUDY_NAMES:
        guess = did_you_mean(options.name, pedestal_studies.STUDY_NAMES)
        print(f'pedestal: error: unknown study {options.name!r};{guess} there are '
              f'{", ".join(pedestal_studies.STUDY_NAMES)}', file=sys.stderr)
        return console.EXIT_WRONG_COMMAND
    from pedestal_analysis.results import intervals
    from pedestal_studies.result import save
    kinds = ['png', options.vector] if options.vector else ['png']
    output = options.output or pathlib.Path('studies', options.name)
    console.check_json(options.json)
    study = pedestal_studies.study(options.name)
    with contextlib.ExitStack() as stack:
        run = _of_scenario(options) if options.scenario else study.run
        many = {} if options.scenario else _many_runs(options, study, stack)
        output.mkdir(parents=True, exist_ok=True)
        progress = stack.enter_context(console.progress_of_share())
        result = run(progress, **many)
        for name, draw in result.figures.items():
            progress(None, f'drawing {name}')
            save(draw, *(output / f'{name}.{kind}' for kind in kinds))
    console.show_study(f'study {options.name}', result.rows if result.shown is None else result.shown,
                       intervals.missed)
    for remark in result.remarks:
        print(remark)
    print(f'figures in {output}: {", ".join(f"{name}.png" for name in result.figures)}')
    console.write_json(options.json, {'name': options.name, 'rows': result.rows})
    return 0


def _of_scenario(options: argparse.Namespace) -> 'Callable[..., Result]':
    """Return the function(progress) that runs the study for the plant of --scenario."""
    from pedestal_studies import plant_studies
    if options.name not in plant_studies.PLANT_STUDIES:
        raise ValueError(f'--scenario: study {options.name} has the plant of the papers; must be one of '
                         f'{", ".join(plant_studies.PLANT_STUDIES)}')
    for name in ('runs', 'workers', 'scheduler'):
        if getattr(options, name) is not None:
            raise ValueError(f'--{name}: does not go with --scenario, which makes one run of each case')
    return functools.partial(plant_studies.PLANT_STUDIES[options.name], options.scenario)


def _many_runs(options: argparse.Namespace, study: types.ModuleType,
               stack: contextlib.ExitStack) -> dict[str, object]:
    """Return the keyword arguments of a study of many runs, except its progress. The stack closes the pool."""
    given = {name: getattr(options, name) for name in ('runs', 'workers', 'scheduler')}
    if 'runs' not in inspect.signature(study.run).parameters:
        for name, value in given.items():
            if value is not None:
                raise ValueError(f'--{name} {value}: study {options.name} has one run of each case')
        return {}
    if given['runs'] is not None and given['runs'] < 1:
        raise ValueError(f'--runs {options.runs}: must be at least 1')
    from pedestal_analysis.trials import monte_carlo
    return {'runs': options.runs or study.DEFAULT_RUNS,
            'pool': stack.enter_context(monte_carlo.Pool(options.workers, options.scheduler))}
