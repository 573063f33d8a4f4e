"""Laws of a Kalman filter with three states: angle, rate and acceleration of the target on one axis.

The angle is measured, and the rate if a sensor measures it. Two measurements of one instant are taken one after the
other, which is exact because their errors are independent.

The covariance P is kept as its upper triangle, so that P is always symmetric. Every product of 3 x 3 matrices is
written out.

    x, P    estimate and its covariance
    F, Q    transition over T [s], covariance of the process noise
    H       row that selects the measured state
    nu, S   innovation and its variance
    R       variance of the measurement
    K       gain (k1, k2, k3) on angle, rate and acceleration
"""
import math
from collections import namedtuple

from acu_tracker.geometry.motion import AxisMotion
from pedestal_common.compiled import compiled

Symmetric = namedtuple('Symmetric', 'p11 p12 p13 p22 p23 p33')
"""Upper triangle of a symmetric 3 x 3 matrix, a covariance of angle, rate and acceleration."""

Gaussian = namedtuple('Gaussian', 'x P')
"""Estimate of one axis: its mean x = (x1, x2, x3) [rad, rad/s, rad/s2] and covariance P."""

Transition = namedtuple('Transition', 'f13 f23 f33')
"""Third column of the transition F = [[1, T, f13], [0, 1, f23], [0, 0, f33]], [s2, s, -]."""

PreviousAngle = namedtuple('PreviousAngle', 'x1 p11 c1 c2 c3')
"""Estimate of the angle at the last measurement.

x1, p11     mean [rad] and variance [rad2] of this angle
c1, c2, c3  covariances of this angle with the present angle, rate and acceleration
"""


@compiled
def predicted_mean(x, F, T):
    """Return F x, the AxisMotion T [s] after x; F: a Transition over T."""
    return AxisMotion(x.angle + T * x.rate + F.f13 * x.acceleration, x.rate + F.f23 * x.acceleration,
                      F.f33 * x.acceleration)


@compiled
def predicted_covariance(P, F, Q, T):
    """Return F P F' + Q, the Symmetric covariance T [s] after P (paper 000, eq. 7)."""
    a11 = P.p11 + T * P.p12 + F.f13 * P.p13
    a12 = P.p12 + T * P.p22 + F.f13 * P.p23
    a13 = P.p13 + T * P.p23 + F.f13 * P.p33
    a22 = P.p22 + F.f23 * P.p23
    a23 = P.p23 + F.f23 * P.p33
    return Symmetric(a11 + T * a12 + F.f13 * a13 + Q.p11, a12 + F.f23 * a13 + Q.p12, F.f33 * a13 + Q.p13,
                     a22 + F.f23 * a23 + Q.p22, F.f33 * a23 + Q.p23, F.f33 * F.f33 * P.p33 + Q.p33)


@compiled
def past(g, F, T):
    """Return the PreviousAngle for a prediction over T [s]: (c1, c2, c3) = F P H'.

    g: Gaussian at the last measurement; F: Transition over T.
    """
    P = g.P
    return PreviousAngle(g.x.angle, P.p11, P.p11 + T * P.p12 + F.f13 * P.p13, P.p12 + F.f23 * P.p13, F.f33 * P.p13)


@compiled
def _corrected(x, k1, k2, k3, nu):
    """Return x + K nu."""
    return AxisMotion(x.angle + k1 * nu, x.rate + k2 * nu, x.acceleration + k3 * nu)


@compiled
def update(g, nu, R):
    """Return the Gaussian after a measured angle of variance R [rad2] with the innovation nu [rad].

    H = [1 0 0], K = P H' / S (paper 000, eq. 8, 9, 10). The first row of the new P is p1j - k1 p1j. The equal form kj
    R is used, because it loses no digits in a difference.
    """
    P, S = g.P, g.P.p11 + R
    k1, k2, k3 = P.p11 / S, P.p12 / S, P.p13 / S
    return Gaussian(_corrected(g.x, k1, k2, k3, nu),
                    Symmetric(k1 * R, k2 * R, k3 * R, P.p22 - k2 * P.p12, P.p23 - k2 * P.p13, P.p33 - k3 * P.p13))


@compiled
def update_correlated(g, o, rho, nu, S):
    """Return the Gaussian after a measured angle whose noise is correlated with that of the last angle.

    The noise is rho times the noise of the last angle, plus independent noise. The difference y_k - rho y_k-1 of the
    measured angles is therefore H X_k - rho H X_k-1 plus the independent noise (Bryson, Henrikson 1968).

    o      PreviousAngle; c is its (c1, c2, c3)
    nu, S  innovation of the difference [rad] and its variance [rad2]

    K = (P H' - rho c) / S, P -= K S K'.
    """
    P = g.P
    k1, k2, k3 = (P.p11 - rho * o.c1) / S, (P.p12 - rho * o.c2) / S, (P.p13 - rho * o.c3) / S
    return Gaussian(_corrected(g.x, k1, k2, k3, nu),
                    Symmetric(P.p11 - k1 * k1 * S, P.p12 - k1 * k2 * S, P.p13 - k1 * k3 * S, P.p22 - k2 * k2 * S,
                              P.p23 - k2 * k3 * S, P.p33 - k3 * k3 * S))


@compiled
def update_rate(g, nu, R):
    """Return the Gaussian after a measured rate of variance R [rad2/s2] with the innovation nu [rad/s].

    H = [0 1 0] (paper 004, eq. 34).
    """
    P, S = g.P, g.P.p22 + R
    k1, k2, k3 = P.p12 / S, P.p22 / S, P.p23 / S
    return Gaussian(_corrected(g.x, k1, k2, k3, nu),
                    Symmetric(P.p11 - k1 * P.p12, k1 * R, P.p13 - k1 * P.p23, k2 * R, k3 * R, P.p33 - k3 * P.p23))


@compiled
def update_with_gain(g, nu, R, K):
    """Return the Gaussian after a measured angle of variance R [rad2] with the innovation nu [rad], by a given gain K.

    K = (k1, k2, k3) [-, 1/s, 1/s2]. The new P is (1 - K H) P (1 - K H)' + K R K' (form of Joseph), written out.
    """
    P, S = g.P, g.P.p11 + R
    k1, k2, k3 = K
    return Gaussian(_corrected(g.x, k1, k2, k3, nu),
                    Symmetric(P.p11 - 2.0 * k1 * P.p11 + k1 * k1 * S,
                              P.p12 - k1 * P.p12 - k2 * P.p11 + k1 * k2 * S,
                              P.p13 - k1 * P.p13 - k3 * P.p11 + k1 * k3 * S,
                              P.p22 - 2.0 * k2 * P.p12 + k2 * k2 * S,
                              P.p23 - k2 * P.p13 - k3 * P.p12 + k2 * k3 * S,
                              P.p33 - 2.0 * k3 * P.p13 + k3 * k3 * S))


@compiled
def log_likelihood(nu, S):
    """Return the logarithm of the normal density of an innovation nu of variance S, without the constant term."""
    return -0.5 * (nu * nu / S + math.log(S))
