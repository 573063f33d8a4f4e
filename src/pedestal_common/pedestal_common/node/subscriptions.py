"""How a node of a realtime graph hears its topics: what it takes of them, and what it says of the rest."""
import collections
import inspect

from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.qos import DurabilityPolicy

from pedestal_common.graph import nodes, topics
from pedestal_common.node import middleware
from pedestal_common.node.unit import LEVEL_ERROR, LEVEL_WARN
from pedestal_common.realtime import publisher_gate
from pedestal_common.wire.commands import MAX_COMMAND_AGE_NS

DROP_REPORT_NS = 2_000_000_000
"""Time [ns] for which the diagnostics speak of a message that was dropped."""

UNDISCOVERED_NODE_NAME = '_NODE_NAME_UNKNOWN_'
"""What rmw calls a node that is not discovered yet."""

MAX_DISCOVERY_NS = 10_000_000_000
"""Time [ns] for which a text waits until the graph names every writer of its topic: it is said once only, often before
its writer is discovered."""

DISCOVERY_POLL_S = 0.02
"""Time [s] between two looks at who writes a text."""

MAX_HELD_TEXTS = 1000
"""Texts that wait at the most."""

MAX_RECENT_MESSAGES = 100
"""Messages of a topic with two subscriptions that are known again when the other one brings them."""


def pair(function):
    """function(data, info) as a callback of a subscription: EventsExecutor (rclpy 7.1.6) hands a callback of two
    arguments one pair, SingleThreadedExecutor hands it two."""
    def call(data, info=None):
        function(*(data if info is None else (data, info)))
    call.__signature__ = inspect.signature(lambda data, info: None)
    return call


def subscribe(node, link, ros_name, take, role):
    """Call take(data, info) once for each message on the topic of a nodes.Link, which ROS calls ros_name: the list of
    the subscriptions of the node for it. role: in realtime, `read` or `recorded`.

    A latched reader does not match a writer that does not latch, so where topics.Qos says `unlatched` there is a
    second subscription. A latched writer matches both; what it says comes twice and is taken once.
    """
    def open_with(profile, callback, **events):
        return node.create_subscription(middleware.message_class(link.type), ros_name, pair(callback), profile,
                                        raw=True, **events)
    latched = middleware.qos(link.rate, role)
    if not topics.QOS_BY_RATE[link.rate].unlatched:
        return [open_with(latched, take)]
    heard = collections.deque(maxlen=MAX_RECENT_MESSAGES)

    def take_once(data, info):
        message = info['source_timestamp'], info['publication_sequence_number']
        if message not in heard:
            heard.append(message)
            take(data, info)
    volatile = middleware.qos(link.rate, role)
    volatile.durability = DurabilityPolicy.VOLATILE
    unmatched = SubscriptionEventCallbacks(use_default_callbacks=False)  # rclpy's would warn of every volatile writer
    return [open_with(latched, take_once, event_callbacks=unmatched), open_with(volatile, take_once)]


def foreign_publishers(node, link, ros_name):
    """Return the names of the nodes that publish a topic and are no publisher of its nodes.Link.

    Return None in a graph without a publisher of the link. An undiscovered node may be foreign.
    """
    if not any(writer in node.graph.members for writer in link.writers):
        return None
    return [name for name in node.writers_of(ros_name) if name not in link.writers and name != nodes.REPLAY_NODE]


class TopicSubscriber:
    """Hears one topic and hands on what its Intake takes: take(message, whether it begins anew).

    node: the shell.Shell that listens; link: nodes.Link of the topic, which ROS calls ros_name; decode: see Intake
    """

    def __init__(self, node, link, ros_name, decode, take):
        self.link, self._node, self._ros_name, self._take = link, node, ros_name, take
        everybodys = len(link.writers) > 1 or link.rate in ('once', 'command')
        self._expected = any(writer in node.graph.members for writer in link.writers)
        text = link.rate in topics.EVENT_RATES and self._expected
        self.intake = publisher_gate.PublisherGate(decode, round(node.graph.future * 1e9), None if everybodys
                                                   else self._count,
                                                   paced=not text, oldest=MAX_COMMAND_AGE_NS
                                                   if link.rate == 'command' else None)
        self._held, self._missed = collections.deque(maxlen=MAX_HELD_TEXTS), 0
        self.callback = self._hold if text else self._hear
        if text:
            node.every(DISCOVERY_POLL_S, self._look)

    def open(self, subscribe):
        """Begin to hear. subscribe() makes the subscriptions with `callback`."""
        self._subscribe = subscribe
        self._subscriptions = subscribe()

    def _hold(self, data, info):
        self._held.append((self._node.clock()[0], data, info))
        self._look()

    def _look(self):
        """Hear the texts that wait, once every writer has a name. What was said beside a stranger is not taken; once
        it has gone a subscription anew brings the last text again."""
        while self._held and (not self._undiscovered() or self._node.clock()[0] - self._held[0][0] > MAX_DISCOVERY_NS):
            self._hear(*self._held.popleft()[1:])
        missed = self.intake.dropped[publisher_gate.DROP_OTHER_PUBLISHER]
        if missed > self._missed and not self.strangers():
            self._missed = missed
            for subscription in self._subscriptions:
                self._node.destroy_subscription(subscription)
            self._subscriptions = self._subscribe()

    def _undiscovered(self):
        return any(UNDISCOVERED_NODE_NAME in name for name in self._node.writers_of(self._ros_name))

    def _hear(self, data, info):
        taker = self.intake
        now, utc = self._node.clock()
        message = taker.take(data, info['publication_sequence_number'], info['source_timestamp'], now, utc)
        if message is not None:
            self._take(message, taker.anew)
        elif taker.reason in publisher_gate.WARNING_DROP_REASONS:
            self._node.diagnose_now()

    def strangers(self):
        """Names of the nodes that write this topic and should not; none in a graph without those that should."""
        return foreign_publishers(self._node, self.link, self._ros_name) or []

    def _count(self):
        """As Intake wants it. Who is not discovered yet may be a stranger."""
        return len(self.strangers()) if self._expected else None

    def finding(self, now):
        """(level, text) of what was dropped lately; None where nothing was."""
        taker = self.intake
        if taker.dropped_at is None or now - taker.dropped_at > DROP_REPORT_NS:
            return None
        reason, count = taker.reason, taker.dropped[taker.reason]
        if reason not in publisher_gate.WARNING_DROP_REASONS:
            return LEVEL_WARN, f'{self.link.name}: {count} dropped: {reason}: {taker.detail}'
        who = ', '.join(self.strangers() if self._expected else self._node.writers_of(self._ros_name)) or 'it has gone'
        return LEVEL_ERROR, f'{self.link.name}: {count} dropped: {reason}: {who}'

    def values(self):
        """[(key, text)] for the diagnostics: what was dropped so far, the smallest time from sent to heard."""
        taker = self.intake
        values = [(f'dropped {self.link.name}: {reason}', str(count)) for reason, count in taker.dropped.items()]
        if taker.offset is not None:
            values.append((f'offset {self.link.name}_ms', f'{taker.offset * 1e-6:.3f}'))
        return values
