"""ROS shell of the antenna control unit: answers every receiver error with a rate command; modes by service."""
import math
import sys

import numpy as np
from std_srvs.srv import Trigger

from acu_tracker import announcement, control_unit, modes
from acu_tracker.params import AcuParameters
from acu_tracker.unit import DRIVE, INS, JOINTS, MODE, PROGRAM, Acu
from pedestal_common import messages, records, shell


class AcuNode(shell.Shell):

    def __init__(self):
        super().__init__('acu', AcuParameters, live=('tracker', 'azimuth', 'elevation'))
        self.unit = Acu(self.parameters, 'ins' in self.graph.members)
        self.prepare(self.unit)
        self.outputs = self.unit.outputs
        self.joints = records.only(self.unit.heard, JOINTS)
        self.follower_places = [(name, records.only(self.unit.heard, name)) for name in self.unit.followers]
        self.announced = None
        self.state = self.unit.state[0]
        self.lookahead = self.state['lookahead']
        self.told = (0, 0)
        self.refused = ''
        self.drive_state = 'unknown'
        self.invalid = 0
        self.waiting = 'operator' in self.graph.members and self.graph.lockstep
        self.held = None

        # The rate command, which the drive waits for, then what is only looked at.
        self.says = [(message, records.only(self.unit.said, name), self.writer(name))
                     for name, message in self.unit.messages.items()]
        self.send_mode = self.writer(MODE)
        self.send_keyhole, self.send_hidden = self.writer('acu/keyhole'), self.writer('acu/blockage')
        self.reader(PROGRAM, self.on_program)
        self.reader(DRIVE, self.on_drive_state)
        if INS in self.unit.events:
            self.reader(INS, self.unit.take_ins_state)
        for mode in range(len(modes.MODES)):
            self.create_service(Trigger, f'acu/{modes.MODES[mode]}', self.service(mode))
        self.create_service(Trigger, 'acu/reset_faults', self.on_reset_faults)
        self.diagnose_with(self.diagnose)

        self.follow(JOINTS, self.unit.followers, self.step)

    def check_parameters(self, params):
        params.check_drive(self.graph.beams > 0)

    def reconfigure(self):
        self.unit.configure(self.parameters)

    def on_program(self, message):
        try:
            self.unit.take_program(message)
            self.refused = ''
        except ValueError as error:
            self.refused = f'acu/program_track refused: {error}'
            self.get_logger().warning(self.refused)
        self.waiting = False
        if self.held is not None:
            step, self.held = self.held, None
            self.step(*step)

    def on_drive_state(self, message):
        self.drive_state = message.data
        self.unit.take_drive_state(message)

    def step(self, stamp, joints, followers):
        """Answer step t_k; in lockstep the first one waits for the operator's program track."""
        if self.waiting:
            self.held = (stamp, joints, followers)
            return
        records.take(self.joints, joints)
        for name, place in self.follower_places:
            records.take(place, followers[name])
        self.unit.answer()
        outputs = self.outputs[0]
        self.invalid |= int(outputs['invalid_input'])
        self.begin_step(stamp)
        if outputs['mode'] != self.announced:
            self.announce_mode()
        if self.lookahead['forecasts'] != self.told[0] or self.lookahead['blockages'] != self.told[1]:
            self.announce_ahead()
        for message, place, send in self.says:
            records.put(message, place)
            send(message)

    def announce_mode(self):
        self.announced = int(self.outputs[0]['mode'])
        self.announce(self.send_mode, messages.String(data=modes.MODES[self.announced]))

    def announce_ahead(self):
        """Say what is new of a keyhole or a hidden sector; it stands until there is another."""
        keyholes, hidden = self.told
        self.told = int(self.lookahead['forecasts']), int(self.lookahead['blockages'])
        if self.told[0] != keyholes:
            text = announcement.keyhole(self.lookahead, self.parameters.tracker.receiver.beamwidth)
            self.announce(self.send_keyhole, messages.String(data=text))
        if self.told[1] != hidden:
            self.announce(self.send_hidden, messages.String(data=announcement.hidden(self.lookahead)))

    def service(self, mode):
        """The callback of a mode's service: asks the mode machine at once and answers with what it reads back."""
        def change(_request, response):
            response.success = accepted = self.unit.ask(mode)
            outputs = self.outputs[0]
            now = modes.MODES[outputs['mode']]
            response.message = (f'mode is {now}' if accepted else
                                f'refused: {modes.REASONS[outputs["reason"]]}; mode is {now}')
            return response
        return change

    def on_reset_faults(self, _request, response):
        self.refused = ''
        response.success = True
        response.message = 'cleared'
        return response

    def diagnose(self):
        """What is now, and every invalid input since the last diagnosis."""
        outputs = self.outputs[0]
        mode, reason = modes.MODES[outputs['mode']], modes.REASONS[outputs['reason']]
        invalid = [name for i, name in enumerate(control_unit.INVALID_INPUTS) if self.invalid >> i & 1]
        self.invalid = 0
        values = [('mode', mode), ('reason', reason), ('locked', str(int(outputs['locked']))),
                  ('coasting', str(int(outputs['coasting']))), ('drive', self.drive_state),
                  ('invalid_input', ' '.join(invalid)), ('errors gated', str(int(outputs['gated']))),
                  ('rates gated', str(int(outputs['rates_gated']))),
                  ('ranges gated', str(int(outputs['ranges_gated'])))]
        for axis, limited in zip(messages.AXES, np.transpose([outputs[f'{kind}_limited'] for kind in
                                                              ('angle', 'rate', 'acceleration')])):
            values.append((f'{axis} limited', ' '.join(kind for kind, on in zip(('angle', 'rate', 'acceleration'),
                                                                                 limited) if on)))
        for axis, innovation, nis in zip(messages.AXES, outputs['innovation'], outputs['nis']):
            values += [(f'{axis} innovation_deg', f'{math.degrees(innovation):.4g}'), (f'{axis} nis', f'{nis:.4g}')]
        values += [('blocked', str(int(outputs['blocked']))), *announcement.numbers(self.lookahead)]
        if self.refused:
            return shell.WARN, self.refused, values
        if self.state['overtravel']:
            return shell.WARN, 'no turn of the azimuth holds the whole program track: it will stop at a limit', values
        if self.steps.refused:
            return shell.WARN, self.steps.refusal, values
        if invalid == ['error_gated']:
            return shell.WARN, 'an error of the receiver was too far off to be believed', values
        if invalid:
            return shell.ERROR, f'invalid input: {" ".join(invalid)}', values
        return (shell.WARN if outputs['coasting'] else shell.OK), f'{mode} ({reason})', values


def main(args=None):
    return shell.main(AcuNode, args)


if __name__ == '__main__':
    sys.exit(main())
