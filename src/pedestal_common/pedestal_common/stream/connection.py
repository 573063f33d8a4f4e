"""Connections: to a device, in a thread of its own, which opens it again after an error; and ports of this machine."""
import errno
import socket
import threading

from pedestal_common.quantities import Seconds

RETRY_PERIOD_S = 1.0  # time between two attempts to open a connection [s]


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
        """Open the device and serve it until the connection ends. Raise OSError when the device vanishes, ValueError
        for a speed that it refuses."""
        raise NotImplementedError

    def _run(self) -> None:
        while not self.ended.is_set():
            try:
                self.serve()
            except (OSError, ValueError) as error:     # SerialException is an OSError
                self.silence = f'{self.url}: {error}'
                self.ended.wait(RETRY_PERIOD_S)


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
