"""ROS shell of the tracking receiver: answers every joint state with the three receiver channels."""
import sys

import numpy as np

from pedestal_common import records, shell
from tracking_receiver_sim import receiver
from tracking_receiver_sim.params import TrackingReceiverNodeParameters
from tracking_receiver_sim.unit import JOINTS, SHIP, TrackingReceiver

FAULTS = (receiver.NO_TARGET, receiver.NO_JOINTS, receiver.STAMP_ORDER)


class TrackingReceiverNode(shell.Shell):

    def __init__(self):
        super().__init__('tracking_receiver', TrackingReceiverNodeParameters)
        self.on_ship = 'ship_motion' in self.graph.members
        self.unit = TrackingReceiver(self.parameters, self.on_ship)
        self.prepare(self.unit)
        self.outputs = self.unit.outputs
        self.fault = receiver.LOCKED
        self.joints, self.ship = (records.only(self.unit.heard, name) for name in (JOINTS, SHIP))
        self.says = [(message, records.only(self.unit.said, name), self.writer(name))
                     for name, message in self.unit.messages.items()]
        self.diagnose_with(self.diagnose)
        self.follow(JOINTS, self.unit.followers, self.step)

    def step(self, stamp, joints, followers):
        records.take(self.joints, joints)
        records.take(self.ship, followers.get(SHIP))
        self.unit.answer()
        outputs = self.outputs[0]
        if outputs['status'] in FAULTS:
            self.fault = int(outputs['status'])
        self.begin_step(stamp)
        for message, place, send in self.says:
            if place.stamp[0] != records.NEVER:
                records.put(message, place)
                send(message)

    def diagnose(self):
        """What is now, and the last fault since the last diagnosis."""
        outputs = self.outputs[0]
        status = int(outputs['status'])
        fault, self.fault = self.fault, receiver.LOCKED
        values = [('cn0_dbhz', f'{outputs["cn0_dbhz"]:.2f}'), ('locked', str(int(outputs['locked']))),
                  ('target', self.parameters.target.kind)]
        sigma = receiver.angle_noise(self.parameters, float(outputs['cn0_dbhz']), self.parameters.period)
        values.append(('angle_noise_deg', f'{np.degrees(sigma):.4g}'))
        if self.unit.target.start_time:
            values.append(('stamp_0_utc', self.unit.target.start_time))
        if self.steps.refused:
            return shell.WARN, self.steps.refusal, values
        if fault in FAULTS:
            return shell.ERROR, receiver.STATUSES[fault], values
        return (shell.OK if status == receiver.LOCKED else shell.WARN), receiver.STATUSES[status], values


def main(args=None):
    return shell.main(TrackingReceiverNode, args)


if __name__ == '__main__':
    sys.exit(main())
