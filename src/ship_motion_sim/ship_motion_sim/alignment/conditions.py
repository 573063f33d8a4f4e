"""Conditions that every alignment method assumes: latitude, sensors and sea; argument k of the methods."""
import math

import numpy as np

from ship_motion_sim import earth

CONDITIONS_DTYPE = np.dtype([
    ('gravity', 'f8'),                  # [m/s2]
    ('earth_rate', 'f8', (3,)),         # ENU [rad/s]
    ('velocity_density', 'f8'),         # density of the velocity of sea and aid: variance per step x step [m2/s]
    ('gyro_noise', 'f8'),               # angle random walk [rad/sqrt(s)]
    ('gyro_bias', 'f8'),                # 1 sigma [rad/s]: the limit of azimuth is gyro_bias / w_N
    ('accelerometer_bias', 'f8'),       # 1 sigma [m/s2]: the limit of level is accelerometer_bias / g
], align=True)


def conditions(p, latitude) -> np.ndarray:
    """Return one record of CONDITIONS_DTYPE for AlignmentParameters p at a latitude [rad]."""
    record = np.zeros((), CONDITIONS_DTYPE)
    record['gravity'], record['earth_rate'] = earth.gravity(latitude), earth.rate(latitude)
    record['velocity_density'] = p.velocity_disturbance**2 * p.step
    record['gyro_noise'], record['gyro_bias'] = p.gyro_noise, p.gyro_bias
    record['accelerometer_bias'] = p.accelerometer_bias
    return record


UNKNOWN_AZIMUTH_SIGMA_RAD = math.pi  # standard deviation of an unknown azimuth [rad]
