"""The shaper: it turns the raw target of an axis into a reference that the axis can follow.

The reference keeps the limits of rate, acceleration and jerk. The acceleration of the reference comes from fhan, the
time-optimal acceleration of a double integrator in discrete time (Han 2009). The function fhan acts on the difference
shaped minus raw, and the rate and acceleration of the raw target are fed forward. The reference therefore follows a
raw target within the limits without lag. After a jump it reaches the raw target in minimum time without overshoot.
"""
import math

from acu_tracker.geometry.vector import AxisMotion
from acu_tracker.servo.params import ShaperParameters
from pedestal_common.compiled import compiled
from pedestal_common.fhan import fhan
from pedestal_common.quantities import Radians, RadiansPerSecond, RadiansPerSecond2, RadiansPerSecond3, Seconds

SUB_STEP_COUNT = 4  # number of sub-steps in which the shaper computes a step of the drive


@compiled
def toward_rate_limit(gap: RadiansPerSecond, h: Seconds, jerk: RadiansPerSecond3) -> RadiansPerSecond2:
    """Return the largest acceleration a with which the rate still stays inside its limit.

    The jerk j must reduce a to 0 before the rate has grown by gap, its distance from the limit, in sub-steps h:

        a^2/(2 j) + a h/2 + j h^2/8 = gap

    The second and third term stand for the discrete steps: j h^2/8 is the most that the last part of a step adds.
    """
    room = gap - 0.125 * jerk * h * h
    if room <= 0.0:
        return min(gap / h, 0.0)
    half = 0.5 * jerk * h
    return math.sqrt(half * half + 2.0 * jerk * room) - half


@compiled
def held_inside(raw: AxisMotion, low: Radians, high: Radians, braking: RadiansPerSecond2,
                lag: Seconds) -> tuple[AxisMotion, bool]:
    """Return (AxisMotion of the raw target, put on a limit if it is beyond or could not stop before it; True if put
    there). lag: time until the braking begins."""
    stop = raw.angle + raw.rate * (abs(raw.rate) / (2.0 * braking) + lag)
    if raw.angle > high or (raw.rate > 0.0 and stop > high):
        return AxisMotion(high, 0.0, 0.0), True
    if raw.angle < low or (raw.rate < 0.0 and stop < low):
        return AxisMotion(low, 0.0, 0.0), True
    return raw, False


@compiled
def shape(before: AxisMotion, raw: AxisMotion, dt: Seconds, limits: ShaperParameters) -> tuple[AxisMotion, bool, bool]:
    """Return (shaped reference, True if its rate was limited, True if its acceleration was limited). before: shaped
    reference dt ago; raw: raw target now, at the end of dt."""
    p, v, a = before
    h = dt / SUB_STEP_COUNT
    # p, v, a: shaped angle, rate, acceleration; e, de: shaped minus raw; back: time from a sub-step to the end of dt.
    # r: acceleration for reducing e: the part of the limit that the acceleration of the raw target leaves, and at
    # least a fifth of the limit.
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
