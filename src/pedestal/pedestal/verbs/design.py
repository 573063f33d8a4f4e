"""Verbs for the design of an antenna: scenarios, sample files, parameters, studies, tuning, speed of the machine."""
import argparse
import contextlib
import functools
import importlib.resources
import inspect
import pathlib
import shlex
import sys
import types
import typing
from collections.abc import Callable, Mapping

from pedestal import console
from pedestal.verbs import arguments
from pedestal.verbs.arguments import Verb
from pedestal_common import parameters
from pedestal_common.parameters import did_you_mean, option_of

if typing.TYPE_CHECKING:    # a list of the scenarios does not wait for numpy
    from pedestal_common.quantities import Json
    from pedestal_studies.result import Result

SAMPLE_FILES = {
    'flight.csv': 'ADS-B of a helicopter as CSV, one row a second: a turn of 2 km radius at 45 m/s that climbs at 2 '
                  'm/s; rounded to 1e-5 deg and 25 ft, as ADS-B is.',
    'ship.csv': 'Motion of a ship as CSV, four rows a second for 150 s: roll 6 deg in 9 s, pitch 2 deg in 7 s, yaw 1 '
                'deg in 13 s about heading 60 deg, heave 1 m.',
    'iss.tle': 'Elements of the ISS on 2019-12-09, which the scenario leo_pass also has.',
    'night.tle': 'Made-up elements of twelve satellites on 2019-12-09 for a night of passes: nine low ones, one of a '
                 'navigation system, one in a Molniya orbit, and a geostationary one.',
    'my_antenna.yaml': 'A scenario: another antenna that tracks the flight of uav_flyby.',
    'acceptance.yaml': 'A specification of acceptance that explains all its keys, for the scenario uav_tracker_3m.',
    'acceptance_ship_pass.yaml': 'A short specification of acceptance with the losses of receiver and INS, for the '
                                 'scenario ship_pass.',
    'acceptance_station_real.yaml': 'A whole specification of acceptance, for the scenario station_real.',
    'acceptance_uav_tracker_3m.yaml': 'A whole specification of acceptance, for the scenario uav_tracker_3m.',
}
"""{name of a file in the folder samples of this package: its content in a sentence}."""

PLOT_SUFFIXES = '.png', '.svg', '.pdf'

LOOP_REQUIREMENTS = {'speed_bandwidth': 'speed', 'position_bandwidth': 'position', 'phase_margin': 'phase_margin',
                     'gain_margin': 'gain_margin'}  # option: field


def _add_scenarios(_parser: argparse.ArgumentParser) -> None:
    """The verbs that run something take the name of a scenario, or a file.

        pedestal scenarios
        pedestal run uav_flyby               run one of them
    """


def _scenarios(_options: argparse.Namespace) -> int:
    from pedestal_bringup.scenario import shipped
    console.show_list(shipped.available().items())
    return 0


def _add_samples(parser: argparse.ArgumentParser) -> None:
    """Writes flight.csv, ship.csv, iss.tle, night.tle, my_antenna.yaml, and four specifications of acceptance. If one
    of these files exists, nothing is written."""
    parser.add_argument('folder', nargs='?', type=pathlib.Path, default=pathlib.Path(), metavar='DIR',
                        help='output folder; default: the current folder')


def _samples(options: argparse.Namespace) -> int:
    options.folder.mkdir(parents=True, exist_ok=True)
    for name in SAMPLE_FILES:
        if (options.folder / name).exists():
            raise FileExistsError(f'{options.folder / name} already exists and is not overwritten, so give another '
                                  'folder')
    for name in SAMPLE_FILES:
        (options.folder / name).write_bytes((importlib.resources.files('pedestal') / 'samples' / name).read_bytes())
    console.show_list((str(options.folder / name), text) for name, text in SAMPLE_FILES.items())
    return 0


def _add_new(parser: argparse.ArgumentParser) -> None:
    """All other values are scaled from the antenna of the scenario leo_pass; the command prints each rule. Comments in
    the file explain its values. `pedestal tune FILE --loops` then tunes the loops and measures their margins.
    """
    from pedestal_workbench.tuning.data_sheet import SCALED_FIELDS, DataSheet
    parser.add_argument('file', type=pathlib.Path, metavar='FILE.yaml', help='new scenario file')
    arguments.add_station(parser)
    for name, field in parameters.flatten(DataSheet):
        unit = field.metadata.get('unit')
        allowed = ', '.join(field.metadata.get('options', ()))
        default = 'scaled by the diameter' if name in SCALED_FIELDS else parameters.value_text(field.default)
        described = f'{field.metadata["doc"]}{f": {allowed}" if allowed else ""}; default: {default}'
        parser.add_argument(option_of(name), type=field.type, default=field.default,
                            metavar=unit.upper().replace(' ', '') if unit else 'SCENARIO' if allowed else 'RATIO',
                            help=described.replace('%', '%%'))


def _new(options: argparse.Namespace) -> int:
    from pedestal_workbench.tuning import antenna_from_data_sheet
    from pedestal_workbench.tuning.data_sheet import DataSheet
    if options.file.suffix not in ('.yaml', '.yml'):
        raise ValueError(f'{options.file}: must end in .yaml or .yml')
    if options.file.exists():
        raise FileExistsError(f'{options.file} already exists and is not overwritten, so give another name')
    try:
        sheet = DataSheet(**{name: getattr(options, name) for name, _ in parameters.flatten(DataSheet)})
    except parameters.ParameterError as error:
        name, equals, rest = str(error).partition(' = ')
        raise ValueError(f'{option_of(name)}{equals}{rest}') from None
    from pedestal import satellite
    station = None if options.station is None else satellite.station_values(options.station)
    content, remarks = antenna_from_data_sheet.new(sheet, options.file.stem, options.command, station)
    options.file.write_text(content)
    print(*remarks, sep='\n', end='\n' if remarks else '')
    following = shlex.join(('pedestal', 'tune', str(options.file), '--loops'))
    print(f'written: {options.file}  ({following})')
    return 0


def _add_parameters(parser: argparse.ArgumentParser) -> None:
    from pedestal_common.graph import nodes
    parser.add_argument('node', help='name of the node or of its executable: acu, adu, tracking_receiver, '
                        f'ship_motion, ins, recorder, {", ".join(nodes.STANDALONE_NODES)}; or scenario')


def _parameters(options: argparse.Namespace) -> int:
    from pedestal_common.graph.graph_parameters import GraphParameters
    rows = []
    own = _parameters_type(options.node)
    for prefix, parameters_type in (('', own), ('graph.', GraphParameters)):
        values = parameters.defaults(parameters_type)
        rows += [(prefix + name, *_columns(field.metadata, values[name]))
                 for name, field in parameters.flatten(parameters_type)]
    console.show_list(rows)
    return 0


def _parameters_type(name: str) -> type[parameters.Parameters]:
    from pedestal_bringup.scenario.sections import SECTION_NODES, is_node, parameters_of
    from pedestal_common.graph import nodes
    short = name.removesuffix('_node').removeprefix('operator_')
    if short in nodes.STANDALONE_NODES:
        return nodes.STANDALONE_NODES[short].parameters_type()
    if not (is_node(short) or short == 'scenario'):
        known = (*SECTION_NODES, *nodes.STANDALONE_NODES, 'scenario')
        raise ValueError(f'{name!r} is no node;{did_you_mean(name, known)} there are {", ".join(known)}')
    return parameters_of(short)


def _columns(meta: 'Mapping[str, Json]', value: object) -> tuple[str, str, str]:
    """Return default, range or options, and meaning with unit of a parameter, as texts."""
    allowed = f'{meta["low"]:g} to {meta["high"]:g}' if 'low' in meta else ' | '.join(meta.get('options', ()))
    unit = f' [{meta["unit"]}]' if meta.get('unit') else ''
    return parameters.value_text(value), allowed, f'{meta["doc"]}{unit}'


def _add_study(parser: argparse.ArgumentParser) -> None:
    """Runs the compiled laws of all nodes in one process. Prints a table with remarks and draws the figures of the
    study."""
    parser.add_argument('name', nargs='?', metavar='NAME', help='name of the study; default: list the studies')
    console.add_json(parser)
    parser.add_argument('--output', type=pathlib.Path, metavar='DIR', help='output folder of the figures; default: '
                        'studies/NAME')
    parser.add_argument('--runs', type=int, metavar='N', help='number of runs of each case; default: set by the '
                        'study')
    parser.add_argument('--vector', choices=('pdf', 'svg'), help='additional vector format in which each figure is '
                        'written, for print')
    parser.add_argument('--scenario', metavar='SCENARIO', help='scenario (name or .yaml file) whose plant '
                        'replaces the plant of the paper, for studies servo, backlash and bode')
    arguments.add_workers(parser)


def _study(options: argparse.Namespace) -> int:
    import pedestal_studies
    if not options.name:
        arguments.refuse_given(options, ('json', 'output', 'runs', 'vector', 'scenario', 'workers', 'scheduler'),
                               'needs the NAME of a study')
        console.show_list(pedestal_studies.descriptions().items())
        return 0
    if options.name not in pedestal_studies.STUDY_NAMES:
        guess = did_you_mean(options.name, pedestal_studies.STUDY_NAMES)
        print(f'pedestal: error: unknown study {options.name!r};{guess} there are '
              f'{", ".join(pedestal_studies.STUDY_NAMES)}', file=sys.stderr)
        return console.EXIT_WRONG_COMMAND
    from pedestal_results import intervals
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
    from pedestal_studies import plant_studies
    if options.name not in plant_studies.PLANT_STUDIES:
        raise ValueError(f'--scenario: study {options.name} has the plant of the papers; must be one of '
                         f'{", ".join(plant_studies.PLANT_STUDIES)}')
    arguments.refuse_given(options, ('runs', 'workers', 'scheduler'),
                           'does not go with --scenario, which makes one run of each case')
    return functools.partial(plant_studies.PLANT_STUDIES[options.name], options.scenario)


def _many_runs(options: argparse.Namespace, study: types.ModuleType,
               stack: contextlib.ExitStack) -> dict[str, object]:
    """Return the keyword arguments of a study of many runs, except its progress. The stack closes the pool."""
    if 'runs' not in inspect.signature(study.run).parameters:
        arguments.refuse_given(options, ('runs', 'workers', 'scheduler'),
                               f'study {options.name} has one run of each case', stated=True)
        return {}
    if options.runs is not None and options.runs < 1:
        raise ValueError(f'--runs {options.runs}: must be at least 1')
    from pedestal_workbench.trials import monte_carlo
    return {'runs': options.runs or study.DEFAULT_RUNS,
            'pool': stack.enter_context(monte_carlo.Pool(options.workers, options.scheduler))}


def _add_tune(parser: argparse.ArgumentParser) -> None:
    """Give exactly one of --filter, --feedforward and --loops. --filter needs a recording or a scenario; --feedforward
    and --loops need a scenario.
    """
    parser.add_argument('source', metavar='BAG|SCENARIO', help='input of the tuning. With a recording, the filter is '
                        'tuned for the largest likelihood of the innovations; with a scenario, for the smallest true '
                        'pointing error')
    parser.add_argument('--filter', metavar='KIND', help='kind of the filter to tune, for example imm (all kinds: '
                        '`pedestal parameters acu`, filter.kind); excludes --feedforward and --loops')
    parser.add_argument('--feedforward', action='store_true', help='compute the gains of the feed-forward from the '
                        'rate loop of the drive; needs a scenario; excludes --filter and --loops')
    parser.add_argument('--loops', action='store_true', help='tune speed and position loop, shaper and bias for the '
                        'plant of a scenario, and measure the margins on it; excludes --filter and --feedforward')
    parser.add_argument('--speed-bandwidth', type=float, metavar='HZ', help='crossover of the speed loop [Hz], for '
                        '--loops; default: 8 times --position-bandwidth if this option is given, else 28')
    parser.add_argument('--position-bandwidth', type=float, metavar='HZ', help='crossover of the position loop [Hz], '
                        'for --loops; default: an eighth of --speed-bandwidth')
    parser.add_argument('--phase-margin', type=float, metavar='DEG', help='smallest phase margin '
                        '[deg], for --loops; 20 to 80; default: 45')
    parser.add_argument('--gain-margin', type=float, metavar='DB', help='smallest gain margin [dB], '
                        'for --loops; 3 to 20; default: 6')
    parser.add_argument('--axis', choices=('azimuth', 'elevation', 'both'), default='both', help='axis to tune; '
                        'default: both')
    parser.add_argument('--seed', type=int, metavar='N', help='first seed; default: value of the scenario')
    parser.add_argument('--runs', type=int, metavar='N', help='number of runs with different seeds for the '
                        'tuning; one more run, with the next seed, checks the result; default: 2')
    arguments.add_duration(parser)
    arguments.add_param(parser)
    parser.add_argument('--output', type=pathlib.Path, metavar='FILE', help='output parameter file; default: '
                        'SCENARIO-KIND.yaml, SCENARIO-feedforward.yaml or SCENARIO-loops.yaml')


def _tune(options: argparse.Namespace) -> int:
    from pedestal_workbench.tuning import loops, tune
    if options.loops:
        arguments.refuse_given(options, ('filter', 'feedforward', 'runs', 'seed', 'duration'),
                               'cannot be combined with --loops, which measures the plant')
    elif bool(options.filter) == options.feedforward:
        raise ValueError('one of --filter KIND, --feedforward and --loops must be given')
    else:
        arguments.refuse_given(options, LOOP_REQUIREMENTS, 'needs --loops', stated=True)
    with console.progress_of_share() as progress:
        if options.loops:
            required = {field: value for name, field in LOOP_REQUIREMENTS.items()
                        if (value := getattr(options, name)) is not None}
            lines = loops.main(arguments.typed(loops.LoopOptions, options), loops.LoopRequirements(**required),
                               progress)
        else:
            lines = tune.main(arguments.typed(tune.TuneOptions, options, filter=options.filter or None), progress)
    print('\n'.join(lines))
    return 0


def _add_filter(parser: argparse.ArgumentParser) -> None:
    """The filter of the control unit, to the last bit, on the azimuths and elevations of a CSV file. The output has
    angles, rates, their standard deviations and the NIS of each row. The azimuth has no wraps.

    Example: pedestal filter angles.csv --sigma 0.03 --plot filtered.png
    """
    from acu_tracker.estimation.filters.kinds import FILTER_KINDS
    parser.add_argument('file', type=pathlib.Path, help='CSV file with columns time, azimuth, elevation, and sigma or '
                        'not; for example time_s,az_deg,el_deg')
    parser.add_argument('--kind', choices=FILTER_KINDS, default='imm', help='kind of the filter; default: imm')
    parser.add_argument('--sigma', type=float, metavar='DEG', help='standard deviation of a measured direction '
                        'across the line of sight [deg]; default: the column sigma')
    parser.add_argument('--gap', type=float, metavar='S', help='longest gap that the filter bridges [s]; after a '
                        'longer one it starts again; default: 20 median steps, at least 1 s')
    parser.add_argument('--output', type=pathlib.Path, metavar='FILE', help='output file; default: FILE-filtered.csv')
    parser.add_argument('--plot', type=pathlib.Path, metavar='FILE', help='output picture of the angles, the rates '
                        'and the NIS: .png, .svg or .pdf')


def _filter(options: argparse.Namespace) -> int:
    from pedestal import estimate
    from pedestal_recording import export
    output = options.output or options.file.with_name(f'{options.file.stem}-filtered.csv')
    for name, path in (('--output', output), ('--plot', options.plot)):
        arguments.check_new_file(name, path)
    if options.plot and options.plot.suffix not in PLOT_SUFFIXES:
        raise ValueError(f'--plot {options.plot}: must end with {", ".join(PLOT_SUFFIXES)}')
    low, high = estimate.SIGMA_LIMITS_DEG
    if options.sigma is not None and not low <= options.sigma <= high:
        raise ValueError(f'--sigma {options.sigma:g}: must be {low:g} to {high:g} deg')
    measured = estimate.read(options.file)
    sigma = measured.sigma if options.sigma is None else options.sigma
    if sigma is None:
        raise ValueError(f'{options.file}: has no column sigma_deg; give --sigma DEG')
    made = estimate.filter(measured.t, measured.azimuth, measured.elevation, options.kind, sigma=sigma,
                           gap=options.gap)
    headers = {column: f'{column} [{unit}]' if unit else column for column, unit in made.units.items()}
    export.write_csv(output, {headers[column]: values.tolist() if column == 'outcome' else values
                              for column, values in made.items()})
    print(f'{measured.description}\n{made.verdict}')
    for begin, end, bridged in made.gaps:
        print(f'gap from {begin:.10g} to {end:.10g} s: ' + ('bridged' if bridged else 'the filter starts again'))
    if options.plot:
        made.plot().savefig(options.plot)
    print(*filter(None, (output, options.plot)), sep='\n')
    return 0


def _add_bench(parser: argparse.ArgumentParser) -> None:
    """Prints a row for each measured speed. Other programs on the machine make the numbers worse.

        pedestal bench                       all benchmarks
        pedestal bench --json speed.json     also as JSON
    """
    from pedestal_studies import bench
    parser.add_argument('what', nargs='?', choices=tuple(bench.BENCH_MODULES), help='benchmark to run; default: all')
    console.add_json(parser)


def _bench(options: argparse.Namespace) -> int:
    from pedestal_studies import bench
    content: dict[str, Json] = {'name': 'bench', 'rows': []}
    for what in (options.what,) if options.what else bench.BENCH_MODULES:
        measured = importlib.import_module(f'{bench.__name__}.{bench.BENCH_MODULES[what]}').run()
        console.show_measured(measured.title, measured.rows)
        print(measured.remark, end='\n' if measured.remark else '')
        content['rows'] += measured.rows
    console.write_json(options.json, content)
    return 0


VERBS = {
    'scenarios': Verb(_add_scenarios, _scenarios),
    'samples': Verb(_add_samples, _samples),
    'new': Verb(_add_new, _new),
    'parameters': Verb(_add_parameters, _parameters),
    'study': Verb(_add_study, _study),
    'tune': Verb(_add_tune, _tune),
    'filter': Verb(_add_filter, _filter),
    'bench': Verb(_add_bench, _bench),
}
