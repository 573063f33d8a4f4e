"""Server of text lines over TCP and a serial device, for the rotator protocols; it never waits for a client."""
import contextlib
import io
import os
import selectors
import socket
import time
import tty
from collections import deque
from collections.abc import Callable
from typing import Generic, TypeAlias, TypeVar

from pedestal_common.stream import Overlong, Splitter, listen
from pedestal_common.wire.commands import program_of

MAX_UNREAD_BYTES = 65_536  # largest size of unread answers of a client [bytes]; further answers are dropped
MAX_WAITING_LINES = 100  # largest number of waiting lines of a client; further input is left unread
LINE_END_TIMEOUT_S = 0.05  # time without a byte after which a complete command counts as a line [s]

LINE_ENDS = b'\r\n'
READ_CHUNK_BYTES = 65_536  # largest size of one read [bytes]

Stream: TypeAlias = socket.socket | io.FileIO   # connection to a program, or a serial device


class Client:
    """A connected program."""
    stream: Stream
    name: str                   # in recordings
    lines: deque[str | None]    # unanswered lines; None: a line that was too long
    dropped: int                # number of answers dropped because they were not read
    gone: str | None            # reason of its end, None while it is connected
    refusals: dict[str, str]    # {command: reason of its last logged refusal} of the program

    def __init__(self, stream: Stream, name: str, longest: int) -> None:
        self.stream, self.name = stream, name
        self.lines, self.dropped, self.gone = deque(), 0, None
        self._splitter, self._has_line_ends = Splitter(LINE_ENDS, longest), False
        self._out, self._receive_time = bytearray(), 0.0
        self.refusals = {}

    def receive(self) -> None:
        """Read the available bytes."""
        try:
            data = os.read(self.stream.fileno(), READ_CHUNK_BYTES)
        except BlockingIOError:
            return
        except OSError as error:
            self.gone = error.strerror
            return
        if data:
            self.take(data)
        else:
            self.gone = ''

    def take(self, data: bytes) -> None:
        """Take received bytes."""
        self.lines += [None if isinstance(line, Overlong) else line.decode('ascii', 'replace')
                       for line in self._splitter.take(data)]
        self._has_line_ends = self._has_line_ends or any(end in data for end in LINE_ENDS)
        self._receive_time = time.monotonic()

    def end_line(self, is_complete: Callable[[str], bool]) -> None:
        """Take the bytes of a program that never sends line ends, as gpredict for Windows, as a line after
        LINE_END_TIMEOUT_S, if is_complete(line)."""
        line = self._splitter.rest.decode('ascii', 'replace')
        if (not self.lines and time.monotonic() - self._receive_time > LINE_END_TIMEOUT_S
                and not self._has_line_ends and not self._splitter.skips and is_complete(line)):
            self._splitter.restart()
            self.lines.append(line)

    def queue_answer(self, data: bytes) -> None:
        """Queue an answer behind the waiting answers."""
        if len(self._out) + len(data) > MAX_UNREAD_BYTES:
            self.dropped += 1
        else:
            self._out += data

    def send(self) -> None:
        """Send as many bytes as the client takes."""
        if self._out:
            try:
                del self._out[:os.write(self.stream.fileno(), self._out)]
            except BlockingIOError:
                pass
            except OSError as error:
                self.gone = error.strerror


AnyClient = TypeVar('AnyClient', bound=Client)


class LineServer(Generic[AnyClient]):
    """Clients of one TCP port, and of a serial device ('': none). Raises OSError. kind: start of the names of the
    clients; most: largest number of clients; longest: longest line [bytes]."""
    clients: list[AnyClient]
    refused_count: int

    def __init__(self, kind: str, address: str, port: int, most: int, longest: int, device: str,
                 make_client: Callable[[Stream, str, int], AnyClient]) -> None:
        self._most, self._longest, self._make = most, longest, make_client
        self._selector, self.clients, self.refused_count = selectors.DefaultSelector(), [], 0
        self._refusals: dict[str, dict[str, str]] = {}     # of each program, also of one that connects for each line
        self._server, self._device_name = listen(address, port, most), f'{kind} {device}'
        self._server.setblocking(False)
        self._selector.register(self._server, selectors.EVENT_READ)
        self._prefix = f'{kind} {self.port} from '
        if device:
            stream = open(device, 'r+b', buffering=0, opener=lambda path, flags: os.open(
                path, flags | os.O_NOCTTY | os.O_NONBLOCK))
            tty.setraw(stream.fileno())
            self._add(stream, self._device_name)

    @property
    def port(self) -> int:
        """Number of the TCP port."""
        return self._server.getsockname()[1]

    def is_own(self, name: str) -> bool:
        """Return True if a name is that of a client of this server, or of an earlier process with the same port."""
        return name.startswith(self._prefix) or name == self._device_name

    def look(self) -> None:
        """Accept new clients, and read from all clients."""
        for key, _ in self._selector.select(0):
            if key.fileobj is self._server:
                self._accept()
            elif len(key.data.lines) <= MAX_WAITING_LINES:
                key.data.receive()

    def send(self) -> list[AnyClient]:
        """Send the waiting answers. Return the clients that have left, after their removal."""
        left = []
        for client in list(self.clients):
            client.send()
            if client.gone is not None and not client.lines:
                self._drop(client)
                left.append(client)
        return left

    def close(self) -> None:
        """Close every connection and the port."""
        for client in list(self.clients):
            self._drop(client)
        self._server.close()

    def _accept(self) -> None:
        with contextlib.suppress(OSError):
            connection, (host, port, *_) = self._server.accept()
            if len(self.clients) >= self._most:
                self.refused_count += 1
                connection.close()
                return
            connection.setblocking(False)
            self._add(connection, f'{self._prefix}{host}:{port}')

    def _add(self, stream: Stream, name: str) -> None:
        client = self._make(stream, name, self._longest)
        client.refusals = self._refusals.setdefault(program_of(name), {})
        self.clients.append(client)
        self._selector.register(stream, selectors.EVENT_READ, client)

    def _drop(self, client: AnyClient) -> None:
        self.clients.remove(client)
        self._selector.unregister(client.stream)
        client.stream.close()
