"""Frames of an INS, and its conversion to those of the graph: body FLU, earth ENU (REP 103).

Quaternions are (x, y, z, w), body -> earth. With the matrices as quaternions, and (x) as their product:

    q_deck = H (x) E (x) q (x) B^-1 (x) M^-1        attitude of the deck
    w_deck = M R w                                  rate of the deck; also the specific force

    E    frame of the earth of the device -> ENU           B    body frame of its attitude -> FLU
    R    body frame of its rates -> FLU                    M    case of the device (FLU) -> deck, its mounting
    H    rotation about the vertical by the heading at which the device reports 0
"""
import math
from typing import Annotated

import numpy as np

from pedestal_common.compiled import compiled
from pedestal_common.geometry.quaternion import product
from pedestal_common.quantities import Floats, Matrix3
from pedestal_common.record import Record

BODY_MATRICES = {'flu': np.eye(3), 'frd': np.diag((1.0, -1.0, -1.0)),
                 'rfu': np.array(((0.0, 1.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 0.0, 1.0)))}
"""{body frame: rotation to FLU}. frd: forward, right, down; rfu: right, forward, up."""

EARTH_MATRICES = {'enu': np.eye(3), 'nwu': np.array(((0.0, -1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0))),
                  'ned': np.array(((0.0, 1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, -1.0)))}
"""{frame of the earth: rotation to ENU}. nwu: north, west, up, as ENU with yaw 0 at north."""


class Frame(Record):
    """Constants of a conversion: quaternions H E and B^-1 M^-1, matrix M R."""
    left: Annotated[Floats, (4,)]
    right: Annotated[Floats, (4,)]
    rate: Matrix3


def quaternion_of(matrix):
    """Return the quaternion (x, y, z, w) of a rotation matrix (3, 3)."""
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


def mounting_matrix(roll, pitch, yaw):
    """Return the rotation case -> deck of a device that is mounted at angles [rad], FLU: yaw to port, then pitch with
    the bow down, then roll with the port side up."""
    (cr, sr), (cp, sp), (cy, sy) = ((math.cos(angle), math.sin(angle)) for angle in (roll, pitch, yaw))
    return np.array(((cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr),
                     (sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr),
                     (-sp, cp * sr, cp * cr)))


def constants(earth, body, rate_body, mounting, heading_zero):
    """Return the Frame (1,) of a device.

    earth, body, rate_body: names of frames; mounting: (roll, pitch, yaw) of its case [rad]; heading_zero: true
    heading at which the device reports 0 [rad], clockwise.
    """
    case = mounting_matrix(*mounting)
    found = Frame.zeros()
    turn = mounting_matrix(0.0, 0.0, -heading_zero)
    found['left'][0] = quaternion_of(turn @ EARTH_MATRICES[earth])
    found['right'][0] = quaternion_of((case @ BODY_MATRICES[body]).T)
    found['rate'][0] = case @ BODY_MATRICES[rate_body]
    return found


@compiled
def attitude(c, q):
    """Return the quaternion deck -> earth of the quaternion q (4,) of a device; c: record of Frame."""
    return product(product(c.left, q), c.right)


@compiled
def on_deck(c, v):
    """Return the components on the deck of a vector v (3,) in the body frame of the rates; c: record of
    Frame."""
    return (c.rate[0, 0] * v[0] + c.rate[0, 1] * v[1] + c.rate[0, 2] * v[2],
            c.rate[1, 0] * v[0] + c.rate[1, 1] * v[1] + c.rate[1, 2] * v[2],
            c.rate[2, 0] * v[0] + c.rate[2, 1] * v[1] + c.rate[2, 2] * v[2])


@compiled
def rotation_vector(a, b):
    """Return the rotation vector [rad] in the frame of the body by which it turned from the quaternion a to b."""
    x, y, z, w = product((-a[0], -a[1], -a[2], a[3]), b)
    if w < 0.0:
        x, y, z, w = -x, -y, -z, -w
    s = math.sqrt(x * x + y * y + z * z)
    k = 2.0 * math.atan2(s, w) / s if s > 0.0 else 2.0
    return k * x, k * y, k * z


@compiled
def turned(q, x, y, z):
    """Return the quaternion of a body that had the quaternion q and turned by a rotation vector (x, y, z) [rad] in the
    frame of the body."""
    angle = math.sqrt(x * x + y * y + z * z)
    k = math.sin(0.5 * angle) / angle if angle > 0.0 else 0.5
    return product(q, (k * x, k * y, k * z, math.cos(0.5 * angle)))


@compiled
def of_angles(heading, pitch, roll):
    """Return the quaternion FLU -> ENU of a heading clockwise from north, a pitch with the bow up and a roll with the
    starboard side down, all [rad]: Rz(90 deg - heading) Ry(-pitch) Rx(roll)."""
    y, p, r = 0.5 * (0.5 * math.pi - heading), -0.5 * pitch, 0.5 * roll
    yaw, level = (0.0, 0.0, math.sin(y), math.cos(y)), (0.0, math.sin(p), 0.0, math.cos(p))
    return product(product(yaw, level), (math.sin(r), 0.0, 0.0, math.cos(r)))
