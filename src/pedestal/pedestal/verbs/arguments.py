"""Arguments that several verbs of the command line share: their definition, and the check of their values."""
import argparse
import dataclasses
import inspect
import itertools
import os
import pathlib
import typing
from collections.abc import Callable, Iterable, Mapping, Sequence

from pedestal import console
from pedestal_common.parameters import flatten, option_of

if typing.TYPE_CHECKING:
    from pedestal.satellite import Choice
    from pedestal_bringup.scenario.variant import Variant
    from pedestal_operator.remote_node import RemoteSession
    from pedestal_recording.recording import Recording

    Verbs: typing.TypeAlias = 'argparse._SubParsersAction[argparse.ArgumentParser]'


class Verb(typing.NamedTuple):
    """Verb of the command line, or step of a verb. The docstring of `add_arguments` is its help, below its line in
    VERBS."""
    add_arguments: Callable[[argparse.ArgumentParser], None]
    main: Callable[[argparse.Namespace], int] | None = None     # does the work and returns the exit code; None: a step
                                                                # of the verb does

    def add_to(self, verbs: 'Verbs', name: str, line: str) -> None:
        """Add the parser of this verb to those of other verbs. line: first line of its help."""
        description = '\n\n'.join(filter(None, (line, inspect.getdoc(self.add_arguments))))
        parser = verbs.add_parser(name, help=line, description=description,
                                  formatter_class=argparse.RawDescriptionHelpFormatter)
        self.add_arguments(parser)
        if self.main:
            parser.set_defaults(main=self.main, parser=parser)


def add_steps(parser: argparse.ArgumentParser, title: str, steps: Mapping[str, tuple[str, Verb]]) -> None:
    """Add a subcommand for each step of a verb, {name: (first line of its help, step)}. title: noun for the help."""
    verbs = parser.add_subparsers(title=title, required=True, metavar=title.upper())
    for name, (line, step) in steps.items():
        step.add_to(verbs, name, line)


_Options = typing.TypeVar('_Options')


def typed(kind: type[_Options], options: argparse.Namespace, **more: object) -> _Options:
    """Return the options dataclass of a function, whose fields have the names of the options or are in `more`."""
    given = {field.name: getattr(options, field.name)
             for field in dataclasses.fields(kind) if field.name not in more}   # type: ignore[arg-type]  # a dataclass
    return kind(**given, **more)


def add_scenario(parser: argparse.ArgumentParser) -> None:
    """Add the scenario as first argument."""
    action = parser.add_argument('scenario', help='name (see `pedestal scenarios`) or .yaml file of the scenario')
    vars(action)['completer'] = scenarios_and_files


def scenarios_and_files(prefix: str, **_: object) -> list[str]:
    """Return the scenarios and the .yaml files whose name begins with a prefix, for the completion of a shell."""
    from pedestal_bringup.scenario import shipped
    folder = pathlib.Path(prefix).parent if '/' in prefix else pathlib.Path()
    found = [f'{path}/' if path.is_dir() else str(path) for path in sorted(folder.glob('*'))
             if path.is_dir() or path.suffix in ('.yaml', '.yml')]
    return [*shipped.available(), *found]


def parameter_names(prefix: str, **_: object) -> list[str]:
    """Return the texts NODE.KEY= that begin with a prefix, for the completion of a shell."""
    from pedestal_bringup.scenario.sections import SECTION_NODES, parameters_of
    node = prefix.partition('.')[0]
    if '.' not in prefix or node not in (*SECTION_NODES, 'scenario'):
        return [f'{name}.' for name in (*SECTION_NODES, 'scenario')]
    return [f'{node}.{name}=' for name, _ in flatten(parameters_of(node))]


def add_duration(parser: argparse.ArgumentParser, whole: str = 'a run') -> None:
    """Add --duration S. whole: noun for the help, with its article."""
    parser.add_argument('--duration', type=float, metavar='S', help=f'length of {whole} in simulated time [s]; '
                        'default: value of the scenario')


def add_param(parser: argparse.ArgumentParser, example: str = 'acu.azimuth.feedforward.bandwidth=12') -> None:
    """Add --param NODE.KEY=VALUE, which may be repeated."""
    action = parser.add_argument('--param', action='append', default=[], metavar='NODE.KEY=VALUE',
                                 help=f'parameter and its new value, for example {example}; may be repeated')
    vars(action)['completer'] = parameter_names


def add_station(parser: argparse.ArgumentParser) -> None:
    """Add --station LAT,LON,H."""
    parser.add_argument('--station', metavar='LAT,LON,H', help='position of the antenna: latitude [deg], longitude '
                        '[deg], height [m]; default: that of the scenario')


def add_beam(parser: argparse.ArgumentParser) -> None:
    """Add --beam NAME for a recording of several beams."""
    parser.add_argument('--beam', default='', metavar='NAME', help='beam to read from a recording of several beams, '
                        'for example beam_2; default: the first')


def add_new_bag(parser: argparse.ArgumentParser) -> None:
    """Add --bag DIR for the recording of a run."""
    parser.add_argument('--bag', type=pathlib.Path, metavar='DIR', help='output directory of the new recording; '
                        'default: bags/runs/SCENARIO-N')


def add_namespace(parser: argparse.ArgumentParser) -> None:
    """Add --namespace NAME for a graph that was launched in a namespace."""
    parser.add_argument('--namespace', default='', metavar='NAME', help='ROS namespace of the graph, for example '
                        'ship_1; default: none')


def add_elements(parser: argparse.ArgumentParser) -> None:
    """Add --tle FILE and --satellite NAME for the orbital elements of a satellite."""
    parser.add_argument('--tle',
                        type=pathlib.Path, metavar='FILE', help='file with the orbit of the satellite to track: '
                        'TLE, or OMM in KVN, XML, JSON or CSV form')
    parser.add_argument('--satellite',
                        default='', metavar='NAME', help='name or catalogue number of the satellite, if '
                        'the file of --tle contains several')


def add_choice(parser: argparse.ArgumentParser, more: str = '') -> None:
    """Add the options of `choice`. more: end of the help of --pass."""
    add_elements(parser)
    add_station(parser)
    parser.add_argument('--pass', dest='which', metavar='WHICH', help='pass to track from rise to set, or about its '
                        'culmination with a shorter --duration. next: the next pass; N: number N of the list; a UTC '
                        'such as 2019-12-10T12:35: the pass at this UTC, from there on, or the first after it'
                        f'{more}; default with --tle: next')
    parser.add_argument('--start', metavar='START', help='begin of the run: a UTC, or +S for S seconds after the rise '
                        'of the pass')


def choice(options: argparse.Namespace) -> 'Choice':
    """Return the satellite, station and pass of the command line. Raises ValueError for --satellite without --tle."""
    from pedestal.satellite import Choice
    check_elements(options)
    return Choice(options.tle, options.satellite, options.station, options.which, options.start)


def check_elements(options: argparse.Namespace) -> None:
    """Raise ValueError for --satellite without --tle."""
    if not options.tle:
        refuse_given(options, ('satellite',), 'needs --tle FILE, the file that holds it', stated=True)


def elements(options: argparse.Namespace) -> dict[str, str]:
    """Return the arguments of the commands `tle` and `elements` from the file of --tle, {} without it. Raises
    ValueError."""
    check_elements(options)
    if not options.tle:
        return {}
    import datetime

    from tracking_receiver_sim import elements as files
    chosen = files.read(options.tle, options.satellite,
                        datetime.datetime.now(datetime.timezone.utc).replace(tzinfo=None))
    if chosen.remark:
        print(chosen.remark)
    return {name: text for name, text in chosen.values.items() if text}


def ros_arguments(options: argparse.Namespace) -> list[str]:
    """Return the ROS 2 arguments for a node in the namespace of --namespace. Raises ValueError."""
    if not options.namespace:
        return []
    from pedestal_common.node import middleware
    return ['--ros-args', '-r', f'__ns:={middleware.namespace("--namespace ", options.namespace) or "/"}']


def add_remote(parser: argparse.ArgumentParser, commands: bool = True) -> None:
    """Add namespace, beam and timeout for a client of a running graph, and the operator if it sends commands."""
    add_namespace(parser)
    parser.set_defaults(who=None)
    if commands:
        parser.add_argument('--who', metavar='NAME', help='name of the operator in the commands; default: login@host')
    parser.add_argument('--beam', default='', metavar='NAME', help='beam of an array with several beams, for example '
                        'beam_2')
    parser.add_argument('--timeout', type=float, default=5.0, metavar='S', help='longest wait for the graph and for '
                        'its reply [s]; default: 5')


def check_beam(options: argparse.Namespace) -> None:
    """Raise ValueError if --beam names no beam."""
    from pedestal_common.graph import nodes
    if options.beam and options.beam + '/' not in nodes.prefixes(nodes.MAX_BEAMS):
        raise ValueError(f'--beam {options.beam}: must be beam_1 to beam_{nodes.MAX_BEAMS}')


def remote(options: argparse.Namespace, node: str = 'acu') -> 'RemoteSession':
    """Return the session of a client node that sends commands to a node, by the options of add_remote."""
    from pedestal_operator.remote_node import Remote, RemoteSession, user
    check_beam(options)
    return RemoteSession(lambda: Remote(f'terminal_{os.getpid()}', options.who or user(), node, options.beam),
                         ros_arguments(options))


def add_workers(parser: argparse.ArgumentParser) -> None:
    """Add --workers N and --scheduler ADDRESS for many runs."""
    workers = parser.add_mutually_exclusive_group()
    workers.add_argument('--workers', type=int, metavar='N', help='number of processes for the runs; default: one per '
                         'core')
    workers.add_argument('--scheduler', metavar='ADDRESS', help="address of a Dask cluster for the runs, for example "
                         "tcp://host:8786; needs pip install 'pedestal_workbench[cluster]' on this machine and the "
                         "pedestal packages on the cluster")


def add_params_file(parser: argparse.ArgumentParser) -> None:
    """Add --params-file FILE, which may be repeated."""
    parser.add_argument('--params-file', action='append', type=pathlib.Path, default=[], metavar='FILE',
                        help='ROS 2 parameter file whose values replace the values of the scenario, for example an '
                        'output of `pedestal tune`; may be repeated, the last value holds; --param replaces both')


def variant(options: argparse.Namespace) -> 'Variant':
    """Return the scenario of the command line with its changes, as far as the verb has options for them."""
    from pedestal_bringup.scenario.variant import Variant
    given = vars(options)
    return Variant(options.scenario, tuple(options.param), tuple(given.get('params_file', ())), given.get('seed'),
                   given.get('duration'))


def check_recording(options: argparse.Namespace) -> None:
    """Raise ValueError for parameters with --bag, whose run is over."""
    if options.bag is not None:
        refuse_given(options, ('param', 'params_file'), 'has no effect with --bag')


def recording(options: argparse.Namespace) -> 'tuple[Recording, str]':
    """Return (recording, name) of --bag, or of a run in memory of --scenario with its changes. Raises ValueError."""
    check_recording(options)
    if options.bag is not None:
        from pedestal_recording import bag as bags
        return bags.read(options.bag, ''), str(options.bag)
    from pedestal_bringup.loop import memory_recording
    chosen = variant(options).load()
    return memory_recording.record(chosen), chosen.name


def add_result_files(parser: argparse.ArgumentParser, output: str, report: str) -> None:
    """Add --output, --report and --json; output, report: texts of the help."""
    parser.add_argument('--output', type=pathlib.Path, metavar='FILE', help=output)
    parser.add_argument('--report', type=pathlib.Path, metavar='FILE', help=report)
    console.add_json(parser)


def refuse_given(options: argparse.Namespace, names: Iterable[str], reason: str, stated: bool = False) -> None:
    """Raise ValueError for a given option of some names, with the reason, such as 'has no effect with --bag'. stated:
    True if the text states the value of the option."""
    for name in names:
        value = getattr(options, name)
        if not (value is None or value is False or value in ([], '')):
            text = f' {value:g}' if isinstance(value, float) else f' {value}'
            raise ValueError(f'{option_of(name)}{text if stated else ""}: {reason}')


def check_result_files(options: argparse.Namespace, *more: str, new: Sequence[str] = ('output', 'report')) -> None:
    """Check --json, and the options `new` and `more` that name new files. Raises ValueError, also for two options of
    which one would overwrite the file of the other."""
    console.check_json(options.json)
    new = (*new, *more)
    for name in new:
        check_new_file(option_of(name), getattr(options, name))
    paths = [(name, path) for name, given in vars(options).items()
             for path in (given if isinstance(given, list) else [given]) if isinstance(path, pathlib.Path)]
    for (name, path), (other, same) in itertools.combinations(paths, 2):
        if {name, other} & {*new, 'json'} and path.resolve() == same.resolve():
            raise ValueError(f'{option_of(name)} {path}: is also the file of {option_of(other)}')


def check_new_file(option: str, path: pathlib.Path | None) -> None:
    """Raise ValueError if the file of an option exists already, or if its directory is missing."""
    if path is None:
        return
    if str(path) == '-':
        raise ValueError(f'{option} -: must be the name of a file; only --json writes to standard output')
    if path.exists():
        raise ValueError(f'{option} {path}: exists already; the file is not overwritten, so give another name')
    if not path.parent.is_dir():
        raise ValueError(f'{option} {path}: must be a file in a directory that exists')
