"""ROS node that serves the rotator protocol of rotctld over TCP to gpredict and to other clients of Hamlib.

In the folder rotator, rotctld.py reads the lines and controller.py turns them into commands.
"""
import dataclasses
from collections.abc import Sequence

from pedestal_common import parameters
from pedestal_common.graph.nodes import Node
from pedestal_common.quantities import Seconds
from pedestal_operator.rotator import pointing, rotctld
from pedestal_operator.rotator.controller import PendingRequest
from pedestal_operator.rotator.line_server import Client
from pedestal_operator.rotator.pointing import Refused
from pedestal_operator.rotator.rotctld import RESULT_INVALID, RESULT_OK, RESULT_REJECTED
from pedestal_operator.rotator.server_node import ServerNode, ServerParameters, tcp_port

RESULT_BY_OUTCOME = {pointing.OUTCOME_DONE: RESULT_OK, pointing.OUTCOME_REFUSED: RESULT_REJECTED,
                     pointing.OUTCOME_OUT_OF_REACH: RESULT_INVALID, pointing.OUTCOME_BUSY: rotctld.RESULT_BUSY,
                     pointing.OUTCOME_NO_REPLY: rotctld.RESULT_TIMEOUT,
                     pointing.OUTCOME_NO_POSITION: rotctld.RESULT_IO_ERROR}

ANTENNA_COMMAND_BY_NAME = {'park': 'stow', 'reset': 'acu/reset_faults'}


@dataclasses.dataclass(frozen=True)
class RotctldParameters(ServerParameters):
    """Parameters of the rotctld server."""
    port: int = tcp_port(4533)
    read_only: bool = parameters.flag(False, 'refusal of all commands that move or stop the antenna')
    raw_azimuth: bool = parameters.flag(False, 'azimuth in answers over the whole travel, not modulo 360 deg')
    jog_rate: float = parameters.parameter(5.0, 0.01, 60.0, 'deg/s', 'rate of `move` at 100 %')


class RotctldClient(Client):
    """A connected program."""
    line: str | None = None                                 # the line that waits for its answer
    request: rotctld.Request = rotctld.Request('')          # of the line
    pending: PendingRequest | None = None                   # of the line


class RotctldNode(ServerNode[RotctldClient]):
    """Server of the rotctld protocol; it answers the lines of a client in order."""
    parameters: RotctldParameters

    def __init__(self, row: Node) -> None:
        super().__init__(row.name, RotctldParameters, rotctld.MAX_LINE_BYTES, RotctldClient)

    def serve(self, client: RotctldClient, now: Seconds) -> None:
        """Answer the lines in order; one that commands the antenna, after the reply of the control unit."""
        # A complete command without a line end counts as a line, because gpredict for Windows sends no line end.
        client.end_line(rotctld.is_complete)
        while client.pending or client.lines:
            if client.pending:
                outcome = client.pending.look(self, now)
                if outcome is None:
                    return
                pending, client.pending = client.pending, None
                self._answer(client, RESULT_BY_OUTCOME[outcome], pending.reason)
            else:
                self._begin(client, client.lines.popleft(), now)

    def _begin(self, client: RotctldClient, line: str | None, now: Seconds) -> None:
        """line: None if it was too long. A line for which rotctld.read returns None gets no answer."""
        request = rotctld.Request('', error=RESULT_INVALID) if line is None else rotctld.read(line)
        if request is None:
            return
        client.line, client.request = line, request
        if request.error != RESULT_OK:
            self._answer(client, request.error, rotctld.ERROR_REASONS[request.error] if line is not None else
                         f'more than {rotctld.MAX_LINE_BYTES} bytes')
        elif request.name == 'quit':
            client.gone = ''     # ended without an error
            client.lines.clear()
        elif request.name in rotctld.SET_COMMANDS:
            self._move(client, request, now)
        else:
            try:
                self._answer(client, RESULT_OK, lines=self._lines(request))
            except Refused as refused:
                self._answer(client, RESULT_BY_OUTCOME[refused.outcome], refused.reason)

    def _answer(self, client: RotctldClient, result: int, reason: str = '',
                lines: Sequence[tuple[str, str]] = ()) -> None:
        client.queue_answer(rotctld.answer(client.request, result, lines))
        if result == RESULT_OK:
            client.refusals.pop(client.request.name, None)
        else:
            self.refuse(client, client.request.name, client.line, reason)

    def _move(self, client: RotctldClient, request: rotctld.Request, now: Seconds) -> None:
        if self.parameters.read_only:
            self._answer(client, RESULT_REJECTED, 'this server is read only (parameter read_only)')
            return
        control, name = self.controller, client.name
        if request.name == 'set_pos':
            azimuth, elevation = request.values
            client.pending = control.go(name, azimuth, elevation, now)
        elif request.name == 'move':
            direction, percent = request.values
            # A percentage of -1 means that none was given.
            rate = self.parameters.jog_rate * (50 if percent == -1 else percent) / 100.0
            client.pending = control.jog(name, [rate * part for part in rotctld.MOVE_DIRECTIONS[int(direction)]], now)
        elif request.name == 'stop':
            client.pending = control.stop(name, now)
        else:
            client.pending = control.do(name, ANTENNA_COMMAND_BY_NAME[request.name], now)

    def _lines(self, request: rotctld.Request) -> Sequence[tuple[str, str]]:
        """Return (name, text) of each value. Raises Refused."""
        if request.name == 'help':
            return rotctld.COMMAND_LIST_LINES
        pointing = self.controller.pointing
        if request.name == 'get_pos':
            azimuth, elevation = pointing.earth_angles()
            return rotctld.position(azimuth, elevation, self.parameters.raw_azimuth)
        if request.name == 'get_info':
            mode = self.texts.get('acu/mode', 'no mode') if self.present('acu') else 'no control unit'
            return [('Info', f'pedestal, {mode}'[:63])]
        limits = pointing.limits
        if request.name == 'get_status':
            return [('Status flags', rotctld.flags(self.rates(), pointing.earth_angles(), limits))]
        if request.name == 'dump_caps':
            return [('', f'Caps of the pedestal: azimuth {limits.azimuth}, elevation {limits.elevation} deg')]
        return rotctld.state(limits, bool(request.separator))
