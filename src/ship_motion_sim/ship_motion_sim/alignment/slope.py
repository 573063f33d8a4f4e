"""Least-squares slope of the integral of a signal: its mean with the weights of a parabola, from two running sums.

The slope of X_j = sum_{k<j} x_k over j = 0 ... n is sum_k (k + 1)(n - k) x_k / (n (n + 1)(n + 2) / 6): the middle of a
window counts most, its ends least, so noise that is the derivative of something bounded falls out.
"""
from pedestal_common.compiled import compiled


@compiled
def added(first, second, n, x):
    """(sum k x, sum k^2 x, n) with the n-th value x, counted from n = 0; k = n + 1."""
    k = n + 1.0
    return first + k * x, second + k * k * x, n + 1


@compiled
def slope(first, second, n):
    """The slope per step; NaN before there is a value."""
    return ((n + 1.0) * first - second) / (n * (n + 1.0) * (n + 2.0) / 6.0)
