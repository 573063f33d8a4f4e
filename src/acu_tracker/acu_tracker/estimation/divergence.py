"""Detection of divergence in autotrack: the estimate moves away from the target, and the antenna follows the estimate.

    m = mean over the last errors of (nu_A^2 / S_A + nu_E^2 / S_E) / 2

    nu, S   innovation of an angle [rad] and its variance [rad2] as the filter predicts it
    A, E    azimuth and elevation
    m       is 1 while the innovations are as large as the filter expects [-]

An error signal with the wrong sign, with rotated axes or with a gain three times too high drives the antenna away from
its target. Then m becomes large before the beam leaves the target, and it is still large when the signal is lost. In
this case autotrack must not coast on the wrong estimate.

The detected divergence is latched: it stays until a reset.
"""

from acu_tracker.estimation.filters.measurement import Innovation
from pedestal_common.compiled import compiled
from pedestal_common.quantities import Bit
from pedestal_common.record import Record


class Divergence(Record):
    """State of the detection."""
    m: float        # the mean [-]
    diverged: Bit   # 1 from the detection of a divergence until its reset


DIVERGENCE_ERROR_COUNT = 100
"""Number of errors in the mean m; they take half a second. Without a fault m stays below 1.25."""

MAX_COUNTED_ERROR = 12.5
"""Largest contribution of one error to m [-]: half the default gate.

This avoids an alarm after a few errors with interference.
"""

DIVERGENCE_LIMIT = 7.0
"""Largest m of a filter that still follows its target [-].

A filter without an acceleration state reaches 6.1 on a target that reverses its motion, and keeps it in the beam.
"""

COASTING_DIVERGENCE_LIMIT = 2.0
"""Largest m with which the filter may coast after a loss of the signal without a known cause [-]."""


@compiled
def restart(state: Divergence) -> None:
    """Set m to 1 when a mode begins."""
    state.m = 1.0


@compiled
def take(state: Divergence, innovation: Innovation) -> None:
    """Add the innovation of an error to the mean m; one of NaN (nothing was predicted) is ignored."""
    # The comparison of x with itself is False for NaN.
    x = 0.5 * (innovation.axis[0].chi_square + innovation.axis[1].chi_square)
    if x == x:
        state.m += (min(x, MAX_COUNTED_ERROR) - state.m) / DIVERGENCE_ERROR_COUNT


@compiled
def diverges(state: Divergence, without_signal: Bit) -> bool:
    """Return True if the filter has diverged.

    without_signal: True if the filter coasts, and no known cause explains the loss of the signal.
    """
    return state.m > (COASTING_DIVERGENCE_LIMIT if without_signal else DIVERGENCE_LIMIT)


@compiled
def latch(state: Divergence) -> None:
    """Latch the divergence until `release`."""
    state.diverged = 1


@compiled
def release(state: Divergence) -> None:
    """Reset the latched divergence."""
    state.diverged = 0
