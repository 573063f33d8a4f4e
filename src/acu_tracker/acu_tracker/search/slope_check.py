"""Check that the receiver's errors lead to the target, before the loop is closed on them.

The mode acquire moves the beam on a small circle about the expected place of the target. The measured errors should
follow the offset of this place one for one. The matrix K of their slopes comes from a least-squares fit:

    K = S_ed S_dd^-1,    S_ed = sum (e - e') (d - d')^T,    S_dd = sum (d - d') (d - d')^T

    d, d'   offset of the expected place from the beam, and its mean over the samples [rad]
    e, e'   error of the receiver, and its mean over the samples [rad]

Each of these vectors is (cross-elevation, elevation). The diagonal of K is 1 without a fault, negative if a sign is
wrong, and cos(beta) if the axes of the errors are turned by beta. A constant error of the expected place changes only
the means, and not K.

s: record of Slopes.
"""
from typing import Annotated

from pedestal_common.compiled import compiled
from pedestal_common.quantities import Floats, Pair, Vector3
from pedestal_common.record import Record


class Slopes(Record):
    """n: number of samples; d, e: their means d', e' [rad]; dd, ed: the sums S_dd (xx, xe, ee) and S_ed [rad2]."""
    n: int
    d: Pair
    e: Pair
    dd: Vector3
    ed: Annotated[Floats, (2, 2)]


MIN_SLOPE = 0.5
"""Slope below which autotrack does not begin [-].

Axes that are turned by 60 deg have this slope. Such a turn uses up the phase margin of the loop.
"""

VERDICT_UNKNOWN, VERDICT_RIGHT, VERDICT_WRONG = range(3)  # verdicts of the check


@compiled
def restart(s):
    """Clear the samples."""
    s.n = 0
    s.d[:] = 0.0
    s.e[:] = 0.0
    s.dd[:] = 0.0
    s.ed[0, 0] = s.ed[0, 1] = s.ed[1, 0] = s.ed[1, 1] = 0.0


@compiled
def take(s, d, e):
    """Take a sample d and e; means and sums are updated as by Welford (1962)."""
    s.n += 1
    dx, de = d[0] - s.d[0], d[1] - s.d[1]
    s.d[0] += dx / s.n
    s.d[1] += de / s.n
    rest_x, rest_e = d[0] - s.d[0], d[1] - s.d[1]
    s.dd[0] += dx * rest_x
    s.dd[1] += dx * rest_e
    s.dd[2] += de * rest_e
    for i in range(2):
        deviation = e[i] - s.e[i]
        s.e[i] += deviation / s.n
        s.ed[i, 0] += deviation * rest_x
        s.ed[i, 1] += deviation * rest_e


@compiled
def slopes(s):
    """Return the slopes (K_xx, K_ee) of cross-elevation and elevation [-].

    Both slopes are NaN until the beam has moved on both axes.
    """
    det = s.dd[0] * s.dd[2] - s.dd[1] * s.dd[1]
    return ((s.ed[0, 0] * s.dd[2] - s.ed[0, 1] * s.dd[1]) / det,
            (s.ed[1, 1] * s.dd[0] - s.ed[1, 0] * s.dd[1]) / det)


@compiled
def verdict(s, samples):
    """Return VERDICT_RIGHT or VERDICT_WRONG; VERDICT_UNKNOWN with less than `samples` samples."""
    if s.n < samples:
        return VERDICT_UNKNOWN
    x, e = slopes(s)
    return VERDICT_RIGHT if x >= MIN_SLOPE and e >= MIN_SLOPE else VERDICT_WRONG
