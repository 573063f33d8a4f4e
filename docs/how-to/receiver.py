"""A receiver of your own: angle errors that arrive by UDP become the topic tracking_receiver/angle_error.

    python receiver.py 5005

A datagram is 'CROSS_ELEVATION ELEVATION CN0' in rad, rad, dB-Hz; 'nan nan 20' states that the receiver is not locked.
"""
import math
import signal
import socket
import sys

import rclpy
from geometry_msgs.msg import Vector3Stamped
from rclpy.node import Node
from sensor_msgs.msg import JointState

from pedestal_common.node import middleware


class Receiver(Node):
    """Publisher of the newest error for each message on joint_states, with the stamp of that message."""

    def __init__(self, port):
        super().__init__('tracking_receiver')
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(('127.0.0.1', port))
        self.socket.setblocking(False)
        self.publisher = self.create_publisher(Vector3Stamped, 'tracking_receiver/angle_error', middleware.qos('step'))
        self.create_subscription(JointState, 'joint_states', self.step, middleware.qos('step'))

    def step(self, joints):
        error = Vector3Stamped(header=joints.header)
        error.header.frame_id = 'beam'
        error.vector.x, error.vector.y, error.vector.z = self.newest()
        self.publisher.publish(error)

    def newest(self):
        """Return the newest datagram as three numbers; no lock if none has come since the last step."""
        text = b'nan nan 0'
        try:
            while True:
                text = self.socket.recv(100)
        except BlockingIOError:
            pass
        try:
            cross_elevation, elevation, cn0 = map(float, text.split())
        except ValueError:          # another datagram
            return math.nan, math.nan, 0.0
        return cross_elevation, elevation, cn0


middleware.initialise()
signal.signal(signal.SIGINT, signal.SIG_DFL)      # Ctrl-C also ends a node that waits for a message
rclpy.spin(Receiver(int(sys.argv[1])))
