"""From a lost target to one that the loop may be closed on: search, acquire, step track, as offsets of the beam.

Search leads the beam over the last place, the small area and the full one. Where the level has passed its peak,
acquire goes back to it and

    settles         until the level is that of the new place,
    looks around    unless the expected level says that this is the main lobe; goes to the better place and settles,
    peaks           by the level at a step to either side of both axes, as step track does,
    checks          the sign of the slopes on a small circle, and goes to where the errors lead.

Every offset is about the expected place of the target, which the caller knows; it is demanded at once, and the shaper
of each axis makes the way to it smooth.
"""
import math

import numpy as np

from acu_tracker.search import level, pattern, place, side_lobe, slope_check, step_track
from acu_tracker.search.pattern import Area, Point
from pedestal_common.codes import codes
from pedestal_common.compiled import compiled

ACQUISITION_PHASES = ('settle', 'look around', 'peak', 'check', 'checked', 'wrong slope')
Phase = codes(ACQUISITION_PHASES)

ACQUISITION_DTYPE = np.dtype([
    ('level', level.LEVEL_DTYPE), ('slopes', slope_check.SLOPES_DTYPE), ('step_track', step_track.STEP_TRACK_DTYPE),
    ('place', place.PLACE_DTYPE), ('began', 'f8'), ('radius', 'f8'), ('peak', 'f8'), ('centre', 'f8', (2,)),
    ('phase', 'i8'), ('since', 'f8'), ('look', 'i8'), ('levels', 'f8', (1 + side_lobe.LOOK_AROUND_PLACES,)),
    ('looks', 'i8'),
    ('peaks', 'i8'), ('doubts', 'i8'), ('fair', 'f8'),
], align=True)
"""place: the expected one without a program; began: search or acquire [s]; radius: of the small area [rad]; peak: the
highest level on the way [dB-Hz]; centre: offset of the place where it was, in cross-elevation and elevation [rad];
phase of acquire, entered at `since` [s]; look: place of the look-around or the peak that the beam is at, levels: at
those before; looks, peaks: how many times it did; doubts: how many times the slopes were wrong;
fair: when the level of autotrack was last that of the main lobe [s]."""

LEVEL_SETTLING_LAGS = 4.0
"""Time constants after which a level is that of a new place."""

PEAK_DROP_DB = 1.0
"""How far the level falls behind its peak before the beam goes back [dB]."""

MAX_RISE_TIME_S = 1.0
"""Longest time that a level may keep on rising [s]."""

CIRCLE_RADIUS_BEAMWIDTHS, CIRCLE_PERIOD_S, CIRCLE_TURN_COUNT = 0.1, 0.5, 2.0
"""Of the slope check: radius [beamwidths], time of a turn [s], and their number; in the first the circle opens."""

MIN_CHECK_ERROR_COUNT = 50
"""Of the slope check."""

MAX_LOOK_AROUND_COUNT = 4
"""Times that acquire looks around before it checks what it has."""

PEAK_STEP_BEAMWIDTHS, MAX_PEAK_MOVE_BEAMWIDTHS = 0.3, 0.7
"""Of a peak: the steps to either side and the farthest way to go [beamwidths]; a way beyond PEAK_STEP_BEAMWIDTHS is
gone in two."""

MAX_PEAK_COUNT = 3

PEAK_OFFSETS_BEAMWIDTHS = ((0.0, 0.0), (PEAK_STEP_BEAMWIDTHS, 0.0), (-PEAK_STEP_BEAMWIDTHS, 0.0),
                           (0.0, PEAK_STEP_BEAMWIDTHS), (0.0, -PEAK_STEP_BEAMWIDTHS))
"""Places of a peak [beamwidths]."""


def initialise(s):
    """Nothing heard yet; s (n,) of ACQUISITION_DTYPE."""
    s['level']['stamp'] = -math.inf


@compiled
def take_level(s, p, z, stamp, locked):
    """Take the level z [dB-Hz] of a stamp [s]; locked: whether the receiver gives errors. p: record of
    AcquisitionParameters."""
    level.take(s.level, p, z, stamp, locked)


@compiled
def learn(s, p, z, stamp):
    """Take a level [dB-Hz] that is noise alone, of a stamp [s], before it is heard."""
    if stamp > s.level.stamp and math.isfinite(z) and math.isfinite(s.level.stamp):
        level.learn(s.level, p, z, min(stamp - s.level.stamp, p.time_constant))


@compiled
def begin_search(s, p, beamwidth, t, sigma):
    """Search from t [s] on; sigma: standard deviation of the expected place [rad], NaN where it is not known.
    p: record of SearchParameters."""
    s.began = t
    s.radius = p.small * beamwidth
    if 2.0 * sigma > s.radius:
        s.radius = min(2.0 * sigma, p.full * beamwidth)
    s.peak = -math.inf
    s.centre[0] = s.centre[1] = 0.0
    level.restart_times(s.level)


@compiled
def area(s, p, tau, beamwidth, full):
    """The pattern.Area of the small or the full stage; tau: time constant of the level [s]."""
    radius = p.full * beamwidth if full else s.radius
    return Area(p.pattern, radius, p.across * radius, p.pitch * beamwidth,
                pattern.highest_speed(beamwidth, tau, p.speed))


@compiled
def searched(s, p, tau, beamwidth, t):
    """(Point of the beam along and across the track at t [s], whether all rounds are over); p: record of
    SearchParameters."""
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
    """Put the beam at an offset (x, e) [rad] from the expected place."""
    s.centre[0], s.centre[1] = x, e


@compiled
def note_fair_level(s, t, fair):
    """Keep at t [s] whether the level of autotrack is fair."""
    if fair:
        s.fair = t


@compiled
def waiting(s, p, t):
    """Whether the search at t [s] still stands on the last place."""
    return t < s.began + p.wait


@compiled
def note_peak(s, offset):
    """Keep the offset (x, e) [rad], where the beam was when the receiver took what its level now shows, if that is
    the highest level so far."""
    if s.level.z > s.peak:
        s.peak = s.level.z
        s.centre[0], s.centre[1] = offset


@compiled
def peak_passed(s, p):
    """Whether a signal has been there and its peak is behind the beam. p: record of AcquisitionParameters."""
    return level.detected(s.level, p) and (s.level.z < s.peak - PEAK_DROP_DB or s.level.above_detect > MAX_RISE_TIME_S)


@compiled
def begin_acquire(s, t):
    """Acquire from t [s] on what is at the centre."""
    s.began, s.looks, s.peaks, s.doubts = t, 0, 0, 0
    s.levels[:] = -math.inf
    _enter(s, Phase.SETTLE, t)


@compiled
def _enter(s, phase, t):
    s.phase, s.since, s.look = phase, t, 0


@compiled
def acquire(s, p, beamwidth, t, distance):
    """Bring acquire to t [s]; distance: measured range of the target [m], NaN where there is none. p: record of
    AcquisitionParameters."""
    settled = t - s.since >= LEVEL_SETTLING_LAGS * p.time_constant
    if s.phase == Phase.SETTLE and settled:
        s.levels[0] = s.level.z
        axis = side_lobe.expected(p.expected_dbhz, p.reference_range, p.range_exponent, distance)
        main = p.expected_dbhz > 0.0 and not side_lobe.suspected(s.level.z, axis)
        if main or s.looks >= MAX_LOOK_AROUND_COUNT:
            _peak(s, t)
        else:
            _enter(s, Phase.LOOK_AROUND, t)
            s.look, s.looks = 1, s.looks + 1
    elif (s.phase == Phase.LOOK_AROUND or s.phase == Phase.PEAK) and settled:
        s.levels[s.look] = s.level.z
        s.look, s.since = s.look + 1, t
        if s.phase == Phase.LOOK_AROUND and s.look > side_lobe.LOOK_AROUND_PLACES:
            _go_to_best(s, beamwidth, t)
        elif s.phase == Phase.PEAK and s.look >= len(PEAK_OFFSETS_BEAMWIDTHS):
            _go_to_peak(s, beamwidth, t)
    elif s.phase == Phase.CHECK and t - s.since >= CIRCLE_TURN_COUNT * CIRCLE_PERIOD_S:
        _judge(s, t)


@compiled
def _go_to_best(s, beamwidth, t):
    """After a look around: settle at the better place, or peak here where there is none."""
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
    _enter(s, Phase.PEAK, t)
    s.look, s.peaks = 1, s.peaks + 1


@compiled
def _go_to_peak(s, beamwidth, t):
    """After the steps to either side: go to the peak, and check the slopes there unless it was far."""
    far = False
    for i in range(2):
        way = step_track.peak(s.levels[1 + 2 * i], s.levels[2 + 2 * i], PEAK_STEP_BEAMWIDTHS * beamwidth, beamwidth)
        far |= abs(way) > PEAK_STEP_BEAMWIDTHS * beamwidth
        s.centre[i] += min(max(way, -MAX_PEAK_MOVE_BEAMWIDTHS * beamwidth), MAX_PEAK_MOVE_BEAMWIDTHS * beamwidth)
    if far and s.peaks < MAX_PEAK_COUNT:
        _peak(s, t)
    else:
        _enter(s, Phase.CHECK, t)
        slope_check.restart(s.slopes)


@compiled
def _judge(s, t):
    """After the circle: where the slopes are right go to where the errors lead, where they are wrong twice give up."""
    verdict = slope_check.verdict(s.slopes, MIN_CHECK_ERROR_COUNT)
    if verdict == slope_check.VERDICT_RIGHT:
        # The mean error over whole turns is that at the centre: there the errors are on the straight part of their
        # curve, and fit together for the filter.
        s.centre[0] += s.slopes.e[0]
        s.centre[1] += s.slopes.e[1]
        s.phase = Phase.CHECKED
    elif verdict == slope_check.VERDICT_WRONG:
        s.doubts += 1
        if s.doubts > 1:
            s.phase = Phase.WRONG_SLOPE
        else:
            s.peaks = 0
            _peak(s, t)


@compiled
def acquired(s, beamwidth, t):
    """Point of the beam at t [s] in cross-elevation and elevation."""
    x, e = s.centre[0], s.centre[1]
    if s.phase == Phase.LOOK_AROUND:
        aside, up = side_lobe.place(s.look, beamwidth)
        return Point(x + aside, e + up, 0.0, 0.0)
    if s.phase == Phase.PEAK:
        aside, up = PEAK_OFFSETS_BEAMWIDTHS[s.look]
        return Point(x + aside * beamwidth, e + up * beamwidth, 0.0, 0.0)
    if s.phase != Phase.CHECK:
        return Point(x, e, 0.0, 0.0)
    c = pattern.circle(CIRCLE_RADIUS_BEAMWIDTHS * beamwidth, CIRCLE_PERIOD_S, t - s.since)
    return Point(x + c.x, e + c.y, c.dx, c.dy)


@compiled
def take_error(s, expected, error):
    """Take an error of the receiver while the slopes are checked; expected: offset of the target's expected place from
    the beam when it was measured, both (cross-elevation, elevation) [rad]."""
    if s.phase == Phase.CHECK:
        slope_check.take(s.slopes, expected, error)


@compiled
def failed(s, p, t):
    """Whether acquire gives up at t [s]: no signal at the centre any more, or no end within the timeout. p: record of
    AcquisitionParameters."""
    settled = (s.phase != Phase.LOOK_AROUND and s.phase != Phase.PEAK and t - s.since > LEVEL_SETTLING_LAGS
               * p.time_constant)
    return t - s.began > p.timeout or (settled and s.level.below_loss >= p.loss_time)
