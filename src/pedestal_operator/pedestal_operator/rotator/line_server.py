"""Server of line protocols over TCP and a serial device; it never waits for a client."""
import collections
import contextlib
import os
import selectors
import tty

from pedestal_operator import tcp_port

MAX_UNREAD_BYTES = 65_536
"""Largest size of unread answers of a client [bytes]; further answers are dropped."""

MAX_WAITING_LINES = 100
"""Largest number of waiting lines of a client; further input is left unread."""

READ_CHUNK_BYTES = 65_536
"""Largest size of one read [bytes]."""


class Lines:
    """Splitter of bytes into lines of at most `longest` bytes; a longer line is dropped."""

    def __init__(self, longest):
        self._longest, self._remainder, self._skips_line = longest, b'', False

    def take(self, data):
        """Return the lines that bytes complete, None for a line that is too long."""
        *lines, self._remainder = (self._remainder + data).replace(b'\r', b'\n').split(b'\n')
        found = []
        for line in lines:
            too_long, self._skips_line = self._skips_line or len(line) > self._longest, False
            found.append(None if too_long else line.decode('ascii', 'replace'))
        if len(self._remainder) > self._longest:
            self._remainder, self._skips_line = b'', True
        return found


class Client:
    """A connected program.

    name      its name in recordings
    lines     unanswered lines
    dropped   number of answers dropped because they were not read
    gone      reason of its end, None while it is connected
    """

    def __init__(self, stream, name, longest):
        self.stream, self.name = stream, name
        self.lines, self.dropped, self.gone = collections.deque(), 0, None
        self._splitter, self._out = Lines(longest), bytearray()

    def receive(self):
        """Read the available bytes."""
        try:
            data = os.read(self.stream.fileno(), READ_CHUNK_BYTES)
        except BlockingIOError:
            return
        except OSError as error:
            self.gone = error.strerror
            return
        if data:
            self.lines += self._splitter.take(data)
        else:
            self.gone = ''

    def queue_answer(self, data):
        """Queue an answer behind the waiting answers."""
        if len(self._out) + len(data) > MAX_UNREAD_BYTES:
            self.dropped += 1
        else:
            self._out += data

    def send(self):
        """Send as many bytes as the client takes."""
        if self._out:
            try:
                del self._out[:os.write(self.stream.fileno(), self._out)]
            except BlockingIOError:
                pass
            except OSError as error:
                self.gone = error.strerror


class LineServer:
    """Clients of one TCP port (port < 0: none), and of a serial device ('': none). Raises OSError.

    kind: start of the names of the clients; most: largest number of clients; longest: largest length of a line
    [bytes]; make_client(stream, name, longest) -> a Client.
    """

    def __init__(self, kind, address, port, most, longest, device='', make_client=Client):
        self._kind, self._most, self._longest, self._make = kind, most, longest, make_client
        self._selector, self.clients, self.refused_count = selectors.DefaultSelector(), [], 0
        self._server = None
        if port >= 0:
            self._server = tcp_port.listen(address, port, most)
            self._server.setblocking(False)
            self._selector.register(self._server, selectors.EVENT_READ)
        if device:
            stream = open(device, 'r+b', buffering=0, opener=lambda path, flags: os.open(
                path, flags | os.O_NOCTTY | os.O_NONBLOCK))
            tty.setraw(stream)
            self._add(stream, f'{kind} {device}')

    @property
    def port(self):
        """Number of the TCP port."""
        return self._server.getsockname()[1]

    def look(self):
        """Accept new clients, and read from all clients."""
        for key, _ in self._selector.select(0):
            if key.fileobj is self._server:
                self._accept()
            elif len(key.data.lines) <= MAX_WAITING_LINES:
                key.data.receive()

    def send(self):
        """Send the waiting answers. Return the clients that have left, after their removal."""
        left = []
        for client in list(self.clients):
            client.send()
            if client.gone is not None and not client.lines:
                self._drop(client)
                left.append(client)
        return left

    def close(self):
        """Close every connection and the port."""
        for client in list(self.clients):
            self._drop(client)
        if self._server:
            self._server.close()

    def _accept(self):
        with contextlib.suppress(OSError):
            connection, (host, port, *_) = self._server.accept()
            if len(self.clients) >= self._most:
                self.refused_count += 1
                connection.close()
                return
            connection.setblocking(False)
            self._add(connection, f'{self._kind} {host}:{port}')

    def _add(self, stream, name):
        client = self._make(stream, name, self._longest)
        self.clients.append(client)
        self._selector.register(stream, selectors.EVENT_READ, client)

    def _drop(self, client):
        self.clients.remove(client)
        self._selector.unregister(client.stream)
        client.stream.close()
