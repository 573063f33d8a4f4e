"""Han's time-optimal function, the core of a tracking differentiator and of Zhou 2011's control law."""
import math

from pedestal_common.compiled import compiled
from pedestal_common.quantities import Seconds


@compiled
def fhan(x1: float, x2: float, r: float, h0: Seconds) -> float:
    """Return the acceleration u, between -r and r, that brings x1'' = u to rest at x1 = 0 in the shortest time.

    x1: error, in any unit; x2: its rate; h0: time that sets the size of a zone in which u is linear in x1 and x2, and
    which u = r crosses within h0. This avoids chattering. The formula, with the names d, a0, y and a, is that of Han
    (2009).
    """
    d = r * h0 * h0
    a0 = h0 * x2
    y = x1 + a0
    a = a0 + y if abs(y) <= d else a0 + math.copysign(0.5 * (math.sqrt(d * (d + 8.0 * abs(y))) - d), y)
    return -r * a / d if abs(a) <= d else -math.copysign(r, a)
