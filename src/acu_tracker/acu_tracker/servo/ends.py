"""Ends of the travel of an axis: the largest rate towards an end, and the time until the axis is there.

    v^2 / (2 a) + v t = d

    d   distance to the end [rad]
    v   largest rate from which the axis stops within d [rad/s]
    a   deceleration of the axis in front of the end [rad/s2]
    t   reaction time of the axis [s]; AcuParameters.reaction defines it

The slope dv/dd is at most 1 / t. Therefore a command that is late by t / e (e: Euler's number) causes no overshoot.
"""
import math
from typing import NamedTuple

from pedestal_common.compiled import compiled
from pedestal_common.quantities import Radians, RadiansPerSecond, RadiansPerSecond2, Seconds


class Ends(NamedTuple):
    """Angles between which an axis may be at present: its limits, or the floor."""
    low: Radians
    high: Radians


@compiled
def braking_distance(v: RadiansPerSecond, a: RadiansPerSecond2, t: Seconds) -> Radians:
    """Return the distance in which an axis at a rate v >= 0 stops."""
    return v * v / (2.0 * a) + v * t


@compiled
def stopping_rate(d: Radians, a: RadiansPerSecond2, t: Seconds) -> RadiansPerSecond:
    """Return the largest rate towards an end d ahead from which an axis stops before the end.

    The rate is 0 if the axis is beyond the end (d <= 0).
    """
    if d <= 0.0:
        return 0.0
    return math.sqrt(a * t * (a * t) + 2.0 * a * d) - a * t


@compiled
def inside(u: RadiansPerSecond, y: Radians, ends: Ends, a: RadiansPerSecond2, t: Seconds) -> RadiansPerSecond:
    """Return a rate command u limited so that an axis at y stops between its Ends.

    Beyond an end only motion back inside is left.
    """
    return min(max(u, -stopping_rate(y - ends.low, a, t)), stopping_rate(ends.high - y, a, t))


@compiled
def time_to(y: Radians, dy: RadiansPerSecond, ends: Ends) -> Seconds:
    """Return the time until an axis at y reaches an end if it keeps its rate dy.

    The time is 0 beyond an end, and inf if the axis is at rest.
    """
    if y > ends.high or y < ends.low:
        return 0.0
    if dy > 0.0:
        return (ends.high - y) / dy
    return (ends.low - y) / dy if dy < 0.0 else math.inf
