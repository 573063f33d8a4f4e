"""Filters of constant gain: X += (alpha, beta / T, gamma / (2 T^2)) nu, predicted at constant rate or acceleration.

    X    estimate of angle, rate and acceleration; its gains in parentheses are k1, k2, k3 of `gain`
    nu   innovation of the angle [rad]
    T    time between measurements [s]

The gain alpha determines beta and gamma, by the relation of Benedict and Bordner or by that of Kalata.
"""
import math

from pedestal_common.compiled import compiled


@compiled
def benedict_bordner(alpha):
    """Return beta of the alpha-beta filter with the best compromise of noise and ramp transient
    (Benedict, Bordner 1962)."""
    return alpha * alpha / (2.0 - alpha)


@compiled
def kalata(alpha):
    """Return (beta, gamma) of the alpha-beta-gamma filter: the steady Kalman filter of a constant acceleration that
    takes an independent step at every measurement (Kalata 1984)."""
    beta = 2.0 * (2.0 - alpha) - 4.0 * math.sqrt(1.0 - alpha)
    return beta, beta * beta / alpha


@compiled
def gain(alpha, beta, gamma, T):
    """Return (k1 [-], k2 [1/s], k3 [1/s2]) over T [s]."""
    return (alpha, beta / T, gamma / (2.0 * T * T))
