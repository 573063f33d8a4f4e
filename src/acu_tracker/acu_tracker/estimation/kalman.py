"""Kalman filter of three states (angle, rate, acceleration): the angle is measured, the rate where a sensor gives it.

The covariance is kept as its upper triangle (p11, p12, p13, p22, p23, p33), symmetric by construction. Two
measurements of one instant are taken one after the other, which is exact as their errors are independent.
"""
import math

from pedestal_common.compiled import compiled


@compiled
def predict_covariance(p11, p12, p13, p22, p23, p33, T, f13, f23, f33, q11, q12, q13, q22, q23, q33):
    """P = F P F' + Q with F = [[1, T, f13], [0, 1, f23], [0, 0, f33]] (paper 000, eq. 7)."""
    a11 = p11 + T * p12 + f13 * p13
    a12 = p12 + T * p22 + f13 * p23
    a13 = p13 + T * p23 + f13 * p33
    a22 = p22 + f23 * p23
    a23 = p23 + f23 * p33
    return (a11 + T * a12 + f13 * a13 + q11, a12 + f23 * a13 + q12, f33 * a13 + q13,
            a22 + f23 * a23 + q22, f33 * a23 + q23, f33 * f33 * p33 + q33)


@compiled
def update(x1, x2, x3, p11, p12, p13, p22, p23, p33, nu, R):
    """X, P after an innovation nu of the angle, H = [1 0 0] (paper 000, eq. 8, 9, 10).

    K = P H' / S; the measured row of P is P H' R / S, which is p1j - K1 p1j without the difference.
    """
    S = p11 + R
    k1, k2, k3 = p11 / S, p12 / S, p13 / S
    return (x1 + k1 * nu, x2 + k2 * nu, x3 + k3 * nu,
            k1 * R, k2 * R, k3 * R, p22 - k2 * p12, p23 - k2 * p13, p33 - k3 * p13)


@compiled
def update_rate(x1, x2, x3, p11, p12, p13, p22, p23, p33, nu, R):
    """The same for an innovation of the rate, H = [0 1 0] (paper 004, eq. 34)."""
    S = p22 + R
    k1, k2, k3 = p12 / S, p22 / S, p23 / S
    return (x1 + k1 * nu, x2 + k2 * nu, x3 + k3 * nu,
            p11 - k1 * p12, k1 * R, p13 - k1 * p23, k2 * R, k3 * R, p33 - k3 * p23)


@compiled
def update_with_gain(x1, x2, x3, p11, p12, p13, p22, p23, p33, nu, R, k1, k2, k3):
    """The same for the angle with any gain K: P = (1 - K H) P (1 - K H)' + K R K' (Joseph), multiplied out."""
    S = p11 + R
    return (x1 + k1 * nu, x2 + k2 * nu, x3 + k3 * nu,
            p11 - 2.0 * k1 * p11 + k1 * k1 * S,
            p12 - k1 * p12 - k2 * p11 + k1 * k2 * S,
            p13 - k1 * p13 - k3 * p11 + k1 * k3 * S,
            p22 - 2.0 * k2 * p12 + k2 * k2 * S,
            p23 - k2 * p13 - k3 * p12 + k2 * k3 * S,
            p33 - 2.0 * k3 * p13 + k3 * k3 * S)


@compiled
def log_likelihood(nu, S):
    """Logarithm of the normal density of an innovation nu of variance S, less the constant -log(2 pi) / 2."""
    return -0.5 * (nu * nu / S + math.log(S))
