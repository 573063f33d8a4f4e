"""Arguments of the launch file pedestal.launch.py, and the functions that turn them into a scenario. The ROS 2 package
`launch` is not imported, because only a machine with ROS 2 has it."""
import pathlib
from collections.abc import Callable, Iterable, Mapping
from typing import NamedTuple, TypeVar

from pedestal_bringup.graph import graph, operator_servers, supervisor
from pedestal_bringup.graph.processes import Graph
from pedestal_bringup.graph.start import begins, parameters_of_all
from pedestal_bringup.scenario import files as scenario_files
from pedestal_bringup.scenario import scenario
from pedestal_bringup.scenario.program import Plan
from pedestal_common import parameters


class Argument(NamedTuple):
    """Argument of the launch file."""
    name: str
    doc: str                            # for --show-args
    default: str = ''
    choices: tuple[str, ...] = ()       # allowed values, () for any


_N = TypeVar('_N', int, float)

SERVER_OFF, SERVER_ON = 'false', 'true'

ARGUMENTS = (
    Argument('scenario', 'name of a scenario that comes with the product, or path of a .yaml', 'leo_pass'),
    Argument('pacing', "pacing of the run; empty: the scenario's", choices=('', 'lockstep', 'realtime')),
    Argument('duration', "length of the run in the drive's time [s]; empty: the scenario's"),
    Argument('seed', "seed of every noise stream, a whole number; empty: the scenario's"),
    Argument('params_file', 'ROS 2 parameter file whose values replace those of the scenario'),
    Argument('bag', 'new folder for the recording; empty: bags/runs/SCENARIO-N'),
    Argument('namespace', 'ROS namespace of all nodes, for example ship_1'),
    *(Argument(name,
               f'in realtime: {server.does}' + (
                   f' on 127.0.0.1: {SERVER_OFF}, {SERVER_ON} (port {server.port}) or a port' if server.port else ''),
               SERVER_OFF, () if server.port else (SERVER_OFF, SERVER_ON))
      for name, server in operator_servers.SERVERS.items()))


def misspelt_arguments(names: Iterable[str]) -> list[str]:
    """Return a line on each name that looks like a misspelt argument: launch accepts any name."""
    known = [argument.name for argument in ARGUMENTS]
    return [f'no argument {name}:=;{meant}' for name in names
            if name not in known and (meant := parameters.did_you_mean(name, known))]


def _number(given: Mapping[str, str], name: str, number_type: Callable[[str], _N], description: str) -> _N | None:
    """Return the number of an argument, None for an empty text. Raises ValueError with the description of a number."""
    try:
        return number_type(given[name]) if given[name] else None
    except ValueError:
        raise ValueError(f'{name}:={given[name]}: must be {description}') from None


def load_scenario(given: Mapping[str, str]) -> scenario.Scenario:
    """Return the Scenario that the arguments select and change. given: {argument: text}. Raises ValueError."""
    from pedestal_common.node import middleware  # loads rclpy, which --show-args does not need
    namespace = middleware.namespace('namespace:=', given['namespace'])
    changes = scenario_files.file_overrides(given['params_file'], namespace) if given['params_file'] else ()
    chosen = scenario.load(given['scenario'], changes,
                           _number(given, 'seed', int, 'a whole number'),
                           _number(given, 'duration', float, 'a number of seconds'), given['pacing'] or None)
    for program in chosen.own.values():
        raise ValueError(f'{program}: only `pedestal run` starts a program of the user in the place of a node')
    return chosen


def servers(given: Mapping[str, str],
            chosen: scenario.Scenario) -> list[tuple[operator_servers.Server, dict[str, int]]]:
    """Return [(server, its parameters)] of the requested servers. Raises ValueError, see operator_servers.check."""
    ports = {name: _port(name, given[name]) for name in operator_servers.SERVERS if given[name].lower() != SERVER_OFF}
    operator_servers.check(ports, chosen.header, '{}:=')
    return [(operator_servers.SERVERS[name], {'graph.beams': chosen.header.graph_beams,
                                              **({'port': port} if port else {})}) for name, port in ports.items()]


def _port(name: str, text: str) -> int:
    default = operator_servers.SERVERS[name].port
    try:
        return default if text.lower() == SERVER_ON or not default else operator_servers.port(text)
    except ValueError:
        raise ValueError(f'{name}:={text}: must be {SERVER_OFF}, {SERVER_ON} or a port, 1 to 65535') from None


def prepare(given: Mapping[str, str], chosen: scenario.Scenario) -> tuple[list[str], pathlib.Path, pathlib.Path]:
    """Prepare the run of a scenario: in realtime compile its laws, then write its files to the folder of the logs.

    Return (lines on the run, path of the ROS 2 parameter file of all nodes, path of the scenario file). Raises
    ValueError, RuntimeError.
    """
    lines, _ = graph.read_files(Plan(chosen))
    bag = graph.new_bag(given['bag'], chosen.name)
    if chosen.header.pacing == 'realtime':
        supervisor.prepare(chosen)
    files = Graph(chosen, bag)     # only its folder and its file are used: launch starts the processes
    files.write(parameters_of_all(chosen, bag, begins(chosen)))
    scenario_file = files.log / f'{chosen.name}.yaml'
    scenario_file.write_text(chosen.as_yaml())
    return lines, files.file, scenario_file
