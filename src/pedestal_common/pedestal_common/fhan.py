"""Han's time-optimal function, the core of a tracking differentiator and of paper 001's control law."""
import math

from pedestal_common.compiled import compiled


@compiled
def fhan(x1, x2, r, h0):
    """Return the time-optimal acceleration u within +-r that brings x1'' = u to rest at x1 = 0 (Han 2009).

    x1: error; x2: its rate; h0: time [s]. Close to rest, within what u = r reaches in h0, the law is linear, which
    avoids chattering. d, a0, y, a are the names of Han's formula.
    """
    d = r * h0 * h0
    a0 = h0 * x2
    y = x1 + a0
    a = a0 + y if abs(y) <= d else a0 + math.copysign(0.5 * (math.sqrt(d * (d + 8.0 * abs(y))) - d), y)
    return -r * a / d if abs(a) <= d else -math.copysign(r, a)
