"""The program track, turned by the smallest rotation that puts it where the target was last seen.

So it has the shape of the program and the place of the estimate: what an outage of the receiver is bridged with, for
many seconds better than the filter's own rate and acceleration.
"""
import math

import numpy as np

from acu_tracker.geometry.motion import LineOfSight, earth_angles, line_of_sight
from acu_tracker.geometry.vector import Vector, cross, dot, vector
from acu_tracker.program import program_track
from pedestal_common.compiled import compiled

BRIDGE = np.dtype([('axis', 'f8', (3,)), ('cos', 'f8'), ('valid', 'i8')], align=True)
"""axis: ENU, of the length of the rotation's sine; cos: of its angle; valid: 0 where there is none."""

LIKE_PROGRAM = math.cos(math.radians(3.0))
"""The program is believed while it is closer to the estimate than this (cosine)."""


@compiled
def begin(b, program, t, u):
    """Turn the program so that it is at the ENU unit vector u at t [s]; none where it is not nearly there."""
    b.valid = 0
    if program_track.status(program, t) == program_track.NONE:
        v = program_track.direction(program, t)
        b.cos = dot(v, u)
        b.valid = b.cos > LIKE_PROGRAM
        b.axis[0], b.axis[1], b.axis[2] = cross(v, u)


@compiled
def turned(b, v):
    """An ENU Vector of the program after the turn (Rodrigues)."""
    axis = vector(b.axis)
    d = cross(axis, v)
    k = dot(axis, v) / (1.0 + b.cos)
    return Vector(b.cos * v.x + d.x + k * axis.x, b.cos * v.y + d.y + k * axis.y, b.cos * v.z + d.z + k * axis.z)


@compiled
def motion_at(b, program, t):
    """Motion in earth angles of the turned program at t [s]."""
    sight = line_of_sight(program_track.motion_at(program, t))
    return earth_angles(LineOfSight(turned(b, sight.u), turned(b, sight.du), turned(b, sight.ddu)))
