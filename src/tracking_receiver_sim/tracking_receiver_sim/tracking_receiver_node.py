"""ROS shell of the tracking receiver: answers every joint state with the three receiver channels."""
import sys

import numpy as np

from pedestal_common import line_of_sight, messages, noise, shell
from tracking_receiver_sim import receiver, target
from tracking_receiver_sim.params import TrackingReceiverNodeParameters

FAULTS = (receiver.NO_TARGET, receiver.NO_JOINTS, receiver.STAMP_ORDER)


class TrackingReceiverNode(shell.Shell):

    def __init__(self):
        super().__init__('tracking_receiver', TrackingReceiverNodeParameters)
        p = self.parameters
        self.target = target.build(p.target, p.duration)
        self.constants = receiver.constants(p, p.period, self.target)
        self.state = receiver.initial_state()
        self.inputs, self.outputs = np.zeros(1, receiver.INPUTS), np.zeros(1, receiver.OUTPUTS)
        self.inputs[0]['mat_ed'] = line_of_sight.ashore_matrix()
        self.rng = noise.generator(p.seed, 'tracking_receiver')
        self.normals = receiver.normals_per_step(p)
        receiver.step(self.state.copy(), self.constants, self.inputs, self.outputs, self.target.breaks,
                      self.target.coefficients, np.zeros(self.normals))

        self.fault = receiver.LOCKED
        self.error = messages.Vector3Stamped(header=messages.header('beam'), vector=messages.vector3())
        self.truth = messages.odometry('earth', 'target')
        self.send_error = self.writer('tracking_receiver/angle_error')
        self.send_truth = self.writer('target/truth')
        self.diagnose_with(self.diagnose)
        self.on_ship = 'ship_motion' in self.graph.members
        self.follow('joint_states', {'ship/truth': 0.0} if self.on_ship else {}, self.step)

    def step(self, stamp, joints, followers):
        inputs, outputs = self.inputs[0], self.outputs[0]
        inputs['stamp_ns'] = stamp
        inputs['azimuth'], inputs['elevation'] = messages.by_name(joints.name, joints.position, messages.AXES)
        inputs['valid'] = 1
        if self.on_ship and followers['ship/truth'] is not None:
            pose = followers['ship/truth'].pose.pose
            q = pose.orientation
            line_of_sight.rotation(q.x, q.y, q.z, q.w, inputs['mat_ed'])
            inputs['position'] = pose.position.x, pose.position.y, pose.position.z
        receiver.step(self.state, self.constants, self.inputs, self.outputs, self.target.breaks,
                      self.target.coefficients, self.rng.standard_normal(self.normals))
        if outputs['status'] in FAULTS:
            self.fault = int(outputs['status'])
        self.begin_step(stamp)
        if outputs['due']:
            messages.put_stamp(self.error.header.stamp, int(outputs['stamp_ns']))
            vector = self.error.vector
            vector.x, vector.y = float(outputs['cross_elevation']), float(outputs['elevation'])
            vector.z = float(outputs['cn0_dbhz'])
            self.send_error(self.error)
        messages.put_stamp(self.truth.header.stamp, stamp)
        position, velocity = self.truth.pose.pose.position, self.truth.twist.twist.linear
        position.x, position.y, position.z = outputs['target_position'].tolist()
        velocity.x, velocity.y, velocity.z = outputs['target_velocity'].tolist()
        self.send_truth(self.truth)

    def diagnose(self):
        """What is now, and the last fault since the last diagnosis."""
        outputs = self.outputs[0]
        status = int(outputs['status'])
        fault, self.fault = self.fault, receiver.LOCKED
        values = [('cn0_dbhz', f'{outputs["cn0_dbhz"]:.2f}'), ('locked', str(int(outputs['locked']))),
                  ('target', self.parameters.target.kind)]
        sigma = receiver.angle_noise(self.parameters, float(outputs['cn0_dbhz']), self.parameters.period)
        values.append(('angle_noise_deg', f'{np.degrees(sigma):.4g}'))
        if self.target.start_time:
            values.append(('stamp_0_utc', self.target.start_time))
        if self.steps.refused:
            return shell.WARN, self.steps.refusal, values
        if fault in FAULTS:
            return shell.ERROR, receiver.STATUSES[fault], values
        return (shell.OK if status == receiver.LOCKED else shell.WARN), receiver.STATUSES[status], values


def main(args=None):
    return shell.main(TrackingReceiverNode, args)


if __name__ == '__main__':
    sys.exit(main())
