"""Stop of a process by an exception in the handler of a signal, also where Python would ignore the exception.

Python ignores every exception in a destructor, and in a callback of a weak reference or of a C library. Numba runs
many of these while it compiles. Therefore a timer sends SIGALRM a little later, whose handler raises it again.

Inside an executor of rclpy an exception would leave a callback half done, of which rclpy and Python warn on stderr.
Therefore it waits for the end of `uninterrupted`.
"""
import contextlib
import signal
import sys
import types
from collections.abc import Iterator

STOP_RETRY_S = 0.02  # time after which SIGALRM tries again to stop the process [s]

_HOOKS = '_raw_object_cache_getbuffer', '_raw_object_cache_notify'
"""Functions of llvmlite that LLVM calls before and after it makes machine code. An exception in these functions would
be ignored and would lose the code, so that the law could not be loaded."""

_protected: list[bool] = []     # not empty inside `uninterrupted`
_waiting: list[type[BaseException]] = []    # exceptions that wait for its end


def raise_stop(stop: type[BaseException], frame: types.FrameType | None) -> None:
    """Raise the exception `stop`, or raise it a little later if LLVM makes machine code now."""
    if _protected:
        _waiting.append(stop)
        return
    while frame is not None:
        if frame.f_code.co_name in _HOOKS:
            _stop_later()
            return
        frame = frame.f_back
    raise stop


@contextlib.contextmanager
def uninterrupted() -> Iterator[None]:
    """Let `raise_stop` wait for the end of this context."""
    _protected.append(True)
    try:
        yield
    finally:
        _protected.clear()
    if _waiting:
        raise _waiting.pop()


def retry(stop: type[BaseException]) -> None:
    """Let SIGALRM, whose handler must raise it again, follow whenever Python ignores the exception `stop`."""
    def on_unraisable(unraisable: 'sys.UnraisableHookArgs') -> None:
        if issubclass(unraisable.exc_type, stop):
            _stop_later()
        else:
            sys.__unraisablehook__(unraisable)
    sys.unraisablehook = on_unraisable


def _stop_later() -> None:
    signal.setitimer(signal.ITIMER_REAL, STOP_RETRY_S)
