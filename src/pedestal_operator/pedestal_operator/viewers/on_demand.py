"""Data of a running antenna for viewers, received while a viewer needs them."""
import contextlib
from collections.abc import Callable, Sequence

import numpy as np
from rclpy.subscription import Subscription

from pedestal_common.graph import nodes
from pedestal_common.graph.nodes import Link
from pedestal_common.node import subscriptions
from pedestal_common.node.shell import Shell
from pedestal_common.quantities import Message, Nanoseconds
from pedestal_common.wire import records
from pedestal_operator.viewers import frames


class OnDemand:
    """Subscription of a node to a topic. take(CDR bytes, rclpy's message info) is called for each message."""
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


class _Latest:
    _data: bytes | None                                     # received since the last reading
    _read: tuple[Nanoseconds, Sequence[float]] | None       # result of the last reading

    def __init__(self, node: Shell, prefix: str, topic: str) -> None:
        self._decoder = records.Decoder(topic, records.empty(records.of(topic), 1))
        self._data = self._read = None
        self.topic = OnDemand(node, node.links[prefix + topic], self._take)

    def _take(self, data: bytes, _info: object) -> None:
        self._data = data

    def read(self) -> tuple[Nanoseconds, Sequence[float]] | None:
        """Return (stamp, numbers) of the last readable message, None before the first."""
        if self._data is not None:
            with contextlib.suppress(ValueError):
                self._read = self._decoder.decoded(self._data)
            self._data = None
        return self._read


class FrameSource:
    """Frames from the last messages of joint_states (of every beam) and ship/imu/data, subscribed while active."""

    def __init__(self, node: Shell) -> None:
        self._attitude = _Latest(node, '', 'ship/imu/data')
        self._angles = {prefix: _Latest(node, prefix, 'joint_states') for prefix in nodes.prefixes(node.graph.beams)}

    def set_active(self, active: bool) -> None:
        """Subscribe to the antenna if active, else end the subscriptions."""
        for latest in (self._attitude, *self._angles.values()):
            latest.topic.set_active(active)

    def read(self) -> tuple[Nanoseconds, list[frames.Transform]]:
        """Return (stamp of the last angles, their transforms), (0, []) before the first. The deck is ashore before the
        first message of the INS. A deck without an attitude has no transform."""
        latest = {prefix: latest.read() for prefix, latest in self._angles.items()}
        known = {prefix: read for prefix, read in latest.items() if read}
        if not known:
            return 0, []
        attitude = self._attitude.read()
        decks = [frames.of_deck(attitude[1][:4]) if attitude else frames.of_deck()]
        if attitude and not np.isfinite(attitude[1][:4]).all():
            decks = []
        return max(stamp for stamp, _ in known.values()), [*decks, *(
            transform for prefix, (_, numbers) in known.items()
            for transform in frames.of_pedestal(numbers[:2], prefix))]
