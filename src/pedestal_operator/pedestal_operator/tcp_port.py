"""Opening of the TCP port of a server, for the page and the rotator protocols."""
import errno
import socket


def listen(address: str, port: int, clients: int | None = None) -> socket.socket:
    """Return a socket that listens on a port of an address. Raises OSError; for a port in use its text names the port.

    port: 0 for a free port; clients: number of clients that may wait for their connection, None for any.
    """
    try:
        return socket.create_server((address, port), family=socket.AF_INET6 if ':' in address else socket.AF_INET,
                                    backlog=clients)
    except OSError as error:
        if error.errno != errno.EADDRINUSE:
            raise
        raise OSError(f'port {port} of {address} is in use') from None
