"""Filters with a fixed window of measurements: least squares, and the Wiener filter of finite memory.

The estimate is a weighted sum of the last n measurements. The weights give the best linear unbiased estimate of angle
and rate at the newest measurement. The motion is a polynomial of the time plus a random displacement d:

    y_i = angle - rate tau_i + (1/2) acceleration tau_i^2 + d_i + noise_i,      tau_i = i T, i = 0 ... n - 1

Least squares has no displacement d. In the Wiener filter (Zadeh and Ragazzini, Journal of Applied Physics 21 (1950)
645) d is the displacement by a stationary random acceleration with the standard deviation sigma and the
autocorrelation exp(-alpha |tau|). Its polynomial has the degree 1, without the acceleration.
"""
import functools

import numpy as np
from scipy.linalg import solve, toeplitz
from scipy.signal import fftconvolve

from pedestal_common.quantities import Floats, Radians, RadiansPerSecond2
from pedestal_studies.ensemble import MEASUREMENT_PERIOD_S as T


def polynomial(n: int, degree: int) -> Floats:
    """Return the columns (n, degree + 1) by which angle, rate and acceleration enter the measurements y_i."""
    tau = T * np.arange(n, dtype=float)
    return np.column_stack([np.ones(n), -tau, 0.5 * tau * tau][:degree + 1])


def least_squares(n: int, degree: int) -> Floats:
    """Return the weights (2, n) of angle and rate [1/s], newest first, of a polynomial over n measurements."""
    return np.asarray(np.linalg.pinv(polynomial(n, degree))[:2], float)


def displacement(n: int, alpha: float) -> Floats:
    """Return the covariance (n, n) [s4] of d at the lags i T for sigma = 1."""
    covariance = toeplitz(np.exp(-alpha * T * np.arange(n)))     # of the accelerations in the middles of the intervals
    for _ in range(2):
        rate = T * np.cumsum(covariance, axis=0)
        before = np.vstack((np.zeros(n), rate[:-1]))
        covariance = np.vstack((np.zeros(n), T * np.cumsum(0.5 * (before + rate), axis=0)[:-1])).T
    return covariance


@functools.lru_cache(maxsize=8)
def wiener(n: int, alpha: float, sigma: RadiansPerSecond2, noise: Radians) -> Floats:
    """Return the weights (2, n) of angle and rate [1/s], newest first, of the Wiener filter over n measurements; alpha
    [1/s], sigma: those of the acceleration."""
    B = polynomial(n, degree=1)
    scaled = solve(sigma**2 * displacement(n, alpha) + noise**2 * np.eye(n), B, assume_a='pos')
    return np.linalg.solve(B.T @ scaled, scaled.T)


def estimates(weights: Floats, y: Floats) -> Floats:
    """Return angle and rate (2, runs, m) of filtered measurements y (runs, m), with weights (2, n). The first n - 1
    estimates lack measurements and are NaN."""
    n = weights.shape[1]
    out = np.full((2, *y.shape), np.nan)
    for i, line in enumerate(weights):
        out[i, :, n - 1:] = fftconvolve(y, line[None], mode='valid', axes=1)
    return out
