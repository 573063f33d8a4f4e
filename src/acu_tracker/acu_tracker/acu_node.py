"""ROS shell of the antenna control unit: answers every receiver error with a rate command; modes by service."""
import math
import sys

import numpy as np
from std_srvs.srv import Trigger

from acu_tracker import control_unit, modes, program_track
from acu_tracker.params import AcuParameters
from pedestal_common import messages, shell

ERROR, ATTITUDE = 'tracking_receiver/angle_error', 'ship/imu/data'


class AcuNode(shell.Shell):

    def __init__(self):
        super().__init__('acu', AcuParameters, live=('tracker', 'azimuth', 'elevation'))
        p = self.parameters
        self.constants = control_unit.constants(p)
        self.state = control_unit.initial_state(p)
        self.inputs, self.outputs = np.zeros(1, control_unit.INPUTS), np.zeros(1, control_unit.OUTPUTS)
        self.times, self.angles = np.zeros(0), np.zeros((0, 2))
        self.inputs['drive_ready'] = 1
        self.outputs[0]['mode'] = modes.STANDBY
        self.outputs['innovation'] = self.outputs['nis'] = math.nan
        control_unit.step(self.state.copy(), self.constants, self.inputs, self.outputs.copy(), self.times, self.angles)
        control_unit.request(self.state.copy(), self.constants, self.inputs, self.outputs.copy(), modes.STANDBY,
                             self.times, self.angles)
        self.announced = None
        self.refused = ''
        self.drive_state = 'unknown'
        self.invalid = 0
        self.waiting = 'operator' in self.graph.nodes and self.graph.lockstep
        self.held = None

        self.command = messages.joint_state(messages.AXES)
        self.estimate = messages.joint_trajectory('earth', [messages.trajectory_point()])
        self.reference = messages.joint_trajectory('base_link', [messages.trajectory_point()])
        self.send_command = self.writer('acu/rate_command')
        self.send_estimate = self.writer('acu/estimate')
        self.send_reference = self.writer('acu/reference')
        self.send_mode = self.writer('acu/mode')
        self.reader('acu/program_track', self.on_program)
        self.reader('adu/state', self.on_drive_state)
        for mode in range(len(modes.MODES)):
            self.create_service(Trigger, f'acu/{modes.MODES[mode]}', self.service(mode))
        self.create_service(Trigger, 'acu/reset_faults', self.on_reset_faults)
        self.diagnose_with(self.diagnose)

        self.on_ship = 'ins' in self.graph.nodes
        self.inputs[0]['stabilised'] = self.on_ship
        followers = {ERROR: p.receiver_latency, **({ATTITUDE: p.attitude_latency} if self.on_ship else {})}
        self.follow('joint_states', followers, self.step)

    def reconfigure(self):
        self.constants = control_unit.constants(self.parameters)

    def on_program(self, message):
        """A table of two or more points is a program track in earth angles, one point a preset in deck angles."""
        try:
            times, angles = rows(message)
            if len(angles) == 1:
                self.inputs[0]['preset'], self.inputs[0]['preset_valid'] = angles[0], 1
            else:
                start = messages.nanoseconds(message.header.stamp) * 1e-9
                self.times, self.angles = program_track.checked(times + start, angles)
                self.inputs[0]['program_count'] = len(self.times)
            self.refused = ''
        except ValueError as error:
            self.refused = f'acu/program_track refused: {error}'
            self.get_logger().warning(self.refused)
        self.waiting = False
        if self.held is not None:
            step, self.held = self.held, None
            self.step(*step)

    def on_drive_state(self, message):
        """A drive that never says how it is counts as ready."""
        self.drive_state = message.data
        self.inputs['drive_ready'] = message.data == 'enabled'

    def step(self, stamp, joints, followers):
        """Answer step t_k; in lockstep the first one waits for the operator's program track."""
        if self.waiting:
            self.held = (stamp, joints, followers)
            return
        inputs, outputs = self.inputs[0], self.outputs[0]
        inputs['stamp'] = stamp * 1e-9
        inputs['position'] = messages.by_name(joints.name, joints.position, messages.AXES)
        inputs['velocity'] = messages.by_name(joints.name, joints.velocity, messages.AXES)
        inputs['encoder_valid'] = 1
        error = followers[ERROR]
        inputs['error_valid'] = error is not None and error.vector.x == error.vector.x
        if error is not None:
            inputs['error_stamp'] = messages.nanoseconds(error.header.stamp) * 1e-9
            vector = error.vector
            inputs['cross_elevation'], inputs['elevation'], inputs['cn0_dbhz'] = vector.x, vector.y, vector.z
        if self.on_ship and followers[ATTITUDE] is not None:
            attitude = followers[ATTITUDE]
            q, w = attitude.orientation, attitude.angular_velocity
            inputs['attitude_stamp'] = messages.nanoseconds(attitude.header.stamp) * 1e-9
            inputs['attitude_valid'] = 1
            inputs['quaternion'] = q.x, q.y, q.z, q.w
            inputs['deck_rate'] = w.x, w.y, w.z
        control_unit.step(self.state, self.constants, self.inputs, self.outputs, self.times, self.angles)
        inputs['preset_valid'] = 0
        self.invalid |= int(outputs['invalid_input'])
        self.begin_step(stamp)
        if outputs['mode'] != self.announced:
            self.announce_mode()
        self.publish_step(stamp)

    def announce_mode(self):
        self.announced = int(self.outputs[0]['mode'])
        self.announce(self.send_mode, messages.String(data=modes.MODES[self.announced]))

    def publish_step(self, stamp):
        """The rate command, which the drive waits for, then what is only looked at."""
        outputs = self.outputs[0]
        messages.put_stamp(self.command.header.stamp, stamp)
        self.command.velocity[:] = outputs['rate']
        self.command.effort[:] = outputs['torque']
        self.send_command(self.command)
        for message, send, values in ((self.estimate, self.send_estimate, outputs['estimate']),
                                      (self.reference, self.send_reference, outputs['reference'])):
            messages.put_stamp(message.header.stamp, stamp)
            point = message.points[0]
            point.positions[:], point.velocities[:], point.accelerations[:] = values.T
            send(message)

    def service(self, mode):
        """The callback of a mode's service: asks the mode machine at once and answers with what it reads back."""
        def change(_request, response):
            accepted = control_unit.request(self.state, self.constants, self.inputs, self.outputs, mode, self.times,
                                            self.angles)
            outputs = self.outputs[0]
            response.success = bool(accepted)
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
                  ('invalid_input', ' '.join(invalid))]
        for axis, limited in zip(messages.AXES, np.transpose([outputs[f'{kind}_limited'] for kind in
                                                              ('angle', 'rate', 'acceleration')])):
            values.append((f'{axis} limited', ' '.join(kind for kind, on in zip(('angle', 'rate', 'acceleration'),
                                                                                 limited) if on)))
        for axis, innovation, nis in zip(messages.AXES, outputs['innovation'], outputs['nis']):
            values += [(f'{axis} innovation_deg', f'{math.degrees(innovation):.4g}'), (f'{axis} nis', f'{nis:.4g}')]
        if self.refused:
            return shell.WARN, self.refused, values
        if self.steps.refused:
            return shell.WARN, self.steps.refusal, values
        if invalid == ['error_gated']:
            return shell.WARN, 'an error of the receiver was too far off to be believed', values
        if invalid:
            return shell.ERROR, f'invalid input: {" ".join(invalid)}', values
        return (shell.WARN if outputs['coasting'] else shell.OK), f'{mode} ({reason})', values


def rows(message):
    """(times after the stamp (n,) [s], angles (n, 2) [rad]) of a JointTrajectory; ValueError when not there."""
    if not set(messages.AXES) <= set(message.joint_names):
        raise ValueError(f'joint_names {message.joint_names}: must hold {" and ".join(messages.AXES)}')
    columns = [message.joint_names.index(axis) for axis in messages.AXES]
    for row, point in enumerate(message.points):
        if len(point.positions) != len(message.joint_names):
            raise ValueError(f'row {row}: {len(point.positions)} positions; must be {len(message.joint_names)}')
    times = [point.time_from_start.sec + point.time_from_start.nanosec * 1e-9 for point in message.points]
    angles = [[point.positions[column] for column in columns] for point in message.points]
    return np.array(times), np.reshape(angles, (-1, len(columns)))


def main(args=None):
    return shell.main(AcuNode, args)


if __name__ == '__main__':
    sys.exit(main())
