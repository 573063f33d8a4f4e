"""The bridge: the program track, rotated so that it passes through the place where the target was last tracked.

The antenna follows the rotated program during an outage of the receiver. For many seconds the rotated program is more
accurate than the rate and the acceleration that the filter has estimated. The rotation is the one with the smallest
angle.

b: record of Bridge; program: a ProgramTrack; w: a Way.
"""
import math
from collections import namedtuple

from acu_tracker.geometry.motion import LineOfSight, earth_angles, line_of_sight
from acu_tracker.geometry.vector import Vector, cross, dot, vector
from acu_tracker.modes import Reason
from acu_tracker.program import program_track
from pedestal_common.compiled import compiled
from pedestal_common.quantities import Vector3
from pedestal_common.record import Record


class Bridge(Record):
    """Rotation of the program."""
    axis: Vector3  # axis of the rotation, ENU; its length is the sine of the angle of the rotation
    cos: float  # cosine of the angle
    valid: int  # 1 if there is a rotation


Way = namedtuple('Way', 'program valid axis cos')
"""Path that the antenna may follow: the ProgramTrack `program`, rotated if `valid` is 1; axis, cos: as in
Bridge."""

MIN_PROGRAM_COSINE = math.cos(math.radians(3.0))
"""Cosine of the largest angle between program and estimate for which the program is rotated [-]: 3 deg."""


@compiled
def begin(b, program, t, u):
    """Find the rotation that turns the direction of the program at t [s] to the ENU unit vector u.

    The rotation is not valid if its angle is too large (MIN_PROGRAM_COSINE), or if the program does not cover t.
    """
    b.valid = 0
    if program_track.status(program, t) == Reason.NONE:
        v = program_track.direction(program, t)
        b.cos = dot(v, u)
        b.valid = b.cos > MIN_PROGRAM_COSINE
        b.axis[0], b.axis[1], b.axis[2] = cross(v, u)


@compiled
def clear(b):
    """Discard the rotation: the program is followed as it is."""
    b.valid = 0


@compiled
def way(b, program):
    """Return the Way of the program with the present rotation."""
    return Way(program, b.valid, vector(b.axis), b.cos)


@compiled
def _rotated(w, v):
    """Return an ENU Vector v of the program after the rotation.

    The formula of Rodrigues gives v cos + a x v + a (a.v) / (1 + cos), for an axis a with the sine of the angle as its
    length.
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
