"""Publishers of a topic in realtime: the lost messages of the graph's publisher, and the messages of other publishers.
"""
from pedestal_common.node import subscriptions
from pedestal_common.realtime.publisher_gate import (
    CONFIRMED_TAKEOVER_NS,
    DROP_OTHER_PUBLISHER,
    PUBLISHER_POLL_NS,
    PublisherGate,
)


class TopicPublishers:
    """Publishers of a nodes.Link that a node records, told apart as the nodes of the graph tell them apart.

    lost: number of messages of the graph's publisher that are missing, by its sequence numbers
    """

    def __init__(self, node, link):
        self._node, self._link = node, link
        self._gate = PublisherGate(lambda data: (None, data), 0, self._count)
        self._lost, self._polled, self._foreign = {}, None, False

    @property
    def lost(self):
        """Number of missing messages of the graph's publisher."""
        return sum(self._lost.values())

    def several(self, now):
        """Return True if more than one publisher sends at a time [ns]."""
        return self._gate.writers.several(now)

    def take(self, data, info):
        """Return False for a message of another publisher than that of the graph.

        This needs a publisher of the graph that sends, and a foreign publisher that the graph names. A doubtful
        message counts as a message of the graph.
        """
        now, utc = self._node.clock()
        taken = self._gate.take(data, info['publication_sequence_number'], info['source_timestamp'], now, utc)
        ours = self._gate.in_charge
        if taken is not None:
            self._lost[ours] = ours.lost
        return not (taken is None and self._gate.reason == DROP_OTHER_PUBLISHER and ours is not None
                    and now - ours.arrival < CONFIRMED_TAKEOVER_NS and self._named(now))

    def _count(self):
        names = subscriptions.foreign_publishers(self._node, self._link, self._link.name)
        return None if names is None else len(names)

    def _named(self, now):
        if self._polled is None or now - self._polled >= PUBLISHER_POLL_NS:
            names = subscriptions.foreign_publishers(self._node, self._link, self._link.name) or ()
            self._polled = now
            self._foreign = any(subscriptions.UNDISCOVERED_NODE_NAME not in name for name in names)
        return self._foreign
