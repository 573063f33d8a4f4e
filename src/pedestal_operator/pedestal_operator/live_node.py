"""ROS node that serves the messages of the graph, byte by byte, to the viewers Foxglove and Lichtblick by WebSocket.

In the folder viewers, on_demand.py subscribes to the topics that a viewer shows.
"""
import dataclasses
import queue
from collections.abc import Mapping
from types import ModuleType

from pedestal_common import parameters
from pedestal_common.graph import topics
from pedestal_common.graph.nodes import Link, Node
from pedestal_common.node import shell
from pedestal_common.quantities import Message, Nanoseconds
from pedestal_common.wire import messages
from pedestal_operator.viewers import frames
from pedestal_operator.viewers.on_demand import FrameSource, OnDemand

POLL_PERIOD_S = 0.05  # period of the check for viewers of topics [s]
FRAME_PERIOD_S = 1.0 / 30.0  # period of the messages of the frames [s]

TRANSFORMS_CHANNEL, DESCRIPTION_CHANNEL = '/transforms', '/robot_description'


@dataclasses.dataclass(frozen=True)
class LiveParameters(parameters.Parameters):
    """Parameters of the live server."""
    address: str = parameters.text('127.0.0.1',
                                   'address of the server; viewers that reach it read all topics and change nothing')
    port: int = parameters.parameter(8765, 0, 65535, '', 'TCP port; 0: a free port, which the node prints')


def sdk() -> ModuleType:
    """Return the package foxglove. Raises ValueError with the command for its installation if it is missing."""
    try:
        import foxglove
        import foxglove.channels
        import foxglove.messages
    except ImportError:
        raise ValueError("Foxglove needs foxglove-sdk: pip install 'pedestal_operator[live]'") from None
    return foxglove


class Outlet:
    """Channel of the Foxglove server with CDR messages of one type."""
    last: tuple[bytes, Nanoseconds] | None      # the last message and its send time, None before the first

    def __init__(self, name: str, type_name: str) -> None:
        foxglove = sdk()
        schema = foxglove.Schema(name=type_name, encoding='ros2msg', data=messages.definition(type_name))
        self.channel = foxglove.Channel(name, schema=schema, message_encoding='cdr')
        self.last = None

    def publish(self, data: bytes, sent: Nanoseconds) -> None:
        """Send a message to all viewers without waiting; a slow viewer loses its oldest messages."""
        self.last = data, sent
        self.channel.log(data, log_time=sent)

    def republish(self) -> None:
        """Send the last message again."""
        if self.last:
            self.channel.log(self.last[0], log_time=self.last[1])


class TopicOutlet(Outlet):
    """Channel of a topic of the graph, subscribed while the channel has a viewer; a latched topic always."""

    def __init__(self, node: shell.Shell, link: Link) -> None:
        super().__init__(f'/{link.name}', link.type)
        self._topic = OnDemand(node, link, self._take)
        self.latched = topics.QOS_BY_RATE[link.rate].latched

    def look(self) -> None:
        """Begin or end the subscription to the topic."""
        self._topic.set_active(self.latched or self.channel.has_sinks())

    def _take(self, data: bytes, info: Mapping[str, int]) -> None:
        self.publish(data, info['source_timestamp'])


class NewSubscriptions:
    """Topics with a new viewer, reported by the server from its own thread."""

    def __init__(self) -> None:
        self._topics: queue.SimpleQueue[str] = queue.SimpleQueue()

    def on_subscribe(self, _client: object, channel: Message) -> None:
        """Note a topic with a new viewer; called by the server."""
        self._topics.put(channel.topic)

    def on_unsubscribe(self, _client: object, _channel: object) -> None:
        """Do nothing; called by the server."""

    def taken(self) -> set[str]:
        """Return the names of the topics since the last call, each once."""
        names = set()
        while not self._topics.empty():
            names.add(self._topics.get())
        return names


class LiveNode(shell.Shell):
    """Read-only server of the topics of the graph, its frames and the model of the pedestal."""
    awaits = 'clients'
    parameters: LiveParameters
    _latched: dict[str, Outlet]     # {name of a channel whose last message every new viewer receives}

    def __init__(self, row: Node) -> None:
        super().__init__(row.name, LiveParameters)
        self._foxglove, p = sdk(), self.parameters
        self._topics = [TopicOutlet(self, link) for link in self.links.values()]
        self._latched = {outlet.channel.topic(): outlet for outlet in self._topics if outlet.latched}
        self._latched[DESCRIPTION_CHANNEL] = description = Outlet(DESCRIPTION_CHANNEL, 'std_msgs/msg/String')
        description.publish(messages.serialize(messages.String(data=frames.PEDESTAL_URDF)), self.clock()[1])
        self._frames, self._published_stamp = FrameSource(self), 0
        self._transforms = self._foxglove.channels.FrameTransformsChannel(TRANSFORMS_CHANNEL)
        self._new_subscriptions = NewSubscriptions()
        try:
            self._server = self._foxglove.start_server(name='pedestal', host=p.address, port=p.port,
                                                       server_listener=self._new_subscriptions)
        except RuntimeError as error:
            raise ValueError(f'{p.address}:{p.port}: {error}') from None
        print(f'foxglove: ws://{p.address}:{self._server.port}', flush=True)
        self.every(POLL_PERIOD_S, self._look)
        self.every(FRAME_PERIOD_S, self._publish_frames)

    def _look(self) -> None:
        for outlet in self._topics:
            outlet.look()
        for name in self._new_subscriptions.taken() & set(self._latched):
            self._latched[name].republish()

    def _publish_frames(self) -> None:
        watched = self._transforms.has_sinks()
        self._frames.set_active(watched)
        stamp, transforms = self._frames.read()
        if not watched or stamp == self._published_stamp:
            return
        self._published_stamp, make = stamp, self._foxglove.messages
        time = make.Timestamp(*divmod(stamp, 1_000_000_000))
        self._transforms.log(make.FrameTransforms(transforms=[make.FrameTransform(
            timestamp=time, parent_frame_id=given.parent, child_frame_id=given.child,
            translation=make.Vector3(**dict(zip('xyz', given.translation))),
            rotation=make.Quaternion(**dict(zip('xyzw', given.rotation)))) for given in transforms]))

    def close(self) -> None:
        """Close the server, then the node."""
        self._server.stop()
        super().close()
