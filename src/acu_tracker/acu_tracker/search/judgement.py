"""Judgement of a signal before autotrack closes the loop on it: main lobe or side lobe, slopes of the errors.

The first side lobe of a dish is 18 to 25 dB below the main lobe, at 1.5 to 2 b from its axis (b: beamwidth). In the
side lobe the difference channels of the receiver have a false null, which an antenna can track as long as the signal
lasts. A side lobe is detected by its level: it is far below the level that range and gain give. If range and gain are
unknown, the beam looks around: it visits six places 1.2 b off. If the beam was in a side lobe, one of these places is
within the main lobe.

For the slopes the mode acquire moves the beam on a small circle about the expected place of the target. The measured
errors should follow the offset of this place one for one. The matrix K of their slopes comes from a least-squares fit:

    K = S_ed S_dd^-1,    S_ed = sum (e - e') (d - d')^T,    S_dd = sum (d - d') (d - d')^T

d: offset of the expected place from the beam, e: error of the receiver, d', e': their means over the samples [rad];
each is (cross-elevation, elevation). The diagonal of K is 1 without a fault, negative if a sign is wrong, and
cos(beta) if the axes of the errors are turned by beta. A constant error of the expected place changes only the means,
and not K.
"""
import math
from typing import Annotated

from pedestal_common.compiled import compiled
from pedestal_common.quantities import DecibelHertz, Floats, Meters, Pair, Radians, Vector3
from pedestal_common.record import Record

SIDE_LOBE_MARGIN_DB = 10.0  # distance below the expected level at which a signal counts as one in a side lobe [dB]
LOOK_AROUND_PLACES = 6  # number of places of a look-around
LOOK_AROUND_BEAMWIDTHS = 1.2  # distance of the places of a look-around [beamwidths]
MIN_IMPROVEMENT_DB = 2.0  # least increase of the level for which the beam moves to another place [dB]


@compiled
def expected_level(cn0_dbhz: DecibelHertz, reference_range: Meters, exponent: float, distance: Meters) -> DecibelHertz:
    """Return the level that is expected on the axis of the beam. It falls with the power `exponent` of the range from
    cn0_dbhz at reference_range; without a distance (NaN) it is cn0_dbhz."""
    if math.isnan(distance) or distance <= 0.0:
        return cn0_dbhz
    return cn0_dbhz - 10.0 * exponent * math.log10(distance / reference_range)


@compiled
def suspected(z: DecibelHertz, level: DecibelHertz) -> bool:
    """Return True if a level z is more than SIDE_LOBE_MARGIN_DB below the expected level."""
    return z < level - SIDE_LOBE_MARGIN_DB


@compiled
def look_around_place(i: int, beamwidth: Radians) -> tuple[Radians, Radians]:
    """Return the offset (cross-elevation, elevation) of place i of a look-around; place 0 is the centre."""
    if i == 0:
        return 0.0, 0.0
    angle = 2.0 * math.pi * (i - 1) / LOOK_AROUND_PLACES
    return LOOK_AROUND_BEAMWIDTHS * beamwidth * math.cos(angle), LOOK_AROUND_BEAMWIDTHS * beamwidth * math.sin(angle)


@compiled
def best_place(levels: Floats) -> int:
    """Return the number of the place with the highest level; 0 unless it gains more than MIN_IMPROVEMENT_DB."""
    highest = 0
    for i in range(1, 1 + LOOK_AROUND_PLACES):
        if levels[i] > levels[highest]:
            highest = i
    return highest if levels[highest] > levels[0] + MIN_IMPROVEMENT_DB else 0


class Slopes(Record):
    """State of the fit."""
    n: int          # number of samples
    d: Pair         # mean d' [rad]
    e: Pair         # mean e' [rad]
    dd: Vector3     # sum S_dd (xx, xe, ee) [rad2]
    ed: Annotated[Floats, (2, 2)]   # sum S_ed [rad2]


MIN_SLOPE = 0.5
"""Slope below which autotrack does not begin [-]. Axes that are turned by 60 deg have this slope. Such a turn uses up
the phase margin of the loop."""

VERDICT_UNKNOWN, VERDICT_RIGHT, VERDICT_WRONG = range(3)  # verdicts of the check


@compiled
def restart_slopes(state: Slopes) -> None:
    """Clear the samples."""
    state.n = 0
    state.d[:] = 0.0
    state.e[:] = 0.0
    state.dd[:] = 0.0
    state.ed[0, 0] = state.ed[0, 1] = state.ed[1, 0] = state.ed[1, 1] = 0.0


@compiled
def take_slopes(state: Slopes, d: tuple[Radians, Radians], e: tuple[Radians, Radians]) -> None:
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
    """Return the slopes (K_xx, K_ee) [-]; both are NaN until the beam has moved on both axes."""
    det = state.dd[0] * state.dd[2] - state.dd[1] * state.dd[1]
    return ((state.ed[0, 0] * state.dd[2] - state.ed[0, 1] * state.dd[1]) / det,
            (state.ed[1, 1] * state.dd[0] - state.ed[1, 0] * state.dd[1]) / det)


@compiled
def slope_verdict(state: Slopes, samples: int) -> int:
    """Return VERDICT_RIGHT or VERDICT_WRONG; VERDICT_UNKNOWN with less than `samples` samples."""
    if state.n < samples:
        return VERDICT_UNKNOWN
    x, e = slopes(state)
    return VERDICT_RIGHT if x >= MIN_SLOPE and e >= MIN_SLOPE else VERDICT_WRONG
