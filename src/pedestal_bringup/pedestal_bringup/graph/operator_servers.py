"""Servers beside a realtime run, for other programs: each is a node of its own that uses only the topics of the
graph."""
import contextlib
import importlib.util
import json
import signal
import subprocess
import sys
import typing

from pedestal_bringup.graph.processes import RunError, log_folder
from pedestal_operator.page.page_security import PAGE_ROLES

SERVER_STOP_TIMEOUT_S = 5.0
"""Grace period of a server at its end [s]."""


class Server(typing.NamedTuple):
    """Row of SERVERS.

    module       module of the node; executable: its name for ROS 2
    port         default port; 0: it has none
    does         its task, for the help
    first_lines  number of first lines on its standard output that are for the user
    library      Python package that it needs; extra: its name for pip
    """
    module: str
    executable: str
    port: int
    does: str
    first_lines: int = 0
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
                                help=f'in realtime: {server.does} on 127.0.0.1; default port: {server.port}')
        else:
            parser.add_argument(f'--{name}', action='store_const', const=0, help=f'in realtime: {server.does}')


def port(text):
    """Return a TCP port of an option. Raises ValueError."""
    port = int(text)
    if not 1 <= port <= 65535:
        raise ValueError(text)
    return port


def check(names, header, option='--{} '):
    """Raise ValueError where servers are requested in lockstep, or a library is missing. option: format of an option
    with a value."""
    for name in names:
        requested = option.format(name).strip()
        if header.pacing != 'realtime':
            raise ValueError(f'{requested} needs {option.format("pacing")}realtime')
        library = SERVERS[name].library
        if library and not importlib.util.find_spec(library):
            raise ValueError(f"{requested} needs {library}: pip install '{SERVERS[name].extra}'")


@contextlib.contextmanager
def servers(options, header, bag):
    """Run the servers of the options while the context is open. Raises ValueError in lockstep, and where a library is
    missing."""
    wanted = {name: getattr(options, name) for name in SERVERS if getattr(options, name) is not None}
    check(wanted, header)
    if wanted:
        log_folder(bag).mkdir(parents=True, exist_ok=True)
    processes = []
    try:
        for name, port in wanted.items():
            server = SERVERS[name]
            with open(log_folder(bag) / f'{name}.out', 'wb') as output:
                processes.append(subprocess.Popen(
                    [sys.executable, '-m', server.module, '--ros-args', '-p', f'graph.beams:={header.graph_beams}',
                     *(['-p', f'port:={port}'] if port else [])], text=True,
                    stdin=subprocess.DEVNULL, stdout=subprocess.PIPE if server.first_lines else output,
                    stderr=output if server.first_lines else subprocess.STDOUT, start_new_session=True))
            if server.first_lines:
                _pass_on(name, processes[-1], server.first_lines)
            else:
                print(f'{name}: 127.0.0.1:{port}' if port else f'{name}: robot_description, tf', flush=True)
        yield
    finally:
        for process in processes:
            process.send_signal(signal.SIGTERM)
        for process in processes:
            try:
                process.wait(SERVER_STOP_TIMEOUT_S)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
            if process.stdout:
                process.stdout.close()


def _pass_on(name, process, lines):
    """Print the first lines of a server. Raises RunError for a server that ends instead, with the error that it
    prints."""
    for _ in range(lines):
        line = process.stdout.readline()
        if not line.startswith(name):
            raise RunError(f'--{name}: {json.loads(line)["error"] if line else "it did not start"}')
        print(line, end='', flush=True)
