"""The node that owns the drive's time: its clock, its steps and their pacing.

What moves is its unit: one drive, or one for each beam of an array.
"""
import time

from pedestal_common import unit_node
from pedestal_common.steps import SECOND

ACKNOWLEDGED_STEPS = 1000
"""Lockstep: the drive waits this often until every reader has all; a reader's queue holds 5000 messages (Fast DDS), so
a slow recorder slows the run and loses nothing."""


class Timekeeper(unit_node.UnitNode):
    """Step k begins when step k - 1 has been answered (lockstep) or every period (realtime).

    In it the units obey what was said of step k - 1, and tell where they are at t_k.
    """

    def __init__(self, module):
        super().__init__(module, serves_beams=True)

    def begin(self):
        p = self.parameters
        self.period_ns = round(p.period * SECOND)
        self.last_step = round(p.duration / p.period) if p.duration > 0.0 else None
        self.k = -1
        self.lost_steps = self.late_ticks = 0
        self.newest, self.command_stamps = {}, {}
        self.tick_timer = None
        self.ticking = False
        self.begun = self.ticked = time.monotonic()
        latencies = {port.named(name): latency for port in self.ports
                     for name, latency in port.unit.latencies.items()}
        self.commands = [port.named(port.unit.COMMAND) for port in self.ports]
        if self.graph.lockstep:
            self.follow(self.unit.trigger, latencies)
        else:
            for port in self.ports:
                for name, decoder in port.decoders.items():
                    if name != self.unit.trigger:
                        self.reader(name, self._newest_taker(name, decoder))
        self.start_timer = self.every(0.001, self.start)

    def start(self):
        """Step 0, once the graph is complete. In realtime the steady timer begins with the first command, when the
        others have found each other; without an ACU at once, and with a mute one after the deadline."""
        self.start_timer.cancel()
        self.await_graph()
        self.ticked = time.monotonic()
        if self.graph.lockstep:
            self.steps.take(self.unit.trigger, 0, (0, ()))
        else:
            self.answer(0, {})
            commanded = any(name.rpartition('/')[2] == 'acu' for name in self.graph.members)
            self.tick_timer = self.every(self.graph.deadline if commanded else self.parameters.period,
                                         self.begin_ticking)

    def begin_ticking(self):
        """Realtime: from now on a step every period."""
        self.tick_timer.cancel()
        self.tick_timer = self.every(self.parameters.period, self.tick)
        self.ticked = time.monotonic()
        self.ticking = True

    def answer(self, stamp, values):
        """Make step k of the stamp k T [ns]; in lockstep the next one begins at once."""
        if self.k == self.last_step:
            self.end()
            return
        self.k += 1
        if self.k == 1:
            self.begun = time.monotonic()
        for port in self.ports:
            port.step(stamp, values)
        self.begin_step(stamp)
        if self.graph.lockstep and self.k % ACKNOWLEDGED_STEPS == 0:
            self.await_acknowledged()
        for port in self.ports:
            port.publish()
        if self.graph.lockstep:
            self.steps.take(self.unit.trigger, stamp + self.period_ns, (stamp + self.period_ns, ()))

    def tick(self):
        """Realtime: one period has passed on the steady clock."""
        if self.finished:
            return
        before = self.k * self.period_ns
        self.lost_steps += any(before > self.command_stamps.get(name, 0) for name in self.commands)
        self.late_ticks += time.monotonic() - self.ticked > 1.5 * self.parameters.period
        self.ticked = time.monotonic()
        values, self.newest = self.newest, {}
        self.answer(before + self.period_ns, values)

    def _newest_taker(self, name, decoder):
        """Realtime: takes the messages of a topic; the newest wins. A command that is not newer than the last one, or
        from the future, is refused."""
        def take(data):
            message = decoder.decoded(data)
            if name not in self.commands:
                self.newest[name] = message
                return
            stamp, now = message[0], self.k * self.period_ns
            last = self.command_stamps.get(name)
            if last is not None and stamp <= last:
                self.refused = (f'{name} refused: stamp went back from {last / SECOND:.3f} to {stamp / SECOND:.3f} s')
            elif stamp > now:
                self.refused = (f'{name} refused: stamp {stamp / SECOND:.3f} s lies ahead of the drive '
                                f'({now / SECOND:.3f} s)')
            else:
                self.command_stamps[name] = stamp
                self.newest[name] = message
                if self.tick_timer is not None and not self.ticking and len(self.command_stamps) == len(self.ports):
                    self.begin_ticking()
        return take

    def end(self):
        """The last step has been answered: say how it went and finish. The clock ran from the first answer on, when
        everyone had found everyone."""
        wall = time.monotonic() - self.begun
        self.await_acknowledged()
        self.result = {'steps': self.k, 'wall_s': wall,
                       'realtime_factor': (self.k - 1) * self.parameters.period / wall,
                       'lost_steps': int(self.lost_steps), 'late_ticks': int(self.late_ticks)}
        self.finished = True

    def diagnose(self):
        diagnosis = super().diagnose()
        return diagnosis._replace(values=[*diagnosis.values, ('step', str(self.k)),
                                          ('lost_steps', str(int(self.lost_steps))),
                                          ('late_ticks', str(int(self.late_ticks)))])
