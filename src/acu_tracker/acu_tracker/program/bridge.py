"""The program track, turned by the smallest rotation that puts it where the target was last seen.

So it has the shape of the program and the place of the estimate: what a silence of the receiver is bridged with, for
many seconds better than the filter's own rate and acceleration.
"""
import math

import numpy as np

from acu_tracker.geometry.deck_reference import moving_angles, moving_direction
from acu_tracker.program import program_track
from pedestal_common.compiled import compiled
from pedestal_common.line_of_sight import cross

BRIDGE = np.dtype([('axis', 'f8', (3,)), ('cos', 'f8'), ('there', 'i8')], align=True)
"""axis: ENU, of the length of the rotation's sine; cos: of its angle; there: 0 where there is none."""

LIKE_PROGRAM = math.cos(math.radians(3.0))
"""The program is believed while it is closer to the estimate than this (cosine)."""


@compiled
def begin(b, times, table, t, e, n, u):
    """Turn the program so that it is at the ENU unit vector (e, n, u) at t; none where it is not nearly there."""
    b.there = 0
    if program_track.status(times, t) == program_track.NONE:
        x, y, z = program_track.direction(times, table, t)
        b.cos = x * e + y * n + z * u
        b.there = b.cos > LIKE_PROGRAM
        b.axis[0], b.axis[1], b.axis[2] = cross(x, y, z, e, n, u)


@compiled
def turned(b, x, y, z):
    """An ENU vector of the program after the turn (Rodrigues)."""
    p, q, r = b.axis[0], b.axis[1], b.axis[2]
    dx, dy, dz = cross(p, q, r, x, y, z)
    k = (p * x + q * y + r * z) / (1.0 + b.cos)
    return b.cos * x + dx + k * p, b.cos * y + dy + k * q, b.cos * z + dz + k * r


@compiled
def outlook(b, times, table, t):
    """Earth (A, dA, ddA, E, dE, ddE) of the turned program at t."""
    A, dA, ddA, E, dE, ddE = program_track.outlook(times, table, t)
    e, n, u, de, dn, du, dde, ddn, ddu = moving_direction(A, dA, ddA, E, dE, ddE)
    e, n, u = turned(b, e, n, u)
    de, dn, du = turned(b, de, dn, du)
    dde, ddn, ddu = turned(b, dde, ddn, ddu)
    return moving_angles(n, -e, u, dn, -de, du, ddn, -dde, ddu)
