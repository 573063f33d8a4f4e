"""The node that publishes a recording: whom it waits for, when a message is due, what has arrived."""
import contextlib
import dataclasses
import struct
import time

from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.qos import HistoryPolicy, QoSProfile, ReliabilityPolicy

from pedestal_analysis.reprocess.playlist import latched, reads
from pedestal_analysis.reprocess.terminal import RIGHT_ARROW_CODES, StatusLine
from pedestal_common.graph import nodes
from pedestal_common.graph.steps import NS_PER_SECOND, GraphError
from pedestal_common.node import middleware, shell
from pedestal_recording import bag as bags

ANSWER_TOPICS = {node.name: (None if node.reads[0] in node.writes else node.reads[0], node.answer)
                 for node in nodes.NODES if node.answer}
"""{node: (topic, the topic on which the node answers it in every step, with the same stamp)}: what lockstep waits for.
The drive begins the steps: it answers nothing (None). The INS answers late, by its latency, and is not waited for."""

KEY_HELP = 'space: pause, go on   n or right arrow: one step   q: quit'
MAX_UNACKNOWLEDGED_MESSAGES = 1000
"""Messages of a topic that may be unacknowledged: Fast DDS keeps 5000 and refuses more."""

DISCOVERY_SETTLING_S = 0.5
"""Seconds from the coming of the last reader to the first message, in which other nodes still find each other."""

UNDISCOVERED_NODE_PATH = '_NODE_NAMESPACE_UNKNOWN_/_NODE_NAME_UNKNOWN_'
"""What rmw calls the node of a writer it has found before it has found the node."""

POSITION_REFRESH_S, SUBSCRIBER_POLL_S, KEYBOARD_POLL_S = 0.1, 0.5, 0.05
"""Seconds between two looks at the position shown, at who still reads, at the keyboard while waiting."""

SUBSCRIBER_EXIT_TIMEOUT_S = 5.0
"""Seconds that tell a reader that ended, which is known at once, from one that was killed: Fast DDS waits 20 s for it
and then forgets what it did not take."""

ANSWER_QUIET_S, STOPPED_ARRIVAL_TIMEOUT_S = 0.5, 1.0
"""Seconds without another answer after which the node under test has answered all; seconds a stopped replay waits
until what it sent has arrived."""

_stamp_of = struct.Struct('<iI').unpack_from


def answer_of(node, graph):
    """ANSWER_TOPICS of a node by its name in a graph {name: Link}; an array of several beams is asked by its first."""
    return tuple(name if name is None or name in graph else f'{nodes.beam_of(node) or "beam_1"}/{name}'
                 for name in ANSWER_TOPICS[nodes.plain(node)])


@dataclasses.dataclass
class NodeUnderTest:
    """A node that answers every step: the topic that asks it (None: it asks), the one it answers on; stamps [ns] of
    the last step it was asked and of its last answer; how many of both."""
    name: str
    trigger: str | None
    answer: str
    asked: int = -1
    answered: int = -1
    steps: int = 0
    answers: int = 0

    def owes(self, stamp=-1):
        """Whether it must answer before the messages of this stamp may go out."""
        return self.answered < (stamp if self.trigger is None else self.asked)

    def silence(self, stamp, deadline):
        """The GraphError when it did not answer within the deadline [s]."""
        step = stamp if self.trigger is None else self.asked
        return GraphError(f'no {self.answer} for step {step / NS_PER_SECOND:.6f} s after {deadline:g} s; silent: {self.name}')


class Pace:
    """When messages go out: `rate` times real time, None: at once. Keys pause it, let single steps through, quit."""

    def __init__(self, rate, paused):
        self.rate, self.paused, self.quit = rate, paused, False
        self._steps = 0
        self._base = None

    def press(self, key):
        """Do what a key says."""
        if key == b' ':
            self.paused, self._steps = not self.paused, 0
        elif key == b'n' or key in RIGHT_ARROW_CODES:
            self._steps += self.paused
            self.paused = True
        elif key == b'q':
            self.quit = True

    def wait(self, stamp, now):
        """Seconds from now [s] until the messages of a stamp [ns] go out; 0 for a single step, which it uses up."""
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

    def __str__(self):
        return 'paused' if self.paused else 'lockstep' if self.rate is None else f'{self.rate:g} x'


@dataclasses.dataclass
class Channel:
    """A topic that is published: its publisher, how many were sent, how many of them had arrived at the last look."""
    publisher: object
    sent: int = 0
    arrived: int = 0


class Player(Node):
    """Publishes a Playlist as ReplayOptions say.

    The nodes of the options must read every topic, or anyone when there are none. companion: a topic that goes along
    where nobody else writes it, read or not. stopped() -> whether it shall end.
    """

    def __init__(self, playlist, companion, options, keyboard, stopped):
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
        self._next_look = self._next_readers = self._spun = 0.0

    def _publisher(self, name, type_name):
        topic = self.graph.get(name)
        if topic is not None and topic.type != type_name:
            raise bags.BagError(f'{self.playlist.bag.path}: {name} is a {type_name}; must be a {topic.type}')
        try:
            kind = middleware.message_class(type_name)
        except (ImportError, AttributeError, ValueError):
            raise bags.BagError(f'{self.playlist.bag.path}: {name} is of type {type_name}, which is not installed '
                                'here; choose others with --topics') from None
        return self.create_publisher(kind, name, middleware.qos(topic.rate if topic is not None else 'step'))

    def _listen(self, topic):
        """Read what a node under test writes, in the place of the nodes that are not there."""
        node = next((node for node in self.under_test if node.answer == topic.name), None)

        def take(data):
            if node is not None:
                seconds, nanoseconds = _stamp_of(data, 4)
                node.answered = max(node.answered, seconds * NS_PER_SECOND + nanoseconds)
                node.answers += 1
        profile = QoSProfile(history=HistoryPolicy.KEEP_ALL, depth=1, reliability=ReliabilityPolicy.RELIABLE)
        self.create_subscription(middleware.message_class(topic.type), topic.name, take, profile, raw=True)

    def _spin(self, seconds):
        self.spinner.spin_once(timeout_sec=seconds)
        self._spun = time.monotonic()

    def _other_writers(self, name):
        """The others that write a topic; of one that every node writes, those whose messages would be doubled."""
        others = [shell.node_of(info) for info in self.get_publishers_info_by_topic(name)]
        if self.get_name() in others:
            others.remove(self.get_name())
        topic = self.graph.get(name)
        return [node for node in others if topic is None or len(topic.writers) == 1 or node in topic.writers]

    def _unread(self):
        """(topic, who should read it) of the first that is not read; None when all are."""
        for name, channel in self.channels.items():
            if name == self.companion:
                continue
            readers = [shell.node_of(info) for info in self.get_subscriptions_info_by_topic(name)]
            wanted = [node for node in self.nodes if reads(self.graph, node, name)]
            lacking = [node for node in wanted if node not in readers]
            if lacking or channel.publisher.get_subscription_count() < max(1, len(wanted)):
                return name, ', '.join(lacking or wanted) or 'anyone'
        return None

    def connect(self):
        """Wait until every topic has its readers; True, or False when stopped meanwhile.

        Raises GraphError when a topic has a writer already, or is read by nobody after the deadline.
        """
        begun = settled = time.monotonic()
        while not self._ended():
            unread, now = self._unread(), time.monotonic()
            for name in self.channels:
                others = self._other_writers(name) if name != self.companion else []
                if UNDISCOVERED_NODE_PATH in others and now - begun < self.deadline:
                    settled = now
                elif others:
                    raise GraphError(f'{name} already has a writer, {", ".join(others)}: its messages would come '
                                     'twice')
            if unread:
                settled = now
                name, who = unread
                self.status.show(f'waiting for {who} to read {name} ...')
                if now - begun > self.deadline:
                    present = sorted(set(self.get_node_names()) - {self.get_name()})
                    raise GraphError(f'nobody reads {name} after {self.deadline:g} s; waited for {who}; present: '
                                     f'{", ".join(present) or "no node"}')
            elif now - settled > DISCOVERY_SETTLING_S:
                if self.companion and self._other_writers(self.companion):
                    self.destroy_publisher(self.channels.pop(self.companion).publisher)
                return True
            self._spin(KEYBOARD_POLL_S)
        return False

    def play(self):
        """Publish to the end of the list, or until quit or stopped. Raises GraphError when a reader goes, or when an
        answer of lockstep stays away for the deadline; shell.Stopped when stopped while a reader takes nothing."""
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

    def _announce(self, name, stamp, data):
        for other in self.channels:
            self._await_arrival(other, self.deadline)
        self._send(name, stamp, data)
        self._await_arrival(name, self.deadline)

    def _send(self, name, stamp, data):
        channel = self.channels[name]
        if channel.sent - channel.arrived >= MAX_UNACKNOWLEDGED_MESSAGES:
            self._await_arrival(name, self.deadline)
        channel.publisher.publish(data)
        channel.sent += 1
        for node in self.under_test:
            if name == node.trigger:
                node.asked, node.steps = stamp, node.steps + 1

    def _await_arrival(self, name, limit):
        channel = self.channels[name]
        since, readers = time.monotonic(), channel.publisher.get_subscription_count()
        while not channel.publisher.wait_for_all_acked(Duration(seconds=0)):
            waited = time.monotonic() - since
            if waited > STOPPED_ARRIVAL_TIMEOUT_S and self.stopped():
                raise shell.Stopped
            if waited > limit:
                raise GraphError(f'a reader of {name} took nothing for {limit:g} s')
            self._spin(0.002)
        if time.monotonic() > since + SUBSCRIBER_EXIT_TIMEOUT_S and channel.publisher.get_subscription_count() < readers:
            raise GraphError(f'a reader of {name} died before it had taken all')
        channel.arrived = channel.sent

    def _await_turn(self, stamp):
        """Wait until the messages of a stamp are due; False when it is the end instead."""
        since = time.monotonic()
        while True:
            for key in self.keyboard.pressed():
                self.pace.press(key)
            if self._ended():
                return False
            now = time.monotonic()
            self._look(now)
            wait = self._wait(stamp, now, since)
            if wait <= 0.0:
                if now - self._spun > 0.01:
                    self._spin(0)
                return True
            self._spin(min(wait, KEYBOARD_POLL_S))

    def _ended(self):
        return self.pace.quit or self.stopped()

    def _wait(self, stamp, now, since):
        """Seconds until the messages of a stamp go out, which are waited for since then; as far as one can tell."""
        late = self._late(stamp) if self.pace.rate is None else None
        if late is None:
            return self.pace.wait(stamp, now)
        if now - since > self.deadline:
            raise late.silence(stamp, self.deadline)
        return KEYBOARD_POLL_S

    def _late(self, stamp=-1):
        return next((node for node in self.under_test if node.owes(stamp)), None)

    def _look(self, now):
        if now >= self._next_look:
            self._next_look = now + POSITION_REFRESH_S
            start, end = self.playlist.origin, self.playlist.end
            self.status.show(f'{(self.position - start) / NS_PER_SECOND:.3f} / {(end - start) / NS_PER_SECOND:.3f} s  {self.pace}'
                             + (f'   {KEY_HELP}' if self.keyboard.there else ''))
        if now >= self._next_readers:
            self._next_readers = now + SUBSCRIBER_POLL_S
            unread = self._unread()
            if unread:
                name, who = unread
                raise GraphError(f'{name} is no longer read by {who}, at {self.position / NS_PER_SECOND:.6f} s')

    def finish(self):
        """Wait until everything sent has arrived and the nodes under test have answered. Raises GraphError after the
        deadline; a stopped replay waits only for what it sent, and only a little."""
        if self._ended():
            with contextlib.suppress(GraphError, shell.Stopped):
                for name in self.channels:
                    self._await_arrival(name, STOPPED_ARRIVAL_TIMEOUT_S)
            return
        for name in self.channels:
            self._await_arrival(name, self.deadline)
        limit = self.deadline if self.pace.rate is None else ANSWER_QUIET_S
        count, since = -1, 0.0
        while self._late() and not self._ended():
            now, answers = time.monotonic(), sum(node.answers for node in self.under_test)
            if answers != count:
                count, since = answers, now
            elif now - since > limit:
                if self.pace.rate is None:
                    raise self._late().silence(-1, self.deadline)
                return
            self._spin(KEYBOARD_POLL_S)

    def close(self):
        """Leave the graph."""
        self.status.clear()
        self.spinner.remove_node(self)
        self.spinner.shutdown()
        self.destroy_node()
