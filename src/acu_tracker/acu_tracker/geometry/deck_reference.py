"""Conversion of the line of sight to a target from the earth frame to the rotating deck, and of its rates back.

The conversion is exact: it differentiates the unit vector u to the target twice. The suffix _dot is a time derivative.

    M'_dot = -[w x] M',    u_d = M' u,    u_d_dot = M' du - w x u_d
    u_d_dot_dot = M' ddu - w x (2 M' du - w x u_d) - dw x u_d

    M, M'        rotation deck -> earth, its transpose (Attitude.mat is M); near the zenith the tilted frame of the
                 filter takes the place of the earth frame (module estimate_frame)
    u, du, ddu   unit vector and its derivatives in the earth frame, or in the frame of the filter  [-, 1/s, 1/s2]
    u_d          unit vector on the deck, FLU                                                   [-]
    w, dw        angular rate and angular acceleration of the deck, FLU                         [rad/s, rad/s2]
    [w x]        matrix of the cross product with w
"""
from typing import NamedTuple

from acu_tracker.geometry.vector import (
    LineOfSight,
    Rotation,
    Vector,
    angles,
    cross,
    earth_angles,
    minus,
    rotated,
    times,
    transposed,
    turned,
)
from pedestal_common.compiled import compiled
from pedestal_common.geometry import line_of_sight
from pedestal_common.quantities import Radians, RadiansPerSecond

ZERO_VECTOR = Vector(0.0, 0.0, 0.0)


class Attitude(NamedTuple):
    """Attitude of the deck and its motion."""
    mat: Rotation   # M, from the deck to the frame in which the target is given
    w: Vector       # angular rate of the deck, FLU [rad/s]
    dw: Vector      # its angular acceleration, FLU [rad/s2]


@compiled
def on_deck(attitude: Attitude, sight: LineOfSight) -> LineOfSight:
    """Return a LineOfSight on the deck (FLU); sight: the LineOfSight in the frame to which attitude.mat rotates."""
    u, du, ddu = turned(transposed(attitude.mat), sight)
    wu, dwu = cross(attitude.w, u), cross(attitude.dw, u)
    return LineOfSight(u, minus(du, wu), minus(minus(ddu, cross(attitude.w, minus(times(2.0, du), wu))), dwu))


@compiled
def fixed_rates(w: Vector, A: Radians, E: Radians) -> tuple[RadiansPerSecond, RadiansPerSecond]:
    """Return the rates (dA, dE) of the deck angles of an earth-fixed direction.

    A, E: its deck angles now; w: rate of the deck [rad/s], FLU.
    """
    u = Vector(*line_of_sight.direction(A, E))
    motion = angles(LineOfSight(u, times(-1.0, cross(w, u)), ZERO_VECTOR))
    return motion.azimuth.rate, motion.elevation.rate


@compiled
def earth_rates(attitude: Attitude, u: Vector, du: Vector) -> tuple[RadiansPerSecond, RadiansPerSecond]:
    """Return the rates (dA, dE) of the earth angles of a direction that is measured on the deck.

    u, du: unit vector (FLU) of the direction and its rate on the deck [1/s]. The rate of the unit vector in the earth
    frame is M (du + w x u). Where attitude.mat rotates to the frame of the filter, the rates are those in that frame.
    """
    wu = cross(attitude.w, u)
    du = Vector(du.x + wu.x, du.y + wu.y, du.z + wu.z)
    motion = earth_angles(LineOfSight(rotated(attitude.mat, u), rotated(attitude.mat, du), ZERO_VECTOR))
    return motion.azimuth.rate, motion.elevation.rate
