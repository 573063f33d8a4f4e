"""The attitude of the deck: the INS's last measurements, interpolated or extrapolated to any instant near them."""
import math

import numpy as np

from acu_tracker.geometry import attitude_error, attitude_jump
from acu_tracker.geometry.deck_reference import Attitude
from acu_tracker.geometry.history import bracket, history_type, push
from acu_tracker.geometry.vector import vector
from pedestal_common.compiled import compiled
from pedestal_common.geometry.line_of_sight import ASHORE, rotation
from pedestal_common.geometry.quaternion import product

ATTITUDE = np.dtype([('stabilised', 'i8'), ('history', history_type(10)), ('told', 'f8', (7,)),
                     ('aligned', 'i8'), ('jump', attitude_jump.JUMP),
                     ('error', attitude_error.ERROR),
                     ('mat_ed', 'f8', (3, 3)), ('w', 'f8', (3,)), ('dw', 'f8', (3,))], align=True)
"""stabilised: 1 on a ship, 0 ashore, where the attitude never changes; history: quaternion (x, y, z, w) deck -> earth,
w [rad/s], dw [rad/s2] of the last steps, as they are believed; told: the last q and w as they came; aligned: whether
the INS was; error: how its error changes. mat_ed (deck -> earth), w, dw: at the instant that `at` was last called
for.
"""

TURNS = 1e-6
"""Rate [rad/s] of a deck from which its attitude changes from one measurement to the next."""

INVALID, REPEATED, NEW = range(3)
"""What `take` makes of an attitude."""


@compiled
def smoothed_acceleration(before, w, w_before, T, tau):
    """Angular acceleration [rad/s2] from two rates [rad/s] T [s] apart, low-passed with tau [s]; before: its value T
    ago."""
    return before + T / (tau + T) * ((w - w_before) / T - before)


@compiled
def rotation_angle(w, dw, T):
    """Angle [rad] by which the deck rotates in T [s] at a rate w [rad/s] with its derivative dw [rad/s2]."""
    return T * w + 0.5 * T * T * dw


@compiled
def rotated(q, r):
    """Quaternion (x, y, z, w) of a deck of attitude q (4,) after the rotation vector r [rad] (FLU): q (x) exp(r/2)."""
    rx, ry, rz = r
    angle = math.sqrt(rx * rx + ry * ry + rz * rz)
    k = math.sin(0.5 * angle) / angle if angle > 0.0 else 0.5
    return product(q, (k * rx, k * ry, k * rz, math.cos(0.5 * angle)))


@compiled
def _same(s, q, w):
    """Whether an INS says once more what it said before, though it says that the deck turns. Keeps what it says."""
    same, turns = True, False
    for i in range(7):
        x = q[i] if i < 4 else w[i - 4]
        same &= x == s.told[i]
        turns |= i >= 4 and abs(x) > TURNS
        s.told[i] = x
    return same and turns


@compiled
def _believe(s, row, last, T):
    """Turn the quaternion in a row of the history into the one that is believed, T [s] after that in row `last`."""
    a, b = s.history.sample[last], s.history.sample[row]
    predicted = rotated(a, (0.5 * T * (a[4] + b[4]), 0.5 * T * (a[5] + b[5]), 0.5 * T * (a[6] + b[6])))
    b[0], b[1], b[2], b[3] = attitude_jump.believed(s.jump, predicted, (b[0], b[1], b[2], b[3]), T)


@compiled
def take(s, p, t_k, stamp, q, w, aligning):
    """Take a measured quaternion q (4,) and rate w (3,) [rad/s] into the history: INVALID, REPEATED or NEW.

    INVALID: not finite, no unit quaternion, older than the last or younger than the step t_k [s], or the numbers of
    the last though the deck turns. aligning: whether the INS is, so that its attitude may jump.
    """
    norm = math.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    if not (abs(norm - 1.0) < 0.01 and math.isfinite(w[0] + w[1] + w[2])):
        return INVALID
    h = s.history
    last = h.newest
    T = stamp - h.stamp[last] if h.count > 0 else math.inf
    if not (T > 0.0 and stamp <= t_k):
        return REPEATED if T == 0.0 else INVALID
    if _same(s, q, w):
        return INVALID
    row = push(h, stamp)
    # One sign of the quaternion, so that neighbours can be averaged.
    dot = 0.0
    for i in range(4):
        dot += q[i] * h.sample[last, i]
    for i in range(4):
        h.sample[row, i] = q[i] / norm if dot >= 0.0 else -q[i] / norm
    for i in range(3):
        h.sample[row, 4 + i] = w[i]
        h.sample[row, 7 + i] = 0.0
        if T <= p.attitude_timeout:
            h.sample[row, 7 + i] = smoothed_acceleration(
                h.sample[last, 7 + i], w[i], h.sample[last, 4 + i], T, p.attitude_smoothing)
    if T <= p.attitude_timeout and s.aligned and not aligning:
        _believe(s, row, last, T)
    else:
        attitude_jump.forget(s.jump)
    s.aligned = not aligning
    return NEW


@compiled
def at(s, p, t):
    """Whether there is an attitude at t [s], between two samples or predicted from the last; `current` gives it."""
    if not s.stabilised:
        rotation(ASHORE[0], ASHORE[1], ASHORE[2], ASHORE[3], s.mat_ed)
        s.w[:] = 0.0
        s.dw[:] = 0.0
        return True
    h = s.history
    last = h.sample[h.newest]
    T = t - h.stamp[h.newest]
    if h.count == 0 or T > p.attitude_timeout:
        return False
    if T >= 0.0:
        for i in range(3):
            s.dw[i] = last[7 + i]
            s.w[i] = last[4 + i] + T * last[7 + i]
        x, y, z, w = rotated(last, (rotation_angle(last[4], last[7], T), rotation_angle(last[5], last[8], T),
                                    rotation_angle(last[6], last[9], T)))
    else:
        i, j, f = bracket(h, t)
        if i < 0:
            return False
        a, b = h.sample[i], h.sample[j]
        for k in range(3):
            s.w[k] = a[4 + k] + f * (b[4 + k] - a[4 + k])
            s.dw[k] = b[7 + k]
        x, y, z, w = a[0] + f * (b[0] - a[0]), a[1] + f * (b[1] - a[1]), a[2] + f * (b[2] - a[2]), \
            a[3] + f * (b[3] - a[3])
    norm = math.sqrt(x * x + y * y + z * z + w * w)
    rotation(x / norm, y / norm, z / norm, w / norm, s.mat_ed)
    return True


@compiled
def current(s):
    """The Attitude, deck -> earth, at the instant that `at` was last called for."""
    return Attitude(s.mat_ed, vector(s.w), vector(s.dw))
