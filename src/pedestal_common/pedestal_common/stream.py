"""Data of a device: the connection in a thread of its own, the frames of its bytes, and what is dropped of them."""
import collections
import errno
import os
import re
import socket
import threading
from collections.abc import Iterable

from pedestal_common.quantities import Nanoseconds, Seconds

RETRY_PERIOD_S = 1.0  # time between two attempts to open a connection [s]
REPORT_NS = 2_000_000_000  # time for which the diagnostics report what was dropped [ns]


class Connection:
    """Base of the connections. A subclass overrides `serve`, which opens the device and serves it."""
    url: str
    silence: str            # reason why nothing arrives, '' while the device answers
    ended: threading.Event  # set at the end of the connection; `serve` then returns

    def __init__(self, url: str, name: str) -> None:
        self.url, self.silence, self.ended = url, f'{url}: not connected so far', threading.Event()
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def end(self, longest: Seconds) -> None:
        """End the thread. longest: time in which `serve` returns."""
        self.ended.set()
        if self._thread.is_alive():
            self._thread.join(longest + RETRY_PERIOD_S)

    def serve(self) -> None:
        """Open the device and serve it until the end. Raise OSError or ValueError to have it opened again."""
        raise NotImplementedError

    def _run(self) -> None:
        while not self.ended.is_set():
            try:
                self.serve()
            except (OSError, ValueError) as error:     # SerialException is an OSError
                # The text of a SerialException with a number repeats number and path.
                number = error.errno if isinstance(error, OSError) else None
                self.silence = f'{self.url}: {os.strerror(number) if number and number > 0 else error}'
                self.ended.wait(RETRY_PERIOD_S)


class Overlong(bytes):
    """Begin of a frame that is too long."""


class Splitter:
    """Splitter into frames that end with one of the bytes `ends`, and have at most `longest` bytes before it."""
    rest: bytes     # begun frame
    skips: bool     # True until the end of a frame whose bytes are discarded

    def __init__(self, ends: bytes, longest: int) -> None:
        self._split, self._longest = re.compile(b'[' + re.escape(ends) + b']').split, longest
        self.restart()

    def restart(self, skips: bool = False) -> None:
        """Discard the begun frame. skips: True if the next bytes may begin within a frame, which is discarded."""
        self.rest, self.skips = b'', skips

    def take(self, data: bytes) -> list[bytes]:
        """Return the frames that these bytes end, and an Overlong for each frame that becomes too long."""
        *frames, self.rest = self._split(self.rest + data)
        if frames and self.skips:
            del frames[0]
            self.skips = False
        if self.skips:
            self.rest = b''
        found = [Overlong(frame) if len(frame) > self._longest else frame for frame in frames]
        if len(self.rest) > self._longest:
            found.append(Overlong(self.rest))
            self.restart(skips=True)
        return found


class Drops:
    """Dropped data of one source. kinds: those that are counted from 0 on; another kind is counted from its first."""
    counts: collections.Counter[str]    # {kind: number}
    kind: str                           # of the last
    reason: str                         # of the last

    def __init__(self, kinds: Iterable[str] = ()) -> None:
        self.counts = collections.Counter(dict.fromkeys(kinds, 0))
        self.kind = self.reason = ''
        self._at: Nanoseconds | None = None

    def drop(self, kind: str, reason: str, now: Nanoseconds) -> None:
        """Count what is dropped now, and note the reason."""
        self.counts[kind] += 1
        self.kind, self.reason, self._at = kind, reason, now

    def reported(self, now: Nanoseconds) -> bool:
        """Return True if something was dropped within REPORT_NS before now."""
        return self._at is not None and now - self._at < REPORT_NS


def listen(address: str, port: int, clients: int | None = None) -> socket.socket:
    """Return a socket that listens on a TCP port. Raises OSError; for a port in use its text names the port.

    port: 0 for a free port; clients: number of clients that may wait for their connection, None for any.
    """
    try:
        return socket.create_server((address, port), family=socket.AF_INET6 if ':' in address else socket.AF_INET,
                                    backlog=clients)
    except OSError as error:
        if error.errno != errno.EADDRINUSE:
            raise
        raise OSError(f'port {port} of {address} is in use') from None


def bound(host: str, port: int) -> socket.socket:
    """Return a socket that receives the datagrams at a UDP port. Raises OSError."""
    made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        made.bind((host, port))
    except OSError:
        made.close()
        raise
    return made
