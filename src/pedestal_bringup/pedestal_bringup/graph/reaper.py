"""Ends the nodes that a killed `pedestal run` left behind and that do not listen: hung or stopped ones.

A node is told by the kernel when `pedestal run` dies (processes.Graph) and ends in order, the drive with a ramp. This
process reads the numbers of the nodes from its standard input, one a line, holds on to each by a pidfd, so that nobody
else with the same number is ever met, and comes into play when the input ends. Without pidfds (Linux before 5.3) it
does nothing.
"""
import contextlib
import os
import select
import signal
import sys
import time

GRACE_PERIOD_S = 20.0
"""Seconds the nodes have to end by themselves."""


def main():
    """Read the numbers of the nodes, wait for the end of the input, end who is left."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    nodes = []
    for line in sys.stdin:
        with contextlib.suppress(OSError, AttributeError):
            nodes.append(os.pidfd_open(int(line)))
    deadline = time.monotonic() + GRACE_PERIOD_S
    _signal(nodes, signal.SIGCONT)
    while nodes and time.monotonic() < deadline:
        ended, _, _ = select.select(nodes, (), (), deadline - time.monotonic())
        nodes = [node for node in nodes if node not in ended]
    _signal(nodes, signal.SIGKILL)


def _signal(nodes, number):
    for node in nodes:
        with contextlib.suppress(OSError):
            signal.pidfd_send_signal(node, number)


if __name__ == '__main__':
    sys.exit(main())
