"""ROS shell of the INS: hears the IMU, publishes attitude and deck rate as the INS knows them."""
import sys

import numpy as np

from pedestal_common import messages, noise, shell
from ship_motion_sim import ins
from ship_motion_sim.params import InsParameters


class InsNode(shell.Shell):

    def __init__(self):
        super().__init__('ins', InsParameters)
        self.constants = ins.constants(self.parameters)
        self.state = ins.initial_state()
        self.inputs, self.outputs = np.zeros(1, ins.INPUTS), np.zeros(1, ins.OUTPUTS)
        self.rng = noise.generator(self.parameters.seed, 'ins')
        ins.step(self.state.copy(), self.constants, self.inputs, self.outputs, np.zeros(ins.NORMALS))

        self.worst = 0
        self.data = messages.imu('base_link')
        self.data.orientation_covariance = np.diag(attitude_variance(self.parameters)).ravel()
        self.data.angular_velocity_covariance = (np.eye(3) * self.parameters.rate_noise**2).ravel()
        self.send = self.writer('ship/imu/data')
        self.diagnose_with(self.diagnose)
        self.follow('ship/imu/data_raw', {}, self.step)

    def step(self, stamp, message, _inputs):
        inputs, outputs = self.inputs[0], self.outputs[0]
        w, f = message.angular_velocity, message.linear_acceleration
        inputs['stamp_ns'] = stamp
        inputs['angular_velocity'] = w.x, w.y, w.z
        inputs['linear_acceleration'] = f.x, f.y, f.z
        ins.step(self.state, self.constants, self.inputs, self.outputs, self.rng.standard_normal(ins.NORMALS))
        self.worst = max(self.worst, int(outputs['status']))
        self.begin_step(stamp)
        if outputs['due']:
            data = self.data
            messages.put_stamp(data.header.stamp, int(outputs['stamp_ns']))
            data.orientation.x, data.orientation.y, data.orientation.z, data.orientation.w = (
                outputs['quaternion'].tolist())
            data.angular_velocity.x, data.angular_velocity.y, data.angular_velocity.z = (
                outputs['angular_velocity'].tolist())
            f = data.linear_acceleration
            f.x, f.y, f.z = outputs['linear_acceleration'].tolist()
            self.send(data)

    def diagnose(self):
        status, self.worst = self.worst, 0
        values = [('latency_s', f'{self.parameters.latency:g}'),
                  ('heading_error_rms_rad', f'{attitude_variance(self.parameters)[2]**0.5:g}')]
        if status:
            return shell.ERROR, ins.STATUS[status], values
        if self.steps.refused:
            return shell.WARN, self.steps.refusal, values
        return shell.OK, 'navigating', values


def attitude_variance(p):
    """Variance of roll, pitch and heading [rad2] that the INS declares."""
    return (p.roll_bias**2 + p.tilt_wander**2 + p.tilt_noise**2, p.pitch_bias**2 + p.tilt_wander**2 + p.tilt_noise**2,
            p.heading_bias**2 + p.heading_wander**2 + p.heading_noise**2)


def main(args=None):
    return shell.main(InsNode, args)


if __name__ == '__main__':
    sys.exit(main())
