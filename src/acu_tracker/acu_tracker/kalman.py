"""Kalman filter of three states (angle, rate, acceleration) with one angle measured: H = [1 0 0].

The covariance is kept as its upper triangle (p11, p12, p13, p22, p23, p33), symmetric by construction.
"""
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
def innovation(x1, p11, y, R):
    """(nu, nu^2 / S): the innovation and its square in units of its variance."""
    nu = y - x1
    return nu, nu * nu / (p11 + R)


@compiled
def update(x1, x2, x3, p11, p12, p13, p22, p23, p33, nu, R):
    """X, P after the innovation nu (eq. 8, 9, 10); K = P H' / S, P H' R / S is p1j - K1 p1j without the difference."""
    S = p11 + R
    k1, k2, k3 = p11 / S, p12 / S, p13 / S
    return (x1 + k1 * nu, x2 + k2 * nu, x3 + k3 * nu,
            k1 * R, k2 * R, k3 * R, p22 - k2 * p12, p23 - k2 * p13, p33 - k3 * p13)
