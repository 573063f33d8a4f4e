"""Subscriptions of a node: the messages of a topic that it accepts, and its report of the dropped messages."""
import collections
import inspect
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Generic, TypeAlias, TypeVar

from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.subscription import Subscription

from pedestal_common.graph import nodes, topics
from pedestal_common.node import middleware
from pedestal_common.node.unit import LEVEL_ERROR, LEVEL_WARN
from pedestal_common.quantities import Nanoseconds
from pedestal_common.realtime import publisher_gate
from pedestal_common.wire.commands import MAX_COMMAND_AGE_NS

if TYPE_CHECKING:
    from pedestal_common.node.shell import Shell

MessageInfo: TypeAlias = Mapping[str, int]      # of rclpy: numbers and times of a message
Take: TypeAlias = Callable[[bytes, MessageInfo], object]      # callback of a subscription, for the CDR bytes
_M = TypeVar('_M')      # a decoded message

UNDISCOVERED_NODE_NAME = '_NODE_NAME_UNKNOWN_'  # name that rmw gives to a node before its discovery

MAX_DISCOVERY_NS = 10_000_000_000
"""Longest time that a text is held until the graph names every publisher of its topic [ns]. A text is published once,
often before DDS discovers its publisher."""

DISCOVERY_POLL_S = 0.02  # time between two checks of the publishers of a text [s]
MAX_HELD_TEXTS = 1000  # largest number of held texts

MAX_RECENT_MESSAGES = 100
"""Number of messages that a topic with two subscriptions remembers, to drop the copy from its second subscription."""


def two_argument_callback(function: Take) -> Callable[..., None]:
    """Return function(data, info) as a callback of a subscription. EventsExecutor (rclpy 7.1.6) passes one pair to it,
    SingleThreadedExecutor two arguments."""
    def call(data: bytes, info: MessageInfo | None = None) -> None:
        function(*(data if info is None else (data, info)))
    vars(call)['__signature__'] = inspect.signature(lambda data, info: None)
    return call


def subscribe(node: 'Shell', link: nodes.Link, ros_name: str, take: Take, role: str) -> list[Subscription]:
    """Return the subscriptions of a node in realtime to a topic, which call `take` once for each message. role: see
    topics.Qos.

    A latched subscriber does not match a volatile publisher. Where topics.Qos has `unlatched` there is therefore a
    second, volatile subscription. A latched publisher matches both; the second copy of its message is dropped.
    """
    def open_with(profile: QoSProfile, callback: Take,
                  events: SubscriptionEventCallbacks | None = None) -> Subscription:
        return node.create_subscription(middleware.message_class(link.type), ros_name,
                                        two_argument_callback(callback), profile, event_callbacks=events, raw=True)
    latched = middleware.qos(link.rate, role)
    if not topics.QOS_BY_RATE[link.rate].unlatched:
        return [open_with(latched, take)]
    recent: collections.deque[tuple[Nanoseconds, int]] = collections.deque(maxlen=MAX_RECENT_MESSAGES)

    def take_once(data: bytes, info: MessageInfo) -> None:
        message = info['source_timestamp'], info['publication_sequence_number']
        if message not in recent:
            recent.append(message)
            take(data, info)
    volatile = middleware.qos(link.rate, role)
    volatile.durability = DurabilityPolicy.VOLATILE
    # The default callback of rclpy is off, because it would warn of each volatile publisher.
    unmatched = SubscriptionEventCallbacks(use_default_callbacks=False)
    return [open_with(latched, take_once, unmatched), open_with(volatile, take_once)]


def foreign_publishers(node: 'Shell', link: nodes.Link, ros_name: str) -> list[str] | None:
    """Return the names of the nodes that publish a topic and are no publisher of its link; None if no node of the
    graph publishes the link. A node before its discovery counts, because it may be foreign."""
    if not any(writer in node.graph.members for writer in link.writers):
        return None
    return [name for name in node.publishers_of(ros_name) if name not in link.writers and name != nodes.REPLAY_NODE]


class SoleNumbers:
    """Check of the sequence numbers of a topic in lockstep: those of the publisher in the graph rise by 1."""

    def __init__(self, node: 'Shell', link: nodes.Link, ros_name: str, first: int | None = None) -> None:
        self._node, self._link, self._ros_name = node, link, ros_name
        self.next = first       # number of the next message, None if any number may follow

    def is_next(self, number: int | None) -> bool:
        """Return True if a message with this number follows the last one. A middleware without numbers has None."""
        return number is None or self.next in (None, number)

    def note(self, number: int | None) -> None:
        """Note the number of a message of the graph."""
        self.next = None if number is None else number + 1

    def shows_foreign(self) -> bool:
        """Return True if ROS lists a foreign publisher of the topic, and the topic has one publisher in the table."""
        return len(self._link.writers) == 1 and bool(foreign_publishers(self._node, self._link, self._ros_name))


class LockstepSubscriber(Generic[_M]):
    """Subscriber to one topic in lockstep, which passes the messages of the graph to take(message, False): no gap
    precedes a message.

    A message whose number is not the next is foreign if ROS lists a foreign publisher, or if the message is
    unreadable. Foreign messages are dropped. An unreadable message of the graph raises ValueError.
    """

    def __init__(self, node: 'Shell', link: nodes.Link, ros_name: str,
                 decode: Callable[[bytes], tuple[Nanoseconds | None, _M]], take: Callable[[_M, bool], None]) -> None:
        self._node, self._link, self._decode, self._take = node, link, decode, take
        self._numbers, self._dropped = SoleNumbers(node, link, ros_name), 0

    def callback(self, data: bytes, info: MessageInfo) -> None:
        """Take a message."""
        number = info['publication_sequence_number']
        follows = self._numbers.is_next(number)
        if not follows and self._numbers.shows_foreign():
            self._drop(data)
            return
        try:
            _, message = self._decode(data)
        except ValueError:
            if follows and not self._numbers.shows_foreign():
                raise
            self._drop(data)
            return
        self._numbers.note(number)
        self._take(message, False)

    def _drop(self, data: bytes) -> None:
        self._dropped += 1
        if self._dropped == 1:
            self._node.warn_of_foreign(self._link, data)


class TopicSubscriber(Generic[_M]):
    """Subscriber to one topic in realtime, which passes the messages that its PublisherGate accepts to take."""

    def __init__(self, node: 'Shell', link: nodes.Link, ros_name: str,
                 decode: Callable[[bytes], tuple[Nanoseconds | None, _M]], take: Callable[[_M, bool], None]) -> None:
        self.link, self._node, self._ros_name, self._take = link, node, ros_name, take
        is_shared = len(link.writers) > 1 or link.rate in ('once', 'command')
        self._expected = any(writer in node.graph.members for writer in link.writers)
        text, sample = link.rate in topics.EVENT_RATES and self._expected, link.rate == 'sample'
        unexpected = None if is_shared else self._surplus_count if sample else self._unexpected_count
        self.gate = publisher_gate.PublisherGate(
            decode, round(node.graph.future * 1e9), unexpected, paced=not (text or sample),
            oldest=MAX_COMMAND_AGE_NS if link.rate == 'command' else None)
        # texts that are held, with their time of arrival
        self._held: collections.deque[tuple[Nanoseconds, bytes, MessageInfo]] = collections.deque(
            maxlen=MAX_HELD_TEXTS)
        self._missed = 0
        self.callback = self._hold if text else self._receive
        if text:
            node.every(DISCOVERY_POLL_S, self._take_held)

    def open(self, subscribe: Callable[[], list[Subscription]]) -> None:
        """Subscribe. subscribe() makes the subscriptions with `callback`."""
        self._subscribe = subscribe
        self._subscriptions = subscribe()

    def _hold(self, data: bytes, info: MessageInfo) -> None:
        self._held.append((self._node.clock()[0], data, info))
        self._take_held()

    def _take_held(self) -> None:
        """Take the held texts once every publisher has a name. A text beside an unexpected publisher is dropped. After
        that publisher has left, a new subscription brings the last text again."""
        while self._held and (not self._undiscovered() or self._node.clock()[0] - self._held[0][0] > MAX_DISCOVERY_NS):
            self._receive(*self._held.popleft()[1:])
        missed = self.gate.drops.counts[publisher_gate.DROP_OTHER_PUBLISHER]
        if missed > self._missed and not self.unexpected_publishers():
            self._missed = missed
            for subscription in self._subscriptions:
                self._node.destroy_subscription(subscription)
            self._subscriptions = self._subscribe()

    def _undiscovered(self) -> bool:
        return any(UNDISCOVERED_NODE_NAME in name for name in self._node.publishers_of(self._ros_name))

    def _receive(self, data: bytes, info: MessageInfo) -> None:
        gate = self.gate
        now, utc = self._node.clock()
        message = gate.take(data, info['publication_sequence_number'], info['source_timestamp'], now, utc)
        if message is not None:
            self._take(message, gate.after_gap)
        elif gate.drops.kind in publisher_gate.WARNING_DROP_REASONS:
            self._node.diagnose_now()

    def unexpected_publishers(self) -> list[str]:
        """Return the names of the publishers that the graph does not expect."""
        return foreign_publishers(self._node, self.link, self._ros_name) or []

    def _unexpected_count(self) -> int | None:
        return len(self.unexpected_publishers()) if self._expected else None

    def _surplus_count(self) -> int:
        """Return the number of publishers beyond one, for a topic of rate `sample`, which any one node may publish."""
        return max(len(self._node.publishers_of(self._ros_name)) - 1, 0)

    def finding(self, now: Nanoseconds) -> tuple[int, str] | None:
        """Return (level, text) about messages that Drops reports, for the diagnostics; None without any."""
        drops = self.gate.drops
        if not drops.reported(now):
            return None
        kind, count = drops.kind, drops.counts[drops.kind]
        if kind not in publisher_gate.WARNING_DROP_REASONS:
            return LEVEL_WARN, f'{self.link.name}: {count} dropped: {kind}: {drops.reason}'
        names = self.unexpected_publishers() if self._expected else self._node.publishers_of(self._ros_name)
        who = ', '.join(names) or 'it has left'
        return LEVEL_ERROR, f'{self.link.name}: {count} dropped: {kind}: {who}'

    def values(self) -> list[tuple[str, str]]:
        """Return [(key, text)]: counts of dropped messages, smallest time from sending to reception."""
        gate = self.gate
        values = [(f'dropped {self.link.name}: {kind}', str(count)) for kind, count in gate.drops.counts.items()]
        if gate.offset is not None:
            values.append((f'offset {self.link.name}_ms', f'{gate.offset * 1e-6:.3f}'))
        return values
