"""Detection of receiver errors with the wrong sign, by the smoothness of the target's direction with either sign.

Beam b and error e are measured. The target is at z+ = b + e if the slope is right, and at z- = b - e if it
is reversed. A straight line is fitted to the last values of each; its squared innovations over the
variance R of e are averaged:

    J+ = mean of (nu_b + nu_e)^2 / R,    J- = mean of (nu_b - nu_e)^2 / R

nu_b, nu_e: innovations of the lines of b and of e. Right slope: the beam is H z+, so that z- = (2 H - 1) z+. H is the
transfer function of the closed loop, which follows a constant rate without error (type II). Except while H lags, z- is
at least as rough as z+, however the target turns. Outliers and noise are in both alike. Reversed slope: the
errors drive the beam away from a target that stays smooth in z-, while z+ moves away twice as fast. The
comparison is a likelihood ratio of two hypotheses (Willsky, A survey of design methods for failure detection in
dynamic systems, Automatica 12 (1976) 601). Each axis of the receiver is judged by itself, in earth axes, because
the deck's motion has no effect there.
"""
import math
from collections import namedtuple

import numpy as np

from acu_tracker.geometry.vector import Vector, dot, rotated
from pedestal_common.compiled import compiled

SLOPE_SIGN_DTYPE = np.dtype([('stamp', 'f8'), ('n', 'i8'), ('line', 'f8', (5, 2)), ('J', 'f8', (2, 2))], align=True)
"""stamp: of the last error [s], -inf for none; n: number of errors in the lines; line: value and rate of the beam's
unit vector (ENU) and of both errors [rad]; J: J+ and J- of both axes [-]."""

LINE_ERROR_COUNT = 200
"""Number of errors in the memory of a line. The longer the memory, the more the travel of the beam counts, and the
less its speed."""

SLOPE_ERROR_COUNT = 100
"""Number of errors in the means J. A target reverses its motion in a shorter time."""

MIN_ERROR_COUNT = 60
"""Number of errors, after the begin of autotrack or the return of the signal, before the first verdict. Means of fewer
errors do not give a useful ratio."""

MAX_ERROR_BEAMWIDTHS = 0.5
"""Largest error that is used [beamwidths]."""

REVERSED_SLOPE_RATIO, REVERSED_SLOPE_MARGIN, CROSS_AXIS_LEAKAGE = 5.0, 0.5, 0.1
"""Limits of a reversed slope [-]: J+ > REVERSED_SLOPE_RATIO J- and J+ > J- + REVERSED_SLOPE_MARGIN +
CROSS_AXIS_LEAKAGE (J+ + J- of the other axis).

A target that reverses is ahead of the beam for a while. At 11 deg/s2 J+ then reaches 2.8 J- in 30 closed loops of
uav_flyby; without noise it reaches 2.9 J- at a bandwidth of 20 rad/s, 4.6 J- at 10 rad/s. Because the beam's axes turn
on its way, a part of the other axis leaks in. This part is 0.0015 without noise, where a beam of 1 deg on a rolling
deck comes from half its width off.
"""

Beam = namedtuple('Beam', 'u across up')
"""Unit Vectors (ENU) along a beam, and along its cross-elevation and elevation."""


@compiled
def beam(mat_ed, A, E):
    """Return the Beam at deck angles A, E [rad]; mat_ed: Rotation deck -> earth."""
    sA, cA, sE, cE = math.sin(A), math.cos(A), math.sin(E), math.cos(E)
    return Beam(rotated(mat_ed, Vector(cE * cA, -cE * sA, sE)), rotated(mat_ed, Vector(-sA, -cA, 0.0)),
                rotated(mat_ed, Vector(-sE * cA, sE * sA, cE)))


@compiled
def near(u, beamwidth):
    """Return True if an error of signals.INPUTS is on the straight part of its curve; beamwidth [rad]."""
    return math.hypot(u.cross_elevation, u.elevation) < MAX_ERROR_BEAMWIDTHS * beamwidth


@compiled
def restart(s):
    """Clear the memory when autotrack begins."""
    s.stamp = -math.inf


@compiled
def _innovation(s, i, y, T, alpha, beta):
    """Update line i with y; return the innovation of y. T: time since the previous value [s]."""
    expected = s.line[i, 0] + T * s.line[i, 1]
    nu = y - expected
    s.line[i, 0] = expected + alpha * nu
    s.line[i, 1] += beta / T * nu
    return nu


@compiled
def _begin(s, u, error):
    """Begin the lines at the first error."""
    s.n = 1
    s.J[0, 0] = s.J[0, 1] = s.J[1, 0] = s.J[1, 1] = 0.0
    for i, y in enumerate((u.x, u.y, u.z, error[0], error[1])):
        s.line[i, 0], s.line[i, 1] = y, 0.0


@compiled
def _reversed(J, other):
    """Return True if J+ and J- of an axis (J) show a reversed slope; other: J+ and J- of the other axis."""
    least = J[1] + REVERSED_SLOPE_MARGIN + CROSS_AXIS_LEAKAGE * (other[0] + other[1])
    return J[0] > REVERSED_SLOPE_RATIO * J[1] and J[0] > least


@compiled
def take(s, t, beam, error, variance, gap):
    """Take an error (cross-elevation, elevation) [rad] of a variance [rad2], measured at t [s] from a Beam; return
    True if a slope is reversed. The lines restart after more than a gap [s] without errors.

    Lines 0 to 2 belong to the beam's unit vector, lines 3 and 4 to the two errors.
    """
    T = t - s.stamp
    if T <= 0.0:
        return False
    s.stamp = t
    if T > gap:
        _begin(s, beam.u, error)
        return False
    n = s.n = min(s.n + 1, LINE_ERROR_COUNT)
    # Gains of a least-squares fit to n points; from LINE_ERROR_COUNT points on, old points fade.
    alpha, beta = 2.0 * (2 * n - 1) / (n * (n + 1)), 6.0 / (n * (n + 1))
    nu = Vector(_innovation(s, 0, beam.u.x, T, alpha, beta), _innovation(s, 1, beam.u.y, T, alpha, beta),
                _innovation(s, 2, beam.u.z, T, alpha, beta))
    for i, along in enumerate((beam.across, beam.up)):
        b, e = dot(nu, along), _innovation(s, 3 + i, error[i], T, alpha, beta)
        if n > 2:
            s.J[i, 0] += ((b + e) * (b + e) / variance - s.J[i, 0]) / SLOPE_ERROR_COUNT
            s.J[i, 1] += ((b - e) * (b - e) / variance - s.J[i, 1]) / SLOPE_ERROR_COUNT
    return n >= MIN_ERROR_COUNT and (_reversed(s.J[0], s.J[1]) or _reversed(s.J[1], s.J[0]))
