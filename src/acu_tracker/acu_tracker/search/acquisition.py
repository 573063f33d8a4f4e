"""From a lost target to a signal on which the loop may be closed: search, acquire, step track, as offsets of the beam.

Search leads the beam over the last place, the small area and the full one. After the level has passed its peak,
acquire returns to the peak and

    settles         until the level is that of the new place,
    looks around    unless the expected level shows the main lobe; goes to the best place and settles,
    peaks           by the level at a step to either side of both axes, as step track does,
    checks          the sign of the slopes on a small circle, and goes to the direction of the errors.

Every offset is relative to the expected place of the target, which the caller supplies. An offset may jump, because
the shaper of each axis smooths the motion.

s: record of ACQUISITION_DTYPE; b, beamwidth: half-power beamwidth [rad]; z: level of the signal, C/N0 [dB-Hz].
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
    ('phase', 'i8'), ('since', 'f8'), ('place_number', 'i8'), ('levels', 'f8', (1 + side_lobe.LOOK_AROUND_PLACES,)),
    ('look_around_count', 'i8'), ('peak_count', 'i8'), ('wrong_slope_count', 'i8'), ('fair', 'f8'),
], align=True)
"""place: the expected one without a program; began: begin of search or acquire [s]; radius: of the small area [rad].
`peak`: highest level so far [dB-Hz]; centre: offset of its place, in cross-elevation and elevation [rad]. `phase`: of
acquire, entered at `since` [s]; place_number: of the place in the phase, 0 for the centre; levels: at the places
before it. `look_around_count`, `peak_count`: numbers of look-arounds and of peaks so far; wrong_slope_count: number of
wrong slope checks. `fair`: time at which the level of autotrack was last that of the main lobe [s]."""

LEVEL_SETTLING_LAGS = 4.0
"""Number of time constants after which a level is that of a new place."""

PEAK_DROP_DB = 1.0
"""Drop of the level behind its peak at which the beam returns [dB]."""

MAX_RISE_TIME_S = 1.0
"""Longest time for which a level may keep rising [s]."""

CIRCLE_RADIUS_BEAMWIDTHS, CIRCLE_PERIOD_S, CIRCLE_TURN_COUNT = 0.1, 0.5, 2.0
"""Circle of the slope check: radius [beamwidths], time of a turn [s], number of turns;
the circle opens in the first."""

MIN_CHECK_ERROR_COUNT = 50
"""Least number of errors in a slope check."""

MAX_LOOK_AROUND_COUNT = 4
"""Number of look-arounds after which acquire continues with the present place."""

PEAK_STEP_BEAMWIDTHS, MAX_PEAK_MOVE_BEAMWIDTHS = 0.3, 0.7
"""Step to either side of a peak, and longest move to it [beamwidths]; after a move beyond PEAK_STEP_BEAMWIDTHS the
peak is repeated."""

MAX_PEAK_COUNT = 3
"""Largest number of peaks before a slope check."""

PEAK_OFFSETS_BEAMWIDTHS = ((0.0, 0.0), (PEAK_STEP_BEAMWIDTHS, 0.0), (-PEAK_STEP_BEAMWIDTHS, 0.0),
                           (0.0, PEAK_STEP_BEAMWIDTHS), (0.0, -PEAK_STEP_BEAMWIDTHS))
"""Places of a peak [beamwidths]."""


def initialise(s):
    """Start before the first level; s (n,) of ACQUISITION_DTYPE."""
    s['level']['stamp'] = -math.inf


@compiled
def take_level(s, p, z, stamp, locked):
    """Take the level z [dB-Hz] of a stamp [s]; locked: whether the receiver measures angle errors. p: record of
    AcquisitionParameters."""
    level.take(s.level, p, z, stamp, locked)


@compiled
def learn(s, p, z, stamp):
    """Take a level [dB-Hz] of a stamp [s] that is noise only; call it before `take_level`."""
    if stamp > s.level.stamp and math.isfinite(z) and math.isfinite(s.level.stamp):
        level.learn(s.level, p, z, min(stamp - s.level.stamp, p.time_constant))


@compiled
def begin_search(s, p, beamwidth, t, sigma):
    """Start a search at t [s]; sigma: standard deviation of the expected place [rad], NaN if unknown. p: record of
    SearchParameters."""
    s.began = t
    s.radius = p.small * beamwidth
    if 2.0 * sigma > s.radius:
        s.radius = min(2.0 * sigma, p.full * beamwidth)
    s.peak = -math.inf
    s.centre[0] = s.centre[1] = 0.0
    level.restart_times(s.level)


@compiled
def area(s, p, tau, beamwidth, full):
    """Return the pattern.Area of the small or the full stage; tau: time constant of the level [s]."""
    radius = p.full * beamwidth if full else s.radius
    return Area(p.pattern, radius, p.across * radius, p.pitch * beamwidth,
                pattern.highest_speed(beamwidth, tau, p.speed))


@compiled
def searched(s, p, tau, beamwidth, t):
    """Return (Point of the beam along and across the track at t [s], whether all rounds are over); p: record of
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
    """Set the offset (x, e) [rad] of the beam from the expected place."""
    s.centre[0], s.centre[1] = x, e


@compiled
def note_fair_level(s, t, fair):
    """Keep t [s] if the level of autotrack is fair."""
    if fair:
        s.fair = t


@compiled
def waiting(s, p, t):
    """Return True while the search at t [s] still stays at the last place."""
    return t < s.began + p.wait


@compiled
def note_peak(s, offset):
    """Keep the offset (x, e) [rad] if the level is the highest so far;
    offset: of the beam when the receiver measured it."""
    if s.level.z > s.peak:
        s.peak = s.level.z
        s.centre[0], s.centre[1] = offset


@compiled
def peak_passed(s, p):
    """Return True if there was a signal and the beam has passed its peak. p: record of AcquisitionParameters."""
    return level.detected(s.level, p) and (s.level.z < s.peak - PEAK_DROP_DB or s.level.above_detect > MAX_RISE_TIME_S)


@compiled
def begin_acquire(s, t):
    """Start to acquire the signal at the centre at t [s]."""
    s.began, s.look_around_count, s.peak_count, s.wrong_slope_count = t, 0, 0, 0
    s.levels[:] = -math.inf
    _enter(s, Phase.SETTLE, t)


@compiled
def _enter(s, phase, t):
    """Begin a phase of acquire at t [s]."""
    s.phase, s.since, s.place_number = phase, t, 0


@compiled
def acquire(s, p, beamwidth, t, distance):
    """Advance acquire to t [s]; distance: measured range of the target [m], NaN for none. p: record of
    AcquisitionParameters."""
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
    """After a look-around, settle at the best place, or peak here if no place is better."""
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
    """Begin the steps to either side of the present place. Its level is known, so the first step is place 1."""
    _enter(s, Phase.PEAK, t)
    s.place_number, s.peak_count = 1, s.peak_count + 1


@compiled
def _go_to_peak(s, beamwidth, t):
    """After the steps to either side, go to the peak, and check the slopes there unless it was far."""
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
    """After the circle, go to the direction of the errors if the slopes are right; give up if they are wrong twice."""
    verdict = slope_check.verdict(s.slopes, MIN_CHECK_ERROR_COUNT)
    if verdict == slope_check.VERDICT_RIGHT:
        # The mean error over whole turns is the error at the centre. There the errors are on the straight part of
        # their curve, and consistent for the filter.
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
    """Return the Point of the beam at t [s] in cross-elevation and elevation."""
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
    """Take an error of the receiver while the slopes are checked; expected: offset of the target's expected place from
    the beam at the time of the measurement, both (cross-elevation, elevation) [rad]."""
    if s.phase == Phase.CHECK:
        slope_check.take(s.slopes, expected, error)


@compiled
def failed(s, p, t):
    """Return True if acquire gives up at t [s]: the signal at the centre is lost, or the timeout is over. p: record of
    AcquisitionParameters."""
    at_centre = s.phase != Phase.LOOK_AROUND and s.phase != Phase.PEAK
    settled = at_centre and t - s.since > LEVEL_SETTLING_LAGS * p.time_constant
    return t - s.began > p.timeout or (settled and s.level.below_loss >= p.loss_time)
