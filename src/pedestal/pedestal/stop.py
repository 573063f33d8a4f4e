"""Stop of `pedestal` by Ctrl-C, SIGTERM or SIGHUP. The command line imports this module first, because the import of
the rest takes up to a second. A signal during that import ends the process at once, with the usual message. Another
program that imports this module keeps its own handlers of the signals."""
import atexit
import os
import signal
import sys
import types
from collections.abc import Callable

STOP_MESSAGE, STOP_EXIT_CODE = 'pedestal: stopped', 130
"""Message on stderr and exit code of a stopped process; 130 is 128 + number of SIGINT, the convention of shells."""


def on_stop(handler: Callable[[int, types.FrameType | None], object] | signal.Handlers) -> None:
    """Set the handler of the three signals. A signal that the parent process ignores remains ignored."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, handler)


def interrupt_on_stop() -> None:
    """Let the three signals raise KeyboardInterrupt, after 20 ms if Python would ignore it now."""
    from pedestal_common import ignored_stop

    def interrupt(_number: int, frame: types.FrameType | None) -> None:
        ignored_stop.raise_stop(KeyboardInterrupt, frame)
    on_stop(interrupt)
    signal.signal(signal.SIGALRM, interrupt)
    ignored_stop.retry(KeyboardInterrupt)


def ignore_at_exit() -> None:
    """Let signals have no effect from the first exit function of Python on. At its end Python restores their default
    action, which would kill a process that has done its work."""
    atexit.unregister(_ignore)
    atexit.register(_ignore)


def _ignore() -> None:
    signal.setitimer(signal.ITIMER_REAL, 0.0)
    on_stop(signal.SIG_IGN)


def _end_at_once(_number: int, _frame: types.FrameType | None) -> None:
    """End the process with the usual message, without Python's buffers and exit functions."""
    os.write(2, f'{STOP_MESSAGE}\n'.encode())
    os._exit(STOP_EXIT_CODE)


if os.path.basename(sys.argv[0]) in ('pedestal', 'cli.py'):     # the command line, by its script or as a module
    on_stop(_end_at_once)
