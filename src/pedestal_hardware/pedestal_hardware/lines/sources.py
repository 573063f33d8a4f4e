"""Sources of bytes: a UDP port of this machine, a TCP connection to a device, or a serial device."""
import socket
import urllib.parse
from typing import Protocol

from pedestal_common.parameters import ParameterError
from pedestal_common.stream import bound

READ_TIMEOUT_S = 0.1  # longest wait for the next bytes [s]
CONNECT_TIMEOUT_S = 3.0  # longest wait for a TCP connection [s]
MAX_READ_BYTES = 65536  # largest number of bytes of one read; no datagram is longer
URL_FORMS_TEXT = 'udp://HOST:PORT, socket://HOST:PORT, or the path of a serial device'  # for texts


class Source(Protocol):
    """Source of bytes."""
    WHOLE: bool     # True if each `read` returns whole lines, as that of a datagram does

    def read(self) -> bytes:
        """Return the bytes received in READ_TIMEOUT_S, b'' for none. Raises OSError if the device has vanished."""

    def close(self) -> None:
        """End the connection."""


class UdpSource:
    """Datagrams at a UDP port of this machine. host: address of this machine to which the device sends."""
    WHOLE = True

    def __init__(self, host: str, port: int) -> None:
        self.socket = bound(host, port)
        self.socket.settimeout(READ_TIMEOUT_S)

    def read(self) -> bytes:
        """Return the next datagram, with the end of its last line."""
        try:
            return self.socket.recv(MAX_READ_BYTES) + b'\n'
        except TimeoutError:
            return b''

    def close(self) -> None:
        """Free the port."""
        self.socket.close()


class TcpSource:
    """TCP connection to a device that listens at host and port."""
    WHOLE = False

    def __init__(self, host: str, port: int) -> None:
        self.socket = socket.create_connection((host, port), CONNECT_TIMEOUT_S)
        self.socket.settimeout(READ_TIMEOUT_S)

    def read(self) -> bytes:
        """Return the next bytes. Raises OSError after the end of the connection."""
        try:
            received = self.socket.recv(MAX_READ_BYTES)
        except TimeoutError:
            return b''
        if not received:
            raise OSError('the device has closed the connection')
        return received

    def close(self) -> None:
        """End the connection."""
        self.socket.close()


class SerialSource:
    """Serial device of a path, at a speed [Bd]."""
    WHOLE = False

    def __init__(self, path: str, baud_rate: int) -> None:
        # pyserial is an extra of this package.
        try:
            import serial
        except ImportError as error:
            raise OSError(f"{error}: pip install 'pedestal_hardware[serial]'") from None
        self.device = serial.Serial(path, baud_rate, timeout=READ_TIMEOUT_S)

    def read(self) -> bytes:
        """Return the next bytes. Raises OSError, of which SerialException is a kind, when the device vanishes."""
        return self.device.read(max(1, min(self.device.in_waiting, MAX_READ_BYTES)))

    def close(self) -> None:
        """Free the device."""
        self.device.close()


def place(url: str, name: str = 'url') -> tuple[str, str, int]:
    """Return (scheme, host, port) of a url; ('', path, 0) for a serial device. Raises ParameterError."""
    if '://' not in url:
        if not url.startswith('/'):
            raise ParameterError(f"{name} = '{url}': must be {URL_FORMS_TEXT}")
        return '', url, 0
    parts = urllib.parse.urlsplit(url)
    if parts.scheme not in ('udp', 'socket'):
        raise ParameterError(f"{name} = '{url}': {parts.scheme}: must be {URL_FORMS_TEXT}")
    try:
        port = parts.port or 0
    except ValueError:
        port = 0
    if not parts.hostname or not port or parts.path.strip('/'):
        raise ParameterError(f"{name} = '{url}': must be {URL_FORMS_TEXT}, with a port from 1 to 65535")
    return parts.scheme, parts.hostname, port


def opened(url: str, baud_rate: int) -> Source:
    """Return the opened source of a url. Raises OSError, or ValueError for a speed that the device refuses."""
    scheme, where, port = place(url)
    if not scheme:
        return SerialSource(where, baud_rate)
    return UdpSource(where, port) if scheme == 'udp' else TcpSource(where, port)
