"""Check that the receiver's errors lead to the target, before the loop is closed on them.

The beam moves in a known way about the expected place of the target, which is at an offset d from the beam. The errors
e should follow it one for one. With the sums over the samples, less their means,

    K = S_ed S_dd^-1,    S_ed = sum (e - e') (d - d')^T,    S_dd = sum (d - d') (d - d')^T

is the matrix of slopes (least squares). Its diagonal is 1 without a fault, negative if a sign is wrong, and cos(beta)
if the axes of the errors are turned by beta. An error of the prediction is in the means only.
"""
import numpy as np

from pedestal_common.compiled import compiled

SLOPES_DTYPE = np.dtype([('n', 'i8'), ('d', 'f8', (2,)), ('e', 'f8', (2,)), ('dd', 'f8', (3,)), ('ed', 'f8', (2, 2))],
                        align=True)
"""n: number of samples; d, e: their means d', e' [rad]; dd, ed: the sums S_dd (xx, xe, ee) and S_ed [rad2]."""

MIN_SLOPE = 0.5
"""Slope below which the loop is not closed [-]: axes turned by 60 deg, which use up the phase margin."""

VERDICT_UNKNOWN, VERDICT_RIGHT, VERDICT_WRONG = range(3)
"""Verdicts of the check."""


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
    """Take an expected offset d of the target from the beam and the error e, both (cross-elevation, elevation) [rad]
    (Welford 1962)."""
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
    """Return (K_xx, K_ee) [1]; NaN before the beam has moved in two directions."""
    det = s.dd[0] * s.dd[2] - s.dd[1] * s.dd[1]
    return ((s.ed[0, 0] * s.dd[2] - s.ed[0, 1] * s.dd[1]) / det,
            (s.ed[1, 1] * s.dd[0] - s.ed[1, 0] * s.dd[1]) / det)


@compiled
def verdict(s, samples):
    """Return VERDICT_RIGHT or VERDICT_WRONG after this number of samples, VERDICT_UNKNOWN before."""
    if s.n < samples:
        return VERDICT_UNKNOWN
    x, e = slopes(s)
    return VERDICT_RIGHT if x >= MIN_SLOPE and e >= MIN_SLOPE else VERDICT_WRONG
