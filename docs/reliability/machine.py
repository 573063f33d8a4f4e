"""Delays of the machine itself, which no realtime graph can avoid: a loop that only waits.

    python docs/reliability/machine.py [SECONDS]

A loop on each core wakes every millisecond for SECONDS (default 60), with the priority of `scenario.priority` 10 where
the user may set it. The program prints for each core how often the loop woke later than 1, 2, 3.5, 5 and 10 ms. A
delay above 3.5 ms costs a step of 5 ms in every program.
"""
import argparse
import multiprocessing
import os
import sys
import time

PERIOD = 1_000_000
LATE = (1.0, 2.0, 3.5, 5.0, 10.0)
PRIORITY = 10


def lateness(core, seconds):
    """Times late [ms] of one core's loop, those above LATE[0], and whether it had its priority."""
    os.sched_setaffinity(0, {core})
    try:
        os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(PRIORITY))
    except PermissionError:
        pass
    late, due = [], time.monotonic_ns()
    end = due + int(seconds * 1e9)
    while due < end:
        due += PERIOD
        time.sleep(max(due - time.monotonic_ns(), 0) / 1e9)
        behind = (time.monotonic_ns() - due) / 1e6
        if behind > LATE[0]:
            late.append(behind)
            due = time.monotonic_ns()
    return late, os.sched_getscheduler(0) == os.SCHED_RR


def main(args=None):
    """Print the table; the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('seconds', nargs='?', type=float, default=60.0)
    seconds = parser.parse_args(args).seconds
    cores = sorted(os.sched_getaffinity(0))
    with multiprocessing.Pool(len(cores)) as pool:
        found = pool.starmap(lateness, [(core, seconds) for core in cores], chunksize=1)
    print('| core | priority | ' + ' | '.join(f'> {limit:g} ms' for limit in LATE) + ' | latest |\n'
          + '|---' * (3 + len(LATE)) + '|')
    for core, (late, priority) in zip(cores, found, strict=True):
        counts = ' | '.join(str(sum(one > limit for one in late)) for limit in LATE)
        print(f'| {core} | {PRIORITY if priority else 0} | {counts} | {max(late, default=0.0):.1f} ms |')
    return 0


if __name__ == '__main__':
    sys.exit(main())
