"""Jumps of the attitude: a change that the rates of the deck do not explain is separated, and admitted slowly.

    p_k = b_k-1 (x) exp(w T / 2)    predicted by the rate w from the corrected attitude b of the step before
    b_k = c (x) q_k                 corrected attitude, q measured by the INS; c = 1 before any jump
    c = p_k (x) q_k*                after a jump: the angle between b_k and p_k exceeds MAX_UNEXPLAINED_ANGLE_RAD

(x) is the product of quaternions, q* the inverse of q, T the time of a step. The quaternions rotate deck -> earth, so
that c turns about axes of the earth. The angle of c then decays to 0 at JUMP_DECAY_RATE_RAD_S. A jump does not disturb
tracking by the receiver, whatever its size, at its begin or at its end. A mode that points by the attitude moves to
the new one so slowly that the operator can check it.
"""
import math

import numpy as np

from pedestal_common.compiled import compiled
from pedestal_common.geometry.quaternion import product

ATTITUDE_JUMP_DTYPE = np.dtype([('c', 'f8', (4,)), ('apart', 'i8')], align=True)
"""c: quaternion (x, y, z, w) earth -> earth; apart: 1 while c is in use."""

MAX_UNEXPLAINED_ANGLE_RAD = 3e-3
"""Largest change in a step that the rates need not explain [rad]: that of a rate with an error of 0.5 rad/s, or a
hundred times the noise of an INS."""

JUMP_DECAY_RATE_RAD_S = 1e-3
"""Rate at which a jump is admitted [rad/s]."""


@compiled
def conjugate(q):
    """Return the inverse of a unit quaternion."""
    return -q[0], -q[1], -q[2], q[3]


@compiled
def _half_angle(q):
    """Return half of the angle [rad] of a unit quaternion, 0 to pi / 2."""
    return math.atan2(math.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2]), abs(q[3]))


@compiled
def clear(s):
    """Use the measured attitude without a correction."""
    s.apart = 0


@compiled
def _decay(s, T):
    """Reduce the angle of c by JUMP_DECAY_RATE_RAD_S for T [s]."""
    half = _half_angle(s.c)
    left = half - 0.5 * JUMP_DECAY_RATE_RAD_S * T
    if left <= 0.0:
        s.apart = 0
        return
    k = math.sin(left) / math.sin(half) * math.copysign(1.0, s.c[3])
    s.c[0], s.c[1], s.c[2], s.c[3] = k * s.c[0], k * s.c[1], k * s.c[2], math.cos(left)


@compiled
def jump_corrected(s, predicted, measured, T):
    """Return the corrected quaternion of a measured one, T [s] after the one before; predicted: by the rates."""
    q = measured
    if s.apart:
        _decay(s, T)
        if s.apart:
            q = product(s.c, measured)
    if 2.0 * _half_angle(product(conjugate(predicted), q)) <= MAX_UNEXPLAINED_ANGLE_RAD:
        return q
    s.c[0], s.c[1], s.c[2], s.c[3] = product(predicted, conjugate(measured))
    s.apart = 1
    return predicted
