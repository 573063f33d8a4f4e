"""The modes search and acquire: the motion of the beam from a lost target to a signal on which autotrack can begin.

The mode search leads the beam over the last place of the target, a small area and the full area. After the level has
passed its peak, the mode acquire returns the beam to the peak. Acquire has these phases:

    settle         wait until the level is that of the new place
    look around    visit six places around the peak, go to the best one and settle there. This phase is left out if the
                   expected level shows that the beam is in the main lobe
    peak           measure the level one step to either side in both axes, as step track does, and go to the peak
    check          move on a small circle to check the sign of the slopes of the receiver errors, then go to the
                   direction that the errors show

The result is the offset of the beam from the expected place of the target; the caller supplies this place. An offset
may jump, because the shaper of each axis smooths the motion.

beamwidth: half-power beamwidth; z: signal level, C/N0.
"""
import math
from typing import Annotated

from acu_tracker.search import level, pattern, place, side_lobe, slope_check, step_track
from acu_tracker.search.params import AcquisitionParameters, SearchParameters
from acu_tracker.search.pattern import Area, Point
from pedestal_common.codes import codes
from pedestal_common.compiled import compiled
from pedestal_common.quantities import DecibelHertz, Floats, Meters, Pair, Radians, Records, Seconds
from pedestal_common.record import Record

ACQUISITION_PHASES = ('settle', 'look around', 'peak', 'check', 'checked', 'wrong slope')
Phase = codes(ACQUISITION_PHASES)


class Acquisition(Record):
    """State of search and acquire."""
    level: level.Level
    slopes: slope_check.Slopes
    step_track: step_track.StepTrack
    place: place.Place      # expected place of the target without a program
    began: Seconds          # begin of search or acquire
    radius: Radians         # of the small area
    peak: DecibelHertz      # highest level so far
    # offset of the beam from the expected place: of the highest level in search, then the present centre of acquire,
    # or the offset of step track; cross-elevation, elevation [rad]
    centre: Pair
    phase: int              # phase of acquire, a code of ACQUISITION_PHASES
    since: Seconds          # time at which the phase or its present place began
    place_number: int       # number of the present place in the phase; 0: the centre
    levels: Annotated[Floats, (1 + side_lobe.LOOK_AROUND_PLACES,)]  # levels at the places of the phase [dB-Hz]
    look_around_count: int  # number of the phases look around so far
    peak_count: int         # number of the phases peak so far
    wrong_slope_count: int  # number of slope checks with a wrong slope
    fair: Seconds           # last time at which the level was not suspected to be that of a side lobe


LEVEL_SETTLING_LAGS = 4.0  # number of time constants of the level after which it is that of a new place
PEAK_DROP_DB = 1.0  # drop of the level below its peak at which search ends and the beam returns to the peak [dB]
MAX_RISE_TIME_S = 1.0  # time for which the level may stay above its threshold before search ends without a drop [s]

CIRCLE_RADIUS_BEAMWIDTHS, CIRCLE_PERIOD_S, CIRCLE_TURN_COUNT = 0.1, 0.5, 2.0
"""Circle of the slope check: radius [beamwidths], time of a turn [s], number of turns. The radius grows during the
first turn."""

MIN_CHECK_ERROR_COUNT = 50  # least number of errors in a slope check
MAX_LOOK_AROUND_COUNT = 4  # number of phases `look around` after which acquire continues with the present place

PEAK_STEP_BEAMWIDTHS, MAX_PEAK_MOVE_BEAMWIDTHS = 0.3, 0.7
"""Phase `peak`: step to either side of the centre, and longest move of the centre [beamwidths]. After a move beyond
the length of the step the phase is repeated."""

MAX_PEAK_COUNT = 3  # largest number of phases `peak` before a slope check

PEAK_OFFSETS_BEAMWIDTHS = ((0.0, 0.0), (PEAK_STEP_BEAMWIDTHS, 0.0), (-PEAK_STEP_BEAMWIDTHS, 0.0),
                           (0.0, PEAK_STEP_BEAMWIDTHS), (0.0, -PEAK_STEP_BEAMWIDTHS))
"""Offsets of the places of the phase `peak` from the centre: cross-elevation, elevation [beamwidths]."""


def initialise(record: Records) -> None:
    """Start before the first level."""
    record['level']['stamp'] = -math.inf


@compiled
def begin_search(state: Acquisition, params: SearchParameters, beamwidth: Radians, t: Seconds, sigma: Radians) -> None:
    """Start a search at t.

    sigma: standard deviation of the expected place, NaN if it is not known. The radius of the small area is at least
    2 sigma.
    """
    state.began = t
    state.radius = params.small * beamwidth
    if 2.0 * sigma > state.radius:
        state.radius = min(2.0 * sigma, params.full * beamwidth)
    state.peak = -math.inf
    state.centre[0] = state.centre[1] = 0.0
    level.restart_times(state.level)


@compiled
def area(state: Acquisition, params: SearchParameters, tau: Seconds, beamwidth: Radians, full: bool) -> Area:
    """Return the small area, or the full area if `full` is True; tau: time constant of the level."""
    radius = params.full * beamwidth if full else state.radius
    return Area(int(params.pattern), radius, params.across * radius, params.pitch * beamwidth,
                pattern.highest_speed(beamwidth, tau, params.speed))


@compiled
def searched(state: Acquisition, params: SearchParameters, tau: Seconds, beamwidth: Radians,
             t: Seconds) -> tuple[Point, bool]:
    """Return (offset of the beam at t, along and across the track of the target; True if all rounds are over).

    tau: time constant of the level.
    """
    small, full = area(state, params, tau, beamwidth, False), area(state, params, tau, beamwidth, True)
    T_small, T_full = pattern.duration(small), pattern.duration(full)
    t -= state.began + params.wait
    if t < 0.0:
        return Point(0.0, 0.0, 0.0, 0.0), False
    over = t >= params.rounds * (T_small + T_full)
    t -= math.floor(t / (T_small + T_full)) * (T_small + T_full)
    return (pattern.point(small, t) if t < T_small else pattern.point(full, t - T_small)), over


@compiled
def waiting(state: Acquisition, params: SearchParameters, t: Seconds) -> bool:
    """Return True while the search at t still waits at the last place."""
    return t < state.began + params.wait


@compiled
def note_peak(state: Acquisition, offset: tuple[Radians, Radians]) -> None:
    """Keep the offset if the level is the highest so far.

    offset: cross-elevation and elevation of the beam when the receiver measured the level.
    """
    if state.level.z > state.peak:
        state.peak = state.level.z
        state.centre[0], state.centre[1] = offset


@compiled
def peak_passed(state: Acquisition, params: AcquisitionParameters) -> bool:
    """Return True if there is a signal and the beam has passed its peak, or has had the signal for MAX_RISE_TIME_S."""
    return level.detected(state.level, params) and (state.level.z < state.peak - PEAK_DROP_DB
                                                    or state.level.above_detect > MAX_RISE_TIME_S)


@compiled
def begin_acquire(state: Acquisition, t: Seconds) -> None:
    """Start the mode acquire at t, with the beam at the centre."""
    state.began, state.look_around_count, state.peak_count, state.wrong_slope_count = t, 0, 0, 0
    state.levels[:] = -math.inf
    _enter(state, Phase.SETTLE, t)


@compiled
def _enter(state: Acquisition, phase: int, t: Seconds) -> None:
    state.phase, state.since, state.place_number = phase, t, 0


@compiled
def acquire(state: Acquisition, params: AcquisitionParameters, beamwidth: Radians, t: Seconds,
            distance: Meters) -> None:
    """Advance the mode acquire to t; distance: measured range of the target, NaN if there is none."""
    settled = t - state.since >= LEVEL_SETTLING_LAGS * params.time_constant
    if state.phase == Phase.SETTLE and settled:
        state.levels[0] = state.level.z
        axis = side_lobe.expected(params.expected_dbhz, params.reference_range, params.range_exponent, distance)
        main = params.expected_dbhz > 0.0 and not side_lobe.suspected(state.level.z, axis)
        if main or state.look_around_count >= MAX_LOOK_AROUND_COUNT:
            _peak(state, t)
        else:
            _enter(state, Phase.LOOK_AROUND, t)
            state.place_number, state.look_around_count = 1, state.look_around_count + 1
    elif (state.phase == Phase.LOOK_AROUND or state.phase == Phase.PEAK) and settled:
        state.levels[state.place_number] = state.level.z
        state.place_number, state.since = state.place_number + 1, t
        if state.phase == Phase.LOOK_AROUND and state.place_number > side_lobe.LOOK_AROUND_PLACES:
            _go_to_best(state, beamwidth, t)
        elif state.phase == Phase.PEAK and state.place_number >= len(PEAK_OFFSETS_BEAMWIDTHS):
            _go_to_peak(state, beamwidth, t)
    elif state.phase == Phase.CHECK and t - state.since >= CIRCLE_TURN_COUNT * CIRCLE_PERIOD_S:
        _apply_verdict(state, t)


@compiled
def _go_to_best(state: Acquisition, beamwidth: Radians, t: Seconds) -> None:
    """End the phase `look around`: settle at the best place, or begin the phase `peak` if no place is better."""
    chosen = side_lobe.best(state.levels)
    x, e = side_lobe.place(chosen, beamwidth)
    state.centre[0] += x
    state.centre[1] += e
    if chosen != 0:
        _enter(state, Phase.SETTLE, t)
    else:
        _peak(state, t)


@compiled
def _peak(state: Acquisition, t: Seconds) -> None:
    """Begin the phase `peak` with place 1, because the level at the centre (place 0) is known."""
    _enter(state, Phase.PEAK, t)
    state.place_number, state.peak_count = 1, state.peak_count + 1


@compiled
def _go_to_peak(state: Acquisition, beamwidth: Radians, t: Seconds) -> None:
    """End the phase `peak`: go to the peak, and check the slopes there. If the peak was far, repeat the phase."""
    far = False
    for i in range(2):
        move = step_track.peak(state.levels[1 + 2 * i], state.levels[2 + 2 * i], PEAK_STEP_BEAMWIDTHS * beamwidth,
                               beamwidth)
        far |= abs(move) > PEAK_STEP_BEAMWIDTHS * beamwidth
        state.centre[i] += min(max(move, -MAX_PEAK_MOVE_BEAMWIDTHS * beamwidth), MAX_PEAK_MOVE_BEAMWIDTHS * beamwidth)
    if far and state.peak_count < MAX_PEAK_COUNT:
        _peak(state, t)
    else:
        _enter(state, Phase.CHECK, t)
        slope_check.restart(state.slopes)


@compiled
def _apply_verdict(state: Acquisition, t: Seconds) -> None:
    """End the slope check: go to the direction of the errors if the slopes are right; fail if they are wrong twice."""
    verdict = slope_check.verdict(state.slopes, MIN_CHECK_ERROR_COUNT)
    if verdict == slope_check.VERDICT_RIGHT:
        # The mean error over whole turns of the circle is the error at the centre. After this move the errors are
        # small, on the straight part of the error curve, as the filter expects.
        state.centre[0] += state.slopes.e[0]
        state.centre[1] += state.slopes.e[1]
        state.phase = Phase.CHECKED
    elif verdict == slope_check.VERDICT_WRONG:
        state.wrong_slope_count += 1
        if state.wrong_slope_count > 1:
            state.phase = Phase.WRONG_SLOPE
        else:
            state.peak_count = 0
            _peak(state, t)


@compiled
def acquired(state: Acquisition, beamwidth: Radians, t: Seconds) -> Point:
    """Return the offset of the beam in the mode acquire at t, in cross-elevation and elevation."""
    x, e = state.centre[0], state.centre[1]
    if state.phase == Phase.LOOK_AROUND:
        aside, up = side_lobe.place(state.place_number, beamwidth)
        return Point(x + aside, e + up, 0.0, 0.0)
    if state.phase == Phase.PEAK:
        aside, up = PEAK_OFFSETS_BEAMWIDTHS[state.place_number]
        return Point(x + aside * beamwidth, e + up * beamwidth, 0.0, 0.0)
    if state.phase != Phase.CHECK:
        return Point(x, e, 0.0, 0.0)
    c = pattern.circle(CIRCLE_RADIUS_BEAMWIDTHS * beamwidth, CIRCLE_PERIOD_S, t - state.since)
    return Point(x + c.x, e + c.y, c.dx, c.dy)


@compiled
def take_error(state: Acquisition, expected: tuple[Radians, Radians], error: tuple[Radians, Radians]) -> None:
    """Take an error of the receiver during the slope check.

    expected  offset of the expected place of the target from the beam when the error was measured
    error     the error; both are (cross-elevation, elevation)
    """
    if state.phase == Phase.CHECK:
        slope_check.take(state.slopes, expected, error)


@compiled
def failed(state: Acquisition, params: AcquisitionParameters, t: Seconds) -> bool:
    """Return True if acquire gives up at t: the signal at the centre is lost, or the timeout is over."""
    at_centre = state.phase != Phase.LOOK_AROUND and state.phase != Phase.PEAK
    settled = at_centre and t - state.since > LEVEL_SETTLING_LAGS * params.time_constant
    return t - state.began > params.timeout or (settled and state.level.below_loss >= params.loss_time)
