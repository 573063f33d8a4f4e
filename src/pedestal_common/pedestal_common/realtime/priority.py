"""Scheduling priority of a node, whose steps have deadlines: the kernel runs a process with such a priority before all
processes without one (sched(7))."""
import contextlib
import os


def take(priority: int) -> str:
    """Set the scheduling policy SCHED_RR at a priority (1 to 99) for every thread of this process. Return '', or the
    reason why the system refuses.

    The threads of the middleware are included, and new threads inherit the priority.
    """
    try:
        for thread in os.listdir('/proc/self/task'):
            with contextlib.suppress(ProcessLookupError):
                os.sched_setscheduler(int(thread), os.SCHED_RR, os.sched_param(priority))
    except OSError as error:
        return error.strerror or str(error)
    return ''
