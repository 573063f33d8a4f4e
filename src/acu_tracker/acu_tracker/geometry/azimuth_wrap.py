"""The azimuth wrap: choice among angles that differ by whole revolutions, for an axis with more than one of travel."""
import math
from collections import namedtuple

from pedestal_common.compiled import compiled
from pedestal_common.geometry.line_of_sight import wrap

Travel = namedtuple('Travel', 'below above')
"""Future travel of a target's azimuth below (<= 0) and above (>= 0) its present value [rad]."""


@compiled
def nearest(azimuth, near, low, high, travel):
    """Return the wrap of an azimuth [rad], nearest to `near`, from which a Travel stays inside low..high [rad].

    If no wrap holds the whole travel, return one that holds the azimuth itself; otherwise the nearest.
    """
    # Penalties, far above every distance, that rank the wraps: a wrap outside the limits, and a wrap whose travel
    # leaves the limits.
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
