"""The expected place of a target without a program: on from its last known place along its great circle.

The last known rate becomes less and less certain. It is expected to fade, as in a Singer model (Singer 1970, with the
rate in the place of the acceleration), so that the target has moved by

    W tau (1 - exp(-T/tau)),    W: its rate at the last measurement, T ago.
"""
import math

import numpy as np

from acu_tracker.geometry.great_circle import turned
from acu_tracker.geometry.motion import AxisMotion, LineOfSight, Motion, angles, earth_angles
from acu_tracker.geometry.vector import Vector, dot, times, vector
from pedestal_common.compiled import compiled
from pedestal_common.geometry import line_of_sight

PLACE_DTYPE = np.dtype([('u', 'f8', (3,)), ('du', 'f8', (3,)), ('stamp', 'f8')], align=True)
"""ENU unit vector u [-] of the target at a stamp [s], and its rate du [1/s]."""

ZERO_VECTOR = Vector(0.0, 0.0, 0.0)
"""Vector of length 0."""

RATE_FADE_TIME_S = 10.0
"""Time constant with which the expected rate fades [s]."""


@compiled
def remember(s, t, u, du):
    """Keep that the target is at the ENU unit Vector u with its rate du [1/s] at t [s]."""
    s.u[0], s.u[1], s.u[2] = u
    s.du[0], s.du[1], s.du[2] = du
    s.stamp = t


@compiled
def motion_at(s, t):
    """Return the Motion in earth angles at t [s], not before the last known place."""
    u, du = vector(s.u), vector(s.du)
    W, left = math.sqrt(dot(du, du)), math.exp((s.stamp - t) / RATE_FADE_TIME_S)
    angle = W * RATE_FADE_TIME_S * (1.0 - left)
    ahead = turned(u, du, W, angle)
    # d/d angle (u cos + du/W sin) = (du cos - u W sin) / W, and the angle grows by W left. The second derivative is
    # the sum of the circle, -(W left)^2 ahead, and of the fading rate, -rate / RATE_FADE_TIME_S.
    rate = times(left, turned(du, times(-W * W, u), W, angle))
    bend, fading = times(-(W * left)**2, ahead), times(-1.0 / RATE_FADE_TIME_S, rate)
    return earth_angles(LineOfSight(ahead, rate, Vector(bend.x + fading.x, bend.y + fading.y, bend.z + fading.z)))


@compiled
def track(motion):
    """Return the direction [rad] in which a target with this Motion moves,
    from cross-elevation towards elevation; 0 at rest."""
    return math.atan2(motion.elevation.rate, motion.azimuth.rate * math.cos(motion.elevation.angle))


@compiled
def displaced(motion, p):
    """Return the Motion of a beam at an offset from a target: a pattern.Point p in cross-elevation and elevation. The
    accelerations of the pattern are neglected."""
    n = line_of_sight.displaced_motion(motion.azimuth.angle, motion.elevation.angle, motion.azimuth.rate,
                                       motion.elevation.rate, p.x, p.y, p.dx, p.dy)
    beam = angles(LineOfSight(Vector(n[0], n[1], n[2]), Vector(n[3], n[4], n[5]), ZERO_VECTOR))
    return Motion(AxisMotion(beam.azimuth.angle, beam.azimuth.rate, motion.azimuth.acceleration),
                  AxisMotion(beam.elevation.angle, beam.elevation.rate, motion.elevation.acceleration))
