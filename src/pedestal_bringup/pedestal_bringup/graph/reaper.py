"""Reaper: a process beside `pedestal run` that kills nodes which a dead `pedestal run` has left behind.

When `pedestal run` dies, the kernel sends each node SIGTERM, and the drive stops its axes by a ramp. A node that hangs
or is suspended (SIGSTOP) ignores SIGTERM, so the reaper kills it after a grace period. The reaper reads the process
numbers of the nodes from its standard input, which ends with `pedestal run`. A pidfd of each avoids that a signal
reaches a later process with the same number; without pidfds (Linux before 5.3) the reaper does nothing.
"""
import contextlib
import os
import select
import signal
import sys
import time
from collections.abc import Iterable

GRACE_PERIOD_S = 20.0  # time from the end of `pedestal run` in which the nodes must end by themselves [s]


def main() -> None:
    """Read the process numbers of the nodes, wait for the grace period, and kill the nodes that remain."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    nodes = []
    for line in sys.stdin:
        # OSError: the node has ended already. AttributeError: this Python or its system has no pidfds.
        with contextlib.suppress(OSError, AttributeError):
            nodes.append(os.pidfd_open(int(line)))
    deadline = time.monotonic() + GRACE_PERIOD_S
    _signal(nodes, signal.SIGCONT)     # A suspended node acts on the kernel's SIGTERM only after SIGCONT.
    while nodes and time.monotonic() < deadline:
        ended, _, _ = select.select(nodes, (), (), deadline - time.monotonic())
        nodes = [node for node in nodes if node not in ended]
    _signal(nodes, signal.SIGKILL)


def _signal(nodes: Iterable[int], number: int) -> None:
    for node in nodes:
        with contextlib.suppress(OSError):
            signal.pidfd_send_signal(node, number)


if __name__ == '__main__':
    main()
