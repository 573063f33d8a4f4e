"""Detection of receiver errors that are only noise: they change far more from one to the next than the model expects.

    q = mean over the last errors of (nu_k - nu_k-1)^2 / 2R

    nu_k   innovation of error k [rad]
    R      variance of an error by the model of the receiver [rad2]
    q      mean of both axes [-]; 1 for white noise of the variance R

Slow changes cancel in the difference: a target that turns, a slope of the wrong sign, a bias. `tracker` ignores all
errors while q is above the gate. Some noisy errors would pass the gate alone, and would mislead the filter.

Source: von Neumann, Distribution of the ratio of the mean square successive difference to the variance, Annals of
Mathematical Statistics 12 (1941) 367.
"""
import numpy as np

from acu_tracker.estimation.filters.measurement import Innovation, Measurement
from pedestal_common.compiled import compiled
from pedestal_common.quantities import Pair
from pedestal_common.record import Record


class Roughness(Record):
    """State of the detection."""
    nu: Pair    # innovations of the previous error [rad]; NaN without one
    q: float    # the mean [-]


ROUGHNESS_ERROR_COUNT = 10  # number of errors in the mean q

MAX_COUNTED_DIFFERENCE = 100.0
"""Largest contribution of one difference to q [-].

One outlier makes two large differences. The limit keeps q below the default gate of 25 after one outlier, so that the
gate alone decides on it.
"""


@compiled
def restart(state: Roughness) -> None:
    """Set q to 1 when the filter starts."""
    state.nu[0] = state.nu[1] = np.nan
    state.q = 1.0


@compiled
def take(state: Roughness, innovation: Innovation, measurement: Measurement) -> float:
    """Add an innovation to the mean and return q; the measurement of the innovation holds R."""
    x = 0.0
    for i in range(2):
        nu = innovation.axis[i].nu
        d = nu - state.nu[i]
        x += 0.25 * d * d / measurement.axis[i].variance      # d^2 / 2R, half for each axis
        state.nu[i] = nu
    if x == x:  # not NaN
        state.q += (min(x, MAX_COUNTED_DIFFERENCE) - state.q) / ROUGHNESS_ERROR_COUNT
    return state.q
