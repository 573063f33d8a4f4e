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

s: record of Acquisition; p: record of AcquisitionParameters, except where a function states otherwise;
beamwidth: half-power beamwidth [rad]; z: signal level, C/N0 [dB-Hz].
"""
import math
from typing import Annotated

from acu_tracker.search import level, pattern, place, side_lobe, slope_check, step_track
from acu_tracker.search.pattern import Area, Point
from pedestal_common.codes import codes
from pedestal_common.compiled import compiled
from pedestal_common.quantities import Floats, Pair
from pedestal_common.record import Record

ACQUISITION_PHASES = ('settle', 'look around', 'peak', 'check', 'checked', 'wrong slope')
Phase = codes(ACQUISITION_PHASES)


class Acquisition(Record):
    """State of search and acquire."""
    level: level.Level  # level, slopes, step_track: states of the modules of the same names (slopes: slope_check)
    slopes: slope_check.Slopes
    step_track: step_track.StepTrack
    place: place.Place  # expected place of the target without a program
    began: float  # begin of search or acquire [s]
    radius: float  # radius of the small area [rad]
    peak: float  # highest level so far [dB-Hz]
    # offset of the beam from the expected place: of the highest level in search, then the present centre of acquire,
    # or the offset of step track; cross-elevation, elevation [rad]
    centre: Pair
    phase: int  # phase, since: phase of acquire, and the time at which it or its present place began [s]
    since: float
    place_number: int  # number of the present place in the phase; 0: the centre
    levels: Annotated[Floats, (1 + side_lobe.LOOK_AROUND_PLACES,)]  # levels at the places of the phase [dB-Hz]
    look_around_count: int  # look_around_count, peak_count: numbers of the phases look around and peak so far
    peak_count: int
    wrong_slope_count: int  # number of slope checks with a wrong slope
    fair: float  # last time at which the level was not suspected to be that of a side lobe [s]


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


def initialise(s):
    """Start before the first level; s (n,) of Acquisition."""
    s['level']['stamp'] = -math.inf


@compiled
def take_level(s, p, z, stamp, locked):
    """Take the level z [dB-Hz] of a stamp [s]; locked: True if the receiver measures angle errors."""
    level.take(s.level, p, z, stamp, locked)


@compiled
def learn(s, p, z, stamp):
    """Take a level z [dB-Hz] of noise alone, measured at a stamp [s]. Call this function before `take_level`."""
    if stamp > s.level.stamp and math.isfinite(z) and math.isfinite(s.level.stamp):
        level.learn(s.level, p, z, min(stamp - s.level.stamp, p.time_constant))


@compiled
def begin_search(s, p, beamwidth, t, sigma):
    """Start a search at t [s].

    p: record of SearchParameters; sigma: standard deviation of the expected place [rad], NaN if it is not known. The
    radius of the small area is at least 2 sigma.
    """
    s.began = t
    s.radius = p.small * beamwidth
    if 2.0 * sigma > s.radius:
        s.radius = min(2.0 * sigma, p.full * beamwidth)
    s.peak = -math.inf
    s.centre[0] = s.centre[1] = 0.0
    level.restart_times(s.level)


@compiled
def area(s, p, tau, beamwidth, full):
    """Return the pattern.Area of the small area, or of the full area if `full` is True.

    p: record of SearchParameters; tau: time constant of the level [s].
    """
    radius = p.full * beamwidth if full else s.radius
    return Area(p.pattern, radius, p.across * radius, p.pitch * beamwidth,
                pattern.highest_speed(beamwidth, tau, p.speed))


@compiled
def searched(s, p, tau, beamwidth, t):
    """Return (Point of the beam at t [s], along and across the track of the target; True if all rounds are over).

    p: record of SearchParameters; tau: time constant of the level [s].
    """
    small, full = area(s, p, tau, beamwidth, False), area(s, p, tau, beamwidth, True)
    T_small, T_full = pattern.duration(small), pattern.duration(full)
    t -= s.began + p.wait
    if t < 0.0:
        return Point(0.0, 0.0, 0.0, 0.0), False
    over = t >= p.rounds * (T_small + T_full)
    t -= math.floor(t / (T_small + T_full)) * (T_small + T_full)
    return (pattern.point(small, t) if t < T_small else pattern.point(full, t - T_small)), over


@compiled
def set_offset(s, x, e):
    """Set the offset (x, e) [rad] of the beam from the expected place."""
    s.centre[0], s.centre[1] = x, e


@compiled
def note_fair_level(s, t, fair):
    """Keep the time t [s] if the level is fair: not suspected to be that of a side lobe."""
    if fair:
        s.fair = t


@compiled
def waiting(s, p, t):
    """Return True while the search at t [s] still waits at the last place; p: record of SearchParameters."""
    return t < s.began + p.wait


@compiled
def note_peak(s, offset):
    """Keep the offset if the level is the highest so far.

    offset: cross-elevation and elevation of the beam when the receiver measured the level [rad].
    """
    if s.level.z > s.peak:
        s.peak = s.level.z
        s.centre[0], s.centre[1] = offset


@compiled
def peak_passed(s, p):
    """Return True if there is a signal and the beam has passed its peak, or has had the signal for MAX_RISE_TIME_S."""
    return level.detected(s.level, p) and (s.level.z < s.peak - PEAK_DROP_DB or s.level.above_detect > MAX_RISE_TIME_S)


@compiled
def begin_acquire(s, t):
    """Start the mode acquire at t [s], with the beam at the centre."""
    s.began, s.look_around_count, s.peak_count, s.wrong_slope_count = t, 0, 0, 0
    s.levels[:] = -math.inf
    _enter(s, Phase.SETTLE, t)


@compiled
def _enter(s, phase, t):
    """Begin a phase of acquire at t [s]."""
    s.phase, s.since, s.place_number = phase, t, 0


@compiled
def acquire(s, p, beamwidth, t, distance):
    """Advance the mode acquire to t [s]; distance: measured range of the target [m], NaN if there is none."""
    settled = t - s.since >= LEVEL_SETTLING_LAGS * p.time_constant
    if s.phase == Phase.SETTLE and settled:
        s.levels[0] = s.level.z
        axis = side_lobe.expected(p.expected_dbhz, p.reference_range, p.range_exponent, distance)
        main = p.expected_dbhz > 0.0 and not side_lobe.suspected(s.level.z, axis)
        if main or s.look_around_count >= MAX_LOOK_AROUND_COUNT:
            _peak(s, t)
        else:
            _enter(s, Phase.LOOK_AROUND, t)
            s.place_number, s.look_around_count = 1, s.look_around_count + 1
    elif (s.phase == Phase.LOOK_AROUND or s.phase == Phase.PEAK) and settled:
        s.levels[s.place_number] = s.level.z
        s.place_number, s.since = s.place_number + 1, t
        if s.phase == Phase.LOOK_AROUND and s.place_number > side_lobe.LOOK_AROUND_PLACES:
            _go_to_best(s, beamwidth, t)
        elif s.phase == Phase.PEAK and s.place_number >= len(PEAK_OFFSETS_BEAMWIDTHS):
            _go_to_peak(s, beamwidth, t)
    elif s.phase == Phase.CHECK and t - s.since >= CIRCLE_TURN_COUNT * CIRCLE_PERIOD_S:
        _apply_verdict(s, t)


@compiled
def _go_to_best(s, beamwidth, t):
    """End the phase `look around`: settle at the best place, or begin the phase `peak` if no place is better."""
    chosen = side_lobe.best(s.levels)
    x, e = side_lobe.place(chosen, beamwidth)
    s.centre[0] += x
    s.centre[1] += e
    if chosen != 0:
        _enter(s, Phase.SETTLE, t)
    else:
        _peak(s, t)


@compiled
def _peak(s, t):
    """Begin the phase `peak` with place 1, because the level at the centre (place 0) is known."""
    _enter(s, Phase.PEAK, t)
    s.place_number, s.peak_count = 1, s.peak_count + 1


@compiled
def _go_to_peak(s, beamwidth, t):
    """End the phase `peak`: go to the peak, and check the slopes there. If the peak was far, repeat the phase."""
    far = False
    for i in range(2):
        move = step_track.peak(s.levels[1 + 2 * i], s.levels[2 + 2 * i], PEAK_STEP_BEAMWIDTHS * beamwidth, beamwidth)
        far |= abs(move) > PEAK_STEP_BEAMWIDTHS * beamwidth
        s.centre[i] += min(max(move, -MAX_PEAK_MOVE_BEAMWIDTHS * beamwidth), MAX_PEAK_MOVE_BEAMWIDTHS * beamwidth)
    if far and s.peak_count < MAX_PEAK_COUNT:
        _peak(s, t)
    else:
        _enter(s, Phase.CHECK, t)
        slope_check.restart(s.slopes)


@compiled
def _apply_verdict(s, t):
    """End the slope check: go to the direction of the errors if the slopes are right; fail if they are wrong twice."""
    verdict = slope_check.verdict(s.slopes, MIN_CHECK_ERROR_COUNT)
    if verdict == slope_check.VERDICT_RIGHT:
        # The mean error over whole turns of the circle is the error at the centre. After this move the errors are
        # small, on the straight part of the error curve, as the filter expects.
        s.centre[0] += s.slopes.e[0]
        s.centre[1] += s.slopes.e[1]
        s.phase = Phase.CHECKED
    elif verdict == slope_check.VERDICT_WRONG:
        s.wrong_slope_count += 1
        if s.wrong_slope_count > 1:
            s.phase = Phase.WRONG_SLOPE
        else:
            s.peak_count = 0
            _peak(s, t)


@compiled
def acquired(s, beamwidth, t):
    """Return the Point of the beam in the mode acquire at t [s], in cross-elevation and elevation."""
    x, e = s.centre[0], s.centre[1]
    if s.phase == Phase.LOOK_AROUND:
        aside, up = side_lobe.place(s.place_number, beamwidth)
        return Point(x + aside, e + up, 0.0, 0.0)
    if s.phase == Phase.PEAK:
        aside, up = PEAK_OFFSETS_BEAMWIDTHS[s.place_number]
        return Point(x + aside * beamwidth, e + up * beamwidth, 0.0, 0.0)
    if s.phase != Phase.CHECK:
        return Point(x, e, 0.0, 0.0)
    c = pattern.circle(CIRCLE_RADIUS_BEAMWIDTHS * beamwidth, CIRCLE_PERIOD_S, t - s.since)
    return Point(x + c.x, e + c.y, c.dx, c.dy)


@compiled
def take_error(s, expected, error):
    """Take an error of the receiver during the slope check.

    expected  offset of the expected place of the target from the beam when the error was measured
    error     the error; both are (cross-elevation, elevation) [rad]
    """
    if s.phase == Phase.CHECK:
        slope_check.take(s.slopes, expected, error)


@compiled
def failed(s, p, t):
    """Return True if acquire gives up at t [s]: the signal at the centre is lost, or the timeout is over."""
    at_centre = s.phase != Phase.LOOK_AROUND and s.phase != Phase.PEAK
    settled = at_centre and t - s.since > LEVEL_SETTLING_LAGS * p.time_constant
    return t - s.began > p.timeout or (settled and s.level.below_loss >= p.loss_time)
