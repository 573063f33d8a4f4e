"""Wrong slope of the receiver, against the program: a sum of likelihood ratios.

WrongSlope of `monitors` must find the motion of the target in the errors. Where a program tells the motion, the
direction of the target less that of the program is almost a straight line, also if the program is late or has an
offset. Then the small motion of the beam about this line shows the slope, before the beam is off the target.

    a, b    innovations of beam less program, and of the error, from lines through the last means of both. Their
            components are across the beam and divided by the noise, as complex numbers a_x + i a_e, b_x + i b_e
    x       |a + W b|^2 / 2: squared innovation, per axis, of the target's direction if the receiver has applied the
            wrong slope W^-1; W = 1: of the right slope

For a turn W = exp(i beta) a block adds to the logarithm of the likelihood ratio

    (|a + b|^2 - |a + W b|^2) / 2 = Re (1 - W) b a*

and for a reversed sign 2 a_x b_x or 2 a_e b_e. Page's sum S of these steps never falls below 0 (Page, Continuous
inspection schemes, Biometrika 41 (1954) 100). Under the right slope S exceeds its limit once in exp(limit) blocks or
less often (Lorden, Annals of Mathematical Statistics 42 (1971) 1897), whatever the beam does. CAUTION times the
step of an error that repeats the motion of the beam is subtracted, because errors of the attitude move the beam alone.

All this is true of a target that keeps to its program. Therefore a sum stays 0 while the program turns, while target
and program part, and while W for 0.5 s, or the right slope for 5 s, does not explain the errors. A target that leaves
a program which it kept to within the noise can look like a wrong slope (`test_slope_ratio.py`).
"""
import math
from typing import Annotated

from acu_tracker.geometry.vector import Vector, dot
from pedestal_common.compiled import compiled
from pedestal_common.quantities import Floats, Radians2, Seconds
from pedestal_common.record import Record

_TURNS = tuple((math.cos(math.radians(beta)), math.sin(math.radians(beta)))
               for beta in (90.0, 112.5, 135.0, 157.5, 180.0, 202.5, 225.0, 247.5, 270.0))  # real, imaginary part of W
HYPOTHESIS_COUNT = 2 + len(_TURNS)  # reversed sign of cross-elevation, of elevation, then turns of 90 to 270 deg


class SlopeRatio(Record):
    """State of the test."""
    stamp: Seconds      # of the last block
    n: int              # number of blocks in the lines
    line: Annotated[Floats, (6, 2)]     # value and rate [1/s] of beam less program and of the error, ENU
    hold: int           # number of blocks until the sums may grow
    right: float        # mean x of the right slope [-]
    wrong: Annotated[Floats, (HYPOTHESIS_COUNT,)]   # mean x of each hypothesis [-]
    S: Annotated[Floats, (HYPOTHESIS_COUNT,)]       # sum of each hypothesis [-]


LINE_BLOCK_COUNT = 500
"""Number of blocks in the memory of a line: 10 s. A line through less time follows the beam that departs."""

MIN_LINE_BLOCK_COUNT = 50   # number of blocks before the first verdict: 1 s
MAX_ACCELERATION = math.radians(0.06)   # largest acceleration of a program in use: a satellite in a low orbit [rad/s2]
MAX_WALK = 0.01     # largest walk of the attitude, over the variance of a block [1/s]: a tenth of it in the memory
MAX_PARTING_RATE = math.radians(0.05)   # largest rate between target and program [rad/s]; 2 s late: 0.02 deg/s
RIGHT_BLOCK_COUNT, MAX_RIGHT_X = 250, 1.2   # number of blocks in the mean x of the right slope; its limit [-]
WRONG_BLOCK_COUNT, MAX_WRONG_X = 25, 1.5    # the same of a hypothesis
HOLD_BLOCK_COUNT = 500  # number of blocks for which the sums stay 0 after the target has left its program
MAX_BLOCK_X = 12.0  # largest x of one block that noise can explain [-]
MAX_S = 15.0
"""Largest sum of a right slope [-]. `pedestal study wrong-slope` states the largest one of its targets."""

CAUTION = 0.1   # share of a step that is subtracted [-]


@compiled
def restart(state: SlopeRatio) -> None:
    """Clear the memory."""
    state.n = state.hold = 0


@compiled
def _innovation(state: SlopeRatio, i: int, y: float, T: Seconds) -> float:
    """Update line i with y, T after the last one; return the innovation of y. The gains are those of a least-squares
    fit to n blocks, as in monitors."""
    n = state.n
    if n == 1:
        state.line[i, 0], state.line[i, 1] = y, 0.0
        return 0.0
    expected = state.line[i, 0] + T * state.line[i, 1]
    nu = y - expected
    state.line[i, 0] = expected + 2.0 * (2 * n - 1) / (n * (n + 1.0)) * nu
    state.line[i, 1] += 6.0 / (n * (n + 1.0) * T) * nu
    return nu


@compiled
def _add(state: SlopeRatio, h: int, step: float, x: float, possible: bool) -> bool:
    """Add a step to the sum of hypothesis h, with its x; return True if the hypothesis explains the block."""
    state.wrong[h] += (min(x, MAX_BLOCK_X) - state.wrong[h]) / WRONG_BLOCK_COUNT
    explained = x < MAX_BLOCK_X
    state.S[h] = max(0.0, state.S[h] + step) if possible and explained and state.wrong[h] < MAX_WRONG_X else 0.0
    return explained


@compiled
def take(state: SlopeRatio, t: Seconds, u: Vector, e: Vector, across: Vector, up: Vector, sigma2: Radians2) -> bool:
    """Take the means of a block which ends at t; return True if the slope is wrong.

    u: direction of the beam less that of the program; e: error, both ENU; across, up: unit vectors across the beam;
    sigma2: variance of the mean of the errors.
    """
    T = t - state.stamp
    state.stamp = t
    state.n = min(state.n + 1, LINE_BLOCK_COUNT)
    if state.n == 1:
        state.S[:] = 0.0
        state.right, state.wrong[:] = 1.0, 1.0
    a = Vector(_innovation(state, 0, u.x, T), _innovation(state, 1, u.y, T), _innovation(state, 2, u.z, T))
    b = Vector(_innovation(state, 3, e.x, T), _innovation(state, 4, e.y, T), _innovation(state, 5, e.z, T))
    if state.n < 4:
        return False
    w = 1.0 / math.sqrt(sigma2 * (1.0 + 4.0 / state.n))     # the innovation of a line has 1 + 4/n times the variance
    a_x, a_e, b_x, b_e = w * dot(a, across), w * dot(a, up), w * dot(b, across), w * dot(b, up)
    power, c, d = a_x * a_x + a_e * a_e, a_x * b_x + a_e * b_e, a_x * b_e - a_e * b_x   # b a* = c + i d
    both = 0.5 * (power + b_x * b_x + b_e * b_e)
    state.right += (min(both + c, MAX_BLOCK_X) - state.right) / RIGHT_BLOCK_COUNT
    parting = Vector(state.line[0, 1], state.line[1, 1], state.line[2, 1])
    state.hold = HOLD_BLOCK_COUNT if state.right > MAX_RIGHT_X else max(0, state.hold - 1)
    possible = state.hold == 0 and dot(parting, parting) < MAX_PARTING_RATE**2
    explained = _add(state, 0, 2.0 * a_x * (b_x - CAUTION * a_x), (a_x - b_x)**2, possible)
    explained = _add(state, 1, 2.0 * a_e * (b_e - CAUTION * a_e), (a_e - b_e)**2, possible) or explained
    for h in range(HYPOTHESIS_COUNT - 2):
        cosine, sine = _TURNS[h]
        turned = cosine * c - sine * d      # Re W b a*
        step = c - turned - CAUTION * (1.0 - cosine) * power
        explained = _add(state, 2 + h, step, both + turned, possible) or explained
    if not explained and both + c > MAX_BLOCK_X:
        state.n, state.hold = 0, HOLD_BLOCK_COUNT     # a jump of the program or of the target
    return state.n > MIN_LINE_BLOCK_COUNT and state.S.max() > MAX_S
