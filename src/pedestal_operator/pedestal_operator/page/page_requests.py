"""Commands from the open pages to the control unit, and the replies; roles and timeouts are checked. No ROS here.

A jog is a command of axis rates that the page repeats while a button is held. Three timeouts end it. Each repetition
is forwarded once, if the last state of the page is at most MAX_STATE_AGE_S old. This module stops the axes if a page
that jogs is silent for JOG_TIMEOUT_S or has left. The control unit itself stops the axes 0.5 s after the last jog.
"""
import math
from collections.abc import Callable, Mapping, Sequence

from pedestal_common.graph import topics
from pedestal_common.quantities import Json, Seconds
from pedestal_common.wire import commands
from pedestal_common.wire.commands import Reply
from pedestal_operator.page import page_security
from pedestal_operator.page.page_server import Client, PageMessage

MAX_STATE_AGE_S = 0.5  # largest age of the last state that a page received, for a jog of the page [s]
JOG_TIMEOUT_S = 0.4  # time after the last jog of a page at which the axes are stopped [s]
PAGE_REPLY_TIMEOUT_S = 2.0  # longest wait for a reply of the control unit [s]
MAX_JOG_RATE_DEG_S = 10.0  # largest rate of a jog [deg/s]
MAX_ARGUMENTS = 20  # largest number of arguments of a command


class PageRequests:
    """Commands of all pages. request(who, verb, {argument: value}) sends a command and returns its number;
    is_jogging() is True while the antenna follows a jog."""

    def __init__(self, request: Callable[[str, str, Mapping[str, object]], str],
                 replied: Callable[[str], Reply | None], send: Callable[[Client, Mapping[str, object]], None],
                 is_jogging: Callable[[], bool]) -> None:
        self._request, self._replied, self._send, self._is_jogging = request, replied, send, is_jogging
        # _waiting: {number of a request: (page, number on the page, command, time)}; _jogs: {page: last time}.
        self._waiting: dict[str, tuple[Client, Json, str, Seconds]] = {}
        self._jogs: dict[Client, Seconds] = {}

    def take(self, received: PageMessage, now: Seconds) -> None:
        """Take a message of a page at the time now."""
        client, message, age = received
        if message is None:
            self._end_jog(client, now)
        elif 'jog' in message:
            self._jog(client, message['jog'], now, age)
        elif isinstance(message.get('ask'), str):
            self._forward(client, message, now)
        else:
            self._send(client, {'error': 'unknown message: must have jog or ask'})

    def _forward(self, client: Client, message: Mapping[str, Json], now: Seconds) -> None:
        verb, given, number = message['ask'], message.get('arguments') or {}, message.get('id')
        if not (isinstance(given, dict) and len(given) <= MAX_ARGUMENTS and _is_allowed(verb) and all(
                _is_allowed(name) and isinstance(value, (str, int, float)) and _is_allowed(str(value))
                for name, value in given.items())):
            self._send(client, {'error': f'ask: must be a verb with at most {MAX_ARGUMENTS} numbers or texts'})
            return
        refusal = page_security.refusal_reason(client.role, verb, given)
        if refusal:
            self._send(client, {'id': number, 'verb': verb, 'granted': False, 'reply': refusal})
            return
        self._jogs.pop(client, None)
        self._waiting[self._request(str(client), verb, given)] = client, number, verb, now

    def _jog(self, client: Client, rates: Json, now: Seconds, age: Seconds) -> None:
        """Send a jog. rates: those of both axes [deg/s], 0 at its end; age: that of the last state on the page."""
        refusal = page_security.refusal_reason(client.role, 'rate', {})
        if refusal:
            self._send(client, {'verb': 'rate', 'granted': False, 'reply': refusal})
        elif not (isinstance(rates, list) and len(rates) == 2 and all(
                type(rate) in (int, float) and abs(rate) <= MAX_JOG_RATE_DEG_S for rate in rates)):
            self._send(client, {'error': f'jog: must be two rates of at most {MAX_JOG_RATE_DEG_S:g} deg/s'})
        elif not any(rates):
            self._end_jog(client, now)
        elif age > MAX_STATE_AGE_S:
            self._end_jog(client, now)
            self._send(client, {'verb': 'rate', 'granted': False,
                                'reply': f'the state on the page is {min(age, 999.0):.1f} s old: must be at most '
                                         f'{MAX_STATE_AGE_S:g} s'})
        else:
            self._jogs[client] = now
            self._rate(client, rates, now)

    def _rate(self, client: Client, rates: Sequence[float], now: Seconds) -> None:
        number = self._request(str(client), 'rate', dict(zip(topics.AXES, map(math.radians, map(float, rates)))))
        self._waiting[number] = client, None, 'rate', now

    def _end_jog(self, client: Client, now: Seconds) -> None:
        if self._jogs.pop(client, None) is not None and self._is_jogging():
            self._rate(client, (0.0, 0.0), now)

    def look(self, now: Seconds) -> None:
        """Forward replies, end the jogs of silent pages, and report missing replies, at the time now."""
        for client in [client for client, at in self._jogs.items() if now - at > JOG_TIMEOUT_S]:
            self._end_jog(client, now)
        for number, (client, page_number, verb, at) in list(self._waiting.items()):
            reply = self._replied(number)
            if reply is None and now - at > PAGE_REPLY_TIMEOUT_S:
                reply = Reply(False, f'the control unit did not reply within {PAGE_REPLY_TIMEOUT_S:g} s')
            if reply is not None:
                del self._waiting[number]
                self._forward_reply(client, page_number, verb, reply, now)

    def _forward_reply(self, client: Client, page_number: Json, verb: str, reply: Reply, now: Seconds) -> None:
        """The reply to an accepted jog is left out."""
        if verb == 'stop' and not reply.granted:  # standby is the fallback if the control unit cannot hold the axes
            self._waiting[self._request(str(client), 'standby', {})] = client, page_number, 'standby', now
        if verb != 'rate' or not reply.granted:
            self._send(client, {'id': page_number, 'verb': verb, 'granted': reply.granted, 'reply': reply.text})


def _is_allowed(text: str) -> bool:
    return len(text) <= commands.MAX_TEXT_CHARACTERS and text.isprintable()
