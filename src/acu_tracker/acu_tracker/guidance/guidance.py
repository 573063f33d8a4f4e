"""Guidance: the reference of both axes in encoder angles, from the target of the mode.

The target is converted to deck angles, the pointing model converts these to encoder angles, and the azimuth is put on
an azimuth wrap inside the limits. Near a keyhole the reference is a planned slew of the look-ahead instead.

`way` is the program, rotated to the place where the target was last tracked. `gap` is the outage of the receiver.
"""
import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from acu_tracker import modes
from acu_tracker import tracking as target_tracking
from acu_tracker.estimation import target
from acu_tracker.geometry import attitude, azimuth_wrap, direction
from acu_tracker.geometry.azimuth_wrap import Travel
from acu_tracker.geometry.history import Pointing
from acu_tracker.geometry.vector import AxisMotion, Motion, line_of_sight, rotation
from acu_tracker.guidance import manual
from acu_tracker.lookahead import planner
from acu_tracker.mode.interruptions import Outage
from acu_tracker.modes import Mode, Reason
from acu_tracker.pointing import model
from acu_tracker.program import bridge, program_track
from acu_tracker.program.program_track import ProgramTrack
from acu_tracker.search import acquisition
from acu_tracker.servo import position_loop
from acu_tracker.servo.travel import Ends
from acu_tracker.signals import Inputs
from acu_tracker.tracking import Tracking
from pedestal_common.compiled import compiled, separate
from pedestal_common.geometry import line_of_sight as pointing
from pedestal_common.geometry.pointing_model import PointingModel
from pedestal_common.quantities import Bit, BothAxes, Pair, Radians, Records, Seconds
from pedestal_common.record import Record

if TYPE_CHECKING:
    from acu_tracker.control_unit import Constants
    from acu_tracker.params import AxisParameters


class Guidance(Record):
    """State of the guidance."""
    preset: direction.Direction     # direction of the mode preset, deck angles on the sky
    slave: direction.Direction      # direction of the mode slave, earth angles
    manual: manual.Manual           # point that an operator moves by hand, in the modes stop and rate
    bridge: bridge.Bridge           # rotation of the program to the place where the target was last tracked
    acquisition: acquisition.Acquisition    # state of the modes that use the signal level
    lookahead: planner.Planner      # planned slews through keyholes, and predicted hidden sectors
    turn: azimuth_wrap.Turn         # turn of the azimuth to another wrap at a limit of its travel
    azimuth: Radians                # azimuth of the last reference, before the shaper
    target_angles: Pair             # encoder angles of the target for that reference [rad]
    direction: Pair                 # deck angles of the target on the sky [rad]
    unreachable: Bit                # 1: the beam cannot point to the direction, and points to the nearest one
    pointing_offset: Radians        # intended angle between beam and target
    held: Seconds                   # last instant at which a limit held the beam off the target
    overtravel: Bit                 # 1: no azimuth wrap holds the whole program inside the limits


class Order(NamedTuple):
    """Mode of a step and where it starts."""
    mode: int
    begins: Bit         # 1 if the mode begins in this step
    azimuth: Radians    # azimuth of the last shaped reference
    stamp: Seconds      # of the step


def initialise(guidance: Records, preset: tuple[Radians, Radians]) -> None:
    """Begin with no direction except the preset angles."""
    direction.initialise(guidance['preset'], preset)
    direction.initialise(guidance['slave'], 0.0)
    manual.initialise(guidance['manual'])
    acquisition.initialise(guidance['acquisition'])
    planner.initialise(guidance['lookahead'])
    azimuth_wrap.initialise_turn(guidance['turn'])
    guidance['held'] = -math.inf


@compiled
def start_from(guidance: Guidance, azimuth: Radians) -> None:
    """Set the azimuth near which the next azimuth wrap is chosen."""
    guidance.azimuth = azimuth


@compiled
def move_by_hand(guidance: Guidance, constants: 'Constants', order: Order, ends: BothAxes[Ends], actual: Motion,
                 dt: Seconds) -> None:
    """Advance the point that an operator moves by hand, from the actual motion of the axes up to the ends."""
    valid = order.mode == Mode.RATE and order.stamp <= guidance.manual.until
    for i in range(2):
        if order.begins:
            manual.begin(guidance.manual, i, actual[i])
        if order.mode == Mode.STOP or order.mode == Mode.RATE:
            manual.step(guidance.manual, i, constants.axis[i].p.shaper, ends[i], valid, dt)


@compiled
def motion(guidance: Guidance, tracking: Tracking, constants: 'Constants', order: Order, way: bridge.Way, gap: Outage,
           now: position_loop.Instants) -> Motion:
    """Return the reference of both axes, each at the instant that its controller needs."""
    t_azimuth, t_elevation = (position_loop.instant(constants.axis[0].p, now.t_k, now.t_m),
                              position_loop.instant(constants.axis[1].p, now.t_k, now.t_m))
    motion = _reference(guidance, tracking, constants, order, way, gap, t_azimuth)
    if t_elevation != t_azimuth:
        later = _reference(guidance, tracking, constants, order, way, gap, t_elevation)
        motion = Motion(motion.azimuth, later.elevation)
    return motion


@compiled
def _reference(guidance: Guidance, tracking: Tracking, constants: 'Constants', order: Order, way: bridge.Way,
               gap: Outage, t: Seconds) -> Motion:
    """Return the reference of the encoders at t: the target of the mode, or a slew through a keyhole.

    The angles of the modes stow, stop and rate are encoder angles. Another direction goes through the pointing model.
    """
    mode, guidance.unreachable = order.mode, 0
    if not modes.FOLLOWS_TARGET[mode]:
        start_from(guidance, order.azimuth)
    if mode == Mode.STOW:
        return Motion(AxisMotion(constants.axis[0].p.stow, 0.0, 0.0), AxisMotion(constants.axis[1].p.stow, 0.0, 0.0))
    if mode == Mode.PRESET:
        return _on_encoders(guidance, tracking, direction.motion_at(guidance.preset, t))
    if mode == Mode.STOP or mode == Mode.RATE:
        return manual.motion(guidance.manual, t - order.stamp)
    source = _source(guidance, tracking, constants, mode, way, gap, t)
    on_sky = target.on_deck(tracking.target, constants.p, tracking.attitude, t, source)
    guidance.direction[0], guidance.direction[1] = on_sky.azimuth.angle, on_sky.elevation.angle
    motion = _on_encoders(guidance, tracking, on_sky)
    guidance.target_angles[0], guidance.target_angles[1] = motion.azimuth.angle, motion.elevation.angle
    level = motion.azimuth
    if planner.slewing(guidance.lookahead, t) and tracking.attitude.stabilised:
        on_level = target.on_levelled_deck(tracking.target, rotation(guidance.lookahead.level), source)
        level = model.to_encoders(tracking.pointing.model, on_level)[0].azimuth
    return on_axes(guidance, constants, tracking.pointing.model, order, way.program, t, on_sky, motion, level)


@compiled
def on_axes(guidance: Guidance, constants: 'Constants', terms: PointingModel, order: Order, program: ProgramTrack,
            t: Seconds, on_sky: Motion, encoders: Motion, level: AxisMotion) -> Motion:
    """Return the reference of both axes at t: a planned slew, else the target on its azimuth wrap.

    on_sky, encoders: deck angles and encoder angles of the target; level: its encoder azimuth on the levelled deck.
    """
    guidance.pointing_offset = 0.0
    if planner.slewing(guidance.lookahead, t):
        motion, guidance.pointing_offset = planner.motion_at(guidance.lookahead, constants.lookahead, t, encoders,
                                                             level)
        start_from(guidance, motion.azimuth.angle)
        return motion
    wrapped = _wrapped(guidance, constants.axis[0].p, order, program, t, encoders.azimuth)
    start_from(guidance, model.in_turn(terms, on_sky, encoders.azimuth.angle, wrapped.angle))
    return Motion(AxisMotion(guidance.azimuth, wrapped.rate, wrapped.acceleration), encoders.elevation)


@compiled
def _on_encoders(guidance: Guidance, tracking: Tracking, on_sky: Motion) -> Motion:
    # Also note whether the beam reaches the direction.
    motion, reachable = model.to_encoders(tracking.pointing.model, on_sky)
    guidance.unreachable = 0 if reachable else 1
    return motion


@compiled
def _source(guidance: Guidance, tracking: Tracking, constants: 'Constants', mode: int, way: bridge.Way, gap: Outage,
            t: Seconds) -> target.Source:
    # In autotrack the rotated program takes the place of the estimate during an explained outage of the receiver.
    if mode == Mode.SLAVE:
        return target.Source(0, direction.motion_at(guidance.slave, t))
    if modes.FOLLOWS_TABLE[mode]:
        return target.Source(0, program_track.motion_at(way.program, t))
    if modes.USES_SIGNAL_LEVEL[mode]:
        return acquisition.source(guidance.acquisition, mode, constants, way, t)
    if way.valid and gap.coasting and gap.permitted and program_track.status(way.program, t) == Reason.NONE:
        return target.Source(0, bridge.motion_at(way, t))
    return target.Source(1, target.outlook(tracking.target, constants.target, t))


@compiled
def _wrapped(guidance: Guidance, params: 'AxisParameters', order: Order, program: ProgramTrack, t: Seconds,
             azimuth: AxisMotion) -> AxisMotion:
    """Return the motion of the azimuth on an azimuth wrap inside the limits; azimuth: angle of the target on any wrap.

    When a program begins, the function chooses a wrap that holds the whole program. A later change of the wrap is a
    turn of the axis. An electronic beam changes the wrap at once and makes no turn.
    """
    travel, before, limits = Travel(0.0, 0.0), guidance.azimuth, params.limits
    begins = order.begins and modes.FOLLOWS_TABLE[order.mode]
    if begins:
        travel = program_track.azimuth_travel(program, t)
    guidance.azimuth = azimuth_wrap.nearest(azimuth.angle, before, limits.low, limits.high, travel)
    has_motors = int(params.controller) != position_loop.CONTROLLER_BEAM
    if not begins and abs(guidance.azimuth - before) > math.pi and has_motors:
        azimuth_wrap.begin_turn(guidance.turn, t)
        if guidance.overtravel and program_track.status(program, t) == Reason.NONE:
            begins, travel = True, program_track.azimuth_travel(program, t)
    if begins:
        guidance.overtravel = (guidance.azimuth + travel.below < limits.low
                               or guidance.azimuth + travel.above > limits.high)
    return AxisMotion(guidance.azimuth, azimuth.rate, azimuth.acceleration)


@compiled
def watch_beam(guidance: Guidance, constants: 'Constants', mode: int, references: Motion, limited: bool,
               t: Seconds) -> None:
    """Note whether a turn of the azimuth is over, and whether a limit holds the beam off the target.

    references: shaped, at t; limited: True if an axis is held at a limit.
    """
    beamwidth, elevation = constants.p.tracker.receiver.beamwidth, guidance.target_angles[1]
    azimuth_wrap.watch_turn(guidance.turn, references.azimuth.angle, (guidance.azimuth, elevation), beamwidth, t)
    if limited and modes.FOLLOWS_TARGET[mode] and math.hypot(
            (guidance.azimuth - references.azimuth.angle) * math.cos(elevation),
            elevation - references.elevation.angle) > azimuth_wrap.MAX_OFFSET_BEAMWIDTHS * beamwidth:
        guidance.held = t


@compiled
def pointing_offset(guidance: Guidance, t: Seconds) -> Radians:
    """Return the intended angle between beam and target at t; during a turn inf, so that no error is used."""
    return math.inf if azimuth_wrap.turn_covers(guidance.turn, t) else guidance.pointing_offset


@compiled
def held(guidance: Guidance, constants: 'Constants', t: Seconds) -> bool:
    """Return True if a limit holds the beam off the target at t, or held it within the last coast_time.

    The errors of the receiver are then no evidence of a divergence. The filter still uses these errors, because the
    target may come back to the beam.
    """
    return t - guidance.held <= constants.p.tracker.coast_time


@compiled
def bridge_to(guidance: Guidance, tracking: Tracking, constants: 'Constants', program: ProgramTrack,
              t: Seconds) -> None:
    """Rotate the program so that it passes through the estimate at t. This avoids a jump of the antenna."""
    bridge.begin(guidance.bridge, program, t, target.sight(tracking.target, constants.target, t).u)


@compiled
def begin_by_level(guidance: Guidance, tracking: Tracking, constants: 'Constants', before: int, mode: int,
                   t: Seconds) -> None:
    """Enter a mode that uses the signal level at t; before: the previous mode.

    After autotrack the target is expected at its estimate. After another mode it is expected where the antenna points;
    between two modes that use the signal level the expected place stays.
    """
    tracked = before == Mode.AUTOTRACK
    if tracked:
        sight = target.sight(tracking.target, constants.target, t)
        acquisition.remember(guidance.acquisition, t, sight.u, sight.du)
    elif not modes.USES_SIGNAL_LEVEL[before]:
        u, du = target_tracking.beam(tracking, constants, t)
        acquisition.remember(guidance.acquisition, t, u, du)
    spread = target_tracking.spread(tracking, constants, t) if tracked and mode == Mode.SEARCH else np.nan
    acquisition.begin(guidance.acquisition, mode, constants, t, spread)


@compiled
def check_slope(guidance: Guidance, tracking: Tracking, constants: 'Constants', inputs: Inputs, at: Pointing,
                way: bridge.Way) -> None:
    """Compare an error of the receiver, measured with the beam `at`, with the expected place of the target."""
    t = inputs.error_stamp - constants.p.tracker.receiver.age
    expected = acquisition.expected(guidance.acquisition, way, t)
    motion = attitude.on_deck(tracking.attitude, constants.p, t, expected)
    x, y, z = pointing.direction(motion.azimuth.angle, motion.elevation.angle)
    acquisition.take_error(guidance.acquisition, pointing.offsets(at.A, at.E, x, y, z),
                           (inputs.cross_elevation, inputs.elevation))


@separate
def look_ahead(guidance: Guidance, tracking: Tracking, constants: 'Constants', mode: int, program: ProgramTrack,
               gap: Outage, t: Seconds) -> bool:
    """Plan for keyholes and hidden sectors once in planner.LOOK_AHEAD_PERIOD_S.

    Return True if the program has been replaced; the mode must then restart.
    """
    lookahead = guidance.lookahead
    if not modes.FOLLOWS_TARGET[mode] or mode == Mode.SLAVE:
        planner.clear_plan(lookahead)
        guidance.overtravel, guidance.pointing_offset = 0, 0.0
        if mode != Mode.SLAVE:
            azimuth_wrap.stop_turn(guidance.turn)
            guidance.held = -math.inf
        return False
    another = planner.another_program(lookahead, program)
    if another:
        # The plan was for the previous program.
        planner.clear_plan(lookahead)
        bridge.clear(guidance.bridge)
    if planner.due(lookahead, t):
        _plan(guidance, tracking, constants, mode, program, gap, t)
    return another


@compiled
def _plan(guidance: Guidance, tracking: Tracking, constants: 'Constants', mode: int, program: ProgramTrack,
          gap: Outage, t: Seconds) -> None:
    terms, lookahead, azimuth = tracking.pointing.model, guidance.lookahead, guidance.azimuth
    if modes.FOLLOWS_TABLE[mode]:
        bridge.clear(guidance.bridge)
        planner.look_along_program(lookahead, constants.lookahead, terms, t, azimuth,
                                   bridge.way(guidance.bridge, program))
        return
    if mode == Mode.AUTOTRACK and not gap.coasting:
        bridge_to(guidance, tracking, constants, program, t)
    way = bridge.way(guidance.bridge, program)
    if way.valid and program_track.status(program, t) == Reason.NONE:
        planner.look_along_program(lookahead, constants.lookahead, terms, t, azimuth, way)
        return
    sight = (line_of_sight(acquisition.expected(guidance.acquisition, way, t))
             if modes.USES_SIGNAL_LEVEL[mode] else target.sight(tracking.target, constants.target, t))
    planner.look_along_great_circle(lookahead, constants.lookahead, terms, t, azimuth, sight.u, sight.du)
