"""The attitude of the deck: what the INS said, what it is at any instant near it, and how a target looks from there.

`s` is the unit's STATE.
"""
import math

from acu_tracker.geometry import deck_reference, estimate_frame
from acu_tracker.history import bracket, push
from acu_tracker.lookahead import ahead
from pedestal_common.compiled import assign, compiled
from pedestal_common.line_of_sight import ASHORE, rotation


@compiled
def take_attitude(s, p, u):
    """Remember a new attitude with its rate and low-passed angular acceleration; False where it is unusable."""
    q, w = u.quaternion, u.deck_rate
    norm = math.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    if not (u.attitude_valid and abs(norm - 1.0) < 0.01 and math.isfinite(w[0] + w[1] + w[2])):
        return False
    h = s.attitude
    last = h.newest
    T = u.attitude_stamp - h.stamp[last] if h.count > 0 else math.inf
    if not (T > 0.0 and u.attitude_stamp <= u.stamp):
        return T == 0.0
    row = push(h, u.attitude_stamp)
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
            h.sample[row, 7 + i] = deck_reference.smoothed_acceleration(
                h.sample[last, 7 + i], w[i], h.sample[last, 4 + i], T, p.attitude_smoothing)
    if s.aligning:
        # Its heading is still being looked for: the mean begins with the one that is found.
        s.ahead.latest = -math.inf
    ahead.take_attitude(s.ahead, u.attitude_stamp, h.sample[row, :4], p.keyhole.mean_time)
    return True


@compiled
def attitude_at(s, p, t):
    """Set s.mat_ed, s.w, s.dw to the attitude at t: between two samples, or predicted from the last one; ashore it is
    always the same."""
    if not s.stabilised:
        rotation(ASHORE[0], ASHORE[1], ASHORE[2], ASHORE[3], s.mat_ed)
        s.w[:] = 0.0
        s.dw[:] = 0.0
        return True
    h = s.attitude
    last = h.sample[h.newest]
    T = t - h.stamp[h.newest]
    if h.count == 0 or T > p.attitude_timeout:
        return False
    if T >= 0.0:
        for i in range(3):
            s.dw[i] = last[7 + i]
            s.w[i] = last[4 + i] + T * last[7 + i]
        x, y, z, w = deck_reference.turned(
            last[0], last[1], last[2], last[3], deck_reference.turn(last[4], last[7], T),
            deck_reference.turn(last[5], last[8], T), deck_reference.turn(last[6], last[9], T))
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
def estimate_from_deck(s, p, t, A, dA, ddA, E, dE, ddE):
    """Deck angles of a target at t, given in the frame of the filter."""
    if not s.frame.tilted and s.range == 0.0:
        return seen_from_deck(s, p, t, A, dA, ddA, E, dE, ddE)
    attitude_at(s, p, t)
    estimate_frame.from_deck(s.frame, s.mat_ed, s.mat_fd)
    return deck_reference.moving_angles(*deck_reference.from_lever_arm(
        s.arm[0], s.arm[1], s.arm[2], *deck_reference.deck_motion(
            s.mat_fd, s.w[0], s.w[1], s.w[2], s.dw[0], s.dw[1], s.dw[2], A, dA, ddA, E, dE, ddE)))


@compiled
def seen_from_deck(s, p, t, A, dA, ddA, E, dE, ddE):
    """Deck angles of a target at t, given in earth angles."""
    if s.stabilised and attitude_at(s, p, t):
        return deck_reference.deck_angles(s.mat_ed, s.w[0], s.w[1], s.w[2], s.dw[0], s.dw[1], s.dw[2],
                                          A, dA, ddA, E, dE, ddE)
    return A, dA, ddA, E, dE, ddE


@compiled
def levelled(s, framed, A, dA, ddA, E, dE, ddE):
    """Azimuth on the levelled deck of a plan, (A, dA, ddA), of what `followed` gave."""
    if framed:
        estimate_frame.from_deck(s.frame, s.ahead.level, s.mat_fd)
    else:
        assign(s.mat_fd, s.ahead.level)
    A, dA, ddA, _, _, _ = deck_reference.deck_angles(s.mat_fd, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, A, dA, ddA, E, dE, ddE)
    return A, dA, ddA


@compiled
def deck_rates(s, p, t):
    """(azimuth, elevation) rate at which a fixed target where the beam is seems to move because the deck does; 0 where
    nobody compensates for it."""
    wanted = p.azimuth.beam.rate_compensation != 0.0 or p.elevation.beam.rate_compensation != 0.0
    if wanted and s.stabilised and attitude_at(s, p, t):
        return deck_reference.fixed_rates(s.w[0], s.w[1], s.w[2], s.azimuth.position, s.elevation.position)
    return 0.0, 0.0
