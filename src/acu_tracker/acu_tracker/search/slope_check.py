"""Check that the receiver's errors lead to the target, before the loop is closed on them.

The mode acquire moves the beam on a small circle about the expected place of the target. The measured errors should
follow the offset of this place one for one. The matrix K of their slopes comes from a least-squares fit:

    K = S_ed S_dd^-1,    S_ed = sum (e - e') (d - d')^T,    S_dd = sum (d - d') (d - d')^T

    d, d'   offset of the expected place from the beam, and its mean over the samples [rad]
    e, e'   error of the receiver, and its mean over the samples [rad]

Each of these vectors is (cross-elevation, elevation). The diagonal of K is 1 without a fault, negative if a sign is
wrong, and cos(beta) if the axes of the errors are turned by beta. A constant error of the expected place changes only
the means, and not K.
"""
from typing import Annotated

from pedestal_common.compiled import compiled
from pedestal_common.quantities import Floats, Pair, Radians, Vector3
from pedestal_common.record import Record


class Slopes(Record):
    """State of the fit."""
    n: int          # number of samples
    d: Pair         # mean d' [rad]
    e: Pair         # mean e' [rad]
    dd: Vector3     # sum S_dd (xx, xe, ee) [rad2]
    ed: Annotated[Floats, (2, 2)]   # sum S_ed [rad2]


MIN_SLOPE = 0.5
"""Slope below which autotrack does not begin [-].

Axes that are turned by 60 deg have this slope. Such a turn uses up the phase margin of the loop.
"""

VERDICT_UNKNOWN, VERDICT_RIGHT, VERDICT_WRONG = range(3)  # verdicts of the check


@compiled
def restart(state: Slopes) -> None:
    """Clear the samples."""
    state.n = 0
    state.d[:] = 0.0
    state.e[:] = 0.0
    state.dd[:] = 0.0
    state.ed[0, 0] = state.ed[0, 1] = state.ed[1, 0] = state.ed[1, 1] = 0.0


@compiled
def take(state: Slopes, d: tuple[Radians, Radians], e: tuple[Radians, Radians]) -> None:
    """Take a sample d and e; means and sums are updated as by Welford (1962)."""
    state.n += 1
    dx, de = d[0] - state.d[0], d[1] - state.d[1]
    state.d[0] += dx / state.n
    state.d[1] += de / state.n
    rest_x, rest_e = d[0] - state.d[0], d[1] - state.d[1]
    state.dd[0] += dx * rest_x
    state.dd[1] += dx * rest_e
    state.dd[2] += de * rest_e
    for i in range(2):
        deviation = e[i] - state.e[i]
        state.e[i] += deviation / state.n
        state.ed[i, 0] += deviation * rest_x
        state.ed[i, 1] += deviation * rest_e


@compiled
def slopes(state: Slopes) -> tuple[float, float]:
    """Return the slopes (K_xx, K_ee) of cross-elevation and elevation [-].

    Both slopes are NaN until the beam has moved on both axes.
    """
    det = state.dd[0] * state.dd[2] - state.dd[1] * state.dd[1]
    return ((state.ed[0, 0] * state.dd[2] - state.ed[0, 1] * state.dd[1]) / det,
            (state.ed[1, 1] * state.dd[0] - state.ed[1, 0] * state.dd[1]) / det)


@compiled
def verdict(state: Slopes, samples: int) -> int:
    """Return VERDICT_RIGHT or VERDICT_WRONG; VERDICT_UNKNOWN with less than `samples` samples."""
    if state.n < samples:
        return VERDICT_UNKNOWN
    x, e = slopes(state)
    return VERDICT_RIGHT if x >= MIN_SLOPE and e >= MIN_SLOPE else VERDICT_WRONG
