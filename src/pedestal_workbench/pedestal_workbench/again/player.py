"""Player: the ROS node of `pedestal replay` that publishes a Playlist, and waits for subscribers, due times,
acknowledgement and, with --lockstep, the answers of the nodes under test."""
import contextlib
import dataclasses
import struct
import time
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import HistoryPolicy, QoSProfile, ReliabilityPolicy

from pedestal_common.graph import nodes
from pedestal_common.graph.steps import NS_PER_SECOND, GraphError
from pedestal_common.node import middleware, shell
from pedestal_common.quantities import Nanoseconds, Seconds
from pedestal_common.wire import messages
from pedestal_recording import bag as bags
from pedestal_workbench.again.playlist import Playlist, latched, reads
from pedestal_workbench.again.terminal import RIGHT_ARROW_CODES, Keyboard, StatusLine

if TYPE_CHECKING:
    from pedestal_workbench.again.replay import ReplayOptions

ANSWER_TOPICS = {node.name: (None if node.reads[0] in node.writes else node.reads[0], node.answer)
                 for node in nodes.NODES if node.answer}
"""{node: (topic that triggers a step, topic of its answer with the stamp of the step)}.

Because the drive begins the steps itself, it has no trigger. Because the INS answers late by its latency, it is not in
the table.
"""

KEY_HELP = 'space: pause, resume   n or right arrow: one step   q: quit'
MAX_UNACKNOWLEDGED_MESSAGES = 1000
"""Largest number of unacknowledged messages of a topic. Fast DDS keeps 5000, and refuses more."""

QUIET_WAIT_S = 3.0  # time of the wait for a subscriber before it is announced [s]
DISCOVERY_SETTLING_S = 0.5
"""Time from the discovery of the last subscriber to the first message [s]. Other nodes discover each other in it."""

UNDISCOVERED_NODE_PATH = '_NODE_NAMESPACE_UNKNOWN_/_NODE_NAME_UNKNOWN_'
"""Name that the ROS middleware (rmw) states for a node while only its publisher has been discovered."""

POSITION_REFRESH_S, SUBSCRIBER_POLL_S, KEYBOARD_POLL_S = 0.1, 0.5, 0.05
"""Periods of the update of the shown position, of the check of subscribers, and of the check for pressed keys [s]."""

SUBSCRIBER_EXIT_TIMEOUT_S = 5.0
"""Time without acknowledgement after which a lost subscriber counts as killed [s]. A subscriber that ends by itself
disappears at once. Fast DDS waits 20 s for a killed subscriber to acknowledge, and then drops its messages."""

MAX_SPIN_PAUSE_S = 0.01  # largest time between two spins of the player, in which it receives answers [s]

ANSWER_QUIET_S, STOPPED_ARRIVAL_TIMEOUT_S = 0.5, 1.0
"""Time without an answer after which the wait for the last answers ends, and time for which a stopped replay waits for
acknowledgement [s]."""

_stamp_of = struct.Struct('<iI').unpack_from


def answer_of(node: str, graph: Mapping[str, nodes.Link]) -> tuple[str | None, str]:
    """Return the row of ANSWER_TOPICS of a node in a graph. An array answers by the topics of its first beam."""
    trigger, answer = ANSWER_TOPICS[nodes.plain(node)]

    def of_beam(name: str) -> str:
        return name if name in graph else f'{nodes.beam_of(node) or "beam_1"}/{name}'
    return trigger and of_beam(trigger), of_beam(answer)


@dataclasses.dataclass
class NodeUnderTest:
    """A live node that receives the replayed messages and must answer every step."""
    name: str
    trigger: str | None     # topic that begins a step, None for a node that begins the steps itself
    answer: str     # topic of its answers
    triggered: Nanoseconds = -1     # stamp of the last trigger, -1 before the first
    answered: Nanoseconds = -1      # stamp of the last answer, -1 before the first
    steps: int = 0      # number of triggers
    answers: int = 0    # number of answers

    def owes(self, stamp: Nanoseconds = -1) -> bool:
        """Return True if the node must still answer before a stamp may be published."""
        return self.answered < (stamp if self.trigger is None else self.triggered)

    def silence(self, stamp: Nanoseconds, deadline: Seconds) -> GraphError:
        """Return the GraphError for an answer that was missing for longer than the deadline."""
        step = stamp if self.trigger is None else self.triggered
        return GraphError(f'no {self.answer} for step {step / NS_PER_SECOND:.6f} s after {deadline:g} s; silent: '
                          f'{self.name}')


class Pace:
    """Due times of the messages. Keys pause the replay, make a single step or quit. rate: multiples of real time, None
    if each message is due at once."""

    def __init__(self, rate: float | None, paused: bool) -> None:
        self.rate, self.paused, self.quit = rate, paused, False
        self._steps = 0
        self._base: tuple[Seconds, Nanoseconds] | None = None

    def press(self, key: bytes) -> None:
        """Apply a pressed key, see KEY_HELP."""
        if key == b' ':
            self.paused, self._steps = not self.paused, 0
        elif key == b'n' or key in RIGHT_ARROW_CODES:
            self._steps += self.paused
            self.paused = True
        elif key == b'q':
            self.quit = True

    def wait(self, stamp: Nanoseconds, now: Seconds) -> Seconds:
        """Return the time to wait until a stamp is due; now: steady time. A step that a key requested is used up."""
        if self.paused:
            self._base = None
            if self._steps:
                self._steps -= 1
                return 0.0
            return KEYBOARD_POLL_S
        if self.rate is None:
            return 0.0
        if self._base is None:
            self._base = now, stamp
        return self._base[0] + (stamp - self._base[1]) / NS_PER_SECOND / self.rate - now

    def __str__(self) -> str:
        return 'paused' if self.paused else 'lockstep' if self.rate is None else f'{self.rate:g} x'


@dataclasses.dataclass
class Channel:
    """A published topic."""
    publisher: Publisher
    sent: int = 0   # number of messages
    arrived: int = 0    # number of messages known as acknowledged


class Player(Node):
    """ROS node that publishes a Playlist as the ReplayOptions state, until stopped() returns True.

    Each topic must have the nodes of the options as its subscribers or, without nodes, any subscriber. Only the
    companion (the clock) needs none, and is published if it has no other publisher.
    """

    def __init__(self, playlist: Playlist, companion: str | None, options: 'ReplayOptions', keyboard: Keyboard,
                 stopped: Callable[[], bool]) -> None:
        super().__init__(nodes.REPLAY_NODE)
        self.playlist, self.companion = playlist, companion
        self.nodes, self.deadline = options.nodes, options.deadline
        self.keyboard, self.stopped, self.status = keyboard, stopped, StatusLine()
        self.graph = playlist.bag.graph
        self.channels = {name: Channel(self._publisher(name, playlist.bag.topics[name])) for name in playlist.names}
        self.under_test = [NodeUnderTest(node, *answer_of(node, self.graph)) for node in self.nodes
                           if nodes.plain(node) in ANSWER_TOPICS]
        self.pace = Pace(options.rate, options.paused)
        for topic in self.graph.values():
            if any(node in topic.writers for node in self.nodes):
                self._listen(topic)
        self.spinner = middleware.make_executor()
        self.spinner.add_node(self)
        self.position = playlist.first
        self._next_refresh = self._next_subscriber_check = self._last_spin = 0.0    # monotonic [s]

    def _publisher(self, name: str, type_name: str) -> Publisher:
        topic = self.graph.get(name)
        if topic is not None and topic.type != type_name:
            raise bags.BagError(f'{self.playlist.bag.path}: {name} is a {type_name}; must be a {topic.type}')
        try:
            kind = middleware.message_class(type_name)
        except (ImportError, AttributeError, ValueError):
            raise bags.BagError(f'{self.playlist.bag.path}: {name} is of type {type_name}, which is not installed; '
                                'choose other topics with --topics') from None
        return self.create_publisher(kind, name, middleware.qos(topic.rate if topic is not None else 'step'))

    def _listen(self, topic: nodes.Link) -> None:
        """Subscribe to an output of a node under test, as the missing nodes would."""
        node = next((node for node in self.under_test if node.answer == topic.name), None)

        def take(data: bytes) -> None:
            if node is not None:
                seconds, nanoseconds = _stamp_of(data, messages.CDR_HEADER_BYTES)
                node.answered = max(node.answered, seconds * NS_PER_SECOND + nanoseconds)
                node.answers += 1
        profile = QoSProfile(history=HistoryPolicy.KEEP_ALL, depth=1, reliability=ReliabilityPolicy.RELIABLE)
        self.create_subscription(middleware.message_class(topic.type), topic.name, take, profile, raw=True)

    def _spin(self, seconds: Seconds) -> None:
        self.spinner.spin_once(timeout_sec=seconds)
        self._last_spin = time.monotonic()

    def _other_writers(self, name: str) -> list[str]:
        """Return the names of the other nodes that publish a topic. Of a topic with several publishers, such as the
        diagnostics, only the recorded nodes count."""
        others = [shell.node_of(info) for info in self.get_publishers_info_by_topic(name)]
        if self.get_name() in others:
            others.remove(self.get_name())
        topic = self.graph.get(name)
        return [node for node in others if topic is None or len(topic.writers) == 1 or node in topic.writers]

    def _unread(self) -> tuple[str, str] | None:
        """Return (topic, its missing subscribers as a text) of the first topic without its subscribers, or None."""
        for name, channel in self.channels.items():
            if name == self.companion:
                continue
            readers = [shell.node_of(info) for info in self.get_subscriptions_info_by_topic(name)]
            wanted = [node for node in self.nodes if reads(self.graph, node, name)]
            lacking = [node for node in wanted if node not in readers]
            if lacking or channel.publisher.get_subscription_count() < max(1, len(wanted)):
                return name, ', '.join(lacking or wanted) or 'any node'
        return None

    def connect(self) -> bool:
        """Wait until each topic has its subscribers. Return False if the replay ended meanwhile.

        Raises GraphError for another publisher, and without a subscriber after the deadline. Because a publisher whose
        node is not discovered yet may be one of this node, it counts only after the deadline.
        """
        begun = settled = time.monotonic()
        while not self._ended():
            unread, now = self._unread(), time.monotonic()
            for name in self.channels:
                others = self._other_writers(name) if name != self.companion else []
                if UNDISCOVERED_NODE_PATH in others and now - begun < self.deadline:
                    settled = now
                elif others:
                    raise GraphError(f'{name} already has a publisher, {", ".join(others)}: messages would come twice')
            if unread:
                settled = now
                name, missing = unread
                if now - begun > QUIET_WAIT_S:
                    self.status.announce(f'waits for {missing} to subscribe to {name}, {self.deadline:g} s at most')
                if now - begun > self.deadline:
                    present = sorted(set(self.get_node_names()) - {self.get_name()})
                    raise GraphError(f'no subscriber of {name} after {self.deadline:g} s; waited for {missing}; '
                                     f'present: {", ".join(present) or "no node"}')
            elif now - settled > DISCOVERY_SETTLING_S:
                if self.companion and self._other_writers(self.companion):
                    self.destroy_publisher(self.channels.pop(self.companion).publisher)
                return True
            self._spin(KEYBOARD_POLL_S)
        return False

    def play(self) -> None:
        """Publish the messages until the end of the playlist, a key or a signal. Raises GraphError for a lost
        subscriber or a missing answer, and shell.Stopped after a signal while a subscriber acknowledges nothing."""
        for stamp, group in self.playlist.steps():
            if not self._await_turn(stamp):
                return
            self.position = stamp
            for name, data in group:
                if name in self.channels:
                    if latched(self.graph, name):
                        self._announce(name, stamp, data)
                    else:
                        self._send(name, stamp, data)

    def _announce(self, name: str, stamp: Nanoseconds, data: bytes) -> None:
        """Publish a message of a latched topic. All earlier messages arrive before it, all later messages after it."""
        for other in self.channels:
            self._await_arrival(other, self.deadline)
        self._send(name, stamp, data)
        self._await_arrival(name, self.deadline)

    def _send(self, name: str, stamp: Nanoseconds, data: bytes) -> None:
        channel = self.channels[name]
        if channel.sent - channel.arrived >= MAX_UNACKNOWLEDGED_MESSAGES:
            self._await_arrival(name, self.deadline)
        channel.publisher.publish(data)
        channel.sent += 1
        for node in self.under_test:
            if name == node.trigger:
                node.triggered, node.steps = stamp, node.steps + 1

    def _await_arrival(self, name: str, limit: Seconds) -> None:
        """Wait until all messages of a topic are acknowledged. Raises GraphError after the limit or if a subscriber
        died, and shell.Stopped after a signal."""
        channel = self.channels[name]
        since, readers = time.monotonic(), channel.publisher.get_subscription_count()
        while not channel.publisher.wait_for_all_acked(Duration(seconds=0)):
            waited = time.monotonic() - since
            if waited > STOPPED_ARRIVAL_TIMEOUT_S and self.stopped():
                raise shell.Stopped
            if waited > limit:
                raise GraphError(f'a subscriber of {name} acknowledged nothing for {limit:g} s')
            self._spin(0.002)
        late = time.monotonic() > since + SUBSCRIBER_EXIT_TIMEOUT_S
        if late and channel.publisher.get_subscription_count() < readers:
            raise GraphError(f'a subscriber of {name} died before it had acknowledged all messages')
        channel.arrived = channel.sent

    def _await_turn(self, stamp: Nanoseconds) -> bool:
        """Wait until the messages of a stamp are due; return False if the replay ends instead."""
        since = time.monotonic()
        while True:
            for key in self.keyboard.pressed():
                self.pace.press(key)
            if self._ended():
                return False
            now = time.monotonic()
            self._show_position(now)
            self._check_subscribers(now)
            wait = self._time_to_wait(stamp, now, since)
            if wait <= 0.0:
                # At a high rate the player never waits, so it must spin here to receive the answers.
                if now - self._last_spin > MAX_SPIN_PAUSE_S:
                    self._spin(0)
                return True
            self._spin(min(wait, KEYBOARD_POLL_S))

    def _ended(self) -> bool:
        return self.pace.quit or self.stopped()

    def _time_to_wait(self, stamp: Nanoseconds, now: Seconds, since: Seconds) -> Seconds:
        """Return the time to wait for a stamp. Raises GraphError if an answer is missing after the deadline."""
        late = self._late(stamp) if self.pace.rate is None else None
        if late is None:
            return self.pace.wait(stamp, now)
        if now - since > self.deadline:
            raise late.silence(stamp, self.deadline)
        return KEYBOARD_POLL_S

    def _late(self, stamp: Nanoseconds = -1) -> NodeUnderTest | None:
        return next((node for node in self.under_test if node.owes(stamp)), None)

    def _show_position(self, now: Seconds) -> None:
        if now >= self._next_refresh:
            self._next_refresh = now + POSITION_REFRESH_S
            start, end = self.playlist.origin, self.playlist.end
            position, length = (self.position - start) / NS_PER_SECOND, (end - start) / NS_PER_SECOND
            self.status.show(f'{position:.3f} / {length:.3f} s  {self.pace}'
                             + (f'   {KEY_HELP}' if self.keyboard.available else ''))

    def _check_subscribers(self, now: Seconds) -> None:
        if now >= self._next_subscriber_check:
            self._next_subscriber_check = now + SUBSCRIBER_POLL_S
            unread = self._unread()
            if unread:
                name, missing = unread
                raise GraphError(f'{name} lost its subscriber at {self.position / NS_PER_SECOND:.6f} s: {missing}')

    def finish(self) -> None:
        """Wait until all messages are acknowledged and the nodes under test have answered. Raises GraphError. After a
        key or a signal to end, wait for acknowledgement only."""
        if self._ended():
            with contextlib.suppress(GraphError, shell.Stopped):
                for name in self.channels:
                    self._await_arrival(name, STOPPED_ARRIVAL_TIMEOUT_S)
            return
        for name in self.channels:
            self._await_arrival(name, self.deadline)
        limit = self.deadline if self.pace.rate is None else ANSWER_QUIET_S
        count, since = -1, 0.0
        while (late := self._late()) and not self._ended():
            now, answers = time.monotonic(), sum(node.answers for node in self.under_test)
            if answers != count:
                count, since = answers, now
            elif now - since > limit:
                if self.pace.rate is None:
                    raise late.silence(-1, self.deadline)
                return
            self._spin(KEYBOARD_POLL_S)

    def close(self) -> None:
        """Leave the graph."""
        self.status.clear()
        self.spinner.remove_node(self)
        self.spinner.shutdown()
        self.destroy_node()
