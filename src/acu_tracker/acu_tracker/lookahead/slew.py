"""A slew through the keyhole: the azimuth leaves the target, slews at its limits and meets the target again.

At each instant the elevation takes the angle at which the beam is closest to the target.
"""
import math

from acu_tracker.geometry.vector import AxisMotion, LineOfSight, Motion, Vector, line_of_sight, north_west_up
from pedestal_common.compiled import compiled
from pedestal_common.geometry.line_of_sight import wrap
from pedestal_common.quantities import Bit, Radians, RadiansPerSecond, RadiansPerSecond2, Seconds
from pedestal_common.record import Record


class Slew(Record):
    """A planned slew, from its begin (index 1), where it leaves the target, to its end (2), where it meets the
    target."""
    t1: Seconds
    t2: Seconds
    azimuth1: Radians           # deck azimuths
    azimuth2: Radians
    rate1: RadiansPerSecond     # azimuth rates
    rate2: RadiansPerSecond
    peak: RadiansPerSecond      # largest azimuth rate, with its sign
    acceleration: RadiansPerSecond2     # acceleration to the peak, and deceleration from it
    culmination: Seconds        # time of the highest point of the target on the levelled deck
    highest: Radians            # elevation of this point
    needed: RadiansPerSecond    # largest azimuth rate that the target would need without a slew
    loss: Seconds               # expected time in which the target is more than half a beamwidth off the beam
    worst: Radians              # largest pointing offset
    cost: Seconds               # smooth form of the loss, see keyhole._evaluate
    other_cost: Seconds         # cost of the slew in the other direction; inf if the limits forbid it
    long_way: Bit               # 1 if the slew turns opposite to the target


@compiled
def azimuth_at(slew: Slew, t: Seconds) -> AxisMotion:
    """Return the motion of the azimuth at t1 <= t <= t2: it accelerates to the peak, keeps it, decelerates."""
    # begun, left: time since t1 and until t2; rise, fall: duration of the acceleration and of the deceleration.
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
def true_deck_share(slew: Slew, t: Seconds) -> AxisMotion:
    """Return the share to which a slew follows the true deck at t, with its derivatives [-, 1/s, 1/s2].

    A slew is planned on the levelled deck. The target, which the slew leaves and meets, moves on the true deck.
    `motion_at` therefore adds a share of the azimuth difference between both decks to the slew. The share is 1 at the
    ends of the slew and 0 in its middle.
    """
    T = slew.t2 - slew.t1
    x = 1.0 - 2.0 * (t - slew.t1) / T
    return AxisMotion(x**4, -8.0 * x**3 / T, 48.0 * x * x / (T * T))


@compiled
def best_elevation(azimuth: AxisMotion, sight: LineOfSight) -> AxisMotion:
    """Return the motion of the elevation at which a beam at an azimuth a is closest to the target; sight: direction to
    it, FLU.

        E = atan2(z, b),  b = x cos a - y sin a,  c = db/da

    x, y, z: direction of the target; b: its part along the azimuth. An elevation above pi/2 is past the zenith.
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
def pointing_offset(azimuth: Radians, u: Vector, highest: Radians) -> Radians:
    """Return the angle between the target and a beam at a deck azimuth and the best possible elevation. u: unit vector
    of the target, FLU; highest: largest elevation."""
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
def motion_at(slew: Slew, t: Seconds, target: Motion, level: AxisMotion, highest: Radians) -> tuple[Motion, Radians]:
    """Return (motion of the axes at t on a slew, pointing offset from the target).

    target: motion of the target on the true deck; level: azimuth of the target on the levelled deck of the plan;
    highest: largest elevation. At its ends the slew meets the target on the true deck. In its middle it is the planned
    slew on the levelled deck.
    """
    # D: azimuth of the target on the true deck minus that on the levelled deck.
    azimuth, share = azimuth_at(slew, t), true_deck_share(slew, t)
    D = wrap(target.azimuth.angle - level.angle)
    dD, ddD = target.azimuth.rate - level.rate, target.azimuth.acceleration - level.acceleration
    azimuth = AxisMotion(azimuth.angle + share.angle * D, azimuth.rate + (share.rate * D + share.angle * dD),
                         azimuth.acceleration + (share.acceleration * D + 2.0 * share.rate * dD + share.angle * ddD))
    enu = line_of_sight(target)
    sight = LineOfSight(north_west_up(enu.u), north_west_up(enu.du), north_west_up(enu.ddu))
    elevation = best_elevation(azimuth, sight)
    if elevation.angle > highest:
        elevation = AxisMotion(highest, 0.0, 0.0)
    return Motion(azimuth, elevation), pointing_offset(azimuth.angle, sight.u, highest)


@compiled
def peak_rate(D: Radians, T: Seconds, v1: RadiansPerSecond, v2: RadiansPerSecond,
              a: RadiansPerSecond2) -> RadiansPerSecond:
    """Return the peak rate v of a slew through D in T, from v1 to v2; inf if T is too short. It is the smaller root of

        D = v T - (v - v1)^2 / (2 a) - (v - v2)^2 / (2 a)
    """
    half = 0.5 * (v1 + v2 + a * T)
    root = half * half - 0.5 * (v1 * v1 + v2 * v2) - a * D
    return half - math.sqrt(root) if root >= 0.0 else math.inf
