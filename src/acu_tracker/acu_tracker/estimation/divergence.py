"""Whether a filter that the antenna follows has lost touch with its target, seen in its innovations.

    m = mean over the last errors of (nu_A^2 / S_A + nu_E^2 / S_E) / 2

is 1 as long as the filter knows its errors, whatever they are. An error of the wrong sign, turned in its axes or three
times too large drives the antenna away from its target instead: m is large before the beam has left it, and still is
when the signal goes, so that nothing is left to coast on.
"""
import numpy as np

from pedestal_common.compiled import compiled

DIVERGENCE_DTYPE = np.dtype([('m', 'f8'), ('diverged', 'i8')], align=True)
"""m: the mean [-]; diverged: 1 since it was too large, until it is reset."""

DIVERGENCE_ERROR_COUNT = 100
"""Number of errors that the mean is taken over. Honest filters reach 1.25 in their worst half second."""

MAX_COUNTED_ERROR = 12.5
"""More does not count of one error, half the default gate: an interference of some errors is none of the filter."""

DIVERGENCE_LIMIT = 7.0
"""Largest m. A filter that knows no acceleration, on a target that reverses, reaches 6.1 and keeps it in the beam."""

COASTING_DIVERGENCE_LIMIT = 2.0
"""Largest m with which the filter may coast."""


@compiled
def restart(s):
    """Autotrack begins: nothing is held against the filter."""
    s.m = 1.0


@compiled
def take(s, innovation):
    """Take the Innovation of an error; NaN where there was no prediction."""
    x = 0.5 * (innovation.axis[0].chi_square + innovation.axis[1].chi_square)
    if x == x:
        s.m += (min(x, MAX_COUNTED_ERROR) - s.m) / DIVERGENCE_ERROR_COUNT


@compiled
def diverges(s, without_signal):
    """Return whether the filter has diverged by now. without_signal: it coasts, and nothing explains why."""
    return s.m > (COASTING_DIVERGENCE_LIMIT if without_signal else DIVERGENCE_LIMIT)


@compiled
def latch(s):
    """Hold against the filter, until `release`, that it has diverged."""
    s.diverged = 1


@compiled
def release(s):
    """Reset what was held against the filter."""
    s.diverged = 0
