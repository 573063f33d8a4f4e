"""ROS node that programs with an EasyComm rotator talk to: over TCP and a serial device."""
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


@dataclasses.dataclass(frozen=True)
class EasycommParameters(ServerParameters):
    """The server."""
    port: int = tcp_port(4535)
    device: str = parameters.text('', 'serial device that it serves as well, for example /dev/ttyUSB0')
    jog_rate: float = parameters.parameter(2.0, 0.01, 60.0, 'deg/s', 'of ML, MR, MU and MD')


class EasycommClient(Client):
    """ask: what is on its way; it is not told of it, but the log is. wanted: its last set-point (azimuth, elevation)
    [deg]: a line may hold one of them."""
    ask = wanted = None


class EasycommNode(ServerNode):
    """What sets something has no answer in this protocol, so a refusal stands in the log and in the status, GS."""

    def __init__(self):
        super().__init__('easycomm', EasycommParameters, easycomm.MAX_LINE_BYTES, EasycommClient)
        self._refused = False

    @property
    def device(self):
        """The path of the serial line, '' where it serves TCP only."""
        return self.parameters.device

    def serve(self, client, now):
        """Do what a client asks for; note what came of it."""
        while client.lines:
            line = client.lines.popleft()
            if line is not None:
                self._do(client, easycomm.read(line), now)
        if client.ask and (outcome := client.ask.look(self, now)) is not None:
            client.ask, self._refused = None, outcome != OUTCOME_DONE
            if self._refused:
                self.get_logger().warning(f'{client.name}: refused')

    def _do(self, client, asked, now):
        ask, name = self.controller, client.name
        if asked.azimuth is not None or asked.elevation is not None:
            before = client.wanted or self.controller.pointing.angles_told()
            client.wanted = tuple(angle if given is None else given for given, angle in zip(
                (asked.azimuth, asked.elevation), before))
            client.ask = ask.go(name, *client.wanted, now)
        if asked.rates is not None:
            scale = self.parameters.jog_rate if asked.scaled else 1.0
            client.ask = ask.jog(name, [scale * rate for rate in asked.rates], now)
        if asked.verb:
            client.ask = ask.stop(name, now) if asked.verb == 'stop' else ask.do(name, asked.verb, now)
        client.say(easycomm.answer(asked, self.controller.pointing.angles_told(), self._status(), 0, SERVER_VERSION))

    def _status(self):
        if self._refused or not self.present('joint_states'):
            return easycomm.STATUS_ERROR
        moving = any(abs(rate) > 0.01 for rate in self.rates())
        return easycomm.STATUS_MOVING if moving else easycomm.STATUS_IDLE


def main(args=None) -> int:
    """Run the server until it is stopped; args: of the command line, None for sys.argv."""
    return shell.main(EasycommNode, args)


if __name__ == '__main__':
    sys.exit(main())
