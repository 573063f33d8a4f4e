"""ROS shell of the antenna drive unit: owns the drive's time, publishes the encoders, obeys rate commands."""
import sys

import numpy as np

from adu_drive import drive_state, drive_unit, faults, thermal
from adu_drive.params import AduNodeParameters
from adu_drive.timekeeper_node import DriveShell
from adu_drive.unit import COMMAND, SHIP, Adu
from pedestal_common import messages, shell


class AduNode(DriveShell):

    def __init__(self):
        super().__init__(AduNodeParameters)
        self.invalid = ''

    def units(self):
        return [('', Adu(self.parameters, 'ship_motion' in self.graph.members))]

    def judge(self):
        if self.first.outputs[0]['invalid_command']:
            deck = self.first.inputs[0]['base_acceleration']
            self.invalid = COMMAND if (np.abs(deck) <= drive_unit.LARGEST).all() else SHIP

    def diagnose(self):
        """What is now, and the topic that held no number since the last diagnosis."""
        outputs = self.first.outputs[0]
        now = self.first.condition()
        invalid, self.invalid = self.invalid, ''
        values = [(f'{axis} {name}', '1' if outputs[axis][name] else '0') for axis in messages.AXES
                  for name in ('torque_limited', 'voltage_limited', 'end_stop', 'stopping')]
        values += [(f'{axis} faults', ', '.join(faults.names(outputs[axis]['faults']))) for axis in messages.AXES]
        values += [(f'{axis}_motor_{i} thermal_load', f'{load:.3f}') for axis in messages.AXES
                   for i, load in enumerate(outputs[axis]['thermal_load'], 1)]
        values = self.diagnosed([*values, ('state', now), ('phase', drive_state.PHASES[outputs['phase']]),
                                 ('brakes', 'on' if outputs['braked'] else 'off')])
        if outputs['emergency'] or any(outputs[axis]['faults'] for axis in messages.AXES):
            return shell.ERROR, now, values
        if invalid:
            largest = f'{drive_unit.LARGEST:g}'
            return shell.ERROR, f'{invalid} holds NaN or infinity, or goes beyond {largest}: stopping', values
        if self.stale():
            limit = self.first.memory['timeout'][0] / 1e9
            return shell.ERROR, f'no new {self.stale()} for {limit:g} s: stopping', values
        if self.refused:
            return shell.WARN, self.refused, values
        if now != 'enabled':
            return shell.WARN, now, values
        if any(outputs[axis]['end_stop'] for axis in messages.AXES):
            return shell.WARN, 'at an end stop', values
        hottest = max(outputs[axis]['thermal_load'].max() for axis in messages.AXES)
        if hottest > thermal.WARM:
            return shell.WARN, f'a motor is at {100.0 * hottest:.0f} % of its thermal load', values
        return shell.OK, 'following', values


def main(args=None):
    return shell.main(AduNode, args)


if __name__ == '__main__':
    sys.exit(main())
