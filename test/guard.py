"""Guard of a test session: a process that kills what a killed session leaves behind.

    python guard.py PID MARK

A test session has a mark: an environment variable with a value of its own, which every process below it inherits.
After the death of process PID, the guard kills all processes whose environment holds MARK. The guard itself is
without the mark. This module needs the standard library only, because conftest.py also serves other environments.
"""
import contextlib
import os
import pathlib
import select
import signal
import subprocess
import sys
import time
import uuid

VARIABLE = 'PEDESTAL_TEST_SESSION'
"""Environment variable that holds the mark of a session."""

DEATH_TIME_S = 10.0
"""Time within which a killed process is gone, also one that waits for a disk [s]."""

END_TIME_S = 3.0
"""Time that processes have at an ordinary end of the session to end by themselves [s]."""

POLL_TIME_S = 0.05

OF_PYTHON = b'multiprocessing.resource_tracker', b'multiprocessing.forkserver'
"""Parts of the command lines of processes of Python itself, which end with the last process that uses them."""


def _marked(mark: str) -> list[int]:
    """Return the pids of all processes whose environment holds a mark, except those of Python itself."""
    entry = f'{VARIABLE}={mark}'.encode()
    found = []
    for process in pathlib.Path('/proc').glob('[0-9]*'):
        with contextlib.suppress(OSError):
            if entry in (process / 'environ').read_bytes().split(b'\0') and (
                    not any(part in (process / 'cmdline').read_bytes() for part in OF_PYTHON)):
                found.append(int(process.name))
    return found


def _command_line(pid: int) -> str:
    """Return the command line of a process, '' of a process that has ended."""
    with contextlib.suppress(OSError):
        return pathlib.Path(f'/proc/{pid}/cmdline').read_text(errors='replace').replace('\0', ' ').strip()[:200]
    return ''


def kill_marked(mark: str) -> None:
    """Kill all processes of a mark. One pass is not enough, because a process may start another one meanwhile."""
    end = time.monotonic() + DEATH_TIME_S
    while (pids := _marked(mark)) and time.monotonic() < end:
        for pid in pids:
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        time.sleep(POLL_TIME_S)


class Guard:
    """The guard of this process, which marks its environment."""

    def __init__(self) -> None:
        self._mark = uuid.uuid4().hex
        # A session inside of another one has a mark of its own, and its guard has none: it outlives both.
        unmarked = {name: value for name, value in os.environ.items() if name != VARIABLE}
        # Ctrl-C ends the process group of pytest, to which the guard therefore does not belong.
        self._process = subprocess.Popen([sys.executable, __file__, str(os.getpid()), self._mark], env=unmarked,
                                         stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
                                         stderr=subprocess.DEVNULL, start_new_session=True)
        os.environ[VARIABLE] = self._mark

    def clear(self) -> list[str]:
        """Give the processes of the session time to end, kill those that remain, and return a text of each."""
        end = time.monotonic() + END_TIME_S
        while (pids := _marked(self._mark)) and time.monotonic() < end:
            time.sleep(POLL_TIME_S)
        leftovers = [f'{pid} {_command_line(pid)}' for pid in pids]
        kill_marked(self._mark)
        return leftovers

    def end(self) -> None:
        """End the guard after an ordinary end of the session, also of one without `clear`."""
        kill_marked(self._mark)
        self._process.terminate()
        self._process.wait(DEATH_TIME_S)


def _main(pid: int, mark: str) -> None:
    """Wait for the death of a process, and kill all processes of its mark."""
    with contextlib.suppress(ProcessLookupError):
        select.select([os.pidfd_open(pid)], [], [])
    kill_marked(mark)


if __name__ == '__main__':
    _main(int(sys.argv[1]), sys.argv[2])
