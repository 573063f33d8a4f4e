"""Run a command that must end within a limit, and leave no process of it behind.

    python3 test/limited.py SECONDS COMMAND [ARGUMENT ...]

A command that takes longer is reported with all its processes and the Python stack of each, and killed; the exit code
is then 124. This needs the standard library only, for `make install` has a limit too; the stacks come by the py-spy
of .venv.
"""
import contextlib
import ctypes
import os
import pathlib
import signal
import subprocess
import sys
import time

PY_SPY = pathlib.Path(__file__).parents[1] / '.venv' / 'bin' / 'py-spy'
PR_SET_CHILD_SUBREAPER = 36

EXPIRED = 124
"""Exit code, as of timeout(1)."""

DUMP_TIME_S = 20.0
"""For the stack of one process."""

DEATH_TIME_S = 10.0
"""For a killed process to be gone, also one that waits for a disk."""


def children():
    """{pid: [pid of its children]} of all processes of the machine."""
    found = {}
    for process in pathlib.Path('/proc').glob('[0-9]*'):
        with contextlib.suppress(OSError):
            parent = int((process / 'stat').read_text().rpartition(')')[2].split()[1])
            found.setdefault(parent, []).append(int(process.name))
    return found


def descendants(pid):
    """[(depth, pid)] below a process, also those in sessions of their own: each parent before its children."""
    below = children()

    def walk(parent, depth):
        for child in sorted(below.get(parent, ())):
            yield depth, child
            yield from walk(child, depth + 1)
    return list(walk(pid, 0))


def kill(*pids):
    """SIGKILL to each that is there."""
    for pid in pids:
        with contextlib.suppress(ProcessLookupError):
            os.kill(pid, signal.SIGKILL)


def kill_tree(process):
    """Kill a Popen, its process group and all below it, and wait for its end."""
    below = [pid for _, pid in descendants(process.pid)]
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.kill()
    kill(*below)
    process.wait(DEATH_TIME_S)


def _command_line(pid):
    with contextlib.suppress(OSError):
        return pathlib.Path(f'/proc/{pid}/cmdline').read_text(errors='replace').replace('\0', ' ').strip()[:300]
    return ''


def _is_python(pid):
    with contextlib.suppress(OSError):
        return os.path.basename(os.readlink(f'/proc/{pid}/exe')).startswith('python')
    return False


def report():
    """Print the processes below this one, and where each interpreter of Python stands."""
    below = descendants(os.getpid())
    for depth, pid in below:
        print(f'{"  " * depth}{pid} {_command_line(pid)}', file=sys.stderr)
    for _, pid in below:
        if _is_python(pid) and PY_SPY.exists():
            with contextlib.suppress(subprocess.TimeoutExpired):
                dump = subprocess.run([PY_SPY, 'dump', '--pid', str(pid)], stdin=subprocess.DEVNULL, text=True,
                                      stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=DUMP_TIME_S)
                print(f'\n{dump.stdout}', file=sys.stderr)
    sys.stderr.flush()


def _reap(pid):
    """Bury who has died, orphans too; the exit code of this child among them, else None."""
    code = None
    with contextlib.suppress(ChildProcessError):
        while (dead := os.waitpid(-1, os.WNOHANG))[0]:
            if dead[0] == pid:
                code = os.waitstatus_to_exitcode(dead[1])
    return code


def _kill_all():
    """Kill whoever is below this process, until nobody is."""
    end = time.monotonic() + DEATH_TIME_S
    while (below := descendants(os.getpid())) and time.monotonic() < end:
        kill(*(pid for _, pid in below))
        time.sleep(0.02)
        _reap(0)


def main(limit, *command):
    """The exit code of a command, EXPIRED where it takes longer than limit [s]."""
    # Orphans become children of this process, so that none is lost.
    ctypes.CDLL(None).prctl(PR_SET_CHILD_SUBREAPER, 1)
    # Ctrl-C is for the command, which ends in order; whoever ends this process ends the command.
    signal.signal(signal.SIGINT, lambda *_: None)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(128 + signal.SIGTERM))
    end = time.monotonic() + float(limit)
    process = subprocess.Popen(command)     # held: it would take the exit code with it
    try:
        while (code := _reap(process.pid)) is None and time.monotonic() < end:
            time.sleep(0.05)
        if code is None:
            print(f'\n{" ".join(command)}: not ended after {float(limit):g} s. Its processes:', file=sys.stderr)
            report()
            return EXPIRED
        for _, left in descendants(os.getpid()):
            print(f'left behind and killed: {left} {_command_line(left)}', file=sys.stderr)
        return code if code >= 0 else 128 - code
    finally:
        _kill_all()


if __name__ == '__main__':
    sys.exit(main(*sys.argv[1:]))
