"""The line of sight of an earth target in the axes of a rotating deck, and back.

Exact: the unit vector u to the target is differentiated twice. The suffix _dot is a time derivative.

    M'_dot = -[w x] M',    u_d = M' u,    u_d_dot = M' du - w x u_d
    u_d_dot_dot = M' ddu - w x (2 M' du - w x u_d) - dw x u_d

    M, M'        rotation deck -> earth (or frame of the filter), its transpose
    u, du, ddu   unit vector and its derivatives in that frame
    u_d          the unit vector on the deck
    w, dw        rate and angular acceleration of the deck, FLU
"""
from collections import namedtuple

from acu_tracker.geometry.motion import LineOfSight, angles, earth_angles
from acu_tracker.geometry.vector import Vector, cross, minus, rotated, rotated_back, times
from pedestal_common.compiled import compiled
from pedestal_common.geometry import line_of_sight

ZERO_VECTOR = Vector(0.0, 0.0, 0.0)

Attitude = namedtuple('Attitude', 'mat w dw')
"""Rotation from the deck to the frame in which the target is given; rate w [rad/s] and angular acceleration dw
[rad/s2] of the deck, FLU."""


@compiled
def on_deck(attitude, sight):
    """Return the LineOfSight in FLU of a LineOfSight in the frame of the attitude."""
    u, du = rotated_back(attitude.mat, sight.u), rotated_back(attitude.mat, sight.du)
    ddu = rotated_back(attitude.mat, sight.ddu)
    wu, dwu = cross(attitude.w, u), cross(attitude.dw, u)
    return LineOfSight(u, minus(du, wu), minus(minus(ddu, cross(attitude.w, minus(times(2.0, du), wu))), dwu))


@compiled
def fixed_rates(w, A, E):
    """Return the rates (dA, dE) [rad/s] of the deck angles of an earth-fixed direction, now at A, E [rad], while the
    deck rotates at w [rad/s] (FLU)."""
    u = Vector(*line_of_sight.direction(A, E))
    motion = angles(LineOfSight(u, times(-1.0, cross(w, u)), ZERO_VECTOR))
    return motion.azimuth.rate, motion.elevation.rate


@compiled
def earth_rates(attitude, u, du):
    """Return the rates (dA, dE) [rad/s] of the earth angles of a FLU unit vector u that moves by du [1/s] on the deck.

    The rate of the unit vector in the earth's frame is M (du + w x u).
    """
    wu = cross(attitude.w, u)
    du = Vector(du.x + wu.x, du.y + wu.y, du.z + wu.z)
    motion = earth_angles(LineOfSight(rotated(attitude.mat, u), rotated(attitude.mat, du), ZERO_VECTOR))
    return motion.azimuth.rate, motion.elevation.rate
