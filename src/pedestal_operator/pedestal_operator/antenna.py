"""Common interface to the last messages of an antenna, for the programs of the operator.

The antenna is a running graph (remote_node.Remote), or a recording (pedestal_analysis.reprocess.replay_page).
"""
import abc
import math

import numpy as np

from pedestal_common.geometry import pointing_report
from pedestal_common.graph import nodes

POINTING_TOPIC = 'acu/pointing'  # topic with the report of the pointing model in force
MAX_MESSAGE_AGE_S = 2.5  # age after which the last message is stale [s]


class Antenna(abc.ABC):
    """Reader of the last messages of an antenna.

    beam      prefix of the nodes of one beam, such as 'beam_2/'; '' without several beams
    numbers   {topic: numbers of its last message, in the order of `layouts.columns`}
    texts     {topic: its last text}
    status    {node: its last DiagnosticStatus}
    alarms    list of the DiagnosticStatus on acu/alarms
    """
    beam: str
    numbers: dict
    texts: dict
    status: dict
    alarms: list

    @abc.abstractmethod
    def age(self, name) -> float:
        """Return the age of the last message of a topic or node [s], infinite before the first."""

    def present(self, name, age=MAX_MESSAGE_AGE_S):
        """Return True if the last message of a topic or node is younger than an age [s]."""
        return self.age(name) < age

    def diagnostics_of(self, node) -> dict:
        """Return {key: text} of the last diagnostics of a node, {} if stale."""
        return self.last_diagnostics_of(node) if self.present(self.name_of(node)) else {}

    def last_diagnostics_of(self, node) -> dict:
        """Return {key: text} of the last diagnostics of a node, however old, {} before the first."""
        status = self.status.get(self.name_of(node))
        return {pair.key: pair.value for pair in status.values} if status else {}

    def name_of(self, node) -> str:
        """Return the name under which a node publishes its diagnostics: with the beam, for a node of a beam."""
        return self.beam + node if nodes.row(node).of_beam else node

    def encoder_angles(self, topic):
        """Return the encoder angles (azimuth, elevation) [deg] of joint_states or acu/reference, NaN if stale."""
        return self._degrees(topic, 0)

    def directions(self, topic):
        """Return the direction of the beam on the sky, deck angles (azimuth, elevation) [deg], NaN if stale.

        topic: joint_states, or acu/reference for the commanded direction. The pointing model in force converts the
        encoder angles.
        """
        angles, report = self.encoder_angles(topic), self.pointing_model
        if report is None:
            return angles
        # The time of a change of the model is counted from the arrival of its report.
        t = np.array([report.begins_s + self.age(POINTING_TOPIC)])
        azimuth, elevation = np.degrees(pointing_report.directions(report, t, np.radians([angles])))[0].tolist()
        return azimuth, elevation

    @property
    def pointing_model(self):
        """The pointing_report.Report of the model in force; None without a model, or with a text that is no report."""
        try:
            return pointing_report.read(self.texts.get(POINTING_TOPIC, ''))
        except ValueError:
            return None

    def rates(self):
        """Return (azimuth, elevation) rates [deg/s] of the axes, NaN if stale."""
        return self._degrees('joint_states', 2)

    def _degrees(self, topic, first):
        """Return two numbers of a topic from index `first` on, in degrees, NaN if stale."""
        if not self.present(topic):
            return math.nan, math.nan
        azimuth, elevation = self.numbers[topic][first:first + 2]
        return math.degrees(azimuth), math.degrees(elevation)
