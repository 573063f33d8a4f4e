"""Subscription to a topic of the graph while it is needed."""
from collections.abc import Callable

from rclpy.subscription import Subscription

from pedestal_common.graph.nodes import Link
from pedestal_common.node import subscriptions
from pedestal_common.node.shell import Shell
from pedestal_common.quantities import Message


class OnDemand:
    """Subscription of a node to the topic of a link, which can be switched on and off.

    take(CDR bytes, rclpy's message info) is called for each message.
    """
    _subscriptions: list[Subscription]

    def __init__(self, node: Shell, link: Link, take: Callable[[bytes, Message], None]) -> None:
        self._node, self._link, self._take, self._subscriptions = node, link, take, []

    def set_active(self, active: bool) -> None:
        """Subscribe if active, else end the subscription."""
        if active and not self._subscriptions:
            self._subscriptions = subscriptions.subscribe(self._node, self._link, self._link.name, self._take, 'read')
        elif not active:
            while self._subscriptions:
                self._node.destroy_subscription(self._subscriptions.pop())
