"""Whether the receiver's errors are noise: they turn back from one to the next by far more than their model says.

    q = mean over the last ones of max(-(nu_k - nu_k-1) (nu_k-1 - nu_k-2), 0) / R

of both axes together. Of white noise of the variance R the product has the mean R and is positive two times in three.
What goes one way, a target that turns, a slope of the wrong sign, a filter that began while the dish slewed, a beam
that is behind after lost steps, has differences of one sign, and a hop has one alone: both count nothing. Neither does
it mislead a filter, but by what it is, and the gate refuses it; of noise many times its size the gate lets some
through.
"""
import numpy as np

from pedestal_common.compiled import compiled

ROUGHNESS = np.dtype([('nu', 'f8', (2,)), ('d', 'f8', (2,)), ('q', 'f8'), ('noisy', 'i8')], align=True)
"""nu: innovations of the error before, d: their differences from those before [rad], NaN: there were none; q [-];
noisy: 1 from q > gate on until q < SUSPECT."""

ERRORS = 10
"""Number of errors that the mean is taken over."""

LARGEST = 80.0
"""More does not count of one error, so that one outlier, which makes three, is left to the gate."""

SUSPECT = 5.0
"""q from which on an error is not held against the filter. White noise of the variance R reaches 4."""


@compiled
def restart(s):
    """A filter begins: nothing is held against the errors."""
    s.nu[0] = s.nu[1] = s.d[0] = s.d[1] = np.nan
    s.q, s.noisy = 1.0, 0


@compiled
def take(s, innovation, m, gate):
    """Whether the errors are noise, after the Innovation of a Measurement."""
    x = 0.0
    for i in range(2):
        d = innovation.axis[i].nu - s.nu[i]
        if d * s.d[i] < 0.0:
            x -= 0.5 * d * s.d[i] / m.axis[i].variance
        s.nu[i], s.d[i] = innovation.axis[i].nu, d
    s.q += (min(x, LARGEST) - s.q) / ERRORS
    s.noisy = s.q > (SUSPECT if s.noisy else gate)
    return s.noisy != 0
