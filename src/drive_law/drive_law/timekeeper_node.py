"""Node that owns the time of the drive: clock, steps and pacing.

A port (unit_node.Port, in `self.ports`) connects one unit to its topics: one drive, or each beam of an array.
"""
import time
from collections.abc import Callable, Mapping
from typing import Protocol, cast

from rclpy.executors import Executor

from drive_law.params import RunParameters
from pedestal_common.graph.nodes import Node
from pedestal_common.graph.steps import NS_PER_SECOND
from pedestal_common.node import unit_node
from pedestal_common.node.unit import Diagnosis, Unit
from pedestal_common.quantities import Nanoseconds
from pedestal_common.wire.records import Decoded

ACKNOWLEDGE_INTERVAL_STEPS = 1000
"""Number of lockstep steps between two waits for the acknowledgement of all messages by all subscribers.

Because the queue of a subscriber holds 5000 messages (Fast DDS), a slow recorder slows the run but loses nothing.
"""

MAX_WAIT_S = 0.1
"""Longest wait between two readings of the UTC clock [s]. A step of that clock is noticed within this time."""

MIN_RECEIVE_FRACTION = 0.25
"""Smallest share of a period for receiving messages in realtime, also for a drive that is late for its next step."""


class DriveUnit(Unit, Protocol):
    """Unit that a Timekeeper runs: a drive."""
    COMMAND: str    # topic of its commands

    @property
    def rests(self) -> bool:
        """True if the axes stand still without torque."""


def unit_of(port: unit_node.Port) -> DriveUnit:
    """Return the unit of a port."""
    return cast(DriveUnit, port.unit)   # the modules of its subclasses name only drives


class Timekeeper(unit_node.UnitNode):
    """Node that makes the steps. Step k uses the messages of step k - 1 and publishes the state at t_k.

    In lockstep, step k begins when all nodes have answered step k - 1. In realtime, step k begins k periods after the
    start time, the epoch (UTC).
    """
    parameters: RunParameters
    missed_steps: int       # steps that were not made in their period, because the node was late
    lost_steps: int         # missed steps, and steps without the command of the previous step
    late_ticks: int         # steps that began more than half a period late

    FIRST_STEP = 0
    """Number of the first step of realtime; a step before 0 publishes nothing."""

    PRECEDENCE = 1
    """Priority above that of the other nodes, whose searches and predictions may take longer than a step."""

    def __init__(self, row: Node) -> None:
        super().__init__(row, serves_beams=True)

    def begin(self) -> None:
        """Begin the steps, which define the time of the graph."""
        p = self.parameters
        self.period_ns = round(p.period * NS_PER_SECOND)
        self.last_step = round(p.duration / p.period) if p.duration > 0.0 else None
        self.stopping = False
        self._count_from_first_step()
        # {topic: age of its data at the step [s]} of the inputs of all units
        latencies = {port.named(name): latency for port in self.ports
                     for name, latency in port.unit.latencies.items()}
        self.commands = [port.named(unit_of(port).COMMAND) for port in self.ports]
        if self.graph.lockstep:
            self.follow(self.unit.trigger, latencies)
            # The timer calls `start` once, as soon as the executor of the node runs.
            self.timer = self.every(0.001, self.start)
        else:
            self.wait, self.guarded_step = 0.0, self._guarded(self.make_due_step)
            for port in self.ports:
                for name, decoder in port.decoders.items():
                    if name != self.unit.trigger:
                        self.reader(name, unit_node.decoding(decoder), self._newest_receiver(name))

    def _count_from_first_step(self) -> None:
        self.k, self.made = (-1 if self.graph.lockstep else self.FIRST_STEP - 1), 0
        self.lost_steps = self.missed_steps = self.late_ticks = 0
        self.newest: dict[str, Decoded] = {}
        self.command_stamps: dict[str, Nanoseconds] = {}
        self.begun = self.last_step_time = time.monotonic_ns()

    def restart(self) -> None:
        """Begin the steps of lockstep again, for another replay."""
        super().restart()
        self._count_from_first_step()
        self.timer = self.every(0.001, self.start)

    @property
    def awaits(self) -> str:
        """Condition for the first step."""
        if self.graph.lockstep:
            return 'the subscribers of its topics'
        _, now = self.clock()
        return f'the start time, in {max(self.epoch(now) - now, 0) / NS_PER_SECOND:.1f} s'

    def start(self) -> None:
        """Begin step 0 of lockstep, when the graph is complete. `answer` makes the step."""
        self.timer.cancel()
        self.await_graph()
        assert self.steps
        self.steps.take(self.unit.trigger, 0, (0, ()))

    def answer(self, stamp: Nanoseconds, values: Mapping[str, Decoded | None]) -> None:
        """Make the next step of lockstep, when all nodes have answered the previous step, whose number is self.k.

        The step after the new one is announced to `self.steps`, which waits for the answers to the new step and then
        calls this method again.
        """
        if self.k == self.last_step:     # all nodes have answered the last step
            self.end()
            return
        if self.k == 0:
            self.begun = time.monotonic_ns()
        self.k += 1
        self._make(stamp, values)
        assert self.steps
        self.steps.take(self.unit.trigger, stamp + self.period_ns, (stamp + self.period_ns, ()))

    def _make(self, stamp: Nanoseconds, values: Mapping[str, Decoded | None]) -> None:
        """Make the step number self.k with the messages of the previous step."""
        for port in self.ports:
            port.step(stamp, values)
        if self.k < 0:
            return
        self.begin_step(stamp)
        self.made += 1
        if self.graph.lockstep and self.k % ACKNOWLEDGE_INTERVAL_STEPS == 0:
            self.await_acknowledged()
        for port in self.ports:
            port.publish()
        self.after_step()

    def spin(self, executor: Executor) -> None:
        """Receive messages until the next step of realtime, then make it.

        This avoids a timer of rclpy. At each reset of a timer, EventsExecutor (rclpy 7.1.6) queues all due timers
        again, also those that its queue already holds. In a drive too slow for its steps, the queue would grow without
        limit, and messages would wait for minutes.
        """
        if self.graph.lockstep:
            super().spin(executor)
            return
        end = time.monotonic() + self.wait
        while self.failure is None and (left := end - time.monotonic()) > 0.0:
            executor.spin_once(timeout_sec=left)
        if self.failure is None:
            self.guarded_step()

    def make_due_step(self) -> None:
        """Make the due step of realtime, unless it was made, and set the wait for the next step."""
        now, utc = self.clock()
        start = self.epoch(utc)
        k, min_wait = (utc - start) // self.period_ns, 0.0
        if k >= self.FIRST_STEP and k > self.k:
            self._make_realtime_step(k, start + k * self.period_ns, now)
            min_wait = MIN_RECEIVE_FRACTION * self.parameters.period
        _, utc = self.clock()
        wait = (start + (max(k, self.k) + 1) * self.period_ns - utc) / NS_PER_SECOND
        self.wait = min(max(wait, min_wait), MAX_WAIT_S)

    def _make_realtime_step(self, k: int, stamp: Nanoseconds, now: Nanoseconds) -> None:
        """Make step k. now: time of the monotonic clock. Skipped earlier steps are not published. They count as missed
        and as lost."""
        previous_stamp = stamp - self.period_ns
        if self.made:
            periods = (now - self.last_step_time) / self.period_ns
            missed = max(round(periods) - 1, 0)
            self.missed_steps += missed
            self.late_ticks += periods > 1.5
            self.lost_steps += missed + any(command_stamp < previous_stamp
                                            for command_stamp in self.command_stamps.values())
        else:
            self.begun = now
        self.k, self.last_step_time = k, now
        values, self.newest = self.newest, {}
        self._make(stamp, values)
        if self.last_step is not None and k >= self.last_step:
            self.finished = True

    def _newest_receiver(self, name: str) -> Callable[[Decoded, object], None]:
        def take(message: Decoded, _: object) -> None:
            self.newest[name] = message
            if name in self.commands:
                self.command_stamps[name] = message[0]
        return take

    def draining(self) -> bool:
        """Return True at the end of a realtime run, until the axes have stopped and the brakes hold. The first call
        disables the drive."""
        if self.graph.lockstep or self.failure or not self.made:
            return False
        if not self.stopping:
            self.stopping = True
            for port in self.ports:
                port.unit.request('adu/disable')
        return not all(unit_of(port).rests for port in self.ports)

    def end(self) -> None:
        """End lockstep after the answers to the last step, with the result of the run. The wall-clock time begins with
        the answers to step 0. Before these answers the nodes still discover each other."""
        self.result = self._outcome(self.k - 1, self.k)
        self.await_acknowledged()
        self.finished = True

    def close(self) -> None:
        """End the node; in realtime, first keep the result of the run."""
        if not self.graph.lockstep:
            # Without graph.start the number of a step counts from midnight.
            self.result = self._outcome(self.made, self.made + int(self.missed_steps))
        super().close()

    def _outcome(self, made: int, steps: int) -> dict[str, float]:
        """Return the result of the run. made: number of steps in the wall-clock time, from which the realtime factor
        follows."""
        wall = max(time.monotonic_ns() - self.begun, 1) * 1e-9
        return {'steps': steps, 'wall_s': wall, 'realtime_factor': made * self.parameters.period / wall,
                'lost_steps': int(self.lost_steps), 'missed_steps': int(self.missed_steps),
                'late_ticks': int(self.late_ticks)}

    def diagnose(self) -> Diagnosis:
        """Return the Diagnosis of the drive with the step and the lost, late and missed steps."""
        diagnosis = super().diagnose()
        values = [*diagnosis.values, ('step', str(self.k)), ('lost_steps', str(int(self.lost_steps))),
                  ('late_ticks', str(int(self.late_ticks)))]
        if not self.graph.lockstep:
            values.append(('missed_steps', str(self.missed_steps)))
        return diagnosis._replace(values=values)
