"""Control of the antenna: one client holds it, by name.

Every client may stop the antenna, and may send any command while control is free.
"""
from pedestal_common.wire.commands import Reply

CONTROL_ROLES = ('operator', 'supervisor')
"""Roles of a client; a supervisor takes control from any holder."""

UNRESTRICTED_COMMANDS = ('standby', 'stop', 'acu/standby', 'acu/stop')
"""Commands and services that are open to every client at any time."""


class Authority:
    """Control of the antenna; holder: name of the client that has it, '' while control is free."""

    def __init__(self):
        self.holder = ''

    def admit(self, command):
        """Raise ValueError for a Command from a client that does not hold control."""
        if self.holder and command.who != self.holder and command.verb not in (*UNRESTRICTED_COMMANDS, 'take'):
            raise ValueError(f'control is held by {self.holder}')

    def take(self, who, role) -> Reply:
        """Give control to the client `who`. Raise ValueError if another holds it, except for a supervisor."""
        if not who:
            raise ValueError('a client that takes control must have a name')
        if self.holder not in ('', who) and role != 'supervisor':
            raise ValueError(f'control is held by {self.holder}')
        before, self.holder = self.holder, who
        return Reply(True, f'control is with {who}' + (f', taken from {before}' if before not in ('', who) else ''))

    def release(self) -> Reply:
        """Release control."""
        before, self.holder = self.holder, ''
        return Reply(True, f'control released by {before}' if before else 'control was already free')
