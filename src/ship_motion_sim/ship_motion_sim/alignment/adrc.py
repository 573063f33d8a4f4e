"""Alignment method of paper 001, corrected: level by ADRC, azimuth from the commands that keep the INS level.

The ADRC consists of tracking differentiator, extended state observer and nonlinear combination. Symbols: see the
package. After levelling, the commands only cancel the tilt by the rotation of the earth. So equations (14) and (15) of
the paper, at rest, give (19): sin az = w_cE / w_N, cos az = 1 + w_cN / w_N. The commands are noisy. The least-squares
slope of their integral since `start` suppresses the noise; a plain mean does not.
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
    ('start', 'f8'),                        # time after which the azimuth uses the commands [s]
    ('velocity_variance', 'f8'),            # variance of the velocity in the settled loop [m2/s2]
    ('innovation_variance', 'f8'),          # variance of the innovations in the settled loop [m2/s2]
    ('swell', 'f8'),                        # on swell: variance of the velocity / that of the innovations [-]
    ('level', 'f8'),                        # 1 sigma of level of the settled loop [rad]
], align=True)

STATE_DTYPE = np.dtype([
    ('t', 'f8'),                            # time since power-up [s]
    ('observer', extended_observer.STATE_DTYPE),
    ('v1', 'f8', (2,)), ('v2', 'f8', (2,)),     # tracking differentiator: reference of velocity and of its rate
    ('first', 'f8', (2,)), ('second', 'f8', (2,)), ('count', 'i8'),     # running sums of slope.added for w_cE, w_cN
    ('command', 'f8', (3,)), ('azimuth', 'f8'), ('azimuth_sigma', 'f8'), ('level_sigma', 'f8'),
], align=True)


def constants(k, p, h) -> np.ndarray:
    """Return the record () of CONSTANTS_DTYPE of AdrcParameters p for steps of h [s]; k: CONDITIONS_DTYPE."""
    record = np.zeros((), CONSTANTS_DTYPE)
    record['w_o'], record['w_c'], record['start'] = p.observer, p.control, p.start
    g, r = float(k['gravity']), float(k['velocity_density']) / h
    # Model of one channel whose command is in the linear zone of fhan. The state is (v, x2, z1, z2, z3). The noises
    # are those of the velocity and the random walk of the gyros. F, B: prediction of the observer; law: command from
    # z.
    F = np.array([[1.0, h, 0.5 * h * h], [0.0, 1.0, h], [0.0, 0.0, 1.0]])
    B = np.array([0.5 * h * h, h, 0.0])
    law = -np.array([p.control**2, 2.0 * levelling.DAMPING_COEFFICIENT * p.control, 1.0])
    gain = np.array(extended_observer.gains(p.observer, h))
    predicted = np.zeros((5, 5))
    predicted[:2, :2], predicted[:2, 2:] = F[:2, :2], np.outer(B[:2], law)
    predicted[2:, 2:] = F + np.outer(B, law)
    innovation = predicted[0] - predicted[2]
    A = predicted.copy()
    A[2:] += np.outer(gain, innovation)
    noise = np.concatenate(([0.0, 0.0], gain))
    Q = np.outer(noise, noise) * r
    Q[1, 1] += (g * float(k['gyro_noise']))**2 * h
    P = steady_state.covariance(A, Q)
    record['velocity_variance'] = P[0, 0]
    record['innovation_variance'] = np.sum(np.outer(innovation, innovation) * P) + r
    # Response of the state to a swell of amplitude 1 at the slowest frequency; the innovation is v - z1 + swell.
    z = cmath.exp(1j * extended_observer.MIN_SWELL_FREQUENCY_RAD_S * h)
    state = solution(z * np.eye(5) - A, noise)
    record['swell'] = abs(state[0] / (state[0] - state[2] + 1.0))**2
    record['level'] = math.sqrt(P[1, 1] + float(k['accelerometer_bias'])**2) / g
    return record


@compiled
def azimuth_sigma(c, k, o, window):
    """Return the 1 sigma [rad] of the azimuth from the slope over a window [s]; o: extended_observer.STATE_DTYPE.

    c, k: records CONSTANTS_DTYPE, CONDITIONS_DTYPE. The random walk of the gyros, gyro_noise, gives the slope the
    variance 1.2 gyro_noise^2 / window, because the weights are a parabola. The noise of the commands is the second
    derivative of the integral of the velocity. So only the ends of the window count, with 2 x 6^2 / (g window^2)^2
    times the velocity variance. Innovations beyond the expected ones count as swell, which the loop enlarges.
    """
    g, w_north = k.gravity, k.earth_rate[1]
    variance = c.velocity_variance + c.swell * extended_observer.swell_variance(o, c.innovation_variance)
    noise = 72.0 * variance / (g * window * window)**2
    return min(math.sqrt(noise + 1.2 * k.gyro_noise**2 / window + k.gyro_bias**2) / w_north, UNKNOWN_AZIMUTH_SIGMA_RAD)


@compiled
def level_sigma(c, k, o, t):
    """Return the 1 sigma [rad] of level t [s] after power-up; other arguments as of `azimuth_sigma`.

    The result is the root sum square of two parts. The first part is the observed tilt or the 1 sigma of the settled
    loop, whichever is larger. Innovations above the expected ones increase that 1 sigma. The second part is the share
    of the initial tilt that the observer, with all poles at w_o, has not observed yet.
    """
    x = c.w_o * t
    unobserved = extended_observer.INITIAL_LEVEL_SIGMA_RAD * (1.0 + x + 0.5 * x * x) * math.exp(-x)
    settled = math.sqrt(max(o.innovation_ratio, 1.0)) * c.level
    return math.hypot(max(settled, extended_observer.tilt(o, k)), unobserved)


@compiled
def step(s, c, k, v_east, v_north, h):
    """Execute one step h [s] after the last; v_east, v_north: velocity error in n' [m/s].

    s, c, k: records STATE_DTYPE, CONSTANTS_DTYPE, CONDITIONS_DTYPE.
    """
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
