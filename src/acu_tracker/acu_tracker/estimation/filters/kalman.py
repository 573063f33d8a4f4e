"""Laws of a filter with three states: angle, rate and acceleration of the target on one axis. Kalman, or constant
gain.

The angle is measured, and the rate if a sensor measures it. Two measurements of one instant are taken one after the
other, which is exact because their errors are independent. The covariance P is kept as its upper triangle, so that P
is always symmetric. Every product of 3 x 3 matrices is written out.

    F, Q    transition over T [s], covariance of the process noise
    H       row that selects the measured state
    nu, S   innovation and its variance; R: variance of the measurement
    K       gain (k1, k2, k3) on angle, rate and acceleration [-, 1/s, 1/s2]
"""
import math
from typing import NamedTuple

from acu_tracker.geometry.vector import AxisMotion
from pedestal_common.compiled import compiled
from pedestal_common.quantities import Radians, Radians2, RadiansPerSecond, Seconds, Xyz


class Symmetric(NamedTuple):
    """Upper triangle of a symmetric 3 x 3 matrix, a covariance of angle, rate and acceleration."""
    p11: float
    p12: float
    p13: float
    p22: float
    p23: float
    p33: float


class Gaussian(NamedTuple):
    """Estimate of one axis."""
    x: AxisMotion   # mean (x1, x2, x3)
    P: Symmetric    # covariance


class Transition(NamedTuple):
    """Third column of the transition F = [[1, T, f13], [0, 1, f23], [0, 0, f33]]."""
    f13: float      # [s2]
    f23: Seconds
    f33: float      # [-]


class PreviousAngle(NamedTuple):
    """Estimate of the angle at the last measurement."""
    x1: Radians     # mean of this angle
    p11: Radians2   # variance of this angle
    c1: Radians2    # covariance of this angle with the present angle
    c2: float       # covariance with the present rate [rad2/s]
    c3: float       # covariance with the present acceleration [rad2/s2]


@compiled
def predicted_mean(x: AxisMotion, F: Transition, T: Seconds) -> AxisMotion:
    """Return F x, the motion T after x."""
    return AxisMotion(x.angle + T * x.rate + F.f13 * x.acceleration, x.rate + F.f23 * x.acceleration,
                      F.f33 * x.acceleration)


@compiled
def predicted_covariance(P: Symmetric, F: Transition, Q: Symmetric, T: Seconds) -> Symmetric:
    """Return F P F' + Q, the covariance T after P (Ma 2023, eq. 7)."""
    a11 = P.p11 + T * P.p12 + F.f13 * P.p13
    a12 = P.p12 + T * P.p22 + F.f13 * P.p23
    a13 = P.p13 + T * P.p23 + F.f13 * P.p33
    a22 = P.p22 + F.f23 * P.p23
    a23 = P.p23 + F.f23 * P.p33
    return Symmetric(a11 + T * a12 + F.f13 * a13 + Q.p11, a12 + F.f23 * a13 + Q.p12, F.f33 * a13 + Q.p13,
                     a22 + F.f23 * a23 + Q.p22, F.f33 * a23 + Q.p23, F.f33 * F.f33 * P.p33 + Q.p33)


@compiled
def past(gaussian: Gaussian, F: Transition, T: Seconds) -> PreviousAngle:
    """Return the PreviousAngle for a prediction over T from the last Gaussian: (c1, c2, c3) = F P H'."""
    P = gaussian.P
    return PreviousAngle(gaussian.x.angle, P.p11, P.p11 + T * P.p12 + F.f13 * P.p13, P.p12 + F.f23 * P.p13,
                         F.f33 * P.p13)


@compiled
def _corrected(x: AxisMotion, k1: float, k2: float, k3: float, nu: float) -> AxisMotion:
    return AxisMotion(x.angle + k1 * nu, x.rate + k2 * nu, x.acceleration + k3 * nu)


@compiled
def update(gaussian: Gaussian, nu: Radians, R: Radians2) -> Gaussian:
    """Return the Gaussian after a measured angle of variance R with the innovation nu. H = [1 0 0], K = P H' / S
    (Ma 2023, eq. 8, 9, 10). The first row of the new P is p1j - k1 p1j. The equal form kj R is used, because it
    loses no digits in a difference."""
    P, per_S = gaussian.P, 1.0 / (gaussian.P.p11 + R)
    k1, k2, k3 = P.p11 * per_S, P.p12 * per_S, P.p13 * per_S
    return Gaussian(_corrected(gaussian.x, k1, k2, k3, nu),
                    Symmetric(k1 * R, k2 * R, k3 * R, P.p22 - k2 * P.p12, P.p23 - k2 * P.p13, P.p33 - k3 * P.p13))


@compiled
def update_correlated(gaussian: Gaussian, previous: PreviousAngle, rho: float, nu: Radians, S: Radians2) -> Gaussian:
    """Return the Gaussian after a measured angle whose noise is correlated with that of the last angle.

    The noise is rho times the noise of the last angle, plus independent noise. The difference y_k - rho y_k-1 of the
    measured angles is therefore H X_k - rho H X_k-1 plus the independent noise (Bryson, Henrikson 1968). nu, S:
    innovation of the difference and its variance. K = (P H' - rho c) / S, P -= K S K'.
    """
    P = gaussian.P
    k1, k2, k3 = (P.p11 - rho * previous.c1) / S, (P.p12 - rho * previous.c2) / S, (P.p13 - rho * previous.c3) / S
    return Gaussian(_corrected(gaussian.x, k1, k2, k3, nu),
                    Symmetric(P.p11 - k1 * k1 * S, P.p12 - k1 * k2 * S, P.p13 - k1 * k3 * S, P.p22 - k2 * k2 * S,
                              P.p23 - k2 * k3 * S, P.p33 - k3 * k3 * S))


@compiled
def update_rate(gaussian: Gaussian, nu: RadiansPerSecond, R: float) -> Gaussian:
    """Return the Gaussian after a measured rate of variance R [rad2/s2]: H = [0 1 0] (Li 2018, eq. 34)."""
    P, S = gaussian.P, gaussian.P.p22 + R
    k1, k2, k3 = P.p12 / S, P.p22 / S, P.p23 / S
    return Gaussian(_corrected(gaussian.x, k1, k2, k3, nu),
                    Symmetric(P.p11 - k1 * P.p12, k1 * R, P.p13 - k1 * P.p23, k2 * R, k3 * R, P.p33 - k3 * P.p23))


@compiled
def update_with_gain(gaussian: Gaussian, nu: Radians, R: Radians2, K: Xyz) -> Gaussian:
    """Return the Gaussian after a measured angle of variance R with the innovation nu, by a given gain K. The new P is
    (1 - K H) P (1 - K H)' + K R K' (form of Joseph), written out."""
    P, S = gaussian.P, gaussian.P.p11 + R
    k1, k2, k3 = K
    return Gaussian(_corrected(gaussian.x, k1, k2, k3, nu),
                    Symmetric(P.p11 - 2.0 * k1 * P.p11 + k1 * k1 * S,
                              P.p12 - k1 * P.p12 - k2 * P.p11 + k1 * k2 * S,
                              P.p13 - k1 * P.p13 - k3 * P.p11 + k1 * k3 * S,
                              P.p22 - 2.0 * k2 * P.p12 + k2 * k2 * S,
                              P.p23 - k2 * P.p13 - k3 * P.p12 + k2 * k3 * S,
                              P.p33 - 2.0 * k3 * P.p13 + k3 * k3 * S))


@compiled
def exponent(nu: float, S: float) -> float:
    """Return the exponent of the normal density exp(exponent) / sqrt(2 pi S) of an innovation nu of variance S."""
    return -0.5 * nu * nu / S


@compiled
def benedict_bordner(alpha: float) -> float:
    """Return beta of the alpha-beta filter with the best compromise between noise and the transient after a ramp
    (Benedict, Bordner 1962)."""
    return alpha * alpha / (2.0 - alpha)


@compiled
def kalata(alpha: float) -> tuple[float, float]:
    """Return (beta, gamma) of the alpha-beta-gamma filter: the steady Kalman filter of a constant acceleration that
    takes an independent step at every measurement (Kalata 1984)."""
    beta = 2.0 * (2.0 - alpha) - 4.0 * math.sqrt(1.0 - alpha)
    return beta, beta * beta / alpha


@compiled
def constant_gain(alpha: float, beta: float, gamma: float, T: Seconds) -> Xyz:
    """Return K of a filter of constant gain for measurements T apart: (alpha, beta / T, gamma / (2 T^2))."""
    return (alpha, beta / T, gamma / (2.0 * T * T))
