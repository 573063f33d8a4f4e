"""Ends of an axis's travel: the largest rate towards an end, and the time until the axis is there.

    v(d): v^2 / (2 a) + v t = d     rate [rad/s] from which an axis stops within d [rad]; a: its braking [rad/s2],
                                    t: its reaction time [s]

Because dv/dd <= 1 / t, a command that is late by t / e leads to no overshoot.
"""
import math
from collections import namedtuple

from pedestal_common.compiled import compiled

Ends = namedtuple('Ends', 'low high')
"""Least and largest angle of an axis [rad] at present."""


@compiled
def braking_distance(v, a, t):
    """Return the distance [rad] in which an axis at a rate v stops."""
    return v * v / (2.0 * a) + v * t


@compiled
def stopping_rate(d, a, t):
    """Return the largest rate [rad/s] towards a limit d [rad] ahead from which an axis stops
    before it; 0 behind it."""
    if d <= 0.0:
        return 0.0
    return math.sqrt(a * t * (a * t) + 2.0 * a * d) - a * t


@compiled
def inside(u, y, ends, a, t):
    """Return a rate command u [rad/s] limited so that an axis at y [rad] stops between its Ends;
    outside it only leads back."""
    return min(max(u, -stopping_rate(y - ends.low, a, t)), stopping_rate(ends.high - y, a, t))


@compiled
def time_to(y, dy, ends):
    """Return the time [s] until an axis at y [rad] is at a limit if it keeps its rate dy [rad/s];
    0 behind it, inf: never."""
    if y > ends.high or y < ends.low:
        return 0.0
    if dy > 0.0:
        return (ends.high - y) / dy
    return (ends.low - y) / dy if dy < 0.0 else math.inf
