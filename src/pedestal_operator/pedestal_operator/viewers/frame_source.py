"""Where the frames of a running antenna are, by its encoders and its INS."""
import contextlib

from pedestal_common.graph import nodes
from pedestal_common.wire import records
from pedestal_operator.viewers import frames
from pedestal_operator.viewers.on_demand import OnDemand


class _Latest:
    """The last message of a stamped topic, taken apart only when it is asked for."""

    def __init__(self, node, prefix, topic):
        self._decoder = records.Decoder(topic, records.empty(records.of(topic), 1))
        self._data = self._read = None
        self.topic = OnDemand(node, node.links[prefix + topic], self._take)

    def _take(self, data, _info):
        self._data = data

    def read(self):
        """(stamp [ns], numbers) of the last message that could be read; None before the first."""
        if self._data is not None:
            with contextlib.suppress(ValueError):
                self._read = self._decoder.decoded(self._data)
            self._data = None
        return self._read


class FrameSource:
    """Hears joint_states of every beam of a graph, and ship/imu/data, while the frames are wanted. node: the
    shell.Shell that hears."""

    def __init__(self, node):
        self._attitude = _Latest(node, '', 'ship/imu/data')
        self._angles = {prefix: _Latest(node, prefix, 'joint_states') for prefix in nodes.prefixes(node.graph.beams)}

    def want(self, wanted):
        """Begin or cease to hear the antenna."""
        for latest in (self._attitude, *self._angles.values()):
            latest.topic.want(wanted)

    def read(self):
        """(stamp of the last angles [ns], their frames.Transforms); (0, []) before the first. The deck is ashore until
        the INS is heard."""
        heard = {prefix: latest.read() for prefix, latest in self._angles.items()}
        told = {prefix: read for prefix, read in heard.items() if read}
        if not told:
            return 0, []
        attitude = self._attitude.read()
        deck = frames.of_deck(attitude[1][:4]) if attitude else frames.of_deck()
        return max(stamp for stamp, _ in told.values()), [deck, *(
            transform for prefix, (_, numbers) in told.items()
            for transform in frames.of_pedestal(numbers[:2], prefix))]
