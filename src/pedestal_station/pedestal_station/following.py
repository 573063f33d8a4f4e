"""A pass as the antenna follows it: guidance, look-ahead and shaper of the control unit on a table of directions.

No plant takes part: the axes are where their shaped references are. While the references keep the limits, the axes are
on the target, and the steps are as long as the survey of the table allows. Otherwise they are those of the drive.
"""
import math
from typing import NamedTuple

from acu_tracker.control_unit import Constants
from acu_tracker.geometry import azimuth_wrap
from acu_tracker.geometry.vector import AxisMotion, Motion
from acu_tracker.guidance import guidance
from acu_tracker.lookahead import planner
from acu_tracker.modes import Mode
from acu_tracker.pointing import model
from acu_tracker.program import bridge, program_track
from acu_tracker.program.program_track import ProgramTrack
from acu_tracker.servo import shaper, travel
from acu_tracker.servo.params import ShaperParameters
from pedestal_common.compiled import compiled
from pedestal_common.geometry import blockage, line_of_sight
from pedestal_common.geometry.interval import interval
from pedestal_common.geometry.pointing_model import PointingModel
from pedestal_common.quantities import Bit, Floats, Pairs, Radians, Seconds, Times, Vectors3
from pedestal_common.record import Record
from receiver_law.monopulse import sum_pattern

MAX_PIECES = 64  # largest number of pieces of time that are kept
MAX_AZIMUTH_STEP_RAD = 0.02  # largest motion of the target between two rows, on a circle of the zenith distance [rad]
MIN_STEP_S = 1e-3  # least time between two rows [s]
MAX_JUMP_RAD = 1e-3  # largest difference from a reference at which an axis counts as on it [rad]

COLUMN_COUNT = 7
T, AZIMUTH, ELEVATION, AZIMUTH_RATE, ELEVATION_RATE, AZIMUTH_ACCELERATION, ELEVATION_ACCELERATION = range(COLUMN_COUNT)
"""Columns of a survey: time [s], encoder angles [rad], their rates and accelerations."""

LOST_TEXTS = 'keyhole', 'travel', 'limit of the elevation', 'rate of the elevation'
KEYHOLE, TRAVEL, ELEVATION_LIMIT, ELEVATION_RATE_LIMIT = range(len(LOST_TEXTS))
"""Reasons for which the target is off the beam."""


class Course(NamedTuple):
    """A pass in tables."""
    program: ProgramTrack
    rows: Floats        # the survey of the program
    ahead: Times        # for each row, time of the next one that the azimuth cannot follow; inf: none


class Followed(Record):
    """State of a pass that is followed, and its sums."""
    guidance: guidance.Guidance
    begun: Seconds      # begin of the last slew through a keyhole, -inf before the first one
    long_way: Bit       # 1 if one turns opposite to the target
    overtravel: Bit     # 1 if no azimuth wrap holds the pass
    received: Seconds   # integral of the received power over that on the axis of the beam
    count: int          # number of pieces


class Axes(NamedTuple):
    """References of both axes, with the limits of their travel in force."""
    azimuth: AxisMotion
    elevation: AxisMotion
    azimuth_held: bool      # True if the reference is at the end of the travel, not on the target
    elevation_held: bool


@compiled
def survey(program: ProgramTrack, terms: PointingModel, rows: Floats) -> int:
    """Fill rows as far as they reach; return the number of rows that are needed."""
    count, t, last = 0, program.times[0], program.times[-1]
    while True:
        motion, _ = model.to_encoders(terms, program_track.motion_at(program, t))
        azimuth, elevation = motion
        if count < len(rows):
            row = rows[count]
            row[T], row[AZIMUTH], row[ELEVATION] = t, azimuth.angle, elevation.angle
            row[AZIMUTH_RATE], row[ELEVATION_RATE] = azimuth.rate, elevation.rate
            row[AZIMUTH_ACCELERATION], row[ELEVATION_ACCELERATION] = azimuth.acceleration, elevation.acceleration
        count += 1
        if t >= last:
            return count
        scale, end = abs(math.cos(elevation.angle)), program.times[interval(program.times, t) + 1]
        sky_rate = max(math.hypot(azimuth.rate * scale, elevation.rate), 1e-12)     # avoids a division by zero
        t += max(MAX_AZIMUTH_STEP_RAD * scale / sky_rate, MIN_STEP_S)
        t = end if t > end - MIN_STEP_S else t


@compiled
def hidden(program: ProgramTrack, sectors: Vectors3, times: Times, heights: Floats) -> None:
    """Fill heights at times of the program: 1 where a sector hides the target, else -1."""
    for i in range(len(times)):
        motion = program_track.motion_at(program, times[i])
        heights[i] = 1.0 if blockage.blocked(sectors, motion.azimuth.angle, motion.elevation.angle) else -1.0


@compiled
def _axes(state: Followed, constants: Constants, terms: PointingModel, order: guidance.Order, program: ProgramTrack,
          t: Seconds, elevation: Radians) -> tuple[Axes, Motion]:
    """Return (references at t, encoder angles of the target on any wrap); elevation: that of the axis."""
    on_sky = program_track.motion_at(program, t)
    encoders, _ = model.to_encoders(terms, on_sky)
    motion = guidance.on_axes(state.guidance, constants, terms, order, program, t, on_sky, encoders, encoders.azimuth)
    A, a, e = motion.azimuth.angle, constants.axis[0].p, constants.axis[1].p
    ends_a = travel.of_azimuth(constants.floor, a.limits, order.azimuth, elevation)
    ends_e = travel.of_elevation(constants.floor, e.limits, order.azimuth, order.azimuth, A)
    azimuth, azimuth_held = shaper.held_inside(motion.azimuth, ends_a.low, ends_a.high, a.shaper.acceleration,
                                               _lag(a.shaper))
    raised, elevation_held = shaper.held_inside(motion.elevation, ends_e.low, ends_e.high, e.shaper.acceleration,
                                                _lag(e.shaper))
    return Axes(azimuth, raised, azimuth_held, elevation_held), encoders


@compiled
def _lag(limits: ShaperParameters) -> Seconds:
    return limits.h0 + limits.acceleration / limits.jerk


@compiled
def _offset(azimuth: AxisMotion, elevation: AxisMotion, target: Motion) -> Radians:
    x, y, z = line_of_sight.direction(target.azimuth.angle, target.elevation.angle)
    dX, dE = line_of_sight.offsets(azimuth.angle, elevation.angle, x, y, z)
    return math.hypot(dX, dE)


@compiled
def _on(axis: AxisMotion, before: AxisMotion, reference: AxisMotion, step: Seconds) -> bool:
    """Return True if an axis that was at `before` a step ago reaches its reference at that rate."""
    expected = before.angle + 0.5 * step * (before.rate + reference.rate)
    return abs(reference.angle - axis.angle) < MAX_JUMP_RAD and abs(reference.angle - expected) < MAX_JUMP_RAD


@compiled
def _add(state: Followed, pieces: Floats, reason: int, begin: Seconds, end: Seconds) -> None:
    """Add a time in which the target is off the beam; the last piece grows if it ends there."""
    last = pieces[state.count - 1]
    if state.count > 0 and last[2] == reason and begin <= last[1]:
        last[1] = end
    elif state.count < len(pieces):
        row = pieces[state.count]
        row[0], row[1], row[2] = begin, end, reason
        state.count += 1


@compiled
def _hard(row: Floats, constants: Constants) -> bool:
    """Return True if the target at a row exceeds the limits of a plan or of the elevation."""
    limits, e = constants.lookahead.limits, constants.axis[1].p.shaper
    return (abs(row[AZIMUTH_RATE]) > limits.rate or abs(row[AZIMUTH_ACCELERATION]) > limits.acceleration
            or abs(row[ELEVATION_RATE]) > e.rate or abs(row[ELEVATION_ACCELERATION]) > e.acceleration)


@compiled
def _step(state: Followed, constants: Constants, course: Course, k: int, t: Seconds,
          exact: bool) -> tuple[Seconds, bool]:
    """Return (end of the step that begins at t in row k, True if it is one of the drive)."""
    ahead, rows = state.guidance.lookahead, course.rows
    end = rows[k + 1, T]
    if not exact or planner.slewing(ahead, t) or _hard(rows[k], constants) or _hard(rows[k + 1], constants):
        return min(t + constants.p.period, end), True
    if course.ahead[k] - end <= constants.lookahead.horizon:
        end = min(end, t + planner.LOOK_AHEAD_PERIOD_S)
    if ahead.forecast == planner.FORECAST_KEYHOLE and t < ahead.slew.t1:
        end = min(end, ahead.slew.t1)
    return end, False


@compiled
def follow(state: Followed, constants: Constants, terms: PointingModel, course: Course, near: Radians,
           ends: Pairs, pieces: Floats) -> None:
    """Follow a pass from its begin to its end.

    near    azimuth of the axis before the pass, from which the azimuth wrap is chosen
    ends    (2, 2), filled with the encoder angles at begin and end
    pieces  (n, 3), filled with begin, end and reason of each time off the beam
    """
    program, rows = course.program, course.rows
    beamwidth, k, t, exact = constants.p.tracker.receiver.beamwidth, 0, rows[0, T], True
    guidance.start_from(state.guidance, near)
    now, target = _axes(state, constants, terms, guidance.Order(Mode.PROGRAM, True, near, t), program, t,
                        rows[0, ELEVATION])
    azimuth, elevation = now.azimuth, now.elevation
    state.overtravel = state.guidance.overtravel
    ends[0, 0], ends[0, 1] = azimuth.angle, elevation.angle
    offset = _offset(azimuth, elevation, target)
    while k < len(rows) - 1:
        ahead = state.guidance.lookahead
        if course.ahead[k] - t <= constants.lookahead.horizon and planner.due(ahead, t):
            planner.look_along_program(ahead, constants.lookahead, terms, t, state.guidance.azimuth,
                                       bridge.way(state.guidance.bridge, program))
        end, fine = _step(state, constants, course, k, t, exact)
        order = guidance.Order(Mode.PROGRAM, False, azimuth.angle, t)
        now, target = _axes(state, constants, terms, order, program, end, elevation.angle)
        before = azimuth, elevation
        if fine:
            azimuth, _, _ = shaper.shape(azimuth, now.azimuth, end - t, constants.axis[0].p.shaper)
            elevation, _, _ = shaper.shape(elevation, now.elevation, end - t, constants.axis[1].p.shaper)
        else:
            azimuth, elevation = now.azimuth, now.elevation
        exact = (_on(azimuth, before[0], now.azimuth, end - t)
                 and _on(elevation, before[1], now.elevation, end - t))
        if not exact and not fine:      # the step is repeated in steps of the drive
            azimuth, elevation = before
            continue
        before_step, offset = offset, _offset(azimuth, elevation, target)
        _take(state, constants, pieces, (t, end), (before_step, offset), now,
              abs(azimuth.angle - now.azimuth.angle) * math.cos(elevation.angle)
              >= abs(elevation.angle - now.elevation.angle))
        azimuth_wrap.watch_turn(state.guidance.turn, azimuth.angle,
                                (state.guidance.azimuth, target.elevation.angle), beamwidth, end)
        t = end
        k += 1 if t >= rows[k + 1, T] else 0
    ends[1, 0], ends[1, 1] = azimuth.angle, elevation.angle


@compiled
def _take(state: Followed, constants: Constants, pieces: Floats, times: tuple[Seconds, Seconds],
          offsets: tuple[Radians, Radians], now: Axes, of_azimuth: bool) -> None:
    """Take the pointing offsets at begin and end of a step; between them the offset is linear. of_azimuth: True if the
    azimuth is farther from its reference than the elevation."""
    (t, end), (first, last), beamwidth = times, offsets, constants.p.tracker.receiver.beamwidth
    ahead, half = state.guidance.lookahead, 0.5 * beamwidth
    slewing = planner.slewing(ahead, end)
    if slewing and ahead.slew.t1 != state.begun:
        state.begun = ahead.slew.t1
        state.long_way |= ahead.slew.long_way
    power = 0.5 * (sum_pattern(first / beamwidth)**2 + sum_pattern(last / beamwidth)**2)
    state.received += power * (end - t)
    if max(first, last) <= half:
        return
    if min(first, last) <= half:
        crossing = t + (end - t) * (half - first) / (last - first)
        t, end = (crossing, end) if last > half else (t, crossing)
    reason = KEYHOLE if slewing else TRAVEL if state.guidance.turn.under_way or now.azimuth_held else (
        ELEVATION_LIMIT if now.elevation_held else KEYHOLE if of_azimuth else ELEVATION_RATE_LIMIT)
    _add(state, pieces, reason, t, end)
