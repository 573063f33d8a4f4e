"""The keyhole: search of a pass near the zenith that the azimuth cannot follow, and the best slew through it.

A target that passes near the zenith of the deck needs the azimuth rate W / cos E0, which the axis does not have. W:
rate of the target along its great circle [rad/s]; E0: the highest elevation of the target [rad]. The axis therefore
leaves the target at t1, slews at its limits, and meets the target again at t2 on the other side, in either direction
of turn. For each direction t1 is chosen for the least loss of signal, and t2 is the earliest possible time.
"""
import math
from collections.abc import MutableSequence
from typing import NamedTuple

from acu_tracker.lookahead import path as paths
from acu_tracker.lookahead import slew as slews
from acu_tracker.lookahead.path import Path
from acu_tracker.lookahead.slew import Slew
from pedestal_common.compiled import compiled
from pedestal_common.geometry.line_of_sight import wrap
from pedestal_common.quantities import Radians, RadiansPerSecond, RadiansPerSecond2, Seconds
from pedestal_common.record import Record


class SlewLimits(Record):
    """Limits of a slew."""
    rate: RadiansPerSecond              # largest azimuth rate
    acceleration: RadiansPerSecond2     # of the azimuth
    low: Radians                        # least azimuth
    high: Radians                       # largest azimuth
    highest: Radians                    # largest elevation
    half_beam: Radians                  # half the beamwidth


SLEW_CANDIDATE_COUNT, REFINEMENT_COUNT, SLEW_SAMPLE_COUNT, BISECTION_COUNT = 48, 4, 160, 24
"""Effort of a plan: number of candidates for t1, of refinements of t1, of samples in which a slew is evaluated, and of
bisections for t2."""

MIN_GAIN_S = 0.02  # least gain [s] for which a renewed plan replaces begin and direction of the previous one

PLAN_NO_KEYHOLE, PLAN_SLEW, PLAN_NO_WRAP, PLAN_BEYOND_PATH = range(4)
"""Outcomes of `plan`: no keyhole; a planned slew; no azimuth wrap inside the limits; a keyhole that ends beyond the
path."""


class Passage(NamedTuple):
    """A keyhole that needs a slew."""
    path: Path          # completed
    azimuth: Radians    # azimuth of the axis at the first row of the path
    limits: SlewLimits
    after: Seconds      # time from which the axis can follow the target again
    # rms tilt of the deck about one horizontal axis; the tilt is normally distributed. A slew follows only a share of
    # it, see _evaluate
    tilt: Radians


class Keyhole(NamedTuple):
    """Keyhole of a path."""
    first: int      # first and last row of the path between which the axis cannot follow the target; -1: no keyhole
    last: int
    needed: RadiansPerSecond    # largest azimuth rate of the target there


@compiled
def _fit(slew: Slew, passage: Passage, turn: float, t1: Seconds) -> bool:
    """Fit a slew that leaves the target at t1 and meets it as early as possible after passage.after; return False if
    there is none. turn: 1 clockwise, -1 counter-clockwise.

    The function tries t2 at the end of the path, then at passage.after. Then it bisects between `early`, which is too
    early, and `late`, which is possible. The azimuth at t1 is set within +-pi.
    """
    path, limits = passage.path, passage.limits
    A1, v1 = paths.azimuth_at(path, t1, limits.rate)
    early, late, v = passage.after, path.t0 + (len(path.rows) - 1) * path.h, math.inf
    for i in range(BISECTION_COUNT):
        t2 = late if i == 0 else early if i == 1 else 0.5 * (early + late)
        A2, v2 = paths.azimuth_at(path, t2, limits.rate)
        D = turn * (A2 - A1)
        D -= 2.0 * math.pi * math.floor(D / (2.0 * math.pi))
        tried = slews.peak_rate(D, t2 - t1, turn * v1, turn * v2, limits.acceleration)
        if tried <= limits.rate:
            late, v = t2, tried
            slew.t2, slew.azimuth2, slew.rate2 = t2, A1 + turn * D, v2
            if i == 1:
                break
        elif i == 0:
            return False
        else:
            early = t2
    slew.t1, slew.azimuth1, slew.rate1 = t1, A1, v1
    slew.peak, slew.acceleration = turn * v, limits.acceleration
    # `slew.azimuth_at` accelerates from both ends to the peak. A slew whose peak is below the rate
    # at an end would have to decelerate first, and is rejected. The tolerance covers rounding.
    return v >= max(turn * v1, turn * slew.rate2) - 1e-6 * limits.rate


@compiled
def _unwrap(slew: Slew, path: Path, azimuth: Radians) -> None:
    """Put a fitted slew on the azimuth wrap of the axis; azimuth: angle of the axis at the first row of the path."""
    first = path.rows[int((slew.t1 - path.t0) / path.h), paths.AZIMUTH_COLUMN]
    revolutions = math.floor((azimuth - path.rows[0, paths.AZIMUTH_COLUMN]) / (2.0 * math.pi) + 0.5)
    start = 2.0 * math.pi * revolutions + first + wrap(slew.azimuth1 - first)
    slew.azimuth2 += start - slew.azimuth1
    slew.azimuth1 = start


@compiled
def _fits(slew: Slew, path: Path, low: Radians, high: Radians) -> bool:
    """Return True if an unwrapped slew and the travel of the path after it stay inside low..high."""
    i = min(int((slew.t2 - path.t0) / path.h) + 1, len(path.rows) - 1)
    met = path.rows[i]
    # Difference of the wraps of the slew and of the path at the row where they meet.
    offset = slew.azimuth2 - met[paths.AZIMUTH_COLUMN]
    return (low <= min(slew.azimuth1, offset + met[paths.LEAST_AZIMUTH_COLUMN])
            and max(slew.azimuth1, offset + met[paths.LARGEST_AZIMUTH_COLUMN]) <= high)


@compiled
def _evaluate(slew: Slew, passage: Passage, samples: int) -> None:
    """Set the fields cost, loss and worst of a fitted slew; samples: number of instants at which it is evaluated.

        cost   integral of x^8 / (1 + x^8) over the slew [s]; x: pointing offset in half beamwidths. This smooth form
               of the loss also ranks slews without a loss
        loss   integral of the probability that the target is more than half a beamwidth off the beam [s]

    The slew follows only the share `true_deck_share` of the tilt of the deck. The rest of the tilt is a normally
    distributed offset, which adds to the pointing offset. Therefore loss contains the error function of a distance
    over sqrt(2) standard deviations.
    """
    limits = passage.limits
    T = (slew.t2 - slew.t1) / samples
    cost = loss = worst = 0.0
    for i in range(samples):
        t = slew.t1 + (i + 0.5) * T
        u, _ = paths.at(passage.path, t)
        offset = slews.pointing_offset(slews.azimuth_at(slew, t).angle, u, limits.highest)
        x2 = (offset / limits.half_beam)**2
        x8 = x2 * x2 * x2 * x2
        cost += T * x8 / (1.0 + x8)
        worst = max(worst, offset)
        share = slews.true_deck_share(slew, t).angle
        scale = math.sqrt(2.0) * max(passage.tilt * (1.0 - share), 1e-9)     # 1e-9 avoids a division by zero.
        loss += T * (1.0 - 0.5 * (math.erf((limits.half_beam - offset) / scale)
                                  + math.erf((limits.half_beam + offset) / scale)))
    slew.cost, slew.loss, slew.worst = cost, loss, worst


@compiled
def _attempt(slew: Slew, passage: Passage, turn: float, t1: Seconds, samples: int) -> tuple[bool, Seconds]:
    """Fit, unwrap and evaluate a slew that leaves the target at t1. Return (feasible, cost: inf outside the
    limits)."""
    if t1 < passage.path.t0 or not _fit(slew, passage, turn, t1):
        return False, math.inf
    _unwrap(slew, passage.path, passage.azimuth)
    if not _fits(slew, passage.path, passage.limits.low, passage.limits.high):
        return True, math.inf
    _evaluate(slew, passage, samples)
    return True, slew.cost


@compiled
def find(path: Path, rate: RadiansPerSecond, acceleration: RadiansPerSecond2) -> Keyhole:
    """Return the first Keyhole of a path, where the target exceeds the azimuth rate or acceleration. Two excesses
    belong to two keyholes if the time between them is longer than the time of half a revolution."""
    first, last, needed, before = -1, -1, 0.0, 0.0
    for i in range(1, len(path.rows)):
        dA = (path.rows[i, paths.AZIMUTH_COLUMN] - path.rows[i - 1, paths.AZIMUTH_COLUMN]) / path.h
        if abs(dA) > rate or (i > 1 and abs(dA - before) > acceleration * path.h):
            if first >= 0 and (i - last) * path.h > math.pi / rate:
                break
            first = i - 1 if first < 0 else first
            last, needed = i, max(needed, abs(dA))
        before = dA
    return Keyhole(first, last, needed)


@compiled
def _search(trial: Slew, passage: Passage, turn: float, t_in: Seconds) -> tuple[bool, Seconds]:
    """Put the best slew of one direction into `trial`; t_in: instant at which the keyhole begins.

    Return (True if a slew meets the target before the path ends, even outside the limits; the least cost). The cost is
    inf if no slew is inside the limits.
    """
    # t1 is searched from t_in back by the time of a whole revolution, because an earlier t1 has no advantage.
    step = min(t_in - passage.path.t0, 2.0 * math.pi / passage.limits.rate) / SLEW_CANDIDATE_COUNT
    feasible, centre, cost = False, t_in - 0.5 * SLEW_CANDIDATE_COUNT * step, math.inf
    for level in range(REFINEMENT_COUNT + 1):
        # The first level covers the whole interval, the next levels are finer about the best t1 so far. The last level
        # repeats the best slew with more samples.
        around = 0 if level == REFINEMENT_COUNT else SLEW_CANDIDATE_COUNT // 2 if level == 0 else 4
        middle = centre
        for k in range(-around, around + 1):
            t1 = min(middle + k * step, t_in)
            samples = SLEW_SAMPLE_COUNT if around > 0 else 10 * SLEW_SAMPLE_COUNT
            possible, here = _attempt(trial, passage, turn, t1, samples)
            feasible |= possible
            if here < cost:
                centre, cost = t1, here
        if cost == math.inf:
            break
        step *= 0.25
    return feasible, cost


@compiled
def _set_culmination(slew: Slew, path: Path, keyhole: Keyhole) -> None:
    top = keyhole.first
    for i in range(keyhole.first, keyhole.last + 1):
        top = i if path.rows[i, paths.UP_COLUMN] > path.rows[top, paths.UP_COLUMN] else top
    slew.culmination = path.t0 + top * path.h
    slew.highest = math.asin(min(path.rows[top, paths.UP_COLUMN], 1.0))


@compiled
def plan(work: MutableSequence[Slew], path: Path, azimuth: Radians, limits: SlewLimits, tilt: Radians, previous: Slew,
         planned: bool) -> int:
    """Find the keyhole of a completed Path and the best slew through it; return one of the outcomes PLAN_.

    work      two slews, the first for the best slew, the second for trials
    previous  the previous plan, if planned is True
    planned   True if there is a previous plan whose slew has not begun
    The other arguments are those of Passage.

    Slews with different t1 may cost the same. The previous t1 and direction therefore stay in force until another slew
    costs less by MIN_GAIN_S.

    The effort is bounded. For each of the two directions the first level of _search evaluates SLEW_CANDIDATE_COUNT + 1
    slews of SLEW_SAMPLE_COUNT samples. Each of the next REFINEMENT_COUNT - 1 levels evaluates 9 such slews. The last
    level evaluates one slew with ten times as many samples.
    """
    keyhole = find(path, limits.rate, limits.acceleration)
    if keyhole.first < 0:
        return PLAN_NO_KEYHOLE
    best, trial = work[0], work[1]
    t_in, t_out = path.t0 + keyhole.first * path.h, path.t0 + keyhole.last * path.h
    passage = Passage(path, azimuth, limits, t_out, tilt)
    own_travel = path.rows[keyhole.last, paths.AZIMUTH_COLUMN] - path.rows[keyhole.first, paths.AZIMUTH_COLUMN]
    # Side 0 is the direction in which the target itself turns. least: cost of the better direction; other: cost of the
    # other direction.
    least = other = math.inf
    for side in range(2):
        feasible, cost = _search(trial, passage, math.copysign(1.0, own_travel) * (1.0 - 2.0 * side), t_in)
        if side == 0 and not feasible:
            return PLAN_BEYOND_PATH
        if cost < math.inf:
            other = max(least, cost)
            # If the costs of both directions are equal within 0.1 %, the slew turns as the target does.
            if trial.cost < 0.999 * least:
                least = trial.cost
                trial.long_way = side
                work[0] = trial
    if least == math.inf:
        return PLAN_NO_WRAP
    turn, t1 = math.copysign(1.0, previous.peak), min(previous.t1, t_in)
    if planned and _attempt(trial, passage, turn, t1, 10 * SLEW_SAMPLE_COUNT)[1] < least + MIN_GAIN_S:
        trial.long_way = 1 if turn * own_travel < 0.0 else 0
        other = least if trial.long_way != best.long_way else other
        work[0] = trial
    _set_culmination(best, path, keyhole)
    best.needed, best.other_cost = keyhole.needed, other
    return PLAN_SLEW
