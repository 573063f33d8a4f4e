"""Lines of a device, in a thread of its own. A line ends with CR, LF or NUL, or with its datagram.

The splitter discards what it cannot read as a whole line: the rest of a line that began before the connection, a line
that stopped, a line that is too long. Half a level or half an angle would otherwise be a wrong number.
"""
import contextlib
import time
from collections.abc import Callable

from pedestal_common.quantities import Seconds
from pedestal_common.stream import Connection, Overlong, Splitter
from pedestal_hardware.lines import sources

MAX_LINE_BYTES = 256  # largest length of a line; NMEA 0183 allows 82 bytes
LINE_ENDS = b'\r\n\0'
LINE_TIMEOUT_S = 0.5  # longest pause within a line [s]
TCP_SILENCE_S = 10.0  # time without bytes until TCP is opened again [s]; a device without supply never closes it


class LineSplitter:
    """Whole lines in a stream of bytes. counts: {kind: number} of the lines and of what was discarded."""

    def __init__(self, counts: dict[str, int]) -> None:
        self.counts = counts
        self._splitter, self._since = Splitter(LINE_ENDS, MAX_LINE_BYTES), 0.0

    def begin(self, whole: bool) -> None:
        """Begin with a new connection. whole: True if its first bytes begin a line."""
        self.counts['cut_lines'] += bool(self._splitter.rest)
        self._splitter.restart(skips=not whole)

    def take(self, received: bytes, now: Seconds) -> list[bytes]:
        """Return the lines that bytes complete which were received now; b'' to look only for a line that stopped."""
        if self._splitter.rest and now - self._since > LINE_TIMEOUT_S:
            self.begin(whole=False)
        if not received:
            return []
        lines, self._since = self._splitter.take(received), now
        kept = [line for line in lines if line.strip() and not isinstance(line, Overlong)]
        self.counts['long_lines'] += sum(isinstance(line, Overlong) for line in lines)
        self.counts['lines'] += len(kept)
        return kept


class LineReader(Connection):
    """Reader of one device. url: see sources.place; take: called in the thread of the reader for each whole line."""
    counts: dict[str, int]  # lines, cut_lines, long_lines, connections

    def __init__(self, url: str, baud_rate: int, take: Callable[[bytes], None]) -> None:
        super().__init__(url, 'lines')
        self._baud_rate, self._take = baud_rate, take
        self.counts = {'lines': 0, 'cut_lines': 0, 'long_lines': 0, 'connections': 0}
        self._splitter = LineSplitter(self.counts)

    def close(self) -> None:
        """End the thread."""
        self.end(sources.CONNECT_TIMEOUT_S)

    def serve(self) -> None:
        """Read lines until the reader ends. Raises OSError when the device vanishes."""
        with contextlib.closing(sources.opened(self.url, self._baud_rate)) as source:
            self.counts['connections'] += 1
            self.silence = ''
            self._splitter.begin(source.WHOLE)
            heard = time.monotonic()
            while not self.ended.is_set():
                received, now = source.read(), time.monotonic()
                heard = now if received else heard
                if isinstance(source, sources.TcpSource) and now - heard > TCP_SILENCE_S:
                    raise OSError(f'no bytes for {TCP_SILENCE_S:g} s, opened again')
                for line in self._splitter.take(received, now):
                    self._take(line)
