"""Choice of the azimuth wrap: of the azimuths that point in the same direction, the one to which the axis goes.

The choice matters for an axis with more than one revolution of travel.
"""
import math
from typing import NamedTuple

from pedestal_common.compiled import compiled
from pedestal_common.geometry.line_of_sight import wrap
from pedestal_common.quantities import Radians


class Travel(NamedTuple):
    """Future travel of a target's azimuth from its present value."""
    below: Radians      # at most 0
    above: Radians      # at least 0


@compiled
def nearest(azimuth: Radians, near: Radians, low: Radians, high: Radians, travel: Travel) -> Radians:
    """Return the wrap of an azimuth that suits the limits low to high best.

    The first choice is the wrap nearest to `near` from which the Travel stays inside the limits. The second choice is
    the nearest wrap that is inside the limits itself. The last choice is the nearest wrap.
    """
    # Two penalties, far above every distance, rank the wraps: 2e6 for a wrap outside the limits, 1e6 for a wrap whose
    # travel leaves the limits.
    closest = near + wrap(azimuth - near)
    best, score = closest, math.inf
    for i in range(-2, 3):
        candidate = closest + 2.0 * math.pi * i
        away = abs(candidate - near)
        if candidate < low or candidate > high:
            away += 2e6
        elif candidate + travel.below < low or candidate + travel.above > high:
            away += 1e6
        if away < score:
            best, score = candidate, away
    return best
