"""The modes search, acquire and steptrack, which use the signal level: link from the control unit to `search`.

The signal level is the C/N0 of the receiver. The modes move the beam about the expected place of the target; the
laws of these motions are in the package `search`.

a    record of acquisition.Acquisition
c    record of control_unit.Constants
way  bridge.Way: the program, rotated to the place where the target was last tracked
"""
import math

from acu_tracker import modes
from acu_tracker.estimation import target
from acu_tracker.modes import Mode, Reason
from acu_tracker.program import bridge, program_track
from acu_tracker.search import acquisition, level, pattern, place, side_lobe, step_track
from acu_tracker.search.pattern import Point
from pedestal_common.compiled import compiled
from pedestal_common.geometry import line_of_sight as pointing

SIDE_LOBE_TIME_S = 0.3
"""Time for which the level must be that of a side lobe before autotrack ends [s].

The time may begin in the mode program, before autotrack. Because the filter diverges within 0.4 s on the slopes of a
side lobe, the time is shorter.
"""


@compiled
def expected(a, way, t):
    """Return the Motion in earth angles of the expected place of the target at t [s].

    The place follows the program, rotated to where the target was last tracked. Without a program it is the last
    place, moved on with a rate that fades.
    """
    if program_track.status(way.program, t) != Reason.NONE:
        return place.motion_at(a.place, t)
    return bridge.motion_at(way, t)


@compiled
def source(a, mode, c, way, t):
    """Return the target.Source to which the beam points at t [s]: the expected place plus the offset of the mode."""
    motion = expected(a, way, t)
    return target.Source(0, place.displaced(motion, _offset(a, mode, c, t, motion)))


@compiled
def _offset(a, mode, c, t, motion):
    """Return the Point of the beam relative to the expected place at t [s], in cross-elevation and elevation [rad].

    motion: Motion of the expected place in earth angles.
    """
    beamwidth = c.p.tracker.receiver.beamwidth
    if mode == Mode.SEARCH:
        p, _ = acquisition.searched(a, c.p.search, c.p.acquisition.time_constant, beamwidth, t)
        return pattern.rotated(p, place.track(motion))
    if mode == Mode.ACQUIRE:
        return acquisition.acquired(a, beamwidth, t)
    return Point(a.centre[0], a.centre[1], 0.0, 0.0)


@compiled
def advance(a, mode, c, u, way):
    """Take the level of a step and advance the running mode. Return True if acquire has found a slope of wrong sign.

    mode: the mode of the previous step; u: record of signals.Inputs.dtype. While the beam is off the target, the level
    is noise alone; the function then learns the statistics of the noise.
    """
    p, beamwidth = c.p.acquisition, c.p.tracker.receiver.beamwidth
    new = u.error_stamp > a.level.stamp and math.isfinite(u.cn0_dbhz)
    off_target = (not modes.FOLLOWS_TARGET[mode]
                  or (mode == Mode.SEARCH and acquisition.waiting(a, c.p.search, u.stamp)))
    if u.error_valid:
        level.restart_noise(a.level, p)
    elif off_target:
        acquisition.learn(a, p, u.cn0_dbhz, u.error_stamp)
    acquisition.take_level(a, p, u.cn0_dbhz, u.error_stamp, u.error_valid != 0)
    if mode == Mode.SEARCH and new:
        # The receiver smooths the level, which therefore belongs to the offset one time constant ago.
        t = u.error_stamp - p.time_constant
        offset = _offset(a, mode, c, t, expected(a, way, t))
        acquisition.note_peak(a, (offset.x, offset.y))
    elif mode == Mode.ACQUIRE:
        acquisition.acquire(a, p, beamwidth, u.stamp, u.range)
    elif mode == Mode.STEPTRACK:
        present = a.level.below_loss < p.loss_time
        x, e = step_track.step(a.step_track, c.p.steptrack, beamwidth, p.time_constant, u.stamp,
                               u.cn0_dbhz if new else math.nan, present)
        acquisition.set_offset(a, x, e)
    level_on_axis = side_lobe.expected(p.expected_dbhz, p.reference_range, p.range_exponent, u.range)
    judged = mode == Mode.PROGRAM or mode == Mode.AUTOTRACK
    # A level is called fair if it is not suspected to be that of a side lobe.
    fair = not judged or not u.error_valid or not side_lobe.suspected(u.cn0_dbhz, level_on_axis)
    acquisition.note_fair_level(a, u.stamp, fair)
    return mode == Mode.ACQUIRE and a.phase == acquisition.Phase.WRONG_SLOPE


@compiled
def in_side_lobe(a, c, t):
    """Return True if the level has been that of a side lobe for SIDE_LOBE_TIME_S up to t [s]."""
    return c.p.acquisition.expected_dbhz > 0.0 and t - a.fair > SIDE_LOBE_TIME_S


@compiled
def found(a, mode, c):
    """Return True if the mode search may hand over to acquire, or the mode acquire to autotrack."""
    if mode == Mode.SEARCH:
        return acquisition.peak_passed(a, c.p.acquisition)
    return a.phase == acquisition.Phase.CHECKED


@compiled
def end(a, mode, c, t):
    """Return the reason why a mode that uses the signal level ends at t [s], or NONE."""
    p = c.p.acquisition
    if mode == Mode.SEARCH:
        _, over = acquisition.searched(a, c.p.search, p.time_constant, c.p.tracker.receiver.beamwidth, t)
        return Reason.NOT_FOUND if over else Reason.NONE
    if mode == Mode.ACQUIRE:
        if a.phase == acquisition.Phase.WRONG_SLOPE:
            return Reason.WRONG_SLOPE
        return Reason.SIGNAL_LOST if acquisition.failed(a, p, t) else Reason.NONE
    if mode == Mode.STEPTRACK and a.level.below_loss >= p.loss_time:
        return Reason.SIGNAL_LOST
    return Reason.NONE


@compiled
def begin(a, mode, c, t, spread):
    """Enter a mode that uses the signal level at t [s].

    spread: standard deviation of the expected place, across the line of sight [rad]; NaN if it is not known.
    """
    level.restart_times(a.level)
    if mode == Mode.SEARCH:
        acquisition.begin_search(a, c.p.search, c.p.tracker.receiver.beamwidth, t, spread)
    elif mode == Mode.ACQUIRE:
        acquisition.begin_acquire(a, t)
    else:
        step_track.start(a.step_track, t, a.centre[0], a.centre[1])


@compiled
def remember(a, t, u, du):
    """Store the expected place of the target at t [s]: an ENU unit Vector u and its rate du [1/s]."""
    place.remember(a.place, t, u, du)
    acquisition.set_offset(a, 0.0, 0.0)


@compiled
def check_slope(a, at, motion, error):
    """Compare an error (cross-elevation, elevation) [rad] with the offset of the expected place from the beam.

    at: Pointing of the beam; motion: Motion of the expected place in deck angles.
    """
    x, y, z = pointing.direction(motion.azimuth.angle, motion.elevation.angle)
    acquisition.take_error(a, pointing.offsets(at.A, at.E, x, y, z), error)
