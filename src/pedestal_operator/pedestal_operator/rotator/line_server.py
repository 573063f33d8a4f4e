"""Programs that talk in lines, over TCP or a serial device, each read and written without waiting for any of them."""
import collections
import contextlib
import os
import selectors
import socket
import tty

MAX_UNREAD_BYTES = 65_536
"""Bytes of answers that a client may leave unread; what comes then is dropped."""

MAX_WAITING_LINES = 100
"""Lines of a client that may wait for an answer before it is no longer read."""

READ_CHUNK_BYTES = 65_536


class Lines:
    """Cuts bytes into lines of at most `longest`; of a longer one nothing is kept."""

    def __init__(self, longest):
        self._longest, self._rest, self._skips = longest, b'', False

    def take(self, data):
        """The lines that bytes have completed; None for one that was too long."""
        *lines, self._rest = (self._rest + data).replace(b'\r', b'\n').split(b'\n')
        found = []
        for line in lines:
            too_long, self._skips = self._skips or len(line) > self._longest, False
            found.append(None if too_long else line.decode('ascii', 'replace'))
        if len(self._rest) > self._longest:
            self._rest, self._skips = b'', True
        return found


class Client:
    """A program at the other end. name: how the recording calls it; lines: what it has said and is not answered yet;
    dropped: answers that it did not read; gone: why it has left, None as long as it is there."""

    def __init__(self, stream, name, longest):
        self.stream, self.name = stream, name
        self.lines, self.dropped, self.gone = collections.deque(), 0, None
        self._cut, self._out = Lines(longest), bytearray()

    def receive(self):
        """Take what has come."""
        try:
            data = os.read(self.stream.fileno(), READ_CHUNK_BYTES)
        except BlockingIOError:
            return
        except OSError as error:
            self.gone = error.strerror
            return
        if data:
            self.lines += self._cut.take(data)
        else:
            self.gone = ''

    def say(self, data):
        """Put an answer behind those that are still to be sent."""
        if len(self._out) + len(data) > MAX_UNREAD_BYTES:
            self.dropped += 1
        else:
            self._out += data

    def send(self):
        """Send as much as the other end takes."""
        if self._out:
            try:
                del self._out[:os.write(self.stream.fileno(), self._out)]
            except BlockingIOError:
                pass
            except OSError as error:
                self.gone = error.strerror


class LineServer:
    """The clients of one TCP port (port < 0: none), and of a serial device ('': none). Raises OSError.

    kind: what the names of the clients begin with; longest: bytes of a line; make_client(stream, name, longest).
    """

    def __init__(self, kind, address, port, most, longest, device='', make_client=Client):
        self._kind, self._most, self._longest, self._make = kind, most, longest, make_client
        self._selector, self.clients, self.turned_away = selectors.DefaultSelector(), [], 0
        self._server = None
        if port >= 0:
            self._server = socket.create_server((address, port), backlog=most)
            self._server.setblocking(False)
            self._selector.register(self._server, selectors.EVENT_READ)
        if device:
            stream = open(device, 'r+b', buffering=0, opener=lambda path, flags: os.open(
                path, flags | os.O_NOCTTY | os.O_NONBLOCK))
            tty.setraw(stream)
            self._add(stream, f'{kind} {device}')

    @property
    def port(self):
        """The port it listens on."""
        return self._server.getsockname()[1]

    def look(self):
        """Take new clients and what has come from each."""
        for key, _ in self._selector.select(0):
            if key.fileobj is self._server:
                self._accept()
            elif len(key.data.lines) <= MAX_WAITING_LINES:
                key.data.receive()

    def send(self):
        """Send what is to be sent; the clients that have left, and are forgotten."""
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
                self.turned_away += 1
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
