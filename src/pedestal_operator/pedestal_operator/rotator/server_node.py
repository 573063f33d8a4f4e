"""Base class of the nodes that serve a rotator protocol, line by line, to other programs (rotctld, EasyComm)."""
import dataclasses
import time
from collections.abc import Callable
from typing import Generic

from pedestal_common import parameters
from pedestal_common.quantities import Seconds
from pedestal_operator.remote_node import Remote
from pedestal_operator.rotator.controller import Controller
from pedestal_operator.rotator.line_server import AnyClient, LineServer, Stream

POLL_PERIOD_S = 0.005  # period at which the node reads from and answers its clients [s]


def tcp_port(default: int) -> int:
    """Return the parameter `port` of a server."""
    return parameters.parameter(default, 0, 65535, '', 'TCP port; 0: a free port, which the node prints')


@dataclasses.dataclass(frozen=True)
class ServerParameters(parameters.Parameters):
    """Common parameters of the servers; each server has its own default of `port`."""
    address: str = parameters.text('127.0.0.1', 'address of the server; programs that reach it can move the antenna')
    clients: int = parameters.parameter(8, 1, 64, '', 'largest number of connected clients')
    port: int = tcp_port(0)
    permission: bool = parameters.flag(True, 'a program takes control only while it is free and the antenna is not in '
                                       'a pass, or after the command `allow` of an operator; false: while it is free')


class ServerNode(Remote, Generic[AnyClient]):
    """Node that serves its clients from a timer. longest, make_client: see line_server.LineServer."""
    awaits = 'clients'

    parameters: ServerParameters
    _checked_arrival: Seconds | None

    def __init__(self, name: str, parameters_type: type[ServerParameters], longest: int,
                 make_client: Callable[[Stream, str, int], AnyClient]) -> None:
        super().__init__(name, name, parameters_type=parameters_type)
        p = self.parameters
        self.controller = Controller(self, 'program' if p.permission else 'operator')
        self._checked_arrival = None
        self._server = LineServer(name, p.address, p.port, p.clients, longest, self.device, make_client)
        print(f'{name}: {p.address}:{self._server.port}' + (f' and {self.device}' if self.device else ''), flush=True)
        self.every(POLL_PERIOD_S, self._serve_clients)

    @property
    def device(self) -> str:
        """Path of the serial device of a further client, '' for none; overridden by servers with serial devices."""
        return ''

    def serve(self, client: AnyClient, now: Seconds) -> None:
        """Answer the lines of a client at the time now; overridden."""
        raise NotImplementedError

    def _serve_clients(self) -> None:
        now = time.monotonic()
        self._server.look()
        self._release_lost_control()
        self.controller.look(now)
        for client in self._server.clients:
            self.serve(client, now)
        for client in self._server.send():     # the clients that have left
            self.controller.leave(client.name)
            dropped = f'{client.dropped} answers dropped, because they were not read' if client.dropped else ''
            if client.gone or dropped:
                self.get_logger().warning(f'{client.name}: {", ".join(filter(None, (client.gone, dropped)))}')

    def _release_lost_control(self) -> None:
        """Release control of a client of an earlier process. Each arrival of the diagnostics is checked once."""
        arrival = self.arrivals.get('acu')
        if arrival == self._checked_arrival:
            return
        self._checked_arrival, holder = arrival, self.diagnostics_of('acu').get('control', '')
        if self._server.is_own(holder) and holder != self.controller.holder:
            self.who = holder     # releases in the name of the client that holds control
            self.request('release')

    def refuse(self, client: AnyClient, command: str, line: str | None, reason: str) -> None:
        """Log the refusal of a line of a client. line: None if it was too long. A reason that repeats is logged once,
        and again after the next success of the command: the subclass then deletes the reason from client.refusals."""
        if client.refusals.get(command) != reason:
            client.refusals[command] = reason
            refused = 'refused a line' if line is None else f'refused {line!r}'
            self.get_logger().warning(f'{client.name}: {refused}: {reason.removeprefix("refused: ")}')

    def close(self) -> None:
        """Release the control of the clients, then close the port and the node."""
        self.controller.release(time.monotonic())
        self._server.close()
        super().close()
