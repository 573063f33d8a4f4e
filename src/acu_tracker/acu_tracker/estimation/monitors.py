"""The monitors that detect wrong errors of the receiver: divergence, roughness, repetition, sign of the slope.

Divergence: the estimate moves away from the target, and the antenna follows the estimate. The mean m is 1 while the
innovations nu of both angles are as large as the filter expects by their variances S:

    m = mean over the last errors of (nu_A^2 / S_A + nu_E^2 / S_E) / 2

An error signal with the wrong sign, with rotated axes or with a gain three times too high drives the antenna away from
its target. Then m becomes large before the beam leaves the target, and it is still large when the signal is lost. In
this case autotrack must not coast on the wrong estimate.

Roughness: errors that are only noise change far more from one to the next than the model expects. The mean q of both
axes is 1 for white noise of the variance R by the model of the receiver:

    q = mean over the last errors of (nu_k - nu_k-1)^2 / 2R

Slow changes cancel in the difference: a target that turns, a slope of the wrong sign, a bias. The gate of
`receiver_error` rejects all errors while q is above it, because some noisy errors would pass the gate alone and
mislead the filter. Source: von Neumann, Distribution of the ratio of the mean square successive difference to the
variance, Annals of Mathematical Statistics 12 (1941) 367.

Repetition: measured errors have noise and change with the direction of the beam. Errors that stay equal while the beam
moves are therefore repeated, and the filter must not use them.

SlopeSign: the direction of a real target is smooth. The test computes it with either sign of the error, and compares
which of the two directions is smoother:

    b, e    measured direction of the beam and measured error, on one axis [rad]
    z+      b + e: direction of the target if the slope is right
    z-      b - e: direction of the target if the slope is reversed

A straight line is fitted to the last values of b and of e. The squared innovations nu of both lines are averaged:

    J+ = mean of (nu_b + nu_e)^2 / R,    J- = mean of (nu_b - nu_e)^2 / R

Right slope: the beam is H z+, so that z- = (2 H - 1) z+. H is the transfer function of the closed loop, which follows
a constant rate without error (type II). Except while H lags, z- is at least as rough as z+, however the target turns.
Outliers and noise are in z+ and z- alike.

Reversed slope: the errors drive the beam away from the target. The direction z- stays smooth, and z+ moves away twice
as fast as the beam.

The comparison is a likelihood ratio of two hypotheses (Willsky, A survey of design methods for failure detection in
dynamic systems, Automatica 12 (1976) 601). Each axis of the receiver is tested by itself. The directions are those in
the earth frame, because the motion of the deck has no effect there.
"""
import math
from typing import Annotated, NamedTuple

from acu_tracker.estimation.filters.measurement import Innovation, Measurement
from acu_tracker.geometry.history import Pointing
from acu_tracker.geometry.vector import Rotation, Vector, dot, rotated
from acu_tracker.signals import Inputs
from pedestal_common.compiled import compiled
from pedestal_common.quantities import Bit, Floats, Pair, Radians, Radians2, Seconds, Vector3
from pedestal_common.record import Record


class Divergence(Record):
    """State of the detection."""
    m: float        # the mean [-]
    diverged: Bit   # 1 from the detection of a divergence until its reset


DIVERGENCE_ERROR_COUNT = 100  # number of errors in m: half a second. Without a fault m stays below 1.25.

MAX_COUNTED_ERROR = 12.5
"""Largest contribution of one error to m [-]: half the default gate. This avoids an alarm after a few errors with
interference."""

DIVERGENCE_LIMIT = 7.0
"""Largest m of a filter that still follows its target [-]. A filter without an acceleration state reaches 6.1 on a
target that reverses its motion, and keeps it in the beam."""

COASTING_DIVERGENCE_LIMIT = 2.0  # largest m [-] with which the filter may coast after a loss without a known cause


@compiled
def restart_divergence(state: Divergence) -> None:
    """Set m to 1 when a mode begins."""
    state.m = 1.0


@compiled
def take_divergence(state: Divergence, innovation: Innovation) -> None:
    """Add the innovation of an error to the mean m; an innovation of NaN is ignored."""
    # The comparison of x with itself is False for NaN.
    x = 0.5 * (innovation.axis[0].chi_square + innovation.axis[1].chi_square)
    if x == x:
        state.m += (min(x, MAX_COUNTED_ERROR) - state.m) / DIVERGENCE_ERROR_COUNT


@compiled
def diverges(state: Divergence, without_signal: Bit) -> bool:
    """Return True if the filter has diverged; without_signal: it coasts without a known cause of the loss."""
    return state.m > (COASTING_DIVERGENCE_LIMIT if without_signal else DIVERGENCE_LIMIT)


@compiled
def latch_divergence(state: Divergence) -> None:
    """Latch the divergence until `release_divergence`."""
    state.diverged = 1


@compiled
def release_divergence(state: Divergence) -> None:
    """Reset the latched divergence."""
    state.diverged = 0


class Roughness(Record):
    """State of the detection."""
    nu: Pair    # innovations of the previous error [rad]; NaN without one
    q: float    # the mean [-]


ROUGHNESS_ERROR_COUNT = 10  # number of errors in the mean q

MAX_COUNTED_DIFFERENCE = 100.0
"""Largest contribution of one difference to q [-]. One outlier makes two large differences. The limit keeps q below
the default gate of 25 after one outlier, so that the gate alone decides on it."""


@compiled
def restart_roughness(state: Roughness) -> None:
    """Set q to 1 when the filter starts."""
    state.nu[0] = state.nu[1] = math.nan
    state.q = 1.0


@compiled
def take_roughness(state: Roughness, innovation: Innovation, measurement: Measurement) -> float:
    """Add an innovation to the mean and return q; the measurement of the innovation holds R."""
    x = 0.0
    for i in range(2):
        nu = innovation.axis[i].nu
        d = nu - state.nu[i]
        x += 0.25 * d * d / measurement.axis[i].variance      # d^2 / 2R, half for each axis
        state.nu[i] = nu
    if x == x:  # not NaN
        state.q += (min(x, MAX_COUNTED_DIFFERENCE) - state.q) / ROUGHNESS_ERROR_COUNT
    return state.q


class Repetition(Record):
    """Last message of the receiver."""
    message: Vector3    # cross-elevation error, elevation error [rad] and C/N0 [dB-Hz]
    at: Pair            # deck angles of the beam when these numbers came for the first time [rad]


REPETITION_TRAVEL_RAD = 3e-3  # travel of the beam within which the message must change [rad]


@compiled
def take_repetition(state: Repetition, inputs: Inputs, at: Pointing) -> bool:
    """Take an error of the receiver, with the beam `at`; return True if it is repeated."""
    last = state.message
    if inputs.cross_elevation != last[0] or inputs.elevation != last[1] or inputs.cn0_dbhz != last[2]:
        last[0], last[1], last[2] = inputs.cross_elevation, inputs.elevation, inputs.cn0_dbhz
        state.at[0], state.at[1] = at.A, at.E
        return False
    return max(abs(at.A - state.at[0]), abs(at.E - state.at[1])) > REPETITION_TRAVEL_RAD


class SlopeSign(Record):
    """State of the test."""
    stamp: Seconds      # time of the last error; -inf: no error yet
    n: int              # number of errors in the lines
    # value and rate of the five lines: three components of the beam's unit vector (ENU), then both errors [rad]
    line: Annotated[Floats, (5, 2)]
    J: Annotated[Floats, (2, 2)]    # J+ and J- of cross-elevation, then of elevation [-]


LINE_ERROR_COUNT = 200
"""Number of errors in the memory of a line. With a longer memory the test depends more on how far the beam travels,
and less on how fast."""

SLOPE_ERROR_COUNT = 100  # number of errors in J+ and J-. A real target reverses its motion in a shorter time.

MIN_ERROR_COUNT = 60
"""Number of errors before the first verdict, counted from the begin of autotrack or the return of the signal. The
means of fewer errors have no useful ratio."""

MAX_ERROR_BEAMWIDTHS = 0.5  # largest error that is used [beamwidths]

REVERSED_SLOPE_RATIO, REVERSED_SLOPE_MARGIN, CROSS_AXIS_LEAKAGE = 5.0, 0.5, 0.1
"""Limits of a reversed slope [-]: J+ > REVERSED_SLOPE_RATIO J- and J+ > J- + REVERSED_SLOPE_MARGIN +
CROSS_AXIS_LEAKAGE (J+ + J- of the other axis).

The ratio: with a right slope J+ is larger than J- for a while after the target has reversed its motion. In 30 closed
loops of the scenario uav_flyby with a reversal of 11 deg/s2, J+ reached 2.8 J-. Without noise J+ reaches 2.9 J- at a
bandwidth of 20 rad/s, and 4.6 J- at 10 rad/s. The leakage: because the axes of the beam turn while the beam moves, a
part of the means of one axis appears in those of the other axis. Without noise this part is 0.0015, for a beam of 1
deg that starts half a beamwidth off on a rolling deck.
"""


class Beam(NamedTuple):
    """Unit vectors (ENU) of a beam."""
    u: Vector       # along the beam
    across: Vector  # in the direction of growing cross-elevation
    up: Vector      # in the direction of growing elevation


@compiled
def slope_beam(mat_ed: Rotation, A: Radians, E: Radians) -> Beam:
    """Return the Beam at deck angles A, E; mat_ed: deck -> earth."""
    sA, cA, sE, cE = math.sin(A), math.cos(A), math.sin(E), math.cos(E)
    return Beam(rotated(mat_ed, Vector(cE * cA, -cE * sA, sE)), rotated(mat_ed, Vector(-sA, -cA, 0.0)),
                rotated(mat_ed, Vector(-sE * cA, sE * sA, cE)))


@compiled
def shows_slope(inputs: Inputs, beamwidth: Radians) -> bool:
    """Return True if an error of the receiver is on the straight part of the error curve."""
    return math.hypot(inputs.cross_elevation, inputs.elevation) < MAX_ERROR_BEAMWIDTHS * beamwidth


@compiled
def restart_slope(state: SlopeSign) -> None:
    """Clear the memory when a mode begins."""
    state.stamp = -math.inf


@compiled
def _innovation(state: SlopeSign, i: int, y: float, T: Seconds, alpha: float, beta: float) -> float:
    """Update line i with a value y, T after the last one; return the innovation of y. alpha, beta: gains [-]."""
    expected = state.line[i, 0] + T * state.line[i, 1]
    nu = y - expected
    state.line[i, 0] = expected + alpha * nu
    state.line[i, 1] += beta / T * nu
    return nu


@compiled
def _begin(state: SlopeSign, u: Vector, error: tuple[Radians, Radians]) -> None:
    state.n = 1
    state.J[0, 0] = state.J[0, 1] = state.J[1, 0] = state.J[1, 1] = 0.0
    for i, y in enumerate((u.x, u.y, u.z, error[0], error[1])):
        state.line[i, 0], state.line[i, 1] = y, 0.0


@compiled
def _reversed(J: Pair, other: Pair) -> bool:
    """Return True if an axis has a reversed slope; J, other: (J+, J-) of this axis and of the other one."""
    least = J[1] + REVERSED_SLOPE_MARGIN + CROSS_AXIS_LEAKAGE * (other[0] + other[1])
    return J[0] > REVERSED_SLOPE_RATIO * J[1] and J[0] > least


@compiled
def take_slope(state: SlopeSign, t: Seconds, beam: Beam, error: tuple[Radians, Radians], variance: Radians2,
               gap: Seconds) -> bool:
    """Take an error (cross-elevation, elevation) of variance R, measured at t with the beam; return True if the slope
    of an axis is reversed. The lines restart after the time `gap` without errors."""
    T = t - state.stamp
    if T <= 0.0:
        return False
    state.stamp = t
    if T > gap:
        _begin(state, beam.u, error)
        return False
    n = state.n = min(state.n + 1, LINE_ERROR_COUNT)
    # alpha, beta: gains of a least-squares fit to n points; from LINE_ERROR_COUNT points on, old points fade.
    alpha, beta = 2.0 * (2 * n - 1) / (n * (n + 1)), 6.0 / (n * (n + 1))
    nu = Vector(_innovation(state, 0, beam.u.x, T, alpha, beta), _innovation(state, 1, beam.u.y, T, alpha, beta),
                _innovation(state, 2, beam.u.z, T, alpha, beta))
    for i, along in enumerate((beam.across, beam.up)):
        b, e = dot(nu, along), _innovation(state, 3 + i, error[i], T, alpha, beta)
        if n > 2:
            state.J[i, 0] += ((b + e) * (b + e) / variance - state.J[i, 0]) / SLOPE_ERROR_COUNT
            state.J[i, 1] += ((b - e) * (b - e) / variance - state.J[i, 1]) / SLOPE_ERROR_COUNT
    return n >= MIN_ERROR_COUNT and (_reversed(state.J[0], state.J[1]) or _reversed(state.J[1], state.J[0]))
