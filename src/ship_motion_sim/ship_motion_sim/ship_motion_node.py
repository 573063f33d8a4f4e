"""ROS shell of the ship: answers every tick of the drive's clock with the ship's truth and what its IMU feels."""
import sys

import numpy as np

from pedestal_common import messages, noise, shell
from ship_motion_sim import imu, motion
from ship_motion_sim.params import ShipMotionParameters


class ShipMotionNode(shell.Shell):

    def __init__(self):
        super().__init__('ship_motion', ShipMotionParameters)
        self.ship = motion.constants(self.parameters.ship)
        self.imu = imu.constants(self.parameters)
        self.inputs, self.truth = np.zeros(1, motion.INPUTS), np.zeros(1, motion.OUTPUTS)
        self.imu_inputs, self.felt = np.zeros(1, imu.INPUTS), np.zeros(1, imu.OUTPUTS)
        self.rng = noise.generator(self.parameters.imu.seed, 'ship_motion')
        self.last_stamp = None
        self.compute(0, 1.0, np.zeros(imu.NORMALS))

        self.odometry = messages.odometry('earth', 'base_link')
        self.data_raw = messages.imu('base_link')
        self.send_truth = self.writer('ship/truth')
        self.send_imu = self.writer('ship/imu/data_raw')
        self.diagnose_with(self.diagnose)
        self.follow('clock', {}, self.step)

    def compute(self, stamp, dt, normals):
        self.inputs['t'] = stamp * 1e-9
        self.imu_inputs['dt'] = dt
        motion.step(self.ship, self.inputs, self.truth)
        imu.step(self.imu, self.imu_inputs, self.truth, self.felt, normals)

    def step(self, stamp, _clock, _inputs):
        dt = (stamp - self.last_stamp) * 1e-9 if self.last_stamp is not None else NOMINAL_PERIOD
        self.last_stamp = stamp
        self.compute(stamp, dt, self.rng.standard_normal(imu.NORMALS))
        truth, felt = self.truth[0], self.felt[0]
        messages.put_stamp(self.odometry.header.stamp, stamp)
        messages.put_stamp(self.data_raw.header.stamp, stamp)
        pose, twist = self.odometry.pose.pose, self.odometry.twist.twist
        put_vector(pose.position, truth['position'])
        put_quaternion(pose.orientation, truth['quaternion'])
        put_vector(twist.linear, truth['velocity_deck'])
        put_vector(twist.angular, truth['angular_velocity'])
        put_vector(self.data_raw.angular_velocity, felt['angular_velocity'])
        put_vector(self.data_raw.linear_acceleration, felt['linear_acceleration'])
        self.begin_step(stamp)
        self.send_truth(self.odometry)
        self.send_imu(self.data_raw)

    def diagnose(self):
        truth = self.truth[0]
        values = [(f'{name}_deg', f'{np.degrees(truth[name]):.3f}') for name in ('roll', 'pitch')]
        for status, names in ((truth['status'], motion.STATUS), (self.felt[0]['status'], imu.STATUS)):
            if status:
                return shell.ERROR, names[status], values
        if self.steps.refused:
            return shell.WARN, self.steps.refusal, values
        return shell.OK, 'under way', values


NOMINAL_PERIOD = 5e-3
"""What the IMU takes for the length of its first sample [s]."""


def put_vector(message, values):
    message.x, message.y, message.z = values.tolist()


def put_quaternion(message, values):
    message.x, message.y, message.z, message.w = values.tolist()


def main(args=None):
    return shell.main(ShipMotionNode, args)


if __name__ == '__main__':
    sys.exit(main())
