"""What the antenna can point at: angles inside the limits and above the floor, the tables that modes follow.

s, c, u: records of control_unit.STATE and CONSTANTS, of signals.INPUTS.
"""
import math

from acu_tracker import modes, signals
from acu_tracker.estimation import target
from acu_tracker.geometry import azimuth_wrap
from acu_tracker.geometry.azimuth_wrap import Travel
from acu_tracker.program import program_track, tables
from acu_tracker.servo import floor
from pedestal_common.compiled import compiled


@compiled
def outside(c, A, E):
    """OUTSIDE_LIMITS if deck angles [rad] cannot be pointed at, else NONE; NaN is outside."""
    a, e = c.axis[0].p.limits, c.axis[1].p.limits
    inside = a.low <= A <= a.high and e.low <= E <= e.high
    return modes.NONE if inside and not floor.above(c.floor, A, E) else modes.OUTSIDE_LIMITS


@compiled
def _followed(s, c, track, t_m):
    """(NONE or why the program cannot be followed, by its times or its place at t_m [s]; signals.PROGRAM if it is bad,
    else 0).
    """
    obstacle = program_track.status(track, s.stamp)
    if obstacle != modes.NONE:
        return obstacle, 0
    source = target.Source(0, program_track.motion_at(track, t_m))
    motion = target.on_deck(s.target, c.p, s.attitude, t_m, source)
    A, E, limits = motion.azimuth.angle, motion.elevation.angle, c.axis[0].p.limits
    if not math.isfinite(A + E):
        return modes.NO_PROGRAM, signals.PROGRAM
    return outside(c, azimuth_wrap.nearest(A, s.azimuth, limits.low, limits.high, Travel(0.0, 0.0)), E), 0


@compiled
def table(s, c, u, mode, of_all):
    """(NONE or why the table of a mode cannot be followed, signals.PROGRAM if it is bad, else 0)."""
    track = tables.of_mode(of_all, mode)
    if mode != modes.PROGRAM:
        unpredicted = u.unpredicted[tables.PLACE[mode]]
        if unpredicted != modes.NONE:
            return unpredicted, 0
        if (program_track.status(track, s.stamp) == modes.NONE
                and program_track.motion_at(track, s.stamp).elevation.angle < 0.0):
            return modes.BELOW_HORIZON, 0
    obstacle, flag = _followed(s, c, track, s.stamp + c.lead)
    if mode == modes.PROGRAM and u.gap and obstacle == modes.BEFORE_PROGRAM:
        return modes.PROGRAM_GAP, flag
    return obstacle, flag


@compiled
def matters(s, mode, request, fallback, falls_back):
    """Whether it matters if a mode's table can be followed."""
    return request == mode or s.mode == mode or (falls_back and (s.table == mode or fallback == mode))
