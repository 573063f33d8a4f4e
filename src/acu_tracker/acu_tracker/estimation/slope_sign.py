"""Whether the errors that the loop is closed on have the wrong sign, seen in which of two directions moves smoothly.

Beam b and error e are measured; the target is at z+ = b + e if the slope is right, at z- = b - e if it is reversed. A
straight line is fitted to the last errors of each, and its innovations squared over the variance R of e are averaged:

    J+ = mean of (nu_b + nu_e)^2 / R,    J- = mean of (nu_b - nu_e)^2 / R

A target may turn as it likes: the beam is H z+ of what it follows, so that z- = (2 H - 1) z+ is at least as rough, H
being the closed loop of type II, but for the while that H lags; an outlier or noise is in both alike. Reversed errors
drive the beam away from a target that stays smooth in z-, while z+ runs away twice as fast: a likelihood ratio of two
hypotheses (Willsky, A survey of design methods for failure detection in dynamic systems, Automatica 12 (1976) 601).
Each axis of the receiver for itself, the beam in earth axes, where the deck's motion does not count.
"""
import math
from collections import namedtuple

import numpy as np

from acu_tracker.geometry.vector import Vector, dot, rotated
from pedestal_common.compiled import compiled

SLOPE_SIGN_DTYPE = np.dtype([('stamp', 'f8'), ('n', 'i8'), ('line', 'f8', (5, 2)), ('J', 'f8', (2, 2))], align=True)
"""stamp of the last error [s], -inf: there was none; n: errors in the lines, value and rate of the beam's unit vector
(ENU) and of both errors [rad]; J+ and J- of both axes [-]."""

LINE_ERROR_COUNT = 200
"""Errors that a line remembers: so many that the beam's way counts before its speed does."""

SLOPE_ERROR_COUNT = 100
"""Number of errors that J is taken over; a reversal of the target is over in the mean of them."""

MIN_ERROR_COUNT = 60
"""Errors since autotrack began, or the signal came back, before which nothing is said: means of a few are no ratio."""

MAX_ERROR_BEAMWIDTHS = 0.5
"""Largest error that is looked at [beamwidths]."""

REVERSED_SLOPE_RATIO, REVERSED_SLOPE_MARGIN, CROSS_AXIS_LEAKAGE = 5.0, 0.5, 0.1
"""Slope reversed: J+ > REVERSED_SLOPE_RATIO J- and J+ > J- + REVERSED_SLOPE_MARGIN + CROSS_AXIS_LEAKAGE (J+ + J- of
the other axis). A target that reverses is a
while ahead of the beam: at 11 deg/s2 J+ reaches 2.8 J- in 30 closed loops of uav_flyby, and without noise 2.9 at a
bandwidth of 20 rad/s, 4.6 at 10. Of what the other axis does some is seen, as the beam's axes turn on its way: 0.0015
where a beam of 1 deg on a rolling deck comes from half its width off, without noise."""

Beam = namedtuple('Beam', 'u across up')
"""Unit Vectors (ENU) along a beam, and of its cross-elevation and elevation."""


@compiled
def beam(mat_ed, A, E):
    """The Beam at deck angles A, E [rad] on a deck of attitude mat_ed, a Rotation deck -> earth."""
    sA, cA, sE, cE = math.sin(A), math.cos(A), math.sin(E), math.cos(E)
    return Beam(rotated(mat_ed, Vector(cE * cA, -cE * sA, sE)), rotated(mat_ed, Vector(-sA, -cA, 0.0)),
                rotated(mat_ed, Vector(-sE * cA, sE * sA, cE)))


@compiled
def near(u, beamwidth):
    """Whether an error of signals.INPUTS is on the straight part of its curve; beamwidth [rad]."""
    return math.hypot(u.cross_elevation, u.elevation) < MAX_ERROR_BEAMWIDTHS * beamwidth


@compiled
def restart(s):
    """Autotrack begins: nothing is held against the slope."""
    s.stamp = -math.inf


@compiled
def _innovation(s, i, y, T, alpha, beta):
    """Innovation of y against line i, which takes it; T [s] since the one before."""
    expected = s.line[i, 0] + T * s.line[i, 1]
    nu = y - expected
    s.line[i, 0] = expected + alpha * nu
    s.line[i, 1] += beta / T * nu
    return nu


@compiled
def _begin(s, u, error):
    """The first error: the lines begin where they are."""
    s.n = 1
    s.J[0, 0] = s.J[0, 1] = s.J[1, 0] = s.J[1, 1] = 0.0
    for i, y in enumerate((u.x, u.y, u.z, error[0], error[1])):
        s.line[i, 0], s.line[i, 1] = y, 0.0


@compiled
def _reversed(J, other):
    """Whether J+ and J- of an axis say that its slope is; other: those of the other axis."""
    return J[0] > REVERSED_SLOPE_RATIO * J[1] and J[0] > J[1] + REVERSED_SLOPE_MARGIN + CROSS_AXIS_LEAKAGE * (other[0] + other[1])


@compiled
def take(s, t, beam, error, variance, gap):
    """Take an error (cross-elevation, elevation) [rad] of a variance [rad2], measured at t [s] from a Beam; whether a
    slope is reversed. After more than a gap [s] without any it begins anew."""
    T = t - s.stamp
    if T <= 0.0:
        return False
    s.stamp = t
    if T > gap:
        _begin(s, beam.u, error)
        return False
    n = s.n = min(s.n + 1, LINE_ERROR_COUNT)
    # Gains of the least squares of n points; of the last n, as they fade, from LINE_ERROR_COUNT on.
    alpha, beta = 2.0 * (2 * n - 1) / (n * (n + 1)), 6.0 / (n * (n + 1))
    nu = Vector(_innovation(s, 0, beam.u.x, T, alpha, beta), _innovation(s, 1, beam.u.y, T, alpha, beta),
                _innovation(s, 2, beam.u.z, T, alpha, beta))
    for i, along in enumerate((beam.across, beam.up)):
        b, e = dot(nu, along), _innovation(s, 3 + i, error[i], T, alpha, beta)
        if n > 2:
            s.J[i, 0] += ((b + e) * (b + e) / variance - s.J[i, 0]) / SLOPE_ERROR_COUNT
            s.J[i, 1] += ((b - e) * (b - e) / variance - s.J[i, 1]) / SLOPE_ERROR_COUNT
    return n >= MIN_ERROR_COUNT and (_reversed(s.J[0], s.J[1]) or _reversed(s.J[1], s.J[0]))
