"""The attitude of the deck: its history, the correction of its jumps, and the statistics of its error.

DeckAttitude interpolates or extrapolates the last measurements of the INS to any instant near them. w, dw: angular
rate [rad/s] and angular acceleration [rad/s2] of the deck, FLU; T: time between two samples, or since the last one.

AttitudeError: noise and slow random walk of tilt (roll or pitch) and heading. The INS may publish these statistics on
ins/error; otherwise parameters define them. `receiver_error` adds the noise to the variance of each measured
direction.

AttitudeJump: jumps in the attitude of the INS are changes that the measured rates of the deck do not explain. A
rotation c keeps the corrected attitude continuous at a jump, and then decays slowly:

    p_k = b_k-1 (x) exp(w T / 2)    attitude of sample k, predicted by the rate w from b_k-1
    b_k = c (x) q_k                 corrected attitude; q_k: measured by the INS; c = 1 before any jump
    c = p_k (x) q_k*                set at a jump: the angle between b_k and p_k exceeds MAX_UNEXPLAINED_ANGLE_RAD

(x) is the product of quaternions, q* the inverse of q. The quaternions rotate deck -> earth, so that c turns about
axes of the earth. Neither a jump of any size nor the decay disturbs tracking by the receiver. A mode that points by
the attitude follows the decay so slowly that the operator can check the new attitude.
"""
import math
from typing import TYPE_CHECKING, Annotated

from acu_tracker.geometry import frames
from acu_tracker.geometry.frames import Attitude
from acu_tracker.geometry.history import HISTORY_LENGTH, History, bracket, push
from acu_tracker.geometry.vector import ZERO_VECTOR, Motion, Rotation, Vector, angles, line_of_sight, turn
from pedestal_common.compiled import compiled
from pedestal_common.geometry.line_of_sight import ASHORE_ATTITUDE
from pedestal_common.geometry.quaternion import product
from pedestal_common.quantities import (
    Bit,
    Floats,
    Pair,
    Quaternion,
    Radians,
    Radians2,
    RadiansPerSecond,
    RadiansPerSecond2,
    Seconds,
    Vector3,
    Xyz,
    Xyzw,
)
from pedestal_common.record import Record

if TYPE_CHECKING:
    from acu_tracker.estimation.params import AttitudeModelParameters
    from acu_tracker.params import SharedParameters


class AttitudeError(Record):
    """Statistics that the INS published."""
    published: Bit  # 1 after the INS published valid statistics
    noise: Pair     # variance of the white noise of a sample, of (tilt, heading) [rad2]
    walk: Pair      # growth of the variance by the random walk of the error, of (tilt, heading) [rad2/s]


MAX_ATTITUDE_NOISE = 0.5  # largest accepted 1-sigma of the noise [rad] and of the random walk [rad/sqrt(s)]


@compiled
def take_statistics(error: AttitudeError, noise: Vector3, walk: Vector3) -> bool:
    """Adopt the statistics that the INS published; return False, without a change, if a number is out of range. noise,
    walk: 1-sigma of roll, pitch and heading [rad], and of their random walk [rad/sqrt(s)]."""
    for i in range(3):
        if not (0.0 <= noise[i] <= MAX_ATTITUDE_NOISE and 0.0 <= walk[i] <= MAX_ATTITUDE_NOISE):
            return False
    error.noise[0], error.noise[1] = 0.5 * (noise[0] * noise[0] + noise[1] * noise[1]), noise[2] * noise[2]
    error.walk[0], error.walk[1] = 0.5 * (walk[0] * walk[0] + walk[1] * walk[1]), walk[2] * walk[2]
    error.published = 1
    return True


@compiled
def expected_error(error: AttitudeError,
                   model: 'AttitudeModelParameters') -> tuple[tuple[Radians2, Radians2], tuple[float, float]]:
    """Return ((noise of tilt, of heading), (walk of tilt, of heading) [rad2/s]), by `model` if the INS published none.
    The slow errors of `model` are Gauss-Markov processes with the standard deviation sigma and the correlation time
    tau (wander_time). Their variance first grows by 2 sigma^2 / tau."""
    if error.published:
        return (error.noise[0], error.noise[1]), (error.walk[0], error.walk[1])
    k = 2.0 / model.wander_time
    return ((model.tilt_noise * model.tilt_noise, model.heading_noise * model.heading_noise),
            (k * model.tilt_wander * model.tilt_wander, k * model.heading_wander * model.heading_wander))


class AttitudeJump(Record):
    """Correction of the attitude after a jump."""
    c: Quaternion   # correcting quaternion earth -> earth
    apart: Bit      # 1 while c is in use, after a jump


MAX_UNEXPLAINED_ANGLE_RAD = 3e-3
"""Largest angle between measured and predicted attitude that is not a jump [rad]: a hundred times the noise of an INS.
In a step of 5 ms a rate with an error of 0.5 rad/s gives this angle."""

JUMP_DECAY_RATE_RAD_S = 1e-3  # rate at which the angle of c decays [rad/s]


@compiled
def conjugate(q: Xyzw) -> Xyzw:
    """Return the inverse of a unit quaternion."""
    return -q[0], -q[1], -q[2], q[3]


@compiled
def _half_angle(q: Xyzw | Quaternion) -> Radians:
    return math.atan2(math.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2]), abs(q[3]))


@compiled
def _decay(jump: AttitudeJump, T: Seconds) -> None:
    half = _half_angle(jump.c)
    left = half - 0.5 * JUMP_DECAY_RATE_RAD_S * T
    if left <= 0.0:
        jump.apart = 0
        return
    k = math.sin(left) / math.sin(half) * math.copysign(1.0, jump.c[3])
    jump.c[0], jump.c[1], jump.c[2], jump.c[3] = k * jump.c[0], k * jump.c[1], k * jump.c[2], math.cos(left)


@compiled
def jump_corrected(jump: AttitudeJump, predicted: Xyzw, measured: Xyzw, T: Seconds) -> Xyzw:
    """Return the corrected quaternion b_k; predicted: p_k; measured: q_k; T: time since the sample before."""
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


class AttitudeHistory(History):
    """Last samples after the correction of jumps: quaternion (x, y, z, w) deck -> earth, w, dw."""
    sample: Annotated[Floats, (HISTORY_LENGTH, 10)]


class DeckAttitude(Record):
    """Measured attitude of the deck."""
    stabilised: Bit         # 1 on a ship; 0 ashore, where the attitude never changes
    history: AttitudeHistory
    sample: Annotated[Floats, (7,)]     # last quaternion and w as received
    aligned: Bit            # 1 if the INS was aligned at the last sample
    jump: AttitudeJump
    error: AttitudeError


RATE_COLUMN, ACCELERATION_COLUMN = 4, 7  # first columns of w and of dw in a sample

MIN_TURN_RATE_RAD_S = 1e-6  # rate of the deck above which its attitude must change from one measurement to the next

UNKNOWN_VECTOR = Vector(math.nan, math.nan, math.nan)  # vector without a value

SAMPLE_INVALID, SAMPLE_REPEATED, SAMPLE_NEW = range(3)
"""Outcomes of `take`: the sample is unusable, has the stamp of the last sample, or is kept."""


@compiled
def put(deck: DeckAttitude, stabilised: Bit) -> bool:
    """Set whether the pedestal is on a ship (stabilised) or ashore; return True if this is a change."""
    new = deck.stabilised != stabilised
    deck.stabilised = stabilised
    return new


@compiled
def newest(deck: DeckAttitude) -> Floats:
    """Return the last sample (10,) of the history: quaternion, w, dw."""
    return deck.history.sample[deck.history.newest]


@compiled
def smoothed_acceleration(before: RadiansPerSecond2, w: RadiansPerSecond, w_before: RadiansPerSecond, T: Seconds,
                          tau: Seconds) -> RadiansPerSecond2:
    """Return one component of dw, the difference of two rates T apart, low-passed by tau; before: its value T ago."""
    return before + T / (tau + T) * ((w - w_before) / T - before)


@compiled
def rotation_angle(w: RadiansPerSecond, dw: RadiansPerSecond2, T: Seconds) -> Radians:
    """Return the angle by which the deck rotates about one axis in T, from a rate w that grows by dw."""
    return T * w + 0.5 * T * T * dw


@compiled
def rotated(q: Xyzw | Quaternion, r: Xyz) -> Xyzw:
    """Return q (x) exp(r/2): a deck of attitude q after a rotation by the vector r [rad], FLU."""
    rx, ry, rz = r
    angle = math.sqrt(rx * rx + ry * ry + rz * rz)
    k = math.sin(0.5 * angle) / angle if angle > 0.0 else 0.5
    return product(q, (k * rx, k * ry, k * rz, math.cos(0.5 * angle)))


@compiled
def _repeats(deck: DeckAttitude, q: Quaternion, w: Vector3) -> bool:
    """Keep a sample; return True if it repeats the previous one although its rates show a turning deck."""
    same, turns = True, False
    for i in range(7):
        x = q[i] if i < 4 else w[i - 4]
        same &= x == deck.sample[i]
        turns |= i >= 4 and abs(x) > MIN_TURN_RATE_RAD_S
        deck.sample[i] = x
    return same and turns


@compiled
def _vector(sample: Floats, column: int) -> Vector:
    return Vector(sample[column], sample[column + 1], sample[column + 2])


@compiled
def _correct_jump(deck: DeckAttitude, row: int, last: int, T: Seconds) -> None:
    """Correct the quaternion in a row of the history for a jump; row `last` holds the sample T before it. The mean of
    the rates of both samples predicts the quaternion."""
    a, b = deck.history.sample[last], deck.history.sample[row]
    w_a, w_b = _vector(a, RATE_COLUMN), _vector(b, RATE_COLUMN)
    predicted = rotated(a, (0.5 * T * (w_a.x + w_b.x), 0.5 * T * (w_a.y + w_b.y), 0.5 * T * (w_a.z + w_b.z)))
    b[0], b[1], b[2], b[3] = jump_corrected(deck.jump, predicted, (b[0], b[1], b[2], b[3]), T)


@compiled
def take(deck: DeckAttitude, params: 'SharedParameters', t_k: Seconds, stamp: Seconds, q: Quaternion, w: Vector3,
         aligning: Bit) -> int:
    """Take a measured quaternion q and rate w into the history at the step t_k; return one of SAMPLE_.

    A sample is invalid if it is not finite, or its quaternion has not the length 1. A sample older than the last one
    or later than the step is invalid as well. So is a sample that equals the last one while the deck turns. While the
    INS is `aligning`, its attitude may jump.
    """
    norm = math.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    if not (abs(norm - 1.0) < 0.01 and math.isfinite(w[0] + w[1] + w[2])):
        return SAMPLE_INVALID
    h = deck.history
    last = h.newest
    T = stamp - h.stamp[last] if h.count > 0 else math.inf
    if not (T > 0.0 and stamp <= t_k):
        return SAMPLE_REPEATED if T == 0.0 else SAMPLE_INVALID
    if _repeats(deck, q, w):
        return SAMPLE_INVALID
    row = push(h, stamp)
    # Neighbouring quaternions get the same sign, so that they can be averaged.
    dot = 0.0
    for i in range(4):
        dot += q[i] * h.sample[last, i]
    for i in range(4):
        h.sample[row, i] = q[i] / norm if dot >= 0.0 else -q[i] / norm
    for i in range(3):
        h.sample[row, RATE_COLUMN + i] = w[i]
        h.sample[row, ACCELERATION_COLUMN + i] = 0.0
        if T <= params.attitude_timeout:
            h.sample[row, ACCELERATION_COLUMN + i] = smoothed_acceleration(
                h.sample[last, ACCELERATION_COLUMN + i], w[i], h.sample[last, RATE_COLUMN + i], T,
                params.attitude_smoothing)
    if T <= params.attitude_timeout and deck.aligned and not aligning:
        _correct_jump(deck, row, last, T)
    else:
        deck.jump.apart = 0
    deck.aligned = not aligning
    return SAMPLE_NEW


@compiled
def at(deck: DeckAttitude, params: 'SharedParameters', t: Seconds) -> tuple[bool, Attitude]:
    """Return (True if the attitude at t is known, the Attitude deck -> earth, of NaN if it is unknown). The attitude
    is interpolated between two samples, or predicted from the last sample for at most attitude_timeout. Ashore it is
    constant and always known."""
    if not deck.stabilised:
        return True, Attitude(turn(ASHORE_ATTITUDE[0], ASHORE_ATTITUDE[1], ASHORE_ATTITUDE[2], ASHORE_ATTITUDE[3]),
                              ZERO_VECTOR, ZERO_VECTOR)
    h = deck.history
    last = h.sample[h.newest]
    T = t - h.stamp[h.newest]
    i, j, f = (h.newest, h.newest, 0.0) if T >= 0.0 else bracket(h, t)
    if h.count == 0 or T > params.attitude_timeout or i < 0:
        return False, Attitude(Rotation(UNKNOWN_VECTOR, UNKNOWN_VECTOR, UNKNOWN_VECTOR), UNKNOWN_VECTOR,
                               UNKNOWN_VECTOR)
    if T >= 0.0:
        w_last, dw = _vector(last, RATE_COLUMN), _vector(last, ACCELERATION_COLUMN)
        rate = Vector(w_last.x + T * dw.x, w_last.y + T * dw.y, w_last.z + T * dw.z)
        x, y, z, w = rotated(last, (rotation_angle(w_last.x, dw.x, T), rotation_angle(w_last.y, dw.y, T),
                                    rotation_angle(w_last.z, dw.z, T)))
    else:
        a, b = h.sample[i], h.sample[j]
        w_a, w_b, dw = _vector(a, RATE_COLUMN), _vector(b, RATE_COLUMN), _vector(b, ACCELERATION_COLUMN)
        rate = Vector(w_a.x + f * (w_b.x - w_a.x), w_a.y + f * (w_b.y - w_a.y), w_a.z + f * (w_b.z - w_a.z))
        x, y, z, w = a[0] + f * (b[0] - a[0]), a[1] + f * (b[1] - a[1]), a[2] + f * (b[2] - a[2]), \
            a[3] + f * (b[3] - a[3])
    norm = math.sqrt(x * x + y * y + z * z + w * w)
    return True, Attitude(turn(x / norm, y / norm, z / norm, w / norm), rate, dw)


@compiled
def on_deck(deck: DeckAttitude, params: 'SharedParameters', t: Seconds, motion: Motion) -> Motion:
    """Return the Motion in deck angles at t of one in earth angles; unchanged ashore or without an attitude."""
    known, now = at(deck, params, t)
    if deck.stabilised and known:
        return angles(frames.on_deck(now, line_of_sight(motion)))
    return motion
