"""Who is in control: one holder at a time, by name. Everybody may stop the antenna, and with nobody in control ask."""
from pedestal_common.wire.commands import Reply

CONTROL_ROLES = ('operator', 'supervisor')
"""A supervisor takes control away from whoever holds it."""

UNRESTRICTED_COMMANDS = ('standby', 'stop', 'acu/standby', 'acu/stop')
"""Verbs and services that whoever holds control cannot keep from others."""


class Authority:
    """holder: the name of who is in control, '' for nobody."""

    def __init__(self):
        self.holder = ''

    def admit(self, command):
        """Raise ValueError where a Command is of somebody who is not in control."""
        if self.holder and command.who != self.holder and command.verb not in (*UNRESTRICTED_COMMANDS, 'take'):
            raise ValueError(f'control is held by {self.holder}')

    def take(self, who, role) -> Reply:
        """Give control to `who`; from another one only to a supervisor. Raises ValueError."""
        if not who:
            raise ValueError('who takes control must have a name')
        if self.holder not in ('', who) and role != 'supervisor':
            raise ValueError(f'control is held by {self.holder}')
        before, self.holder = self.holder, who
        return Reply(True, f'control is with {who}' + (f', taken from {before}' if before not in ('', who) else ''))

    def release(self) -> Reply:
        """Take control back from its holder."""
        before, self.holder = self.holder, ''
        return Reply(True, f'control released by {before}' if before else 'nobody was in control')
