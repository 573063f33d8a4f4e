"""Where the axes are sent: the target of the mode on the deck, on the azimuth wrap that fits, or a slew ahead of it.

s, c: records of control_unit.STATE and CONSTANTS.
"""
from acu_tracker import modes
from acu_tracker.estimation import target
from acu_tracker.geometry import azimuth_wrap, direction
from acu_tracker.geometry.azimuth_wrap import Travel
from acu_tracker.geometry.motion import AxisMotion, Motion
from acu_tracker.guidance import manual
from acu_tracker.lookahead import planner
from acu_tracker.mode import by_level, outage
from acu_tracker.program import bridge, program_track
from acu_tracker.servo import position_loop
from pedestal_common.compiled import compiled


@compiled
def of_axes(s, c, program, now):
    """`_reference` of each axis at the instant that its controller needs."""
    t_azimuth, t_elevation = (position_loop.instant(c.axis[0].p, now.t_k, now.t_m),
                              position_loop.instant(c.axis[1].p, now.t_k, now.t_m))
    motion = _reference(s, c, program, t_azimuth)
    if t_elevation != t_azimuth:
        motion = Motion(motion.azimuth, _reference(s, c, program, t_elevation).elevation)
    return motion


@compiled
def _reference(s, c, program, t):
    """Reference Motion on the deck at t [s] of the mode: its target, on the azimuth wrap that fits, or a slew."""
    if not modes.FOLLOWS[s.mode]:
        s.azimuth = s.axis[0].reference.angle
    if s.mode == modes.STOW:
        return Motion(AxisMotion(c.axis[0].p.stow, 0.0, 0.0), AxisMotion(c.axis[1].p.stow, 0.0, 0.0))
    if s.mode == modes.PRESET:
        return direction.motion_at(s.preset, t)
    if s.mode == modes.STOP or s.mode == modes.RATE:
        return Motion(manual.motion(s.manual, 0, t - s.stamp), manual.motion(s.manual, 1, t - s.stamp))
    source = _source(s, c, program, t)
    motion = target.on_deck(s.target, c.p, s.attitude, t, source)
    s.target_angles[0], s.target_angles[1] = motion.azimuth.angle, motion.elevation.angle
    s.pointing_offset = 0.0
    if planner.slewing(s.lookahead, t):
        level = motion.azimuth
        if s.attitude.stabilised:
            level = target.levelled_azimuth(s.target, s.lookahead.level, source)
        motion, s.pointing_offset = planner.motion_at(s.lookahead, c.lookahead, t, motion, level)
        s.azimuth = motion.azimuth.angle
        return motion
    return Motion(_wrapped(s, c, program, t, motion.azimuth), motion.elevation)


@compiled
def _source(s, c, program, t):
    """The target.Source of the mode at t [s]; the program bridges an outage that has a reason."""
    if s.mode == modes.SLAVE:
        return target.Source(0, direction.motion_at(s.slave, t))
    if modes.BY_TABLE[s.mode]:
        return target.Source(0, program_track.motion_at(program, t))
    if modes.BY_LEVEL[s.mode]:
        return by_level.source(s, c, program, t)
    if (s.bridge.valid and outage.coasting(s, c) and outage.permitted(s, c)
            and program_track.status(program, t) == modes.NONE):
        return target.Source(0, bridge.motion_at(s.bridge, program, t))
    return target.outlook(s.target, c.tracker, t)


@compiled
def _wrapped(s, c, program, t, azimuth):
    """AxisMotion of the azimuth at t [s] on the wrap that fits; when a program begins, on one that holds all of it."""
    limits, travel = c.axis[0].p.limits, Travel(0.0, 0.0)
    begins = s.entered and modes.BY_TABLE[s.mode]
    if begins:
        travel = program_track.azimuth_travel(program, t)
    s.azimuth = azimuth_wrap.nearest(azimuth.angle, s.azimuth, limits.low, limits.high, travel)
    if begins:
        s.overtravel = s.azimuth + travel.below < limits.low or s.azimuth + travel.above > limits.high
    return AxisMotion(s.azimuth, azimuth.rate, azimuth.acceleration)


@compiled
def look_ahead(s, c, program):
    """Plan ahead once in planner.INTERVAL: keyholes and hidden sectors on the path of the target."""
    h = s.lookahead
    if not modes.FOLLOWS[s.mode] or s.mode == modes.SLAVE:
        planner.forget(h)
        s.overtravel, s.pointing_offset = 0, 0.0
        return
    if planner.another_program(h, program):
        # The plan was for the previous program; this one begins as a mode does.
        planner.forget(h)
        s.bridge.valid, s.entered = 0, 1
    if not planner.due(h, s.stamp):
        return
    if modes.BY_TABLE[s.mode]:
        s.bridge.valid = 0
        planner.look_along_program(h, c.lookahead, s.stamp, s.azimuth, program, s.bridge)
        return
    sight = (by_level.sight(s, program, s.stamp) if modes.BY_LEVEL[s.mode]
             else target.earth_outlook(s.target, c.tracker, s.stamp))
    if s.mode == modes.AUTOTRACK and not outage.coasting(s, c):
        bridge.begin(s.bridge, program, s.stamp, sight.u)
    if s.bridge.valid and program_track.status(program, s.stamp) == modes.NONE:
        planner.look_along_program(h, c.lookahead, s.stamp, s.azimuth, program, s.bridge)
    else:
        planner.look_along_great_circle(h, c.lookahead, s.stamp, s.azimuth, sight.u, sight.du)
