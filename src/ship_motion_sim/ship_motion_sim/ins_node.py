"""ROS shell of the INS: hears the IMU, publishes attitude and deck rate as the INS knows them."""
import math
import sys

from pedestal_common import messages, records, shell
from ship_motion_sim import ins, navigator
from ship_motion_sim.ins_unit import DATA, RAW, STATE, Ins
from ship_motion_sim.params import InsParameters


class InsNode(shell.Shell):

    def __init__(self):
        super().__init__('ins', InsParameters)
        self.unit = Ins(self.parameters)
        self.prepare(self.unit)
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
        outputs, stage = self.unit.outputs[0], int(self.unit.outputs[0]['stage'])
        sigma = outputs['variance']**0.5
        values = [('latency_s', f'{self.parameters.latency:g}')]
        known = self.unit.state[0]['released'] > 0
        if known:
            values.append(('heading_error_rms_rad', f'{sigma[2]:g}'))
        if stage != ins.NO_STAGE:
            values += [('method', self.parameters.method), ('state', navigator.STAGES[stage])]
            if known:
                values.append(('level_error_rms_rad', f'{sigma[0]:g}'))
        if stage == navigator.NAVIGATING:
            values += [(f'velocity_{axis}', f'{v:.3f}') for axis, v in zip(('east', 'north', 'up'),
                                                                           outputs['velocity'])]
        if status:
            return shell.ERROR, ins.STATUS[status], values
        if self.steps.refused:
            return shell.WARN, self.steps.refusal, values
        if stage == navigator.ALIGNING:
            heading, wanted = (math.degrees(x) for x in (sigma[2], self.parameters.alignment.aligned_sigma))
            so_far = f'heading known to {heading:.2g} deg (1 sigma)' if known else 'heading not known yet'
            return shell.WARN, f'aligning: {so_far}, navigates from {wanted:.2g} deg on', values
        return shell.OK, 'navigating', values


def main(args=None):
    return shell.main(InsNode, args)


if __name__ == '__main__':
    sys.exit(main())
