"""Client that commands an antenna by a program: it follows who has control, and notes the interference of others."""
import contextlib
from collections.abc import Callable

from pedestal_common.graph.modes import MODES
from pedestal_common.quantities import Message
from pedestal_common.wire import commands
from pedestal_operator.remote_node import Remote

DRIVE_STATE_TOPIC, EMERGENCY_STOP = 'adu/state', 'emergency stop'  # topic, and its text after an emergency stop


class Commander(Remote):
    """Remote that commands the antenna for a longer time."""
    holder = ''             # client that has control of the antenna, '' for none
    interference = ''       # mode of another client without control, or an emergency stop; '' for none

    def _take_reply(self, status: Message) -> None:
        """Take the replies of the control unit, also those to others: who has control, and who commanded a mode."""
        super()._take_reply(status)
        with contextlib.suppress(ValueError):
            command, reply = commands.of_reply(status)
            verb = command.verb.removeprefix('acu/')
            if reply.granted and verb in ('take', 'release'):
                self.holder = command.who if verb == 'take' else ''
            elif reply.granted and verb in MODES and command.who != self.who and self.holder in ('', self.who):
                self.interference = f'{command.who} commanded {verb}'

    def _text_taker(self, topic: str) -> Callable[[Message], None]:
        take = super()._text_taker(topic)

        def taken(message: Message) -> None:
            if topic == DRIVE_STATE_TOPIC and message.data == EMERGENCY_STOP:
                self.interference = EMERGENCY_STOP
            take(message)
        return taken

    def _take_status(self, array: Message) -> None:
        super()._take_status(array)
        if any(status.name == self.name_of('acu') for status in array.status):
            self.holder = self.diagnostics_of('acu').get('control', '')
