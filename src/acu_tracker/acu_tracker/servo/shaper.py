"""On-line command shaper: a reference the axis can follow, within rate, acceleration and jerk.

Han's fhan acts on shaped minus raw; the raw rate and acceleration are fed forward, so a raw reference
within the limits is followed without lag, and a jump is made in minimum time without overshoot.
"""
import math

from pedestal_common.compiled import compiled
from pedestal_common.fhan import fhan

SUB_STEPS = 4


@compiled
def toward_rate_limit(gap, h, jerk):
    """Largest acceleration that jerk can still take out before the rate has grown by gap (in steps of h).

    a^2/(2 j) + a h/2 = gap; the last part of a step costs up to j h^2/8 more.
    """
    room = gap - 0.125 * jerk * h * h
    if room <= 0.0:
        return min(gap / h, 0.0)
    half = 0.5 * jerk * h
    return math.sqrt(half * half + 2.0 * jerk * room) - half


@compiled
def held_inside(position, rate, acceleration, low, high, braking, lag):
    """(position, rate, acceleration, held): a raw reference that could not stop before a limit is set onto it."""
    stop = position + rate * (abs(rate) / (2.0 * braking) + lag)
    if position > high or (rate > 0.0 and stop > high):
        return high, 0.0, 0.0, True
    if position < low or (rate < 0.0 and stop < low):
        return low, 0.0, 0.0, True
    return position, rate, acceleration, False


@compiled
def shape(p, v, a, raw_p, raw_v, raw_a, dt, rate, acceleration, jerk, h0):
    """(position, rate, acceleration, rate limited, acceleration limited) of the shaped reference dt later.

    p, v, a are the shaped reference before, raw_* the raw one at the end of dt.
    """
    h = dt / SUB_STEPS
    # What the target's own acceleration takes is not there for closing the gap.
    r = max(acceleration - abs(raw_a), 0.2 * acceleration)
    rate_limited = acceleration_limited = False
    for i in range(SUB_STEPS):
        back = (SUB_STEPS - i) * h
        e = p - (raw_p - raw_v * back + 0.5 * raw_a * back * back)
        de = v - (raw_v - raw_a * back)
        wanted = raw_a + fhan(e, de, r, h0)
        u = min(max(wanted, -acceleration), acceleration)
        acceleration_limited |= u != wanted
        up, down = toward_rate_limit(rate - v, h, jerk), -toward_rate_limit(rate + v, h, jerk)
        rate_limited |= u > up or u < down
        u = min(max(u, down), up)
        a = min(max(u, a - jerk * h), a + jerk * h)
        p += v * h + 0.5 * a * h * h
        v += a * h
    return p, v, a, rate_limited, acceleration_limited
