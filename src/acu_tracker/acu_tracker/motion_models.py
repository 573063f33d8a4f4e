"""The 'current' statistical model of a target's motion: Phi, Q (paper 000, eq. 2, 4, 5).

Corrected against the print: q22 has 1/(2 alpha^3); sigma_a^2 goes with the square.
The closed forms of Q lose all digits for small x = alpha T (q11 is a difference of terms ~1 of size x^5), so
below SERIES_BELOW the power series is used:
    q = int_0^T g(s) g(s)' ds,  g = (s^2/2 - alpha s^3/6 + ..., s - alpha s^2/2 + ..., e^(-alpha s)).
"""
import math

from pedestal_common.compiled import compiled

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
def transition(alpha, T):
    """(f13, f23, f33) of Phi = [[1, T, f13], [0, 1, f23], [0, 0, f33]] (eq. 2)."""
    x = alpha * T
    if x < SERIES_BELOW:
        return T * T * _series(_G1, x), T * _series(_G2, x), math.exp(-x)
    e = math.exp(-x)
    return (x - 1.0 + e) / alpha**2, (1.0 - e) / alpha, e


@compiled
def process_noise(alpha, T):
    """(q11, q12, q13, q22, q23, q33) of q in Q = 2 alpha sigma_a^2 q (eq. 4)."""
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
    """sigma_a^2 of the modified Rayleigh density about the mean acceleration abar (eq. 5, with the square).

    At abar = a_max it is zero and the filter would lock, hence sigma_a >= floor a_max.
    """
    return max((4.0 - math.pi) / math.pi * max(a_max - abs(abar), 0.0)**2, (floor * a_max)**2)
