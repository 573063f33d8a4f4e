"""How a target may move: Phi and Q of four models of one axis, X = (angle, rate, acceleration).

    cv                      constant rate, disturbed by white acceleration; its third state stays 0
    ca                      constant acceleration, disturbed by white jerk
    singer                  an acceleration of mean 0 that lasts 1 / alpha (Singer 1970)
    current_statistical     the same about a mean that is the estimate itself (paper 000, eq. 2, 4, 5)
Phi = [[1, T, f13], [0, 1, f23], [0, 0, f33]] for all of them.

Corrected against the print of paper 000: q22 has 1/(2 alpha^3); sigma_a^2 goes with the square.
The closed forms of Q lose all digits for small x = alpha T (q11 is a difference of terms ~1 of size x^5), so
below SERIES_BELOW the power series is used:
    q = int_0^T g(s) g(s)' ds,  g = (s^2/2 - alpha s^3/6 + ..., s - alpha s^2/2 + ..., e^(-alpha s)).
"""
import math

import numpy as np

from pedestal_common.compiled import compiled

MODELS = ('cv', 'ca', 'singer', 'current_statistical')
CV, CA, SINGER, CURRENT_STATISTICAL = range(len(MODELS))

MODEL = np.dtype([('kind', 'i8'), ('alpha', 'f8'), ('noise', 'f8'), ('sigma', 'f8'), ('a_max', 'f8'),
                  ('floor', 'f8')], align=True)
"""kind: of MODELS, then what its group of the parameters gives; a model reads only its own.

noise: cv [rad/s2/sqrt(Hz)] of the white acceleration, ca [rad/s3/sqrt(Hz)] of the white jerk: the square root of a
two-sided density, int of E[w(t) w(s)] ds = noise^2.
"""

SERIES_BELOW = 0.5
_TERMS = range(14)


def _coefficients(first, count):
    """c_k of the series sum c_k (-x)^k of one q: n! (n + 1) c_k = count(n), a sum of binomials, n = k + first."""
    return tuple(count(k + first) / (math.factorial(k + first) * (k + first + 1)) for k in _TERMS)


_G1 = tuple(1.0 / math.factorial(k + 2) for k in _TERMS)
_G2 = tuple(1.0 / math.factorial(k + 1) for k in _TERMS)
_Q11 = _coefficients(4, lambda n: 2**n - 2 * n - 2)
_Q12 = _coefficients(3, lambda n: 2**n - n - 2)
_Q13 = _coefficients(2, lambda n: 2**n - n - 1)
_Q22 = _coefficients(2, lambda n: 2**n - 2)
_Q23 = _coefficients(1, lambda n: 2**n - 1)
_Q33 = _coefficients(0, lambda n: 2**n)


@compiled
def _series(c, x):
    total = 0.0
    for k in range(len(c) - 1, -1, -1):
        total = c[k] - x * total
    return total


@compiled
def fading(alpha, T):
    """(f13, f23, f33) of an acceleration that fades with e^(-alpha T) (paper 000, eq. 2)."""
    x = alpha * T
    if x < SERIES_BELOW:
        return T * T * _series(_G1, x), T * _series(_G2, x), math.exp(-x)
    e = math.exp(-x)
    return (x - 1.0 + e) / alpha**2, (1.0 - e) / alpha, e


@compiled
def fading_noise(alpha, T):
    """(q11, q12, q13, q22, q23, q33) of q in Q = 2 alpha sigma_a^2 q (paper 000, eq. 4)."""
    x = alpha * T
    if x < SERIES_BELOW:
        return (T**5 * _series(_Q11, x), T**4 * _series(_Q12, x), T**3 * _series(_Q13, x),
                T**3 * _series(_Q22, x), T**2 * _series(_Q23, x), T * _series(_Q33, x))
    e = math.exp(-x)
    q11 = (1.0 - e * e + 2.0 * x + 2.0 / 3.0 * x**3 - 2.0 * x * x - 4.0 * x * e) / (2.0 * alpha**5)
    q12 = (e * e + 1.0 - 2.0 * e + 2.0 * x * e - 2.0 * x + x * x) / (2.0 * alpha**4)
    q13 = (1.0 - e * e - 2.0 * x * e) / (2.0 * alpha**3)
    q22 = (4.0 * e - 3.0 - e * e + 2.0 * x) / (2.0 * alpha**3)
    q23 = (e * e + 1.0 - 2.0 * e) / (2.0 * alpha**2)
    q33 = (1.0 - e * e) / (2.0 * alpha)
    return q11, q12, q13, q22, q23, q33


@compiled
def acceleration_variance(abar, a_max, floor):
    """sigma_a^2 of the modified Rayleigh density about the mean acceleration abar (paper 000, eq. 5, with the square).

    At abar = a_max it is zero and the filter would lock, hence sigma_a >= floor a_max.
    """
    return max((4.0 - math.pi) / math.pi * max(a_max - abs(abar), 0.0)**2, (floor * a_max)**2)


@compiled
def transition(m, T):
    """(f13, f23, f33) of Phi over T [s]."""
    if m.kind == CV:
        return 0.0, 0.0, 0.0
    if m.kind == CA:
        return 0.5 * T * T, T, 1.0
    return fading(m.alpha, T)


@compiled
def process_noise(m, abar, T):
    """(q11, q12, q13, q22, q23, q33) of Q over T [s] about the mean acceleration abar [rad/s2]."""
    if m.kind == CV:
        k = m.noise * m.noise
        return k * T * T * T / 3.0, k * T * T / 2.0, 0.0, k * T, 0.0, 0.0
    if m.kind == CA:
        k, T2 = m.noise * m.noise, T * T
        return (k * T2 * T2 * T / 20.0, k * T2 * T2 / 8.0, k * T2 * T / 6.0, k * T2 * T / 3.0, k * T2 / 2.0, k * T)
    variance = m.sigma * m.sigma if m.kind == SINGER else acceleration_variance(abar, m.a_max, m.floor)
    k = 2.0 * m.alpha * variance
    q11, q12, q13, q22, q23, q33 = fading_noise(m.alpha, T)
    return k * q11, k * q12, k * q13, k * q22, k * q23, k * q33


@compiled
def predicted(m, x1, x2, x3, T):
    """X after T: Phi X; current_statistical Phi X + U abar = Phi1 X with abar = x3 (paper 000, eq. 6, 11)."""
    if m.kind == CURRENT_STATISTICAL:
        return x1 + T * x2 + 0.5 * T * T * x3, x2 + T * x3, x3
    f13, f23, f33 = transition(m, T)
    return x1 + T * x2 + f13 * x3, x2 + f23 * x3, f33 * x3


@compiled
def initial_variance(m, rate_sigma):
    """Variance of the acceleration [rad2/s4] at the start; ca, without a scale of its own: the rate's per second."""
    if m.kind == CV:
        return 0.0
    if m.kind == CA:
        return rate_sigma * rate_sigma
    return m.sigma * m.sigma if m.kind == SINGER else m.a_max * m.a_max
