"""Connection to a rotator, by TCP or a serial line, in a thread of its own.

Because a rotator needs up to 0.6 s for an answer, no step of the node may wait for one.
"""
import threading
import time
import typing

import serial

from pedestal_common.quantities import Degrees, Seconds
from pedestal_common.stream import Connection
from pedestal_hardware.rotator.protocols import Accepted, Answer, Position, Refusal, RotatorProtocol

READ_TIMEOUT_S = 0.02  # longest wait for the next byte [s]
MAX_READ_BYTES = 4096  # number of bytes that are read at once


class Measurement(typing.NamedTuple):
    """Angles of the device."""
    azimuth: Degrees
    elevation: Degrees
    at: Seconds     # time of the monotonic clock at which they arrived


class Line(Connection):
    """Connection to one rotator. url: as pyserial takes it; poll_period: between two requests for the position;
    timeout: longest wait for an answer; baud_rate: 0 for that of the protocol."""
    newest: Measurement | None  # None before the first
    refusal: str                # of the device for the last set-point or stop, '' after an accepted one
    counts: dict[str, int]      # positions, set-points, refusals and missing answers

    def __init__(self, url: str, protocol: type[RotatorProtocol], poll_period: Seconds, timeout: Seconds,
                 baud_rate: int = 0) -> None:
        super().__init__(url, 'rotator')
        self.protocol, self.poll_period, self.timeout = protocol, poll_period, timeout
        self.baud_rate = baud_rate or protocol.BAUD_RATE
        self.newest, self.refusal = None, ''
        self.counts = {'positions': 0, 'set_points': 0, 'refusals': 0, 'missing_answers': 0}
        self._request, self._lock = b'', threading.Lock()
        # True from a request that the protocol does not answer until the next position: a refusal belongs to it.
        self._unanswered = False
        self._wake, self._reader = threading.Event(), protocol()

    @property
    def fault(self) -> str:
        """Reason why the device does not follow, '' if it does."""
        return self.silence or self.refusal

    def send_set_point(self, azimuth: Degrees, elevation: Degrees) -> None:
        """Send a set-point at the next opportunity, in place of an earlier one that was not sent."""
        with self._lock:
            self._request = self._reader.set_point(azimuth, elevation)
        self._wake.set()

    def send_stop(self) -> None:
        """Send a stop at the next opportunity, in place of a set-point that was not sent."""
        with self._lock:
            self._request = self.protocol.STOP
        self._wake.set()

    def close(self) -> None:
        """Stop the device and end the thread."""
        self.send_stop()
        self.ended.set()        # after the stop, which the thread sends last
        self._wake.set()
        self.end(2.0 * self.timeout)

    def serve(self) -> None:
        """Exchange requests and answers until the thread ends; raises OSError when the device vanishes."""
        with serial.serial_for_url(self.url, baudrate=self.baud_rate, timeout=READ_TIMEOUT_S,
                                   write_timeout=self.timeout) as device:
            self._exchange(device)

    def _exchange(self, device: serial.Serial) -> None:
        self._reader = self.protocol()
        while True:
            begun, ending = time.monotonic(), self.ended.is_set()
            self._wake.clear()
            self._send_request(device)
            if ending:
                return
            device.write(self.protocol.ASK)
            self._await(device, Position)
            self._wake.wait(max(self.poll_period - (time.monotonic() - begun), 0.0))

    def _send_request(self, device: serial.Serial) -> None:
        request = self._request
        if not request:
            return
        device.write(request)
        if not self.protocol.ANSWERS_SETS:
            self.refusal, self._unanswered = '', True
        self.counts['set_points'] += request != self.protocol.STOP
        if self.protocol.ANSWERS_SETS:
            self._await(device, Accepted)
        with self._lock:
            # An error before this line leaves the request to the next connection, a refused stop to the next poll.
            if self._request is request and not (self.refusal and request == self.protocol.STOP):
                self._request = b''

    def _refused(self, reason: str, awaited: type[Answer]) -> None:
        """Keep the reason of a refusal: of a request until the next request is sent or accepted, of other bytes until
        the next position."""
        if awaited is Accepted or self._unanswered:
            self.refusal = f'{self.url}: request refused: {reason}'
        else:
            self.silence = f'{self.url}: {reason}'

    def _await(self, device: serial.Serial, awaited: type[Answer]) -> None:
        """Read until an answer of the awaited type arrives, or a refusal of a set-point. Raise OSError after a
        time-out: the connection is then opened again, because a late answer would be taken for that to the next
        request."""
        end = time.monotonic() + self.timeout
        while time.monotonic() < end:
            received = device.read(max(1, min(device.in_waiting, MAX_READ_BYTES)))
            ended = False
            for answer in self._reader.answers(received):
                if isinstance(answer, Position):
                    self.newest = Measurement(*answer, time.monotonic())
                    self.counts['positions'] += 1
                    self.silence, self._unanswered = '', False
                elif isinstance(answer, Refusal):
                    self.counts['refusals'] += 1
                    self._refused(answer.reason, awaited)
                else:
                    self.refusal = ''
                ended |= isinstance(answer, awaited) or isinstance(answer, Refusal) and awaited is Accepted
            if ended:
                return
        self.counts['missing_answers'] += 1
        raise OSError(f'no {"position" if awaited is Position else "answer"} for {self.timeout:g} s')
