"""Recorder: the ROS node that records every topic of the graph in a bag, byte by byte, and reports each lost message.

This module receives the messages, step_order.py puts them in order, and writer.py writes them.
"""
import collections
import sys
import time
from collections.abc import Callable
from typing import TypeAlias

from rclpy.qos import HistoryPolicy

from pedestal_common import parameters
from pedestal_common.graph import nodes, topics
from pedestal_common.graph.steps import NS_PER_SECOND, GraphError
from pedestal_common.node import middleware, shell, subscriptions
from pedestal_common.node.subscriptions import MessageInfo, Take
from pedestal_common.node.unit import LEVEL_ERROR, LEVEL_OK, LEVEL_WARN, Diagnosis
from pedestal_common.quantities import Nanoseconds, Seconds
from pedestal_common.realtime.publisher_gate import (
    CONFIRMED_TAKEOVER_NS,
    DROP_OTHER_PUBLISHER,
    PUBLISHER_POLL_NS,
    PublisherGate,
)
from pedestal_common.text_files import files
from pedestal_common.wire import messages
from pedestal_common.wire.cdr import STAMPED_TYPES
from pedestal_recording import configuration
from pedestal_recording.mcap_file import BagError
from pedestal_recording.readable import Readable
from pedestal_recording.recorder_params import RecorderParameters
from pedestal_recording.step_order import OrderError, StepOrder
from pedestal_recording.writer import Writer

QUIET_TIME_S = 0.5  # time without a message after which the recorder ends, once the run has ended [s]

MAX_DRAIN_S = 4.0
"""Longest wait for late messages after the end of the run [s].

The recorder waits this long if it received messages, but still none of one of the topics that are published every
step. Such messages can come late: Fast DDS resends the messages that a subscriber missed during discovery with its
next heartbeat, by default every 3 s.
"""

SYNC_PERIOD_S = 5.0  # time between two synchronisations of the disk in realtime [s]
LAST_OPENED_TOPIC = 'diagnostics'
"""Topic to which the recorder subscribes last, when the executor already serves all other topics.

Every node publishes this topic, and in lockstep waits for its subscriber before the first step. Because the recorder
subscribes to it last, no message waits when the executor starts. The executor would take waiting messages in another
order than that of their arrival.
"""

MAX_STAMP_DISTANCE_NS = 3600 * NS_PER_SECOND  # largest plausible distance of a stamp from the time of the drive [ns]


_Counter: TypeAlias = Callable[[bytes, MessageInfo], bool]


class TopicPublishers:
    """Publishers of one topic in realtime: a PublisherGate distinguishes the graph's publisher from foreign ones."""

    def __init__(self, node: 'RecorderNode', link: nodes.Link) -> None:
        self._node, self._link = node, link
        self._gate = PublisherGate(lambda data: (None, data), 0, self._count)
        self.lost = 0   # number of messages of the graph's publisher that are missing, by its sequence numbers
        self._counted: dict[object, int] = {}
        self._polled: Nanoseconds | None = None
        self._foreign = False

    def several(self, now: Nanoseconds) -> bool:
        """Return True if more than one publisher was active shortly before a time of the steady clock."""
        return self._gate.streams.several(now)

    def take(self, data: bytes, info: MessageInfo) -> bool:
        """Return True for a message of the graph, False for a message of a foreign publisher.

        A message is foreign if the gate rejects it as a message of another publisher, and two more conditions hold.
        The graph's publisher is distinguished from the others, and has sent within CONFIRMED_TAKEOVER_NS. ROS names a
        foreign publisher of the topic. In doubt, a message counts as a message of the graph.
        """
        now, utc = self._node.clock()
        taken = self._gate.take(data, info['publication_sequence_number'], info['source_timestamp'], now, utc)
        ours = self._gate.active
        if taken is not None and ours is not None:
            self.lost += ours.lost - self._counted.get(ours, 0)
            self._counted[ours] = ours.lost
        return not (taken is None and self._gate.drops.kind == DROP_OTHER_PUBLISHER and ours is not None
                    and ours in self._gate.streams.streams and now - ours.arrival < CONFIRMED_TAKEOVER_NS
                    and self._named(now))

    def _count(self) -> int | None:
        names = subscriptions.foreign_publishers(self._node, self._link, self._link.name)
        return None if names is None else len(names)

    def _named(self, now: Nanoseconds) -> bool:
        """Return True if ROS names a foreign publisher, by a check every PUBLISHER_POLL_NS at most."""
        if self._polled is None or now - self._polled >= PUBLISHER_POLL_NS:
            names = subscriptions.foreign_publishers(self._node, self._link, self._link.name) or ()
            self._polled = now
            self._foreign = any(subscriptions.UNDISCOVERED_NODE_NAME not in name for name in names)
        return self._foreign


class RecorderNode(shell.Shell):
    """Recorder of the graph. It writes in the order of steps (StepOrder) in lockstep, of arrival in realtime.

    In realtime the publish time of a message is the wall time of the publisher, and the log time is its stamp.
    """

    def __init__(self, row: nodes.Node) -> None:
        super().__init__(row.name, RecorderParameters)
        names = self.graph.members
        if self.graph.lockstep and not names:
            raise parameters.ParameterError("graph.nodes = '': must name the nodes of the graph in lockstep")
        beams, flags = self.graph.beams, [flag for flag in topics.TOPIC_FLAGS if getattr(self.parameters, flag)]
        recorded = nodes.recorded(names, flags, beams, self.graph.own) if names else list(self.links.values())
        if self.graph.lockstep:  # a command belongs to no step; its reply does, and repeats the command
            recorded = [link for link in recorded if link.rate not in topics.REALTIME_RATES]
        # planned end of the run, since its start
        self._end: Nanoseconds | None = round(self.parameters.duration * NS_PER_SECOND) or None
        self._bag = Writer(self.parameters.bag, recorded, {
            'scenario': self.parameters.scenario, 'pacing': self.graph.pacing, 'seed': self.parameters.seed,
            'beamwidth': self.parameters.beamwidth, **({'beams': beams} if beams else {}),
            **({'servo': 1} if nodes.SIMULATED_DRIVES.name in names else {}),
            **({'iq': 1} if nodes.SIMULATED_IQ.name in names else {}),
            **({'own': self.graph.own} if self.graph.own else {}),
            **({} if self.graph.lockstep else {'start': self.epoch(self.clock()[1])}),
            **({'planned_end_ns': self._end} if self._end else {}),
            'git': configuration.git_revision(), **configuration.versions()},
            configuration.records(self.parameters.scenario_yaml, self.parameters.parameters_yaml))
        self._order = StepOrder(recorded, names, self._bag.write)   # for lockstep
        self._lost: collections.Counter[str] = collections.Counter()    # messages of a topic
        self._heard: dict[str, TopicPublishers] = {}    # by topic, in realtime
        self._stamp: Nanoseconds = self.graph.start     # newest time of the drive
        self._has_time = self.graph.lockstep or self.graph.start > 0    # False before the first time of the drive
        self._last_step: Nanoseconds = sys.maxsize      # time of the drive that ended the run
        self._without_stamp = 0     # number of messages without a valid stamp
        self._received = [0] * len(recorded)    # number of messages of each recorded topic
        self._step_topics = [index for index, topic in enumerate(recorded) if topic.rate == 'step']
        self._error: str | None = None  # reason why the node ends early
        # steady time and number of received messages at the last arrival, after the end of the run
        self._last_arrival: tuple[Seconds, int] | None = None
        self.diagnose_with(self._diagnosis)
        for index, topic in enumerate(recorded):
            if topic.name != LAST_OPENED_TOPIC:
                self._record(index, topic)
        self._last = [(index, topic) for index, topic in enumerate(recorded) if topic.name == LAST_OPENED_TOPIC]
        self._opening = self.every(0.0, self._record_last)
        if not self.graph.lockstep:
            self.every(1.0, lambda: self._write(self._bag.flush))
            self.every(SYNC_PERIOD_S, self._bag.synchronise)

    def _record(self, index: int, topic: nodes.Link) -> None:
        """Subscribe to a topic. The queue keeps all messages in lockstep, and those of several seconds in realtime."""
        take = self._receiver(index, topic)
        if self.graph.lockstep:
            profile = middleware.qos(topic.rate)
            profile.history = HistoryPolicy.KEEP_ALL
            self.create_subscription(middleware.message_class(topic.type), topic.name,
                                     subscriptions.two_argument_callback(take),
                                     profile, raw=True)
        else:
            subscriptions.subscribe(self, topic, topic.name, take, 'recorded')

    def _record_last(self) -> None:
        self._opening.cancel()
        for index, topic in self._last:
            self._record(index, topic)

    def _receiver(self, index: int, topic: nodes.Link) -> Take:
        """Return the function take(data, info) that checks, counts and writes each message."""
        put = self._into_step(index, topic) if self.graph.lockstep else self._on_arrival(index, topic)
        count = self._lockstep_counter(index, topic) if self.graph.lockstep else self._realtime_counter(index, topic)
        checked = len(topic.writers) == 1 and (self.graph.lockstep or topic.rate not in topics.UNSTEPPED_RATES)
        received = self._received

        def take(data: bytes, info: MessageInfo) -> None:
            received[index] += 1
            try:
                if not checked or count(data, info):
                    put(data, info)
                else:
                    self._bag.write_foreign(index, self._now(), info['source_timestamp'], data)
            except (BagError, OrderError) as error:
                self._fail(str(error))
        return take

    def _lockstep_counter(self, index: int, topic: nodes.Link) -> _Counter:
        """Return the function that checks the sequence numbers of a topic in lockstep. Its value is False for a
        foreign message.

        The numbers of the graph's publisher rise by 1, and begin at 1 on a topic of every step. A gap counts as lost
        messages and ends the run.
        """
        numbers = subscriptions.SoleNumbers(self, topic, topic.name,
                                            first=1 if topic.rate == 'step' and self.graph.members else None)
        readable = Readable(topic.name, topic.type, ours=True)

        def count(data: bytes, info: MessageInfo) -> bool:
            number = info['publication_sequence_number']
            if not numbers.is_next(number):
                if numbers.shows_foreign() or readable.problem(data):
                    return False
                assert numbers.next is not None     # else each number is the next
                if number > numbers.next:
                    self._lost[topic.name] += number - numbers.next
                    self._bag.skip(index, number - numbers.next)
                    self._fail(self._losses())
                elif number != 1:  # a publisher that begins again counts from 1
                    self._fail(f'{topic.name} has more than one publisher: another graph runs on ROS_DOMAIN_ID '
                               f'{self.context.get_domain_id()}; set a free one')
            numbers.note(number)
            return True
        return count

    def _realtime_counter(self, index: int, topic: nodes.Link) -> _Counter:
        """Return the function that counts the missing messages of a topic in realtime. It is False for a foreign
        message.
        """
        publishers = self._heard[topic.name] = TopicPublishers(self, topic)

        def count(data: bytes, info: MessageInfo) -> bool:
            before = publishers.lost
            ours = publishers.take(data, info)
            if publishers.lost > before:
                self._lost[topic.name] = publishers.lost
                self._bag.skip(index, publishers.lost - before)
            return ours
        return count

    def _losses(self) -> str:
        return 'lost ' + ', '.join(f'{count} of {name}' for name, count in self._lost.items())

    def _fail(self, reason: str) -> None:
        """End the node with a reason.

        Because rclpy prints a traceback for an exception in a callback, this function raises none.
        """
        self._error = self._error or reason
        self.finished = True

    def _stamp_in(self, data: bytes) -> Nanoseconds | None:
        try:
            return messages.stamp_of(data)
        except ValueError:
            self._without_stamp += 1
            return None

    def _sender(self, data: bytes) -> str:
        """Return the name of the node that published diagnostics, '' if the message is unreadable."""
        try:
            return messages.deserialize(data, 'diagnostic_msgs/msg/DiagnosticArray').status[0].name
        except (ValueError, IndexError):
            self._without_stamp += 1
            return ''

    def _into_step(self, index: int, topic: nodes.Link) -> Take:
        """Return the function that passes a message of a topic to the StepOrder in lockstep."""
        order, stamp_in, slot = self._order, self._stamp_in, self._order.slot(topic.name)

        def put(data: bytes, _: object) -> Nanoseconds | None:
            stamp = stamp_in(data)
            if stamp is None or slot is None:
                order.take_unplaced(index, data)
            else:
                order.take(slot, stamp, data)
            return stamp

        def put_clock(data: bytes, info: MessageInfo) -> None:
            self._tick(put(data, info))

        def put_event(data: bytes, _: object) -> None:
            order.take_change(index, data)

        def put_diagnostics(data: bytes, _: object) -> None:
            sender, stamp = self._sender(data), stamp_in(data)
            sender_slot = order.slot(topic.name, sender)
            if sender != self.name:
                if sender_slot is None or stamp is None:
                    order.take_unplaced(index, data)
                else:
                    order.take(sender_slot, stamp, data)

        if topic.rate in topics.EVENT_RATES:
            return put_event
        return {'clock': put_clock, 'diagnostics': put_diagnostics}.get(topic.name, put)

    def _log_time(self, stamp: Nanoseconds | None) -> Nanoseconds:
        """Return the log time of a message: its stamp, or the time of the drive.

        The time of the drive replaces a stamp that is missing, that lies in the future, or that is more than
        MAX_STAMP_DISTANCE_NS away from it. A stamp lies in the future if it is later than now by more than
        `graph.future`. Before the start of the run, the start takes the place of now. This avoids a wrong log time of
        the program track, which has the stamp of the start and arrives some seconds before it.
        """
        if stamp is not None:
            now = self._stamp or stamp
            latest = max(self.clock()[1], self.graph.start) + self.graph.future * NS_PER_SECOND
            if abs(stamp - now) < MAX_STAMP_DISTANCE_NS and stamp <= latest:
                return stamp
            self._without_stamp += 1
        return self._now()

    def _now(self) -> Nanoseconds:
        """Return the time of the drive. Before its first message in realtime, UTC takes its place."""
        return self._stamp if self._has_time else self.clock()[1]

    def _on_arrival(self, index: int, topic: nodes.Link) -> Take:
        """Return the function that writes a message of a topic at its arrival in realtime."""
        write, stamp_in, log_time = self._bag.write, self._stamp_in, self._log_time
        clock = PublisherGate(lambda data: (messages.stamp_of(data),) * 2, round(self.graph.future * NS_PER_SECOND))
        # Equipment may run before and after the run.
        of_step, first = topic.rate == 'step', self.graph.start

        def put(data: bytes, info: MessageInfo) -> None:
            stamp = stamp_in(data)
            if not (stamp and of_step) or first <= stamp <= self._last_step:
                write(index, log_time(stamp), info['source_timestamp'], data)

        def put_clock(data: bytes, info: MessageInfo) -> None:
            self._tick(clock.take(data, info['publication_sequence_number'], info['source_timestamp'], *self.clock()))
            put(data, info)

        def put_unstamped(data: bytes, info: MessageInfo) -> None:
            write(index, self._now(), info['source_timestamp'], data)

        def put_diagnostics(data: bytes, info: MessageInfo) -> None:
            if self._sender(data) != self.name:
                put(data, info)

        if topic.type not in STAMPED_TYPES:
            return put_unstamped
        return {'clock': put_clock, 'diagnostics': put_diagnostics}.get(topic.name, put)

    def _tick(self, stamp: Nanoseconds | None) -> None:
        """Take a new time of the drive, None for a rejected message; end the node at the planned end."""
        if stamp is None or stamp < self.graph.start:
            return
        if self.graph.lockstep and stamp // NS_PER_SECOND > self._stamp // NS_PER_SECOND:
            assert self.diagnostics
            self.diagnostics.publish(self._stamp)
        self._stamp, self._has_time = stamp, True
        if self._end is not None and stamp - self.epoch(stamp) >= self._end:
            self._last_step = min(self._last_step, stamp)
            self.finished = True

    def _write(self, write: Callable[[], None]) -> None:
        try:
            write()
        except BagError as error:
            self._fail(str(error))

    def _diagnosis(self) -> Diagnosis:
        level, message = LEVEL_OK, 'recording'
        if self._without_stamp or self._order.unplaced:
            level, message = LEVEL_WARN, 'recording; some messages have no valid stamp or no place in a step'
        doubled = [name for name, publishers in self._heard.items() if publishers.several(time.monotonic_ns())]
        if doubled:
            level, message = LEVEL_WARN, f'recording; {", ".join(doubled)}: more than one publisher'
        if self._lost:
            level, message = LEVEL_ERROR, self._losses()
        return Diagnosis(level, message, [
            ('messages', str(self._bag.messages)), ('waiting steps', str(self._order.waiting)),
            ('lost', str(self._lost.total())), ('without valid stamp', str(self._without_stamp)),
            ('out of order', str(self._order.unplaced))])

    def draining(self) -> bool:
        """Return True while the recorder waits for late messages after the end of the run.

        The wait ends when all steps are written, after QUIET_TIME_S without a message, or after MAX_DRAIN_S.
        """
        now = time.monotonic()
        if self._error is not None:
            return False
        if self._end is not None and self._order.written >= self._end and not self._order.waiting:
            return False
        received = sum(self._received)
        if self._last_arrival is None:
            self._last_arrival, self._drain_end = (now, received), now + MAX_DRAIN_S
        elif received != self._last_arrival[1]:
            self._last_arrival = now, received
        incomplete = received and not all(self._received[index] for index in self._step_topics)
        return now < self._drain_end and (incomplete or now < self._last_arrival[0] + QUIET_TIME_S)

    def close(self) -> None:
        """Write the waiting steps and finish the bag. `result` states its path, messages, losses, size and SHA-256.

        Raises GraphError if an error ended the node, or if messages were lost in lockstep.
        """
        self._write(self._order.finish)
        self._write(self._bag.close)
        self.result = {'bag': str(self._bag.path), 'messages': self._bag.messages, 'lost': self._lost.total(),
                       'sha256': files.sha256(self._bag.file), 'bytes': self._bag.file.stat().st_size}
        if self._error is None and self._lost and self.graph.lockstep:
            self._error = self._losses()
        if self._error is not None:
            raise GraphError(self._error)
