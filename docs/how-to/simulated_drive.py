"""A simulated drive of your own, in lockstep: both axes follow the rates with a lag.

    pedestal run uav_flyby --drive docs/how-to/simulated_drive.py

It publishes a step, and waits for the command with the stamp of this step before the next one.
"""
import argparse
import math

import rclpy
from builtin_interfaces.msg import Time
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile
from rclpy.utilities import remove_ros_args
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import String

LOSSLESS = QoSProfile(depth=1, history=HistoryPolicy.KEEP_ALL)      # reliable, volatile
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)     # a later subscriber gets the last one
AXES = ['azimuth', 'elevation']
READERS = {'adu/truth': 2, 'joint_states': 2, 'clock': 1}     # receiver, control unit and recorder of this graph
BANDWIDTH = 30.0    # of the axes [rad/s]


class Drive(Node):
    """Publisher of clock, joint_states, adu/truth and adu/state. `pedestal run` gives it period and duration."""

    def __init__(self):
        super().__init__('adu')
        self.period, self.duration = (self.declare_parameter(name, 0.005).value for name in ('period', 'duration'))
        self.angles, self.rates, self.k = [-0.7, 0.15], [0.0, 0.0], -1
        self.steps = {topic: self.create_publisher(Clock if topic == 'clock' else JointState, topic, LOSSLESS)
                      for topic in READERS}
        self.states = self.create_publisher(String, 'adu/state', LATCHED)
        self.states.publish(String(data='enabled'))
        self.create_subscription(JointState, 'acu/rate_command', self.move, LOSSLESS)
        self.waiting = self.create_timer(0.05, self.begin)

    def begin(self):
        """Publish step 0 as soon as all nodes of the graph are there, because a message before would be lost."""
        if self.count_publishers('acu/rate_command') and all(
                publisher.get_subscription_count() >= READERS[topic] for topic, publisher in self.steps.items()):
            self.waiting.cancel()
            self.publish()

    def move(self, command):
        """Move by the command of step k to step k + 1."""
        rates = dict(zip(command.name, command.velocity))
        share = -math.expm1(-BANDWIDTH * self.period)
        for i, axis in enumerate(AXES):
            self.rates[i] += share * (rates[axis] - self.rates[i])
            self.angles[i] += self.period * self.rates[i]
        self.publish()

    def publish(self):
        """Publish the next step, or end the run."""
        if (self.k + 0.5) * self.period > self.duration:
            for publisher in self.steps.values():
                publisher.wait_for_all_acked()
            raise SystemExit
        self.k += 1
        nanoseconds = round(self.k * self.period * 1e9)
        joints = JointState(name=AXES, position=self.angles, velocity=self.rates)
        joints.header.stamp = Time(sec=nanoseconds // 10**9, nanosec=nanoseconds % 10**9)
        for topic, publisher in self.steps.items():
            publisher.publish(Clock(clock=joints.header.stamp) if topic == 'clock' else joints)


def main():
    """Run the drive until the end of the run."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.parse_args(remove_ros_args()[1:])     # `pedestal run` adds arguments of ROS 2
    rclpy.init()
    try:
        rclpy.spin(Drive())
    except (KeyboardInterrupt, ExternalShutdownException):
        pass


if __name__ == '__main__':
    main()
