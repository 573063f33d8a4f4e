"""measure the compiled closed loop against the papers: rows and figures"""
import contextlib
import functools
import inspect
import pathlib
import sys

from pedestal.verbs import arguments
from pedestal_analysis import console
from pedestal_common.parameters import did_you_mean


def add_arguments(parser):
    """Name, output folder, runs and who works on them."""
    parser.add_argument('name', nargs='?', metavar='NAME', help='without one: list the studies')
    console.add_json(parser)
    parser.add_argument('--output', type=pathlib.Path, metavar='DIR', help='of the figures; default: studies/NAME')
    parser.add_argument('--runs', type=int, metavar='N', help='of each case; default: what the study says')
    arguments.add_vector(parser)
    parser.add_argument('--scenario', metavar='SCENARIO', help='servo, backlash, bode: of your own plant, a name or a '
                        "path of a .yaml, in the place of the paper's")
    arguments.add_workers(parser)


def main(options):
    """Run the study, print its table and remarks, draw its figures; without a name list them; exit code 2 for an
    unknown one."""
    import pedestal_studies
    if not options.name:
        for name in ('json', 'output', 'runs', 'vector', 'scenario', 'workers', 'scheduler'):
            if getattr(options, name) is not None:
                raise ValueError(f'--{name}: needs the NAME of a study')
        console.show_list(pedestal_studies.descriptions().items())
        return 0
    if options.name not in pedestal_studies.STUDY_NAMES:
        print(f'pedestal: error: unknown study {options.name!r};{did_you_mean(options.name, pedestal_studies.STUDY_NAMES)} '
              f'there are {", ".join(pedestal_studies.STUDY_NAMES)}', file=sys.stderr)
        return console.EXIT_WRONG_COMMAND
    from pedestal_analysis.results import intervals
    from pedestal_studies.rigs import drawing
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
            drawing.save(draw, *(output / f'{name}.{kind}' for kind in kinds))
    console.show_study(f'study {options.name}', result.rows if result.shown is None else result.shown,
                       intervals.missed)
    for remark in result.remarks:
        print(remark)
    print(f'figures in {output}: {", ".join(f"{name}.png" for name in result.figures)}')
    console.write_json(options.json, {'name': options.name, 'rows': result.rows})
    return 0


def _of_scenario(options):
    """function(progress) of the study for the plant of --scenario."""
    from pedestal_studies import plant_studies
    if options.name not in plant_studies.PLANT_STUDIES:
        raise ValueError(f"--scenario: study {options.name} is of the papers' plant; any plant have "
                         f'{", ".join(plant_studies.PLANT_STUDIES)}')
    for name in ('runs', 'workers', 'scheduler'):
        if getattr(options, name) is not None:
            raise ValueError(f'--{name}: does not go with --scenario, which is one run of each case')
    return functools.partial(plant_studies.PLANT_STUDIES[options.name], options.scenario)


def _many_runs(options, study, stack):
    """Keyword arguments of a study of many runs beside its progress; the pool is closed with the stack."""
    asked = {name: getattr(options, name) for name in ('runs', 'workers', 'scheduler')}
    if 'runs' not in inspect.signature(study.run).parameters:
        for name, value in asked.items():
            if value is not None:
                raise ValueError(f'--{name} {value}: study {options.name} has one run of each case')
        return {}
    if asked['runs'] is not None and asked['runs'] < 1:
        raise ValueError(f'--runs {options.runs}: must be at least 1')
    from pedestal_analysis.trials import monte_carlo
    return {'runs': options.runs or study.DEFAULT_RUNS,
            'pool': stack.enter_context(monte_carlo.Pool(options.workers, options.scheduler))}
