"""On-line command shaper: a reference that the axis can follow, within rate, acceleration and jerk.

Han's fhan, the time-optimal acceleration of a double integrator in discrete time (Han 2009), acts on shaped minus raw;
the raw rate and acceleration are fed forward. Therefore a raw reference within the limits is followed without lag, and
a jump is made in minimum time without overshoot.
"""
import math

from acu_tracker.geometry.motion import AxisMotion
from pedestal_common.compiled import compiled
from pedestal_common.fhan import fhan

SUB_STEP_COUNT = 4
"""Number of steps of the shaper in a step of the drive."""


@compiled
def toward_rate_limit(gap, h, jerk):
    """Return the largest acceleration [rad/s2] that jerk [rad/s3] can reduce to 0 before the rate has grown by gap
    [rad/s], in steps of h [s].

    a^2/(2 j) + a h/2 = gap; the last part of a step costs up to j h^2/8 more.
    """
    room = gap - 0.125 * jerk * h * h
    if room <= 0.0:
        return min(gap / h, 0.0)
    half = 0.5 * jerk * h
    return math.sqrt(half * half + 2.0 * jerk * room) - half


@compiled
def held_inside(raw, low, high, braking, lag):
    """Return (AxisMotion, whether it was changed): a raw target that could not stop before a limit low, high [rad] is
    set onto the limit; braking [rad/s2], lag: time until braking begins [s]."""
    stop = raw.angle + raw.rate * (abs(raw.rate) / (2.0 * braking) + lag)
    if raw.angle > high or (raw.rate > 0.0 and stop > high):
        return AxisMotion(high, 0.0, 0.0), True
    if raw.angle < low or (raw.rate < 0.0 and stop < low):
        return AxisMotion(low, 0.0, 0.0), True
    return raw, False


@compiled
def shape(before, raw, dt, limits):
    """Return (AxisMotion, rate limited, acceleration limited) of the shaped reference dt [s] after `before`.

    raw: the AxisMotion to be followed, at the end of dt; limits: record of ShaperParameters.
    """
    p, v, a = before
    h = dt / SUB_STEP_COUNT
    # The acceleration of the target itself is not available for closing the gap; at least a fifth always closes it.
    # p, v, a: shaped angle, rate, acceleration; e, de: shaped minus raw; back: time from a sub-step to the end of dt.
    r = max(limits.acceleration - abs(raw.acceleration), 0.2 * limits.acceleration)
    rate_limited = acceleration_limited = False
    for i in range(SUB_STEP_COUNT):
        back = (SUB_STEP_COUNT - i) * h
        e = p - (raw.angle - raw.rate * back + 0.5 * raw.acceleration * back * back)
        de = v - (raw.rate - raw.acceleration * back)
        wanted = raw.acceleration + fhan(e, de, r, limits.h0)
        u = min(max(wanted, -limits.acceleration), limits.acceleration)
        acceleration_limited |= u != wanted
        up = toward_rate_limit(limits.rate - v, h, limits.jerk)
        down = -toward_rate_limit(limits.rate + v, h, limits.jerk)
        rate_limited |= u > up or u < down
        u = min(max(u, down), up)
        a = min(max(u, a - limits.jerk * h), a + limits.jerk * h)
        p += v * h + 0.5 * a * h * h
        v += a * h
    return AxisMotion(p, v, a), rate_limited, acceleration_limited
