"""Reachable directions: whether fixed angles, or the table that a mode follows, are inside the limits of the axes.

The floor, the lowest elevation of each azimuth, is one of the limits.
"""
import math
from typing import TYPE_CHECKING

from acu_tracker import signals
from acu_tracker.geometry import attitude, azimuth_wrap
from acu_tracker.geometry.azimuth_wrap import Travel
from acu_tracker.modes import Mode, Reason
from acu_tracker.pointing import model
from acu_tracker.program import program_track
from acu_tracker.program.program_track import ProgramTrack
from acu_tracker.servo import travel
from acu_tracker.signals import Inputs
from acu_tracker.tracking import Tracking
from pedestal_common.compiled import compiled
from pedestal_common.geometry import pointing_model
from pedestal_common.quantities import Radians, Seconds

if TYPE_CHECKING:
    from acu_tracker.control_unit import Constants


@compiled
def outside(constants: 'Constants', A: Radians, E: Radians) -> int:
    """Return OUTSIDE_LIMITS if the encoder angles A and E cannot be reached, else NONE. NaN counts as outside."""
    a, e = constants.axis[0].p.limits, constants.axis[1].p.limits
    inside = a.low <= A <= a.high and e.low <= E <= e.high
    return Reason.NONE if inside and not travel.above(constants.floor, A, E) else Reason.OUTSIDE_LIMITS


@compiled
def judge_direction(pointing: pointing_model.PointingModel, constants: 'Constants', azimuth: Radians,
                    elevation: Radians) -> int:
    """Return OUTSIDE_LIMITS if a direction (deck angles on the sky) cannot be reached, else NONE."""
    A, E, _ = pointing_model.encoder_of(pointing, azimuth, elevation)
    return outside(constants, A, E)


@compiled
def _judge_track(tracking: Tracking, constants: 'Constants', track: ProgramTrack, t: Seconds,
                 azimuth: Radians) -> tuple[int, int]:
    """Return the result of _judge_table for a table.

    The table must cover t. The direction is judged at t + lead, the instant at which the next command is in force.
    """
    obstacle = program_track.status(track, t)
    if obstacle != Reason.NONE:
        return obstacle, 0
    t_m = t + constants.lead
    on_sky = attitude.on_deck(tracking.attitude, constants.p, t_m, program_track.motion_at(track, t_m))
    motion, _ = model.to_encoders(tracking.pointing.model, on_sky)
    A, E, limits = motion.azimuth.angle, motion.elevation.angle, constants.axis[0].p.limits
    if not math.isfinite(A + E):
        return Reason.NO_PROGRAM, signals.Flag.PROGRAM
    # Travel(0, 0): only this direction must be inside the limits, not the further path of the target.
    return outside(constants, azimuth_wrap.nearest(A, azimuth, limits.low, limits.high, Travel(0.0, 0.0)), E), 0


@compiled
def _judge_table(tracking: Tracking, constants: 'Constants', inputs: Inputs, mode: int,
                 all_tables: program_track.Tables, t: Seconds, azimuth: Radians) -> tuple[int, int]:
    """Return (NONE or the reason why the table of a mode cannot be followed at t, signals.Flag.PROGRAM or 0).

    The flag marks a table with an angle that is not finite.
    """
    track = program_track.of_mode(all_tables, mode)
    if mode != Mode.PROGRAM:
        unpredicted = inputs.unpredicted[program_track.TABLE_INDEX[mode]]
        if unpredicted != Reason.NONE:
            return unpredicted, 0
        if (program_track.status(track, t) == Reason.NONE
                and program_track.motion_at(track, t).elevation.angle < 0.0):
            return Reason.BELOW_HORIZON, 0
    obstacle, flag = _judge_track(tracking, constants, track, t, azimuth)
    # In a gap between two pieces of the program (inputs.gap) the table is the next piece, which has not begun.
    if mode == Mode.PROGRAM and inputs.gap and obstacle == Reason.BEFORE_PROGRAM:
        return Reason.PROGRAM_GAP, flag
    return obstacle, flag


@compiled
def judge_tables(tracking: Tracking, constants: 'Constants', inputs: Inputs, wanted: tuple[int, int, int, int],
                 all_tables: program_track.Tables, t: Seconds, azimuth: Radians) -> tuple[int, int, int, int]:
    """Return (program, tle, sun of modes.Conditions at t, flags of bad tables).

    wanted   modes whose table is evaluated; another table counts as good, to save time
    azimuth  of the last reference, before the shaper; the azimuth wrap is chosen near it
    """
    program = tle = sun = Reason.NONE
    flags = flag = 0
    if Mode.PROGRAM in wanted:
        program, flags = _judge_table(tracking, constants, inputs, Mode.PROGRAM, all_tables, t, azimuth)
    if Mode.TLE in wanted:
        tle, flag = _judge_table(tracking, constants, inputs, Mode.TLE, all_tables, t, azimuth)
        flags |= flag
    if Mode.SUN in wanted:
        sun, flag = _judge_table(tracking, constants, inputs, Mode.SUN, all_tables, t, azimuth)
        flags |= flag
    return program, tle, sun, flags
