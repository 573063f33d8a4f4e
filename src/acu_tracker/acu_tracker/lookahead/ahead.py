"""What lies ahead of the deck: a keyhole to be slewed through, sectors that hide the target.

Once in INTERVAL the path of the target is laid out on the levelled deck, `horizon` seconds of it: from the program
track, in autotrack turned so that it begins at the estimate, or along the great circle of the estimate where there is
no program. The levelled deck is the mean attitude of the ship; a plan keeps the one it was made for.
"""
import math

import numpy as np

from acu_tracker.geometry import deck_reference
from acu_tracker.lookahead import keyhole
from acu_tracker.program import bridge, program_track
from pedestal_common.blockage import blocked
from pedestal_common.compiled import assign, compiled
from pedestal_common.line_of_sight import angles, rotation, to_deck, wrap

ROWS = 1025
INTERVAL = 1.0
"""Seconds from one look ahead to the next."""

WHATS = ('none', 'keyhole', 'no turn')
NONE, KEYHOLE, NO_TURN = range(len(WHATS))

AHEAD = np.dtype([
    ('mean', 'f8', (4,)), ('spread', 'f8'), ('since', 'f8'), ('latest', 'f8'),
    ('looked', 'f8'), ('what', 'i8'), ('number', 'i8'), ('motion', 'f8'),
    ('plan', keyhole.PLAN), ('tried', keyhole.PLAN), ('trial', keyhole.PLAN), ('level', 'f8', (3, 3)),
    ('next_level', 'f8', (3, 3)), ('path', 'f8', (ROWS, 6)),
    ('hidden', 'f8', (2,)), ('hidden_number', 'i8'), ('program', 'f8', (7,)),
], align=True)
"""mean, spread: mean attitude and mean square [rad2] of the deck's tilt from it, `latest` the stamp of the last;
looked: when the path was last laid out; what: one of WHATS; number: of the plan, counted; plan: while `what` is
KEYHOLE; level: levelled deck -> earth of the plan; hidden: from when until when [s] a sector will hide the target,
NaN none; hidden_number: counted; program: what `another_program` knows the table by."""


@compiled
def forget(h):
    """Nothing is planned any more."""
    h.what = NONE
    h.looked = -math.inf
    h.hidden[:] = math.nan


@compiled
def another_program(h, times, table):
    """Whether the table is another one than at the call before: by its number of rows and by its first and last."""
    last = len(times) - 1
    same = h.program[0] == last
    h.program[0] = last
    for i in range(6 if last >= 0 else 0):
        row = 0 if i < 3 else last
        value = times[row] if i % 3 == 0 else table[row, i % 3 - 1]
        same = same and h.program[1 + i] == value
        h.program[1 + i] = value
    return not same


@compiled
def take_attitude(h, stamp, quaternion, mean_time):
    """Move the mean attitude by a new one (4,). A ship whose mean is not known yet is taken to be level."""
    if not h.latest > -math.inf:
        h.since = stamp
        heading = math.hypot(quaternion[2], quaternion[3])
        h.mean[0] = h.mean[1] = 0.0
        h.mean[2], h.mean[3] = quaternion[2] / heading, quaternion[3] / heading
        h.spread = 0.0
    else:
        T = stamp - h.latest
        share = T / (mean_time + T)
        dot = 0.0
        for i in range(4):
            dot += h.mean[i] * quaternion[i]
        norm = 0.0
        for i in range(4):
            h.mean[i] += share * (math.copysign(1.0, dot) * quaternion[i] - h.mean[i])
            norm += h.mean[i] * h.mean[i]
        for i in range(4):
            h.mean[i] /= math.sqrt(norm)
        a, b = h.mean, quaternion
        x = 2.0 * (b[0] * b[2] - b[3] * b[1] - a[0] * a[2] + a[3] * a[1])
        y = 2.0 * (b[1] * b[2] + b[3] * b[0] - a[1] * a[2] - a[3] * a[0])
        h.spread += T / (min(stamp - h.since, mean_time) + T) * (x * x + y * y - h.spread)
    h.latest = stamp


@compiled
def lay_out(h, b, t0, step, times, table, from_program, e, n, u, de, dn, du):
    """Fill the path from t0 on, on h.next_level; how many rows there are: as far as the program goes.

    b: the `bridge` by which the program is turned, none: as it is. Without the program the great circle of the ENU
    unit vector (e, n, u) and its rate [1/s].
    """
    W = math.sqrt(de * de + dn * dn + du * du)
    for i in range(ROWS):
        t = t0 + i * step
        if from_program:
            if t > times[-1]:
                return i
            x, y, z = program_track.direction(times, table, t)
            if b.there:
                x, y, z = bridge.turned(b, x, y, z)
        else:
            cos, sin = math.cos(W * i * step), math.sin(W * i * step) / W if W > 0.0 else 0.0
            x, y, z = cos * e + sin * de, cos * n + sin * dn, cos * u + sin * du
        h.path[i, 0], h.path[i, 1], h.path[i, 2] = to_deck(h.next_level, x, y, z)
    return ROWS


@compiled
def look(h, b, p, sectors, t0, turn, times, table, from_program, e, n, u, de, dn, du):
    """Look for a keyhole and hidden sectors from t0 on; p the AcuParameters, turn: deck azimuth of the axis at t0, the
    rest as in `lay_out`.

    A plan is kept once its slew begins within `notice`, or as soon as it is known that no turn of the azimuth fits.
    """
    q, k = h.mean, p.keyhole
    h.looked = t0
    rotation(q[0], q[1], q[2], q[3], h.next_level)
    step = k.horizon / (ROWS - 1)
    rows = lay_out(h, b, t0, step, times, table, from_program, e, n, u, de, dn, du)
    if rows < 3:
        return
    path = h.path[:rows]
    below, above = 0.0, 0.0
    if from_program and t0 + rows * step < times[-1]:
        below, above = program_track.azimuth_travel(times, table, t0 + (rows - 1) * step)
    keyhole.complete(path, below, above)
    look_for_sectors(h, sectors, path, t0, step)
    r, a = p.azimuth.shaper, p.azimuth.limits
    found = keyhole.plan(h.tried, h.trial, path, t0, step, turn, k.share * r.rate, k.share * r.acceleration, a.low,
                         a.high, p.elevation.limits.high - k.elevation_margin, 0.5 * p.tracker.receiver.beamwidth,
                         math.sqrt(0.5 * h.spread))
    if found == keyhole.AHEAD and h.tried.t1 - t0 <= k.notice:
        keyhole.copy(h.tried, h.plan)
        h.plan.culmination, h.plan.highest, h.plan.needed = h.tried.culmination, h.tried.highest, h.tried.needed
        h.plan.other_cost = h.tried.other_cost
        assign(h.level, h.next_level)
        h.motion = math.sqrt(h.spread)
        h.what = KEYHOLE
        h.number += 1
    elif found == keyhole.NO_TURN and h.what != NO_TURN:
        h.what = NO_TURN
        h.number += 1
    elif found == keyhole.NOTHING:
        h.what = NONE


@compiled
def look_for_sectors(h, sectors, path, t0, step):
    """The first time that a path is hidden; announced when it begins after the last one has ended."""
    first = last = -1
    for i in range(len(path)):
        A, E = angles(path[i, 0], path[i, 1], path[i, 2])
        if blocked(sectors, A, E):
            first = i if first < 0 else first
            last = i
        elif first >= 0:
            break
    if first < 0:
        h.hidden[:] = math.nan
    else:
        begin = t0 + first * step
        if not begin <= h.hidden[1]:        # NaN: there was none
            h.hidden_number += 1
        h.hidden[0], h.hidden[1] = begin, t0 + last * step


@compiled
def slewing(h, t):
    """Whether a plan is under way at t."""
    return h.what == KEYHOLE and h.plan.t1 <= t <= h.plan.t2


@compiled
def through(h, t, A, dA, ddA, E, dE, ddE, B, dB, ddB, highest):
    """What to follow at t of a plan under way: deck (A, dA, ddA, E, dE, ddE), and the angle [rad] off the target.

    A ... ddE: the target on the true deck; B, dB, ddB: its azimuth on the levelled one. The slew is that of the
    levelled deck; at its ends it meets the target on the true one, in between their difference means nothing.
    """
    plan = h.plan
    a, da, dda = keyhole.slew(plan, t)
    g, dg, ddg = keyhole.true_deck_share(plan, t)
    D = wrap(A - B)
    a += g * D
    da += dg * D + g * (dA - dB)
    dda += ddg * D + 2.0 * dg * (dA - dB) + g * (ddA - ddB)
    e, n, u, de, dn, du, dde, ddn, ddu = deck_reference.moving_direction(A, dA, ddA, E, dE, ddE)
    E, dE, ddE = deck_reference.best_elevation(a, da, dda, n, -e, u, dn, -de, du, ddn, -dde, ddu)
    if E > highest:
        E, dE, ddE = highest, 0.0, 0.0
    return a, da, dda, E, dE, ddE, keyhole.off_beam(a, n, -e, u, highest)
