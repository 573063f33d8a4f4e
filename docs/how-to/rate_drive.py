"""A drive of your own that follows rates: the amplifiers close the speed loops, and answer by UDP.

    pedestal run uav_flyby --pacing realtime --param adu.period=0.02 --drive 'rate_drive.py 5006 --truth'

Every period the drive sends 'AZIMUTH_RATE ELEVATION_RATE' [rad/s] to the port of the amplifiers. They answer with
'AZIMUTH ELEVATION AZIMUTH_RATE ELEVATION_RATE' [rad, rad/s] of their encoders.
"""
import argparse
import socket
import sys
import time

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.utilities import remove_ros_args
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import String

RELIABLE = 10      # quality of service: reliable, volatile, the last 10 messages
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)     # a later subscriber gets the last one

AXES = ['azimuth', 'elevation']
PERIOD_S = 0.02
"""Period of the drive [s]: the same as the parameter `period` of the control unit."""

COMMAND_TIMEOUT_S, ANSWER_TIMEOUT_S = 10.0 * PERIOD_S, 0.2
"""Age from which a command is stale, so that the axes stop, and from which the amplifiers count as silent [s]."""


class Drive(Node):
    """Publisher of clock, joint_states and adu/state; it commands the amplifiers at a UDP port.

    truth: it also publishes its encoder angles as the true ones, which a simulated receiver needs.
    """

    def __init__(self, port, truth):
        super().__init__('adu')
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.connect(('127.0.0.1', port))
        self.socket.setblocking(False)
        self.rates, self.commanded, self.answered, self.state = [0.0, 0.0], 0.0, 0.0, ''
        self.clock = self.create_publisher(Clock, 'clock', RELIABLE)
        self.joints = [self.create_publisher(JointState, topic, RELIABLE)
                       for topic in ['joint_states'] + ['adu/truth'] * truth]
        self.states = self.create_publisher(String, 'adu/state', LATCHED)
        self.create_subscription(JointState, 'acu/rate_command', self.take, RELIABLE)
        self.create_timer(PERIOD_S, self.step)

    def take(self, command):
        """Keep a command of the control unit; a name identifies its axis."""
        rates = dict(zip(command.name, command.velocity))
        self.rates, self.commanded = [rates[axis] for axis in AXES], time.monotonic()

    def step(self):
        """Publish the newest answer of the amplifiers, then command them."""
        now = time.monotonic()
        measured = self.newest()
        if measured:
            self.answered = now
            joints = JointState(name=AXES, position=measured[:2], velocity=measured[2:])
            joints.header.stamp = self.get_clock().now().to_msg()     # UTC of the measurement
            self.clock.publish(Clock(clock=joints.header.stamp))
            for publisher in self.joints:
                publisher.publish(joints)
        self.report('enabled' if now - self.answered < ANSWER_TIMEOUT_S else 'fault: amplifiers silent')
        stale = now - self.commanded > COMMAND_TIMEOUT_S
        self.send(self.command([0.0, 0.0] if stale else self.rates, measured))

    def command(self, rates, measured):
        """Return the two numbers for the amplifiers, from the rates [rad/s] that are in force."""
        return rates

    def report(self, state):
        """Publish the state when it has changed; a state other than `enabled` ends the motion of the control unit."""
        if state != self.state:
            self.state = state
            self.states.publish(String(data=state))

    def send(self, numbers):
        try:
            self.socket.send(' '.join(map(str, numbers)).encode())
        except ConnectionRefusedError:
            pass     # nothing listens at the port: the amplifiers are silent

    def newest(self):
        """Return the newest answer as four numbers, None if there was none since the last step."""
        text = b''
        try:
            while True:
                text = self.socket.recv(200)
        except (BlockingIOError, ConnectionRefusedError):
            numbers = [float(part) for part in text.split()]
            return numbers if len(numbers) == 4 else None


def main(drive):
    """Run a class of drive on the port of the command line."""
    parser = argparse.ArgumentParser(description=sys.modules[drive.__module__].__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('port', type=int, help='UDP port of the amplifiers on 127.0.0.1, 1 to 65535')
    parser.add_argument('--truth', action='store_true', help='encoder angles also on adu/truth, which a simulated '
                        'receiver needs')
    options = parser.parse_args(remove_ros_args()[1:])     # `pedestal run` adds arguments of ROS 2
    rclpy.init()
    try:
        rclpy.spin(drive(options.port, options.truth))
    except (KeyboardInterrupt, ExternalShutdownException):
        pass


if __name__ == '__main__':
    main(Drive)
