"""Subscription to a topic of the graph while it is needed."""
from pedestal_common.node import subscriptions


class OnDemand:
    """Subscription of a node (shell.Shell) to the topic of a nodes.Link, which can be switched on and off.

    take(CDR bytes, rclpy's message info) is called for each message.
    """

    def __init__(self, node, link, take):
        self._node, self._link, self._take, self._subscriptions = node, link, take, []

    def set_active(self, active):
        """Subscribe if active, else end the subscription."""
        if active and not self._subscriptions:
            self._subscriptions = subscriptions.subscribe(self._node, self._link, self._link.name, self._take, 'read')
        elif not active:
            while self._subscriptions:
                self._node.destroy_subscription(self._subscriptions.pop())
