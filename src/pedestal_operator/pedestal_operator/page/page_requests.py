"""What pages ask, on its way to the control unit and back: roles, dead men, replies. No ROS here.

A jog has three dead men. The page repeats it while it is held: it is passed on once for each time that it comes, if
the state that the page saw last is not older than MAX_STATE_AGE_S. A page that jogged and is silent for
JOG_TIMEOUT_S, or
has gone, is stopped here. The control unit's own dead man, 0.5 s, has the last word.
"""
import math

from pedestal_common.graph import topics
from pedestal_common.wire import commands
from pedestal_common.wire.commands import Reply
from pedestal_operator.page import page_security

MAX_STATE_AGE_S = 0.5
"""Age [s] of the state that a page saw last beyond which what it holds is not believed."""

JOG_TIMEOUT_S = 0.4
"""Time [s] without another jog after which the axes are told to stand."""

PAGE_REPLY_TIMEOUT_S = 2.0
"""Time [s] within which the control unit replies to a page."""

MAX_JOG_RATE_DEG_S = 10.0
"""Rate [deg/s] of a jog at the most."""

MAX_ARGUMENTS = 20
"""Arguments of an ask at the most."""


class PageRequests:
    """ask(who, verb, {argument: value}) -> number of the request; replied(number) -> its Reply or None; tell(client,
    message): what a page is told; jogged() -> whether the antenna still follows a jog."""

    def __init__(self, ask, replied, tell, jogged):
        self._ask, self._replied, self._tell, self._jogged = ask, replied, tell, jogged
        self._waiting, self._jogs = {}, {}

    def take(self, asked, now):
        """What a page has asked (page_server.Asked), at the time now [s]."""
        client, message, age = asked
        if message is None:
            self._end_jog(client, now)
        elif 'jog' in message:
            self._jog(client, message['jog'], now, age)
        elif isinstance(message.get('ask'), str):
            self._pass_on(client, message, now)
        else:
            self._tell(client, {'error': 'that was no message of this page'})

    def _pass_on(self, client, message, now):
        verb, given, number = message['ask'], message.get('arguments') or {}, message.get('id')
        if not (isinstance(given, dict) and len(given) <= MAX_ARGUMENTS and _sound(verb) and all(
                _sound(name) and isinstance(value, (str, int, float)) and _sound(str(value))
                for name, value in given.items())):
            self._tell(client, {'error': 'an ask must have a verb and arguments that are numbers or texts'})
            return
        why = page_security.refusal_reason(client.role, verb, given)
        if why:
            self._tell(client, {'id': number, 'verb': verb, 'granted': False, 'reply': why})
            return
        self._jogs.pop(client, None)
        self._waiting[self._ask(str(client), verb, given)] = client, number, verb, now

    def _jog(self, client, rates, now, age):
        why = page_security.refusal_reason(client.role, 'rate', {})
        if why:
            self._tell(client, {'verb': 'rate', 'granted': False, 'reply': why})
        elif not (isinstance(rates, list) and len(rates) == 2 and all(
                type(rate) in (int, float) and abs(rate) <= MAX_JOG_RATE_DEG_S for rate in rates)):
            self._tell(client, {'error': f'jog: must be two rates of at most {MAX_JOG_RATE_DEG_S:g} deg/s'})
        elif not any(rates):
            self._end_jog(client, now)
        elif age > MAX_STATE_AGE_S:
            self._end_jog(client, now)
            self._tell(client, {'verb': 'rate', 'granted': False,
                                'reply': f'the page is {min(age, 999.0):.1f} s behind the antenna'})
        else:
            self._jogs[client] = now
            self._rate(client, rates, now)

    def _rate(self, client, rates, now):
        number = self._ask(str(client), 'rate', dict(zip(topics.AXES, map(math.radians, map(float, rates)))))
        self._waiting[number] = client, None, 'rate', now

    def _end_jog(self, client, now):
        if self._jogs.pop(client, None) is not None and self._jogged():
            self._rate(client, (0.0, 0.0), now)

    def look(self, now):
        """Pass replies on; stop who is silent; tell who waits in vain."""
        for client in [client for client, at in self._jogs.items() if now - at > JOG_TIMEOUT_S]:
            self._end_jog(client, now)
        for number, (client, own, verb, at) in list(self._waiting.items()):
            reply = self._replied(number)
            if reply is None and now - at > PAGE_REPLY_TIMEOUT_S:
                reply = Reply(False, f'the control unit did not reply within {PAGE_REPLY_TIMEOUT_S:g} s')
            if reply is not None:
                del self._waiting[number]
                self._pass_back(client, own, verb, reply, now)

    def _pass_back(self, client, own, verb, reply, now):
        if verb == 'stop' and not reply.granted:  # an axis that cannot be held still is no longer commanded at all
            self._waiting[self._ask(str(client), 'standby', {})] = client, own, 'standby', now
        if verb != 'rate' or not reply.granted:
            self._tell(client, {'id': own, 'verb': verb, 'granted': reply.granted, 'reply': reply.text})


def _sound(text):
    """Whether a text can be in a command."""
    return len(text) <= commands.MAX_TEXT_CHARACTERS and text.isprintable()
