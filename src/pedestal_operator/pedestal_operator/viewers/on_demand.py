"""A topic of the graph that is heard only as long as somebody wants it."""
from pedestal_common.node import subscriptions


class OnDemand:
    """Hands take(data, info) the CDR bytes of a nodes.Link while it is wanted. node: the shell.Shell that hears."""

    def __init__(self, node, link, take):
        self._node, self._link, self._take, self._subscriptions = node, link, take, []

    def want(self, wanted):
        """Begin or cease to hear the topic."""
        if wanted and not self._subscriptions:
            self._subscriptions = subscriptions.subscribe(self._node, self._link, self._link.name, self._take, 'read')
        elif not wanted:
            while self._subscriptions:
                self._node.destroy_subscription(self._subscriptions.pop())
