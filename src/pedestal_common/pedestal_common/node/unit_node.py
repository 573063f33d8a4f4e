"""ROS node that runs a unit (node.unit): it decodes the messages of a step, lets the unit make the step, and publishes
the results. Subclasses add tasks that are no law, such as the time that the drive owns."""
import collections
import dataclasses
import time
from collections.abc import Callable, Mapping

import numpy as np
from rclpy.timer import Timer
from std_srvs.srv import Trigger

from pedestal_common.graph import nodes, topics
from pedestal_common.graph.steps import NS_PER_SECOND, GraphError, Steps
from pedestal_common.node import shell
from pedestal_common.node.unit import LEVEL_ERROR, LEVEL_WARN, Diagnosis, Unit
from pedestal_common.quantities import Message, Nanoseconds, Seconds
from pedestal_common.realtime import priority
from pedestal_common.wire import commands, messages, records

REPLAY_POLL_S = 0.2  # time between two checks whether another replay publishes the inputs [s]

LOCKSTEP_POLL_S, TRIGGER_POLL_S = 0.2, 0.05
"""Time between two checks for a step that waits too long in lockstep, and for a silent trigger in realtime [s]."""

SETTLING_POLL_S = 0.001  # time after which the messages queued at start-up count as processed [s]


@dataclasses.dataclass
class LastText:
    """Last published text of a text topic."""
    publish: Callable[[bytes], None]    # publishes the next text
    code: int = topics.NO_TEXT_CODE
    text: object = ''


class Port:
    """Connection of a unit to its topics. prefix: that of the unit's beam in a node that serves several beams, else
    ''."""

    def __init__(self, node: shell.Shell, unit: Unit, prefix: str = '') -> None:
        self.prefix = prefix
        self.stamps = np.zeros(1, np.int64)
        written = [name for name in unit.writes if not prefix or name in nodes.BEAM_TOPICS
                   or prefix == nodes.prefixes(node.graph.beams)[0]]
        self._writers = {name: node.writer(self.named(name)) for name in written
                         if name in unit.messages or records.is_text(name)}
        self._reply = node.writer(self.named(unit.NODE.replies)) if unit.NODE.replies else None
        self._announce, self._epoch_of = node.announce, node.epoch
        self._clock = node.clock
        self.use(unit)

    def use(self, unit: Unit) -> None:
        """Connect a new unit, whose first step is the next step."""
        self.unit = unit
        self.decoders = {self.named(name): records.Decoder(name, unit.inputs)
                         for name in (unit.trigger, *unit.latencies)}
        self._initial = unit.memory.record.copy()
        self._encoders = [(records.Encoder(name, message, unit.outputs), self._writers[name])
                          for name, message in unit.messages.items() if name in self._writers]
        self._texts = {name: LastText(writer) for name, writer in self._writers.items() if records.is_text(name)}
        self._epoch = 0
        self._last: Nanoseconds | None = None       # stamp of the last step

    def named(self, topic: str) -> str:
        """Return the name in the graph of a topic of the unit, with the prefix of the beam for a topic of a beam."""
        return self.prefix + topic if topic in nodes.BEAM_TOPICS else topic

    def step(self, stamp: Nanoseconds, values: Mapping[str, records.Decoded | None]) -> None:
        """Make the step of a stamp. values: {topic: its message, or None if no message arrived}. The unit receives
        stamps that count from the epoch (Shell.epoch), so that times in seconds keep their resolution as
        floating-point numbers."""
        self._epoch, self._last = self._epoch_of(stamp), stamp
        self.unit.epoch = self._epoch
        for name, decoder in self.decoders.items():
            came, numbers = values.get(name) or (records.NO_STAMP, None)
            decoder.put(came - self._epoch, numbers)
        self.stamps[0] = stamp - self._epoch
        self.unit.step(self.stamps, self.unit.inputs, self.unit.outputs)

    def reset_after_gap(self) -> None:
        """Reset the memory of the unit to its initial values. Received texts and messages of rate `once` stay."""
        self.unit.memory.record[...] = self._initial
        self.unit.configure(self.unit.parameters)

    def command(self, command: commands.Command) -> commands.Reply:
        """Return the Reply of the unit to a Command, and publish it."""
        reply = self.unit.command(command)
        self.reply()
        return reply

    def reply(self) -> None:
        """Publish the replies to the commands."""
        while self.unit.pending_replies:
            answer = commands.reply_message(*self.unit.pending_replies.popleft())
            if self._reply:
                self._announce(self._reply, answer)

    def publish(self) -> None:
        """Publish the replies since the last step, the changed texts, then every message that is due."""
        self.reply()
        self.announce()
        for encoder, publish in self._encoders:
            if encoder.due:
                publish(encoder.encoded(self._epoch))

    def announce(self) -> None:
        """Publish the texts that have changed; a list of texts has the stamp of the step."""
        outputs = self.unit.outputs[0]
        for name, last in self._texts.items():
            code = outputs[name]
            if code != last.code:
                last.code = code
                text = self.unit.encode(name, int(code))
                if text != last.text:     # different codes may have the same text
                    last.text = text
                    self._announce(last.publish, messages.String(data=text) if isinstance(text, str)
                                   else self._stamped(text))

    def _stamped(self, message: Message) -> Message:
        header = messages.header('')
        messages.put_stamp(header.stamp, self._clock()[1] if self._last is None else self._last)
        return dataclasses.replace(message, header=header)


class UnitNode(shell.Shell):
    """Node that runs the unit of its row."""

    PRECEDENCE = 0
    """Amount by which the scheduling priority of this node exceeds graph.priority."""

    def __init__(self, row: nodes.Node, serves_beams: bool = False) -> None:
        self.row, unit_type = row, row.unit_type()
        super().__init__(self.row.name, self.row.parameters_type(), unit_type.LIVE)
        flags = [flag for flag in topics.TOPIC_FLAGS if getattr(self.parameters, flag, False)]
        reads = nodes.reads(self.row, self.graph.members, flags, self.graph.own)
        prefixes = nodes.prefixes(self.graph.beams) if serves_beams else ('',)
        self.ports: list[Port] = []
        for prefix in prefixes:
            unit = unit_type(self.parameters, reads)
            unit.lockstep = self.graph.lockstep
            self.prepare(unit)
            self.ports.append(Port(self, unit, prefix))
        self.unit = self.ports[0].unit
        self.steps: Steps | None = None
        self.refused = ''
        self._waiting_for_once: set[str] = set()    # topics of rate `once` without a message
        # the first steps, which wait for these messages
        self._held: collections.deque[tuple[Nanoseconds, dict[str, records.Decoded | None]]] = collections.deque()
        self._settled = not self.graph.lockstep
        self._settling: Timer | None = None
        self._urgent = [port.unit.urgent for port in self.ports]
        self._once: frozenset[str] = frozenset()
        self._replays: set[bytes] = set()       # identities of the publishers of replays
        self._replay_left = False
        self._callees = {} if self.graph.lockstep else {
            name: self.create_client(Trigger, self._root + name if self.beam else name) for name in unit_type.CALLS}
        self._called: set[str] = set()
        for port in self.ports:
            self._listen(port)
        self._once = frozenset(self._waiting_for_once)
        for name in unit_type.REQUESTS:
            self.create_service(Trigger, name, self._service(name))
        self.diagnose_with(self.diagnose)
        self.begin()
        if self.graph.priority and not self.graph.lockstep:
            refusal = priority.take(self.graph.priority + self.PRECEDENCE)
            if refusal:
                self.get_logger().info(f'runs with default scheduling: graph.priority = {self.graph.priority}: '
                                       f'{refusal}')

    def _listen(self, port: Port) -> None:
        """Subscribe to the topics that do not belong to a step: texts, topics of rate `once` or `sample`, commands."""
        if self.row.obeys:
            self.message_reader(port.named(self.row.obeys), self._command_taker(port))
        for name in port.unit.reads:
            rate = topics.TOPIC_BY_NAME[name].rate
            if rate == 'change':
                self.message_reader(port.named(name), self._text_taker(port, name))
            elif rate == 'once':
                self.message_reader(port.named(name), self._once_taker(port, name))
                if self.graph.lockstep and any(writer in self.graph.members for writer in self.links[
                        self.beam + name if self.beam + name in self.links else name].writers):
                    self._waiting_for_once.add(name)
            elif rate == 'sample' and not self.graph.lockstep:
                self.sample_reader(port.named(name), self._sample_taker(port, name))

    def _command_taker(self, port: Port) -> Callable[[Message], None]:
        def take(message: Message) -> None:
            try:
                port.command(commands.of_message(message))
            except ValueError as error:
                self.refused = f'{self.row.obeys} refused: {error}'
                self.get_logger().warning(self.refused)
        return take

    def _text_taker(self, port: Port, name: str) -> Callable[[Message], None]:
        def take(message: Message) -> None:
            self._look_for_replay()
            port.unit.take_text(name, message.data)
        return take

    def _once_taker(self, port: Port, name: str) -> Callable[[Message], None]:
        def take(message: Message) -> None:
            self._look_for_replay()
            stamp = messages.nanoseconds(message.header.stamp)
            try:
                port.unit.decode(name, messages.since(message, self.epoch(stamp) if stamp else 0))
                self.refused = ''
            except ValueError as error:
                self.refused = f'{name} refused: {error}'
                self.get_logger().warning(self.refused)
            self._waiting_for_once.discard(name)
            self._release()
        return take

    def _sample_taker(self, port: Port, name: str) -> Callable[[Message], None]:
        """Return take(message) of a topic of rate `sample`. It drops messages before the first step, because the first
        step determines the epoch."""
        def take(message: Message) -> None:
            if not self._stamp:
                return
            stamp = messages.nanoseconds(message.header.stamp)
            port.unit.decode(name, messages.since(message, self.epoch(stamp) if stamp else 0))
        return take

    def _settle(self) -> None:
        """Note that all messages queued at start-up have been processed."""
        assert self._settling
        self._settling.cancel()
        self._settled = True
        self._release()

    def _release(self) -> None:
        """Answer the held first steps as soon as no message of rate `once` is awaited."""
        while self._held and self._settled and not self._waiting_for_once:
            self.answer(*self._held.popleft())

    @property
    def awaits(self) -> str:
        """Names of the awaited topics: the trigger, and the topics of rate `once` without a message."""
        return ', '.join((self.unit.trigger, *sorted(self._waiting_for_once)))

    def begin(self) -> None:
        """Start to follow the trigger of the unit; overridden by the drive, which owns the time."""
        self.follow(self.unit.trigger, self.unit.latencies)

    def follow(self, trigger: str, latencies: Mapping[str, Seconds]) -> None:
        """Match the messages of each step (see Steps), and `answer` each step. latencies: {other topic than the
        trigger: age of its data at the step}. In lockstep a step whose inputs are absent for graph.deadline ends the
        node with the names of the silent publishers."""
        self.steps = Steps(trigger, {name: round(latency * NS_PER_SECOND) for name, latency in latencies.items()},
                           self.graph.lockstep, self._answer, held=nodes.held(latencies))
        decoders = {name: decoder for port in self.ports for name, decoder in port.decoders.items()}
        for name in (trigger, *latencies):
            if nodes.plain(name) not in self.row.writes:
                self.reader(name, decoding(decoders[name]), self._step_taker(name))
        self._watched_step: Nanoseconds | None = None
        self._watched_since = time.monotonic()
        self._replayed = next(name for name in (trigger, *latencies) if nodes.plain(name) not in self.row.writes)
        self.every(REPLAY_POLL_S, self._look_for_replay)
        if self.graph.lockstep:
            self.every(LOCKSTEP_POLL_S, self._watch_pending_step)
        else:
            self._answered = self._triggered = self._watched = self._begun = time.monotonic_ns()
            self.every(TRIGGER_POLL_S, self._watch_trigger)

    def _look_for_replay(self) -> None:
        """Begin again if a new replay publishes the first input of the steps."""
        if self.steps is None:
            return
        replays = {bytes(info.endpoint_gid) for info in
                   self.get_publishers_info_by_topic(self._link(self._replayed)[1])
                   if shell.node_of(info, self._root) == nodes.REPLAY_NODE}
        if self._replays and replays - self._replays:
            self._begin_again()
        self._replays |= replays
        self._replay_left = bool(self._replays) and not replays

    def _begin_again(self) -> None:
        self.get_logger().info('begins again, for another replay')
        for port in self.ports:
            unit = type(port.unit)(self.parameters, port.unit.reads)
            unit.lockstep = self.graph.lockstep
            port.use(unit)
        self.unit = self.ports[0].unit
        assert self.steps
        self.steps.reset_after_gap(self.steps.trigger)
        self.refused = self.steps.refusal = ''
        self._waiting_for_once = set(self._once)
        self._held.clear()
        self._settled, self._settling = not self.graph.lockstep, None
        self._urgent = [port.unit.urgent for port in self.ports]
        self.restart()

    def _step_taker(self, name: str) -> Callable[[records.Decoded, bool], None]:
        """Return take(message, after_gap) of an input. A gap resets the state that depends on earlier messages."""
        assert self.steps
        steps = self.steps

        def take(message: records.Decoded, after_gap: bool) -> None:
            if message[0] < self.run_start:     # equipment that runs before the run
                return
            if message[0] <= self._stamp:
                self._look_for_replay()
            if after_gap:
                steps.reset_after_gap(name)
                if name == steps.trigger and message[0] <= self._stamp:
                    for port in self.ports:
                        port.reset_after_gap()
            if name == steps.trigger:
                self._triggered = time.monotonic_ns()
            steps.take(name, message[0], message)
        return take

    def _answer(self, stamp: Nanoseconds, trigger: records.Decoded, values: dict[str, records.Decoded | None]) -> None:
        """Answer a complete step. In lockstep the first steps wait for the topics of rate `once`, and for the texts
        that arrived before the executor began. Because the executor takes queued messages in any order, these texts
        may come after the first step."""
        assert self.steps
        values[self.steps.trigger] = trigger
        if self._settled and not self._waiting_for_once:
            self.answer(stamp, values)
            return
        self._held.append((stamp, values))
        if self._settling is None:
            self._settling = self.every(SETTLING_POLL_S, self._settle)

    def answer(self, stamp: Nanoseconds, values: Mapping[str, records.Decoded | None]) -> None:
        """Answer the step of a stamp. values: as in Port.step."""
        for port in self.ports:
            port.step(stamp, values)
        self.begin_step(stamp)
        for port in self.ports:
            port.publish()
        self.after_step()

    def after_step(self) -> None:
        """Publish urgent diagnostics after a step in realtime, and call the services that a unit needs."""
        if self.graph.lockstep:
            return
        if [port.unit.urgent for port in self.ports] != self._urgent and self.diagnose_now():
            # A diagnosis clears notes of the unit, so its urgent part is read again.
            self._urgent = [port.unit.urgent for port in self.ports]
        self._answered = time.monotonic_ns()
        if self._callees:
            calls = {name for port in self.ports for name in port.unit.calls}
            for name in calls - self._called:
                answer = self._callees[name].call_async(Trigger.Request())
                answer.add_done_callback(lambda done, name=name: self._log_refusal(name, done.result()))
            self._called = calls

    def _log_refusal(self, name: str, response: Trigger.Response) -> None:
        if not response.success:
            self.get_logger().warning(f'{name}: {response.message}')

    def _watch_trigger(self) -> None:
        """Set `silent` of the units while the trigger is absent, except after a stall and before the run."""
        assert self.steps
        now, limit = time.monotonic_ns(), self.graph.silence * NS_PER_SECOND
        if self.clock()[1] < self.run_start:
            self._answered = self._begun = now
        stalled, self._watched = now - self._watched > limit, now
        # A step that waits for its inputs has a trigger, but no answer yet.
        silent = now - max(self._answered, self._triggered) > limit and not stalled
        if silent and self.steps.pending_stamp is not None:
            # The pending step has the last trigger before the silence. If it waited longer for its inputs, it would be
            # answered with messages from after the silence.
            answered = self._answered
            self.steps.answer_incomplete()
            self._answered = answered
        if silent != self.unit.silent:
            for port in self.ports:
                port.unit.silent = silent
                port.announce()
            if silent:
                self.diagnose_now()

    def _watch_pending_step(self) -> None:
        """Raise GraphError in lockstep if one step has waited for its inputs longer than graph.deadline."""
        assert self.steps
        pending = self.steps.pending_stamp
        if pending is None or self._watched_step != pending or self._replay_left:
            self._watched_step, self._watched_since = pending, time.monotonic()
        elif time.monotonic() - self._watched_since > self.graph.deadline:
            waiting = self.steps.waiting_for
            silent = [writer for name in waiting for writer in self._link(name)[0].writers]
            raise GraphError(f'no {", ".join(waiting)} for step {pending / NS_PER_SECOND:.6f} s after '
                                   f'{self.graph.deadline:g} s', silent)

    def _service(self, name: str) -> Callable[[Trigger.Request, Trigger.Response], Trigger.Response]:
        """Return the callback of a service, which passes the request to every unit between two steps."""
        def serve(_request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
            # Each port receives the same commands, so all give the same reply.
            [reply] = {port.command(commands.Command(name, commands.SERVICE_CLIENT)) for port in self.ports}
            if name.endswith('/reset_faults') and reply.granted:
                self.refused = ''
            response.success, response.message = reply
            return response
        return serve

    def reconfigure(self) -> None:
        """Pass the changed parameters to the units."""
        for port in self.ports:
            port.unit.configure(self.parameters)

    def diagnosed(self) -> Diagnosis:
        """Return the Diagnosis of the unit; overridden by a node that runs several units."""
        return self.unit.diagnose()

    def diagnose(self) -> Diagnosis:
        """Return the Diagnosis of the node: a silent trigger comes first, with an error of the unit behind it. A
        refused input replaces the message of the unit, except an error."""
        diagnosis = self.diagnosed()
        if self.unit.silent and self.steps:
            since = (time.monotonic_ns() - self._answered) * 1e-9
            text = (f'no {self.steps.trigger} so far' if self._answered == self._begun else
                    f'no {self.steps.trigger} for {since:.1f} s')
            text = f'{text}; {diagnosis.message}' if diagnosis.level == LEVEL_ERROR else text
            return diagnosis._replace(level=LEVEL_ERROR, message=text)
        refusal = self.refused or (self.steps.refusal if self.steps else '')
        if refusal and diagnosis.level < LEVEL_ERROR:
            return diagnosis._replace(level=LEVEL_WARN, message=refusal)
        return diagnosis


def decoding(decoder: records.Decoder) -> Callable[[bytes], tuple[Nanoseconds, records.Decoded]]:
    """Return the function that decodes CDR bytes, for Shell.reader."""
    decoded = decoder.decoded

    def decode(data: bytes) -> tuple[Nanoseconds, records.Decoded]:
        message = decoded(data)
        return message[0], message
    return decode
