"""Connection to a rotator, by TCP or a serial line, in a thread of its own.

Because a rotator needs up to 0.6 s for an answer, no step of the node may wait for one.
"""
import threading
import time
import typing
from collections.abc import Callable
from typing import Literal

import serial

from pedestal_common.quantities import Degrees, Seconds
from pedestal_common.stream import Connection
from pedestal_hardware.rotator.protocols import Accepted, Answer, Position, Pulses, Refusal, RotatorProtocol

READ_TIMEOUT_S = 0.02  # longest wait for the next byte [s]
MAX_READ_BYTES = 4096  # number of bytes that are read at once


class Measurement(typing.NamedTuple):
    """Angles of the device."""
    azimuth: Degrees
    elevation: Degrees
    at: Seconds                     # time of the monotonic clock at which they arrived
    pulses: Pulses | None = None    # per degree of its set-points, None if the device reports none


class SetPoint(typing.NamedTuple):
    """Angles to which the device moves."""
    azimuth: Degrees
    elevation: Degrees
    pulses: Pulses | None   # per degree, as the device reported them


class Stream(typing.Protocol):
    """Connection to a device, as pyserial has it. `read` returns b'' if nothing arrives within READ_TIMEOUT_S."""
    in_waiting: int

    def read(self, size: int = 1) -> bytes:
        """Return the received bytes, `size` at most."""

    def write(self, data: bytes, /) -> int | None:
        """Send bytes."""


class Line(Connection):
    """Connection to one rotator. url: as pyserial takes it; protocol: makes that of a connection; poll_period: between
    two requests for the position; timeout: longest wait for an answer; baud_rate: 0 for that of the protocol."""
    newest: Measurement | None  # None before the first
    refusal: str                # of the device for the last set-point or stop, '' after an accepted one
    counts: dict[str, int]      # positions, set-points, refusals and missing answers

    def __init__(self, url: str, protocol: Callable[[], RotatorProtocol], poll_period: Seconds, timeout: Seconds,
                 baud_rate: int = 0) -> None:
        super().__init__(url, 'rotator')
        self._make, self.poll_period, self.timeout = protocol, poll_period, timeout
        self.newest, self.refusal = None, ''
        self.counts = {'positions': 0, 'set_points': 0, 'refusals': 0, 'missing_answers': 0}
        self._request: SetPoint | Literal['stop'] | None = None
        self._lock, self._wake = threading.Lock(), threading.Event()
        self.begin()
        self.baud_rate = baud_rate or self._protocol.BAUD_RATE

    def begin(self) -> None:
        """Begin with a device of which nothing is known."""
        self._protocol = self._make()
        self._asked = False         # True from a request until the next position
        # True from a request that the protocol does not answer until the next position: a refusal belongs to it.
        self._unanswered = False
        self._prompts = False       # True for a device that sends prompts: they are no refusals

    @property
    def fault(self) -> str:
        """Reason why the device does not follow, '' if it does."""
        return self.silence or self.refusal

    def send(self, request: SetPoint | Literal['stop']) -> None:
        """Send a set-point or a stop at the next opportunity, in place of an earlier one that was not sent."""
        with self._lock:
            self._request = request
        self._wake.set()

    def close(self) -> None:
        """Stop the device and end the thread."""
        self.send('stop')
        self.ended.set()        # after the stop, which the thread sends last
        self._wake.set()
        self.end(2.0 * self.timeout)

    def serve(self) -> None:
        """Exchange requests and answers until the thread ends; raises OSError when the device vanishes."""
        with serial.serial_for_url(self.url, baudrate=self.baud_rate, timeout=READ_TIMEOUT_S,
                                   write_timeout=self.timeout) as device:
            self.begin()
            if self._request == 'stop':
                self._send_request(device)
            self.ask(device)    # before the first set-point, because the answer may state how the device counts
            while not self.ended.is_set():
                begun = time.monotonic()
                self._wake.clear()
                self.exchange(device)
                self._wake.wait(max(self.poll_period - (time.monotonic() - begun), 0.0))
            self._send_request(device)

    def exchange(self, device: Stream) -> None:
        """Send the waiting request, and ask for the position."""
        self._send_request(device)
        self.ask(device)

    def ask(self, device: Stream) -> None:
        """Ask for the position, and wait for it."""
        self._write(device, self._protocol.ask)
        self._await(device, Position)

    def _write(self, device: Stream, request: bytes) -> None:
        device.write(request)
        self._protocol.sent(request)
        self._asked = True

    def _send_request(self, device: Stream) -> None:
        request = self._request
        if request is None:
            return
        protocol = self._protocol
        self._write(device, protocol.stop if request == 'stop' else protocol.set_point(*request))
        if not protocol.ANSWERS_SETS:
            self.refusal, self._unanswered = '', True
        self.counts['set_points'] += request != 'stop'
        if protocol.ANSWERS_SETS:
            self._await(device, Accepted)
        with self._lock:
            # An error before this line leaves the request to the next connection, a refused stop to the next poll.
            if self._request is request and not (self.refusal and request == 'stop'):
                self._request = None

    def _await(self, device: Stream, awaited: type[Answer]) -> None:
        """Read until an answer of the awaited type arrives, or a refusal of a set-point. Raise OSError after a
        time-out: the connection is then opened again, because a late answer would be taken for that to the next
        request."""
        end = time.monotonic() + self.timeout
        ended = False
        while time.monotonic() < end:
            received = device.read(max(1, min(device.in_waiting, MAX_READ_BYTES)))
            if ended and not received:
                return      # behind a position nothing more, such as a prompt
            for answer in self._protocol.answers(received):
                self._take(answer, awaited)
                ended |= isinstance(answer, awaited) or isinstance(answer, Refusal) and awaited is Accepted
            if ended and awaited is Accepted:
                return
        if not ended:
            self.counts['missing_answers'] += 1
            raise OSError(f'no {"position" if awaited is Position else "answer"} for {self.timeout:g} s')

    def _take(self, answer: Answer, awaited: type[Answer]) -> None:
        if isinstance(answer, Position):
            self.newest = Measurement(answer.azimuth, answer.elevation, time.monotonic(), answer.pulses)
            self.counts['positions'] += 1
            self.silence, self._asked, self._unanswered = '', False, False
        elif isinstance(answer, Accepted):
            self.refusal = ''
        elif answer.prompt and (self._prompts or not self._asked):
            self._prompts = True
        else:
            self.counts['refusals'] += 1
            self._refused(answer.reason, awaited)

    def _refused(self, reason: str, awaited: type[Answer]) -> None:
        """Keep the reason of a refusal: of a request until the next request is sent or accepted, of other bytes until
        the next position."""
        if awaited is Accepted or self._unanswered:
            self.refusal = f'{self.url}: request refused: {reason}'
        else:
            self.silence = f'{self.url}: {reason}'
