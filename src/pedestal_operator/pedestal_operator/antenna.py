"""The last messages of an antenna, of a running graph or of a recording."""
import abc
import math

from pedestal_common.graph import nodes


class Antenna(abc.ABC):
    """Read the last messages. beam: prefix of the beam's nodes; numbers: {topic: numbers of its last message}; status:
    {node: its last DiagnosticStatus}."""

    @abc.abstractmethod
    def present(self, name):
        """Return True if a topic or node published lately."""

    def told(self, node) -> dict:
        """{key: text} of a node's last diagnostics; {} where it is silent."""
        name = self.beam + node if nodes.row(node).of_beam else node
        return {pair.key: pair.value for pair in self.status[name].values} if self.present(name) else {}

    def angles(self, topic):
        """(azimuth, elevation) [deg] of joint_states or acu/reference; NaN where it is silent."""
        return self._degrees(topic, 0)

    def rates(self):
        """(azimuth, elevation) rates [deg/s] of the axes; NaN where they are silent."""
        return self._degrees('joint_states', 2)

    def _degrees(self, topic, first):
        if not self.present(topic):
            return math.nan, math.nan
        azimuth, elevation = self.numbers[topic][first:first + 2]
        return math.degrees(azimuth), math.degrees(elevation)
