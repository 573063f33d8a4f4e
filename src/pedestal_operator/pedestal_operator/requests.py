"""Requests of this program to a node, and the replies of the node, matched by the numbers of the requests. No ROS
here.
"""
import itertools
from collections.abc import Mapping

from pedestal_common.wire.commands import Command, Reply

JOG_REPEAT_PERIOD_S = 0.2
"""Period at which a jog is repeated [s], less than half of the jog timeout of the control unit."""

MAX_KEPT_REQUESTS = 1000  # largest number of requests kept, because some replies are never read


class Requests:
    """Requests without a reply, and replies that have not been read. prefix: start of the numbers of the requests,
    unique to this program."""
    _pending: dict[str, Command]    # by number
    _replies: dict[str, Reply]

    def __init__(self, prefix: str) -> None:
        self._numbers = (f'{prefix}-{count}' for count in itertools.count(1))
        self._pending, self._replies = {}, {}

    def __len__(self) -> int:
        return len(self._pending)

    def add(self, verb: str, who: str, arguments: Mapping[str, object] | None = None) -> Command:
        """Return the command of a new request. who: name of the sender; arguments: {argument: value}."""
        command = Command(verb, who, next(self._numbers), {
            name: f'{value:.9g}' if isinstance(value, float) else str(value)
            for name, value in (arguments or {}).items()})
        self._pending[command.number] = command
        if len(self._pending) > MAX_KEPT_REQUESTS:
            self._remove(next(iter(self._pending)))
        return command

    def pending_command(self, number: str) -> Command:
        """Return the command of a request without a reply. Raises KeyError for any other number."""
        return self._pending[number]

    def take(self, command: Command, reply: Reply) -> None:
        """Keep a reply if its command is one of these requests."""
        pending = self._pending.get(command.number)
        if pending and pending.who == command.who:
            self._replies[command.number] = reply

    def replied(self, number: str) -> Reply | None:
        """Return the reply to a request once, None before it arrives."""
        return self._remove(number) if number in self._replies else None

    def _remove(self, number: str) -> Reply | None:
        del self._pending[number]
        return self._replies.pop(number, None)
