"""The node that owns the drive's time: its clock, its steps and their pacing.

What moves is its unit: one drive, or one for each beam of an array.
"""
import time

from pedestal_common.graph.steps import NS_PER_SECOND
from pedestal_common.node import unit_node

ACKNOWLEDGE_INTERVAL_STEPS = 1000
"""Lockstep: the drive waits this often until every reader has all; a reader's queue holds 5000 messages (Fast DDS), so
a slow recorder slows the run and loses nothing."""

MAX_WAIT_S = 0.1
"""Seconds after which the clock is looked at again, however far away the next step is: it may be stepped."""

MIN_RECEIVE_FRACTION = 0.25
"""Realtime: the part of a period for which what arrives is heard, also by a drive that is late for its next step."""


class Timekeeper(unit_node.UnitNode):
    """Step k begins when step k - 1 has been answered (lockstep), or when it is its time: k T after the epoch, UTC
    (realtime).

    In it the units obey what was said of step k - 1, and tell where they are at t_k.
    """

    PRECEDENCE = 1
    """Others may compute for longer than a step, a search or a pass: never in the way of the drive."""

    def __init__(self, module):
        super().__init__(module, serves_beams=True)

    def begin(self):
        """Begin to count the steps, and with them the graph's time."""
        p = self.parameters
        self.period_ns = round(p.period * NS_PER_SECOND)
        self.last_step = round(p.duration / p.period) if p.duration > 0.0 else None
        self.k, self.made = -1, 0
        self.lost_steps = self.missed_steps = self.late_ticks = 0
        self.newest, self.command_stamps = {}, {}
        self.begun = self.ticked = time.monotonic_ns()
        self.stopping = False
        latencies = {port.named(name): latency for port in self.ports
                     for name, latency in port.unit.latencies.items()}
        self.commands = [port.named(port.unit.COMMAND) for port in self.ports]
        if self.graph.lockstep:
            self.follow(self.unit.trigger, latencies)
            self.timer = self.every(0.001, self.start)
        else:
            self.wait, self.guarded_tick = 0.0, self._guarded(self.tick)
            for port in self.ports:
                for name, decoder in port.decoders.items():
                    if name != self.unit.trigger:
                        self.reader(name, unit_node.decoding(decoder), self._newest_taker(name))

    @property
    def awaits(self):
        """What it waits for: readers in lockstep, in realtime the time at which the run begins."""
        if self.graph.lockstep:
            return 'the readers of what it writes'
        _, now = self.clock()
        return f'its time to begin, in {max(self.epoch(now) - now, 0) / NS_PER_SECOND:.1f} s'

    def start(self):
        """Lockstep: step 0, once the graph is complete."""
        self.timer.cancel()
        self.await_graph()
        self.steps.take(self.unit.trigger, 0, (0, ()))

    def answer(self, stamp, values):
        """Lockstep: make step k of the stamp k T [ns]; the next one begins at once."""
        if self.k == self.last_step:
            self.end()
            return
        if self.k == 0:
            self.begun = time.monotonic_ns()
        self.k += 1
        self._make(stamp, values)
        self.steps.take(self.unit.trigger, stamp + self.period_ns, (stamp + self.period_ns, ()))

    def _make(self, stamp, values):
        for port in self.ports:
            port.step(stamp, values)
        self.begin_step(stamp)
        self.made += 1
        if self.graph.lockstep and self.k % ACKNOWLEDGE_INTERVAL_STEPS == 0:
            self.await_acknowledged()
        for port in self.ports:
            port.publish()
        self.after_step()

    def spin(self, executor):
        """Realtime: hear what arrives until the next step, then make it.

        Not by a timer of rclpy: at each reset EventsExecutor (rclpy 7.1.6) looks once more which timers are due, and
        queues those that it has queued already. The queue of a drive too slow for its steps grows without end, and
        what is said to it waits for minutes.
        """
        if self.graph.lockstep:
            super().spin(executor)
            return
        end = time.monotonic() + self.wait
        while self.failure is None and (left := end - time.monotonic()) > 0.0:
            executor.spin_once(timeout_sec=left)
        if self.failure is None:
            self.guarded_tick()

    def tick(self):
        """Realtime: make the step whose time it is, if it was not made, and see how long it is to the next [s]."""
        now, utc = self.clock()
        start = self.epoch(utc)
        k, least = (utc - start) // self.period_ns, 0.0
        if k >= 0 and k > self.k:
            self._tick(k, start + k * self.period_ns, now)
            least = MIN_RECEIVE_FRACTION * self.parameters.period
        _, utc = self.clock()
        wait = (start + (max(k, self.k) + 1) * self.period_ns - utc) / NS_PER_SECOND
        self.wait = min(max(wait, least), MAX_WAIT_S)

    def _tick(self, k, stamp, now):
        """Make step k of a stamp [ns] at the time now of the steady clock [ns]. Of steps whose time has passed nothing
        is told: they are missed, and lost."""
        before = stamp - self.period_ns
        if self.made:
            periods = (now - self.ticked) / self.period_ns
            missed = max(round(periods) - 1, 0)
            self.missed_steps += missed
            self.late_ticks += periods > 1.5
            self.lost_steps += missed + any(before > stamp for stamp in self.command_stamps.values())
        else:
            self.begun = now
        self.k, self.ticked = k, now
        values, self.newest = self.newest, {}
        self._make(stamp, values)
        if self.last_step is not None and k >= self.last_step:
            self.finished = True

    def _newest_taker(self, name):
        """Realtime: takes the messages of a topic; the newest wins."""
        def take(message, anew):
            self.newest[name] = message
            if name in self.commands:
                self.command_stamps[name] = message[0]
        return take

    def draining(self):
        """In realtime whoever ends the run, the axes stop first and stand on their brakes."""
        if self.graph.lockstep or self.failure or not self.made:
            return False
        if not self.stopping:
            self.stopping = True
            for port in self.ports:
                port.unit.request('adu/disable')
        return not all(port.unit.rests for port in self.ports)

    def end(self):
        """Lockstep: the last step has been answered: say how it went and finish. The clock ran from the first answer
        on, when everyone had found everyone."""
        self.result = self._outcome(self.k - 1)
        self.await_acknowledged()
        self.finished = True

    def close(self):
        """End; in realtime with the steps made, lost and missed as its result."""
        if not self.graph.lockstep:
            self.result = self._outcome(self.made)
        super().close()

    def _outcome(self, made):
        wall = max(time.monotonic_ns() - self.begun, 1) * 1e-9
        return {'steps': self.k, 'wall_s': wall, 'realtime_factor': made * self.parameters.period / wall,
                'lost_steps': int(self.lost_steps), 'missed_steps': int(self.missed_steps),
                'late_ticks': int(self.late_ticks)}

    def diagnose(self):
        """The Diagnosis of the drive with the step and what was lost among its values."""
        diagnosis = super().diagnose()
        values = [*diagnosis.values, ('step', str(self.k)), ('lost_steps', str(int(self.lost_steps))),
                  ('late_ticks', str(int(self.late_ticks)))]
        if not self.graph.lockstep:
            values.append(('missed_steps', str(self.missed_steps)))
        return diagnosis._replace(values=values)
