"""The linear extended state observer of the two level channels, which all alignment methods except classical share.

    dx1/dt = x2, dx2/dt = x3 + b0 u, dx3/dt = 0, y = x1        paper 001 equation (9)

    x1, x2, x3      of the north and of the east channel: velocity error [m/s], its rate [m/s2], the rate of x2 without
                    command [m/s3]
    z1, z2, z3      estimates of x1, x2, x3; p11 to p33: elements of their covariance
    u, b0 u         level command of the channel [rad/s]; its effect on the rate of x2 [m/s3]
    w_o, h          bandwidth of the observer [rad/s], step [s]
    l1, l2, l3      gains of the observer
    n', az          frame that the INS computes for east, north, up; its azimuth misalignment [rad]
    w_N, g          north part of the rate of the earth [rad/s], gravity [m/s2]

The observer of the paper is linear too, because its delta = 20000 keeps the nonlinear function fal in its linear zone.
The gains are fixed, scheduled, or those of a Kalman filter; the covariance is valid for any gains.
"""
import math
from typing import Annotated

from pedestal_common.compiled import compiled
from pedestal_common.quantities import (
    Floats,
    MetersPerSecond,
    MetersPerSecond2,
    Pair,
    Radians,
    RadiansPerSecond,
    Seconds,
)
from pedestal_common.record import Record
from ship_motion_sim.alignment.conditions import Conditions


class State(Record):
    """State of the observer of both channels, east and north."""
    z: Annotated[Floats, (2, 3)]    # east, north: z1, z2, z3
    input: Pair                     # input b0 u since the last step [m/s3]
    p: Annotated[Floats, (6,)]      # p11, p12, p13, p22, p23, p33, the same for both channels
    innovation_ratio: float         # running mean of innovation^2 over its expected variance


INNOVATION_TIME_CONSTANT_S = 30.0  # time constant of the running mean of innovation_ratio [s]
EXPECTED_INNOVATION_RATIO = 1.2  # innovation ratio on a sea as expected, with the noise of the running mean [-]
MIN_SWELL_FREQUENCY_RAD_S = 2.0 * math.pi / 16.0
"""Frequency of the slowest swell on which a stated 1 sigma is valid [rad/s]: 16 s, the longest expected period."""


@compiled
def gains(w_o: RadiansPerSecond, h: Seconds) -> tuple[float, float, float]:
    """Return the gains (l1 [-], l2 [1/s], l3 [1/s2]) that put the three poles at exp(-w_o h)."""
    p = math.exp(-w_o * h)
    return 1.0 - p**3, 1.5 * (1.0 - p)**2 * (1.0 + p) / h, (1.0 - p)**3 / (h * h)


@compiled
def predicted(z1: MetersPerSecond, z2: MetersPerSecond2, z3: float, b0_u: float,
              h: Seconds) -> tuple[MetersPerSecond, MetersPerSecond2, float]:
    """Return (z1, z2, z3) h later under the input b0_u [m/s3]."""
    rate = z3 + b0_u
    return z1 + h * z2 + 0.5 * h * h * rate, z2 + h * rate, z3


@compiled
def kalman_gains(p11: float, p12: float, p13: float, r: float) -> tuple[float, float, float]:
    """Return the gains (l1 [-], l2 [1/s], l3 [1/s2]) that give the smallest covariance.

    p11, p12, p13: elements of the covariance; r: variance of the measured velocity [m2/s2].
    """
    return p11 / (p11 + r), p12 / (p11 + r), p13 / (p11 + r)


@compiled
def innovation_ratio(ratio: float, e_east: MetersPerSecond, e_north: MetersPerSecond, s: float, h: Seconds) -> float:
    """Return the running mean `ratio`, h later, of innovation^2 divided by its expected variance s [m2/s2].

    e_east, e_north: innovations. The mean is 1 if the disturbance is as expected.
    """
    return ratio + h / INNOVATION_TIME_CONSTANT_S * (0.5 * (e_east * e_east + e_north * e_north) / s - ratio)


@compiled
def swell_variance(observer: State, s: float) -> float:
    """Return the variance of the innovations [m2/s2] above the variance s of the expected sea; it counts as swell."""
    return max(observer.innovation_ratio - EXPECTED_INNOVATION_RATIO, 0.0) * s


INITIAL_VELOCITY_SIGMA_M_S, INITIAL_LEVEL_SIGMA_RAD, INITIAL_AZIMUTH_SIGMA_RAD = 0.1, math.radians(5.0), 2.0
"""Standard deviations at power-up [m/s], [rad], [rad]; the azimuth is unknown."""


@compiled
def start(observer: State, conditions: Conditions, level_sigma: Radians, azimuth_sigma: Radians) -> None:
    """Reset the observer at power-up."""
    for i in range(2):
        observer.input[i] = 0.0
        for j in range(3):
            observer.z[i, j] = 0.0
    for i in range(6):
        observer.p[i] = 0.0
    observer.p[0] = INITIAL_VELOCITY_SIGMA_M_S**2
    observer.p[3] = (level_sigma * conditions.gravity)**2
    observer.p[5] = (azimuth_sigma * conditions.gravity * conditions.earth_rate[1])**2
    observer.innovation_ratio = 1.0


@compiled
def predict_covariance(observer: State, conditions: Conditions, h: Seconds) -> None:
    """Predict the covariance p over h: F p F^T + Q, with Q the effect of the random walk of the gyros on x2."""
    # half: h^2 / 2; aij: elements of F p. F does not change p33.
    p, q, half = observer.p, (conditions.gravity * conditions.gyro_noise)**2, 0.5 * h * h
    p11, p12, p13 = p[0], p[1], p[2]
    p22, p23, p33 = p[3], p[4], p[5]
    a11, a12, a13 = p11 + h * p12 + half * p13, p12 + h * p22 + half * p23, p13 + h * p23 + half * p33
    a22, a23 = p22 + h * p23, p23 + h * p33
    p[0], p[1], p[2] = a11 + h * a12 + half * a13, a12 + h * a13, a13
    p[3], p[4] = a22 + h * a23 + q * h, a23


@compiled
def correct_covariance(observer: State, l1: float, l2: float, l3: float, r: float) -> None:
    """Correct the covariance p for any gains l = (l1, l2, l3): (I - l H) p (I - l H)^T + l r l^T with H = (1, 0, 0).

    r: variance of the measured velocity [m2/s2].
    """
    p = observer.p
    p11, p12, p13 = p[0], p[1], p[2]
    p22, p23, p33 = p[3], p[4], p[5]
    s = p11 + r
    p[0] = (1.0 - l1)**2 * p11 + l1 * l1 * r
    p[1] = (1.0 - l1) * (p12 - l2 * p11) + l1 * l2 * r
    p[2] = (1.0 - l1) * (p13 - l3 * p11) + l1 * l3 * r
    p[3] = p22 - 2.0 * l2 * p12 + l2 * l2 * s
    p[4] = p23 - l2 * p13 - l3 * p12 + l2 * l3 * s
    p[5] = p33 - 2.0 * l3 * p13 + l3 * l3 * s


@compiled
def predict(observer: State, h: Seconds) -> None:
    """Predict z of both channels over h."""
    for i in range(2):
        z = observer.z[i]
        z[0], z[1], z[2] = predicted(z[0], z[1], z[2], observer.input[i], h)


@compiled
def correct(observer: State, v_east: MetersPerSecond, v_north: MetersPerSecond, l1: float, l2: float, l3: float,
            s: float, h: Seconds) -> None:
    """Correct z of both channels with measured velocities.

    l1, l2, l3: gains; s: expected variance of the innovations [m2/s2].
    """
    e_east, e_north = v_east - observer.z[0, 0], v_north - observer.z[1, 0]
    observer.innovation_ratio = innovation_ratio(observer.innovation_ratio, e_east, e_north, s, h)
    for i in range(2):
        z, e = observer.z[i], e_east if i == 0 else e_north
        z[0] += l1 * e
        z[1] += l2 * e
        z[2] += l3 * e


@compiled
def azimuth(observer: State, conditions: Conditions) -> Radians:
    """Return the azimuth misalignment az from z3, which is -g sin az w_N north and -g (1 - cos az) w_N east."""
    g = conditions.gravity
    return math.atan2(-observer.z[1, 2] / g, conditions.earth_rate[1] + observer.z[0, 2] / g)


@compiled
def tilt(observer: State, conditions: Conditions) -> Radians:
    """Return the observed tilt of n', rms of both axes, that the commands have not removed yet."""
    return math.hypot(observer.z[0, 1], observer.z[1, 1]) / (math.sqrt(2.0) * conditions.gravity)


@compiled
def sigmas(observer: State, conditions: Conditions, swell: float) -> tuple[Radians, Radians]:
    """Return the (azimuth, level) 1 sigma from the covariance and the biases of the sensors.

    Innovations that are larger than expected increase the covariance. swell: variance of z3 due to swell [m2/s6].
    """
    factor, g, w_N = max(observer.innovation_ratio, 1.0), conditions.gravity, conditions.earth_rate[1]
    azimuth_variance = ((factor * observer.p[5] + swell) / g**2 + conditions.gyro_bias**2) / w_N**2
    level_variance = (factor * observer.p[3] + conditions.accelerometer_bias**2) / g**2
    return min(math.sqrt(azimuth_variance), math.pi), math.sqrt(level_variance)
