"""Servers beside a realtime run, for other programs: each is a node of its own that knows the graph by its topics."""
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
"""Seconds a server has to end."""


class Server(typing.NamedTuple):
    """A row of SERVERS.

    module   of the node; executable: its name for ROS 2
    port     by default; 0: it has none
    does     what it does, for the help
    says     lines that it begins with on its standard output, which are for the user
    library  a Python package that it needs; extra: by which pip installs that
    """
    module: str
    executable: str
    port: int
    does: str
    says: int = 0
    library: str = ''
    extra: str = ''

    @property
    def package(self):
        """The ROS package of its node."""
        return self.module.partition('.')[0]


SERVERS = {'rotctld': Server('pedestal_operator.rotctld_node', 'rotctld_node', 4533,
                             "serve the protocol of Hamlib's rotctld"),
           'easycomm': Server('pedestal_operator.easycomm_node', 'easycomm_node', 4535,
                              'serve EasyComm I, II and III'),
           'page': Server('pedestal_operator.page_node', 'operator_page', 8080,
                          "serve the operator's page for a browser", says=len(PAGE_ROLES)),
           'foxglove': Server('pedestal_operator.live_node', 'live_node', 8765, 'serve every topic to Foxglove',
                              library='foxglove', extra='pedestal_operator[live]'),
           'frames': Server('pedestal_operator.frames_node', 'frames_node', 0,
                            'publish robot_description and tf, for RViz')}


def add_arguments(parser):
    """--rotctld [PORT] and so on."""
    for name, server in SERVERS.items():
        if server.port:
            parser.add_argument(f'--{name}', nargs='?', type=port, const=server.port, metavar='PORT',
                                help=f'in realtime: {server.does} on 127.0.0.1; default port: {server.port}')
        else:
            parser.add_argument(f'--{name}', action='store_const', const=0, help=f'in realtime: {server.does}')


def port(text):
    """A TCP port in an option. Raises ValueError."""
    port = int(text)
    if not 1 <= port <= 65535:
        raise ValueError(text)
    return port


def check(names, header, option='--{} '):
    """Raise ValueError where servers are asked for in lockstep, or one lacks its library. option: how a value is
    given to whoever asks."""
    for name in names:
        asked = option.format(name).strip()
        if header.pacing != 'realtime':
            raise ValueError(f'{asked} needs {option.format("pacing")}realtime')
        library = SERVERS[name].library
        if library and not importlib.util.find_spec(library):
            raise ValueError(f"{asked} needs {library}: pip install '{SERVERS[name].extra}'")


@contextlib.contextmanager
def servers(options, header, bag):
    """Run the servers that the options ask for as long as the context is open. Raises ValueError in lockstep, and
    where a library is missing."""
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
                    stdin=subprocess.DEVNULL, stdout=subprocess.PIPE if server.says else output,
                    stderr=output if server.says else subprocess.STDOUT, start_new_session=True))
            if server.says:
                _pass_on(name, processes[-1], server.says)
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
    """Print the first lines of a server. Raises RunError where it ends instead, which it tells in one."""
    for _ in range(lines):
        line = process.stdout.readline()
        if not line.startswith(name):
            raise RunError(f'--{name}: {json.loads(line)["error"] if line else "it did not start"}')
        print(line, end='', flush=True)
