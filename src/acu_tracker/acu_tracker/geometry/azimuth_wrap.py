"""Which of the azimuths that are whole turns apart the axis takes: its travel is more than one turn."""
import math
from collections import namedtuple

from pedestal_common.compiled import compiled
from pedestal_common.line_of_sight import wrap

Travel = namedtuple('Travel', 'below above')
"""How far the azimuth of a target still goes below (<= 0) and above (>= 0) where it is now [rad]."""


@compiled
def nearest(azimuth, near, low, high, travel):
    """The wrap of an azimuth [rad] from which a Travel stays inside low..high, nearest to `near`.

    Where none holds the whole travel, one that holds the azimuth itself; otherwise simply the nearest.
    """
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
