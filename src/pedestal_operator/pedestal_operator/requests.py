"""What was asked of a node, and the replies. No ROS here."""
import itertools

from pedestal_common.wire.commands import Command

MAX_KEPT_REQUESTS = 1000
"""Requests that are remembered, the latest: not everybody waits for a reply."""


class Requests:
    """Numbers for requests, and their replies. prefix: of the numbers, so that no other program has the same."""

    def __init__(self, prefix):
        self._numbers = (f'{prefix}-{count}' for count in itertools.count(1))
        self._asked, self._replies = {}, {}

    def __len__(self):
        return len(self._asked)

    def add(self, verb, who, arguments=None) -> Command:
        """The Command of a new request by somebody of that name, with {argument: value}."""
        command = Command(verb, who, next(self._numbers), {
            name: f'{value:.9g}' if isinstance(value, float) else str(value)
            for name, value in (arguments or {}).items()})
        self._asked[command.number] = command
        if len(self._asked) > MAX_KEPT_REQUESTS:
            self._forget(next(iter(self._asked)))
        return command

    def asked(self, number) -> Command:
        """The Command of a request without a reply. Raises KeyError where there is none."""
        return self._asked[number]

    def take(self, command, reply):
        """Keep the Reply to a Command that is one of these requests."""
        asked = self._asked.get(command.number)
        if asked and asked.who == command.who:
            self._replies[command.number] = reply

    def replied(self, number):
        """The Reply to a request, once; None as long as there is none."""
        return self._forget(number) if number in self._replies else None

    def _forget(self, number):
        del self._asked[number]
        return self._replies.pop(number, None)
