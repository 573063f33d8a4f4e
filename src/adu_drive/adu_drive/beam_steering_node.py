"""ROS shell of an electronically steered array: owns the time, publishes the beams in force, obeys references."""
import math
import sys

from adu_drive import electronic_beam
from adu_drive.beam_unit import Beam
from adu_drive.params import BeamParameters
from adu_drive.timekeeper_node import DriveShell
from pedestal_common import messages, shell, topics


class BeamSteeringNode(DriveShell):

    def __init__(self):
        super().__init__(BeamParameters)
        self.invalid = []

    def units(self):
        return [(prefix, Beam(self.parameters)) for prefix in topics.prefixes(self.graph.beams)]

    def judge(self):
        self.invalid += [part.command for part in self.parts
                         if part.unit.outputs[0]['invalid_command'] and part.command not in self.invalid]

    def diagnose(self):
        """What is now, and the topics that held no angle since the last diagnosis."""
        now = self.first.condition()
        invalid, self.invalid = ', '.join(self.invalid), []
        values = [(f'{part.prefix}{axis}_deg', f'{math.degrees(angle):.4f}') for part in self.parts
                  for axis, angle in zip(messages.AXES, part.unit.outputs[0]['position'])]
        values = self.diagnosed([*values, ('state', now)])
        if now != 'enabled':
            return (shell.ERROR if now == 'emergency stop' else shell.WARN), now, values
        if invalid:
            return shell.ERROR, (f'{invalid} holds NaN or infinity, goes beyond {electronic_beam.LARGEST:g} rad or is '
                                 'not newer than the one before: the beam stays'), values
        if self.stale():
            limit = self.parameters.command_timeout * self.parameters.period
            return shell.ERROR, f'no new {self.stale()} for {limit:g} s: the beam stays', values
        if self.refused:
            return shell.WARN, self.refused, values
        return shell.OK, 'following', values


def main(args=None):
    return shell.main(BeamSteeringNode, args)


if __name__ == '__main__':
    sys.exit(main())
