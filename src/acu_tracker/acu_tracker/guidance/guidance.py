"""Guidance: the reference of both axes in encoder angles, from the target of the mode.

The target is converted to deck angles, the pointing model converts these to encoder angles, and the azimuth is put on
an azimuth wrap inside the limits. Near a keyhole the reference is a planned slew of the look-ahead instead.
`control_unit` calls this module in each step.

g      record of Guidance
k      record of tracking.Tracking
c      record of control_unit.Constants
way    bridge.Way: the program, rotated to the place where the target was last tracked
gap    outage.Outage: the time without a signal of the receiver
order  the Order of the step
"""
import math
from collections import namedtuple

import numpy as np

from acu_tracker import modes, tracking
from acu_tracker.estimation import target
from acu_tracker.geometry import attitude, azimuth_turn, azimuth_wrap, direction
from acu_tracker.geometry.azimuth_wrap import Travel
from acu_tracker.geometry.motion import AxisMotion, Motion, line_of_sight
from acu_tracker.geometry.vector import rotation
from acu_tracker.guidance import manual
from acu_tracker.lookahead import planner
from acu_tracker.mode import signal_level_modes
from acu_tracker.modes import Mode, Reason
from acu_tracker.pointing import model
from acu_tracker.program import bridge, program_track
from acu_tracker.search import acquisition
from acu_tracker.servo import position_loop
from pedestal_common.compiled import compiled, separate
from pedestal_common.quantities import Pair
from pedestal_common.record import Record


class Guidance(Record):
    """State of the guidance."""
    preset: direction.Direction  # direction of the mode preset, deck angles on the sky
    slave: direction.Direction  # direction of the mode slave, earth angles
    manual: manual.Manual  # point that an operator moves by hand, in the modes stop and rate
    bridge: bridge.Bridge  # rotation of the program to the place where the target was last tracked
    acquisition: acquisition.Acquisition  # state of the modes that use the signal level
    lookahead: planner.Planner  # planned slews through keyholes, and predicted hidden sectors
    turn: azimuth_turn.Turn  # turn of the azimuth to another wrap at a limit of its travel
    azimuth: float  # azimuth of the last reference, before the shaper [rad]
    target_angles: Pair  # encoder angles (azimuth, elevation) of the target for that reference [rad]
    direction: Pair  # deck angles (azimuth, elevation) of the target on the sky [rad]
    unreachable: int  # 1: the beam cannot point to the direction, and points to the nearest one
    pointing_offset: float  # intended angle between beam and target [rad]
    held: float  # last instant [s] at which a limit held the beam off the target
    overtravel: int  # 1: no azimuth wrap holds the whole program inside the limits


Order = namedtuple('Order', 'mode begins azimuth stamp')
"""Mode of a step and where it starts.

mode     code of the mode
begins   True if the mode begins in this step
azimuth  azimuth of the last shaped reference [rad]
stamp    stamp of the step [s]
"""


def initialise(g, preset):
    """Begin with no direction except the preset angles (2,) [rad]; g: view of Guidance."""
    direction.initialise(g['preset'], preset)
    direction.initialise(g['slave'], 0.0)
    manual.initialise(g['manual'])
    acquisition.initialise(g['acquisition'])
    planner.initialise(g['lookahead'])
    azimuth_turn.initialise(g['turn'])
    g['held'] = -math.inf


@compiled
def start_from(g, azimuth):
    """Set the azimuth [rad] near which the next azimuth wrap is chosen."""
    g.azimuth = azimuth


@compiled
def move_by_hand(g, c, order, ends, actual, dt):
    """Advance the point that an operator moves by hand, by dt [s].

    ends: Ends of both axes, at which the point stops; actual: Motion of the axes, where the point begins.
    """
    valid = order.mode == Mode.RATE and manual.request_valid(g.manual, order.stamp)
    for i in range(2):
        if order.begins:
            manual.begin(g.manual, i, actual[i])
        if order.mode == Mode.STOP or order.mode == Mode.RATE:
            manual.step(g.manual, i, c.axis[i].p.shaper, ends[i], valid, dt)


@compiled
def motion(g, k, c, order, way, gap, now):
    """Return the reference Motion of both axes, each at the instant that its controller needs.

    now: position_loop.Instants of the step.
    """
    t_azimuth, t_elevation = (position_loop.instant(c.axis[0].p, now.t_k, now.t_m),
                              position_loop.instant(c.axis[1].p, now.t_k, now.t_m))
    motion = _reference(g, k, c, order, way, gap, t_azimuth)
    if t_elevation != t_azimuth:
        motion = Motion(motion.azimuth, _reference(g, k, c, order, way, gap, t_elevation).elevation)
    return motion


@compiled
def _reference(g, k, c, order, way, gap, t):
    """Return the reference Motion of the encoders at t [s]: the target of the mode, or a slew through a keyhole.

    The angles of the modes stow, stop and rate are encoder angles. A direction of another mode goes through the
    pointing model.
    """
    mode, g.unreachable = order.mode, 0
    if not modes.FOLLOWS_TARGET[mode]:
        start_from(g, order.azimuth)
    if mode == Mode.STOW:
        return Motion(AxisMotion(c.axis[0].p.stow, 0.0, 0.0), AxisMotion(c.axis[1].p.stow, 0.0, 0.0))
    if mode == Mode.PRESET:
        return _on_encoders(g, k, direction.motion_at(g.preset, t))
    if mode == Mode.STOP or mode == Mode.RATE:
        return manual.motion(g.manual, t - order.stamp)
    source = _source(g, k, c, mode, way, gap, t)
    on_sky = target.on_deck(k.target, c.p, k.attitude, t, source)
    g.direction[0], g.direction[1] = on_sky.azimuth.angle, on_sky.elevation.angle
    motion = _on_encoders(g, k, on_sky)
    g.target_angles[0], g.target_angles[1] = motion.azimuth.angle, motion.elevation.angle
    g.pointing_offset = 0.0
    if planner.slewing(g.lookahead, t):
        level = motion.azimuth
        if k.attitude.stabilised:
            on_level = target.on_levelled_deck(k.target, rotation(g.lookahead.level), source)
            level = model.to_encoders(k.pointing.model, on_level)[0].azimuth
        motion, g.pointing_offset = planner.motion_at(g.lookahead, c.lookahead, t, motion, level)
        start_from(g, motion.azimuth.angle)
        return motion
    wrapped = _wrapped(g, c.axis[0].p, order, way.program, t, motion.azimuth)
    start_from(g, model.in_turn(k.pointing.model, on_sky, motion.azimuth.angle, wrapped.angle))
    return Motion(AxisMotion(g.azimuth, wrapped.rate, wrapped.acceleration), motion.elevation)


@compiled
def _on_encoders(g, k, on_sky):
    """Return the Motion of the encoders for a direction, and note whether the beam reaches it.

    on_sky: Motion of the direction in deck angles.
    """
    motion, reachable = model.to_encoders(k.pointing.model, on_sky)
    g.unreachable = 0 if reachable else 1
    return motion


@compiled
def _source(g, k, c, mode, way, gap, t):
    """Return the target.Source of the mode at t [s].

    In autotrack the rotated program takes the place of the estimate during an explained outage of the receiver.
    """
    if mode == Mode.SLAVE:
        return target.Source(0, direction.motion_at(g.slave, t))
    if modes.FOLLOWS_TABLE[mode]:
        return target.Source(0, program_track.motion_at(way.program, t))
    if modes.USES_SIGNAL_LEVEL[mode]:
        return signal_level_modes.source(g.acquisition, mode, c, way, t)
    if way.valid and gap.coasting and gap.permitted and program_track.status(way.program, t) == Reason.NONE:
        return target.Source(0, bridge.motion_at(way, t))
    return target.outlook(k.target, c.tracker, t)


@compiled
def _wrapped(g, p, order, program, t, azimuth):
    """Return the AxisMotion of the azimuth at t [s] on an azimuth wrap inside the limits.

    p        record of AxisParameters
    program  the program track
    azimuth  AxisMotion of the target on any wrap

    When a program begins, the function chooses a wrap that holds the whole program. A later change of the wrap is a
    turn of the axis. An electronic beam changes the wrap at once and makes no turn.
    """
    travel, before, limits = Travel(0.0, 0.0), g.azimuth, p.limits
    begins = order.begins and modes.FOLLOWS_TABLE[order.mode]
    if begins:
        travel = program_track.azimuth_travel(program, t)
    g.azimuth = azimuth_wrap.nearest(azimuth.angle, before, limits.low, limits.high, travel)
    if not begins and abs(g.azimuth - before) > math.pi and p.controller != position_loop.CONTROLLER_BEAM:
        azimuth_turn.begin(g.turn, t)
        if g.overtravel and program_track.status(program, t) == Reason.NONE:
            begins, travel = True, program_track.azimuth_travel(program, t)
    if begins:
        g.overtravel = g.azimuth + travel.below < limits.low or g.azimuth + travel.above > limits.high
    return AxisMotion(g.azimuth, azimuth.rate, azimuth.acceleration)


@compiled
def watch_beam(g, c, mode, references, limited, t):
    """Note whether a turn of the azimuth is over, and whether a limit holds the beam off the target.

    references: shaped reference Motion of the axes at t [s]; limited: True if an axis is held at a limit.
    """
    beamwidth, elevation = c.p.tracker.receiver.beamwidth, g.target_angles[1]
    azimuth_turn.watch(g.turn, references.azimuth.angle, (g.azimuth, elevation), beamwidth, t)
    if limited and modes.FOLLOWS_TARGET[mode] and math.hypot(
            (g.azimuth - references.azimuth.angle) * math.cos(elevation),
            elevation - references.elevation.angle) > azimuth_turn.MAX_OFFSET_BEAMWIDTHS * beamwidth:
        g.held = t


@compiled
def pointing_offset(g, t):
    """Return the intended angle [rad] between beam and target for an error of the receiver that was measured at t [s].

    During a turn of the azimuth the angle is inf, so that no error is used.
    """
    return math.inf if azimuth_turn.covers(g.turn, t) else g.pointing_offset


@compiled
def held(g, c, t):
    """Return True if a limit holds the beam off the target at t [s], or held it within the last coast_time.

    The errors of the receiver are then no evidence of a divergence. The filter still uses these errors, because the
    target may come back to the beam.
    """
    return t - g.held <= c.p.tracker.coast_time


@compiled
def bridge_to(g, k, c, program, t):
    """Rotate the program so that it passes through the estimate of the target at t [s]."""
    bridge.begin(g.bridge, program, t, tracking.sight(k, c, t).u)


@compiled
def begin_by_level(g, k, c, before, mode, t):
    """Enter a mode that uses the signal level at t [s]; before: the previous mode.

    After autotrack the target is expected at its estimate. After another mode it is expected where the antenna points;
    between two modes that use the signal level the expected place stays.
    """
    tracked = before == Mode.AUTOTRACK
    if tracked:
        sight = tracking.sight(k, c, t)
        signal_level_modes.remember(g.acquisition, t, sight.u, sight.du)
    elif not modes.USES_SIGNAL_LEVEL[before]:
        u, du = tracking.beam(k, c, t)
        signal_level_modes.remember(g.acquisition, t, u, du)
    signal_level_modes.begin(g.acquisition, mode, c, t, tracking.spread(k, c, t) if tracked and mode == Mode.SEARCH
                             else np.nan)


@compiled
def check_slope(g, k, c, u, at, way):
    """Compare an error of the receiver with the expected place of the target, to find a slope of the wrong sign.

    u: record of signals.Inputs.dtype; at: Pointing of the beam when the error was measured.
    """
    t = u.error_stamp - c.p.tracker.receiver.age
    motion = attitude.on_deck(k.attitude, c.p, t, signal_level_modes.expected(g.acquisition, way, t))
    signal_level_modes.check_slope(g.acquisition, at, motion, (u.cross_elevation, u.elevation))


@separate
def look_ahead(g, k, c, mode, program, gap, t):
    """Plan for the keyholes and hidden sectors on the path of the target, once in planner.LOOK_AHEAD_PERIOD_S.

    Return True if the program has been replaced; the mode must then restart.
    """
    h = g.lookahead
    if not modes.FOLLOWS_TARGET[mode] or mode == Mode.SLAVE:
        planner.clear_plan(h)
        g.overtravel, g.pointing_offset = 0, 0.0
        if mode != Mode.SLAVE:
            azimuth_turn.stop(g.turn)
            g.held = -math.inf
        return False
    another = planner.another_program(h, program)
    if another:
        # The plan was for the previous program.
        planner.clear_plan(h)
        bridge.clear(g.bridge)
    if planner.due(h, t):
        _plan(g, k, c, mode, program, gap, t)
    return another


@compiled
def _plan(g, k, c, mode, program, gap, t):
    """Plan from t [s] on along the program, or along the great circle of the target."""
    if modes.FOLLOWS_TABLE[mode]:
        bridge.clear(g.bridge)
        planner.look_along_program(g.lookahead, c.lookahead, k.pointing.model, t, g.azimuth,
                                   bridge.way(g.bridge, program))
        return
    if mode == Mode.AUTOTRACK and not gap.coasting:
        bridge_to(g, k, c, program, t)
    way = bridge.way(g.bridge, program)
    if way.valid and program_track.status(program, t) == Reason.NONE:
        planner.look_along_program(g.lookahead, c.lookahead, k.pointing.model, t, g.azimuth, way)
        return
    sight = (line_of_sight(signal_level_modes.expected(g.acquisition, way, t)) if modes.USES_SIGNAL_LEVEL[mode] else
             tracking.sight(k, c, t))
    planner.look_along_great_circle(g.lookahead, c.lookahead, k.pointing.model, t, g.azimuth, sight.u, sight.du)
