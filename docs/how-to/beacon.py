"""A simulated receiver of your own, a plain rclpy node: it sees a beacon on a mast through a noisy pencil beam.

    pedestal run docs/how-to/beacon.yaml --receiver docs/how-to/beacon.py

It answers each step of the drive, so the run may be in lockstep or in realtime.
"""
import argparse
import math
import random

import rclpy
from geometry_msgs.msg import Vector3Stamped
from nav_msgs.msg import Odometry
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.utilities import remove_ros_args
from sensor_msgs.msg import JointState

RELIABLE = 10      # quality of service: reliable, volatile, the last 10 messages
AZIMUTH_RAD, ELEVATION_RAD, RANGE_M = math.radians(30.0), math.radians(20.0), 5000.0
BEAM_RAD, NOISE_RAD, CN0_DBHZ = math.radians(1.0), 1e-4, 60.0     # noise that the control unit expects at this C/N0


class Beacon(Node):
    """Publisher of an angle error, and of the true target, for each true direction of the dish."""

    def __init__(self):
        super().__init__('tracking_receiver')
        self.noise = random.Random(1)
        self.errors = self.create_publisher(Vector3Stamped, 'tracking_receiver/angle_error', RELIABLE)
        self.truths = self.create_publisher(Odometry, 'target/truth', RELIABLE)
        self.create_subscription(JointState, 'adu/truth', self.step, RELIABLE)

    def step(self, dish):
        """Publish NaN while the beacon is outside the beam, and the truth always."""
        azimuth, elevation = dish.position
        across = math.remainder(AZIMUTH_RAD - azimuth, math.tau) * math.cos(elevation)
        up = ELEVATION_RAD - elevation
        locked = math.hypot(across, up) < BEAM_RAD
        error = Vector3Stamped(header=dish.header)     # the stamp of the step
        error.header.frame_id = 'beam'
        error.vector.x = across + self.noise.gauss(0.0, NOISE_RAD) if locked else math.nan
        error.vector.y = up + self.noise.gauss(0.0, NOISE_RAD) if locked else math.nan
        error.vector.z = CN0_DBHZ if locked else 20.0
        truth = Odometry(header=dish.header, child_frame_id='target')
        truth.header.frame_id = 'earth'
        place = truth.pose.pose.position               # east, north, up of the antenna
        place.x = RANGE_M * math.cos(ELEVATION_RAD) * math.sin(AZIMUTH_RAD)
        place.y = RANGE_M * math.cos(ELEVATION_RAD) * math.cos(AZIMUTH_RAD)
        place.z = RANGE_M * math.sin(ELEVATION_RAD)
        self.errors.publish(error)
        self.truths.publish(truth)


def main():
    """Run the receiver until the run ends."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.parse_args(remove_ros_args()[1:])           # `pedestal run` adds arguments of ROS 2
    rclpy.init()
    try:
        rclpy.spin(Beacon())
    except (KeyboardInterrupt, ExternalShutdownException):
        pass


if __name__ == '__main__':
    main()
