"""ROS shell of the ship: answers every tick of the drive's clock with the ship's truth and what its IMU feels."""
import sys

import numpy as np

from pedestal_common import records, shell
from ship_motion_sim import imu, motion
from ship_motion_sim.params import ShipMotionParameters
from ship_motion_sim.ship_wire import CLOCK, RAW, TRUTH, ShipMotion


class ShipMotionNode(shell.Shell):

    def __init__(self):
        super().__init__('ship_motion', ShipMotionParameters)
        self.unit = ShipMotion(self.parameters)
        self.unit.prepare()
        self.clock = records.only(self.unit.heard, CLOCK)
        self.says = [(self.unit.messages[name], records.only(self.unit.said, name), self.writer(name))
                     for name in (TRUTH, RAW)]
        self.diagnose_with(self.diagnose)
        self.follow(CLOCK, self.unit.followers, self.step)

    def step(self, stamp, _clock, _followers):
        self.clock.stamp[0] = stamp
        self.unit.answer()
        self.begin_step(stamp)
        for message, place, send in self.says:
            records.put(message, place)
            send(message)

    def diagnose(self):
        truth = self.unit.truth[0]
        values = [(f'{name}_deg', f'{np.degrees(truth[name]):.3f}') for name in ('roll', 'pitch')]
        for status, names in ((truth['status'], motion.STATUS), (self.unit.felt[0]['status'], imu.STATUS)):
            if status:
                return shell.ERROR, names[status], values
        if self.steps.refused:
            return shell.WARN, self.steps.refusal, values
        return shell.OK, 'under way', values


def main(args=None):
    return shell.main(ShipMotionNode, args)


if __name__ == '__main__':
    sys.exit(main())
