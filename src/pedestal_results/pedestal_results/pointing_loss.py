"""Loss of received power of a recorded run by its pointing error, from the pattern of the beam.

The pattern is the sum pattern of receiver_law.monopulse: the received voltage by the angle from the beam
axis.
"""
import math

import numpy as np

from pedestal_common.compiled import compiled
from pedestal_common.quantities import Decibels, Floats, Pairs, Radians
from pedestal_results.tracking import Tracking
from receiver_law.monopulse import sum_pattern

LEAST_POWER = 1e-12
"""Smallest received power over that on the beam axis [-]. This avoids an infinite loss in a null of the pattern."""


@compiled
def _fill(error: Pairs, beamwidth: Radians, power: Floats) -> None:
    """Fill power: received power over that on the beam axis [-]. error: pointing errors in cross-elevation and
    elevation [rad].
    """
    for k in range(len(error)):
        voltage = sum_pattern(error[k, 0] / beamwidth) * sum_pattern(error[k, 1] / beamwidth)
        power[k] = voltage * voltage


def _power(run: Tracking) -> Floats:
    """Return the received power over that on the beam axis [-], in the evaluated part of a run.

    Return an empty array without a beamwidth.
    """
    if not math.isfinite(run.beamwidth):
        return np.zeros(0)
    error = np.concatenate((run.true, run.begun[run.tracking])) if run.electronic else run.true
    error = np.ascontiguousarray(error[np.isfinite(error).all(axis=1)])
    power = np.empty(len(error))
    _fill(error, run.beamwidth, power)
    return np.maximum(power, LEAST_POWER)


def mean_db(run: Tracking) -> Decibels:
    """Return the loss of the mean received power of a run; NaN without an evaluated part."""
    power = _power(run)
    return -10.0 * math.log10(power.mean()) if power.size else math.nan


def max_db(run: Tracking) -> Decibels:
    """Return the largest loss of received power of a run; NaN without an evaluated part."""
    power = _power(run)
    return -10.0 * math.log10(power.min()) if power.size else math.nan
