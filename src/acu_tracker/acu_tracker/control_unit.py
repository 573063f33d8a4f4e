"""The antenna control unit: one `step` per drive step, from encoders, receiver error and attitude to the rate command.

The estimate lives in earth angles, near the zenith in those of a tilted `estimate_frame`. docs/architecture.md shows
the order of a step. Each part of the state is written by its own module; here they are brought together.

s, c, u, o: records of STATE, CONSTANTS, signals.INPUTS and OUTPUTS; of_all: the Tables.
"""
import math

import numpy as np

from acu_tracker import intake, modes, signals
from acu_tracker.alarms import annunciator, conditions
from acu_tracker.estimation import divergence, repetition, slope_sign, target, tracker
from acu_tracker.estimation.filters import measurement, target_filter
from acu_tracker.geometry import attitude, deck_reference, direction, encoders
from acu_tracker.geometry.azimuth_wrap import Travel
from acu_tracker.geometry.motion import AxisMotion, Motion, line_of_sight
from acu_tracker.geometry.vector import Vector, rotated, rotation
from acu_tracker.guidance import guidance, manual
from acu_tracker.lookahead import levelled_deck, planner
from acu_tracker.mode import by_level, mode_change, outage, reach, resumption, stow, supervision
from acu_tracker.params import AxisParameters, SharedParameters
from acu_tracker.program import bridge, program_track, tables
from acu_tracker.search import acquisition, coast, place
from acu_tracker.servo import ends, floor, frozen, notch, position_loop, reference, unasked
from acu_tracker.servo.position_loop import Feedback, Instants
from pedestal_common.compiled import compiled
from pedestal_common.geometry import blockage
from pedestal_common.geometry import line_of_sight as pointing
from pedestal_common.parameters import record, record_type

STATE = np.dtype([
    ('stamp', 'f8'), ('error', 'f8', (2,)),             # of this step [s]; of the receiver in deck angles [rad]
    ('mode', mode_change.MODE), ('resumption', resumption.RESUMPTION), ('stow', stow.STOW),
    ('unasked', unasked.ENVELOPE), ('frozen', frozen.FROZEN),
    ('encoders', encoders.ENCODERS), ('attitude', attitude.ATTITUDE),
    ('target', target.TARGET), ('outage', outage.OUTAGE), ('repetition', repetition.REPETITION),
    ('divergence', divergence.DIVERGENCE), ('slope_sign', slope_sign.SLOPE_SIGN),
    ('preset', direction.DIRECTION), ('slave', direction.DIRECTION), ('manual', manual.MANUAL),
    ('guidance', guidance.GUIDANCE), ('bridge', bridge.BRIDGE),
    ('acquisition', acquisition.ACQUISITION),
    ('lookahead', planner.PLANNER), ('axis', position_loop.AXIS, (2,)), ('supervision', conditions.SUPERVISION),
], align=True)

AXIS_CONSTANTS = np.dtype([('p', record_type(AxisParameters)), ('notch', 'f8', (5,)), ('reaction', 'f8'),
                           ('braking', 'f8')], align=True)
CONSTANTS = np.dtype([('p', record_type(SharedParameters)), ('axis', AXIS_CONSTANTS, (2,)), ('lead', 'f8'),
                      ('tracker', tracker.CONSTANTS), ('lookahead', planner.CONSTANTS), ('floor', floor.FLOOR)],
                     align=True)
"""p: the parameters; notch: coefficients; reaction, braking: time [s] given in
front of a limit, deceleration there [rad/s2]; lead: t_m - t_k [s]."""


def axis_constants(params, period, reaction) -> np.ndarray:
    """Constants (1,) of AxisParameters, for steps of period [s]; reaction [s]: see position_loop.follow."""
    c, n = np.zeros(1, AXIS_CONSTANTS), params.notch
    c['p'] = record(params, AxisParameters)
    c['notch'] = notch.coefficients(n.frequency, n.width, n.depth, period)
    c['reaction'], c['braking'] = reaction, params.limits.deceleration
    return c


def constants(params) -> np.ndarray:
    """Constants (1,) of AcuParameters."""
    c, axes = np.zeros(1, CONSTANTS), (params.azimuth, params.elevation)
    c['p'] = record(params, SharedParameters)
    c['lead'] = params.command_delay + 0.5 * params.period
    c['axis'] = np.concatenate([axis_constants(position_loop.slowed(axis, params.command_delay), params.period,
                                               params.reaction) for axis in axes])
    c['floor'] = floor.table(params.floor)
    c['tracker'] = tracker.constants(params.tracker, [axis.filter for axis in axes])
    c['lookahead'] = planner.constants(params)
    return c


def initial_state(params) -> np.ndarray:
    """State (1,) before the first step of AcuParameters: standby, the initial mode pending."""
    s = np.zeros(1, STATE)
    s['stamp'] = -math.inf
    mode_change.initialise(s['mode'], params)
    for name, preset in (('preset', (params.azimuth.preset, params.elevation.preset)), ('slave', 0.0)):
        direction.give(s[name], -math.inf, preset, 0.0, 0.0)
    for name, module in (('resumption', resumption), ('stow', stow), ('unasked', unasked), ('target', target),
                         ('outage', outage), ('manual', manual), ('acquisition', acquisition),
                         ('lookahead', planner), ('supervision', conditions)):
        module.initialise(s[name])
    return s


# What happens between two steps.

@compiled
def latched(s):
    """Bits of the alarms whose fault waits for a reset."""
    return supervision.latched(s.unasked.moves, s.frozen.frozen, s.divergence.diverged)


@compiled
def request(s, c, u, o, of_all, mode):
    """Request a mode (its code) between two steps; True when granted. Sets outputs.mode and outputs.reason.

    The decision uses the inputs of the last step; it takes effect on the command of the next. Arguments as of `step`.
    """
    result, _ = _change(s, c, u, o, of_all, mode, _outage(s, c))
    o.mode, o.reason = s.mode.now, s.mode.reason
    return result == modes.ACCEPTED


@compiled
def refusals(s, c, u, of_all, why):
    """Put into why (len(MODES),) for each mode NONE or why `request` would refuse it now."""
    for mode in range(len(why)):
        now, _ = _situation(s, c, u, of_all, mode, _outage(s, c))
        why[mode] = modes.obstacle(mode, now)


@compiled
def reset(s):
    """Reset what is latched: annunciator.NONE, or the index of an alarm whose cause is still there, and nothing is
    changed. A mode that waited to be entered is forgotten: nothing moves until one is asked for."""
    alarms, t, waited = s.supervision.alarms, s.stamp, latched(s) != 0
    if s.unasked.moves and unasked.beyond(s.unasked, t):
        return supervision.MOVES_UNASKED
    cause = annunciator.persists(alarms, supervision.LATCHED)
    if cause != annunciator.NONE:
        return cause
    unasked.release(s.unasked)
    frozen.release(s.frozen, t)
    divergence.release(s.divergence)
    if supervision.reset(alarms, t) or waited:
        mode_change.wait_for(s.mode, modes.NO_REQUEST)
        resumption.forget(s.resumption)
    return annunciator.NONE


# A step, in its order.

@compiled
def step(s, c, u, o, of_all):
    """Run one drive step.

    A stamp that does not advance (or is NaN) changes nothing: the last command stands, `stamp` is flagged.
    """
    dt = u.stamp - s.stamp
    if not (dt > 0.0 and math.isfinite(u.stamp)):
        o.invalid_input = signals.STAMP
        o.reason = modes.BAD_STAMP
        return
    signals.clear(o)
    silence = c.p.step_gap < dt < math.inf
    if silence and s.mode.now != modes.STANDBY:
        # The axes stand. The mode goes on, from where they are, if the silence was short enough.
        mode_change.go_on(s.mode, resumption.mode_after(s.resumption, s.mode.now, s.stamp, u.stamp, c.p.resume_time))
    s.stamp = u.stamp
    flags = observe(s, c, u, o, of_all, silence)
    begins, gap = _rests(s, c, u) or dt > c.p.step_gap, _outage(s, c)
    now = Instants(s.stamp, s.stamp + c.lead, c.p.period if dt > c.p.step_gap else dt)
    flags |= _decide(s, c, u, o, of_all, gap)
    if encoders.taken(s.encoders, s.stamp):
        _start_from_actual(s, c, u, begins, silence)
    _move_by_hand(s, c, u, begins, now.dt)
    _move(s, c, u, o, of_all, gap, now)
    _tell(s, c, u, o, flags)
    _look_ahead(s, c, of_all, gap)
    _supervise(s, c, u, o, dt)


@compiled
def observe(s, c, u, o, of_all, silence):
    """Take in what has come for the step: encoders, attitude, receiver, preset, and what watches over them. Gives the
    bits of signals.INVALID_INPUTS. silence: whether the step before is long ago."""
    way = _way(s, of_all)
    tracker.transfer(s.target.tracker, c.p.tracker, c.tracker)
    flags = signals.STEP_GAP if silence else 0
    flags |= intake.take_encoders(s.encoders, u) | _hear_attitude(s, c, u) | _hear_receiver(s, c, u, o, way)
    flags |= intake.take_preset(s.preset, u)
    unasked.watch(s.unasked, s.stamp, u.velocity, c.p.unasked_rate, silence or not u.drive_ready)
    if c.axis[0].p.controller != position_loop.BEAM:
        frozen.watch(s.frozen, u, c.p.step_gap + c.p.command_delay, silence)
    if by_level.advance(s.acquisition, s.mode.now, c, u, way):
        divergence.latch(s.divergence)
    return flags


@compiled
def _way(s, of_all):
    """The bridge.Way of the table that was followed last."""
    return bridge.way(s.bridge, tables.of_mode(of_all, s.mode.table))


@compiled
def _hear_attitude(s, c, u):
    """Take the attitude of this step, also into the mean of the look-ahead; flags of what is not valid."""
    if attitude.put(s.attitude, u.stabilised):
        tracker.stop(s.target.tracker)
        planner.forget(s.lookahead)
    flags, new = intake.take_attitude(s.attitude, c.p, u)
    if new:
        # While the INS aligns its heading is not known: the mean begins with the first one after that.
        levelled_deck.take(s.lookahead.deck, u.attitude_stamp, attitude.newest(s.attitude), c.p.keyhole.mean_time,
                           u.aligning)
    return flags


@compiled
def _hear_receiver(s, c, u, o, way):
    """Filter y = encoder at the instant of the error, displaced by the error, and watch over it; a flag where it is
    not accepted, else 0."""
    s.error[0] = s.error[1] = math.nan
    mode, receiver = s.mode.now, c.p.tracker.receiver
    flags, used, at = intake.error_at(s.encoders, receiver, u, modes.BY_LEVEL[mode], s.guidance.pointing_offset)
    if not used or repetition.take(s.repetition, u, at):
        return flags
    measured = pointing.displaced(at.A, at.E, u.cross_elevation, u.elevation)
    s.error[0], s.error[1] = measured[0] - at.A, measured[1] - at.E
    error, t = (u.cross_elevation, u.elevation), u.error_stamp - receiver.age
    if mode == modes.ACQUIRE:
        place_now = attitude.on_deck(s.attitude, c.p, t, by_level.expected(s.acquisition, way, t))
        by_level.check_slope(s.acquisition, at, place_now, error)
    restart_gap = math.inf if _outage(s, c).permitted else c.p.tracker.restart_gap
    outcome, innovation = target.take(s.target, c.p, c.tracker, s.attitude, u, at, measured, restart_gap)
    if outcome != target.NOISY and supervision.obeys(s.supervision):
        divergence.take(s.divergence, innovation)
    if mode == modes.AUTOTRACK and outcome != target.NO_ATTITUDE and slope_sign.near(u, receiver.beamwidth):
        beam = slope_sign.beam(attitude.at(s.attitude, c.p, t)[1].mat, at.A, at.E)
        variance = measurement.error_variance(u.cross_elevation, u.elevation, u.cn0_dbhz, receiver)
        if slope_sign.take(s.slope_sign, t, beam, error, variance, c.p.tracker.coast_after):
            divergence.latch(s.divergence)
    return intake.tell_error(o, outcome, innovation)


@compiled
def _outage(s, c):
    """The Outage of the receiver at s.stamp."""
    return outage.now(s.outage, s.target.tracker.stamp, s.stamp, c.p)


@compiled
def _rests(s, c, u):
    """Whether the mode commands no motion."""
    return stow.rests(s.stow, c.p.stow_pins, u.pins, s.mode.now)


@compiled
def _decide(s, c, u, o, of_all, gap):
    """Decide on the mode, and on what waits to be one; flags of the tables. gap: the Outage."""
    m = s.mode
    waiting = m.pending if m.now == modes.STANDBY else modes.NO_REQUEST
    _, flags = _change(s, c, u, o, of_all, waiting, gap)
    if c.p.stow_pins and stow.step(s.stow, c, u, m.now):
        mode_change.stowed(m)
    if resumption.waits(s.resumption):
        ended = m.now == modes.STANDBY and m.reason == modes.DRIVE_NOT_READY
        mode_change.wait_for(m, resumption.pending(s.resumption, s.stamp, ended, o.locked, m.pending))
    return flags


@compiled
def _change(s, c, u, o, of_all, request, gap):
    """Run the mode machine at s.stamp with a `request` or NO_REQUEST, and what follows from it: (result, flags of the
    tables). gap: the Outage."""
    now, flags = _situation(s, c, u, of_all, request, gap)
    if now.conditions.slope != modes.NONE:
        divergence.latch(s.divergence)
    o.locked = now.conditions.lock == modes.NONE
    before, table = s.mode.now, s.mode.table
    result = mode_change.change(s.mode, now, request)
    mode = s.mode.now
    if result == modes.ACCEPTED and modes.BY_TABLE[mode]:
        tracker.recount(s.target.tracker)
    if s.mode.table != table:
        bridge.forget(s.bridge)
    if mode != before:
        if modes.BY_LEVEL[mode]:
            _begin_by_level(s, c, of_all, before, before == modes.AUTOTRACK and not gap.coasting)
        if before == modes.AUTOTRACK and now.conditions.track != modes.NONE:
            tracker.stop(s.target.tracker)
        divergence.restart(s.divergence)
        slope_sign.restart(s.slope_sign)
    return result, flags


@compiled
def _situation(s, c, u, of_all, request, gap):
    """(modes.Situation at s.stamp, flags of the tables); gap: the Outage; a table is evaluated only where it
    matters."""
    m, A = s.mode, s.guidance.azimuth
    unstable, (lock, slope, track) = _unstable(s, c, u), _track(s, c, gap)
    # There is no coasting on a filter that has begun anew.
    chosen = m.fallback if m.fallback != modes.AUTOTRACK or s.target.tracker.running else modes.PROGRAM
    falls_back = m.now == modes.SEARCH or (m.now == modes.AUTOTRACK and track != modes.NONE)
    wanted = (request, m.now, m.table if falls_back else m.now, chosen if falls_back else m.now)
    program = tle = sun = modes.NONE
    flags = 0
    if unstable == modes.NONE:
        if modes.PROGRAM in wanted:
            program, flags = reach.table(s.attitude, c, u, modes.PROGRAM, of_all, s.stamp, A)
        if modes.TLE in wanted:
            tle, flag = reach.table(s.attitude, c, u, modes.TLE, of_all, s.stamp, A)
            flags |= flag
        if modes.SUN in wanted:
            sun, flag = reach.table(s.attitude, c, u, modes.SUN, of_all, s.stamp, A)
            flags |= flag
    pins = stow.obstacle(s.stow, c.p.stow_pins, u.pins)
    conditions_now = modes.Conditions(
        nothing=modes.NONE, stow=reach.outside(c, c.axis[0].p.stow, c.axis[1].p.stow),
        pin=modes.PINS_OUT if pins == modes.NONE else modes.NONE,
        preset=reach.outside(c, s.preset.angle[0], s.preset.angle[1]),
        direction=modes.NONE if direction.there(s.slave, s.stamp) else modes.NO_DIRECTION,
        program=program, tle=tle, sun=sun, lock=lock, slope=slope, track=track,
        level=by_level.end(s.acquisition, m.now, c, s.stamp))
    return modes.Situation(
        encoder_valid=encoders.taken(s.encoders, s.stamp),
        drive=supervision.distrust(u.drive_ready, s.unasked.moves, s.frozen.frozen), attitude=unstable, pins=pins,
        handover=by_level.found(s.acquisition, m.now, c) if modes.BY_LEVEL[m.now] else c.p.tracker.handover != 0,
        table=m.table, chosen=chosen, conditions=conditions_now), flags


@compiled
def _unstable(s, c, u):
    """NONE, or why the attitude is not known when the next command is in force."""
    if not s.attitude.stabilised:
        return modes.NONE
    # Before the first attitude the state of the INS may not have arrived yet.
    if u.aligning and s.attitude.history.count > 0:
        return modes.INS_ALIGNING
    return modes.NONE if attitude.at(s.attitude, c.p, s.stamp + c.lead)[0] else modes.ATTITUDE_INVALID


@compiled
def _track(s, c, gap):
    """Conditions lock, slope and track; gap: the Outage."""
    k, silent, running = c.p.tracker, not gap.permitted, s.target.tracker.running
    spread = _spread(s, c) if running and silent and gap.coasting else 0.0
    lost = not running or (silent and coast.over(gap.since, k.coast_time, spread, k.receiver.beamwidth))
    if s.divergence.diverged or (s.mode.now == modes.AUTOTRACK and supervision.obeys(s.supervision)
                                 and divergence.diverges(s.divergence, gap.coasting and silent)):
        return modes.DIVERGED, modes.DIVERGED, modes.DIVERGED
    lock = modes.NONE if tracker.locked(s.target.tracker, k, gap.since) else modes.NOT_LOCKED
    side_lobe = by_level.in_side_lobe(s.acquisition, c, s.stamp)
    return lock, modes.NONE, modes.SIGNAL_LOST if lost else modes.SIDE_LOBE if side_lobe else modes.NONE


@compiled
def _spread(s, c):
    """Standard deviation of the estimate across the line of sight at s.stamp [rad]."""
    estimate = target.read(s.target, c.p, c.tracker, s.attitude, s.stamp)
    azimuth, elevation = estimate.variances
    return coast.sigma(azimuth.p11, elevation.p11, estimate.motion.elevation.angle)


@compiled
def _begin_by_level(s, c, of_all, before, tracked):
    """Enter a mode that goes by the level from the one before; tracked: whether the target is, up to now."""
    tracking = before == modes.AUTOTRACK
    if tracked:
        _bridge(s, c, of_all)
    if not modes.BY_LEVEL[before]:
        u, du = _place(s, c, tracking)
        by_level.remember(s.acquisition, s.stamp, u, du)
    spread = _spread(s, c) if tracking and s.mode.now == modes.SEARCH else math.nan
    by_level.begin(s.acquisition, s.mode.now, c, s.stamp, spread)


@compiled
def _bridge(s, c, of_all):
    """Put the program where the target is tracked now."""
    program = tables.of_mode(of_all, s.mode.table)
    bridge.begin(s.bridge, program, s.stamp, target.earth_outlook(s.target, c.tracker, s.stamp).u)


@compiled
def _place(s, c, tracking):
    """(ENU unit vector, its rate [1/s]) of where the target is now: by the estimate that autotrack followed, or else
    where the antenna points."""
    if tracking:
        sight = target.earth_outlook(s.target, c.tracker, s.stamp)
        return sight.u, sight.du
    _, at = encoders.at(s.encoders, s.stamp)
    _, deck = attitude.at(s.attitude, c.p, s.stamp)
    x, y, z = pointing.direction(at.A, at.E)
    return rotated(deck.mat, Vector(x, y, z)), place.STILL


@compiled
def _start_from_actual(s, c, u, begins, silence):
    """Targets := actual, of both axes where they begin anew; of one that does not obey in every step until it does, or
    it would wind up behind its commands and make good for them at once when it hears them again."""
    if begins:
        guidance.start_from(s.guidance, u.position[0])
    for i in range(2):
        rate = u.velocity[i]
        immobile = not begins and s.supervision.axis[i].immobile != 0
        if immobile:
            rate = position_loop.realised(s.axis[i].command, rate)
        if silence or immobile:
            position_loop.take_back(s.axis[i], rate)
        if begins or immobile:
            position_loop.initialise(s.axis[i], c.axis[i].p, s.stamp, u.position[i], rate)


@compiled
def _move_by_hand(s, c, u, begins, dt):
    """Move the point that is commanded by hand on by dt [s]; begins: whether the axes do."""
    mode, travel = s.mode.now, floor.by_hand(c, u, s.manual.angle[0])
    heard = mode == modes.RATE and manual.heard(s.manual, s.stamp)
    for i in range(2):
        if s.mode.begins or begins:
            manual.begin(s.manual, i, reference.now(s.axis[i].reference))
        if mode == modes.STOP or mode == modes.RATE:
            manual.step(s.manual, i, c.axis[i].p.shaper, travel[i], heard, dt)


@compiled
def _move(s, c, u, o, of_all, gap, now):
    """Move the axes, or let them rest; gap: the Outage; now: the Instants."""
    if _rests(s, c, u):
        for i in range(2):
            _write(o, i, position_loop.stop(s.axis[i], c.axis[i].p, now.dt))
    else:
        _follow(s, c, u, o, _motion(s, c, _way(s, of_all), gap, now), now)
        mode_change.begun(s.mode)
        _explain_outage(s, c, of_all, gap)
        o.blocked, o.coasting = s.outage.blocked, s.mode.now == modes.AUTOTRACK and gap.coasting
    for i in range(2):
        unasked.command(s.unasked, i, o.rate[i], s.stamp, min(now.dt, c.p.period), c.p.step_gap + c.p.command_delay)
        frozen.command(s.frozen, i, o.rate[i], c.p.period)


@compiled
def _motion(s, c, way, gap, now):
    """`_reference` of each axis at the instant that its controller needs; now: the Instants."""
    t_azimuth, t_elevation = (position_loop.instant(c.axis[0].p, now.t_k, now.t_m),
                              position_loop.instant(c.axis[1].p, now.t_k, now.t_m))
    motion = _reference(s, c, way, gap, t_azimuth)
    if t_elevation != t_azimuth:
        motion = Motion(motion.azimuth, _reference(s, c, way, gap, t_elevation).elevation)
    return motion


@compiled
def _reference(s, c, way, gap, t):
    """Reference Motion on the deck at t [s] of the mode: its target, on the azimuth wrap that fits, or a slew."""
    mode, g, limits = s.mode.now, s.guidance, c.axis[0].p.limits
    if not modes.FOLLOWS[mode]:
        guidance.start_from(g, s.axis[0].reference.angle)
    if mode == modes.STOW:
        return Motion(AxisMotion(c.axis[0].p.stow, 0.0, 0.0), AxisMotion(c.axis[1].p.stow, 0.0, 0.0))
    if mode == modes.PRESET:
        return direction.motion_at(s.preset, t)
    if mode == modes.STOP or mode == modes.RATE:
        return manual.motion(s.manual, t - s.stamp)
    source = _source(s, c, way, gap, t)
    motion = target.on_deck(s.target, c.p, s.attitude, t, source)
    guidance.aim(g, motion)
    if planner.slewing(s.lookahead, t):
        level = motion.azimuth
        if s.attitude.stabilised:
            level = target.levelled_azimuth(s.target, rotation(s.lookahead.level), source)
        return guidance.slew(g, *planner.motion_at(s.lookahead, c.lookahead, t, motion, level))
    if s.mode.begins and modes.BY_TABLE[mode]:
        return guidance.begin_program(g, limits, motion, way.program, t)
    return guidance.follow(g, limits, motion, Travel(0.0, 0.0))


@compiled
def _source(s, c, way, gap, t):
    """The target.Source of the mode at t [s]; the program bridges an outage that has a reason."""
    mode = s.mode.now
    if mode == modes.SLAVE:
        return target.Source(0, direction.motion_at(s.slave, t))
    if modes.BY_TABLE[mode]:
        return target.Source(0, program_track.motion_at(way.program, t))
    if modes.BY_LEVEL[mode]:
        return by_level.source(s.acquisition, mode, c, way, t)
    if way.valid and gap.coasting and gap.permitted and program_track.status(way.program, t) == modes.NONE:
        return target.Source(0, bridge.motion_at(way, t))
    return target.outlook(s.target, c.tracker, t)


@compiled
def _follow(s, c, u, o, motion, now):
    """Run the position loops of both axes towards a Motion."""
    V, now_ends = _deck_rates(s, c), floor.ends(c, u, motion.azimuth.angle)
    closed = s.mode.now == modes.AUTOTRACK
    for i in range(2):
        feedback = Feedback(u.position[i], u.velocity[i], s.error[i], V[i], closed, now_ends[i])
        _write(o, i, position_loop.follow(s.axis[i], c.axis[i], motion[i], feedback, now))


@compiled
def _deck_rates(s, c):
    """(azimuth, elevation) rate [rad/s] at which the deck's motion moves an earth-fixed direction at the beam; 0 where
    no axis compensates for it."""
    wanted = c.axis[0].p.beam.rate_compensation != 0.0 or c.axis[1].p.beam.rate_compensation != 0.0
    if wanted and s.attitude.stabilised:
        known, deck = attitude.at(s.attitude, c.p, s.stamp)
        if known:
            return deck_reference.fixed_rates(deck.w, s.axis[0].reference.angle, s.axis[1].reference.angle)
    return 0.0, 0.0


@compiled
def _write(o, i, command):
    """The Command of axis i into the outputs."""
    o.rate[i], o.torque[i] = command.rate, command.torque
    o.reference[i, 0], o.reference[i, 1], o.reference[i, 2] = command.reference
    o.angle_limited[i], o.rate_limited[i] = command.angle_limited, command.rate_limited
    o.acceleration_limited[i] = command.acceleration_limited


@compiled
def _explain_outage(s, c, of_all, gap):
    """Note why the receiver may be without signal: the target is hidden, or the beam slews through the keyhole."""
    follows, angles = modes.FOLLOWS[s.mode.now], s.guidance.target_angles
    hidden = follows and blockage.blocked(c.lookahead.sectors, angles[0], angles[1])
    reason = outage.watch(s.outage, hidden, follows and planner.slewing(s.lookahead, s.stamp), s.stamp)
    mode_change.explain(s.mode, reason)
    if reason != modes.NONE and s.mode.now == modes.AUTOTRACK and not gap.coasting:
        _bridge(s, c, of_all)


@compiled
def _tell(s, c, u, o, flags):
    """Put mode, flags, counts and the estimate into the outputs."""
    of_axes, t = floor.ends(c, u, u.position[0]), s.target.tracker
    for i in range(2):
        o.time_to_limit[i] = ends.time_to(u.position[i], u.velocity[i], of_axes[i])
    o.mode, o.reason, o.invalid_input = s.mode.now, s.mode.reason, flags
    o.gated, o.rates_gated, o.ranges_gated = t.gated, t.rates_gated, t.ranges_gated
    o.pins, o.pins_wrong = s.stow.asked, stow.wrong(s.stow, c, u) if c.p.stow_pins else 0
    if t.running:
        _read_estimate(s, c, o)


@compiled
def _read_estimate(s, c, o):
    """Put the estimate of the target at s.stamp, in earth angles of the antenna, into the outputs."""
    estimate = target.read(s.target, c.p, c.tracker, s.attitude, s.stamp)
    for i in range(2):
        o.estimate[i, 0], o.estimate[i, 1], o.estimate[i, 2] = estimate.motion[i]
        o.covariance[i, 0], o.covariance[i, 1], o.covariance[i, 2] = estimate.variances[i]
    target_filter.probabilities(s.target.tracker.filter, c.tracker.filter, o.probability)


@compiled
def _look_ahead(s, c, of_all, gap):
    """Plan ahead once in planner.INTERVAL: keyholes and hidden sectors on the path of the target; gap: the Outage."""
    h, mode, program = s.lookahead, s.mode.now, tables.of_mode(of_all, s.mode.table)
    if not modes.FOLLOWS[mode] or mode == modes.SLAVE:
        planner.forget(h)
        guidance.forget(s.guidance)
        return
    if planner.another_program(h, program):
        # The plan was for the previous program; this one begins as a mode does.
        planner.forget(h)
        bridge.forget(s.bridge)
        mode_change.begin(s.mode)
    if not planner.due(h, s.stamp):
        return
    if modes.BY_TABLE[mode]:
        bridge.forget(s.bridge)
    sight = _sight(s, c, program)
    if mode == modes.AUTOTRACK and not gap.coasting:
        bridge.begin(s.bridge, program, s.stamp, sight.u)
    way, A = bridge.way(s.bridge, program), s.guidance.azimuth
    if modes.BY_TABLE[mode] or (way.valid and program_track.status(program, s.stamp) == modes.NONE):
        planner.look_along_program(h, c.lookahead, s.stamp, A, way)
    else:
        planner.look_along_great_circle(h, c.lookahead, s.stamp, A, sight.u, sight.du)


@compiled
def _sight(s, c, program):
    """LineOfSight in ENU of the target of the mode at s.stamp, of one that goes by the level of its expected place."""
    if modes.BY_LEVEL[s.mode.now]:
        return line_of_sight(by_level.expected(s.acquisition, bridge.way(s.bridge, program), s.stamp))
    return target.earth_outlook(s.target, c.tracker, s.stamp)


@compiled
def _supervise(s, c, u, o, dt):
    """Bring the alarms to this step, dt [s] after the one before."""
    jumped, ship = dt > c.p.step_gap, s.attitude.stabilised and s.attitude.history.count > 0
    # Autotrack is without signal, and nothing explains it.
    signal_lost = s.mode.reason == modes.SIGNAL_LOST or (o.coasting and not _outage(s, c).permitted)
    facts = conditions.Facts(
        0.0 if jumped else dt, dt if jumped else 0.0, dt > 1.5 * c.p.period, latched(s),
        ship and not attitude.at(s.attitude, c.p, s.stamp + c.lead)[0], ship and s.attitude.jump.apart, signal_lost,
        c.p.unasked_rate, c.p.tracker.receiver.beamwidth)
    mode = modes.STANDBY if _rests(s, c, u) else s.mode.now
    conditions.take(s.supervision, mode, u, o, c.axis, s.unasked, facts)
    o.alarms = s.supervision.alarms.revision
