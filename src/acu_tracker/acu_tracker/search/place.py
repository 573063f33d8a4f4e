"""The expected place of a lost target without a program: it moves on along the great circle of the last estimate.

The last known rate W becomes less and less certain. The rate is therefore expected to fade, as the acceleration does
in a Singer model (Singer 1970). In the time T the target has moved by the angle W tau (1 - exp(-T / tau)), tau =
RATE_FADE_TIME_S.
"""
import math

from acu_tracker.geometry.vector import (
    ZERO_VECTOR,
    AxisMotion,
    LineOfSight,
    Motion,
    Vector,
    angles,
    dot,
    earth_angles,
    times,
    turned_along,
    vector,
)
from acu_tracker.search.pattern import Point
from pedestal_common.compiled import compiled
from pedestal_common.geometry import line_of_sight
from pedestal_common.quantities import Radians, Seconds, Vector3
from pedestal_common.record import Record


class Place(Record):
    """Last known place of the target."""
    u: Vector3      # ENU unit vector towards the target [-]
    du: Vector3     # its rate [1/s]
    stamp: Seconds


RATE_FADE_TIME_S = 10.0  # time constant with which the expected rate fades [s]


@compiled
def remember(place: Place, t: Seconds, u: Vector, du: Vector) -> None:
    """Keep the last known place: ENU unit vector u and its rate du [1/s] at t."""
    place.u[0], place.u[1], place.u[2] = u
    place.du[0], place.du[1], place.du[2] = du
    place.stamp = t


@compiled
def motion_at(place: Place, t: Seconds) -> Motion:
    """Return the Motion of the expected place in earth angles at t, a time after the last known place."""
    u, du = vector(place.u), vector(place.du)
    W, left = math.sqrt(dot(du, du)), math.exp((place.stamp - t) / RATE_FADE_TIME_S)
    angle = W * RATE_FADE_TIME_S * (1.0 - left)
    ahead = turned_along(u, du, W, angle)
    # ahead = u cos(angle) + du/W sin(angle), and the angle grows with the rate W left. The second derivative has two
    # parts: -(W left)^2 ahead of the circle, and -rate / RATE_FADE_TIME_S of the fading rate.
    rate = times(left, turned_along(du, times(-W * W, u), W, angle))
    bend, fading = times(-(W * left)**2, ahead), times(-1.0 / RATE_FADE_TIME_S, rate)
    return earth_angles(LineOfSight(ahead, rate, Vector(bend.x + fading.x, bend.y + fading.y, bend.z + fading.z)))


@compiled
def track(motion: Motion) -> Radians:
    """Return the angle from cross-elevation towards elevation in which a target moves; 0 for a target at rest."""
    return math.atan2(motion.elevation.rate, motion.azimuth.rate * math.cos(motion.elevation.angle))


@compiled
def displaced(motion: Motion, offset: Point) -> Motion:
    """Return the Motion of a beam at an offset from a direction; the accelerations of the pattern are neglected."""
    n = line_of_sight.displaced_motion(motion.azimuth.angle, motion.elevation.angle, motion.azimuth.rate,
                                       motion.elevation.rate, offset.x, offset.y, offset.dx, offset.dy)
    beam = angles(LineOfSight(Vector(n[0], n[1], n[2]), Vector(n[3], n[4], n[5]), ZERO_VECTOR))
    return Motion(AxisMotion(beam.azimuth.angle, beam.azimuth.rate, motion.azimuth.acceleration),
                  AxisMotion(beam.elevation.angle, beam.elevation.rate, motion.elevation.acceleration))
