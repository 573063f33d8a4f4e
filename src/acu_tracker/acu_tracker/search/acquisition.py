"""The modes search, acquire and steptrack, which move the beam about the expected place of the target by its level.

The mode search leads the beam over the last place of the target, a small area and the full area. After the level has
passed its peak, the mode acquire returns the beam to the peak. Acquire has these phases:

    settle         wait until the level is that of the new place
    look around    visit six places around the peak, go to the best one and settle there. This phase is left out if the
                   expected level shows that the beam is in the main lobe
    peak           measure the level one step to either side in both axes, as step track does, and go to the peak
    check          move on a small circle to check the sign of the slopes of the receiver errors, then go to the
                   direction that the errors show

An offset may jump, because the shaper of each axis smooths the motion.

`way` is the program, rotated to the place where the target was last tracked.
"""
import dataclasses
import math
from typing import TYPE_CHECKING, Annotated

from acu_tracker import modes
from acu_tracker.estimation import target
from acu_tracker.geometry.vector import Motion, Vector
from acu_tracker.modes import Mode, Reason
from acu_tracker.program import bridge, program_track
from acu_tracker.search import judgement, level, pattern, place, step_track
from acu_tracker.search.level import AcquisitionParameters
from acu_tracker.search.pattern import SEARCH_PATTERNS, Area, Point
from acu_tracker.signals import Inputs
from pedestal_common.codes import codes
from pedestal_common.compiled import compiled
from pedestal_common.parameters import Parameters, choice, parameter
from pedestal_common.quantities import DecibelHertz, Floats, Meters, Pair, Radians, Records, Seconds
from pedestal_common.record import Record

if TYPE_CHECKING:
    from acu_tracker.control_unit import Constants


@dataclasses.dataclass(frozen=True)
class SearchParameters(Parameters):
    """Mode search: rounds of the small and the full area, after a wait at the last place."""

    pattern: str = choice('spiral', SEARCH_PATTERNS, 'search path; square and raster lie along the track')
    wait: float = parameter(2.5, 0.0, 600.0, 's', 'time at the last place before the first round, in which the noise '
                            'is learnt')
    small: float = parameter(1.5, 0.1, 50.0, 'beamwidths', 'radius of the small area', must_be='at most full')
    full: float = parameter(5.0, 0.1, 200.0, 'beamwidths', 'radius of the full area')
    across: float = parameter(0.3, 0.0, 1.0, '', 'raster, sector: width of the area across the track over its length')
    pitch: float = parameter(0.7, 0.1, 1.0, 'beamwidths', 'distance between neighbouring lines')
    speed: float = parameter(1.0, 0.01, 1.0, '', 'speed of the beam, in beamwidths per 4 time constants of the level')
    rounds: int = parameter(3, 1, 1000, '', 'number of rounds after which the search ends without a signal; a round '
                            'covers the small area once, then the full area once')



ACQUISITION_PHASES = ('settle', 'look around', 'peak', 'check', 'checked', 'wrong slope')
Phase = codes(ACQUISITION_PHASES)


class Acquisition(Record):
    """State of the modes that use the signal level."""
    level: level.Level
    slopes: judgement.Slopes
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
    levels: Annotated[Floats, (1 + judgement.LOOK_AROUND_PLACES,)]  # levels at the places of the phase [dB-Hz]
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

SIDE_LOBE_TIME_S = 0.3
"""Time for which the level must be that of a side lobe before autotrack ends [s]. The time may begin in the mode
program. Because the filter diverges within 0.4 s on the slopes of a side lobe, the time is shorter."""


def initialise(record: Records) -> None:
    """Start before the first level."""
    record['level']['stamp'] = -math.inf


@compiled
def remember(state: Acquisition, t: Seconds, u: Vector, du: Vector) -> None:
    """Store the expected place of the target at t: an ENU unit vector u and its rate du [1/s]."""
    place.remember(state.place, t, u, du)
    state.centre[0] = state.centre[1] = 0.0


@compiled
def expected(state: Acquisition, way: bridge.Way, t: Seconds) -> Motion:
    """Return the motion in earth angles of the expected place of the target at t. The place follows the program,
    rotated to where the target was last tracked. Without a program it is the last place, moved on with a rate that
    fades."""
    if program_track.status(way.program, t) != Reason.NONE:
        return place.motion_at(state.place, t)
    return bridge.motion_at(way, t)


@compiled
def source(state: Acquisition, mode: int, constants: 'Constants', way: bridge.Way, t: Seconds) -> target.Source:
    """Return the target.Source to which the beam points at t: the expected place plus the offset of the mode."""
    motion = expected(state, way, t)
    return target.Source(0, place.displaced(motion, _offset(state, mode, constants, t, motion)))


@compiled
def _offset(state: Acquisition, mode: int, constants: 'Constants', t: Seconds, motion: Motion) -> Point:
    """Return the offset of the beam at t from the expected place of this motion, in cross-elevation and elevation."""
    beamwidth = constants.p.tracker.receiver.beamwidth
    if mode == Mode.SEARCH:
        p, _ = searched(state, constants.p.search, constants.p.acquisition.time_constant, beamwidth, t)
        return pattern.rotated(p, place.track(motion))
    if mode == Mode.ACQUIRE:
        return acquired(state, beamwidth, t)
    return Point(state.centre[0], state.centre[1], 0.0, 0.0)


@compiled
def begin(state: Acquisition, mode: int, constants: 'Constants', t: Seconds, spread: Radians) -> None:
    """Enter a mode that uses the signal level at t. spread: standard deviation of the expected place, across the line
    of sight; NaN if it is not known."""
    level.restart_times(state.level)
    if mode == Mode.SEARCH:
        begin_search(state, constants.p.search, constants.p.tracker.receiver.beamwidth, t, spread)
    elif mode == Mode.ACQUIRE:
        begin_acquire(state, t)
    else:
        step_track.start(state.step_track, t, state.centre[0], state.centre[1])


@compiled
def begin_search(state: Acquisition, params: SearchParameters, beamwidth: Radians, t: Seconds, sigma: Radians) -> None:
    """Start a search at t; the radius of the small area is at least 2 sigma (of the expected place)."""
    state.began = t
    state.radius = params.small * beamwidth
    if 2.0 * sigma > state.radius:
        state.radius = min(2.0 * sigma, params.full * beamwidth)
    state.peak = -math.inf
    state.centre[0] = state.centre[1] = 0.0


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
def advance(state: Acquisition, mode: int, constants: 'Constants', inputs: Inputs, way: bridge.Way) -> bool:
    """Take the level of a step and advance the running mode. Return True if acquire has found a slope of wrong sign.
    mode: the mode of the previous step. While the beam is off the target, the level is noise alone; the function then
    learns the statistics of the noise."""
    p, beamwidth = constants.p.acquisition, constants.p.tracker.receiver.beamwidth
    new = inputs.error_stamp > state.level.stamp and math.isfinite(inputs.cn0_dbhz)
    waiting = mode == Mode.SEARCH and inputs.stamp < state.began + constants.p.search.wait
    if inputs.error_valid:
        level.restart_noise(state.level, p)
    elif new and math.isfinite(state.level.stamp) and (waiting or not modes.FOLLOWS_TARGET[mode]):
        level.learn(state.level, p, inputs.cn0_dbhz, min(inputs.error_stamp - state.level.stamp, p.time_constant))
    level.take(state.level, p, inputs.cn0_dbhz, inputs.error_stamp, inputs.error_valid != 0)
    if mode == Mode.SEARCH and new and state.level.z > state.peak:
        # The receiver smooths the level, which therefore belongs to the offset one time constant ago.
        t = inputs.error_stamp - p.time_constant
        offset = _offset(state, mode, constants, t, expected(state, way, t))
        state.peak, state.centre[0], state.centre[1] = state.level.z, offset.x, offset.y
    elif mode == Mode.ACQUIRE:
        acquire(state, p, beamwidth, inputs.stamp, inputs.range)
    elif mode == Mode.STEPTRACK:
        present = state.level.below_loss < p.loss_time
        state.centre[0], state.centre[1] = step_track.step(
            state.step_track, constants.p.steptrack, beamwidth, p.time_constant, inputs.stamp,
            inputs.cn0_dbhz if new else math.nan, present)
    level_on_axis = judgement.expected_level(p.expected_dbhz, p.reference_range, p.range_exponent, inputs.range)
    judged = mode == Mode.PROGRAM or mode == Mode.AUTOTRACK
    # A level is called fair if it is not suspected to be that of a side lobe.
    fair = not judged or not inputs.error_valid or not judgement.suspected(inputs.cn0_dbhz, level_on_axis)
    if fair:
        state.fair = inputs.stamp
    return mode == Mode.ACQUIRE and state.phase == Phase.WRONG_SLOPE


@compiled
def found(state: Acquisition, mode: int, constants: 'Constants') -> bool:
    """Return True if the mode search may hand over to acquire, or the mode acquire to autotrack. Search hands over if
    there is a signal and the beam has passed its peak, or has had the signal for MAX_RISE_TIME_S."""
    if mode == Mode.SEARCH:
        passed = state.level.z < state.peak - PEAK_DROP_DB or state.level.above_detect > MAX_RISE_TIME_S
        return level.detected(state.level, constants.p.acquisition) and passed
    return state.phase == Phase.CHECKED


@compiled
def end(state: Acquisition, mode: int, constants: 'Constants', t: Seconds) -> int:
    """Return the reason why a mode that uses the signal level ends at t, or NONE."""
    p, beamwidth = constants.p.acquisition, constants.p.tracker.receiver.beamwidth
    if mode == Mode.SEARCH:
        _, over = searched(state, constants.p.search, p.time_constant, beamwidth, t)
        return Reason.NOT_FOUND if over else Reason.NONE
    if mode == Mode.ACQUIRE:
        if state.phase == Phase.WRONG_SLOPE:
            return Reason.WRONG_SLOPE
        return Reason.SIGNAL_LOST if failed(state, p, t) else Reason.NONE
    if mode == Mode.STEPTRACK and state.level.below_loss >= p.loss_time:
        return Reason.SIGNAL_LOST
    return Reason.NONE


@compiled
def in_side_lobe(state: Acquisition, constants: 'Constants', t: Seconds) -> bool:
    """Return True if the level has been that of a side lobe for SIDE_LOBE_TIME_S up to t."""
    return constants.p.acquisition.expected_dbhz > 0.0 and t - state.fair > SIDE_LOBE_TIME_S


@compiled
def area(state: Acquisition, params: SearchParameters, tau: Seconds, beamwidth: Radians, full: bool) -> Area:
    """Return the small or the full area; tau: time constant of the level."""
    radius = params.full * beamwidth if full else state.radius
    return Area(int(params.pattern), radius, params.across * radius, params.pitch * beamwidth,
                pattern.highest_speed(beamwidth, tau, params.speed))


@compiled
def searched(state: Acquisition, params: SearchParameters, tau: Seconds, beamwidth: Radians,
             t: Seconds) -> tuple[Point, bool]:
    """Return (offset of the beam at t, along and across the track of the target; True if all rounds are over)."""
    small, full = area(state, params, tau, beamwidth, False), area(state, params, tau, beamwidth, True)
    T_small, T_full = pattern.duration(small), pattern.duration(full)
    t -= state.began + params.wait
    if t < 0.0:
        return Point(0.0, 0.0, 0.0, 0.0), False
    over = t >= params.rounds * (T_small + T_full)
    t -= math.floor(t / (T_small + T_full)) * (T_small + T_full)
    return (pattern.point(small, t) if t < T_small else pattern.point(full, t - T_small)), over


@compiled
def acquire(state: Acquisition, params: AcquisitionParameters, beamwidth: Radians, t: Seconds,
            distance: Meters) -> None:
    """Advance the mode acquire to t; distance: measured range of the target, NaN if there is none."""
    settled = t - state.since >= LEVEL_SETTLING_LAGS * params.time_constant
    if state.phase == Phase.SETTLE and settled:
        state.levels[0] = state.level.z
        axis = judgement.expected_level(params.expected_dbhz, params.reference_range, params.range_exponent, distance)
        main = params.expected_dbhz > 0.0 and not judgement.suspected(state.level.z, axis)
        if main or state.look_around_count >= MAX_LOOK_AROUND_COUNT:
            _peak(state, t)
        else:
            _enter(state, Phase.LOOK_AROUND, t)
            state.place_number, state.look_around_count = 1, state.look_around_count + 1
    elif (state.phase == Phase.LOOK_AROUND or state.phase == Phase.PEAK) and settled:
        state.levels[state.place_number] = state.level.z
        state.place_number, state.since = state.place_number + 1, t
        if state.phase == Phase.LOOK_AROUND and state.place_number > judgement.LOOK_AROUND_PLACES:
            _go_to_best(state, beamwidth, t)
        elif state.phase == Phase.PEAK and state.place_number >= len(PEAK_OFFSETS_BEAMWIDTHS):
            _go_to_peak(state, beamwidth, t)
    elif state.phase == Phase.CHECK and t - state.since >= CIRCLE_TURN_COUNT * CIRCLE_PERIOD_S:
        _apply_verdict(state, t)


@compiled
def _go_to_best(state: Acquisition, beamwidth: Radians, t: Seconds) -> None:
    """End the phase `look around`: settle at the best place, or begin the phase `peak` if no place is better."""
    chosen = judgement.best_place(state.levels)
    x, e = judgement.look_around_place(chosen, beamwidth)
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
        judgement.restart_slopes(state.slopes)


@compiled
def _apply_verdict(state: Acquisition, t: Seconds) -> None:
    """End the slope check: go to the direction of the errors if the slopes are right; fail if they are wrong twice."""
    verdict = judgement.slope_verdict(state.slopes, MIN_CHECK_ERROR_COUNT)
    if verdict == judgement.VERDICT_RIGHT:
        # The mean error over whole turns of the circle is the error at the centre. After this move the errors are
        # small, on the straight part of the error curve, as the filter expects.
        state.centre[0] += state.slopes.e[0]
        state.centre[1] += state.slopes.e[1]
        state.phase = Phase.CHECKED
    elif verdict == judgement.VERDICT_WRONG:
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
        aside, up = judgement.look_around_place(state.place_number, beamwidth)
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
    """Take an error of the receiver during the slope check; expected: offset of the expected place from the beam then.
    Both are (cross-elevation, elevation)."""
    if state.phase == Phase.CHECK:
        judgement.take_slopes(state.slopes, expected, error)


@compiled
def failed(state: Acquisition, params: AcquisitionParameters, t: Seconds) -> bool:
    """Return True if acquire gives up at t: the signal at the centre is lost, or the timeout is over."""
    at_centre = state.phase != Phase.LOOK_AROUND and state.phase != Phase.PEAK
    settled = at_centre and t - state.since > LEVEL_SETTLING_LAGS * params.time_constant
    return t - state.began > params.timeout or (settled and state.level.below_loss >= params.loss_time)
