"""What programs that point the antenna do to it, whatever they speak: one at a time is in control, set-points become
motion, a jog goes on as long as its program is there."""
import math

from pedestal_operator.rotator.pointing import Pointing

PATIENCE = 1.5
"""Time [s] within which the control unit replies; Hamlib's clients wait for 2 s."""

RELEASED = 10.0
"""Time [s] without a command of its holder after which control is given back."""

JOG_AGAIN = 0.2
"""Time [s] after which a jog is asked for again: less than half of the dead man's."""

DONE, REFUSED, OUT_OF_REACH, BUSY, SILENT = range(5)
"""What came of an ask: the control unit was willing, or not; no such place; another client is in control; no reply."""


class Ask:
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
            self.outcome = SILENT if self.numbers else _outcome(self._refusal)
        return self.outcome


def _outcome(refusal):
    if not refusal:
        return DONE
    if 'control is held' in refusal:
        return BUSY
    return OUT_OF_REACH if 'outside limits' in refusal or 'must be' in refusal else REFUSED


class Controller:
    """Asks for the clients of a server, by their names. remote: remote_node.Remote."""

    def __init__(self, remote):
        self._remote = remote
        self.pointing = Pointing(remote)
        self._holder, self._used = '', 0.0
        self._jog, self._told, self._jogs = None, 0.0, False

    def go(self, client, azimuth, elevation, now) -> Ask:
        """Point at a direction [deg]."""
        return self._ask(client, now, lambda: self.pointing.go(azimuth, elevation, now))

    def do(self, client, verb, now) -> Ask:
        """Ask for a verb without arguments."""
        return self._ask(client, now, lambda: self._remote.ask(verb), continues=False)

    def jog(self, client, rates, now) -> Ask:
        """Move at rates (azimuth, elevation) [deg/s] until something else is asked for or the client leaves."""
        ask = self._ask(client, now, lambda: self._remote.ask('rate', _rates(rates)), continues=False)
        if ask.outcome is None:
            self._jog, self._told, self._jogs = rates, now, False
        return ask

    def stop(self, client, now) -> Ask:
        """Stand: everybody may ask for it."""
        self.pointing.forget()
        self._jog, self._remote.who = None, client
        return Ask([self._remote.ask('stop')], now + PATIENCE)

    def look(self, now):
        """Keep a jog alive; end a motion that no set-point continues; give control back when nobody uses it."""
        self._remote.who = self._holder
        self.pointing.look(now)
        jogs = self._remote.texts.get('acu/mode') == 'rate'
        if self._jogs and not jogs:
            self._jog = None    # somebody has asked for another mode
        self._jogs = jogs
        if self._jog and now - self._told >= JOG_AGAIN:
            self._told = self._used = now
            self._remote.ask('rate', _rates(self._jog))
        if self._holder and now - self._used > RELEASED:
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
            return Ask([], now, BUSY)
        if not continues:
            self.pointing.forget()
        self._jog, self._remote.who = None, client
        numbers = [] if self._holder else [self._remote.ask('take')]
        self._holder, self._used = client, now
        number = ask()
        return Ask([], now, OUT_OF_REACH) if number is None else Ask([*numbers, number], now + PATIENCE)


def _rates(rates):
    return dict(zip(('azimuth', 'elevation'), map(math.radians, rates)))
