"""Controller: it turns the requests of rotator programs into commands to the control unit, for all protocols.

One program at a time is in control. A jog lasts until its program leaves or sends another command. Some programs open
a connection for each set-point; such a program stays in control until its motion ends.
"""
import math
from collections.abc import Callable, Iterable, Sequence

from pedestal_common.quantities import Degrees, RadiansPerSecond, Seconds
from pedestal_common.wire.commands import ASK_REFUSAL, HELD_REFUSAL, LIMITS_REFUSAL, RANGE_REFUSAL, program_of
from pedestal_operator.remote_node import JOG_REPEAT_PERIOD_S, Remote
from pedestal_operator.rotator.pointing import (
    OUTCOME_BUSY,
    OUTCOME_DONE,
    OUTCOME_NO_REPLY,
    OUTCOME_OUT_OF_REACH,
    OUTCOME_REFUSED,
    Pointing,
    Refused,
)

CLIENT_REPLY_TIMEOUT_S = 1.5  # longest wait for a reply of the control unit [s]; clients of Hamlib wait for 2 s
CONTROL_TIMEOUT_S = 10.0  # time without a command of a client after which its control is released [s]


class PendingRequest:
    """Pending request of a client."""
    numbers: list[str]      # of its commands without a reply
    deadline: Seconds       # time after which no reply is awaited
    outcome: int | None     # one of the outcomes in `outcomes`, None before it is known
    reason: str             # of a refusal, one line

    def __init__(self, numbers: Iterable[str], deadline: Seconds, outcome: int | None = None, reason: str = '',
                 lose: Callable[[], None] = lambda: None) -> None:
        """Keep the numbers. lose: called after a refusal because the client is not in control."""
        self.numbers, self.deadline, self.outcome, self.reason = list(numbers), deadline, outcome, reason
        self._lose = lose

    def look(self, remote: Remote, now: Seconds) -> int | None:
        """Take the replies at the time now. Return the outcome, None before it is known."""
        for number in list(self.numbers):
            reply = remote.replied(number)
            if reply is not None:
                self.numbers.remove(number)
                self.reason = self.reason or ('' if reply.granted else reply.text)
                if not reply.granted and (ASK_REFUSAL in reply.text or HELD_REFUSAL in reply.text):
                    self._lose()
        if self.outcome is None and not self.numbers:
            self.outcome = _outcome(self.reason)
        elif self.outcome is None and now >= self.deadline:
            self.outcome = OUTCOME_NO_REPLY
            self.reason = self.reason or f'the control unit did not reply within {CLIENT_REPLY_TIMEOUT_S:g} s'
        return self.outcome


def _outcome(refusal: str) -> int:
    if not refusal:
        return OUTCOME_DONE
    if ASK_REFUSAL in refusal:
        return OUTCOME_REFUSED
    if HELD_REFUSAL in refusal:
        return OUTCOME_BUSY
    return OUTCOME_OUT_OF_REACH if LIMITS_REFUSAL in refusal or RANGE_REFUSAL in refusal else OUTCOME_REFUSED


class Controller:
    """Control of the antenna by the clients of a server, of which each method gets the name."""
    holder: str                     # client in control, '' without one; one that has left controls its motion
    _jog: Sequence[float] | None    # rates (azimuth, elevation) [deg/s]

    def __init__(self, remote: Remote, role: str = 'program') -> None:
        """Control by clients with this role (command_table.CONTROL_ROLES of the control unit)."""
        self._remote, self._role = remote, role
        self.pointing = Pointing(remote)
        self.holder, self._has_left, self._last_command_time = '', False, 0.0
        self._jog, self._last_jog_time, self._was_jogging = None, 0.0, False

    def go(self, client: str, azimuth: Degrees, elevation: Degrees, now: Seconds) -> PendingRequest:
        """Point the antenna to a direction."""
        try:
            target = self.pointing.target(azimuth, elevation, now)
        except Refused as refused:
            return PendingRequest([], now, refused.outcome, refused.reason)
        return self._request(client, now, lambda: self.pointing.go(target, now))

    def do(self, client: str, verb: str, now: Seconds) -> PendingRequest:
        """Send a command without arguments."""
        return self._request(client, now, lambda: self._remote.request(verb), continues=False)

    def jog(self, client: str, rates: Sequence[float], now: Seconds) -> PendingRequest:
        """Move at rates (azimuth, elevation) [deg/s] until the next command, or until the client leaves."""
        pending = self._request(client, now, lambda: self._remote.request('rate', _rates(rates)), continues=False)
        if pending.outcome is None:
            self._jog, self._last_jog_time, self._was_jogging = rates, now, False
        return pending

    def stop(self, client: str, now: Seconds) -> PendingRequest:
        """Stop the axes; every client may stop them."""
        self.pointing.reset()
        self._jog, self._remote.who = None, client
        return PendingRequest([self._remote.request('stop')], now + CLIENT_REPLY_TIMEOUT_S)

    def look(self, now: Seconds) -> None:
        """Repeat a jog, end a motion without further set-points, and release control that is no longer used."""
        self._remote.who = self.holder
        self.pointing.look(now)
        is_jogging = self._remote.texts.get('acu/mode') == 'rate'
        if self._was_jogging and not is_jogging:
            self._jog = None  # another mode was commanded
        self._was_jogging = is_jogging
        if (self._has_left and not self.pointing.continues(now)
                or now - self._last_command_time > CONTROL_TIMEOUT_S):
            self.release(now)
        if self._jog and now - self._last_jog_time >= JOG_REPEAT_PERIOD_S:
            self._last_jog_time = self._last_command_time = now
            self._remote.request('rate', _rates(self._jog))

    def leave(self, client: str) -> None:
        """Note that a client has left. Its control is released as soon as its motion has ended."""
        if client == self.holder:
            self._has_left = True

    def release(self, now: Seconds) -> None:
        """Stop the jog or the motion of the client in control, and release its control."""
        if not self.holder:
            return
        self._remote.who = self.holder
        if self._jog:
            self._remote.request('stop')
        self.pointing.settle(now)
        self._jog = None
        self._release()

    def _release(self) -> None:
        """Leave the motion as it is."""
        self._remote.who = self.holder
        self.holder, self._has_left = '', False
        self._remote.request('release')

    def _request(self, client: str, now: Seconds, send: Callable[[], str], continues: bool = True) -> PendingRequest:
        """Return the pending request of send(); take control first if necessary. continues: False for a command that
        ends the motion of the set-points."""
        if self._has_left and program_of(client) == program_of(self.holder):
            self._release()  # the same program on a new connection: its motion continues
        if self.holder not in ('', client):
            return PendingRequest([], now, OUTCOME_BUSY, f'{HELD_REFUSAL} {self.holder}')
        if not continues:
            self.pointing.reset()
        self._jog, self._remote.who = None, client
        numbers = [] if self.holder else [self._remote.request('take', {'role': self._role})]
        self.holder, self._last_command_time = client, now
        return PendingRequest([*numbers, send()], now + CLIENT_REPLY_TIMEOUT_S, lose=lambda: self._lose(client))

    def _lose(self, client: str) -> None:
        """Forget a client that is not in control; its next command requests control again."""
        if client == self.holder:
            self.pointing.reset()
            self.holder, self._has_left, self._jog = '', False, None


def _rates(rates: Sequence[float]) -> dict[str, RadiansPerSecond]:
    return dict(zip(('azimuth', 'elevation'), map(math.radians, rates)))
