"""Subscription to a topic of the graph while it is needed."""
from pedestal_common.node import subscriptions


class OnDemand:
    """Switchable subscription: take(data, info) receives the CDR bytes of a nodes.Link. node: a shell.Shell."""

    def __init__(self, node, link, take):
        self._node, self._link, self._take, self._subscriptions = node, link, take, []

    def set_active(self, active):
        """Subscribe if active, else end the subscription."""
        if active and not self._subscriptions:
            self._subscriptions = subscriptions.subscribe(self._node, self._link, self._link.name, self._take, 'read')
        elif not active:
            while self._subscriptions:
                self._node.destroy_subscription(self._subscriptions.pop())
