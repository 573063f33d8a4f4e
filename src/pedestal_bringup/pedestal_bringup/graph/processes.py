"""Processes of a run: `pedestal run` starts each node as its direct child with a log of its own, ends the nodes in
order, and leaves none behind."""
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
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from typing import TYPE_CHECKING, NamedTuple

from pedestal_bringup.graph import own_programs
from pedestal_bringup.graph.child import Child
from pedestal_common.graph import nodes
from pedestal_common.node import run
from pedestal_common.quantities import Json

if TYPE_CHECKING:
    from pedestal_bringup.scenario.scenario import Scenario

SHOWN_LOG_LINES = 8  # largest number of log lines in an error
NODE_STOP_TIMEOUT_S = 20.0  # grace period of a node from SIGTERM to SIGKILL [s]

RESERVED_LOG_BYTES = 64 * 1024
"""Disk space that a log reserves in advance [bytes]. A node can then log the cause of its end even on a full disk."""

FALLOC_FL_KEEP_SIZE = 1  # flag of fallocate(2): the reserved space does not count in the size of the file

SERVER_START_TIMEOUT_S = 60.0
"""Longest time from the start of a server to its announcement, the lines that state its address [s]."""

SERVER_POLL_PERIOD_S = 0.02  # period of the check for announcements at the start of a run [s]

SERVER_LOG_MODE = 0o600
"""File mode of the log of a server: only its user may read it, because the announcement of the page holds the access
tokens."""

_libc = ctypes.CDLL(None)


class ServerProcess(NamedTuple):
    """Process of a server beside the nodes (operator_servers)."""
    command: list[str]      # as run.command makes it
    first_lines: int        # number of lines that the server prints for the user when it begins to serve


def command_line(node: str, executable: str, file: pathlib.Path) -> list[str]:
    """Return the command that starts a node with a parameter file, beam_2/acu in the namespace beam_2."""
    beam = nodes.beam_of(node)
    return run.command(executable, '--ros-args', *(['-r', f'__ns:=/{beam}'] if beam else []), '--params-file',
                       str(file))


@contextlib.contextmanager
def uninterrupted() -> Iterator[None]:
    """Ignore the signals that end `pedestal` in this context, so that a second Ctrl-C does not interrupt the stop."""
    before = {number: signal.signal(number, signal.SIG_IGN)
              for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _load_node(scenario: 'Scenario', node: str) -> None:
    """Import the class of a node, and load its laws if they are in the law cache."""
    from pedestal_common.compiled import is_compiled  # imported late, because only a run needs numba
    scenario.row(node).node_type()
    if scenario.row(node).unit:
        unit = scenario.unit(node)
        if is_compiled(unit):
            unit.prepare()


def _load_server(command: list[str]) -> None:
    nodes.EXECUTABLES[command[3]].node_type()


class Graph:
    """Processes of the nodes and servers of one run, with their logs, as a context.

    The nodes are held (child.Child) from its beginning until `begin`. Its end stops all processes that still run. No
    process outlives `pedestal run`, however it ends: the kernel sends the processes SIGTERM, and the reaper, a process
    of its own, kills any node that ignores SIGTERM.

    The folder BAG.log beside the bag holds NODE.log for each process, parameters.yaml, and NODE.state with the last
    angles of a drive. Those of an earlier run of the same name are deleted. Raises RuntimeError if the folder cannot
    be written, ValueError for a missing program of the user.
    """
    log: pathlib.Path

    def __init__(self, scenario: 'Scenario', bag: str | pathlib.Path,
                 servers: Mapping[str, ServerProcess] | None = None) -> None:
        self.scenario = scenario
        self.servers = servers or {}
        self._unannounced: set[str] = set()
        self.bag = pathlib.Path(bag)
        self.log = log_folder(bag)
        self.file = self.log / 'parameters.yaml'
        self._own = {node: own_programs.command(program, node, self.file) for node, program in scenario.own.items()}
        self.processes: dict[str, Child] = {}
        self._begun: set[str] = set()
        self._log_starts: dict[str, int] = {}
        with self._disk_errors_named():
            self.log.mkdir(parents=True, exist_ok=True)
            for old_file in (*self.log.glob('*.log'), *self.log.glob('*.state')):
                old_file.unlink()

    @contextlib.contextmanager
    def _disk_errors_named(self) -> Iterator[None]:
        """Turn the OSErrors in this context into a RuntimeError that names the bag and the file."""
        try:
            yield
        except OSError as error:
            raise RuntimeError(f'cannot record to {self.bag}: {error.filename}: {error.strerror}') from None

    def __enter__(self) -> 'Graph':
        self._reaper = subprocess.Popen([sys.executable, '-m', 'pedestal_bringup.graph.reaper'], stdin=subprocess.PIPE,
                                        start_new_session=True)
        assert self._reaper.stdin is not None
        self._reaper_input = self._reaper.stdin
        for node in self.scenario.nodes:
            if node != 'operator':     # the operator runs in this process (watch)
                self._hold(node)
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()
        self._reaper_input.close()
        self._reaper.wait()

    def start_servers(self) -> None:
        """Start the servers, and wait until each has announced itself by lines `NAME: address` or `NAME, ...` in its
        log. Raises RuntimeError for a server that ends instead."""
        for name in self.servers:
            self.start(name)
        deadline = time.monotonic() + SERVER_START_TIMEOUT_S
        while self._unannounced:
            time.sleep(SERVER_POLL_PERIOD_S)
            self.announce()
            for name in sorted(self._unannounced):
                code = self.processes[name].poll()
                if code is not None:
                    raise RuntimeError(f'--{name}: {self.result(name).get("error", exit_description(code))}')
                if time.monotonic() > deadline:
                    raise RuntimeError(f'--{name}: the server has not started within {SERVER_START_TIMEOUT_S:g} s; '
                                       f'its log is {self._log_of(name)}')

    def announce(self) -> None:
        """Print the announcements of the servers that have announced themselves since the last call."""
        for name in sorted(self._unannounced):
            lines = [line for line in self._lines(name) if line.startswith((f'{name}:', f'{name},'))]
            if len(lines) >= self.servers[name].first_lines:
                self._unannounced.remove(name)
                print(*lines, sep='\n', flush=True)

    def write(self, parameters: str) -> None:
        """Write the ROS 2 parameter file with which every node starts."""
        with self._disk_errors_named():
            self.file.write_text(parameters)

    def begin(self, parameters: str, names: Collection[str] | None = None) -> None:
        """Start the held nodes `names`, or all that do not run yet, with the text of a parameter file."""
        self.write(parameters)
        for node, process in self.processes.items():
            if node not in self.servers and node not in self._begun and (names is None or node in names):
                self._begun.add(node)
                process.begin()

    def start(self, node: str) -> None:
        """Start a server, or start a node again. The new process appends to the log of the earlier process."""
        self._hold(node)
        self.processes[node].begin()

    def _hold(self, node: str) -> None:
        rehearse: Callable[[], object] | None
        with open(self._log_of(node), 'ab') as output:
            self._log_starts[node] = size = output.seek(0, os.SEEK_END)
            _libc.fallocate(output.fileno(), FALLOC_FL_KEEP_SIZE, ctypes.c_long(size),
                            ctypes.c_long(RESERVED_LOG_BYTES))
            if node in self.servers:
                os.fchmod(output.fileno(), SERVER_LOG_MODE)
                self._unannounced.add(node)
                command = self.servers[node].command

                rehearse = functools.partial(_load_server, command)
            elif node in self.scenario.own:
                command, rehearse = self._own[node], None
            else:
                command = command_line(node, self.scenario.row(node).executable, self.file)
                rehearse = functools.partial(_load_node, self.scenario, node)
            self.processes[node] = Child(command, output.fileno(), rehearse)
        with contextlib.suppress(OSError):
            self._reaper_input.write(b'%d\n' % self.processes[node].pid)
            self._reaper_input.flush()

    def kill(self, node: str) -> None:
        """Kill the process of a node and wait for its end."""
        self.processes[node].kill()
        self.processes[node].wait()

    def stop(self) -> bool:
        """Stop the processes that still run, and return True if every process has ended with exit code 0, except the
        programs of the user, whose codes may be any. The recorder ends last. In realtime the drive ends first, so that
        it stops its axes while the other nodes are still present."""
        first = [nodes.DRIVE_NODE] if self.scenario.header.pacing == 'realtime' else []
        others = [node for node in self.processes if node not in (*first, 'recorder')]
        with uninterrupted():
            return not any([code for group in (first, others, ['recorder']) for code in self._stop(group)])

    def _stop(self, names: Iterable[str]) -> list[int]:
        """Stop processes together, and return the exit codes of the nodes; kill one that ignores SIGTERM for
        NODE_STOP_TIMEOUT_S."""
        processes = {node: self.processes[node] for node in names if node in self.processes}
        for process in processes.values():
            if process.poll() is None:
                process.send_signal(signal.SIGTERM)
                # A suspended process acts on SIGTERM only after SIGCONT.
                process.send_signal(signal.SIGCONT)
        deadline = time.monotonic() + NODE_STOP_TIMEOUT_S
        for process in processes.values():
            try:
                process.wait(max(deadline - time.monotonic(), 0.0))
            except subprocess.TimeoutExpired:
                process.kill()
        codes = {node: process.wait() for node, process in processes.items()}
        return [code for node, code in codes.items() if node not in self.scenario.own]

    def _log_of(self, node: str) -> pathlib.Path:
        return self.log / f'{node.replace("/", ".")}.log'

    def _lines(self, node: str) -> list[str]:
        with open(self._log_of(node), 'rb') as log:
            log.seek(self._log_starts[node])
            return log.read().decode(errors='replace').strip().splitlines()

    def last_lines(self, node: str) -> list[str]:
        """Return the last lines of a node's log, at most SHOWN_LOG_LINES, without the JSON line of its result."""
        return [line for line in self._lines(node) if not line.startswith('{')][-SHOWN_LOG_LINES:]

    def result(self, node: str) -> dict[str, Json]:
        """Return the last JSON object in a node's log: its result or the reason of its end (shell.main), or {}."""
        for line in reversed(self._lines(node)):
            if line.startswith('{'):
                with contextlib.suppress(ValueError):
                    return json.loads(line)
        return {}

    def outcome(self, node: str) -> dict[str, Json]:
        """Return the result of a node that has ended without error. Raises RuntimeError if its log has no result."""
        result = self.result(node)
        if not result:
            raise RuntimeError(f'{node} ended without its result; its log is {self._log_of(node)}')
        return result

    def ended(self) -> dict[str, int]:
        """Return {node: exit code} of the processes that have ended."""
        return {node: code for node, process in self.processes.items() if (code := process.poll()) is not None}

    def exit_report(self, node: str, reason: str) -> str:
        """Return the text of an error: the node, the reason of its end, and the last lines of its log."""
        log = '\n'.join(f'  | {line}' for line in self.last_lines(node)) or '  | (it logged nothing)'
        return f'{node} {reason}; its last log lines ({self._log_of(node)}):\n{log}'

    def cause(self, node: str, code: int) -> str:
        """Return the last log line of a node in brackets, if the node ended by itself with an error; else ''."""
        lines = self.last_lines(node)
        return f' ({lines[-1]})' if lines and code > 0 else ''


def exit_description(code: int) -> str:
    """Return a text that states how a process with this exit code ended, for example `died by signal SIGKILL`."""
    return f'died by signal {signal.Signals(-code).name}' if code < 0 else f'ended with exit code {code}'


def log_folder(bag: str | pathlib.Path) -> pathlib.Path:
    """Return the folder of the logs of a run: BAG.log, or BAG.logs where BAG.log is a file, as `pedestal run --bag
    dish > dish.log` makes it."""
    bag = pathlib.Path(bag)
    folder = bag.with_name(bag.name + '.log')
    return bag.with_name(bag.name + '.logs') if folder.is_file() else folder
