"""`pedestal replay`: a recording published into a live graph in the order of its Playlist, bytes as recorded."""
import contextlib
import dataclasses
import math
import signal
import struct
import time

import rclpy
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.qos import HistoryPolicy, QoSProfile, ReliabilityPolicy

from pedestal_bringup.again.playlist import Playlist, latched, reads, select, writes
from pedestal_bringup.again.terminal import RIGHT, Keyboard, StatusLine
from pedestal_bringup.bags import bag as bags
from pedestal_common import middleware, nodes, shell
from pedestal_common.steps import SECOND, GraphError

ANSWERS = {node.name: (None if node.reads[0] in node.writes else node.reads[0], node.answer)
           for node in nodes.NODES if node.answer}
"""{node: (topic, what the node answers it with in every step, stamped alike)}: what lockstep waits for. The drive
asks: it says the step, and takes the answer. The INS answers late, by its latency: there is no waiting for it."""


def answer_of(node, graph):
    """ANSWERS of a node by its name in a graph; an array of several beams is asked by its first."""
    return tuple(name if name is None or name in graph else f'{nodes.beam_of(node) or "beam_1"}/{name}'
                 for name in ANSWERS[nodes.plain(node)])


HELP = 'space: pause, go on   n or right arrow: one step   q: quit'
WINDOW = 1000
"""Messages of a topic that may be unacknowledged: Fast DDS keeps 5000 and refuses more."""

SETTLING = 0.5
"""Seconds from the last reader's coming to the first message: others are still finding each other."""

UNKNOWN = '_NODE_NAMESPACE_UNKNOWN_/_NODE_NAME_UNKNOWN_'
"""What rmw calls the node of a writer it has found before it has found the node."""

LOOK, READERS_LOOK, KEY_LOOK = 0.1, 0.5, 0.05
"""Seconds between two looks at the position shown, at who still reads, at the keyboard while waiting."""

LEAVE = 5.0
"""A reader that ends says so at once; for one that was killed Fast DDS waits 20 s and then forgets what it did not
take. Seconds after which it was the latter."""

QUIET, PARTING = 0.5, 1.0
"""Seconds without another answer after which the node under test has said all; seconds a stopped replay waits until
what it sent has arrived."""

_stamp_of = struct.Struct('<iI').unpack_from


@dataclasses.dataclass
class Channel:
    """A topic that is published: its publisher, how many were sent, how many of them had arrived at the last look."""
    publisher: object
    sent: int = 0
    arrived: int = 0


@dataclasses.dataclass
class Outcome:
    """What was sent {topic: count}, over which stamps [s], in which wall time [s]; what was answered {node: count}.
    ended: 'whole', 'quit' (by key) or 'stopped' (by a signal)."""
    bag: str
    sent: dict
    first: float
    last: float
    wall: float
    steps: dict
    answers: dict
    ended: str

    def lines(self):
        width = max(map(len, self.sent))
        lines = [f'{name:{width}} {count:9}' for name, count in self.sent.items()]
        lines += [f'{node} answered {count} of {self.steps[node]} steps' for node, count in self.answers.items()]
        span = self.last - self.first
        factor = f' ({span / self.wall:.3g} x real time)' if self.ended == 'whole' and span > 0.0 else ''
        return [*lines, f'{self.bag}: {sum(self.sent.values())} messages sent, from {self.first:.6f} to '
                        f'{self.last:.6f} s in {self.wall:.3f} s{factor}'
                        + ('' if self.ended == 'whole' else f'; {self.ended} before the end')]


class Player(Node):
    """Publishes a Playlist.

    under_test: the nodes under test; every topic must have them as readers, or anyone when there are none. rate None:
    lockstep. companion: a topic that goes along where nobody else writes it, read or not. stopped() -> True when it
    shall end.
    """

    def __init__(self, playlist, companion, under_test, rate, paused, deadline, keyboard, stopped):
        super().__init__(nodes.STAND_IN)
        self.playlist, self.nodes, self.rate, self.paused = playlist, under_test, rate, paused
        self.deadline, self.keyboard, self.stopped = deadline, keyboard, stopped
        self.companion = companion
        self.channels = {name: Channel(self._publisher(name, playlist.bag.topics[name])) for name in playlist.names}
        self.graph = playlist.bag.graph
        self.answers = {node: answer_of(node, self.graph) for node in under_test if nodes.plain(node) in ANSWERS}
        self.asked, self.asked_steps, self.answered = {}, {}, dict.fromkeys(self.answers, -1)
        self.answer_count = dict.fromkeys(self.answers, 0)
        for topic in self.graph.values():
            if any(node in topic.writers for node in under_test):
                self._listen(topic)
        self.spinner = middleware.make_executor()
        self.spinner.add_node(self)
        self.quit = False
        self.single = 0
        self.base = None
        self.position = playlist.first
        self.next_look = self.next_readers = self.spun = 0.0
        self.status = StatusLine()

    def _publisher(self, name, type_name):
        topic = self.playlist.bag.graph.get(name)
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
        answered, count = self.answered, self.answer_count
        node = next((node for node, (_, answer) in self.answers.items() if answer == topic.name), None)

        def take(data):
            if node is not None:
                seconds, nanoseconds = _stamp_of(data, 4)
                answered[node] = max(answered[node], seconds * SECOND + nanoseconds)
                count[node] += 1
        profile = QoSProfile(history=HistoryPolicy.KEEP_ALL, depth=1, reliability=ReliabilityPolicy.RELIABLE)
        self.create_subscription(middleware.message_class(topic.type), topic.name, take, profile, raw=True)

    def _spin(self, seconds):
        self.spinner.spin_once(timeout_sec=seconds)
        self.spun = time.monotonic()

    def _writers(self, name):
        """The others that write a topic; of one that every node writes, those whose messages would be doubled."""
        found = [shell.node_of(info) for info in self.get_publishers_info_by_topic(name)]
        if self.get_name() in found:
            found.remove(self.get_name())
        topic = self.graph.get(name)
        return [node for node in found if topic is None or len(topic.writers) == 1 or node in topic.writers]

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
                live = self._writers(name) if name != self.companion else []
                if UNKNOWN in live and now - begun < self.deadline:
                    settled = now
                elif live:
                    raise GraphError(f'{name} already has a writer, {", ".join(live)}: its messages would come twice')
            if unread:
                settled = now
                name, who = unread
                self.status.show(f'waiting for {who} to read {name} ...')
                if now - begun > self.deadline:
                    present = sorted(set(self.get_node_names()) - {self.get_name()})
                    raise GraphError(f'nobody reads {name} after {self.deadline:g} s; waited for {who}; present: '
                                     f'{", ".join(present) or "no node"}')
            elif now - settled > SETTLING:
                if self.companion and self._writers(self.companion):
                    self.destroy_publisher(self.channels.pop(self.companion).publisher)
                return True
            self._spin(KEY_LOOK)
        return False

    def play(self):
        """Publish to the end of the list, or until `quit` or stopped. Raises GraphError when a reader goes, or when
        an answer of lockstep stays away for the deadline; shell.Stopped when stopped while a reader takes nothing."""
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
        if channel.sent - channel.arrived >= WINDOW:
            self._await_arrival(name, self.deadline)
        channel.publisher.publish(data)
        channel.sent += 1
        for node, (trigger, _) in self.answers.items():
            if name == trigger:
                self.asked[node] = stamp
                self.asked_steps[node] = self.asked_steps.get(node, 0) + 1

    def _await_arrival(self, name, limit):
        channel = self.channels[name]
        since, readers = time.monotonic(), channel.publisher.get_subscription_count()
        while not channel.publisher.wait_for_all_acked(Duration(seconds=0)):
            waited = time.monotonic() - since
            if waited > PARTING and self.stopped():
                raise shell.Stopped
            if waited > limit:
                raise GraphError(f'a reader of {name} took nothing for {limit:g} s')
            self._spin(0.002)
        if time.monotonic() > since + LEAVE and channel.publisher.get_subscription_count() < readers:
            raise GraphError(f'a reader of {name} died before it had taken all')
        channel.arrived = channel.sent

    def _await_turn(self, stamp):
        """Wait until the messages of a stamp are due; False when it is the end instead."""
        waiting_since = time.monotonic()
        while True:
            for key in self.keyboard.pressed():
                self._press(key)
            if self._ended():
                return False
            now = time.monotonic()
            self._look(now)
            wait = self._wait(stamp, now, waiting_since)
            if wait <= 0.0:
                if now - self.spun > 0.01:
                    self._spin(0)
                return True
            self._spin(min(wait, KEY_LOOK))

    def _ended(self):
        return self.quit or self.stopped()

    def _wait(self, stamp, now, since):
        """Seconds until the messages of this stamp go out; as far as one can tell."""
        if self.rate is None:
            late = self._unanswered(stamp)
            if late:
                if now - since > self.deadline:
                    raise self._silence(late, stamp)
                return KEY_LOOK
        if self.paused:
            self.base = None
            if self.single:
                self.single -= 1
                return 0.0
            return KEY_LOOK
        if self.rate is None:
            return 0.0
        if self.base is None:
            self.base = now, stamp
        return self.base[0] + (stamp - self.base[1]) / SECOND / self.rate - now

    def _unanswered(self, stamp):
        """The node that has yet to speak before the messages of this stamp may go out; None when all have."""
        for node, (trigger, _) in self.answers.items():
            if self.answered[node] < (stamp if trigger is None else self.asked.get(node, -1)):
                return node
        return None

    def _silence(self, node, stamp):
        _, answer = self.answers[node]
        return GraphError(f'no {answer} for step {self.asked.get(node, stamp) / SECOND:.6f} s after '
                          f'{self.deadline:g} s; silent: {node}')

    def _press(self, key):
        if key == b' ':
            self.paused, self.single = not self.paused, 0
        elif key == b'n' or key in RIGHT:
            self.single += self.paused
            self.paused = True
        elif key == b'q':
            self.quit = True

    def _look(self, now):
        if now >= self.next_look:
            self.next_look = now + LOOK
            self._show_position()
        if now >= self.next_readers:
            self.next_readers = now + READERS_LOOK
            gone = self._unread()
            if gone:
                name, who = gone
                raise GraphError(f'{name} is no longer read by {who}, at {self.position / SECOND:.6f} s')

    def _show_position(self):
        origin, end = self.playlist.origin, self.playlist.end
        state = 'paused' if self.paused else 'lockstep' if self.rate is None else f'{self.rate:g} x'
        self.status.show(f'{(self.position - origin) / SECOND:.3f} / {(end - origin) / SECOND:.3f} s  {state}'
                         + (f'   {HELP}' if self.keyboard.there else ''))

    def finish(self):
        """Wait until everything sent has arrived and the nodes under test have answered. Raises GraphError after the
        deadline; a stopped replay waits for what it sent only, and only a little."""
        if self._ended():
            with contextlib.suppress(GraphError, shell.Stopped):
                for name in self.channels:
                    self._await_arrival(name, PARTING)
            return
        for name in self.channels:
            self._await_arrival(name, self.deadline)
        limit = self.deadline if self.rate is None else QUIET
        heard, since = -1, 0.0
        while self._unanswered(-1) and not self._ended():
            now, answers = time.monotonic(), sum(self.answer_count.values())
            if answers != heard:
                heard, since = answers, now
            elif now - since > limit:
                if self.rate is None:
                    raise self._silence(self._unanswered(-1), -1)
                return
            self._spin(KEY_LOOK)


    def close(self):
        self.status.clear()
        self.spinner.remove_node(self)
        self.spinner.shutdown()
        self.destroy_node()


@contextlib.contextmanager
def _stop_by_signal():
    """stopped() -> whether SIGINT has come: rclpy must not be left in the middle of a call."""
    came = []
    before = signal.signal(signal.SIGINT, lambda *_: came.append(True))
    try:
        yield lambda: bool(came)
    finally:
        signal.signal(signal.SIGINT, before)


def replay(path, under_test, names, rate, start=0.0, duration=None, paused=False, deadline=60.0,
           ready=lambda: None) -> Outcome:
    """Publish a bag into the live graph of this ROS domain.

    under_test: what these nodes read, or names: these topics, or neither: all. rate: times real time; None: lockstep
    with them.
    start, duration, deadline [s]. ready() is called before the first message.
    Raises BagError, ValueError for an option, GraphError for what the graph is not.
    """
    for option, value, low in (('rate', rate, 0.0), ('duration', duration, 0.0), ('deadline', deadline, 0.0)):
        if value is not None and not (low < value < math.inf):
            raise ValueError(f'--{option} {value:g}: must be above 0')
    if not 0.0 <= start < math.inf:
        raise ValueError(f'--start {start:g} s: must be 0 or more')
    bag = bags.read(path)
    chosen = select(bag, under_test, names)
    if rate is None:
        _check_lockstep(under_test, chosen, bag.graph)
    of_node = any(writes(bag.graph, node, 'clock') for node in under_test)
    companion = 'clock' if 'clock' in bag.topics and not of_node else None
    if companion in chosen:
        companion = None
    playlist = Playlist(bag, [*chosen, *filter(None, [companion])], start, duration)
    keyboard = Keyboard()
    if paused and not keyboard.there:
        raise ValueError('--paused: standard input is no terminal, no key could end the pause')
    middleware.initialise([])
    try:
        with _stop_by_signal() as stopped, keyboard:
            player = Player(playlist, companion, under_test, rate, paused, deadline, keyboard, stopped)
            try:
                begun = time.monotonic()
                if player.connect():
                    ready()
                    begun = time.monotonic()
                    with contextlib.suppress(shell.Stopped):
                        player.play()
                wall = time.monotonic() - begun
                player.finish()
            finally:
                player.close()
            return Outcome(
                str(path), {name: channel.sent for name, channel in player.channels.items()},
                playlist.first / SECOND, player.position / SECOND, wall,
                {node: player.asked_steps.get(node, 0) for node, (asked, _) in player.answers.items() if asked},
                {node: player.answer_count[node] for node, (asked, _) in player.answers.items() if asked},
                'stopped' if stopped() else 'quit' if player.quit else 'whole')
    finally:
        rclpy.try_shutdown()


def _check_lockstep(under_test, chosen, graph):
    answering = [node for node in under_test if nodes.plain(node) in ANSWERS]
    if not answering:
        why = (f'{", ".join(under_test)} answers no step at its stamp' if under_test else
               'say with --node who answers the steps')
        raise ValueError(f'--lockstep: {why}; there are {", ".join(ANSWERS)}')
    for node in answering:
        asked, _ = answer_of(node, graph)
        if asked not in (None, *chosen):
            raise ValueError(f'--lockstep: {node} answers {asked}, which is not published')
