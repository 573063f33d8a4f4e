"""The monitors that detect wrong errors of the receiver: divergence, roughness, repetition, slope.

Divergence: the estimate moves away from the target, and the antenna follows the estimate. The mean m is 1 while the
innovations nu of both angles are as large as the filter expects by their variances S:

    m = mean over the last errors of (nu_A^2 / S_A + nu_E^2 / S_E) / 2

An error signal with the wrong sign, with rotated axes or with a gain three times too high drives the antenna away from
its target. Then m becomes large before the beam leaves the target. If the signal is lost before m is large enough,
autotrack must not coast on the wrong estimate. A shorter mean n and a longer mean N tell such a loss from a fade:

    n, N = means over the last errors of (nu_A^2 / V_A + nu_E^2 / V_E) / 2,    V = S + max(q - 1, 0) R
    growth g = largest recent n / max(N, 1)

The second term of V is noise that the model of the receiver does not contain, with q and R of the roughness below.
In a fade the noise of the errors grows before the published C/N0 falls, and without this term the noise would look
like a divergence. An estimate that moves away does so smoothly, with a q near 1. The ratio to N excuses a filter that
follows the manoeuvres of its target badly: both means are then large, while a divergence takes less time than N. The
largest recent value counts, because after the beam has left the target the errors are only noise.

No mean counts the errors after a gap longer than `coast_after`, until one of them is accepted. Their innovations show
how far the target has turned in the gap, in which the loop was not closed on errors. Then n and g begin again.

Roughness: errors that are only noise change far more from one to the next than the model expects. The mean q of both
axes is 1 for white noise of the variance R by the model of the receiver:

    q = mean over the last errors of (nu_k - nu_k-1)^2 / 2R

Slow changes cancel in the difference: a target that turns, a slope of the wrong sign, a bias. The gate of
`receiver_error` rejects all errors while q is above it, because some noisy errors would pass the gate alone and
mislead the filter. Source: von Neumann, Distribution of the ratio of the mean square successive difference to the
variance, Annals of Mathematical Statistics 12 (1941) 367.

Repetition: measured errors have noise and change with the direction of the beam. Errors that stay equal while the beam
moves are therefore repeated, and the filter must not use them.

WrongSlope: the direction of a real target is smooth. The test computes it with the errors as received and with errors
of a wrong slope, and compares which of the directions is smoother:

    u, e    measured direction of the beam, and measured error as a vector in the plane across the beam, both ENU
    z       u + e: direction of the target if the slope is right
    z'      u + g^-1 e: direction of the target if the receiver has applied the wrong slope g

g reverses the sign of one axis, or turns both by 90 to 270 deg with errors of the right size or of SMALL_SLOPE of it.
Parabolas are fitted to the last means of u and of e. The innovations a and b of both parabolas, divided by the noise
of e, give

    J = mean of |a + b|^2,    J' = mean of |g a + b|^2

These are quadratic in a and b. Therefore the means of their products are enough for every g, and the turn with the
smallest J' has a closed form. With a_x + i a_e, b_x + i b_e and C = mean of (b a*) it is

    J = mean of (|a|^2 + |b|^2) + 2 Re C,    J' = mean of (|g|^2 |a|^2 + |b|^2) - 2 |g| |C|

Right slope: the beam is H z, so that z' = (2 H - 1) z for a reversed sign. H is the transfer function of the closed
loop. The best prediction of z' has larger errors than that of z, because 2 H - 1 has zeros in the right half-plane:
the poles of the loop with the reversed sign. Therefore z' is only smoother for a while, after the target has turned.
Outliers and noise are in both directions alike. With small errors z' is noisy. In units of this noise J' may
be as small as |g|^2 J while the beam follows a target that turns slowly. Therefore this hypothesis needs a larger
ratio of J and J'.

Wrong slope: the errors drive the beam away from the target. The direction z' stays smooth, and z moves away twice as
fast as the beam.

A target that leaves the beam has no time for this evidence: the error curve is straight up to a third of a beamwidth
only, and behind it the errors say nothing. If the mean error of a block is above LEAVING_ERROR_BEAMWIDTHS although the
filter follows its target, a smaller ratio LEAVING_RATIO is enough.

The comparison is a likelihood ratio of hypotheses (Willsky, A survey of design methods for failure detection in
dynamic systems, Automatica 12 (1976) 601). The directions are those in the earth frame, because the motion of the deck
has no effect there. `pedestal study wrong-slope` compares the time of the alarm with the time of a test that knows the
direction of the target. With the program of a satellite `slope_ratio` is sooner.
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
    n: float        # the shorter mean, without unknown noise [-]
    N: float        # the longer mean, without unknown noise [-]
    g: float        # the growth [-]
    diverged: Bit   # 1 from the detection of a divergence until its reset


DIVERGENCE_ERROR_COUNT = 100  # number of errors in m: half a second. Without a fault m stays below 1.25.

MAX_COUNTED_ERROR = 12.5
"""Largest contribution of one error to m [-]: half the default gate. This avoids an alarm after a few errors with
interference."""

DIVERGENCE_LIMIT = 8.0
"""Largest m of a filter that still follows its target [-]. A filter without an acceleration state reaches 6.1 on a
target that reverses its motion, and the default 7.3 on a dish that swings in gusts; both keep it in the beam."""

SHORT_ERROR_COUNT, LONG_ERROR_COUNT = 50, 1000
"""Numbers of errors in n and N: 0.25 s and 5 s. Most divergences take 0.2 to 1 s."""

GROWTH_ERROR_COUNT = 100  # number of errors in which the part of g above 1 decays: those between divergence and loss

COASTING_GROWTH_LIMIT = 1.75
"""Largest g [-] with which the filter may coast after a loss without a known cause. In closed loops g was at least 2.0
at a loss by wrong errors, and at most 1.5 at a fade of 15 to 60 dB, also with filters that cannot follow their
target."""


@compiled
def restart_divergence(state: Divergence) -> None:
    """Set means and growth to 1 when a mode begins."""
    state.m = state.n = state.N = state.g = 1.0


@compiled
def restart_growth(state: Divergence) -> None:
    """Set the short mean and the growth to 1 after a gap."""
    state.n = state.g = 1.0


@compiled
def take_divergence(state: Divergence, innovation: Innovation, measurement: Measurement, q: float) -> None:
    """Add the innovation of a measurement to the means; an innovation of NaN is ignored. q: roughness."""
    # x, y: share of the innovation in m, and in n and N.
    x = y = 0.0
    for i in range(2):
        axis = innovation.axis[i]
        x += 0.5 * axis.chi_square
        y += 0.5 * axis.nu * axis.nu / (axis.S + max(q - 1.0, 0.0) * measurement.axis[i].variance)
    if x == x:  # not NaN
        y = min(y, MAX_COUNTED_ERROR)
        state.m += (min(x, MAX_COUNTED_ERROR) - state.m) / DIVERGENCE_ERROR_COUNT
        state.n += (y - state.n) / SHORT_ERROR_COUNT
        state.N += (y - state.N) / LONG_ERROR_COUNT
        state.g = max(state.n / max(state.N, 1.0), state.g + (1.0 - state.g) / GROWTH_ERROR_COUNT)


@compiled
def diverges(state: Divergence, without_signal: Bit) -> bool:
    """Return True if the filter has diverged; without_signal: it coasts without a known cause of the
    loss, or departs from the program."""
    return state.m > DIVERGENCE_LIMIT or without_signal != 0 and state.g > COASTING_GROWTH_LIMIT


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


class WrongSlope(Record):
    """State of the test. A block is BLOCK_ERROR_COUNT successive errors. Its six numbers are the means of the ENU
    components of the beam's direction and of the error [rad]."""
    stamp: Seconds          # time of the last error; -inf: no error yet
    count: int              # number of errors in the present block
    sum: Annotated[Floats, (6,)]    # sums of the present block
    variance: Radians2      # sum of the variances of its errors
    block_stamp: Seconds    # time of the last error of the last block
    n: int                  # number of blocks in the parabolas
    curve: Annotated[Floats, (6, 3)]    # value, rate [1/s] and acceleration [1/s2] of the six parabolas
    beam_square: Pair       # means of a_x^2, a_e^2 [-]
    error_square: Pair      # means of b_x^2, b_e^2 [-]
    product: Pair           # means of a_x b_x, a_e b_e [-]
    turn: float             # Im C: mean of a_x b_e - a_e b_x [-]
    score: float            # largest score after the last block [-]


BLOCK_ERROR_COUNT = 4
"""Number of errors in a mean. The noise of a mean is half of that of an error; a loop hardly moves the beam within 20
ms."""

CURVE_BLOCK_COUNT = 50
"""Number of blocks in the memory of a parabola: 1 s. With a longer memory the test depends more on how far the beam
travels, and less on how fast."""

SLOPE_BLOCK_COUNT = 25  # number of blocks in the means: 0.5 s. A real target reverses its motion in a shorter time.

MIN_BLOCK_COUNT = 15
"""Number of blocks before the first verdict, counted from the begin of autotrack or the return of the signal. The
means of fewer blocks have no useful ratio."""

MAX_ERROR_BEAMWIDTHS = 0.5  # largest error that is used [beamwidths]

HYPOTHESIS_COUNT = 4  # reversed sign of cross-elevation, of elevation, turned axes, turned axes with SMALL_SLOPE
SMALL_SLOPE = 0.25      # size of small errors over that of right ones [-]

WRONG_SLOPE_RATIO, WRONG_SLOPE_MARGIN, EXPLAINED_ROUGHNESS = 9.0, 2.0, 0.5
"""Limits of a wrong slope [-]: J > WRONG_SLOPE_RATIO (J' - EXPLAINED_ROUGHNESS k) + WRONG_SLOPE_MARGIN, for k axes. A
bracket below 0 counts as 0. The noise alone makes J' about k.

The ratio: with a right slope J is larger than J' for a while after the target has reversed its motion. In closed loops
with square accelerations of 5 to 40 deg/s2 for 0.2 to 3 s, C/N0 up to 90 dB-Hz and bandwidths of 6 to 20 rad/s, J
reached 7.2 J'. The margin: with the ratio, these loops and all targets of `pedestal study wrong-slope` reached 0.6.
"""

LEAVING_RATIO = 2.0
"""Ratio that takes the place of WRONG_SLOPE_RATIO while the target leaves the beam [-]."""

LEAVING_ERROR_BEAMWIDTHS, MAX_FOLLOWING_MEAN = 0.25, 2.2
"""Mean error of a block with which the target leaves the beam [beamwidths], and the m of a Divergence [-]. Up to this
m a filter follows its target so well that its lag does not explain this error. With a right slope the default filter
never had an error above 0.17 beamwidths on any target of the study. Filters of one model reached 0.43 beamwidths on
targets that reverse, with J = 5 J' and m of at least 2.8. With a wrong slope m is 1.4 to 1.9 at this error, because
the filter follows the target that seems to flee.
"""

SMALL_SLOPE_RATIO, SMALL_SLOPE_MARGIN, SMALL_SLOPE_EXPLAINED = 20.0, 6.0, 0.9
"""The same limits for the hypothesis of SMALL_SLOPE [-], which needs a ratio above SMALL_SLOPE^-2. With this ratio the
same loops and targets reached 2.5, also with all kinds of filter."""

SMALL_LEAVING_SHARE, SMALL_LEAVING_SIGMAS = 0.4, 5.0
"""Only a target that leaves the beam is tested with the hypothesis of SMALL_SLOPE: the mean error of a block is above
this share of `leaving_error` [-], and above this number of its standard deviations. A filter that follows badly looks
like the hypothesis when its target reverses, and so does each filter in the noise of a fade.
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
def restart_slope(state: WrongSlope) -> None:
    """Clear the memory when a mode begins."""
    state.stamp = -math.inf


@compiled
def _clear_block(state: WrongSlope) -> None:
    state.count = 0
    state.variance = 0.0
    state.sum[:] = 0.0


@compiled
def _clear_slope(state: WrongSlope) -> None:
    _clear_block(state)
    state.n = 0
    state.beam_square[:] = 0.0
    state.error_square[:] = 0.0
    state.product[:] = 0.0
    state.turn = state.score = 0.0


@compiled
def _innovation(state: WrongSlope, i: int, T: Seconds) -> float:
    """Update parabola i with the present block, T after the last one; return the innovation of its mean.

    The gains are those of a least-squares fit to n blocks (Brookner, Tracking and Kalman filtering made easy, 1998,
    table 7.3-1). From CURVE_BLOCK_COUNT blocks on, old blocks fade.
    """
    y, n = state.sum[i] / BLOCK_ERROR_COUNT, state.n
    if n == 1:
        state.curve[i, 0], state.curve[i, 1], state.curve[i, 2] = y, 0.0, 0.0
        return 0.0
    rate, acceleration, d = state.curve[i, 1], state.curve[i, 2], n * (n + 1.0) * (n + 2.0)
    expected = state.curve[i, 0] + T * (rate + 0.5 * T * acceleration)
    nu = y - expected
    state.curve[i, 0] = expected + 3.0 * (3 * n * n - 3 * n + 2) / d * nu
    state.curve[i, 1] = rate + T * acceleration + 18.0 * (2 * n - 1) / (d * T) * nu
    state.curve[i, 2] = acceleration + 60.0 / (d * T * T) * nu
    return nu


@compiled
def means(state: WrongSlope) -> tuple[Vector, Vector]:
    """Return the means (ENU) of the beam's direction and of the error of a full block."""
    s, n = state.sum, BLOCK_ERROR_COUNT
    return Vector(s[0] / n, s[1] / n, s[2] / n), Vector(s[3] / n, s[4] / n, s[5] / n)


@compiled
def mean_variance(state: WrongSlope) -> Radians2:
    """Return the variance of the mean of the errors of a full block."""
    return state.variance / (BLOCK_ERROR_COUNT * BLOCK_ERROR_COUNT)


@compiled
def full(state: WrongSlope) -> bool:
    """Return True if the last error has ended a block. The block stays until the next error."""
    return state.count == BLOCK_ERROR_COUNT


@compiled
def _take_block(state: WrongSlope, t: Seconds, beam: Beam) -> None:
    """Update parabolas and means of the products with the present block, which ends at t with the beam."""
    T = t - state.block_stamp
    state.block_stamp = t
    state.n = min(state.n + 1, CURVE_BLOCK_COUNT)
    nu_u = Vector(_innovation(state, 0, T), _innovation(state, 1, T), _innovation(state, 2, T))
    nu_e = Vector(_innovation(state, 3, T), _innovation(state, 4, T), _innovation(state, 5, T))
    if state.n > 3:
        sigma2 = mean_variance(state)
        a, b = (dot(nu_u, beam.across), dot(nu_u, beam.up)), (dot(nu_e, beam.across), dot(nu_e, beam.up))
        for i in range(2):
            state.beam_square[i] += (a[i] * a[i] / sigma2 - state.beam_square[i]) / SLOPE_BLOCK_COUNT
            state.error_square[i] += (b[i] * b[i] / sigma2 - state.error_square[i]) / SLOPE_BLOCK_COUNT
            state.product[i] += (a[i] * b[i] / sigma2 - state.product[i]) / SLOPE_BLOCK_COUNT
        state.turn += ((a[0] * b[1] - a[1] * b[0]) / sigma2 - state.turn) / SLOPE_BLOCK_COUNT


@compiled
def roughnesses(state: WrongSlope, hypothesis: int) -> tuple[float, float]:
    """Return (J, J') of a hypothesis [-]; HYPOTHESIS_COUNT names the hypotheses.

    A turn below 90 deg counts as one of 90 deg.
    """
    if hypothesis < 2:
        S, C = state.beam_square[hypothesis] + state.error_square[hypothesis], state.product[hypothesis]
        return S + 2.0 * C, S - 2.0 * C
    size = SMALL_SLOPE if hypothesis == 3 else 1.0
    A, B = state.beam_square[0] + state.beam_square[1], state.error_square[0] + state.error_square[1]
    C = state.product[0] + state.product[1]
    return A + B + 2.0 * C, size * size * A + B - 2.0 * size * math.hypot(max(C, 0.0), state.turn)


@compiled
def leaving_error(state: Divergence, beamwidth: Radians) -> Radians:
    """Return the mean error of a block above which the target leaves the beam; inf if the filter follows badly, so
    that its lag may explain every error."""
    return LEAVING_ERROR_BEAMWIDTHS * beamwidth if state.m < MAX_FOLLOWING_MEAN else math.inf


@compiled
def score(state: WrongSlope, hypothesis: int, leaves: bool) -> float:
    """Return J less the part of it that J' permits, over its margin [-]: above 1 the slope is that of the hypothesis.
    leaves: True if the target leaves the beam."""
    J, other = roughnesses(state, hypothesis)
    if hypothesis == 3:
        return (J - SMALL_SLOPE_RATIO * max(other - 2.0 * SMALL_SLOPE_EXPLAINED, 0.0)) / SMALL_SLOPE_MARGIN
    explained = EXPLAINED_ROUGHNESS * (1.0 if hypothesis < 2 else 2.0)
    ratio = LEAVING_RATIO if leaves else WRONG_SLOPE_RATIO
    return (J - ratio * max(other - explained, 0.0)) / WRONG_SLOPE_MARGIN


@compiled
def _largest_score(state: WrongSlope, leaving: Radians) -> float:
    """Return the largest score of all hypotheses after a full block, 0 before the first verdict; leaving: see
    leaving_error."""
    if state.n < MIN_BLOCK_COUNT:
        return 0.0
    x, y, z = state.sum[3], state.sum[4], state.sum[5]
    mean, largest = math.sqrt(x * x + y * y + z * z) / BLOCK_ERROR_COUNT, 0.0
    leaves = mean > max(SMALL_LEAVING_SHARE * leaving, SMALL_LEAVING_SIGMAS * math.sqrt(mean_variance(state)))
    for hypothesis in range(HYPOTHESIS_COUNT if leaves else HYPOTHESIS_COUNT - 1):
        largest = max(largest, score(state, hypothesis, mean > leaving))
    return largest


@compiled
def take_slope(state: WrongSlope, t: Seconds, beam: Beam, error: tuple[Radians, Radians], variance: Radians2,
               gap: Seconds, leaving: Radians) -> bool:
    """Take an error (cross-elevation, elevation) of a variance, measured at t with the beam; return True if it ends a
    block and the slope is wrong. The test begins again after the time `gap` without errors."""
    T = t - state.stamp
    if T <= 0.0:
        return False
    state.stamp = t
    if T > gap:
        _clear_slope(state)
    elif full(state):
        _clear_block(state)
    u, across, up = beam.u, beam.across, beam.up
    for i, x in enumerate((u.x, u.y, u.z)):
        state.sum[i] += x
    for i, (x, y) in enumerate(((across.x, up.x), (across.y, up.y), (across.z, up.z))):
        state.sum[3 + i] += error[0] * x + error[1] * y
    state.variance += variance
    state.count += 1
    if not full(state):
        return False
    _take_block(state, t, beam)
    state.score = _largest_score(state, leaving)
    return state.score > 1.0
