"""The shell of a node that owns the drive's time: its clock, its steps and their pacing. What moves are its units, the
column's cores between their messages: one drive, or one for each beam of an array."""
import json
import time

from std_srvs.srv import Trigger

from pedestal_common import messages, records, shell, topics

STEP = 'step'
"""The drive's own trigger among its inputs."""

JOINTS, STATE = 'joint_states', 'adu/state'

ACKNOWLEDGED_STEPS = 1000
"""Lockstep: the drive waits this often until every reader has all; a reader's queue holds 5000 messages (Fast DDS), so
a slow recorder slows the run and loses nothing."""


class Part:
    """A unit and what it hears; prefix: of the topics of its beam.

    heard: {topic: the newest message, None once it was obeyed}; stale: the command in force is too old.
    """

    def __init__(self, prefix, unit):
        self.prefix, self.unit = prefix, unit
        self.command = self.name(unit.COMMAND)
        self.now = records.only(unit.heard, JOINTS)
        self.places = {self.name(name): records.only(unit.heard, name) for name in unit.HEARD.names if name != JOINTS}
        self.heard = dict.fromkeys(self.places)
        self.command_stamp = None
        self.stale = False

    def name(self, topic):
        """The topic as the graph names it."""
        return self.prefix + topic if topics.of_beam(topic) else topic

    def advance(self):
        for topic, place in self.places.items():
            records.take(place, self.heard[topic])
            self.heard[topic] = None
        self.stale = self.unit.advance()


class DriveShell(shell.Shell):
    """Publishes the state when it has changed, then joint_states and clock of every step, and obeys the answers.

    A subclass makes `units` and the words of `diagnose`.
    """

    def __init__(self, parameters_type):
        super().__init__('adu', parameters_type)
        p = self.parameters
        self.parts = [Part(prefix, unit) for prefix, unit in self.units()]
        self.first = self.parts[0].unit
        for part in self.parts:
            self.prepare(part.unit)
        self.period_ns = round(p.period * shell.SECOND)
        self.steps_to_go = round(p.duration / p.period) if p.duration > 0.0 else None
        self.k = 0
        self.lost_steps = self.late_ticks = 0
        self.code = None
        self.announced = ''
        self.refused = ''
        self.tick_timer = None
        self.ticking = False
        self.begun = self.heard = time.monotonic()

        # What the others wait for goes first.
        self.says = [(part.unit.messages[name], records.only(part.unit.said, name), self.writer(part.name(name)))
                     for part in self.parts for name in part.unit.SAID.names
                     if name != STATE and (part.unit is self.first or topics.of_beam(name))]
        self.send_state = self.writer(STATE)
        for name in self.first.SERVICES:
            self.create_service(Trigger, name, self.service(name))
        self.diagnose_with(self.diagnose)

        if self.graph.lockstep:
            self.follow(STEP, {part.name(name): latency for part in self.parts
                               for name, latency in part.unit.followers.items()}, self.answered)
        else:
            for part in self.parts:
                for name in part.unit.followers:
                    self.reader(part.name(name), self.hearing(part, part.name(name)))
        self.start_timer = self.every(0.001, self.start)

    def start(self):
        """Step 0, once the graph is complete. In realtime the steady timer begins with the first command, when the
        others have found each other; without an ACU at once, and with a mute one after the deadline."""
        self.start_timer.cancel()
        self.await_graph()
        self.heard = time.monotonic()
        self.publish_step()
        if not self.graph.lockstep:
            commanded = any(topics.plain(name) == 'acu' for name in self.graph.members)
            self.tick_timer = self.every(self.graph.deadline if commanded else self.parameters.period,
                                         self.begin_ticking)

    def begin_ticking(self):
        """Realtime: from now on a step every period."""
        self.tick_timer.cancel()
        self.tick_timer = self.every(self.parameters.period, self.tick)
        self.heard = time.monotonic()
        self.ticking = True

    def publish_step(self):
        """The state when it has changed, then everything that is said of step k."""
        stamp = self.k * self.period_ns
        self.begin_step(stamp)
        if self.graph.lockstep and self.k % ACKNOWLEDGED_STEPS == 0:
            self.await_acknowledged()
        for part in self.parts:
            part.now.stamp[0] = stamp
            part.unit.say()
        self.announce_state()
        for message, place, send in self.says:
            records.put(message, place)
            send(message)
        if self.graph.lockstep:
            self.steps.take(STEP, stamp, None)

    def announce_state(self):
        code = self.first.said[0][STATE]
        if code != self.code:
            self.code = code
            now = self.first.WORDS[STATE](int(code))
            if now != self.announced:
                self.announced = now
                self.announce(self.send_state, messages.String(data=now))

    def answered(self, _stamp, _trigger, inputs):
        """Lockstep: the commands stamped t_k (and the ship's truth) have come."""
        for part in self.parts:
            for name in part.heard:
                part.heard[name] = inputs.get(name)
        self.advance()

    def hearing(self, part, name):
        """Realtime: what takes the messages of a topic; the latest wins."""
        def take(message):
            part.heard[name] = message

        def take_command(message):
            """One that is not newer, or from the future, is refused."""
            stamp, now = messages.nanoseconds(message.header.stamp), self.k * self.period_ns
            if part.command_stamp is not None and stamp <= part.command_stamp:
                self.refused = (f'{name} refused: stamp went back from {part.command_stamp / 1e9:.3f} to '
                                f'{stamp / 1e9:.3f} s')
            elif stamp > now:
                self.refused = f'{name} refused: stamp {stamp / 1e9:.3f} s lies ahead of the drive ({now / 1e9:.3f} s)'
            else:
                part.command_stamp = stamp
                take(message)
                if self.tick_timer is not None and not self.ticking and all(
                        other.command_stamp is not None for other in self.parts):
                    self.begin_ticking()
        return take_command if name == part.command else take

    def tick(self):
        """Realtime: one period has passed on the steady clock."""
        if self.finished:
            return
        stamp = self.k * self.period_ns
        self.lost_steps += any(stamp > (part.command_stamp or 0) for part in self.parts)
        self.late_ticks += time.monotonic() - self.heard > 1.5 * self.parameters.period
        self.heard = time.monotonic()
        self.advance()

    def advance(self):
        """Go on from t_k to t_k+1 and publish, or end after the last step."""
        if self.k == self.steps_to_go:
            self.end()
            return
        for part in self.parts:
            part.advance()
        self.judge()
        self.k += 1
        if self.k == 1:
            self.begun = time.monotonic()
        self.publish_step()

    def end(self):
        """The last step has been answered: say how it went and finish. The clock ran from the first answer on, when
        everyone had found everyone."""
        wall = time.monotonic() - self.begun
        self.await_acknowledged()
        factor = (self.k - 1) * self.parameters.period / wall
        print(json.dumps({'steps': self.k, 'wall_s': wall, 'realtime_factor': factor,
                          'lost_steps': int(self.lost_steps), 'late_ticks': int(self.late_ticks)}), flush=True)
        self.finished = True

    def service(self, name):
        """The callback of a service: asks every unit between two steps and answers with what it reads back."""
        def change(_request, response):
            [refusal] = {part.unit.refusal(name) for part in self.parts}
            if name == 'adu/reset_faults' and not refusal:
                self.refused = ''
            response.success = not refusal
            response.message = f'{f"refused: {refusal}; " if refusal else ""}drive is {self.first.condition()}'
            return response
        return change

    def judge(self):
        """A step has been made: remember what the next diagnosis shall tell; overridden."""

    def diagnosed(self, values):
        """The values every drive tells after its own."""
        return [*values, ('step', str(self.k)), ('lost_steps', str(int(self.lost_steps))),
                ('late_ticks', str(int(self.late_ticks)))]

    def stale(self):
        """The commands that stay away too long."""
        return ', '.join(part.command for part in self.parts if part.stale)
