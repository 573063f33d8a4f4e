"""Divergence of the filter that the antenna follows, detected in its innovations.

    m = mean over the last errors of (nu_A^2 / S_A + nu_E^2 / S_E) / 2

nu: innovation; S: its variance; A, E: azimuth and elevation. m is 1 while the errors are as large as the filter
expects. An error signal with the wrong sign, with rotated axes or with a gain three times too high drives the antenna
away from its target. Then m is large before the beam leaves the target, and still large when the signal is lost. This
avoids coasting on a wrong estimate.
"""
import numpy as np

from pedestal_common.compiled import compiled

DIVERGENCE_DTYPE = np.dtype([('m', 'f8'), ('diverged', 'i8')], align=True)
"""m: the mean [-]; diverged: 1 from the detection of a divergence until its reset."""

DIVERGENCE_ERROR_COUNT = 100
"""Number of errors in the mean m. Of a filter without a fault, the largest m is 1.25 in its worst half second."""

MAX_COUNTED_ERROR = 12.5
"""Largest contribution of one error to m [-]: half the default gate.
This avoids an alarm after a few errors with interference."""

DIVERGENCE_LIMIT = 7.0
"""Largest m of a filter in touch with its target [-]. A filter without an acceleration state reaches 6.1 on a target
that reverses, and keeps the target in the beam."""

COASTING_DIVERGENCE_LIMIT = 2.0
"""Largest m with which the filter may coast [-]."""


@compiled
def restart(s):
    """Set m to 1 when autotrack begins."""
    s.m = 1.0


@compiled
def take(s, innovation):
    """Add the Innovation of an error to the mean; NaN (no prediction) is ignored."""
    # The comparison of x with itself is False for NaN.
    x = 0.5 * (innovation.axis[0].chi_square + innovation.axis[1].chi_square)
    if x == x:
        s.m += (min(x, MAX_COUNTED_ERROR) - s.m) / DIVERGENCE_ERROR_COUNT


@compiled
def diverges(s, without_signal):
    """Return True if the filter has diverged. without_signal:
    the filter coasts, and no known cause explains the loss."""
    return s.m > (COASTING_DIVERGENCE_LIMIT if without_signal else DIVERGENCE_LIMIT)


@compiled
def latch(s):
    """Latch the divergence until `release`."""
    s.diverged = 1


@compiled
def release(s):
    """Reset the latched divergence."""
    s.diverged = 0
