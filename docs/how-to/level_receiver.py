"""A receiver of your own without error channels: levels that arrive by UDP become tracking_receiver/angle_error.

    python level_receiver.py 5007

A datagram is 'CN0' in dB-Hz, at any rate, for example 20 times a second. Mode `steptrack` needs nothing else.
"""
import math
import socket
import sys

import rclpy
from geometry_msgs.msg import Vector3Stamped
from rclpy.node import Node

from pedestal_common.node import middleware


class LevelReceiver(Node):
    """Publisher of each level, with the errors NaN and with the UTC of its arrival."""

    def __init__(self, port):
        super().__init__('tracking_receiver')
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(('127.0.0.1', port))
        self.publisher = self.create_publisher(Vector3Stamped, 'tracking_receiver/angle_error', middleware.qos('step'))

    def publish(self):
        """Wait for a level and publish it."""
        error = Vector3Stamped()
        level = float(self.socket.recv(100))
        error.header.frame_id, error.header.stamp = 'beam', self.get_clock().now().to_msg()
        error.vector.x, error.vector.y, error.vector.z = math.nan, math.nan, level
        self.publisher.publish(error)


middleware.initialise()
receiver = LevelReceiver(int(sys.argv[1]))
while rclpy.ok():
    receiver.publish()
