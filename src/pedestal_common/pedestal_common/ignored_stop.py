"""Second attempt of a signal to stop a process after Python had to ignore the exception of the first.

The handler of a signal raises an exception that ends the work of the process. Python ignores every exception in a
destructor, and in a callback of a weak reference or of a C library. The work would go on, with a traceback on stderr.
Numba runs many such destructors while it compiles.
"""
import signal
import sys

STOP_RETRY_S = 0.02
"""Time after which SIGALRM tries again to stop the process [s]."""


def stop_later() -> None:
    """Start a timer that sends SIGALRM to this process."""
    signal.setitimer(signal.ITIMER_REAL, STOP_RETRY_S)


def retry(stop: type[BaseException]) -> None:
    """Call `stop_later` whenever Python ignores the exception `stop`. The handler of SIGALRM must raise it again.

    Any other ignored exception is reported as Python does.
    """
    def on_unraisable(unraisable: 'sys.UnraisableHookArgs') -> None:
        if issubclass(unraisable.exc_type, stop):
            stop_later()
        else:
            sys.__unraisablehook__(unraisable)
    sys.unraisablehook = on_unraisable
