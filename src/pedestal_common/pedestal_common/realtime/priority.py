"""The priority of a process with a deadline in every step: the kernel runs it before all that have none (sched(7))."""
import contextlib
import os


def take(priority):
    """Run every thread of this process, those of the middleware too, in SCHED_RR at a priority (1 to 99); what they
    start inherits it. '' or why the system refuses."""
    try:
        for thread in os.listdir('/proc/self/task'):
            with contextlib.suppress(ProcessLookupError):
                os.sched_setscheduler(int(thread), os.SCHED_RR, os.sched_param(priority))
    except OSError as error:
        return error.strerror
    return ''
