"""Filters of constant gain, the alpha-beta and the alpha-beta-gamma filter: their gains.

    X += (alpha, beta / T, gamma / (2 T^2)) nu

    X    estimate of angle, rate and acceleration, predicted at constant rate or constant acceleration
    nu   innovation of the angle [rad]
    T    time between measurements [s]

The gain alpha [-] determines beta and gamma [-]. The alpha-beta filter uses the relation of Benedict and Bordner, the
alpha-beta-gamma filter that of Kalata.
"""
import math

from pedestal_common.compiled import compiled
from pedestal_common.quantities import Seconds, Xyz


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
def gain(alpha: float, beta: float, gamma: float, T: Seconds) -> Xyz:
    """Return (k1 [-], k2 [1/s], k3 [1/s2]), the gains on angle, rate and acceleration for measurements T apart."""
    return (alpha, beta / T, gamma / (2.0 * T * T))
