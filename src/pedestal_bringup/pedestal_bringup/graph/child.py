"""Child process of `pedestal run` in which a node runs: a copy of `pedestal run` where possible, otherwise a new
Python interpreter.

A copy (os.fork without exec) already has the imports of every node: `pedestal run leo_pass --duration 1` takes 4.9 s
with copies and 8.5 s without (medians of 7 pairs on 2 cores; 3.9 and 6.4 s of CPU). A fork copies only the thread that
calls it, so a copy is possible only while `pedestal run` needs no other thread. threading.active_count() counts those
of Python. The libraries of rclpy start threads in C++, so no copy is made after the import of rclpy. OpenBLAS (numpy)
ends its own threads at a fork.

A child is held: it loads its imports and its laws, then waits for `begin`. The nodes of a run therefore load at the
same time, and start together.
"""
import contextlib
import ctypes
import fcntl
import gc
import importlib.util
import math
import os
import pathlib
import signal
import struct
import subprocess
import sys
import threading
import time
import traceback
from collections.abc import Callable, Iterable
from typing import NoReturn

from pedestal_common.quantities import Seconds

PR_SET_PDEATHSIG, PR_SET_NAME, PR_SET_MM, PR_SET_MM_MAP = 1, 15, 35, 14  # operations of prctl(2)

PRCTL_MM_MAP = struct.Struct('=12QIi')
"""struct prctl_mm_map of <linux/prctl.h>: 12 addresses, the size of the auxiliary vector, a file descriptor.

The addresses are: start_code, end_code, start_data, end_data, start_brk, brk (end of the heap), start_stack,
arg_start, arg_end (command line), env_start, env_end (environment), auxv (auxiliary vector).
"""

NO_AUXILIARY_VECTOR, NO_AUXILIARY_SIZE, NO_FILE = 0, 0, -1
"""Values in a PRCTL_MM_MAP with which the kernel keeps the auxiliary vector and the executable of the process."""

CODE_FIELDS, STACK_FIELDS, DATA_AND_HEAP_FIELDS, ENVIRONMENT_FIELDS = (26, 28), (28, 29), (45, 48), (50, 52)
"""Ranges [first, end) of the fields of /proc/self/stat that hold these addresses, numbered from 1 as in proc(5)."""

BLOCKED_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
"""Signals that are blocked during the fork, so that the child does not run a handler of its parent."""

_libc = ctypes.CDLL(None)
_libc.sbrk.restype = _libc.malloc.restype = ctypes.c_void_p


class Child:
    """Child process that is held until `begin` and then runs a module like `python -m`, with the methods of
    subprocess.Popen. It heads a session of its own, and the kernel sends it SIGTERM when its parent ends.

    command   interpreter, '-m', module, arguments ...
    output    file descriptor of its log
    rehearse  function that a held copy calls to import the node and load its laws. Errors are ignored, because the
              node meets the same error later and reports it. None: the command is any program, never a copy
    """

    def __init__(self, command: list[str], output: int, rehearse: Callable[[], object] | None) -> None:
        copy = rehearse is not None and 'rclpy' not in sys.modules and threading.active_count() == 1
        gate, self._begin = os.pipe()
        self.returncode: int | None = None
        parent = os.getpid()
        if copy:
            # This avoids that a garbage collection in the child writes to memory pages that it shares with its parent,
            # which would copy the pages.
            gc.freeze()
        mask = signal.pthread_sigmask(signal.SIG_BLOCK, BLOCKED_SIGNALS)
        try:
            self.pid = os.fork()
            if not self.pid:
                def run() -> int:
                    held = _settle(parent, output, gate, mask)
                    # A copy that cannot show its own command line would look like a second `pedestal run`, and a
                    # user who kills that name would kill the node too. A new interpreter has its own command line.
                    become = _as_copy if copy and _set_command_line(command) else _as_interpreter
                    return become(command, held, rehearse)
                _run_child(run)
        except OSError:
            os.close(self._begin)
            raise
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, mask)
            os.close(gate)

    def begin(self) -> None:
        """Release the held process, so that it runs its module."""
        with contextlib.suppress(BrokenPipeError):
            os.write(self._begin, b'.')
        os.close(self._begin)

    def poll(self) -> int | None:
        """Return the exit code of the process, -N after an end by signal N; None while the process runs."""
        if self.returncode is None:
            pid, status = os.waitpid(self.pid, os.WNOHANG)
            if pid:
                self.returncode = os.waitstatus_to_exitcode(status)
        return self.returncode

    def wait(self, timeout: Seconds | None = None) -> int:
        """Wait for the end of the process and return its exit code. Raises subprocess.TimeoutExpired."""
        end = math.inf if timeout is None else time.monotonic() + timeout
        while self.poll() is None:
            if timeout is not None and time.monotonic() > end:
                raise subprocess.TimeoutExpired(str(self.pid), timeout)
            time.sleep(0.005)
        assert self.returncode is not None
        return self.returncode

    def send_signal(self, number: int) -> None:
        """Send a signal, unless the process has ended."""
        if self.poll() is None:
            os.kill(self.pid, number)

    def kill(self) -> None:
        """Send SIGKILL."""
        self.send_signal(signal.SIGKILL)


def _run_child(run: Callable[[], int]) -> NoReturn:
    """End the child with the exit code of run(), 1 after an error. It must never return into the code of its parent.
    """
    code: str | int = 1     # a text ends a program with exit code 1
    try:
        code = run() or 0
    except SystemExit as end:
        code = end.code or 0
    except BaseException:
        traceback.print_exc()
    finally:
        try:
            sys.stdout.flush()
        finally:
            os._exit(code if isinstance(code, int) else 1)


def _settle(parent: int, output: int, gate: int, mask: Iterable[int]) -> int:
    """Detach the child from its parent, and return the new descriptor of the gate, the pipe on which the parent
    releases it. mask: signal mask before the fork."""
    # Both descriptors are moved above 2. If the parent has no standard input, one of them may have the number of a
    # standard stream (0, 1, 2).
    output, gate = (fcntl.fcntl(descriptor, fcntl.F_DUPFD, 3) for descriptor in (output, gate))
    os.setsid()
    _libc.prctl(PR_SET_PDEATHSIG, signal.SIGTERM)
    if os.getppid() != parent:     # the parent ended before the signal was set
        os._exit(1)
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    os.dup2(output, 1)
    os.dup2(output, 2)
    for descriptor in map(int, os.listdir('/proc/self/fd')):
        if descriptor > 2 and descriptor != gate:
            with contextlib.suppress(OSError):
                os.close(descriptor)
    for number in BLOCKED_SIGNALS:
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, signal.SIG_DFL)
    signal.pthread_sigmask(signal.SIG_SETMASK, mask)
    return gate


def _wait(gate: int) -> None:
    """Wait at the gate until the parent releases this process; end this process if the parent has ended."""
    if not os.read(gate, 1):
        os._exit(0)
    os.close(gate)


def _as_interpreter(command: list[str], gate: int, _: object) -> NoReturn:
    _wait(gate)
    os.execv(command[0], command)


def _as_copy(command: list[str], gate: int, rehearse: Callable[[], object] | None) -> int:
    sys.stdout, sys.stderr = (open(descriptor, 'w', buffering, errors='backslashreplace', closefd=False)
                              for descriptor, buffering in ((1, -1), (2, 1)))
    module = command[2]
    found = importlib.util.find_spec(module)
    assert found is not None and found.origin is not None
    sys.argv = [found.origin, *command[3:]]
    main = importlib.import_module(module).main
    with contextlib.suppress(Exception):
        assert rehearse is not None
        rehearse()
    _wait(gate)
    return main()


def _set_command_line(command: list[str]) -> bool:
    """Give this process its own command line, as ps, pgrep and killall show it. Return True if the kernel did so."""
    _libc.prctl(PR_SET_NAME, os.path.basename(command[0]).encode())
    line = b''.join(os.fsencode(argument) + b'\0' for argument in command)
    begin = _libc.malloc(len(line))
    ctypes.memmove(begin, line, len(line))
    try:
        # proc(5) counts its fields from 1. The fields are counted from the last bracket on, because field 2, a name in
        # brackets, may contain any character. Three zeros stand for the fields 0, 1 and 2.
        fields = ['0', '0', '0', *pathlib.Path('/proc/self/stat').read_text().rpartition(')')[2].split()]
        code, stack, data_and_heap, environment = (map(int, fields[first:end]) for first, end in (
            CODE_FIELDS, STACK_FIELDS, DATA_AND_HEAP_FIELDS, ENVIRONMENT_FIELDS))
        memory = PRCTL_MM_MAP.pack(*code, *data_and_heap, _libc.sbrk(0), *stack, begin, begin + len(line),
                                   *environment, NO_AUXILIARY_VECTOR, NO_AUXILIARY_SIZE, NO_FILE)
    except (OSError, ValueError, struct.error):
        return False
    return _libc.prctl(PR_SET_MM, PR_SET_MM_MAP, memory, len(memory), 0) == 0
