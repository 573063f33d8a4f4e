"""ROS node that serves the rotctld protocol over TCP to clients of Hamlib and to gpredict."""
import pedestal_common.entry  # noqa: F401

# isort: split
import dataclasses
import sys

from pedestal_common import parameters
from pedestal_common.node import shell
from pedestal_operator.rotator import controller, rotctld
from pedestal_operator.rotator.line_server import Client
from pedestal_operator.rotator.rotctld import RESULT_BUSY, RESULT_INVALID, RESULT_OK, RESULT_REJECTED, RESULT_TIMEOUT
from pedestal_operator.rotator.server_node import ServerNode, ServerParameters, tcp_port

RESULT_BY_OUTCOME = {controller.OUTCOME_DONE: RESULT_OK, controller.OUTCOME_REFUSED: RESULT_REJECTED,
                     controller.OUTCOME_OUT_OF_REACH: RESULT_INVALID, controller.OUTCOME_BUSY: RESULT_BUSY,
                     controller.OUTCOME_NO_REPLY: RESULT_TIMEOUT}
"""{outcome of a request: result of the protocol}."""

VERB_BY_COMMAND = {'park': 'stow', 'reset': 'acu/reset_faults'}
"""{command of rotctld: command of the control unit}."""


@dataclasses.dataclass(frozen=True)
class RotctldParameters(ServerParameters):
    """Parameters of the rotctld server."""
    port: int = tcp_port(4533)
    read_only: bool = parameters.flag(False, 'refusal of all commands that move the antenna')
    raw_azimuth: bool = parameters.flag(False, 'azimuth in answers over the whole travel, not modulo 360 deg')
    jog_rate: float = parameters.parameter(5.0, 0.01, 60.0, 'deg/s', 'rate of `move` at 100 %')


class RotctldClient(Client):
    """request, pending: the rotctld.Request without an answer, and its controller.PendingRequest."""
    request = pending = None


class RotctldNode(ServerNode):
    """Server of the rotctld protocol; it answers the lines of a client in order."""

    def __init__(self):
        super().__init__('rotctld', RotctldParameters, rotctld.MAX_LINE_BYTES, RotctldClient)

    def serve(self, client, now):
        """Answer the lines in order; a command of the antenna is answered after the reply of the control unit."""
        while client.pending or client.lines:
            if client.pending:
                outcome = client.pending.look(self, now)
                if outcome is None:
                    return
                client.pending = None
                client.queue_answer(rotctld.answer(client.request, RESULT_BY_OUTCOME[outcome]))
                continue
            line = client.lines.popleft()
            request = rotctld.read(line) if line is not None else rotctld.Request('', error=RESULT_INVALID)
            if request is None:
                continue
            if request.error == RESULT_OK and request.name == 'quit':
                client.gone = ''
                client.lines.clear()
            elif request.error != RESULT_OK:
                client.queue_answer(rotctld.answer(request, request.error))
            elif request.name in rotctld.SET_COMMANDS:
                self._move(client, request, now)
            else:
                client.queue_answer(rotctld.answer(request, RESULT_OK, self._lines(request)))

    def _move(self, client, request, now):
        if self.parameters.read_only:
            client.queue_answer(rotctld.answer(request, RESULT_REJECTED))
            return
        control, name = self.controller, client.name
        client.request = request
        if request.name == 'set_pos':
            client.pending = control.go(name, *request.values, now)
        elif request.name == 'move':
            direction, percent = request.values
            rate = self.parameters.jog_rate * (50 if percent == -1 else percent) / 100.0
            client.pending = control.jog(name, [rate * part for part in rotctld.MOVE_DIRECTIONS[direction]], now)
        elif request.name == 'stop':
            client.pending = control.stop(name, now)
        else:
            client.pending = control.do(name, VERB_BY_COMMAND[request.name], now)

    def _lines(self, request):
        """Return [(name, text)], the values in the answer to a request without motion."""
        pointing, limits = self.controller.pointing, self.controller.pointing.limits
        if request.name == 'get_pos':
            return rotctld.position(*pointing.earth_angles(), self.parameters.raw_azimuth)
        if request.name == 'get_info':
            return [('Info', f'pedestal, {self.texts.get("acu/mode", "no control unit")}'[:63])]
        if request.name == 'get_status':
            return [('Status flags', rotctld.flags(self.rates(), pointing.earth_angles(), limits))]
        if request.name == 'dump_caps':
            return [('', f'Caps of the pedestal: azimuth {limits.azimuth}, elevation {limits.elevation} deg')]
        return rotctld.state(limits, bool(request.separator))


def main(args=None) -> int:
    """Run the server until it is stopped. args: of the command line, None for sys.argv."""
    return shell.main(RotctldNode, args)


if __name__ == '__main__':
    sys.exit(main())
