"""An attitude that jumps: what the rates of the deck do not explain is kept apart, and let in slowly.

    p_k = b_k-1 (x) exp(w T / 2)    predicted by the rate w from the attitude b believed before
    b_k = c (x) q_k                 believed of the attitude q that is told; c = 1 as long as nothing has jumped
    c = p_k (x) q_k*                after a jump, the angle between b_k and p_k is beyond ATTITUDE_JUMP_DTYPE

(quaternions deck -> earth, so that c turns about axes of the earth). The angle of c then goes to 0 by
JUMP_DECAY_RATE_RAD_S. Whoever
tracks by the receiver does not feel a jump, whatever its size and whether it is the error or the end of one; whoever
points by the attitude goes to the new one slowly enough that somebody can look.
"""
import math

import numpy as np

from pedestal_common.compiled import compiled
from pedestal_common.geometry.quaternion import product

ATTITUDE_JUMP_DTYPE = np.dtype([('c', 'f8', (4,)), ('apart', 'i8')], align=True)
"""c: quaternion (x, y, z, w) earth -> earth; apart: 1 while it is not that of no rotation."""

MAX_UNEXPLAINED_ANGLE_RAD = 3e-3
"""That the rates must explain in a step [rad]: a rate that is wrong by 0.5 rad/s, or a hundred times the noise of an
INS."""

JUMP_DECAY_RATE_RAD_S = 1e-3
"""With which a jump is let in [rad/s]."""


@compiled
def conjugate(q):
    """The inverse of a unit quaternion."""
    return -q[0], -q[1], -q[2], q[3]


@compiled
def _half_angle(q):
    """Half of the angle [rad] of a unit quaternion, 0 to pi / 2."""
    return math.atan2(math.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2]), abs(q[3]))


@compiled
def clear(s):
    """Believe what is told."""
    s.apart = 0


@compiled
def _decay(s, T):
    """Take the angle of c down by JUMP_DECAY_RATE_RAD_S for T [s]."""
    half = _half_angle(s.c)
    left = half - 0.5 * JUMP_DECAY_RATE_RAD_S * T
    if left <= 0.0:
        s.apart = 0
        return
    k = math.sin(left) / math.sin(half) * math.copysign(1.0, s.c[3])
    s.c[0], s.c[1], s.c[2], s.c[3] = k * s.c[0], k * s.c[1], k * s.c[2], math.cos(left)


@compiled
def jump_corrected(s, predicted, told, T):
    """The quaternion that is believed of one that is told, T [s] after the one before; predicted: by the rates."""
    q = told
    if s.apart:
        _decay(s, T)
        if s.apart:
            q = product(s.c, told)
    if 2.0 * _half_angle(product(conjugate(predicted), q)) <= MAX_UNEXPLAINED_ANGLE_RAD:
        return q
    s.c[0], s.c[1], s.c[2], s.c[3] = product(predicted, conjugate(told))
    s.apart = 1
    return predicted
