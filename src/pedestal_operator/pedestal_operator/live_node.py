"""ROS node that Foxglove and Lichtblick look at: the messages of the graph, byte by byte, over a WebSocket."""
import pedestal_common.entry  # noqa: F401

# isort: split
import dataclasses
import queue
import sys

from pedestal_common import parameters
from pedestal_common.graph import topics
from pedestal_common.node import shell
from pedestal_common.wire import messages
from pedestal_operator.viewers import frames
from pedestal_operator.viewers.frame_source import FrameSource
from pedestal_operator.viewers.on_demand import OnDemand

POLL_PERIOD_S = 0.05
"""Time [s] between two looks at who watches what."""

FRAME_PERIOD_S = 1.0 / 30.0
"""Time [s] between two messages of the frames."""

TRANSFORMS_CHANNEL, DESCRIPTION_CHANNEL = '/transforms', '/robot_description'
"""Channels that are no topics of the graph: the frames, and the model of the pedestal."""


@dataclasses.dataclass(frozen=True)
class LiveParameters(parameters.Parameters):
    """The server."""
    address: str = parameters.text('127.0.0.1', 'on which it listens; who reaches it sees all and can change nothing')
    port: int = parameters.parameter(8765, 0, 65535, '', 'TCP port; 0: a free one, which it says')


def sdk():
    """The package foxglove. Raises ValueError, which says how to install it, where it is not."""
    try:
        import foxglove
        import foxglove.channels
        import foxglove.messages
    except ImportError:
        raise ValueError("Foxglove needs foxglove-sdk: pip install 'pedestal_operator[live]'") from None
    return foxglove


class Outlet:
    """A channel with CDR messages of a type; last: (bytes, when they were sent [ns]) of the last one, None before."""

    def __init__(self, name, type_name):
        foxglove = sdk()
        schema = foxglove.Schema(name=type_name, encoding='ros2msg', data=messages.definition(type_name))
        self.channel = foxglove.Channel(name, schema=schema, message_encoding='cdr')
        self.last = None

    def say(self, data, sent):
        """Send a message to whoever watches; one who does not read loses the oldest, and nobody waits for him."""
        self.last = data, sent
        self.channel.log(data, log_time=sent)

    def say_again(self):
        """Send the last message once more."""
        if self.last:
            self.channel.log(self.last[0], log_time=self.last[1])


class TopicOutlet(Outlet):
    """The channel of a topic (nodes.Link) of the graph. A topic that latches is heard all the time, any other while
    somebody watches it."""

    def __init__(self, node, link):
        super().__init__(f'/{link.name}', link.type)
        self._topic = OnDemand(node, link, self._take)
        self.latched = topics.QOS_BY_RATE[link.rate].latched

    def look(self):
        """Begin or cease to hear the topic."""
        self._topic.want(self.latched or self.channel.has_sinks())

    def _take(self, data, info):
        self.say(data, info['source_timestamp'])


class NewSubscriptions:
    """The topics that somebody has begun to watch, as the server tells in a thread of its own."""

    def __init__(self):
        self._topics = queue.SimpleQueue()

    def on_subscribe(self, _client, channel):
        """Called by the server."""
        self._topics.put(channel.topic)

    def on_unsubscribe(self, _client, _channel):
        """Called by the server."""

    def taken(self):
        """The names of the topics since the last call, each once."""
        names = set()
        while not self._topics.empty():
            names.add(self._topics.get())
        return names


class LiveNode(shell.Shell):
    """Serves the topics of the graph, its frames and the model of the pedestal, read only."""
    awaits = 'clients'

    def __init__(self):
        super().__init__('live', LiveParameters)
        self._foxglove, p = sdk(), self.parameters
        self._topics = [TopicOutlet(self, link) for link in self.links.values()]
        self._latched = {outlet.channel.topic(): outlet for outlet in self._topics if outlet.latched}
        self._latched[DESCRIPTION_CHANNEL] = description = Outlet(DESCRIPTION_CHANNEL, 'std_msgs/msg/String')
        description.say(messages.serialize(messages.String(data=frames.PEDESTAL_URDF)), self.clock()[1])
        self._frames, self._told = FrameSource(self), 0
        self._transforms = self._foxglove.channels.FrameTransformsChannel(TRANSFORMS_CHANNEL)
        self._newcomers = NewSubscriptions()
        try:
            self._server = self._foxglove.start_server(name='pedestal', host=p.address, port=p.port,
                                                       server_listener=self._newcomers)
        except RuntimeError as error:
            raise ValueError(f'{p.address}:{p.port}: {error}') from None
        self.get_logger().info(f'listens on {p.address}:{self._server.port}')
        self.every(POLL_PERIOD_S, self._look)
        self.every(FRAME_PERIOD_S, self._say_frames)

    def _look(self):
        for outlet in self._topics:
            outlet.look()
        for name in self._newcomers.taken() & set(self._latched):
            self._latched[name].say_again()

    def _say_frames(self):
        watched = self._transforms.has_sinks()
        self._frames.want(watched)
        stamp, transforms = self._frames.read()
        if not watched or stamp == self._told:
            return
        self._told, make = stamp, self._foxglove.messages
        time = make.Timestamp(*divmod(stamp, 1_000_000_000))
        self._transforms.log(make.FrameTransforms(transforms=[make.FrameTransform(
            timestamp=time, parent_frame_id=given.parent, child_frame_id=given.child,
            translation=make.Vector3(**dict(zip('xyz', given.translation))),
            rotation=make.Quaternion(**dict(zip('xyzw', given.rotation)))) for given in transforms]))

    def close(self):
        """Close the server, then the node."""
        self._server.stop()
        super().close()


def main(args=None) -> int:
    """Run the server until it is stopped; args: of the command line, None for sys.argv."""
    return shell.main(LiveNode, args)


if __name__ == '__main__':
    sys.exit(main())
