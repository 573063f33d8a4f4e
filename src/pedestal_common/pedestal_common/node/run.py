"""Process of a node: its installed executable (`acu_node`) calls `main`, as does `python -m pedestal_common.node.run
acu_node`.

The imports of a node take half a second and more. The handlers of `main` avoid that a signal in that time prints a
traceback. This module therefore imports nothing at its beginning that takes time.
"""
import os
import pathlib
import signal
import sys
from collections.abc import Sequence


def command(executable: str, *arguments: str) -> list[str]:
    """Return the command line that starts the node of an executable, also where the executable is not installed."""
    return [sys.executable, '-m', 'pedestal_common.node.run', executable, *arguments]


def run(executable: str, args: Sequence[str] | None = None) -> int:
    """Run the node of an executable to its end, and return the exit code. args: arguments of ROS 2, None for
    sys.argv."""
    from pedestal_common.graph import nodes
    from pedestal_common.node import shell
    row = nodes.EXECUTABLES.get(executable)
    if row is None:
        sys.exit(f'{executable}: must be one of {", ".join(nodes.EXECUTABLES)}')
    node_type = row.node_type()
    return shell.main(lambda: node_type(row), args)


def main() -> int:
    """Run the node whose executable this process is, and return the exit code."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: os._exit(0))
    if sys.argv[1:] and pathlib.PurePath(sys.argv[0]).name == 'run.py':
        del sys.argv[0]
    return run(pathlib.PurePath(sys.argv[0]).stem)


if __name__ == '__main__':
    sys.exit(main())
