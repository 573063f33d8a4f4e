"""Paper 001, corrected: level by ADRC (TD, ESO, NLC), azimuth from the commands that keep it level.

Once level, the commands only cancel the tilt by the earth's rotation, so (14), (15) at rest give (19):
sin az = w_cE / w_N, cos az = 1 + w_cN / w_N. The commands are noisy; the least-squares slope of their integral since
`start` removes the noise (a plain mean does not: reference/nav.md section 1.3).
"""
import cmath
import math

import numpy as np

from pedestal_common.compiled import compiled
from pedestal_common.reproducible import solution
from ship_motion_sim.alignment import extended_observer, levelling, slope, steady_state
from ship_motion_sim.alignment.conditions import UNKNOWN_AZIMUTH_SIGMA_RAD

CONSTANTS_DTYPE = np.dtype([
    ('w_o', 'f8'), ('w_c', 'f8'),           # bandwidth of observer and of level control [rad/s]
    ('start', 'f8'),                        # the commands count from here on [s]
    ('velocity_variance', 'f8'),            # of the settled loop [m2/s2]
    ('innovation_variance', 'f8'),          # of its observer [m2/s2]
    ('swell', 'f8'),                        # variance of the velocity over that of the innovations, on swell [-]
    ('level', 'f8'),                        # 1 sigma once settled [rad]
], align=True)

STATE_DTYPE = np.dtype([
    ('t', 'f8'),                            # since the start [s]
    ('observer', extended_observer.STATE_DTYPE),
    ('v1', 'f8', (2,)), ('v2', 'f8', (2,)),
    ('first', 'f8', (2,)), ('second', 'f8', (2,)), ('count', 'i8'),     # slope of w_cE, w_cN
    ('command', 'f8', (3,)), ('azimuth', 'f8'), ('azimuth_sigma', 'f8'), ('level_sigma', 'f8'),
], align=True)


def constants(k, p, h) -> np.ndarray:
    """The record () of CONSTANTS_DTYPE of AdrcParameters for steps of h [s]; k: CONDITIONS."""
    record = np.zeros((), CONSTANTS_DTYPE)
    record['w_o'], record['w_c'], record['start'] = p.observer, p.control, p.start
    g, r = float(k['gravity']), float(k['velocity_density']) / h
    # One channel, command in fhan's linear zone: v, x2, z1, z2, z3 under noise of the velocity and random walk.
    F = np.array([[1.0, h, 0.5 * h * h], [0.0, 1.0, h], [0.0, 0.0, 1.0]])
    push = np.array([0.5 * h * h, h, 0.0])
    law = -np.array([p.control**2, 2.0 * levelling.DAMPING_COEFFICIENT * p.control, 1.0])
    gain = np.array(extended_observer.gains(p.observer, h))
    before = np.zeros((5, 5))
    before[:2, :2], before[:2, 2:] = F[:2, :2], np.outer(push[:2], law)
    before[2:, 2:] = F + np.outer(push, law)
    innovation = before[0] - before[2]
    A = before.copy()
    A[2:] += np.outer(gain, innovation)
    noise = np.concatenate(([0.0, 0.0], gain))
    Q = np.outer(noise, noise) * r
    Q[1, 1] += (g * float(k['gyro_noise']))**2 * h
    P = steady_state.covariance(A, Q)
    record['velocity_variance'] = P[0, 0]
    record['innovation_variance'] = np.sum(np.outer(innovation, innovation) * P) + r
    z = cmath.exp(1j * extended_observer.MIN_SWELL_FREQUENCY_RAD_S * h)
    state = solution(z * np.eye(5) - A, noise)
    record['swell'] = abs(state[0] / (state[0] - state[2] + 1.0))**2
    record['level'] = math.sqrt(P[1, 1] + float(k['accelerometer_bias'])**2) / g
    return record


@compiled
def azimuth_sigma(c, k, o, window):
    """1 sigma [rad] of the azimuth from the slope over a window [s]; o: STATE_DTYPE of the extended_observer.

    The gyros' random walk has 1.2 / window under the parabola's weights. The commands' own noise is the second
    derivative of the velocity's integral, so that only the ends of the window count: 2 x 6^2 / window^4 of the
    velocity's variance. What the observer did not expect is taken for swell, which the loop makes larger.
    """
    g, w_north = k.gravity, k.earth_rate[1]
    variance = c.velocity_variance + c.swell * extended_observer.swell_variance(o, c.innovation_variance)
    noise = 72.0 * variance / (g * window * window)**2
    return min(math.sqrt(noise + 1.2 * k.gyro_noise**2 / window + k.gyro_bias**2) / w_north, UNKNOWN_AZIMUTH_SIGMA_RAD)


@compiled
def level_sigma(c, k, o, t):
    """1 sigma [rad] of level t [s] after power-up: that of the settled loop, widened where innovations are larger than
    expected, or the observed tilt if that is more; and the initial tilt that the observer, all poles at w_o, has not
    yet observed."""
    x = c.w_o * t
    unseen = extended_observer.INITIAL_LEVEL_SIGMA_RAD * (1.0 + x + 0.5 * x * x) * math.exp(-x)
    return math.hypot(max(math.sqrt(max(o.surprise, 1.0)) * c.level, extended_observer.tilt(o, k)), unseen)


@compiled
def step(s, c, k, v_east, v_north, h):
    """One step h [s] after the last, v_east, v_north [m/s] in n'; records STATE_DTYPE, CONSTANTS_DTYPE, CONDITIONS."""
    s.t += h
    o = s.observer
    for i in range(2):
        s.v1[i], s.v2[i] = levelling.differentiated(s.v1[i], s.v2[i], 0.0, h)
    l1, l2, l3 = extended_observer.gains(c.w_o, h)
    extended_observer.predict(o, h)
    extended_observer.correct(o, v_east, v_north, l1, l2, l3, c.innovation_variance, h)
    levelling.level(o, k, s.v1, s.v2, c.w_c, s.command)
    s.azimuth_sigma, s.level_sigma = UNKNOWN_AZIMUTH_SIGMA_RAD, level_sigma(c, k, o, s.t)
    if s.t < c.start:
        return
    for i in range(2):
        s.first[i], s.second[i], count = slope.added(s.first[i], s.second[i], s.count, s.command[i])
    s.count = count
    w_east = slope.slope(s.first[0], s.second[0], count)
    w_north = slope.slope(s.first[1], s.second[1], count)
    s.azimuth = math.atan2(w_east, k.earth_rate[1] + w_north)
    s.azimuth_sigma = azimuth_sigma(c, k, o, count * h)
