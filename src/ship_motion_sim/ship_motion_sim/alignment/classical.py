"""Alignment method: the fourth-order gyrocompass. A wrong azimuth tilts n', and the north velocity corrects it.

    dv/dt = f - K1 v, w_cE = -k2 v_N, w_cN = k2 v_E, w_cU = K3 / (w_N (s + K4)) v_N
    K1 = K4 = 2 s0, k2 = 4 s0^2/g, K3 = 4 s0^4/g

    v, f            velocity error (v_E, v_N) [m/s] and specific force [m/s2], both level, in n'
    w_cE .. w_cU    commanded rates of n' about east, north and up [rad/s]
    s, s0           Laplace variable, bandwidth [rad/s]
    n', az          frame that the INS computes for east, north, up; its azimuth misalignment [rad]
    w_N, g          north part of the rate of the earth [rad/s], gravity [m/s2]
    K1, k2, K3, K4  gains of the loop; a_x: tilt of n' about east [rad]

All four poles are at -s0 +- j s0. An azimuth error of 180 deg is an unstable equilibrium. Because the loop is closed
from power-up, the transient of the first levelling leaves this equilibrium. The velocities are those of a gyrocompass,
the integrals of two accelerometers. They lack the term w_cU x v, which the rotation of the axes would add.
"""
import math

import numpy as np

from pedestal_common.compiled import compiled
from pedestal_common.quantities import Pair, Vector3
from pedestal_common.record import Record
from ship_motion_sim.alignment import steady_state
from ship_motion_sim.alignment.conditions import UNKNOWN_AZIMUTH_SIGMA_RAD

MAX_AZIMUTH_RATE_RAD_S = 0.1
"""Limit of the azimuth command [rad/s]; without it the first levelling would reach 0.2 rad/s."""


class Constants(Record):
    """Record."""
    s0: float  # bandwidth [rad/s]
    K1: float
    k2: float
    K3: float
    K4: float
    azimuth_sigma: float
    level_sigma: float
    residual: float  # 1 sigmas in the settled loop [rad]


class State(Record):
    """Record."""
    t: float  # time since power-up [s]
    lagged: float  # v_N / (s + K4) [m]
    residual: float  # azimuth that the loop still corrects, smoothed [rad]
    correction: Pair  # to subtract from v_E, v_N in this step [m/s]
    command: Vector3
    azimuth: float
    azimuth_sigma: float
    level_sigma: float


def constants(k, s0, h) -> np.ndarray:
    """Return one record of Constants for the bandwidth s0 [rad/s] and steps of h [s]; k: Conditions."""
    record = np.zeros((), Constants.dtype)
    g, w_north = float(k['gravity']), float(k['earth_rate'][1])
    K1 = K4 = 2.0 * s0
    k2, K3 = 4.0 * s0**2 / g, 4.0 * s0**4 / g
    # rates: d/dt of the state (v, a_x, lagged, az, residual) of the north channel. Its noises are the velocity noise
    # per step and the random walk of the gyros.
    rates = np.array([[-K1, g, 0.0, 0.0, 0.0], [-k2, 0.0, 0.0, -w_north, 0.0], [1.0, 0.0, -K4, 0.0, 0.0],
                      [0.0, 0.0, K3 / w_north, 0.0, 0.0], [0.0, 0.0, K3 / w_north, 0.0, -0.5 * s0]])
    noise = h * rates[:, 0]
    Q = np.outer(noise, noise) * float(k['velocity_density']) / h
    Q += np.diag([0.0, 1.0, 0.0, 1.0, 0.0]) * float(k['gyro_noise'])**2 * h
    P = steady_state.covariance(np.eye(5) + h * rates, Q)
    record['residual'] = math.sqrt(P[4, 4])
    record['s0'], record['K1'], record['k2'], record['K3'], record['K4'] = s0, K1, k2, K3, K4
    record['azimuth_sigma'] = math.sqrt(P[3, 3] + (float(k['gyro_bias']) / w_north)**2)
    record['level_sigma'] = math.sqrt(P[1, 1] + (float(k['accelerometer_bias']) / g)**2)
    return record


@compiled
def envelope(x):
    """Return the decay from 1 after x = s0 t [-], by the slower pair of poles of the loop."""
    return (1.0 + x) * math.exp(-x)


@compiled
def step(s, c, k, v_east, v_north, h):
    """Execute one step h [s] after the last; v_east, v_north: velocity error in n' [m/s].

    s, c, k: records State, Constants, Conditions.
    """
    s.t += h
    s.lagged += h * (v_north - c.K4 * s.lagged)
    # The correction has the damping, and removes the term w_c x v that the strapdown has just added.
    s.correction[0] = h * (c.K1 * v_east + s.command[2] * v_north)
    s.correction[1] = h * (c.K1 * v_north - s.command[2] * v_east)
    s.command[0], s.command[1] = -c.k2 * v_north, c.k2 * v_east
    s.command[2] = min(max(c.K3 / k.earth_rate[1] * s.lagged, -MAX_AZIMUTH_RATE_RAD_S), MAX_AZIMUTH_RATE_RAD_S)
    # The loop corrects a steady az with the rate az s0 / 2, except at 180 deg, which the envelope covers.
    s.residual += h * (s.command[2] - 0.5 * c.s0 * s.residual)
    transient = UNKNOWN_AZIMUTH_SIGMA_RAD * envelope(c.s0 * s.t)
    moving = max(s.residual**2 - 9.0 * c.residual**2, 0.0)      # beyond three sigma of its noise
    s.azimuth_sigma = min(math.sqrt(c.azimuth_sigma**2 + moving + transient**2), UNKNOWN_AZIMUTH_SIGMA_RAD)
    s.level_sigma = c.level_sigma + transient
