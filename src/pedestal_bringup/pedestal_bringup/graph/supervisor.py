"""Supervisor of the nodes of a realtime run. Because the antenna must continue, the supervisor starts a dead node
again. It kills a node that was silent for too long, and then starts this node again."""
import contextlib
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Mapping

from rclpy.executors import SingleThreadedExecutor

from pedestal_bringup.graph.operator_node import Operator
from pedestal_bringup.graph.processes import Graph, exit_description
from pedestal_bringup.graph.restarts import Losses, Restarts, Silence
from pedestal_bringup.scenario.scenario import Scenario
from pedestal_common.compiled import is_compiled
from pedestal_common.graph import nodes
from pedestal_common.graph.steps import NS_PER_SECOND
from pedestal_common.node import middleware
from pedestal_common.quantities import Message, Nanoseconds, Seconds
from pedestal_recording.verify import count

RESTART_CUTOFF_S = 0.5  # time before the end of a run within which a dead node is not started again [s]
SHUTDOWN_GRACE_S = 20.0  # grace period of the drive after the end of the run [s]
OWN_DRIVE_GRACE_S = 1.0  # time after the end of the run in which a drive of the user makes its last step [s]

MAX_SILENCE_S = 5.0
"""Time without diagnostics after which a node is reported as silent [s]. A node publishes diagnostics every second."""


def prepare(scenario: Scenario) -> None:
    """Compile the laws of the nodes that are not in the law cache, each node in its own process.

    Raises RuntimeError.
    """
    units = {nodes.plain(node): node for node in scenario.nodes
             if node not in scenario.own and scenario.row(node).unit and not is_compiled(scenario.unit(node))}
    processes = {node: subprocess.Popen([sys.executable, '-m', 'pedestal_bringup.loop.prepare', node, scenario.name],
                                        stdin=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                                        start_new_session=True) for node in units.values()}
    try:
        for process in processes.values():
            assert process.stdin is not None
            with contextlib.suppress(BrokenPipeError), process.stdin:
                process.stdin.write(scenario.as_yaml())
        for node, process in processes.items():
            assert process.stderr is not None
            errors = process.stderr.read()
            if process.wait() != 0:
                lines = errors.strip().splitlines()
                raise RuntimeError(f'the laws of {node} do not compile: the process '
                                   f'{exit_description(process.returncode)}' + (f'; {lines[-1]}' if lines else ''))
    finally:
        for process in processes.values():
            if process.poll() is None:
                process.kill()
            process.wait()
            if process.stderr is not None:
                process.stderr.close()


class Supervisor:
    """Supervisor of the processes of a running graph. operator: receives the diagnostics; start: time 0, UTC."""

    def __init__(self, graph: Graph, operator: Operator, start: Nanoseconds) -> None:
        header = graph.scenario.header
        self._graph, self._operator = graph, operator
        self._start, self._end = start, start + round(header.duration * NS_PER_SECOND)
        self._limits = header.restart
        self.restarts, self._server_restarts = (
            Restarts(self._limits.attempts, self._limits.within, self._limits.delay) for _ in range(2))
        self._silence, self.losses = Silence(), Losses()
        self._reported_silent: set[str] = set()
        self._dead: set[str] = set()    # nodes whose restart is due, and servers that stay off
        operator.on_diagnostics = self._note

    def watch(self, tracks: Mapping[str, Message], progress: Callable[[Seconds], object]) -> None:
        """Watch the nodes until the end of the run, a UTC that a restart does not move. The program tracks are sent
        first. Raises RuntimeError if a node has died too often."""
        executor = SingleThreadedExecutor()
        executor.add_node(self._operator)
        self._operator.send(tracks)
        while self._is_running():
            middleware.turn(executor, 0.1)
            progress(min(max(time.time_ns() - self._start, 0), self._end - self._start) / NS_PER_SECOND)
            self.check_processes(time.monotonic())

    def _is_running(self) -> bool:
        """Return True until the drive has ended at the end of the run, at the latest SHUTDOWN_GRACE_S after it. A
        drive that is dead shortly before the end is not started again, and also ends the run. A drive of the user does
        not end by itself."""
        grace = OWN_DRIVE_GRACE_S if nodes.DRIVE_NODE in self._graph.scenario.own else SHUTDOWN_GRACE_S
        now, drive_runs = time.time_ns(), self._graph.processes[nodes.DRIVE_NODE].poll() is None
        if now < self._end:
            return drive_runs or not self._is_nearly_over()
        return drive_runs and now < self._end + grace * NS_PER_SECOND

    def _is_nearly_over(self) -> bool:
        return time.time_ns() > self._end - RESTART_CUTOFF_S * NS_PER_SECOND

    def check_processes(self, now: Seconds) -> None:
        """Start dead nodes again when their restart is due, and kill nodes that were silent for too long."""
        self._silence.note_check(now)
        for node in self._silence.longer_than(min(MAX_SILENCE_S, self._limits.silence or MAX_SILENCE_S), now):
            if node not in self._reported_silent:
                self._reported_silent.add(node)
                report(f'{node} is silent')
        if self._limits.silence:     # With the parameter silence = 0 a silent node is reported, but not killed.
            for node in self._silence.longer_than(self._limits.silence, now):
                self._graph.kill(node)
        for node, code in self._graph.ended().items():
            if node not in self._dead and not self._is_nearly_over():
                self._handle_exit(node, code, now)
        with contextlib.suppress(OSError):     # A closed terminal must not end the run.
            self._graph.announce()
        for node in (*self.restarts.due(now), *self._server_restarts.due(now)):
            self._dead.discard(node)
            self._graph.start(node)

    def _handle_exit(self, node: str, code: int, now: Seconds) -> None:
        """Schedule the restart of a node or server that has died. Raises RuntimeError, which ends the run, if a node
        has died too often. A server that has died too often stays off."""
        limits = self._limits
        reason = ('was silent and was killed' if node in self._reported_silent and code == -signal.SIGKILL
                  else exit_description(code))
        self._dead.add(node)
        self._reported_silent.discard(node)
        self._silence.remove(node)
        server = node in self._graph.servers
        if not server:
            self.losses.note_death(now)
        number = (self._server_restarts if server else self.restarts).note_death(node, now)     # 0: too many deaths
        if not number and server:
            report(f'{node} {reason}{self._graph.cause(node, code)}, after {limits.attempts} starts within '
                   f'{limits.within:g} s: it stays off')
            return
        if not number:
            raise RuntimeError(self._graph.exit_report(node, f'{reason}, after {limits.attempts} starts within '
                                                       f'{limits.within:g} s'))
        report(f'{node} {reason}{self._graph.cause(node, code)}: starting it again, {number} of {limits.attempts} '
               f'within {limits.within:g} s')

    def _note(self, status: Message, now: Seconds) -> None:
        node = status.name
        self._silence.note(node, now)
        if node == nodes.DRIVE_NODE:
            for value in status.values:
                if value.key == 'lost_steps' and (lost := count(value.value)) is not None:
                    self.losses.note(lost, now)
        if node in self._reported_silent:
            self._reported_silent.discard(node)
            report(f'{node} publishes diagnostics again')


def report(line: str) -> None:
    """Print a line for the user on stderr. A closed terminal does not end the run."""
    with contextlib.suppress(OSError):
        print(f'pedestal: {line}', file=sys.stderr, flush=True)
