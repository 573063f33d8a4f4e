"""The bridge: the program track, rotated so that it passes through the place where the target was last tracked.

The antenna follows the rotated program during an outage of the receiver. For many seconds the rotated program is more
accurate than the rate and the acceleration that the filter has estimated. The rotation is the one with the smallest
angle.
"""
import math
from typing import NamedTuple

from acu_tracker.geometry.vector import LineOfSight, Motion, Vector, cross, dot, earth_angles, line_of_sight, vector
from acu_tracker.modes import Reason
from acu_tracker.program import program_track
from acu_tracker.program.program_track import ProgramTrack
from pedestal_common.compiled import compiled
from pedestal_common.quantities import Bit, Seconds, Vector3
from pedestal_common.record import Record


class Bridge(Record):
    """Rotation of the program."""
    axis: Vector3   # axis of the rotation, ENU; its length is the sine of the angle of the rotation
    cos: float      # cosine of the angle
    valid: Bit      # 1 if there is a rotation


class Way(NamedTuple):
    """Path that the antenna may follow: the program, rotated if `valid` is 1."""
    program: ProgramTrack
    valid: Bit
    axis: Vector    # as in Bridge
    cos: float      # as in Bridge


MIN_PROGRAM_COSINE = math.cos(math.radians(3.0))  # the program is rotated by 3 deg at most


@compiled
def begin(bridge: Bridge, program: ProgramTrack, t: Seconds, u: Vector) -> None:
    """Find the rotation that turns the direction of the program at t to the ENU unit vector u. It is not valid if its
    angle is too large, or if the program does not cover t."""
    bridge.valid = 0
    if program_track.status(program, t) == Reason.NONE:
        v = program_track.direction(program, t)
        bridge.cos = dot(v, u)
        bridge.valid = bridge.cos > MIN_PROGRAM_COSINE
        bridge.axis[0], bridge.axis[1], bridge.axis[2] = cross(v, u)


@compiled
def clear(bridge: Bridge) -> None:
    """Discard the rotation: the program is followed as it is."""
    bridge.valid = 0


@compiled
def way(bridge: Bridge, program: ProgramTrack) -> Way:
    """Return the Way of the program with the present rotation."""
    return Way(program, bridge.valid, vector(bridge.axis), bridge.cos)


@compiled
def _rotated(path: Way, v: Vector) -> Vector:
    """Return an ENU vector v of the program after the rotation v cos + a x v + a (a.v) / (1 + cos) (formula of
    Rodrigues). The length of the axis a is the sine of the angle."""
    axis = path.axis
    d = cross(axis, v)
    k = dot(axis, v) / (1.0 + path.cos)
    return Vector(path.cos * v.x + d.x + k * axis.x, path.cos * v.y + d.y + k * axis.y,
                  path.cos * v.z + d.z + k * axis.z)


@compiled
def direction(path: Way, t: Seconds) -> Vector:
    """Return the ENU unit vector of a Way at t."""
    u = program_track.direction(path.program, t)
    return _rotated(path, u) if path.valid else u


@compiled
def motion_at(path: Way, t: Seconds) -> Motion:
    """Return the motion in earth angles of a Way at t."""
    motion = program_track.motion_at(path.program, t)
    if not path.valid:
        return motion
    sight = line_of_sight(motion)
    return earth_angles(LineOfSight(_rotated(path, sight.u), _rotated(path, sight.du), _rotated(path, sight.ddu)))
