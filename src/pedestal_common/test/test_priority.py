"""The priority of a process with a deadline: taken by all of its threads, or refused with the reason."""
import json
import shutil
import subprocess
import sys

import pytest

CHILD = """
import json, os, threading
from pedestal_common.realtime import priority
ended = threading.Event()
threading.Thread(target=ended.wait).start()
refusal = priority.take(7)
threads = [int(thread) for thread in os.listdir('/proc/self/task')]
print(json.dumps([refusal, [[os.sched_getscheduler(t), os.sched_getparam(t).sched_priority] for t in threads]]))
ended.set()
"""

SCHED_OTHER, SCHED_RR = 0, 2


def taken(*before):
    """(refusal, [[policy, priority] of each of two threads]) of a process that takes priority 7."""
    return json.loads(subprocess.run([*before, sys.executable, '-c', CHILD], capture_output=True, text=True,
                                     check=True).stdout)


def test_every_thread_takes_it():
    refusal, threads = taken()
    if refusal:
        pytest.skip(f'this machine allows no priority: {refusal}')
    assert threads == [[SCHED_RR, 7]] * 2


@pytest.mark.skipif(not shutil.which('setpriv'), reason='no setpriv to take the right away with')
def test_who_may_not_goes_on_as_before():
    refusal, threads = taken('prlimit', '--rtprio=0', 'setpriv', '--bounding-set=-sys_nice', '--inh-caps=-sys_nice')
    assert refusal == 'Operation not permitted'
    assert threads == [[SCHED_OTHER, 0]] * 2
