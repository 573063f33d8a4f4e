"""A slew through the keyhole: the azimuth leaves the target, slews at its limits and meets the target again.

The elevation takes the angle at which the beam is closest to the target.
"""
import math

import numpy as np

from acu_tracker.geometry.motion import AxisMotion, LineOfSight, Motion, line_of_sight, north_west_up
from pedestal_common.compiled import compiled
from pedestal_common.geometry.line_of_sight import wrap

SLEW_DTYPE = np.dtype([('t1', 'f8'), ('t2', 'f8'), ('azimuth1', 'f8'), ('azimuth2', 'f8'), ('rate1', 'f8'),
                       ('rate2', 'f8'), ('peak', 'f8'), ('acceleration', 'f8'),
                       ('culmination', 'f8'), ('highest', 'f8'), ('needed', 'f8'),
                       ('loss', 'f8'), ('worst', 'f8'), ('cost', 'f8'), ('other_cost', 'f8'), ('long_way', 'i8')],
                      align=True)
"""t1, azimuth1, rate1: time [s] at which the slew leaves the target, azimuth [rad] and rate [rad/s] there; t2,
azimuth2, rate2: the same where it meets the target. `peak`: largest rate, signed [rad/s]; acceleration: to the peak
[rad/s2]; culmination, highest: time [s] and elevation [rad] of the target's highest point on the levelled deck.
`needed`: largest azimuth rate of following without a slew [rad/s]; loss: expected time [s] further than half a
beamwidth off; worst: largest pointing offset [rad]. `cost`: share of signal lost, in seconds; other_cost: of the other
direction, inf if the limits forbid it; long_way: 1 if the slew goes against the target's own direction."""


@compiled
def azimuth_at(slew, t):
    """Return the AxisMotion of the azimuth at t1 <= t <= t2 [s]: accelerated, at its peak rate, decelerated."""
    # begun, left: time since t1 and until t2; rise, fall: times of the acceleration and of the deceleration.
    sign = math.copysign(1.0, slew.peak)
    a = sign * slew.acceleration
    begun, left = t - slew.t1, slew.t2 - t
    rise, fall = (slew.peak - slew.rate1) / a, (slew.peak - slew.rate2) / a
    if begun < rise:
        return AxisMotion(slew.azimuth1 + begun * (slew.rate1 + 0.5 * a * begun), slew.rate1 + a * begun, a)
    if left < fall:
        return AxisMotion(slew.azimuth2 - left * (slew.rate2 + 0.5 * a * left), slew.rate2 + a * left, -a)
    return AxisMotion(slew.azimuth1 + 0.5 * (slew.rate1 + slew.peak) * rise + slew.peak * (begun - rise), slew.peak,
                      0.0)


@compiled
def true_deck_share(slew, t):
    """Return the AxisMotion [1, 1/s, 1/s2] of the share to which a slew follows the true deck at t [s]: 1 at its ends,
    0 in its middle.

    A slew is planned on the levelled deck. The target, which the slew leaves and meets, moves on the true deck. This
    share of the difference between both decks is added to the slew (`motion_at`).
    """
    T = slew.t2 - slew.t1
    x = 1.0 - 2.0 * (t - slew.t1) / T
    return AxisMotion(x**4, -8.0 * x**3 / T, 48.0 * x * x / (T * T))


@compiled
def best_elevation(azimuth, sight):
    """Return the AxisMotion of the elevation at which a beam at an azimuth (AxisMotion) is closest
    to a LineOfSight in FLU.

    An elevation beyond pi/2 is past the zenith. E = atan2(z, b), where b = x cos a - y sin a is the part of the
    direction along the beam's azimuth, and c = db/da.
    """
    a, da, dda = azimuth
    u, du, ddu = sight
    sa, ca = math.sin(a), math.cos(a)
    b, c = u.x * ca - u.y * sa, -u.x * sa - u.y * ca
    db = du.x * ca - du.y * sa + da * c
    ddb = ddu.x * ca - ddu.y * sa + 2.0 * da * (-du.x * sa - du.y * ca) + dda * c - da * da * b
    r2 = max(b * b + u.z * u.z, 1e-12)
    dE = (b * du.z - u.z * db) / r2
    return AxisMotion(math.atan2(u.z, b), dE, (b * ddu.z - u.z * ddb - 2.0 * dE * (b * db + u.z * du.z)) / r2)


@compiled
def pointing_offset(azimuth, u, highest):
    """Return the angle [rad] between a target u (FLU) and the beam at a deck azimuth [rad], at the best elevation up
    to `highest` [rad]."""
    sa, ca = math.sin(azimuth), math.cos(azimuth)
    # b, c: horizontal parts of u along and across the beam; p, q: parts of u along the beam at `highest`, and across
    # it in the vertical plane.
    b, c = ca * u.x - sa * u.y, sa * u.x + ca * u.y
    if math.atan2(u.z, b) <= highest:
        return math.atan2(abs(c), math.hypot(b, u.z))
    p = math.cos(highest) * b + math.sin(highest) * u.z
    q = math.sin(highest) * b - math.cos(highest) * u.z
    return math.atan2(math.hypot(q, c), p)


@compiled
def motion_at(slew, t, target, level, highest):
    """Return (Motion of the axes at t [s] on a slew, pointing offset [rad] from the target).

    target: Motion on the true deck; level: AxisMotion of its azimuth on the levelled deck of the plan. At its ends the
    slew meets the target on the true deck; in its middle the true deck has no share in it. `highest`: the largest
    elevation [rad].
    """
    # D: azimuth of the target on the true deck minus that on the levelled deck.
    azimuth, g = azimuth_at(slew, t), true_deck_share(slew, t)
    D = wrap(target.azimuth.angle - level.angle)
    dD, ddD = target.azimuth.rate - level.rate, target.azimuth.acceleration - level.acceleration
    azimuth = AxisMotion(azimuth.angle + g.angle * D, azimuth.rate + (g.rate * D + g.angle * dD),
                         azimuth.acceleration + (g.acceleration * D + 2.0 * g.rate * dD + g.angle * ddD))
    enu = line_of_sight(target)
    sight = LineOfSight(north_west_up(enu.u), north_west_up(enu.du), north_west_up(enu.ddu))
    elevation = best_elevation(azimuth, sight)
    if elevation.angle > highest:
        elevation = AxisMotion(highest, 0.0, 0.0)
    return Motion(azimuth, elevation), pointing_offset(azimuth.angle, sight.u, highest)


@compiled
def peak_rate(D, T, v1, v2, a):
    """Return the cruising rate of a slew by D [rad] in T [s] that begins at v1, ends at v2 [rad/s] and changes rate by
    a [rad/s2]; inf if T is too short.

    D = v T - (v - v1)^2 / (2 a) - (v - v2)^2 / (2 a), the smaller root of v.
    """
    half = 0.5 * (v1 + v2 + a * T)
    root = half * half - 0.5 * (v1 * v1 + v2 * v2) - a * D
    return half - math.sqrt(root) if root >= 0.0 else math.inf
