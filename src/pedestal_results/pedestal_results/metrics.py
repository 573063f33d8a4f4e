"""Metrics of the response to a step and to a sine, such as overshoot and settling time, for the servo studies.

Libraries are not used here, because their numbers differ. `control.step_info` rounds a settling time to the grid of
times, and these metrics interpolate. `scipy.optimize.curve_fit` gives amplitude and period of a sine that differ by
7e-13 from the published rows.
"""
import math

import numpy as np

from pedestal_common.quantities import Bools, Floats, RadiansPerSecond, Seconds, Times, Vector3


def overshoot_percent(y: Floats, size: float) -> float:
    """Return the overshoot [%] of a step response y from 0 to size."""
    return 100.0 * max(float(np.max(y / size)) - 1.0, 0.0)


def settling_time(t: Times, y: Floats, size: float, band: float = 0.02) -> Seconds:
    """Return the interpolated time from which y stays within size +-band * size, or NaN if it does not settle."""
    excess = np.abs(y / size - 1.0) - band
    outside = np.flatnonzero(excess > 0.0)
    if outside.size == 0:
        return float(t[0])
    last = outside[-1]
    if last == len(t) - 1:
        return math.nan
    return float(t[last] + (t[last + 1] - t[last]) * excess[last] / (excess[last] - excess[last + 1]))


def crossings(y: Floats, size: float, band: float = 0.005) -> int:
    """Return the number of crossings of y through its final value `size`; motion within +-band * size is ignored."""
    side = np.sign(y - size)[np.abs(y - size) > band * abs(size)]
    return int(np.sum(side[1:] != side[:-1]))


def whole_periods(t: Times, period: Seconds, skip: Seconds) -> Bools:
    """Return the mask of the times in whole periods of `period`, counted from `skip` after the start. Raises
    ValueError for a record without a whole period."""
    # The small tolerances keep a last period or a first sample that rounding errors put just outside.
    t = t - t[0]
    whole = math.floor((t[-1] - skip) / period + 1e-6)
    if whole < 1:
        raise ValueError(f'a record of {t[-1]:g} s has no whole period of {period:g} s after {skip:g} s')
    return (t >= skip - 1e-9) & (t < skip + whole * period - 1e-9)


def harmonic_fit(t: Times, y: Floats, w: RadiansPerSecond) -> Vector3:
    """Return (offset, a, b) of the least-squares fit y = offset + a sin(w t) + b cos(w t)."""
    basis = np.column_stack((np.ones_like(t), np.sin(w * t), np.cos(w * t)))
    coefficients, *_ = np.linalg.lstsq(basis, y, rcond=None)
    return coefficients


def amplitude_and_period(t: Times, y: Floats, period: Seconds) -> tuple[float, Seconds]:
    """Return amplitude and period of a sine fitted to y by least squares (Gauss-Newton); period: first guess."""
    w = 2.0 * math.pi / period
    # If t is 0 in the middle, an error of w hardly changes the fitted phase. The search then converges from a poor
    # first guess too.
    middle = 0.5 * (t[0] + t[-1])
    t = t - middle
    for _ in range(20):
        offset, a, b = harmonic_fit(t, y, w)
        sine, cosine = np.sin(w * t), np.cos(w * t)
        basis = np.column_stack((np.ones_like(t), sine, cosine, t * (a * cosine - b * sine)))
        # The last of the four unknowns is the change of w; the others are refitted by the next harmonic_fit.
        (*_, change), *_ = np.linalg.lstsq(basis, y - offset - a * sine - b * cosine, rcond=None)
        w += change
        if abs(change) < 1e-13 * w:
            break
    _, a, b = harmonic_fit(t, y, w)
    return math.hypot(a, b), 2.0 * math.pi / w


def residual(t: Times, y: Floats, period: Seconds) -> Floats:
    """Return y without its mean and without its part at the frequency 1 / period, by a least-squares fit."""
    w = 2.0 * math.pi / period
    offset, a, b = harmonic_fit(t, y, w)
    return y - offset - a * np.sin(w * t) - b * np.cos(w * t)


def peak(y: Floats) -> float:
    """Return the largest absolute value of an array of any shape."""
    return float(np.max(np.abs(y)))
