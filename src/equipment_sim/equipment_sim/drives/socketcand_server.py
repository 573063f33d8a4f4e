"""CAN bus behind a TCP server that speaks as socketcand does: text such as `< send 123 2 11 22 >`.

A frame of one client reaches the other clients and this end. python-can's interface `socketcand`, the tools of
can-utils' socketcand clients and the drive node connect to it.
"""
import contextlib
import select
import socket
import threading
import time
from collections.abc import Iterable, Sequence

import can

from pedestal_common.quantities import Seconds
from pedestal_hardware.can_line import Frame

HOLD_TIME_S = 0.05
"""Time after the beginning of a client's raw mode in which it gets no frames [s]. python-can takes the reply `< ok >`
only if no frame follows at once."""

MAX_LINE_BYTES = 4096  # largest number of bytes of a client without the end of a command; more close the connection
SEND_TIMEOUT_S = 0.2  # time after which a client that reads nothing is disconnected [s]


def _text(cob: int, data: bytes | bytearray) -> bytes:
    return f'< frame {cob:03X} {time.time():.6f} {data.hex().upper()} >'.encode()


class SocketcandServer(can.BusABC):
    """End of the bus for the simulated drives, at a TCP port on 127.0.0.1."""

    def __init__(self, port: int) -> None:
        super().__init__(f'127.0.0.1:{port}')
        self._can_protocol = can.CanProtocol.CAN_20
        self._listener = socket.create_server(('127.0.0.1', port))
        self._received: list[can.Message] = []
        self._buffers: dict[socket.socket, bytes] = {}      # begun command of each client
        self._open_from: dict[socket.socket, Seconds] = {}  # time from which a client gets frames
        self._sending = threading.Lock()

    def _recv_internal(self, timeout: Seconds | None) -> tuple[can.Message | None, bool]:
        if not self._received:
            for ready in select.select([self._listener, *self._buffers], [], [], timeout)[0]:
                self._take(ready)
        return (self._received.pop(0) if self._received else None), False

    def _take(self, ready: socket.socket) -> None:
        if ready is self._listener:
            client, _ = ready.accept()
            client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            client.settimeout(SEND_TIMEOUT_S)
            self._buffers[client] = b''
            self._write(client, b'< hi >')
            return
        try:
            data = ready.recv(MAX_LINE_BYTES)
        except OSError:
            data = b''
        if not data or len(self._buffers[ready]) > MAX_LINE_BYTES:
            self._drop(ready)
            return
        *lines, self._buffers[ready] = (self._buffers[ready] + data).split(b'>')
        for line in lines:
            self._execute(ready, line.split()[1:])

    def _execute(self, client: socket.socket, words: Sequence[bytes]) -> None:
        """Execute a command of a client; `< error ... >` answers an invalid command."""
        if words[:1] in ([b'open'], [b'rawmode']):
            self._write(client, b'< ok >')
            if words[0] == b'rawmode':
                self._open_from[client] = time.monotonic() + HOLD_TIME_S
            return
        try:
            if words[:1] != [b'send']:
                raise ValueError('unknown command')
            message = can.Message(arbitration_id=int(words[1], 16), is_extended_id=len(words[1]) > 3,
                                  timestamp=time.time(), data=bytes(int(word, 16) for word in words[3:]), check=True)
            if len(message.data) != int(words[2]):
                raise ValueError('wrong number of bytes')
        except (ValueError, IndexError) as error:
            self._write(client, f'< error {error} >'.encode())
            return
        if client in self._open_from:
            self._open_from[client] = 0.0
        self._received.append(message)
        if len(self._buffers) > 1:
            self._forward(_text(message.arbitration_id, message.data), client)

    def _forward(self, text: bytes, sender: socket.socket | None) -> None:
        now = time.monotonic()
        for client in list(self._buffers):
            if client is not sender and self._open_from.get(client, now) < now:
                self._write(client, text)

    def _write(self, client: socket.socket, data: bytes) -> None:
        with self._sending:
            try:
                client.sendall(data)
            except OSError:
                self._drop(client)

    def _drop(self, client: socket.socket) -> None:
        self._buffers.pop(client, None)
        self._open_from.pop(client, None)
        with contextlib.suppress(OSError):
            client.close()

    def send(self, msg: can.Message, timeout: Seconds | None = None) -> None:
        """Send a frame to all clients."""
        self._forward(_text(msg.arbitration_id, msg.data), None)

    def send_frames(self, frames: Iterable[Frame]) -> None:
        """Send frames to all clients in one write."""
        self._forward(b''.join([_text(cob, data) for cob, data in frames]), None)

    def shutdown(self) -> None:
        """Close all connections."""
        super().shutdown()
        for client in list(self._buffers):
            self._drop(client)
        self._listener.close()
