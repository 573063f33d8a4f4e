"""What programs that point the antenna do to it, whatever they speak: one at a time is in control, set-points become
motion, a jog goes on as long as its program is there."""
import math

from pedestal_operator.rotator.pointing import Pointing

CLIENT_REPLY_TIMEOUT_S = 1.5
"""Time [s] within which the control unit replies; Hamlib's clients wait for 2 s."""

CONTROL_TIMEOUT_S = 10.0
"""Time [s] without a command of its holder after which control is given back."""

JOG_REPEAT_PERIOD_S = 0.2
"""Time [s] after which a jog is asked for again: less than half of the dead man's."""

OUTCOME_DONE, OUTCOME_REFUSED, OUTCOME_OUT_OF_REACH, OUTCOME_BUSY, OUTCOME_NO_REPLY = range(5)
"""What came of an ask: the control unit was willing, or not; no such place; another client is in control; no reply."""


class PendingRequest:
    """An ask of a client on its way. outcome: of the list above, None as long as it is not known."""

    def __init__(self, numbers, deadline, outcome=None):
        self.numbers, self.deadline, self.outcome = list(numbers), deadline, outcome
        self._refusal = ''

    def look(self, remote, now):
        """Hear the replies; the outcome."""
        for number in list(self.numbers):
            reply = remote.replied(number)
            if reply is not None:
                self.numbers.remove(number)
                self._refusal = self._refusal or ('' if reply.granted else reply.text)
        if self.outcome is None and (not self.numbers or now >= self.deadline):
            self.outcome = OUTCOME_NO_REPLY if self.numbers else _outcome(self._refusal)
        return self.outcome


def _outcome(refusal):
    if not refusal:
        return OUTCOME_DONE
    if 'control is held' in refusal:
        return OUTCOME_BUSY
    return OUTCOME_OUT_OF_REACH if 'outside limits' in refusal or 'must be' in refusal else OUTCOME_REFUSED


class Controller:
    """Asks for the clients of a server, by their names. remote: remote_node.Remote."""

    def __init__(self, remote):
        self._remote = remote
        self.pointing = Pointing(remote)
        self._holder, self._used = '', 0.0
        self._jog, self._told, self._jogs = None, 0.0, False

    def go(self, client, azimuth, elevation, now) -> PendingRequest:
        """Point at a direction [deg]."""
        return self._ask(client, now, lambda: self.pointing.go(azimuth, elevation, now))

    def do(self, client, verb, now) -> PendingRequest:
        """Ask for a verb without arguments."""
        return self._ask(client, now, lambda: self._remote.ask(verb), continues=False)

    def jog(self, client, rates, now) -> PendingRequest:
        """Move at rates (azimuth, elevation) [deg/s] until something else is asked for or the client leaves."""
        ask = self._ask(client, now, lambda: self._remote.ask('rate', _rates(rates)), continues=False)
        if ask.outcome is None:
            self._jog, self._told, self._jogs = rates, now, False
        return ask

    def stop(self, client, now) -> PendingRequest:
        """Stand: everybody may ask for it."""
        self.pointing.forget()
        self._jog, self._remote.who = None, client
        return PendingRequest([self._remote.ask('stop')], now + CLIENT_REPLY_TIMEOUT_S)

    def look(self, now):
        """Keep a jog alive; end a motion that no set-point continues; give control back when nobody uses it."""
        self._remote.who = self._holder
        self.pointing.look(now)
        jogs = self._remote.texts.get('acu/mode') == 'rate'
        if self._jogs and not jogs:
            self._jog = None    # somebody has asked for another mode
        self._jogs = jogs
        if self._jog and now - self._told >= JOG_REPEAT_PERIOD_S:
            self._told = self._used = now
            self._remote.ask('rate', _rates(self._jog))
        if self._holder and now - self._used > CONTROL_TIMEOUT_S:
            self.leave(self._holder, now)

    def leave(self, client, now):
        """A client has gone: what it jogged stands, what it held is free."""
        if client != self._holder:
            return
        self._remote.who = client
        if self._jog:
            self._remote.ask('stop')
        self.pointing.settle(now)
        self._jog, self._holder = None, ''
        self._remote.ask('release')

    def _ask(self, client, now, ask, continues=True):
        if self._holder not in ('', client):
            return PendingRequest([], now, OUTCOME_BUSY)
        if not continues:
            self.pointing.forget()
        self._jog, self._remote.who = None, client
        numbers = [] if self._holder else [self._remote.ask('take')]
        self._holder, self._used = client, now
        number = ask()
        return PendingRequest([], now, OUTCOME_OUT_OF_REACH) if number is None else PendingRequest([*numbers, number],
                                                                                                   now + CLIENT_REPLY_TIMEOUT_S)


def _rates(rates):
    return dict(zip(('azimuth', 'elevation'), map(math.radians, rates)))
