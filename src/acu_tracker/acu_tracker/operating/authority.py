"""Control of the antenna: it belongs to at most one client, whose name is kept here.

While a client holds control, the control unit refuses the commands of other clients, except those that stop the
antenna. While control is free, every client may send any command.
"""
from pedestal_common.wire.commands import HELD_REFUSAL, Command, Reply

CONTROL_ROLES = ('operator', 'supervisor')  # roles of a client; a supervisor may take control from another client

UNRESTRICTED_COMMANDS = ('standby', 'stop', 'acu/standby', 'acu/stop')
"""Commands and services that are open to every client at any time."""


class Authority:
    """Control of the antenna; holder: name of the client that has it, '' while control is free."""

    def __init__(self) -> None:
        self.holder = ''

    def admit(self, command: Command) -> None:
        """Raise ValueError for a Command from a client that does not hold control."""
        if self.holder and command.who != self.holder and command.verb not in (*UNRESTRICTED_COMMANDS, 'take'):
            raise ValueError(f'{HELD_REFUSAL} {self.holder}')

    def take(self, who: str, role: str) -> Reply:
        """Give control to the client named `who`, and return the Reply.

        Raise ValueError if another client holds control; a supervisor takes it all the same.
        """
        if not who:
            raise ValueError('a client that takes control must have a name')
        if self.holder not in ('', who) and role != 'supervisor':
            raise ValueError(f'{HELD_REFUSAL} {self.holder}')
        before, self.holder = self.holder, who
        return Reply(True, f'control is with {who}' + (f', taken from {before}' if before not in ('', who) else ''))

    def release(self) -> Reply:
        """Release control and return the Reply."""
        before, self.holder = self.holder, ''
        return Reply(True, f'control released by {before}' if before else 'control was already free')
