"""Scheduling priority of a node: the kernel runs it before all processes without a priority (sched(7))."""
import contextlib
import os


def take(priority: int) -> str:
    """Set the scheduling policy SCHED_RR at a priority (1 to 99) for every thread of this process, also those of the
    middleware. New threads inherit it. Return '', or the reason why the system refuses."""
    try:
        for thread in os.listdir('/proc/self/task'):
            with contextlib.suppress(ProcessLookupError):
                os.sched_setscheduler(int(thread), os.SCHED_RR, os.sched_param(priority))
    except OSError as error:
        return error.strerror or str(error)
    return ''
