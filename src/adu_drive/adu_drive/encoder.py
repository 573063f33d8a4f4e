"""Absolute encoders: counts of a full turn, continued over the turns."""
import math

from pedestal_common.compiled import compiled


@compiled
def counts(angle, per_rad):
    """Whole counts (as a float) of an angle [rad], nearest count; per_rad = 2^bits / (2 pi)."""
    return math.floor(angle * per_rad + 0.5)
