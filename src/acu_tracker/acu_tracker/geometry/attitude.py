"""The attitude of the deck: the last measurements of the INS,
interpolated or extrapolated to any instant near them.

w, dw: angular rate [rad/s] and angular acceleration [rad/s2] of the deck, FLU; T: time between two samples, or
since the last sample.
"""
import math
from typing import TYPE_CHECKING, Annotated

from acu_tracker.geometry import attitude_error, attitude_jump, deck_reference
from acu_tracker.geometry.deck_reference import ZERO_VECTOR, Attitude
from acu_tracker.geometry.history import HISTORY_LENGTH, History, bracket, push
from acu_tracker.geometry.motion import Motion, angles, line_of_sight
from acu_tracker.geometry.vector import Rotation, Vector, turn
from pedestal_common.compiled import compiled
from pedestal_common.geometry.line_of_sight import ASHORE_ATTITUDE, product
from pedestal_common.quantities import (
    Bit,
    Floats,
    Quaternion,
    Radians,
    RadiansPerSecond,
    RadiansPerSecond2,
    Seconds,
    Vector3,
    Xyz,
    Xyzw,
)
from pedestal_common.record import Record

if TYPE_CHECKING:
    from acu_tracker.params import SharedParameters


class AttitudeHistory(History):
    """Last samples after the correction of jumps: quaternion (x, y, z, w) deck -> earth, w, dw."""
    sample: Annotated[Floats, (HISTORY_LENGTH, 10)]


class DeckAttitude(Record):
    """Measured attitude of the deck."""
    stabilised: Bit         # 1 on a ship; 0 ashore, where the attitude never changes
    history: AttitudeHistory
    sample: Annotated[Floats, (7,)]     # last quaternion and w as received
    aligned: Bit            # 1 if the INS was aligned at the last sample
    jump: attitude_jump.AttitudeJump
    error: attitude_error.AttitudeError


RATE_COLUMN, ACCELERATION_COLUMN = 4, 7
"""First columns of w and of dw in a sample of the history; the quaternion is in columns 0 to 3."""

MIN_TURN_RATE_RAD_S = 1e-6
"""Rate of the deck [rad/s] above which its attitude must change from one measurement to the next."""

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
    """Return one component of dw, the low-passed difference of two rates.

    before       smoothed acceleration T ago
    w, w_before  rate now and T ago
    tau          time constant of the low-pass
    """
    return before + T / (tau + T) * ((w - w_before) / T - before)


@compiled
def rotation_angle(w: RadiansPerSecond, dw: RadiansPerSecond2, T: Seconds) -> Radians:
    """Return the angle by which the deck rotates about one axis in T, from a rate w that grows by dw."""
    return T * w + 0.5 * T * T * dw


@compiled
def rotated(q: Xyzw | Quaternion, r: Xyz) -> Xyzw:
    """Return the quaternion (x, y, z, w) of a deck that had the attitude q and rotated by the vector r [rad].

    r is in FLU. The result is q (x) exp(r/2); (x) is the product of quaternions.
    """
    rx, ry, rz = r
    angle = math.sqrt(rx * rx + ry * ry + rz * rz)
    k = math.sin(0.5 * angle) / angle if angle > 0.0 else 0.5
    return product(q, (k * rx, k * ry, k * rz, math.cos(0.5 * angle)))


@compiled
def _repeats(deck: DeckAttitude, q: Quaternion, w: Vector3) -> bool:
    """Keep a sample of the INS: quaternion q and rate w.

    Return True if the sample equals the previous one although its rates show a turning deck. Such an INS repeats its
    last message.
    """
    same, turns = True, False
    for i in range(7):
        x = q[i] if i < 4 else w[i - 4]
        same &= x == deck.sample[i]
        turns |= i >= 4 and abs(x) > MIN_TURN_RATE_RAD_S
        deck.sample[i] = x
    return same and turns


@compiled
def _vector(sample: Floats, column: int) -> Vector:
    """Return the Vector in three columns of a sample, the first of which is `column`."""
    return Vector(sample[column], sample[column + 1], sample[column + 2])


@compiled
def _correct_jump(deck: DeckAttitude, row: int, last: int, T: Seconds) -> None:
    """Correct the quaternion in a row of the history for a jump; row `last` holds the sample T before it.

    The mean of the rates of both samples predicts the quaternion.
    """
    a, b = deck.history.sample[last], deck.history.sample[row]
    w_a, w_b = _vector(a, RATE_COLUMN), _vector(b, RATE_COLUMN)
    predicted = rotated(a, (0.5 * T * (w_a.x + w_b.x), 0.5 * T * (w_a.y + w_b.y), 0.5 * T * (w_a.z + w_b.z)))
    b[0], b[1], b[2], b[3] = attitude_jump.jump_corrected(deck.jump, predicted, (b[0], b[1], b[2], b[3]), T)


@compiled
def take(deck: DeckAttitude, params: 'SharedParameters', t_k: Seconds, stamp: Seconds, q: Quaternion, w: Vector3,
         aligning: Bit) -> int:
    """Take a measured quaternion q and rate w [rad/s] into the history; return SAMPLE_INVALID, SAMPLE_REPEATED or
    SAMPLE_NEW.

    A sample is invalid if it is not finite, or its quaternion has not the length 1. A sample older than the last one
    or later than the step is invalid as well. So is a sample that equals the last one while the deck turns. A sample
    with the stamp of the last one is a repeated sample.

    t_k       stamp of the step
    stamp     stamp of the sample
    aligning  True while the INS aligns; its attitude may then jump
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
        attitude_jump.clear(deck.jump)
    deck.aligned = not aligning
    return SAMPLE_NEW


@compiled
def at(deck: DeckAttitude, params: 'SharedParameters', t: Seconds) -> tuple[bool, Attitude]:
    """Return (True if the attitude at t is known, the Attitude deck -> earth, of NaN if it is unknown).

    The attitude is interpolated between two samples, or predicted from the last sample for at most attitude_timeout.
    Ashore it is constant and always known.
    """
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
    """Return the Motion in deck angles at t of a Motion in earth angles.

    Ashore, or without a known attitude, return the Motion unchanged.
    """
    known, now = at(deck, params, t)
    if deck.stabilised and known:
        return angles(deck_reference.on_deck(now, line_of_sight(motion)))
    return motion
