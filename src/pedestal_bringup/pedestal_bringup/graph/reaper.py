"""End nodes that a killed `pedestal run` left behind and that ignore SIGTERM, because they hang or are suspended
(SIGSTOP).

When `pedestal run` dies, the kernel sends each node SIGTERM (processes.Graph), and the node ends in order, the drive
with a ramp. This process reads the process numbers of the nodes from its standard input, one per line, and holds a
pidfd of each. A pidfd avoids that a signal reaches another process with the same number. When the input ends, the
grace period begins. Without pidfds (Linux before 5.3) this process does nothing.
"""
import contextlib
import os
import select
import signal
import sys
import time

GRACE_PERIOD_S = 20.0
"""Time in which the nodes must end by themselves [s]."""


def main():
    """Read the process numbers of the nodes, wait for the end of the input, kill the nodes that remain."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    nodes = []
    for line in sys.stdin:
        # OSError: the node has ended already. AttributeError: this Python or its system has no pidfds.
        with contextlib.suppress(OSError, AttributeError):
            nodes.append(os.pidfd_open(int(line)))
    deadline = time.monotonic() + GRACE_PERIOD_S
    _signal(nodes, signal.SIGCONT)     # because a suspended node receives the SIGTERM of the kernel only after it
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
