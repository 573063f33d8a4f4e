"""The node of a server that other programs talk to in lines, whatever they speak."""
import dataclasses
import time

from pedestal_common import parameters
from pedestal_operator.remote_node import Remote
from pedestal_operator.rotator.controller import Controller
from pedestal_operator.rotator.line_server import LineServer

POLL_PERIOD_S = 0.005
"""Time [s] between two looks at the clients."""


@dataclasses.dataclass(frozen=True)
class ServerParameters(parameters.Parameters):
    """What every server has; each adds its `port`."""
    address: str = parameters.text('127.0.0.1', 'on which it listens; anybody who reaches it can ask for motion')
    clients: int = parameters.parameter(8, 1, 64, '', 'at most so many at a time')


def tcp_port(default):
    """The parameter `port` of a server."""
    return parameters.parameter(default, 0, 65535, '', 'TCP port; 0: a free one, which it says')


class ServerNode(Remote):
    """Serves its clients between two looks of its executor.

    parameters_type: its ServerParameters; longest: bytes of a line; make_client: see line_server.LineServer.
    """
    awaits = 'clients'
    device = ''
    """Serial device that it serves as well, '' for none; overridden by a server that can."""

    def __init__(self, name, parameters_type, longest, make_client):
        super().__init__(name, name, parameters_type=parameters_type)
        p = self.parameters
        self.controller = Controller(self)
        self._server = LineServer(name, p.address, p.port, p.clients, longest, self.device, make_client)
        self.get_logger().info(f'listens on {p.address}:{self._server.port}'
                               + (f' and {self.device}' if self.device else ''))
        self.every(POLL_PERIOD_S, self._look)

    def serve(self, client, now):
        """Answer what a client has said, at the time now [s]; overridden."""
        raise NotImplementedError

    def _look(self):
        now = time.monotonic()
        self._server.look()
        self.controller.look(now)
        for client in self._server.clients:
            self.serve(client, now)
        for client in self._server.send():
            self.controller.leave(client.name, now)
            told = f'{client.dropped} answers dropped that it did not read' if client.dropped else ''
            if client.gone or told:
                self.get_logger().warning(f'{client.name}: {", ".join(filter(None, (client.gone, told)))}')

    def close(self):
        """Close the port, then the node."""
        self._server.close()
        super().close()
