"""ROS node that serves the EasyComm protocol over TCP and a serial device."""
import pedestal_common.entry  # noqa: F401

# isort: split
import dataclasses
import sys

from pedestal_common import parameters
from pedestal_common.node import shell
from pedestal_operator.rotator import easycomm
from pedestal_operator.rotator.controller import OUTCOME_DONE
from pedestal_operator.rotator.line_server import Client
from pedestal_operator.rotator.server_node import ServerNode, ServerParameters, tcp_port

SERVER_VERSION = 'pedestal'
"""Text in the answer to VE."""


@dataclasses.dataclass(frozen=True)
class EasycommParameters(ServerParameters):
    """Parameters of the EasyComm server."""
    port: int = tcp_port(4535)
    device: str = parameters.text('', 'serial device of a further client, for example /dev/ttyUSB0; empty: none')
    jog_rate: float = parameters.parameter(2.0, 0.01, 60.0, 'deg/s', 'rate of ML, MR, MU and MD')


class EasycommClient(Client):
    """A connected program.

    pending     its controller.PendingRequest; the outcome is logged only
    set_point   last set-point (azimuth, elevation) [deg], because a line may have one of the angles only
    """
    pending = set_point = None


class EasycommNode(ServerNode):
    """Server of EasyComm. A setting has no answer in this protocol, so the log and the status GS report a refusal."""

    def __init__(self):
        super().__init__('easycomm', EasycommParameters, easycomm.MAX_LINE_BYTES, EasycommClient)
        self._refused = False

    @property
    def device(self):
        """Path of the serial device, '' for none."""
        return self.parameters.device

    def serve(self, client, now):
        """Execute the lines of a client, and note the outcome of its last request."""
        while client.lines:
            line = client.lines.popleft()
            if line is not None:
                self._do(client, easycomm.read(line), now)
        if client.pending and (outcome := client.pending.look(self, now)) is not None:
            client.pending, self._refused = None, outcome != OUTCOME_DONE
            if self._refused:
                self.get_logger().warning(f'{client.name}: refused')

    def _do(self, client, request, now):
        control, name = self.controller, client.name
        if request.azimuth is not None or request.elevation is not None:
            before = client.set_point or self.controller.pointing.earth_angles()
            client.set_point = tuple(angle if given is None else given for given, angle in zip(
                (request.azimuth, request.elevation), before))
            client.pending = control.go(name, *client.set_point, now)
        if request.rates is not None:
            scale = self.parameters.jog_rate if request.scaled else 1.0
            client.pending = control.jog(name, [scale * rate for rate in request.rates], now)
        if request.verb:
            stops = request.verb == 'stop'
            client.pending = control.stop(name, now) if stops else control.do(name, request.verb, now)
        angles = self.controller.pointing.earth_angles()
        client.queue_answer(easycomm.answer(request, angles, self._status(), 0, SERVER_VERSION))

    def _status(self):
        if self._refused or not self.present('joint_states'):
            return easycomm.STATUS_ERROR
        moving = any(abs(rate) > 0.01 for rate in self.rates())
        return easycomm.STATUS_MOVING if moving else easycomm.STATUS_IDLE


def main(args=None) -> int:
    """Run the server until it is stopped. args: of the command line, None for sys.argv."""
    return shell.main(EasycommNode, args)


if __name__ == '__main__':
    sys.exit(main())
