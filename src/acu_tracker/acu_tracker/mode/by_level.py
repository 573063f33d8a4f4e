"""The modes that go by the level of the signal, between the control unit and the laws of `search`.

s, c, u: records of control_unit.STATE and CONSTANTS, of signals.INPUTS.
"""
import math

from acu_tracker import modes
from acu_tracker.estimation import target
from acu_tracker.geometry import attitude, encoders
from acu_tracker.geometry.motion import line_of_sight
from acu_tracker.geometry.vector import Vector, rotated
from acu_tracker.program import bridge, program_track
from acu_tracker.search import acquisition, coast, level, pattern, place, side_lobe, step_track
from acu_tracker.search.pattern import Point
from pedestal_common.compiled import compiled
from pedestal_common.geometry import line_of_sight as pointing

SIDE_LOBE_TIME = 0.3
"""Time for which the level must be that of a side lobe [s], before autotrack or in it: on its slopes the filter
diverges within 0.4 s."""


@compiled
def expected(s, program, t):
    """Motion in earth angles of the expected place of the target at t [s]: by the program, rotated to where the target
    was last tracked; without one, where it was last."""
    if program_track.status(program, t) != modes.NONE:
        return place.motion_at(s.acquisition.place, t)
    if s.bridge.valid:
        return bridge.motion_at(s.bridge, program, t)
    return program_track.motion_at(program, t)


@compiled
def source(s, c, program, t):
    """target.Source of the beam at t [s]."""
    motion = expected(s, program, t)
    return target.Source(0, place.displaced(motion, _offset(s, c, t, motion)))


@compiled
def _offset(s, c, t, motion):
    """Point of the beam about the expected place in cross-elevation and elevation."""
    a, beamwidth = s.acquisition, c.p.tracker.receiver.beamwidth
    if s.mode == modes.SEARCH:
        p, _ = acquisition.searched(a, c.p.search, c.p.acquisition.time_constant, beamwidth, t)
        return pattern.rotated(p, place.track(motion))
    if s.mode == modes.ACQUIRE:
        return acquisition.acquired(a, beamwidth, t)
    return Point(a.centre[0], a.centre[1], 0.0, 0.0)


@compiled
def advance(s, c, u, program):
    """Take the level of a step, learn from it what noise is, and bring the mode of the step before to this one."""
    a, p, beamwidth = s.acquisition, c.p.acquisition, c.p.tracker.receiver.beamwidth
    new = u.error_stamp > a.level.stamp and math.isfinite(u.cn0_dbhz)
    off_target = not modes.FOLLOWS[s.mode] or (s.mode == modes.SEARCH and acquisition.waiting(a, c.p.search, s.stamp))
    if u.error_valid:
        level.forget_noise(a.level, p)
    elif off_target:
        acquisition.learn(a, p, u.cn0_dbhz, u.error_stamp)
    acquisition.hear(a, p, u.cn0_dbhz, u.error_stamp, u.error_valid != 0)
    if s.mode == modes.SEARCH and new:
        t = u.error_stamp - p.time_constant
        offset = _offset(s, c, t, expected(s, program, t))
        acquisition.note_peak(a, (offset.x, offset.y))
    elif s.mode == modes.ACQUIRE:
        acquisition.acquire(a, p, beamwidth, s.stamp, u.range)
        if a.phase == acquisition.WRONG:
            s.divergence.diverged = 1
    elif s.mode == modes.STEPTRACK:
        present = a.level.below_loss < p.loss_time
        a.centre[0], a.centre[1] = step_track.step(a.step_track, c.p.steptrack, beamwidth, p.time_constant, s.stamp,
                                                   u.cn0_dbhz if new else math.nan, present)
    axis = side_lobe.expected(p.expected_dbhz, p.reference_range, p.range_exponent, u.range)
    judged = s.mode == modes.PROGRAM or s.mode == modes.AUTOTRACK
    if not judged or not u.error_valid or not side_lobe.suspected(u.cn0_dbhz, axis):
        a.fair = s.stamp


@compiled
def in_side_lobe(s, c):
    """Whether autotrack follows a level that is that of a side lobe."""
    return c.p.acquisition.expected_dbhz > 0.0 and s.stamp - s.acquisition.fair > SIDE_LOBE_TIME


@compiled
def found(s, c):
    """Whether search may hand over to acquire, or acquire to autotrack."""
    if s.mode == modes.SEARCH:
        return acquisition.passed(s.acquisition, c.p.acquisition)
    return s.acquisition.phase == acquisition.CHECKED


@compiled
def end(s, c):
    """NONE or the reason that the mode ends, for one that goes by the level."""
    a, p = s.acquisition, c.p.acquisition
    if s.mode == modes.SEARCH:
        _, over = acquisition.searched(a, c.p.search, p.time_constant, c.p.tracker.receiver.beamwidth, s.stamp)
        return modes.NOT_FOUND if over else modes.NONE
    if s.mode == modes.ACQUIRE:
        if a.phase == acquisition.WRONG:
            return modes.WRONG_SLOPE
        return modes.SIGNAL_LOST if acquisition.failed(a, p, s.stamp) else modes.NONE
    if s.mode == modes.STEPTRACK and a.level.below_loss >= p.loss_time:
        return modes.SIGNAL_LOST
    return modes.NONE


@compiled
def sigma(s, c):
    """Standard deviation of the estimate across the line of sight at s.stamp [rad]."""
    estimate = target.read(s.target, c.p, c.tracker, s.attitude, s.stamp)
    azimuth, elevation = estimate.variances
    return coast.sigma(azimuth.p11, elevation.p11, estimate.motion.elevation.angle)


@compiled
def begin(s, c, program, mode, tracked):
    """Enter a mode that goes by the level from the present one; tracked: whether the target is, up to now."""
    a = s.acquisition
    if tracked:
        bridge.begin(s.bridge, program, s.stamp, target.earth_outlook(s.target, c.tracker, s.stamp).u)
    level.forget_times(a.level)
    if not modes.BY_LEVEL[s.mode]:
        _remember_place(s, c)
        a.centre[0] = a.centre[1] = 0.0
    if mode == modes.SEARCH:
        spread = sigma(s, c) if s.mode == modes.AUTOTRACK else math.nan
        acquisition.begin_search(a, c.p.search, c.p.tracker.receiver.beamwidth, s.stamp, spread)
    elif mode == modes.ACQUIRE:
        acquisition.begin_acquire(a, s.stamp)
    else:
        step_track.start(a.step_track, s.stamp, a.centre[0], a.centre[1])


@compiled
def _remember_place(s, c):
    """Keep where the target is now: by the estimate that autotrack followed, or else where the antenna points."""
    if s.mode == modes.AUTOTRACK:
        sight = target.earth_outlook(s.target, c.tracker, s.stamp)
        place.remember(s.acquisition.place, s.stamp, sight.u, sight.du)
        return
    _, at = encoders.at(s.encoders, s.stamp)
    _, deck = attitude.at(s.attitude, c.p, s.stamp)
    x, y, z = pointing.direction(at.A, at.E)
    place.remember(s.acquisition.place, s.stamp, rotated(deck.mat, Vector(x, y, z)), place.STILL)


@compiled
def check_slope(s, c, program, at, t, error):
    """Judge an error (cross-elevation, elevation) [rad] by the offset of the target's expected place from the beam;
    at: Pointing of the beam, t [s]: when it was measured."""
    if s.mode != modes.ACQUIRE:
        return
    motion = target.on_deck(s.target, c.p, s.attitude, t, target.Source(0, expected(s, program, t)))
    x, y, z = pointing.direction(motion.azimuth.angle, motion.elevation.angle)
    acquisition.take_error(s.acquisition, pointing.offsets(at.A, at.E, x, y, z), error)


@compiled
def sight(s, program, t):
    """LineOfSight in ENU of the expected place at t [s]."""
    return line_of_sight(expected(s, program, t))
