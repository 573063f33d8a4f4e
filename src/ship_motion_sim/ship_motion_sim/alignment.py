"""Alignment of an INS: level and north from its gyros and accelerometers, by an observer with Kalman gains.

Both level channels have a linear extended state observer, and its estimates give the commands that level the frame n'
of the INS and the azimuth of n'. The study of Zhou 2011 compares five methods; this is
`riccati_eso`. Its covariance is the information limit: the least covariance of z if x1 is measured with white noise r
and x2 walks at random by q.

    dx1/dt = x2, dx2/dt = x3 + b0 u, dx3/dt = 0, y = x1        Zhou 2011 equation (9)

    x1, x2, x3  of the north and of the east channel: velocity error [m/s], its rate [m/s2], the rate of x2 without
                command [m/s3]; z1, z2, z3: their estimates; v1, v2: references of x1 and x2
                north: x2 = g a_x, x3 = g (-sin az w_N - eps_E), b0 = g
                east: x2 = -g a_y, x3 = -g ((1 - cos az) w_N - eps_N), b0 = -g
    a_x, a_y    tilts of n' about east and north; az: its azimuth; eps_E, eps_N: gyro bias [rad/s]
    u           level command of a channel [rad/s]
    r, q        variance of the measured velocity per step [m2/s2]; growth of the variance of x2, the random walk of
                the gyros times g [(m/s2)2/s]; w_N: north part of the rate of the earth

The level commands are those of Zhou 2011, equations (7), (8), (11). The correct form of (11) is u = (u0 - z3) / b0,
but the paper prints u0 - z3 / b0. With the printed form the east channel (b0 < 0) has positive feedback and ends at
180 deg of level, and the gain of the north channel is g times too high.
"""
import math
from typing import Annotated

import numpy as np

from pedestal_common.compiled import compiled
from pedestal_common.fhan import fhan
from pedestal_common.quantities import (
    Floats,
    MetersPerSecond,
    MetersPerSecond2,
    Pair,
    Radians,
    RadiansPerSecond,
    Records,
    Seconds,
    Vector3,
)
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


class Observer(Record):
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
def predicted(z1: MetersPerSecond, z2: MetersPerSecond2, z3: float, b0_u: float,
              h: Seconds) -> tuple[MetersPerSecond, MetersPerSecond2, float]:
    """Return (z1, z2, z3) h later under the input b0_u [m/s3]."""
    rate = z3 + b0_u
    return z1 + h * z2 + 0.5 * h * h * rate, z2 + h * rate, z3


@compiled
def kalman_gains(p11: float, p12: float, p13: float, r: float) -> tuple[float, float, float]:
    """Return the gains (l1 [-], l2 [1/s], l3 [1/s2]) that give the smallest covariance."""
    return p11 / (p11 + r), p12 / (p11 + r), p13 / (p11 + r)


@compiled
def innovation_ratio(ratio: float, e_east: MetersPerSecond, e_north: MetersPerSecond, s: float, h: Seconds) -> float:
    """Return the mean `ratio`, h later, of innovation^2 over its variance s [m2/s2]; 1 on a sea as expected."""
    return ratio + h / INNOVATION_TIME_CONSTANT_S * (0.5 * (e_east * e_east + e_north * e_north) / s - ratio)


@compiled
def swell_variance(observer: Observer, s: float) -> float:
    """Return the variance of the innovations [m2/s2] above the variance s of the expected sea; it counts as swell."""
    return max(observer.innovation_ratio - EXPECTED_INNOVATION_RATIO, 0.0) * s


INITIAL_VELOCITY_SIGMA_M_S, INITIAL_LEVEL_SIGMA_RAD, INITIAL_AZIMUTH_SIGMA_RAD = 0.1, math.radians(5.0), 2.0
"""Standard deviations at power-up [m/s], [rad], [rad]; the azimuth is unknown."""


@compiled
def start(observer: Observer, conditions: Conditions, level_sigma: Radians, azimuth_sigma: Radians) -> None:
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
def predict_covariance(observer: Observer, conditions: Conditions, h: Seconds) -> None:
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
def correct_covariance(observer: Observer, l1: float, l2: float, l3: float, r: float) -> None:
    """Correct p for any gains l = (l1, l2, l3): (I - l H) p (I - l H)^T + l r l^T with H = (1, 0, 0)."""
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
def predict(observer: Observer, h: Seconds) -> None:
    """Predict z of both channels over h."""
    for i in range(2):
        z = observer.z[i]
        z[0], z[1], z[2] = predicted(z[0], z[1], z[2], observer.input[i], h)


@compiled
def correct(observer: Observer, v_east: MetersPerSecond, v_north: MetersPerSecond, l1: float, l2: float, l3: float,
            s: float, h: Seconds) -> None:
    """Correct z of both channels with measured velocities; s: expected variance of the innovations [m2/s2]."""
    e_east, e_north = v_east - observer.z[0, 0], v_north - observer.z[1, 0]
    observer.innovation_ratio = innovation_ratio(observer.innovation_ratio, e_east, e_north, s, h)
    for i in range(2):
        z, e = observer.z[i], e_east if i == 0 else e_north
        z[0] += l1 * e
        z[1] += l2 * e
        z[2] += l3 * e


@compiled
def azimuth(observer: Observer, conditions: Conditions) -> Radians:
    """Return the azimuth misalignment az from z3, which is -g sin az w_N north and -g (1 - cos az) w_N east."""
    g = conditions.gravity
    return math.atan2(-observer.z[1, 2] / g, conditions.earth_rate[1] + observer.z[0, 2] / g)


@compiled
def tilt(observer: Observer, conditions: Conditions) -> Radians:
    """Return the observed tilt of n', rms of both axes, that the commands have not removed yet."""
    return math.hypot(observer.z[0, 1], observer.z[1, 1]) / (math.sqrt(2.0) * conditions.gravity)


@compiled
def sigmas(observer: Observer, conditions: Conditions, swell: float) -> tuple[Radians, Radians]:
    """Return the (azimuth, level) 1 sigma from the covariance and the biases of the sensors.

    Innovations that are larger than expected increase the covariance. swell: variance of z3 due to swell [m2/s6].
    """
    factor, g, w_N = max(observer.innovation_ratio, 1.0), conditions.gravity, conditions.earth_rate[1]
    azimuth_variance = ((factor * observer.p[5] + swell) / g**2 + conditions.gyro_bias**2) / w_N**2
    level_variance = (factor * observer.p[3] + conditions.accelerometer_bias**2) / g**2
    return min(math.sqrt(azimuth_variance), math.pi), math.sqrt(level_variance)


DAMPING_COEFFICIENT = 0.8  # damping coefficient c1 [-]
FHAN_LIMIT_M_S3 = 1e3  # limit r1 of the function fhan [m/s3], which is linear for errors within r1 / w_c^2
MAX_LEVELLING_RATE_RAD_S = 0.5  # limit of a level command [rad/s]


@compiled
def differentiated(v1: MetersPerSecond, v2: MetersPerSecond2, reference: MetersPerSecond,
                   h: Seconds) -> tuple[MetersPerSecond, MetersPerSecond2]:
    """Return (v1, v2) of the tracking differentiator h later. With r0 = 1/h^2, h0 = h, c0 = 1 of the paper, it reaches
    the reference in two steps."""
    return v1 + h * v2, v2 + h * fhan(v1 - reference, v2, 1.0 / (h * h), h)


@compiled
def command(z1: MetersPerSecond, z2: MetersPerSecond2, z3: float, v1: MetersPerSecond, v2: MetersPerSecond2, b0: float,
            w_c: RadiansPerSecond) -> RadiansPerSecond:
    """Return the command u of a channel, within MAX_LEVELLING_RATE_RAD_S. It brings z1, z2 to the references v1, v2
    with the bandwidth w_c, and cancels z3; b0 [m/s2 per rad]."""
    u0 = fhan(z1 - v1, DAMPING_COEFFICIENT * (z2 - v2), FHAN_LIMIT_M_S3, 1.0 / w_c)
    return min(max((u0 - z3) / b0, -MAX_LEVELLING_RATE_RAD_S), MAX_LEVELLING_RATE_RAD_S)


@compiled
def level(observer: Observer, conditions: Conditions, v1: Pair, v2: Pair, w_c: RadiansPerSecond,
          out: Vector3) -> None:
    """Put the commands into out (w_cE, w_cN, w_cU) [rad/s]. The observer receives the limited command."""
    g = conditions.gravity
    out[1] = command(observer.z[0, 0], observer.z[0, 1], observer.z[0, 2], v1[0], v2[0], -g, w_c)
    out[0] = command(observer.z[1, 0], observer.z[1, 1], observer.z[1, 2], v1[1], v2[1], g, w_c)
    out[2] = 0.0
    observer.input[0], observer.input[1] = -g * out[1], g * out[0]


ALIGNING_BANDWIDTH_RAD_S, NAVIGATING_BANDWIDTH_RAD_S = 1.0, 0.1
"""Bandwidth of the level control [rad/s]: high to level a deck, low in navigation with only noise to follow."""


class State(Record):
    """State of the method."""
    observer: Observer
    v1: Pair                # references of x1 of both channels [m/s]
    v2: Pair                # and of x2 [m/s2]
    command: Vector3        # rate of n' about east, north and up [rad/s]
    azimuth: Radians        # estimated misalignment
    azimuth_sigma: Radians  # stated 1 sigmas
    level_sigma: Radians


@compiled
def advance_covariance(observer: Observer, conditions: Conditions,
                       h: Seconds) -> tuple[float, float, float, float]:
    """Advance the covariance by a step h with its measurement. Return (l1, l2, l3, variance of the innovation)."""
    r = conditions.velocity_density / h
    predict_covariance(observer, conditions, h)
    s = observer.p[0] + r
    l1, l2, l3 = kalman_gains(observer.p[0], observer.p[1], observer.p[2], r)
    correct_covariance(observer, l1, l2, l3, r)
    return l1, l2, l3, s


@compiled
def step(state: State, conditions: Conditions, v_east: MetersPerSecond, v_north: MetersPerSecond, h: Seconds,
         w_c: RadiansPerSecond) -> None:
    """Execute one step h after the last; v_east, v_north: velocity error in n'. The bandwidth w_c of the level control
    does not affect the estimate, because the observer receives its exact commands."""
    observer = state.observer
    # The wanted velocity error is zero, so v1 and v2 start at zero and stay there. The differentiator is part of the
    # ADRC of Zhou 2011.
    for i in range(2):
        state.v1[i], state.v2[i] = differentiated(state.v1[i], state.v2[i], 0.0, h)
    predict(observer, h)
    l1, l2, l3, variance = advance_covariance(observer, conditions, h)
    correct(observer, v_east, v_north, l1, l2, l3, variance, h)
    level(observer, conditions, state.v1, state.v2, w_c, state.command)
    state.azimuth = azimuth(observer, conditions)
    # z3 is the integral of l3 / h times the innovations. Swell is the part of the innovations above the expected sea.
    # The slowest swell, of 16 s, gives z3 its largest oscillation, because an integral divides by the frequency.
    swing = l3 / (h * MIN_SWELL_FREQUENCY_RAD_S)
    swell = swing * swing * swell_variance(observer, variance)
    state.azimuth_sigma, level_sigma = sigmas(observer, conditions, swell)
    state.level_sigma = math.hypot(level_sigma, tilt(observer, conditions))
