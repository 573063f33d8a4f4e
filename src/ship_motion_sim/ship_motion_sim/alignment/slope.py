"""Least-squares slope of the integral of a signal, from two running sums. The alignment method adrc uses it.

The slope is the mean of the signal x with the weights of a parabola. The slope of X_j = sum_{k<j} x_k over j = 0 ... n
is sum_k (k + 1)(n - k) x_k / (n (n + 1)(n + 2) / 6). The middle of a window has the largest weight and the ends the
smallest, which suppresses noise that is the derivative of a bounded signal.
"""
from pedestal_common.compiled import compiled


@compiled
def added(first: float, second: float, n: int, x: float) -> tuple[float, float, int]:
    """Return (sum k x, sum k^2 x, number of values) after the value x with the index n, from 0 on; k = n + 1."""
    k = n + 1.0
    return first + k * x, second + k * k * x, n + 1


@compiled
def slope(first: float, second: float, n: int) -> float:
    """Return the slope per step after n values; NaN for n = 0. first, second: sums of `added`."""
    return ((n + 1.0) * first - second) / (n * (n + 1.0) * (n + 2.0) / 6.0)
