"""A drive of your own that follows rates: the amplifiers close the speed loops, and answer by UDP.

    python rate_drive.py 5006

Every period the drive sends 'AZIMUTH_RATE ELEVATION_RATE' [rad/s] to the port of the amplifiers. They answer with
'AZIMUTH ELEVATION AZIMUTH_RATE ELEVATION_RATE' [rad, rad/s] of their encoders.
"""
import argparse
import signal
import socket
import sys
import time

import rclpy
from rclpy.node import Node
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from pedestal_common.node import middleware

AXES = ['azimuth', 'elevation']
PERIOD_S = 0.02
"""Period of the drive [s]: the same as the parameter `period` of the control unit."""

COMMAND_TIMEOUT_S, ANSWER_TIMEOUT_S = 10.0 * PERIOD_S, 0.2
"""Age from which a command is stale, so that the axes stop, and from which the amplifiers count as silent [s]."""


class Drive(Node):
    """Publisher of clock, joint_states and adu/state; it commands the amplifiers at a UDP port."""

    def __init__(self, port):
        super().__init__('adu')
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.connect(('127.0.0.1', port))
        self.socket.setblocking(False)
        self.rates, self.commanded, self.answered, self.state = [0.0, 0.0], 0.0, 0.0, ''
        self.clock = self.create_publisher(Clock, 'clock', middleware.qos('step'))
        self.joints = self.create_publisher(JointState, 'joint_states', middleware.qos('step'))
        self.states = self.create_publisher(String, 'adu/state', middleware.qos('change'))
        self.create_subscription(JointState, 'acu/rate_command', self.take, middleware.qos('step'))
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
            self.joints.publish(joints)
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
    options = parser.parse_args()
    middleware.initialise()
    signal.signal(signal.SIGINT, signal.SIG_DFL)      # Ctrl-C also ends a node that waits for a message
    rclpy.spin(drive(options.port))


if __name__ == '__main__':
    main(Drive)
