"""ROS node of an electronically steered array: it runs a unit for each beam, whose law is
`array.electronic_beam.step`."""
from drive_law.timekeeper_node import Timekeeper, unit_of
from pedestal_common.node.unit import Diagnosis


class BeamSteeringNode(Timekeeper):
    """Node with a unit for each beam and common diagnostics. A port is a unit with its topics."""

    def diagnosed(self) -> Diagnosis:
        """Return the Diagnosis of all beams: their angles, the common state, level and message of the worst beam."""
        of_beams = [(port, port.unit.diagnose()) for port in self.ports]
        port, worst = max(of_beams, key=lambda pair: pair[1].level)
        values = [(port.prefix + key, text) for port, diagnosis in of_beams for key, text in diagnosis.values
                  if key != 'state']
        state = [pair for pair in worst.values if pair[0] == 'state']
        # The message names the command topic of the worst beam.
        command = unit_of(port).COMMAND
        return Diagnosis(worst.level, worst.message.replace(command, port.named(command)), values + state)
