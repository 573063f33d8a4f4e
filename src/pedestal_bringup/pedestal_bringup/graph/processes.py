"""The nodes of a run as processes: direct children with their logs, told to end in order, never left behind."""
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
NODE_STOP_TIMEOUT_S = 20.0

RESERVED_LOG_BYTES = 64 * 1024
"""Bytes of the disk that a log holds in advance, so that the cause of an end is kept also when it is full by then."""

FALLOC_FL_KEEP_SIZE = 1

SERVER_START_TIMEOUT_S = 60.0
"""Longest time from the start of a server to its announcement [s]."""

SERVER_POLL_PERIOD_S = 0.02
"""Period of the check for announcements at the start of a run [s]."""

SERVER_LOG_MODE = 0o600
"""Access to the log of a server: its user only, because the announcement of the page holds its tokens."""

_libc = ctypes.CDLL(None)


class RunError(RuntimeError):
    """A run ended before its time; the message names the node, the reason and its last log lines."""


class ServerProcess(typing.NamedTuple):
    """Server beside the nodes. first_lines: number of lines that it prints for the user when it serves."""
    command: list
    first_lines: int


def command_line(node, module, file):
    """What starts the module of a node, 'beam_2/acu' in the namespace of its beam, with a parameter file."""
    beam = nodes.beam_of(node)
    return [sys.executable, '-m', module, '--ros-args', *(['-r', f'__ns:=/{beam}'] if beam else []),
            '--params-file', str(file)]


@contextlib.contextmanager
def uninterrupted():
    """A second Ctrl-C, or whatever else ends `pedestal`, does not cut the clean stop short."""
    before = {number: signal.signal(number, signal.SIG_IGN)
              for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _load_laws(scenario, node):
    """Load the laws of a node, unless they are still to be compiled."""
    from pedestal_common.compiled import is_compiled  # with numba, which only a run needs
    if scenario.row(node).unit:
        unit = scenario.unit(node)
        if is_compiled(unit):
            unit.prepare()


class Graph:
    """The processes of one run and their logs, beside the bag. Use as a context, in which they are held until `begin`:
    leaving it stops whatever still runs.

    They do not outlive `pedestal run`, however that ends: the kernel sends them SIGTERM then, and who does not listen
    to it is ended by a process of its own (reaper).
    Raises RunError when there is no writing beside the bag.
    """

    def __init__(self, scenario, bag, servers=None):
        self.scenario = scenario
        self.servers, self._unannounced = servers or {}, set()
        self.bag = pathlib.Path(bag)
        self.log = log_folder(bag)
        self.file = self.log / 'parameters.yaml'
        self.processes = {}
        self._log_starts = {}
        with self._beside_the_bag():
            self.log.mkdir(parents=True, exist_ok=True)
            for left in (*self.log.glob('*.log'), *self.log.glob('*.state')):
                left.unlink()

    @contextlib.contextmanager
    def _beside_the_bag(self):
        try:
            yield
        except OSError as error:
            raise RunError(f'cannot record to {self.bag}: {error.filename}: {error.strerror}') from None

    def __enter__(self):
        self._reaper = subprocess.Popen([sys.executable, '-m', 'pedestal_bringup.graph.reaper'], stdin=subprocess.PIPE,
                                        start_new_session=True)
        for node in self.scenario.nodes:
            if node != 'operator':
                self._hold(node)
        return self

    def __exit__(self, *_):
        self.stop()
        self._reaper.stdin.close()
        self._reaper.wait()

    def start_servers(self):
        """Start the servers, and wait until each is announced. Raises RunError for a server that ends instead."""
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
        """The text of the ROS 2 parameter file with which every node starts."""
        with self._beside_the_bag():
            self.file.write_text(parameters)

    def begin(self, parameters):
        """Start the nodes with the text of their parameter file."""
        self.write(parameters)
        for node, process in self.processes.items():
            if node not in self.servers:
                process.begin()

    def start(self, node):
        """Start a node again, which goes on in its log."""
        self._hold(node)
        self.processes[node].begin()

    def _hold(self, node):
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
        """Ask the nodes that still run to end; whether each ends with exit code 0. The recorder ends last, and in
        realtime the drive first: it stops its axes while the others are there."""
        first = [nodes.DRIVE_NODE] if self.scenario.header.pacing == 'realtime' else []
        others = [node for node in self.processes if node not in (*first, 'recorder')]
        with uninterrupted():
            return not any([code for group in (first, others, ['recorder']) for code in self._stop(group)])

    def _stop(self, names):
        """Their exit codes; who does not listen is killed."""
        processes = [self.processes[node] for node in names if node in self.processes]
        for process in processes:
            if process.poll() is None:
                process.send_signal(signal.SIGTERM)
                process.send_signal(signal.SIGCONT)
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
        """What a node said since its last start."""
        with open(self._log_of(node), 'rb') as log:
            log.seek(self._log_starts[node])
            return log.read().decode(errors='replace').strip().splitlines()

    def last_lines(self, node):
        """The end of a node's log, its result left out."""
        return [line for line in self._lines(node) if not line.startswith('{')][-SHOWN_LOG_LINES:]

    def result(self, node):
        """The last JSON object in a node's log: its result, or why it ended (shell.main); {} where there is none."""
        for line in reversed(self._lines(node)):
            if line.startswith('{'):
                with contextlib.suppress(ValueError):
                    return json.loads(line)
        return {}

    def outcome(self, node):
        """The result of a node that has ended well. Raises RunError where it left none."""
        result = self.result(node)
        if not result:
            raise RunError(f'{node} ended without its result; its log is {self._log_of(node)}')
        return result

    def ended(self):
        """{node: exit code} of the processes that have ended."""
        return {node: process.returncode for node, process in self.processes.items() if process.poll() is not None}

    def obituary(self, node, reason):
        """A text that says what became of a node, with the last lines of its log."""
        log = '\n'.join(f'  | {line}' for line in self.last_lines(node)) or '  | (it logged nothing)'
        return f'{node} {reason}; its last log lines ({self._log_of(node)}):\n{log}'

    def cause(self, node, code):
        """Why a node that ended by itself with this exit code did, as it said, in brackets; '' of one that was
        killed."""
        lines = self.last_lines(node)
        return f' ({lines[-1]})' if lines and code > 0 else ''


def exit_description(code):
    """How a process with this exit code ended."""
    return f'died by signal {signal.Signals(-code).name}' if code < 0 else f'ended with exit code {code}'


def log_folder(bag):
    """Where the logs of a run lie, beside its bag."""
    bag = pathlib.Path(bag)
    return bag.with_name(bag.name + '.log')
