"""What tests that start processes share beside the fixtures of conftest.py."""
import socket
import sys

PEDESTAL = (sys.executable, '-m', 'pedestal.cli')
"""The command, as arguments of a process."""


def free_port():
    """Return a port of this machine on which nobody listens."""
    with socket.socket() as probe:
        probe.bind(('127.0.0.1', 0))
        return probe.getsockname()[1]
