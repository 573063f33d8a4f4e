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

from pedestal_common.compiled import compiled
from pedestal_common.geometry.line_of_sight import product
from pedestal_common.quantities import Bit, Quaternion, Radians, Seconds, Xyzw
from pedestal_common.record import Record


class AttitudeJump(Record):
    """Correction of the attitude after a jump."""
    c: Quaternion   # correcting quaternion earth -> earth
    apart: Bit      # 1 while c is in use, after a jump


MAX_UNEXPLAINED_ANGLE_RAD = 3e-3
"""Largest angle between measured and predicted attitude that is not a jump [rad].

The angle is a hundred times the noise of an INS. In a step of 5 ms a rate with an error of 0.5 rad/s gives this angle.
"""

JUMP_DECAY_RATE_RAD_S = 1e-3
"""Rate at which the angle of c decays, and with which the corrected attitude returns to the measured one [rad/s]."""


@compiled
def conjugate(q: Xyzw) -> Xyzw:
    """Return the inverse of a unit quaternion."""
    return -q[0], -q[1], -q[2], q[3]


@compiled
def _half_angle(q: Xyzw | Quaternion) -> Radians:
    """Return half of the angle of a unit quaternion, 0 to pi / 2."""
    return math.atan2(math.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2]), abs(q[3]))


@compiled
def clear(jump: AttitudeJump) -> None:
    """Discard c: the measured attitude is used without a correction."""
    jump.apart = 0


@compiled
def _decay(jump: AttitudeJump, T: Seconds) -> None:
    """Reduce the angle of c by JUMP_DECAY_RATE_RAD_S for T."""
    half = _half_angle(jump.c)
    left = half - 0.5 * JUMP_DECAY_RATE_RAD_S * T
    if left <= 0.0:
        jump.apart = 0
        return
    k = math.sin(left) / math.sin(half) * math.copysign(1.0, jump.c[3])
    jump.c[0], jump.c[1], jump.c[2], jump.c[3] = k * jump.c[0], k * jump.c[1], k * jump.c[2], math.cos(left)


@compiled
def jump_corrected(jump: AttitudeJump, predicted: Xyzw, measured: Xyzw, T: Seconds) -> Xyzw:
    """Return the corrected quaternion b_k of a measured quaternion q_k.

    predicted: p_k; measured: q_k; T: time since the sample before.
    """
    q = measured
    if jump.apart:
        _decay(jump, T)
        if jump.apart:
            q = product(jump.c, measured)
    if 2.0 * _half_angle(product(conjugate(predicted), q)) <= MAX_UNEXPLAINED_ANGLE_RAD:
        return q
    jump.c[0], jump.c[1], jump.c[2], jump.c[3] = product(predicted, conjugate(measured))
    jump.apart = 1
    return predicted
