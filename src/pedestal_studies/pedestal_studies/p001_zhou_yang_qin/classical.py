"""Alignment method: the fourth-order gyrocompass. A wrong azimuth tilts n', and the north velocity corrects it.

    dv/dt = f - K1 v, w_cE = -k2 v_N, w_cN = k2 v_E, w_cU = K3 / (w_N (s + K4)) v_N
    K1 = K4 = 2 s0, k2 = 4 s0^2/g, K3 = 4 s0^4/g

    v, f            velocity error (v_E, v_N) [m/s] and specific force [m/s2], both level, in n'
    w_cE .. w_cU    commanded rates of n' about east, north and up [rad/s]
    s, s0           Laplace variable, bandwidth [rad/s]; w_N: north part of the rate of the earth [rad/s]

All four poles are at -s0 +- j s0. An azimuth error of 180 deg is an unstable equilibrium. Because the loop is closed
from power-up, the transient of the first levelling leaves this equilibrium. The velocities are those of a gyrocompass,
the integrals of two accelerometers. They lack the term w_cU x v, which the rotation of the axes would add.
"""
import math

import numpy as np

from pedestal_common.compiled import compiled
from pedestal_common.quantities import (
    Floats,
    Meters,
    MetersPerSecond,
    Pair,
    Radians,
    RadiansPerSecond,
    Records,
    Seconds,
    Vector3,
)
from pedestal_common.record import Record
from pedestal_common.reproducible import solution
from ship_motion_sim import alignment

MAX_AZIMUTH_RATE_RAD_S = 0.1  # without this limit the first levelling would reach 0.2 rad/s


class Constants(Record):
    """Gains of the loop and its accuracy."""
    s0: RadiansPerSecond    # bandwidth
    K1: float
    k2: float
    K3: float
    K4: float
    azimuth_sigma: Radians  # 1 sigmas in the settled loop
    level_sigma: Radians
    residual: Radians


class State(Record):
    """State of the method."""
    t: Seconds              # since power-up
    lagged: Meters          # v_N / (s + K4)
    residual: Radians       # azimuth that the loop still corrects, smoothed
    correction: Pair        # to subtract from v_E, v_N in this step [m/s]
    command: Vector3        # rate of n' about east, north and up [rad/s]
    azimuth: Radians        # estimated misalignment
    azimuth_sigma: Radians  # stated 1 sigmas
    level_sigma: Radians


def steady_covariance(A: Floats, Q: Floats) -> Floats:
    """Return the P (n, n) that solves P = A P A^T + Q, of a stable loop x(k+1) = A x(k) + noise of covariance Q.

    The elements of P, stacked to a vector, are the solution of (1 - kron(A, A)) P = Q. Because the covariance becomes
    a constant of a law, `reproducible.solution` takes the place of numpy.linalg.solve, whose last bits differ between
    processors.
    """
    n = len(A)
    return np.reshape(solution(np.eye(n * n) - np.kron(A, A), Q.ravel()), (n, n))


def constants(conditions: Records, s0: RadiansPerSecond, h: Seconds) -> Records:
    """Return the Constants (), one record, for the bandwidth s0 and steps of h."""
    record = np.zeros((), Constants.dtype)
    g, w_north = float(conditions['gravity']), float(conditions['earth_rate'][1])
    K1 = K4 = 2.0 * s0
    k2, K3 = 4.0 * s0**2 / g, 4.0 * s0**4 / g
    # rates: d/dt of the state (v, a_x, lagged, az, residual) of the north channel. Its noises are the velocity noise
    # per step and the random walk of the gyros.
    rates = np.array([[-K1, g, 0.0, 0.0, 0.0], [-k2, 0.0, 0.0, -w_north, 0.0], [1.0, 0.0, -K4, 0.0, 0.0],
                      [0.0, 0.0, K3 / w_north, 0.0, 0.0], [0.0, 0.0, K3 / w_north, 0.0, -0.5 * s0]])
    noise = h * rates[:, 0]
    Q = np.outer(noise, noise) * float(conditions['velocity_density']) / h
    Q += np.diag([0.0, 1.0, 0.0, 1.0, 0.0]) * float(conditions['gyro_noise'])**2 * h
    P = steady_covariance(np.eye(5) + h * rates, Q)
    record['residual'] = math.sqrt(P[4, 4])
    record['s0'], record['K1'], record['k2'], record['K3'], record['K4'] = s0, K1, k2, K3, K4
    record['azimuth_sigma'] = math.sqrt(P[3, 3] + (float(conditions['gyro_bias']) / w_north)**2)
    record['level_sigma'] = math.sqrt(P[1, 1] + (float(conditions['accelerometer_bias']) / g)**2)
    return record


@compiled
def envelope(x: float) -> float:
    """Return the decay from 1 after x = s0 t [-], by the slower pair of poles of the loop."""
    return (1.0 + x) * math.exp(-x)


@compiled
def step(state: State, constants: Constants, conditions: alignment.Conditions, v_east: MetersPerSecond,
         v_north: MetersPerSecond, h: Seconds) -> None:
    """Execute one step h after the last; v_east, v_north: velocity error in n'."""
    state.t += h
    state.lagged += h * (v_north - constants.K4 * state.lagged)
    # The correction has the damping, and removes the term w_c x v that the strapdown has just added.
    state.correction[0] = h * (constants.K1 * v_east + state.command[2] * v_north)
    state.correction[1] = h * (constants.K1 * v_north - state.command[2] * v_east)
    state.command[0], state.command[1] = -constants.k2 * v_north, constants.k2 * v_east
    state.command[2] = min(max(constants.K3 / conditions.earth_rate[1] * state.lagged, -MAX_AZIMUTH_RATE_RAD_S),
                           MAX_AZIMUTH_RATE_RAD_S)
    # The loop corrects a steady az with the rate az s0 / 2, except at 180 deg, which the envelope covers.
    state.residual += h * (state.command[2] - 0.5 * constants.s0 * state.residual)
    transient = alignment.UNKNOWN_AZIMUTH_SIGMA_RAD * envelope(constants.s0 * state.t)
    moving = max(state.residual**2 - 9.0 * constants.residual**2, 0.0)      # beyond three sigma of its noise
    state.azimuth_sigma = min(math.sqrt(constants.azimuth_sigma**2 + moving + transient**2),
                              alignment.UNKNOWN_AZIMUTH_SIGMA_RAD)
    state.level_sigma = constants.level_sigma + transient
