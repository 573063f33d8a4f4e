"""Supervisor of a realtime run: the antenna must go on, so a node that dies is started again, and a silent node is
killed first."""
import contextlib
import os
import signal
import subprocess
import sys
import time

from rclpy.executors import SingleThreadedExecutor

from pedestal_bringup.graph.processes import RunError, exit_description
from pedestal_bringup.graph.restarts import Losses, Restarts, Silence
from pedestal_common.compiled import is_compiled
from pedestal_common.graph import nodes
from pedestal_common.graph.steps import NS_PER_SECOND
from pedestal_recording.verify import count

RESTART_CUTOFF_S = 0.5
"""Time before the end of a run within which a dead node is not started again [s]."""

SHUTDOWN_GRACE_S = 20.0
"""Grace period of the drive after the end of the run [s]."""

MAX_SILENCE_S = 5.0
"""Time without diagnostics, which are published every second, after which a node is reported as silent [s]."""


def prepare(scenario):
    """Compile the laws that are not cached, of each node in a process of its own, so that the nodes start warm. Raises
    RunError."""
    units = {nodes.plain(node): node for node in scenario.nodes
             if scenario.row(node).unit and not is_compiled(scenario.unit(node))}
    processes = {node: subprocess.Popen([sys.executable, '-m', 'pedestal_bringup.loop.prepare', node, scenario.name],
                                        stdin=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                                        start_new_session=True) for node in units.values()}
    try:
        for process in processes.values():
            with contextlib.suppress(BrokenPipeError), process.stdin:
                process.stdin.write(scenario.as_yaml())
        for node, process in processes.items():
            errors = process.stderr.read()
            if process.wait() != 0:
                lines = errors.strip().splitlines()
                raise RunError(f'the laws of {node} do not compile: the process '
                               f'{exit_description(process.returncode)}' + (f'; {lines[-1]}' if lines else ''))
    finally:
        for process in processes.values():
            if process.poll() is None:
                # Because a second process of its group compiles too (prepare.compile_unit), the whole group is killed.
                os.killpg(process.pid, signal.SIGKILL)
            process.wait()
            process.stderr.close()


class Supervisor:
    """Supervisor of the processes of a graph whose time is 0 at start [ns UTC]."""

    def __init__(self, graph, operator, start):
        header = graph.scenario.header
        self._graph, self._operator = graph, operator
        self._start, self._end = start, start + round(header.duration * NS_PER_SECOND)
        self._limits = header.restart
        self.restarts, self._server_restarts = (
            Restarts(self._limits.attempts, self._limits.within, self._limits.delay) for _ in range(2))
        self._silence, self.losses = Silence(), Losses()
        self._reported_silent = set()
        self._dead = set()      # nodes whose restart is due, and servers that stay off
        operator.on_diagnostics = self._note

    def watch(self, tracks, progress):
        """Watch the nodes until the end of the run in UTC, which no restart prolongs. progress(time of the run [s]).

        Raises RunError when a node has died too often.
        """
        executor = SingleThreadedExecutor()
        executor.add_node(self._operator)
        self._operator.send(tracks)
        while self._is_running():
            executor.spin_once(timeout_sec=0.1)
            progress(min(max(time.time_ns() - self._start, 0), self._end - self._start) / NS_PER_SECOND)
            self.check_processes(time.monotonic())

    def _is_running(self):
        """Return True until the drive ends at the end of the run, at the latest until SHUTDOWN_GRACE_S after it. A
        missing drive ends the run at its end."""
        now, drive_runs = time.time_ns(), self._graph.processes[nodes.DRIVE_NODE].poll() is None
        if now < self._end:
            return drive_runs or not self._is_nearly_over()
        return drive_runs and now < self._end + SHUTDOWN_GRACE_S * NS_PER_SECOND

    def _is_nearly_over(self):
        return time.time_ns() > self._end - RESTART_CUTOFF_S * NS_PER_SECOND

    def check_processes(self, now):
        """Start dead nodes again, and kill nodes that were silent for too long. now: monotonic [s]."""
        self._silence.note_check(now)
        for node in self._silence.longer_than(min(MAX_SILENCE_S, self._limits.silence or MAX_SILENCE_S), now):
            if node not in self._reported_silent:
                self._reported_silent.add(node)
                report(f'{node} is silent')
        if self._limits.silence:     # 0: a silent node is reported, but not killed
            for node in self._silence.longer_than(self._limits.silence, now):
                self._graph.kill(node)
        for node, code in self._graph.ended().items():
            if node not in self._dead and not self._is_nearly_over():
                self._handle_exit(node, code, now)
        with contextlib.suppress(OSError):     # because a closed terminal does not end the run
            self._graph.announce()
        for node in (*self.restarts.due(now), *self._server_restarts.due(now)):
            self._dead.discard(node)
            self._graph.start(node)

    def _handle_exit(self, node, code, now):
        """Schedule the restart of a node that has died, or end the run. Raises RunError.

        A server that died too often stays off.
        """
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
            raise RunError(self._graph.exit_report(node, f'{reason}, after {limits.attempts} starts within '
                                                f'{limits.within:g} s'))
        report(f'{node} {reason}{self._graph.cause(node, code)}: starting it again, {number} of {limits.attempts} '
               f'within {limits.within:g} s')

    def _note(self, status, now):
        """Note a DiagnosticStatus that arrived at the time now [s]."""
        node = status.name
        self._silence.note(node, now)
        if node == nodes.DRIVE_NODE:
            for value in status.values:
                if value.key == 'lost_steps' and (lost := count(value.value)) is not None:
                    self.losses.note(lost, now)
        if node in self._reported_silent:
            self._reported_silent.discard(node)
            report(f'{node} publishes diagnostics again')


def report(line):
    """Print a line for people; a closed terminal does not end the run."""
    with contextlib.suppress(OSError):
        print(f'pedestal: {line}', file=sys.stderr, flush=True)
