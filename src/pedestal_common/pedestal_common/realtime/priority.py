"""Priority of a process with a deadline in every step: the kernel runs it before all processes without one
(sched(7))."""
import contextlib
import os


def take(priority):
    """Set SCHED_RR at a priority (1 to 99) for every thread of this process, including those of the middleware; new
    threads inherit it. Return '' or why the system refuses."""
    try:
        for thread in os.listdir('/proc/self/task'):
            with contextlib.suppress(ProcessLookupError):
                os.sched_setscheduler(int(thread), os.SCHED_RR, os.sched_param(priority))
    except OSError as error:
        return error.strerror
    return ''
