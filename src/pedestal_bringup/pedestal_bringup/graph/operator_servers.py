"""Servers that connect other programs to the antenna, which `pedestal run` starts beside a realtime run. Each server
is a node of its own that uses only the topics of the graph."""
import contextlib
import importlib.util
import typing
from collections.abc import Mapping

from pedestal_bringup.graph.processes import ServerProcess
from pedestal_bringup.scenario.header import ScenarioParameters
from pedestal_common.graph import nodes
from pedestal_common.node import run
from pedestal_common.stream import listen
from pedestal_operator.page.page_security import PAGE_ROLES

SERVER_ADDRESS = '127.0.0.1'
"""Address on which the servers of a run accept connections (this machine only), the default of each server."""


class Server(typing.NamedTuple):
    """Server, a row of SERVERS."""
    executable: str         # of its node
    port: int               # default TCP port; 0: the server has none
    does: str               # task of the server, for the help texts
    first_lines: int = 1    # number of lines that it prints for the user when it begins to serve; each begins with
                            # its name
    library: str = ''       # Python package that it needs, beyond those of every node; '': none
    extra: str = ''         # name of the pip requirement that installs the library

    @property
    def package(self) -> str:
        """Name of the ROS package that contains the node."""
        return nodes.EXECUTABLES[self.executable].package


SERVERS = {'rotctld': Server('rotctld_node', 4533,
                             "serve the protocol of Hamlib's rotctld"),
           'easycomm': Server('easycomm_node', 4535,
                              'serve EasyComm I, II and III'),
           'page': Server('operator_page', 8080,
                          "serve the operator's page for a browser", first_lines=len(PAGE_ROLES)),
           'foxglove': Server('live_node', 8765, 'serve every topic to Foxglove',
                              library='foxglove', extra='pedestal_operator[live]'),
           'frames': Server('frames_node', 0,
                            'publish robot_description and tf, for RViz')}


def port(text: str) -> int:
    """Return the TCP port that the text of an option states. Raises ValueError outside 1 to 65535."""
    port = int(text)
    if not 1 <= port <= 65535:
        raise ValueError(text)
    return port


def check(ports: Mapping[str, int], header: ScenarioParameters, option: str = '--{} ') -> None:
    """Raise ValueError if servers are requested in lockstep, if a library is missing, or if a port is in use.

    ports: {name: port, 0 without one}; option: format of an option in the error, such as '{}:=' for a launch file.
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
                    probes.enter_context(listen(SERVER_ADDRESS, number))
            except OSError as error:
                raise ValueError(f'{requested}: {error}: {option.format(name)}PORT selects another port') from None


def processes(ports: Mapping[str, int], header: ScenarioParameters) -> dict[str, ServerProcess]:
    """Return {name: process} of servers {name: TCP port, 0 without one}. Raises ValueError, see `check`."""
    check(ports, header)
    return {name: ServerProcess(
        run.command(SERVERS[name].executable, '--ros-args', '-p', f'graph.beams:={header.graph_beams}',
                    *(['-p', f'port:={number}'] if number else [])), SERVERS[name].first_lines)
        for name, number in ports.items()}
