"""Last messages of an antenna, from a running graph or a recording."""
import abc
import math

from pedestal_common.graph import nodes


class Antenna(abc.ABC):
    """Reader of the last messages of an antenna.

    beam      prefix of the nodes of the beam
    numbers   {topic: numbers of its last message}
    status    {node: its last DiagnosticStatus}
    """
    beam: str
    numbers: dict
    status: dict

    @abc.abstractmethod
    def present(self, name):
        """Return True if a topic or node published lately."""

    def diagnostics_of(self, node) -> dict:
        """Return {key: text} of the last diagnostics of a node, {} if stale."""
        name = self.beam + node if nodes.row(node).of_beam else node
        return {pair.key: pair.value for pair in self.status[name].values} if self.present(name) else {}

    def angles(self, topic):
        """Return (azimuth, elevation) [deg] of joint_states or acu/reference, NaN if stale."""
        return self._degrees(topic, 0)

    def rates(self):
        """Return (azimuth, elevation) rates [deg/s] of the axes, NaN if stale."""
        return self._degrees('joint_states', 2)

    def _degrees(self, topic, first):
        if not self.present(topic):
            return math.nan, math.nan
        azimuth, elevation = self.numbers[topic][first:first + 2]
        return math.degrees(azimuth), math.degrees(elevation)
