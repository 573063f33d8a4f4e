"""Lines of a device, in a thread of its own.

A line ends with CR, LF or NUL, or with its datagram. The splitter discards what it cannot read as a whole line: the
rest of a line that began before the connection, a line that stopped for LINE_TIMEOUT_S, and a line that is too long.
Half a level or half an angle would otherwise be a wrong number.
"""
import re
import threading
import time
from collections.abc import Callable

from pedestal_common.quantities import Seconds
from pedestal_hardware.lines import sources

MAX_LINE_BYTES = 256  # largest length of a line; NMEA 0183 allows 82 bytes
LINE_TIMEOUT_S = 0.5  # longest pause within a line [s]
RETRY_PERIOD_S = 1.0  # time between two attempts to open a connection [s]

TCP_SILENCE_S = 10.0
"""Time without bytes after which a TCP connection is opened again [s]. A device that lost its supply never closes
it."""

ENDS_PATTERN = re.compile(rb'[\r\n\0]')


class LineSplitter:
    """Whole lines in a stream of bytes. counts: {kind: number} of the lines and of what was discarded."""

    def __init__(self, counts: dict[str, int]) -> None:
        self.counts = counts
        self._rest, self._since, self._skips = b'', 0.0, False

    def begin(self, whole: bool) -> None:
        """Begin with a new connection. whole: True if its first bytes begin a line."""
        if self._rest:
            self.counts['cut_lines'] += 1
        self._rest, self._skips = b'', not whole

    def datagram(self, received: bytes) -> list[bytes]:
        """Return the lines of a datagram, of which each is whole."""
        return self._checked(ENDS_PATTERN.split(received))

    def stream(self, received: bytes, now: Seconds) -> list[bytes]:
        """Return the lines that are complete with bytes that were received now; b'' to look only for a line that has
        stopped."""
        if self._rest and now - self._since > LINE_TIMEOUT_S:
            self.counts['cut_lines'] += 1
            self._rest, self._skips = b'', True
        if not received:
            return []
        *ended, rest = ENDS_PATTERN.split(self._rest + received)
        if ended and self._skips:
            ended, self._skips = ended[1:], False
        if self._skips:
            rest = b''
        elif len(rest) > MAX_LINE_BYTES:
            self.counts['long_lines'] += 1
            rest, self._skips = b'', True
        self._rest, self._since = rest, now
        return self._checked(ended)

    def _checked(self, lines: list[bytes]) -> list[bytes]:
        """Return the lines that are not empty and not too long."""
        kept = [line for line in lines if line.strip() and len(line) <= MAX_LINE_BYTES]
        self.counts['long_lines'] += sum(len(line) > MAX_LINE_BYTES for line in lines)
        self.counts['lines'] += len(kept)
        return kept


class LineReader:
    """Reader of one device. take: called in the thread of the reader for each whole line."""
    url: str                # see sources.place
    baud_rate: int
    silence: str            # reason why no bytes arrive, '' while the connection is open
    counts: dict[str, int]  # lines, cut_lines, long_lines, connections

    def __init__(self, url: str, baud_rate: int, take: Callable[[bytes], None]) -> None:
        self.url, self.baud_rate, self._take = url, baud_rate, take
        self.silence = f'{url}: not connected so far'
        self.counts = {'lines': 0, 'cut_lines': 0, 'long_lines': 0, 'connections': 0}
        self._splitter, self._ended = LineSplitter(self.counts), threading.Event()
        self._thread = threading.Thread(target=self._run, name='lines', daemon=True)

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def close(self) -> None:
        """End the thread."""
        self._ended.set()
        if self._thread.is_alive():
            self._thread.join(sources.CONNECT_TIMEOUT_S + RETRY_PERIOD_S)

    def _run(self) -> None:
        while not self._ended.is_set():
            source = None
            try:
                source = sources.opened(self.url, self.baud_rate)
                self.counts['connections'] += 1
                self.silence = ''
                self._splitter.begin(source.WHOLE)
                self._serve(source)
            except (OSError, ValueError) as error:     # SerialException is an OSError
                self.silence = f'{self.url}: {error}'
                self._ended.wait(RETRY_PERIOD_S)
            finally:
                if source is not None:
                    source.close()

    def _serve(self, source: sources.Source) -> None:
        """Read lines until the reader ends. Raises OSError when the device vanishes."""
        heard = time.monotonic()
        while not self._ended.is_set():
            received, now = source.read(), time.monotonic()
            heard = now if received else heard
            if isinstance(source, sources.TcpSource) and now - heard > TCP_SILENCE_S:
                raise OSError(f'no bytes for {TCP_SILENCE_S:g} s, opened again')
            for line in (self._splitter.datagram(received) if source.WHOLE
                         else self._splitter.stream(received, now)):
                self._take(line)
