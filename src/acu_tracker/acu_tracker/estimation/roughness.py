"""Detection of errors that are only noise: their change from one to the next is far larger than the receiver model's.

    q = mean over the last errors of (nu_k - nu_k-1)^2 / 2R

nu_k: innovation of error k [rad]; R: variance of an error by the receiver model. q is the mean of both axes, and 1 for
white noise of the variance R. Slow changes cancel in the difference: a target that turns, a slope of the wrong sign, a
bias. Because the filter ignores noisy errors, the part of such noise that passes the gate does not mislead it. Source:
von Neumann, Distribution of the ratio of the mean square successive difference to the variance, Annals of Mathematical
Statistics 12 (1941) 367.
"""
import numpy as np

from pedestal_common.compiled import compiled

ROUGHNESS_DTYPE = np.dtype([('nu', 'f8', (2,)), ('q', 'f8')], align=True)
"""nu: innovations of the previous error [rad], NaN for none; q: the mean [-]."""

ROUGHNESS_ERROR_COUNT = 10
"""Number of errors in the mean q."""

MAX_COUNTED_DIFFERENCE = 100.0
"""Largest contribution of one difference to q [-]. One outlier makes two large differences. This limit
keeps q below the default gate of 25, so that the gate alone decides on the outlier."""


@compiled
def restart(s):
    """Set q to 1 when a filter begins."""
    s.nu[0] = s.nu[1] = np.nan
    s.q = 1.0


@compiled
def take(s, innovation, m):
    """Add the Innovation of a Measurement to the mean; return q."""
    x = 0.0
    for i in range(2):
        nu = innovation.axis[i].nu
        d = nu - s.nu[i]
        x += 0.25 * d * d / m.axis[i].variance      # d^2 / 2R, half for each axis
        s.nu[i] = nu
    if x == x:  # not NaN
        s.q += (min(x, MAX_COUNTED_DIFFERENCE) - s.q) / ROUGHNESS_ERROR_COUNT
    return s.q
