"""What tests that start processes share beside the fixtures of conftest.py."""
import socket
import sys
import threading

import limited

PATIENCE = 120.0
"""Seconds for what takes one or two on a quiet machine."""

PEDESTAL = (sys.executable, '-m', 'pedestal.cli')
"""The command, as arguments of a process."""

NODE = (sys.executable, '-m', 'pedestal_common.node.run')
"""Start of a node, as arguments of a process; the executable of the node follows."""


def free_port():
    """Return a port of this machine on which nobody listens."""
    with socket.socket() as probe:
        probe.bind(('127.0.0.1', 0))
        return probe.getsockname()[1]


def begins_with(process, count):
    """Return the first lines that a process writes; one that does not is killed, which ends them."""
    timer = threading.Timer(PATIENCE, limited.kill_tree, (process,))
    timer.start()
    try:
        return ''.join(process.stdout.readline() for _ in range(count))
    finally:
        timer.cancel()
