"""Frames of an INS, and its conversion to those of the graph: body FLU, earth ENU (REP 103).

Quaternions are (x, y, z, w), body -> earth. With the matrices as quaternions, and (x) as their product:

    q_deck = H (x) E (x) q (x) B^-1 (x) M^-1        attitude of the deck
    w_deck = M R w                                  rate of the deck; also the specific force

    E    frame of the earth of the device -> ENU           B    body frame of its attitude -> FLU
    R    body frame of its rates -> FLU                    M    case of the device (FLU) -> deck, its mounting
    H    rotation about the vertical by the heading at which the device reports 0
"""
import math

import numpy as np

from pedestal_common.compiled import compiled
from pedestal_common.geometry.quaternion import product
from pedestal_common.quantities import Matrix3, Quaternion, Radians, Records, Vector3, Xyz, Xyzw
from pedestal_common.record import Record

BODY_MATRICES = {'flu': np.eye(3), 'frd': np.diag((1.0, -1.0, -1.0)),
                 'rfu': np.array(((0.0, 1.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 0.0, 1.0)))}
"""{body frame: rotation to FLU}. frd: forward, right, down; rfu: right, forward, up."""

EARTH_MATRICES = {'enu': np.eye(3), 'nwu': np.array(((0.0, -1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0))),
                  'ned': np.array(((0.0, 1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, -1.0)))}
"""{frame of the earth: rotation to ENU}. nwu: north, west, up, as ENU with yaw 0 at north."""


class Frame(Record):
    """Constants of a conversion."""
    left: Quaternion    # H E
    right: Quaternion   # B^-1 M^-1
    rate: Matrix3       # M R


def quaternion_of(matrix: Matrix3) -> Quaternion:
    """Return the quaternion of a rotation matrix."""
    # Of 4 w^2, 4 x^2, ... the largest is at least 1, so the division is safe.
    m = np.asarray(matrix)
    squares = np.array((1.0 + m[0, 0] - m[1, 1] - m[2, 2], 1.0 - m[0, 0] + m[1, 1] - m[2, 2],
                        1.0 - m[0, 0] - m[1, 1] + m[2, 2], 1.0 + np.trace(m)))
    products = np.array(((squares[0], m[1, 0] + m[0, 1], m[2, 0] + m[0, 2], m[2, 1] - m[1, 2]),
                         (m[1, 0] + m[0, 1], squares[1], m[2, 1] + m[1, 2], m[0, 2] - m[2, 0]),
                         (m[2, 0] + m[0, 2], m[2, 1] + m[1, 2], squares[2], m[1, 0] - m[0, 1]),
                         (m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1], squares[3])))
    row = products[np.argmax(squares)]
    return row / np.linalg.norm(row)


def mounting_matrix(roll: Radians, pitch: Radians, yaw: Radians) -> Matrix3:
    """Return the rotation case -> deck of a device that is mounted at these angles, FLU: yaw to port, then pitch with
    the bow down, then roll with the port side up."""
    (cr, sr), (cp, sp), (cy, sy) = ((math.cos(angle), math.sin(angle)) for angle in (roll, pitch, yaw))
    return np.array(((cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr),
                     (sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr),
                     (-sp, cp * sr, cp * cr)))


def constants(earth: str, body: str, rate_body: str, mounting: tuple[Radians, Radians, Radians],
              heading_zero: Radians) -> Records:
    """Return the Frame (1,) of a device. mounting: roll, pitch, yaw of its case; heading_zero: true heading at which
    the device reports 0, clockwise."""
    case = mounting_matrix(*mounting)
    found = Frame.zeros()
    turn = mounting_matrix(0.0, 0.0, -heading_zero)
    found['left'][0] = quaternion_of(turn @ EARTH_MATRICES[earth])
    found['right'][0] = quaternion_of((case @ BODY_MATRICES[body]).T)
    found['rate'][0] = case @ BODY_MATRICES[rate_body]
    return found


@compiled
def attitude(frame: Frame, q: Quaternion) -> Xyzw:
    """Return the quaternion deck -> earth of the quaternion of a device."""
    return product(product(frame.left, q), frame.right)


@compiled
def on_deck(frame: Frame, v: Vector3) -> Xyz:
    """Return the components on the deck of a vector in the body frame of the rates."""
    return (frame.rate[0, 0] * v[0] + frame.rate[0, 1] * v[1] + frame.rate[0, 2] * v[2],
            frame.rate[1, 0] * v[0] + frame.rate[1, 1] * v[1] + frame.rate[1, 2] * v[2],
            frame.rate[2, 0] * v[0] + frame.rate[2, 1] * v[1] + frame.rate[2, 2] * v[2])


@compiled
def rotation_vector(a: Quaternion | Xyzw, b: Quaternion | Xyzw) -> Xyz:
    """Return the rotation vector in the frame of the body by which it turned from the quaternion a to b."""
    x, y, z, w = product((-a[0], -a[1], -a[2], a[3]), b)
    if w < 0.0:
        x, y, z, w = -x, -y, -z, -w
    s = math.sqrt(x * x + y * y + z * z)
    k = 2.0 * math.atan2(s, w) / s if s > 0.0 else 2.0
    return k * x, k * y, k * z


@compiled
def turned(q: Quaternion | Xyzw, x: Radians, y: Radians, z: Radians) -> Xyzw:
    """Return the quaternion of a body with the quaternion q after a turn by a rotation vector in its frame."""
    angle = math.sqrt(x * x + y * y + z * z)
    k = math.sin(0.5 * angle) / angle if angle > 0.0 else 0.5
    return product(q, (k * x, k * y, k * z, math.cos(0.5 * angle)))


@compiled
def of_angles(heading: Radians, pitch: Radians, roll: Radians) -> Xyzw:
    """Return the quaternion FLU -> ENU of a heading clockwise from north, a pitch with the bow up and a roll with the
    starboard side down: Rz(90 deg - heading) Ry(-pitch) Rx(roll)."""
    y, p, r = 0.5 * (0.5 * math.pi - heading), -0.5 * pitch, 0.5 * roll
    yaw, level = (0.0, 0.0, math.sin(y), math.cos(y)), (0.0, math.sin(p), 0.0, math.cos(p))
    return product(product(yaw, level), (math.sin(r), 0.0, 0.0, math.cos(r)))
