"""Nodes of a run as processes: direct children with their logs, ended in order, never left behind."""
import contextlib
import ctypes
import functools
import json
import os
import pathlib
import signal
import subprocess
import sys
import time
import typing

from pedestal_bringup.graph.child import Child
from pedestal_common.graph import nodes

SHOWN_LOG_LINES = 8
"""Number of log lines in an error."""
NODE_STOP_TIMEOUT_S = 20.0
"""Grace period of a node at its end [s]."""

RESERVED_LOG_BYTES = 64 * 1024
"""Disk space that a log reserves in advance, so that the cause of an end is stored even on a full disk [bytes]."""

FALLOC_FL_KEEP_SIZE = 1
"""Flag of fallocate(2): the reserved space does not count in the size of the file."""

SERVER_START_TIMEOUT_S = 60.0
"""Longest time from the start of a server to its announcement [s]."""

SERVER_POLL_PERIOD_S = 0.02
"""Period of the check for announcements at the start of a run [s]."""

SERVER_LOG_MODE = 0o600
"""Access to the log of a server: its user only, because the announcement of the page holds its tokens."""

_libc = ctypes.CDLL(None)


class RunError(RuntimeError):
    """Error of a run that ended too early; the message holds the node, the reason and its last log lines."""


class ServerProcess(typing.NamedTuple):
    """Server beside the nodes. first_lines: number of lines that it prints for the user when it serves."""
    command: list
    first_lines: int


def command_line(node, module, file):
    """Return the command that starts the module of a node, 'beam_2/acu' in the namespace of its beam, with a parameter
    file."""
    beam = nodes.beam_of(node)
    return [sys.executable, '-m', module, '--ros-args', *(['-r', f'__ns:=/{beam}'] if beam else []),
            '--params-file', str(file)]


@contextlib.contextmanager
def uninterrupted():
    """Ignore the signals that end `pedestal`, as a second Ctrl-C, during the clean stop."""
    before = {number: signal.signal(number, signal.SIG_IGN)
              for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _load_laws(scenario, node):
    """Load the laws of a node, unless they are not compiled."""
    from pedestal_common.compiled import is_compiled  # imported late, because only a run needs numba
    if scenario.row(node).unit:
        unit = scenario.unit(node)
        if is_compiled(unit):
            unit.prepare()


class Graph:
    """Processes of one run and their logs, beside the bag.

    Use it as a context, in which the nodes are held until `begin` (child.Child). The end of the context stops all
    processes that still run. No process outlives `pedestal run`, however `pedestal run` ends: the kernel sends the
    processes SIGTERM, and a reaper process kills any node that ignores SIGTERM.

    Beside the bag, the folder `log` holds NODE.log for each process, parameters.yaml, and NODE.state files with the
    last angles of a drive. The logs and states of an earlier run of the same name are deleted. Raises RunError when
    the folder cannot be written.
    """

    def __init__(self, scenario, bag, servers=None):
        self.scenario = scenario
        self.servers, self._unannounced = servers or {}, set()
        self.bag = pathlib.Path(bag)
        self.log = log_folder(bag)
        self.file = self.log / 'parameters.yaml'
        self.processes = {}
        self._log_starts = {}
        with self._disk_errors_named():
            self.log.mkdir(parents=True, exist_ok=True)
            for old_file in (*self.log.glob('*.log'), *self.log.glob('*.state')):
                old_file.unlink()

    @contextlib.contextmanager
    def _disk_errors_named(self):
        try:
            yield
        except OSError as error:
            raise RunError(f'cannot record to {self.bag}: {error.filename}: {error.strerror}') from None

    def __enter__(self):
        self._reaper = subprocess.Popen([sys.executable, '-m', 'pedestal_bringup.graph.reaper'], stdin=subprocess.PIPE,
                                        start_new_session=True)
        for node in self.scenario.nodes:
            if node != 'operator':     # the operator runs in this process (watch)
                self._hold(node)
        return self

    def __exit__(self, *_):
        self.stop()
        self._reaper.stdin.close()
        self._reaper.wait()

    def start_servers(self):
        """Start the servers, and wait until each is announced. Raises RunError for a server that ends instead.

        A server announces that it serves by the lines `NAME: address` at the beginning of its log.
        """
        for name in self.servers:
            self.start(name)
        deadline = time.monotonic() + SERVER_START_TIMEOUT_S
        while self._unannounced:
            time.sleep(SERVER_POLL_PERIOD_S)
            self.announce()
            for name in sorted(self._unannounced):
                code = self.processes[name].poll()
                if code is not None:
                    raise RunError(f'--{name}: {self.result(name).get("error", exit_description(code))}')
                if time.monotonic() > deadline:
                    raise RunError(f'--{name}: no announcement within {SERVER_START_TIMEOUT_S:g} s')

    def announce(self):
        """Print the announcements of the servers that have begun to serve since the last call."""
        for name in sorted(self._unannounced):
            lines = [line for line in self._lines(name) if line.startswith((f'{name}:', f'{name},'))]
            if len(lines) >= self.servers[name].first_lines:
                self._unannounced.remove(name)
                print(*lines, sep='\n', flush=True)

    def write(self, parameters):
        """Write the text of the ROS 2 parameter file with which every node starts."""
        with self._disk_errors_named():
            self.file.write_text(parameters)

    def begin(self, parameters):
        """Start the nodes with the text of their parameter file."""
        self.write(parameters)
        for node, process in self.processes.items():
            if node not in self.servers:
                process.begin()

    def start(self, node):
        """Start a server, or start a node again; the process appends to its log."""
        self._hold(node)
        self.processes[node].begin()

    def _hold(self, node):
        """Make the process of a node or server, held until its `begin`, and report it to the reaper."""
        with open(self._log_of(node), 'ab') as output:
            self._log_starts[node] = size = output.seek(0, os.SEEK_END)
            _libc.fallocate(output.fileno(), FALLOC_FL_KEEP_SIZE, ctypes.c_long(size),
                            ctypes.c_long(RESERVED_LOG_BYTES))
            if node in self.servers:
                os.fchmod(output.fileno(), SERVER_LOG_MODE)
                self._unannounced.add(node)
                command, rehearse = self.servers[node].command, lambda: None
            else:
                command = command_line(node, self.scenario.row(node).module, self.file)
                rehearse = functools.partial(_load_laws, self.scenario, node)
            self.processes[node] = Child(command, output.fileno(), rehearse)
        with contextlib.suppress(OSError):
            self._reaper.stdin.write(b'%d\n' % self.processes[node].pid)
            self._reaper.stdin.flush()

    def kill(self, node):
        """Kill the process of a node and wait for its end."""
        self.processes[node].kill()
        self.processes[node].wait()

    def stop(self):
        """Stop the nodes that still run; return True if each ends with exit code 0. The recorder ends last. In
        realtime the drive ends first, because it stops its axes while the other nodes are present."""
        first = [nodes.DRIVE_NODE] if self.scenario.header.pacing == 'realtime' else []
        others = [node for node in self.processes if node not in (*first, 'recorder')]
        with uninterrupted():
            return not any([code for group in (first, others, ['recorder']) for code in self._stop(group)])

    def _stop(self, names):
        """Stop these nodes and return their exit codes; a node that ignores SIGTERM is killed."""
        processes = [self.processes[node] for node in names if node in self.processes]
        for process in processes:
            if process.poll() is None:
                process.send_signal(signal.SIGTERM)
                process.send_signal(signal.SIGCONT)     # because a suspended process receives SIGTERM only after it
        deadline = time.monotonic() + NODE_STOP_TIMEOUT_S
        for process in processes:
            try:
                process.wait(max(deadline - time.monotonic(), 0.0))
            except subprocess.TimeoutExpired:
                process.kill()
        return [process.wait() for process in processes]

    def _log_of(self, node):
        return self.log / f'{node.replace("/", ".")}.log'

    def _lines(self, node):
        """Return the log of a node since its last start."""
        with open(self._log_of(node), 'rb') as log:
            log.seek(self._log_starts[node])
            return log.read().decode(errors='replace').strip().splitlines()

    def last_lines(self, node):
        """Return the end of a node's log, without its result."""
        return [line for line in self._lines(node) if not line.startswith('{')][-SHOWN_LOG_LINES:]

    def result(self, node):
        """Return the last JSON object in a node's log: its result, or the reason of its end (shell.main); {} without
        one."""
        for line in reversed(self._lines(node)):
            if line.startswith('{'):
                with contextlib.suppress(ValueError):
                    return json.loads(line)
        return {}

    def outcome(self, node):
        """Return the result of a node that has ended well. Raises RunError where it left none."""
        result = self.result(node)
        if not result:
            raise RunError(f'{node} ended without its result; its log is {self._log_of(node)}')
        return result

    def ended(self):
        """Return {node: exit code} of the processes that have ended."""
        return {node: process.returncode for node, process in self.processes.items() if process.poll() is not None}

    def exit_report(self, node, reason):
        """Return a text with the reason of a node's end and the last lines of its log."""
        log = '\n'.join(f'  | {line}' for line in self.last_lines(node)) or '  | (it logged nothing)'
        return f'{node} {reason}; its last log lines ({self._log_of(node)}):\n{log}'

    def cause(self, node, code):
        """Return the last log line of a node that ended by itself with this exit code, in brackets; '' of a killed
        node."""
        lines = self.last_lines(node)
        return f' ({lines[-1]})' if lines and code > 0 else ''


def exit_description(code):
    """Return how a process with this exit code ended, in words."""
    return f'died by signal {signal.Signals(-code).name}' if code < 0 else f'ended with exit code {code}'


def log_folder(bag):
    """Return the folder of the logs of a run beside its bag: BAG.log, or BAG.logs where BAG.log is a file.

    `pedestal run --bag dish > dish.log` makes such a file.
    """
    bag = pathlib.Path(bag)
    folder = bag.with_name(bag.name + '.log')
    return bag.with_name(bag.name + '.logs') if folder.is_file() else folder
