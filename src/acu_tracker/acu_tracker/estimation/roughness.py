"""Whether the receiver's errors are noise: far rougher from one to the next than its model says they are.

    q = mean over the last ones of (nu_k - nu_k-1)^2 / 2R

of both axes together is 1 for white noise of the variance R (von Neumann, Distribution of the ratio of the mean
square successive difference to the variance, Annals of Mathematical Statistics 12 (1941) 367). What changes slowly, a
target that turns, a slope of the wrong sign, a bias, cancels in the difference; what the gate lets through of noise
many times its size does not mislead a filter that leaves it alone.
"""
import numpy as np

from pedestal_common.compiled import compiled

ROUGHNESS_DTYPE = np.dtype([('nu', 'f8', (2,)), ('q', 'f8')], align=True)
"""nu: innovations of the error before [rad], NaN: there was none; q [-]."""

ROUGHNESS_ERROR_COUNT = 10
"""Number of errors that the mean is taken over."""

MAX_COUNTED_DIFFERENCE = 100.0
"""More does not count of one difference, so that one outlier, which makes two, is left to the gate."""


@compiled
def restart(s):
    """A filter begins: nothing is held against the errors."""
    s.nu[0] = s.nu[1] = np.nan
    s.q = 1.0


@compiled
def take(s, innovation, m):
    """q after the Innovation of a Measurement."""
    x = 0.0
    for i in range(2):
        nu = innovation.axis[i].nu
        d = nu - s.nu[i]
        x += 0.25 * d * d / m.axis[i].variance
        s.nu[i] = nu
    if x == x:
        s.q += (min(x, MAX_COUNTED_DIFFERENCE) - s.q) / ROUGHNESS_ERROR_COUNT
    return s.q
