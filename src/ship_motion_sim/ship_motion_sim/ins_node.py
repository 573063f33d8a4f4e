"""ROS shell of the INS: hears the IMU, publishes attitude and deck rate as the INS knows them."""
import math
import sys

from pedestal_common import messages, records, shell
from ship_motion_sim import ins, navigator
from ship_motion_sim.ins_wire import DATA, RAW, STATE, Ins
from ship_motion_sim.params import InsParameters


class InsNode(shell.Shell):

    def __init__(self):
        super().__init__('ins', InsParameters)
        self.unit = Ins(self.parameters)
        self.unit.prepare()
        self.worst = 0
        self.raw, self.data = records.only(self.unit.heard, RAW), records.only(self.unit.said, DATA)
        self.send, self.send_state = self.writer(DATA), self.writer(STATE)
        self.announced = ins.NO_STAGE
        self.diagnose_with(self.diagnose)
        self.follow(RAW, self.unit.followers, self.step)

    def step(self, stamp, message, _followers):
        records.take(self.raw, message)
        self.unit.answer()
        outputs, data = self.unit.outputs[0], self.unit.messages[DATA]
        self.worst = max(self.worst, int(outputs['status']))
        self.begin_step(stamp)
        if outputs['stage'] != self.announced:
            self.announced = int(outputs['stage'])
            self.announce(self.send_state, messages.String(data=navigator.STAGES[self.announced]))
        if outputs['due']:
            records.put(data, self.data)
            self.send(data)

    def diagnose(self):
        status, self.worst = self.worst, 0
        outputs = self.unit.outputs[0]
        values = [('latency_s', f'{self.parameters.latency:g}'),
                  ('heading_error_rms_rad', f'{outputs["variance"][2]**0.5:g}')]
        if self.announced != ins.NO_STAGE:
            values += [('method', self.parameters.method), ('state', navigator.STAGES[self.announced]),
                       ('level_error_rms_rad', f'{outputs["variance"][0]**0.5:g}'),
                       *((f'velocity_{axis}', f'{v:.3f}') for axis, v in zip(('east', 'north', 'up'),
                                                                             outputs['velocity']))]
        if status:
            return shell.ERROR, ins.STATUS[status], values
        if self.steps.refused:
            return shell.WARN, self.steps.refusal, values
        if self.announced == navigator.ALIGNING:
            sigma, wanted = outputs['variance'][2]**0.5, self.parameters.alignment.aligned_sigma
            return shell.WARN, (f'aligning: heading known to {math.degrees(sigma):.2g} deg (1 sigma), navigates from '
                                f'{math.degrees(wanted):.2g} deg on'), values
        return shell.OK, 'navigating', values


def main(args=None):
    return shell.main(InsNode, args)


if __name__ == '__main__':
    sys.exit(main())
