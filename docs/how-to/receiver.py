"""A receiver of your own: angle errors that arrive by UDP become the topic tracking_receiver/angle_error.

    pedestal run uav_flyby --pacing realtime --receiver 'receiver.py 5005'

A datagram is 'CROSS_ELEVATION ELEVATION CN0' in rad, rad, dB-Hz; 'nan nan 20' states that the receiver is not locked.
"""
import argparse
import socket

import rclpy
from geometry_msgs.msg import Vector3Stamped
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.utilities import remove_ros_args
from sensor_msgs.msg import JointState

RELIABLE = 10      # quality of service: reliable, volatile, the last 10 messages


class Receiver(Node):
    """Publisher of the newest error, at most one for each message on joint_states, with the stamp of that message."""

    def __init__(self, port):
        super().__init__('tracking_receiver')
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(('127.0.0.1', port))
        self.socket.setblocking(False)
        self.publisher = self.create_publisher(Vector3Stamped, 'tracking_receiver/angle_error', RELIABLE)
        self.create_subscription(JointState, 'joint_states', self.step, RELIABLE)

    def step(self, joints):
        if text := self.newest():
            error = Vector3Stamped(header=joints.header)
            error.header.frame_id = 'beam'
            try:
                error.vector.x, error.vector.y, error.vector.z = map(float, text.split())
            except ValueError:
                self.get_logger().warning(f'{text!r}: must be three numbers', throttle_duration_sec=10.0)
                return
            self.publisher.publish(error)

    def newest(self):
        """Return the newest datagram since the last step; without one, nothing is published: no measurement."""
        text = b''
        try:
            while True:
                text = self.socket.recv(100)
        except BlockingIOError:
            return text


def main():
    """Run the receiver on the port of the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('port', type=int, help='UDP port on 127.0.0.1, 1 to 65535')
    options = parser.parse_args(remove_ros_args()[1:])     # `pedestal run` adds arguments of ROS 2
    rclpy.init()
    try:
        rclpy.spin(Receiver(options.port))
    except (KeyboardInterrupt, ExternalShutdownException):
        pass


if __name__ == '__main__':
    main()
