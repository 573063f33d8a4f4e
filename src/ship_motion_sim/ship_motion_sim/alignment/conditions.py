"""Conditions that every alignment method assumes: latitude, sensors and sea; argument k of the methods."""
import math

import numpy as np

from pedestal_common.quantities import Vector3
from pedestal_common.record import Record
from ship_motion_sim import earth


class Conditions(Record):
    """Record."""
    gravity: float  # [m/s2]
    earth_rate: Vector3  # ENU [rad/s]
    velocity_density: float  # density of the velocity of sea and aid: variance per step x step [m2/s]
    gyro_noise: float  # angle random walk [rad/sqrt(s)]
    gyro_bias: float  # 1 sigma [rad/s]: the limit of azimuth is gyro_bias / w_N
    accelerometer_bias: float  # 1 sigma [m/s2]: the limit of level is accelerometer_bias / g


def conditions(p, latitude) -> np.ndarray:
    """Return one record of Conditions for AlignmentParameters p at a latitude [rad]."""
    record = np.zeros((), Conditions.dtype)
    record['gravity'], record['earth_rate'] = earth.gravity(latitude), earth.rate(latitude)
    record['velocity_density'] = p.velocity_disturbance**2 * p.step
    record['gyro_noise'], record['gyro_bias'] = p.gyro_noise, p.gyro_bias
    record['accelerometer_bias'] = p.accelerometer_bias
    return record


UNKNOWN_AZIMUTH_SIGMA_RAD = math.pi  # standard deviation of an unknown azimuth [rad]
