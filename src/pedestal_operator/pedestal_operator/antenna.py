"""Common interface to the last messages of an antenna: a running graph (remote_node.Remote), or a recording."""
import abc
import math
from collections.abc import Sequence

import numpy as np

from pedestal_common.geometry import pointing_report
from pedestal_common.graph import nodes
from pedestal_common.quantities import Degrees, Message, Seconds

POINTING_TOPIC = 'acu/pointing'  # topic with the report of the pointing model in force
MAX_MESSAGE_AGE_S = 2.5  # age after which the last message is stale [s]


class Antenna(abc.ABC):
    """Reader of the last messages of an antenna."""
    beam: str                           # prefix of the nodes of one beam, such as 'beam_2/'; '' without several beams
    numbers: dict[str, Sequence[float]]     # {topic: of its last message, in the order of `layouts.columns`}
    texts: dict[str, str]               # {topic: its last text}
    status: dict[str, Message]          # {node: its last DiagnosticStatus}
    alarms: list[Message]               # the DiagnosticStatus on acu/alarms

    @abc.abstractmethod
    def age(self, name: str) -> Seconds:
        """Return the age of the last message of a topic or node, infinite before the first."""

    def present(self, name: str, age: Seconds = MAX_MESSAGE_AGE_S) -> bool:
        """Return True if the last message of a topic or node is younger than an age."""
        return self.age(name) < age

    def diagnostics_of(self, node: str) -> dict[str, str]:
        """Return {key: text} of the last diagnostics of a node, {} if stale."""
        return self.last_diagnostics_of(node) if self.present(self.name_of(node)) else {}

    def last_diagnostics_of(self, node: str) -> dict[str, str]:
        """Return {key: text} of the last diagnostics of a node, however old, {} before the first."""
        status = self.status.get(self.name_of(node))
        return {pair.key: pair.value for pair in status.values} if status else {}

    def name_of(self, node: str) -> str:
        """Return the name under which a node publishes its diagnostics: with the beam, for a node of a beam."""
        return self.beam + node if nodes.row(node).of_beam else node

    def encoder_angles(self, topic: str) -> tuple[Degrees, Degrees]:
        """Return the encoder angles (azimuth, elevation) of joint_states or acu/reference, NaN if stale."""
        return self._degrees(topic, 0)

    def directions(self, topic: str) -> tuple[Degrees, Degrees]:
        """Return the deck angles of the beam on the sky, by the pointing model in force; NaN if stale. topic:
        joint_states, or acu/reference for the commanded direction."""
        angles, report = self.encoder_angles(topic), self.pointing_model
        if report is None:
            return angles
        # The time of a change of the model is counted from the arrival of its report.
        t = np.array([report.begins_s + self.age(POINTING_TOPIC)])
        azimuth, elevation = np.degrees(pointing_report.directions(report, t, np.radians([angles])))[0].tolist()
        return azimuth, elevation

    @property
    def pointing_model(self) -> pointing_report.Report | None:
        """Report of the model in force; None without a model, or with a text that is no report."""
        try:
            return pointing_report.read(self.texts.get(POINTING_TOPIC, ''))
        except ValueError:
            return None

    def rates(self) -> tuple[float, float]:
        """Return (azimuth, elevation) rates [deg/s] of the axes, NaN if stale."""
        return self._degrees('joint_states', 2)

    def _degrees(self, topic: str, first: int) -> tuple[float, float]:
        if not self.present(topic):
            return math.nan, math.nan
        azimuth, elevation = self.numbers[topic][first:first + 2]
        return math.degrees(azimuth), math.degrees(elevation)
