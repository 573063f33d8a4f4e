"""Lines to a CAN bus: they send the frames of a period together, and receive the frames that have arrived.

`SocketcandLine` speaks the text protocol of socketcand itself, because the objects of python-can would take a third of
a period of 2 ms. All other interfaces use python-can.
"""
import contextlib
import select
import socket
import time
from collections.abc import Iterable
from typing import Any, Protocol, TypeAlias

import can

from pedestal_common.quantities import Seconds

MAX_CHUNK_BYTES = 65536  # largest number of bytes that are received at once
MAX_TEXT_BYTES = 4096  # largest number of bytes without the end of a frame; more end the connection
SEND_TIMEOUT_S = 0.2  # time after which a server that takes no frame counts as absent [s]

LARGEST_STANDARD_ID = 0x7FF

Frame: TypeAlias = tuple[int, bytes]    # identifier, data


class Line(Protocol):
    """Line to a CAN bus."""

    def send(self, frames: Iterable[Frame]) -> None:
        """Send frames together. Raises OSError."""

    def receive(self, timeout: Seconds) -> list[Frame]:
        """Return the frames that arrive within a time, at least those that have arrived. Raises OSError."""

    def close(self) -> None:
        """Close the line."""


class SocketcandLine:
    """Connection to a socketcand server. channel: name of its bus; timeout: longest wait for an answer. Raises
    OSError."""

    def __init__(self, host: str, port: int, channel: str, timeout: Seconds) -> None:
        self._socket, self._rest = socket.create_connection((host, port), timeout), b''
        try:
            self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._expect(b'hi')
            for command in (f'open {channel}', 'rawmode'):
                self._socket.sendall(f'< {command} >'.encode())
                self._expect(b'ok')
        except OSError:
            self._socket.close()
            raise
        self._socket.settimeout(SEND_TIMEOUT_S)

    def _expect(self, word: bytes) -> None:
        """Receive the answer of the server to a command; what follows it stays."""
        while b'>' not in self._rest:
            data = self._socket.recv(MAX_CHUNK_BYTES)
            if not data:
                raise ConnectionError('the server has closed the connection')
            self._rest += data
        answer, _, self._rest = self._rest.partition(b'>')
        if answer.split() != [b'<', word]:
            raise ConnectionError(f'the server answers {answer.decode(errors="replace")}>')

    def send(self, frames: Iterable[Frame]) -> None:
        """Send frames in one write. An error, which may have cut a frame, ends the connection. Raises OSError."""
        text = ''.join([f'< send {cob:X} {len(data)} {data.hex(" ")} >' for cob, data in frames])
        try:
            self._socket.sendall(text.encode())
        except OSError:
            self._socket.close()
            raise

    def receive(self, timeout: Seconds) -> list[Frame]:
        """Return the frames; see Line."""
        if not select.select((self._socket,), (), (), timeout)[0]:
            return []
        data = self._socket.recv(MAX_CHUNK_BYTES)
        if not data:
            raise ConnectionError('the server has closed the connection')
        *texts, self._rest = (self._rest + data).split(b'>')
        if len(self._rest) > MAX_TEXT_BYTES:
            raise ConnectionError(f'{len(self._rest)} bytes without the end of a frame')
        frames = []
        for text in texts:
            words = text.split()
            if words[1:2] == [b'frame'] and len(words) > 3 and len(words[2]) <= 3:
                with contextlib.suppress(ValueError):     # no hexadecimal numbers
                    frames.append((int(words[2], 16), bytes.fromhex(b''.join(words[4:]).decode())))
        return frames

    def close(self) -> None:
        """Close the connection."""
        self._socket.close()


class PythonCanLine:
    """Interface of python-can. arguments: those of can.Bus. Raises OSError, can.CanError, ValueError."""

    def __init__(self, **arguments: Any) -> None:   # each interface of python-can has its own
        self._bus = can.Bus(**arguments)

    def send(self, frames: Iterable[Frame]) -> None:
        """Send frames. Raises OSError."""
        try:
            for cob, data in frames:
                self._bus.send(can.Message(arbitration_id=cob, is_extended_id=False, data=data))
        except can.CanError as error:
            raise OSError(str(error)) from None

    def receive(self, timeout: Seconds) -> list[Frame]:
        """Return the frames; see Line."""
        frames: list[Frame] = []
        end = time.monotonic() + timeout
        try:
            while (message := self._bus.recv(0.0 if frames else max(end - time.monotonic(), 0.0))) is not None:
                # The identifier of an error frame holds bits of the error, and names no sender.
                if message.arbitration_id <= LARGEST_STANDARD_ID and not (message.is_remote_frame
                                                                          or message.is_error_frame):
                    frames.append((message.arbitration_id, bytes(message.data)))
        except can.CanError as error:
            raise OSError(str(error)) from None
        return frames

    def close(self) -> None:
        """Close the interface."""
        self._bus.shutdown()
