"""ROS node that serves the rotator protocol EasyComm over TCP and a serial device, for programs that track satellites.

In the folder rotator, easycomm.py reads the lines and controller.py turns them into commands.
"""
import dataclasses

from pedestal_common import parameters
from pedestal_common.graph.nodes import Node
from pedestal_common.quantities import Degrees, Seconds
from pedestal_operator.rotator import easycomm
from pedestal_operator.rotator.controller import PendingRequest
from pedestal_operator.rotator.line_server import Client, Stream
from pedestal_operator.rotator.pointing import OUTCOME_DONE, OUTCOME_REFUSED, Refused
from pedestal_operator.rotator.server_node import ServerNode, ServerParameters, tcp_port

SERVER_VERSION = 'pedestal'  # text in the answer to VE


@dataclasses.dataclass(frozen=True)
class EasycommParameters(ServerParameters):
    """Parameters of the EasyComm server."""
    port: int = tcp_port(4535)
    device: str = parameters.text('', 'serial device of a further client, for example /dev/ttyUSB0; empty: none')
    jog_rate: float = parameters.parameter(2.0, 0.01, 60.0, 'deg/s', 'rate of ML, MR, MU and MD')


class EasycommClient(Client):
    """A connected program."""
    pending: list[tuple[str | None, PendingRequest]]    # lines with their requests, in order
    set_point: tuple[Degrees, Degrees] | None = None    # the last one, because a line may have one of the angles only
    refused: bool = False                               # True after a refused setting, until the next accepted one

    def __init__(self, stream: Stream, name: str, longest: int) -> None:
        super().__init__(stream, name, longest)
        self.pending = []


class EasycommNode(ServerNode[EasycommClient]):
    """Server of EasyComm. A setting has no answer in this protocol, so the log and the status GS report a refusal."""
    parameters: EasycommParameters

    def __init__(self, row: Node) -> None:
        super().__init__(row.name, EasycommParameters, easycomm.MAX_LINE_BYTES, EasycommClient)

    @property
    def device(self) -> str:
        """Path of the serial device, '' for none."""
        return self.parameters.device

    def serve(self, client: EasycommClient, now: Seconds) -> None:
        """Execute the lines of a client, and note the outcomes of its requests."""
        while client.lines:
            line = client.lines.popleft()
            try:
                if line is None:
                    raise ValueError(f'more than {easycomm.MAX_LINE_BYTES} bytes')
                self._do(client, line, easycomm.read(line), now)
            except ValueError as error:
                client.pending.append((line, PendingRequest([], now, OUTCOME_REFUSED, str(error))))
            self._note_outcomes(client, now)
        self._note_outcomes(client, now)

    def _note_outcomes(self, client: EasycommClient, now: Seconds) -> None:
        while client.pending and (outcome := client.pending[0][1].look(self, now)) is not None:
            line, pending = client.pending.pop(0)
            self._note(client, line, '' if outcome == OUTCOME_DONE else pending.reason)

    def _note(self, client: EasycommClient, line: str | None, refusal: str) -> None:
        """refusal: reason, '' for an accepted setting."""
        client.refused = bool(refusal)
        if refusal:
            client.set_point = None
            self.refuse(client, 'setting', line, refusal)
        else:
            client.refusals.pop('setting', None)

    def _do(self, client: EasycommClient, line: str, request: easycomm.LineRequest, now: Seconds) -> None:
        control, name = self.controller, client.name
        pending = None
        if request.azimuth is not None or request.elevation is not None:
            pending = self._point(client, (request.azimuth, request.elevation), now)
        elif request.rates is not None:
            scale = self.parameters.jog_rate if request.scaled else 1.0
            pending = control.jog(name, [scale * rate for rate in request.rates], now)
        elif request.verb:
            pending = control.stop(name, now) if request.verb == 'stop' else control.do(name, request.verb, now)
        if pending:
            client.pending.append((line, pending))
        angles = self._angles(client, line) if request.queries else None
        client.queue_answer(easycomm.answer(request, angles, self._status(client, angles), 0, SERVER_VERSION))

    def _point(self, client: EasycommClient, angles: tuple[Degrees | None, Degrees | None],
               now: Seconds) -> PendingRequest:
        """Point to angles (azimuth, elevation); an angle that is None keeps its last value."""
        try:
            last = None if client.refused else self.controller.pointing.set_point(now)
            before = client.set_point or last or self.controller.pointing.earth_angles()
        except Refused as refused:
            return PendingRequest([], now, refused.outcome, refused.reason)
        azimuth, elevation = (angle if given is None else given for given, angle in zip(angles, before))
        pending = self.controller.go(client.name, azimuth, elevation, now)
        client.set_point = (azimuth, elevation) if pending.outcome is None else client.set_point
        return pending

    def _angles(self, client: EasycommClient, line: str) -> tuple[Degrees, Degrees] | None:
        try:
            angles = self.controller.pointing.earth_angles()
        except Refused as refused:
            self.refuse(client, 'query', line, refused.reason)
            return None
        client.refusals.pop('query', None)
        return angles

    def _status(self, client: EasycommClient, angles: tuple[Degrees, Degrees] | None) -> int:
        if client.refused or angles is None:
            return easycomm.STATUS_ERROR
        moving = any(abs(rate) > 0.01 for rate in self.rates())
        return easycomm.STATUS_MOVING if moving else easycomm.STATUS_IDLE
