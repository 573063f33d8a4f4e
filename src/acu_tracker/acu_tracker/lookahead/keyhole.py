"""Through the zenith of the deck, where a target asks for more azimuth rate (W / cos E0) than the axis has.

The axis leaves the target at t1, turns as fast as it may, and meets it again at t2 on the other side; the elevation
meanwhile takes the angle at which the beam is closest to the target. For each way round t1 is chosen so that least
signal is lost; t2 follows from it.

A path (n, 6) is the target in the frame of the levelled deck (FLU), one row every h seconds from t0: the unit vector,
and by `complete` its azimuth counted through all turns, the least and the largest azimuth from there to the end.
"""
import math

import numpy as np

from pedestal_common.compiled import compiled
from pedestal_common.line_of_sight import wrap

PLAN = np.dtype([('t1', 'f8'), ('t2', 'f8'), ('azimuth1', 'f8'), ('azimuth2', 'f8'), ('rate1', 'f8'),
                 ('rate2', 'f8'), ('peak', 'f8'), ('acceleration', 'f8'),
                 ('culmination', 'f8'), ('highest', 'f8'), ('needed', 'f8'),
                 ('loss', 'f8'), ('worst', 'f8'), ('cost', 'f8'), ('other_cost', 'f8'), ('long_way', 'i8')],
                align=True)
"""The slew: leaves the target at t1 [s] with azimuth1, rate1, meets it at t2; peak: its largest rate, signed;
culmination [s] and highest: elevation there on the levelled deck; needed: largest azimuth rate following would take;
loss: expected time [s] further than half a beamwidth off; worst: largest angle off [rad]; cost: share of signal
lost, in seconds, other_cost: of the other way round, inf where the limits forbid it; long_way: 1 where the slew goes
against the target's own way."""

CANDIDATES, LEVELS, SAMPLES, BISECTIONS = 48, 4, 160, 24

NOTHING, AHEAD, NO_TURN, BEYOND = range(4)
"""What `plan` found: no keyhole, one that is planned for, one that no turn of the limits lets through, one whose end
lies beyond the path."""


@compiled
def along(path, t0, h, t):
    """(x, y, z, dx, dy, dz) of the path at t, in straight lines between its rows."""
    i = min(max(int((t - t0) / h), 0), len(path) - 2)
    f = (t - t0) / h - i
    dx, dy, dz = path[i + 1, 0] - path[i, 0], path[i + 1, 1] - path[i, 1], path[i + 1, 2] - path[i, 2]
    return (path[i, 0] + f * dx, path[i, 1] + f * dy, path[i, 2] + f * dz, dx / h, dy / h, dz / h)


@compiled
def azimuth_of(path, t0, h, t, rate):
    """(azimuth, its rate within +-rate) of the path at t."""
    x, y, _, dx, dy, _ = along(path, t0, h, t)
    dA = (y * dx - x * dy) / max(x * x + y * y, 1e-12)
    return math.atan2(-y, x), min(max(dA, -rate), rate)


@compiled
def off_beam(azimuth, x, y, z, highest):
    """Angle [rad] between a target and the beam at a deck azimuth whose elevation, at most `highest`, is the best."""
    sa, ca = math.sin(azimuth), math.cos(azimuth)
    b, c = ca * x - sa * y, sa * x + ca * y
    if math.atan2(z, b) <= highest:
        return math.atan2(abs(c), math.hypot(b, z))
    p, q = math.cos(highest) * b + math.sin(highest) * z, math.sin(highest) * b - math.cos(highest) * z
    return math.atan2(math.hypot(q, c), p)


@compiled
def peak_rate(D, T, v1, v2, a):
    """Cruising rate of a slew by D in T that begins at v1, ends at v2 and changes rate by a; inf where T is too short.

    D = v T - (v - v1)^2 / (2 a) - (v - v2)^2 / (2 a), the smaller root of v.
    """
    half = 0.5 * (v1 + v2 + a * T)
    root = half * half - 0.5 * (v1 * v1 + v2 * v2) - a * D
    return half - math.sqrt(root) if root >= 0.0 else math.inf


@compiled
def slew(plan, t):
    """(azimuth, rate, acceleration) of a PLAN at t1 <= t <= t2."""
    sign = math.copysign(1.0, plan.peak)
    a = sign * plan.acceleration
    begun, left = t - plan.t1, plan.t2 - t
    rise, fall = (plan.peak - plan.rate1) / a, (plan.peak - plan.rate2) / a
    if begun < rise:
        return plan.azimuth1 + begun * (plan.rate1 + 0.5 * a * begun), plan.rate1 + a * begun, a
    if left < fall:
        return plan.azimuth2 - left * (plan.rate2 + 0.5 * a * left), plan.rate2 + a * left, -a
    return plan.azimuth1 + 0.5 * (plan.rate1 + plan.peak) * rise + plan.peak * (begun - rise), plan.peak, 0.0


@compiled
def begin(plan, path, t0, h, way, t1, after, last, rate, acceleration):
    """Lay a slew from t1 to the first instant, from `after` to `last`, at which it meets the target; False: none.

    way: 1 clockwise, -1 the other way round. azimuth1 is within pi.
    """
    A1, v1 = azimuth_of(path, t0, h, t1, rate)
    early, late, v = after, last, math.inf
    for i in range(BISECTIONS):
        t2 = late if i == 0 else early if i == 1 else 0.5 * (early + late)
        A2, v2 = azimuth_of(path, t0, h, t2, rate)
        D = way * (A2 - A1)
        D -= 2.0 * math.pi * math.floor(D / (2.0 * math.pi))
        tried = peak_rate(D, t2 - t1, way * v1, way * v2, acceleration)
        if tried <= rate:
            late, v = t2, tried
            plan.t2, plan.azimuth2, plan.rate2 = t2, A1 + way * D, v2
            if i == 1:
                break
        elif i == 0:
            return False
        else:
            early = t2
    plan.t1, plan.azimuth1, plan.rate1 = t1, A1, v1
    plan.peak, plan.acceleration = way * v, acceleration
    return v >= max(way * v1, way * plan.rate2) - 1e-6 * rate


@compiled
def true_deck_share(plan, t):
    """(g, dg, ddg) [1, 1/s, 1/s2]: how far a slew follows the true deck at t, 1 at its ends, 0 in its middle."""
    T = plan.t2 - plan.t1
    x = 1.0 - 2.0 * (t - plan.t1) / T
    return x**4, -8.0 * x**3 / T, 48.0 * x * x / (T * T)


@compiled
def judge(plan, path, t0, h, highest, half_beam, tilt, samples):
    """Set what a laid slew costs: cost = integral of x^8 / (1 + x^8), x in half beamwidths (the loss made smooth, and
    still a choice where nothing is lost); loss; worst. tilt: of the deck [rad rms about one axis], normally
    distributed, which a slew cannot follow.
    """
    T = (plan.t2 - plan.t1) / samples
    cost = loss = worst = 0.0
    for i in range(samples):
        t = plan.t1 + (i + 0.5) * T
        x, y, z, _, _, _ = along(path, t0, h, t)
        here = off_beam(slew(plan, t)[0], x, y, z, highest)
        x2 = (here / half_beam)**2
        x8 = x2 * x2 * x2 * x2
        cost += T * x8 / (1.0 + x8)
        worst = max(worst, here)
        sigma = math.sqrt(2.0) * max(tilt * (1.0 - true_deck_share(plan, t)[0]), 1e-9)
        loss += T * (1.0 - 0.5 * (math.erf((half_beam - here) / sigma) + math.erf((half_beam + here) / sigma)))
    plan.cost, plan.loss, plan.worst = cost, loss, worst


@compiled
def complete(path, below, above):
    """Fill the azimuth columns of a path; below, above: what the azimuth travels once the path has ended [rad]."""
    n = len(path)
    before = math.atan2(-path[0, 1], path[0, 0])
    path[0, 3] = before
    for i in range(1, n):
        before += wrap(math.atan2(-path[i, 1], path[i, 0]) - before)
        path[i, 3] = before
    path[n - 1, 4], path[n - 1, 5] = before + below, before + above
    for i in range(n - 2, -1, -1):
        path[i, 4], path[i, 5] = min(path[i, 3], path[i + 1, 4]), max(path[i, 3], path[i + 1, 5])


@compiled
def seat(plan, path, t0, h, turn):
    """Put a laid slew on the turn of the axis, which is near `turn` at the first row of the path."""
    first = path[int((plan.t1 - t0) / h), 3]
    turns = math.floor((turn - path[0, 3]) / (2.0 * math.pi) + 0.5)
    start = 2.0 * math.pi * turns + first + wrap(plan.azimuth1 - first)
    plan.azimuth2 += start - plan.azimuth1
    plan.azimuth1 = start


@compiled
def fits(plan, path, t0, h, low, high):
    """Whether a seated slew and the travel of the path after it stay inside low..high."""
    i = min(int((plan.t2 - t0) / h) + 1, len(path) - 1)
    end = plan.azimuth2 - path[i, 3]
    return low <= min(plan.azimuth1, end + path[i, 4]) and max(plan.azimuth1, end + path[i, 5]) <= high


@compiled
def find(path, h, rate, acceleration):
    """(first row, last row, largest rate) between which following a path takes more than rate or acceleration;
    rows -1 for none. What comes later than half a turn at that rate after is another keyhole.
    """
    first, last, needed, before = -1, -1, 0.0, 0.0
    for i in range(1, len(path)):
        dA = (path[i, 3] - path[i - 1, 3]) / h
        if abs(dA) > rate or (i > 1 and abs(dA - before) > acceleration * h):
            if first >= 0 and (i - last) * h > math.pi / rate:
                break
            first = i - 1 if first < 0 else first
            last, needed = i, max(needed, abs(dA))
        before = dA
    return first, last, needed


@compiled
def attempt(trial, path, t0, h, turn, way, t1, after, rate, acceleration, low, high, highest, half_beam, tilt,
            samples):
    """Lay, seat and judge a slew that leaves at t1: (laid at all, its cost, inf where it does not fit the limits)."""
    if t1 < t0 or not begin(trial, path, t0, h, way, t1, after, t0 + (len(path) - 1) * h, rate, acceleration):
        return False, math.inf
    seat(trial, path, t0, h, turn)
    if not fits(trial, path, t0, h, low, high):
        return True, math.inf
    judge(trial, path, t0, h, highest, half_beam, tilt, samples)
    return True, trial.cost


@compiled
def plan(best, trial, path, t0, h, turn, rate, acceleration, low, high, highest, half_beam, tilt):
    """Find the keyhole of a completed path and the best slew through it: NOTHING, AHEAD, NO_TURN or BEYOND.

    best, trial: PLAN records, filled. turn: azimuth of the axis at the first row. rate, acceleration: what the slew
    may use. low, high: limits of the azimuth; highest: of the elevation; tilt: see `judge`. Bounded: two ways round,
    CANDIDATES + 9 LEVELS slews of SAMPLES each.
    """
    first, last, needed = find(path, h, rate, acceleration)
    if first < 0:
        return NOTHING
    t_in, t_out = t0 + first * h, t0 + last * h
    natural = path[last, 3] - path[first, 3]
    # Leaving earlier than a whole turn takes cannot help.
    width = min(t_in - t0, 2.0 * math.pi / rate) / CANDIDATES
    laid, least, other = False, math.inf, math.inf
    for side in range(2):
        way = math.copysign(1.0, natural) * (1.0 - 2.0 * side)
        centre, cost, step = t_in - 0.5 * CANDIDATES * width, math.inf, width
        for level in range(LEVELS + 1):
            # All of it, then ever closer about the best so far, at last that one with more samples.
            around = 0 if level == LEVELS else CANDIDATES // 2 if level == 0 else 4
            middle = centre
            for k in range(-around, around + 1):
                t1 = min(middle + k * step, t_in)
                possible, here = attempt(trial, path, t0, h, turn, way, t1, t_out, rate, acceleration, low, high,
                                         highest, half_beam, tilt, SAMPLES if around > 0 else 10 * SAMPLES)
                laid |= possible and side == 0
                if here < cost:
                    centre, cost = t1, here
            if cost == math.inf:
                break
            step *= 0.25
        if not laid:
            return BEYOND
        if cost < math.inf:
            other = max(least, cost)
            # Where both cost the same, the target's own way.
            if trial.cost < 0.999 * least:
                least = trial.cost
                trial.long_way = side
                copy(trial, best)
    if least == math.inf:
        return NO_TURN
    top = first
    for i in range(first, last + 1):
        top = i if path[i, 2] > path[top, 2] else top
    best.culmination, best.highest, best.needed = t0 + top * h, math.asin(min(path[top, 2], 1.0)), needed
    best.other_cost = other
    return AHEAD


@compiled
def copy(a, b):
    """The slew of one PLAN record into another."""
    b.t1, b.t2, b.azimuth1, b.azimuth2, b.rate1, b.rate2 = a.t1, a.t2, a.azimuth1, a.azimuth2, a.rate1, a.rate2
    b.peak, b.acceleration, b.loss, b.worst, b.cost, b.long_way = (a.peak, a.acceleration, a.loss, a.worst, a.cost,
                                                                  a.long_way)
