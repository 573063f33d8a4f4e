"""The linear extended state observer of a level channel: x1' = x2, x2' = x3 + b0 u, y = x1. Paper 001 equation (9).

Linear, as the paper's is in effect: its delta = 20000 keeps fal in its linear zone. With fixed gains, scheduled ones
or those of a Kalman filter; the covariance below holds for any.
"""
import math

import numpy as np

from pedestal_common.compiled import compiled

STATE = np.dtype([
    ('z', 'f8', (2, 3)),                # east, north: z1, z2, z3
    ('push', 'f8', (2,)),               # b0 u in force since the last step [m/s3]
    ('p', 'f8', (6,)),                  # p11, p12, p13, p22, p23, p33, the same for both channels
    ('surprise', 'f8'),                 # mean of innovation^2 over its expected variance
], align=True)

SURPRISE_TIME = 30.0    # time constant of that mean [s]


@compiled
def gains(w_o, h):
    """(l1 [-], l2 [1/s], l3 [1/s2]) that put the three poles at exp(-w_o h)."""
    p = math.exp(-w_o * h)
    return 1.0 - p**3, 1.5 * (1.0 - p)**2 * (1.0 + p) / h, (1.0 - p)**3 / (h * h)


@compiled
def predicted(z1, z2, z3, push, h):
    """(z1, z2, z3) h later; push = b0 u."""
    rate = z3 + push
    return z1 + h * z2 + 0.5 * h * h * rate, z2 + h * rate, z3


@compiled
def covariance_predicted(p11, p12, p13, p22, p23, p33, q, h):
    """The covariance h later, F p F^T + Q; q [(m/s2)2/s] is what the gyros' random walk does to x2."""
    half = 0.5 * h * h
    a11, a12, a13 = p11 + h * p12 + half * p13, p12 + h * p22 + half * p23, p13 + h * p23 + half * p33
    a22, a23 = p22 + h * p23, p23 + h * p33
    return a11 + h * a12 + half * a13, a12 + h * a13, a13, a22 + h * a23 + q * h, a23, p33


@compiled
def kalman_gains(p11, p12, p13, r):
    """(l1, l2, l3) that make the covariance smallest."""
    return p11 / (p11 + r), p12 / (p11 + r), p13 / (p11 + r)


@compiled
def covariance_corrected(p11, p12, p13, p22, p23, p33, l1, l2, l3, r):
    """The covariance after a correction with any gains: (I - l H) p (I - l H)^T + l r l^T."""
    s = p11 + r
    return ((1.0 - l1)**2 * p11 + l1 * l1 * r,
            (1.0 - l1) * (p12 - l2 * p11) + l1 * l2 * r,
            (1.0 - l1) * (p13 - l3 * p11) + l1 * l3 * r,
            p22 - 2.0 * l2 * p12 + l2 * l2 * s, p23 - l2 * p13 - l3 * p12 + l2 * l3 * s,
            p33 - 2.0 * l3 * p13 + l3 * l3 * s)


@compiled
def surprised(surprise, e_east, e_north, s, h):
    """The running mean of innovation^2 over its expected variance s: 1 where the disturbance is as expected."""
    return surprise + h / SURPRISE_TIME * (0.5 * (e_east * e_east + e_north * e_north) / s - surprise)


VELOCITY_SIGMA, LEVEL_SIGMA, AZIMUTH_SIGMA = 0.1, math.radians(5.0), 2.0
"""What is known at power-up [m/s], [rad], [rad]: any azimuth."""


@compiled
def start(o, k, level_sigma, azimuth_sigma):
    """Nothing observed yet (record STATE; k CONDITIONS), 1 sigma [rad] of level and azimuth as given."""
    for i in range(2):
        o.push[i] = 0.0
        for j in range(3):
            o.z[i, j] = 0.0
    for i in range(6):
        o.p[i] = 0.0
    o.p[0] = VELOCITY_SIGMA**2
    o.p[3] = (level_sigma * k.gravity)**2
    o.p[5] = (azimuth_sigma * k.gravity * k.earth_rate[1])**2
    o.surprise = 1.0


@compiled
def predict_covariance(o, k, h):
    """Carry o.p over h."""
    p = o.p
    p[0], p[1], p[2], p[3], p[4], p[5] = covariance_predicted(p[0], p[1], p[2], p[3], p[4], p[5],
                                                              (k.gravity * k.gyro_noise)**2, h)


@compiled
def correct_covariance(o, l1, l2, l3, r):
    """Put a correction with these gains into o.p."""
    p = o.p
    p[0], p[1], p[2], p[3], p[4], p[5] = covariance_corrected(p[0], p[1], p[2], p[3], p[4], p[5], l1, l2, l3, r)


@compiled
def predict(o, h):
    """Carry z of both channels over h."""
    for i in range(2):
        z = o.z[i]
        z[0], z[1], z[2] = predicted(z[0], z[1], z[2], o.push[i], h)


@compiled
def correct(o, v_east, v_north, l1, l2, l3, s, h):
    """Correct z of both channels with the measured velocities; s: expected variance of the innovations."""
    e_east, e_north = v_east - o.z[0, 0], v_north - o.z[1, 0]
    o.surprise = surprised(o.surprise, e_east, e_north, s, h)
    for i in range(2):
        z, e = o.z[i], e_east if i == 0 else e_north
        z[0] += l1 * e
        z[1] += l2 * e
        z[2] += l3 * e


@compiled
def azimuth(o, k):
    """az [rad] of what the observer finds: z3 = g (-sin az w_N) north, -g (1 - cos az) w_N east."""
    return math.atan2(-o.z[1, 2] / k.gravity, k.earth_rate[1] + o.z[0, 2] / k.gravity)


@compiled
def tilt(o, k):
    """Level of n' [rad], rms of both axes, that is known to be wrong and that the commands have not taken away yet."""
    return math.hypot(o.z[0, 1], o.z[1, 1]) / (math.sqrt(2.0) * k.gravity)


@compiled
def sigmas(o, k):
    """(azimuth, level) 1 sigma [rad]: covariance, wider where the sea surprises, and the sensors' biases."""
    wider = max(o.surprise, 1.0)
    azimuth_variance = (wider * o.p[5] / k.gravity**2 + k.gyro_bias**2) / k.earth_rate[1]**2
    level_variance = (wider * o.p[3] + k.accelerometer_bias**2) / k.gravity**2
    return min(math.sqrt(azimuth_variance), math.pi), math.sqrt(level_variance)
