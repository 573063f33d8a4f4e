"""Conditions that every alignment method assumes: latitude, sensors and sea."""
import math

import numpy as np

from pedestal_common.quantities import MetersPerSecond2, Radians, RadiansPerSecond, Records, Vector3
from pedestal_common.record import Record
from ship_motion_sim import earth
from ship_motion_sim.params import AlignmentParameters


class Conditions(Record):
    """Latitude, sensors and sea."""
    gravity: MetersPerSecond2
    earth_rate: Vector3         # ENU [rad/s]
    velocity_density: float     # density of the velocity of sea and aid: variance per step x step [m2/s]
    gyro_noise: float           # angle random walk [rad/sqrt(s)]
    gyro_bias: RadiansPerSecond             # 1 sigma: the limit of azimuth is gyro_bias / w_N
    accelerometer_bias: MetersPerSecond2    # 1 sigma: the limit of level is accelerometer_bias / g


def conditions(p: AlignmentParameters, latitude: Radians) -> Records:
    """Return the Conditions (), one record, at a latitude."""
    record = np.zeros((), Conditions.dtype)
    record['gravity'], record['earth_rate'] = earth.gravity(latitude), earth.rate(latitude)
    record['velocity_density'] = p.velocity_disturbance**2 * p.step
    record['gyro_noise'], record['gyro_bias'] = p.gyro_noise, p.gyro_bias
    record['accelerometer_bias'] = p.accelerometer_bias
    return record


UNKNOWN_AZIMUTH_SIGMA_RAD = math.pi  # standard deviation of an unknown azimuth [rad]
