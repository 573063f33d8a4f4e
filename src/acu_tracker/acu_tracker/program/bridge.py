"""The program track, rotated by the smallest angle that puts it where the target was last tracked.

It bridges an outage of the receiver with the shape of the program at the place of the estimate. For many seconds this
is more accurate than the filter's own rate and acceleration.
"""
import math
from collections import namedtuple

import numpy as np

from acu_tracker.geometry.motion import LineOfSight, earth_angles, line_of_sight
from acu_tracker.geometry.vector import Vector, cross, dot, vector
from acu_tracker.modes import Reason
from acu_tracker.program import program_track
from pedestal_common.compiled import compiled

BRIDGE_DTYPE = np.dtype([('axis', 'f8', (3,)), ('cos', 'f8'), ('valid', 'i8')], align=True)
"""axis: of the rotation, ENU, with the sine of its angle as its length; cos: cosine of the angle;
valid: 0 without a rotation."""

Way = namedtuple('Way', 'program valid axis cos')
"""Path to follow: a ProgramTrack, rotated if valid; the other fields as of BRIDGE_DTYPE."""

MIN_PROGRAM_COSINE = math.cos(math.radians(3.0))
"""Cosine of the largest angle between program and estimate for which the program is used [-]."""


@compiled
def begin(b, program, t, u):
    """Find the rotation that puts the program at the ENU unit vector u at t [s];
    not valid beyond MIN_PROGRAM_COSINE."""
    b.valid = 0
    if program_track.status(program, t) == Reason.NONE:
        v = program_track.direction(program, t)
        b.cos = dot(v, u)
        b.valid = b.cos > MIN_PROGRAM_COSINE
        b.axis[0], b.axis[1], b.axis[2] = cross(v, u)


@compiled
def clear(b):
    """Follow the program without a rotation."""
    b.valid = 0


@compiled
def way(b, program):
    """Return the Way of the program with the present rotation."""
    return Way(program, b.valid, vector(b.axis), b.cos)


@compiled
def _rotated(w, v):
    """Return an ENU Vector v of the program after the rotation: v cos + a x v + a (a.v) / (1 + cos) (Rodrigues).

    The length of the axis a is the sine of the angle.
    """
    axis = w.axis
    d = cross(axis, v)
    k = dot(axis, v) / (1.0 + w.cos)
    return Vector(w.cos * v.x + d.x + k * axis.x, w.cos * v.y + d.y + k * axis.y, w.cos * v.z + d.z + k * axis.z)


@compiled
def direction(w, t):
    """Return the ENU unit Vector of a Way at t [s]."""
    u = program_track.direction(w.program, t)
    return _rotated(w, u) if w.valid else u


@compiled
def motion_at(w, t):
    """Return the Motion in earth angles of a Way at t [s]."""
    motion = program_track.motion_at(w.program, t)
    if not w.valid:
        return motion
    sight = line_of_sight(motion)
    return earth_angles(LineOfSight(_rotated(w, sight.u), _rotated(w, sight.du), _rotated(w, sight.ddu)))
