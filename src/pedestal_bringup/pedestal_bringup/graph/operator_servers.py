"""Servers beside a realtime run, for other programs: each is a node of its own that uses only the topics of the
graph."""
import contextlib
import importlib.util
import sys
import typing

from pedestal_bringup.graph.processes import ServerProcess
from pedestal_operator import tcp_port
from pedestal_operator.page.page_security import PAGE_ROLES

SERVER_ADDRESS = '127.0.0.1'
"""Address of the servers of a run, their default."""


class Server(typing.NamedTuple):
    """Row of SERVERS.

    module       module of the node; executable: its name for ROS 2
    port         default port; 0: it has none
    does         its task, for the help
    first_lines  number of lines that it prints for the user when it serves, each with its name
    library      Python package that it needs; extra: its name for pip
    """
    module: str
    executable: str
    port: int
    does: str
    first_lines: int = 1
    library: str = ''
    extra: str = ''

    @property
    def package(self):
        """ROS package of its node."""
        return self.module.partition('.')[0]


SERVERS = {'rotctld': Server('pedestal_operator.rotctld_node', 'rotctld_node', 4533,
                             "serve the protocol of Hamlib's rotctld"),
           'easycomm': Server('pedestal_operator.easycomm_node', 'easycomm_node', 4535,
                              'serve EasyComm I, II and III'),
           'page': Server('pedestal_operator.page_node', 'operator_page', 8080,
                          "serve the operator's page for a browser", first_lines=len(PAGE_ROLES)),
           'foxglove': Server('pedestal_operator.live_node', 'live_node', 8765, 'serve every topic to Foxglove',
                              library='foxglove', extra='pedestal_operator[live]'),
           'frames': Server('pedestal_operator.frames_node', 'frames_node', 0,
                            'publish robot_description and tf, for RViz')}


def add_arguments(parser):
    """Add an option of each server to a parser, as --rotctld [PORT]."""
    for name, server in SERVERS.items():
        if server.port:
            parser.add_argument(f'--{name}', nargs='?', type=port, const=server.port, metavar='PORT',
                                help=f'in realtime: {server.does} on {SERVER_ADDRESS}; default port: {server.port}')
        else:
            parser.add_argument(f'--{name}', action='store_const', const=0, help=f'in realtime: {server.does}')


def port(text):
    """Return a TCP port of an option. Raises ValueError."""
    port = int(text)
    if not 1 <= port <= 65535:
        raise ValueError(text)
    return port


def check(ports, header, option='--{} '):
    """Raise ValueError where servers are requested in lockstep, a library is missing, or a port is in use.

    ports: {server: port, 0 without one}; option: format of an option with a value.
    """
    with contextlib.ExitStack() as probes:
        for name, number in ports.items():
            requested = option.format(name).strip()
            if header.pacing != 'realtime':
                raise ValueError(f'{requested} needs {option.format("pacing")}realtime')
            library = SERVERS[name].library
            if library and not importlib.util.find_spec(library):
                raise ValueError(f"{requested} needs {library}: pip install '{SERVERS[name].extra}'")
            try:
                if number:
                    probes.enter_context(tcp_port.listen(SERVER_ADDRESS, number))
            except OSError as error:
                raise ValueError(f'{requested}: {error}: {option.format(name)}PORT selects another port') from None


def selected(options, header) -> dict:
    """Return {name: ServerProcess} of the servers of the options. Raises ValueError, see `check`."""
    ports = {name: getattr(options, name) for name in SERVERS if getattr(options, name) is not None}
    check(ports, header)
    return {name: ServerProcess(
        [sys.executable, '-m', SERVERS[name].module, '--ros-args', '-p', f'graph.beams:={header.graph_beams}',
         *(['-p', f'port:={number}'] if number else [])], SERVERS[name].first_lines)
        for name, number in ports.items()}
