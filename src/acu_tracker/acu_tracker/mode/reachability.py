"""Reachable directions: whether fixed angles, or the table that a mode follows, are inside the limits of the axes.

The floor, the lowest elevation of each azimuth, is one of the limits. A table is the program track, or a predicted
track of a satellite or the sun. k, c, u: records of tracking.Tracking, of control_unit.Constants and of
signals.Inputs.dtype.
"""
import math

from acu_tracker import signals
from acu_tracker.geometry import attitude, azimuth_wrap
from acu_tracker.geometry.azimuth_wrap import Travel
from acu_tracker.modes import Mode, Reason
from acu_tracker.pointing import model
from acu_tracker.program import program_track, tables
from acu_tracker.servo import floor
from pedestal_common.compiled import compiled
from pedestal_common.geometry import pointing_model


@compiled
def outside(c, A, E):
    """Return OUTSIDE_LIMITS if the encoder angles A (azimuth) and E (elevation) [rad] cannot be reached, else NONE.

    They can be reached if both angles are inside the limits of their axes, and the floor at the azimuth A is
    not above the elevation E. NaN counts as outside.
    """
    a, e = c.axis[0].p.limits, c.axis[1].p.limits
    inside = a.low <= A <= a.high and e.low <= E <= e.high
    return Reason.NONE if inside and not floor.above(c.floor, A, E) else Reason.OUTSIDE_LIMITS


@compiled
def judge_direction(m, c, azimuth, elevation):
    """Return OUTSIDE_LIMITS if a direction (deck angles on the sky [rad]) cannot be reached, else NONE.

    m: record of pointing_model.PointingModel.dtype.
    """
    A, E, _ = pointing_model.encoder_of(m, azimuth, elevation)
    return outside(c, A, E)


@compiled
def _judge_track(k, c, track, t, azimuth):
    """Return (NONE or the reason why a table cannot be followed, signals.Flag.PROGRAM or 0).

    track: the table; t, azimuth and the flag: as in judge_table. The table must cover t. The direction is judged
    at t + c.lead, the instant at which the next command is in force.
    """
    obstacle = program_track.status(track, t)
    if obstacle != Reason.NONE:
        return obstacle, 0
    t_m = t + c.lead
    on_sky = attitude.on_deck(k.attitude, c.p, t_m, program_track.motion_at(track, t_m))
    motion, _ = model.to_encoders(k.pointing.model, on_sky)
    A, E, limits = motion.azimuth.angle, motion.elevation.angle, c.axis[0].p.limits
    if not math.isfinite(A + E):
        return Reason.NO_PROGRAM, signals.Flag.PROGRAM
    # Travel(0, 0): only this direction must be inside the limits, not the further path of the target.
    return outside(c, azimuth_wrap.nearest(A, azimuth, limits.low, limits.high, Travel(0.0, 0.0)), E), 0


@compiled
def judge_table(k, c, u, mode, all_tables, t, azimuth):
    """Return (NONE or the reason why the table of a mode cannot be followed at t [s], signals.Flag.PROGRAM or 0).

    all_tables  tables.Tables of all modes
    azimuth     azimuth of the last reference as it was before the shaper limited it [rad]; the azimuth wrap is chosen
                near it

    The flag marks a table with an angle that is not finite.
    """
    track = tables.of_mode(all_tables, mode)
    if mode != Mode.PROGRAM:
        unpredicted = u.unpredicted[tables.TABLE_INDEX[mode]]
        if unpredicted != Reason.NONE:
            return unpredicted, 0
        if (program_track.status(track, t) == Reason.NONE
                and program_track.motion_at(track, t).elevation.angle < 0.0):
            return Reason.BELOW_HORIZON, 0
    obstacle, flag = _judge_track(k, c, track, t, azimuth)
    # In a gap between two pieces of the program (u.gap) the table is the next piece, which has not begun.
    if mode == Mode.PROGRAM and u.gap and obstacle == Reason.BEFORE_PROGRAM:
        return Reason.PROGRAM_GAP, flag
    return obstacle, flag
