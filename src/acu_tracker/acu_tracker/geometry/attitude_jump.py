"""Correction of jumps in the attitude of the INS: changes that the measured rates of the deck do not explain.

A rotation c keeps the corrected attitude continuous at a jump. Afterwards the angle of c decays slowly to 0, so that
the corrected attitude returns to the measured one.

    p_k = b_k-1 (x) exp(w T / 2)    attitude of sample k, predicted by the rate w from b_k-1
    b_k = c (x) q_k                 corrected attitude; q_k: measured by the INS; c = 1 before any jump
    c = p_k (x) q_k*                set at a jump: the angle between b_k and p_k exceeds MAX_UNEXPLAINED_ANGLE_RAD

(x) is the product of quaternions, q* the inverse of q, w the rate of the deck [rad/s], T the time between two samples
[s]. The quaternions rotate deck -> earth, so that c turns about axes of the earth. The angle of c decays at
JUMP_DECAY_RATE_RAD_S. Neither a jump of any size nor this decay disturbs tracking by the receiver. A mode that points
by the attitude follows the decay so slowly that the operator can check the new attitude.
"""
import math
from typing import Annotated

from pedestal_common.compiled import compiled
from pedestal_common.geometry.quaternion import product
from pedestal_common.quantities import Floats
from pedestal_common.record import Record


class AttitudeJump(Record):
    """c: correcting quaternion (x, y, z, w) earth -> earth; apart: 1 while c is in use, after a jump."""
    c: Annotated[Floats, (4,)]
    apart: int


MAX_UNEXPLAINED_ANGLE_RAD = 3e-3
"""Largest angle between measured and predicted attitude that is not a jump [rad].

The angle is a hundred times the noise of an INS. In a step of 5 ms a rate with an error of 0.5 rad/s gives this angle.
"""

JUMP_DECAY_RATE_RAD_S = 1e-3
"""Rate at which the angle of c decays, and with which the corrected attitude returns to the measured one [rad/s]."""


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
    """Discard c: the measured attitude is used without a correction."""
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
    """Return the corrected quaternion b_k of a measured quaternion q_k.

    predicted: p_k; measured: q_k; T: time since the sample before [s].
    """
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
