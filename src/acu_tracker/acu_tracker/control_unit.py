"""The antenna control unit: one `step` per drive step, from encoders, receiver error and attitude to the rate command.

The estimate lives in earth angles, near the zenith in those of a tilted `estimate_frame`.
"""
import math

import numpy as np

from acu_tracker import by_level, direction, manual, modes, reach, resumption, signals, stow, supervision
from acu_tracker.alarms import conditions
from acu_tracker.estimation import divergence, measurement, repetition, target, target_filter, tracker
from acu_tracker.geometry import attitude, azimuth_wrap, deck_reference, encoders
from acu_tracker.geometry.azimuth_wrap import Travel
from acu_tracker.geometry.motion import AxisMotion, Motion
from acu_tracker.geometry.vector import vector
from acu_tracker.lookahead import levelled_deck, planner
from acu_tracker.params import AxisParameters, SharedParameters
from acu_tracker.program import bridge, program_track, tables
from acu_tracker.search import acquisition, coast
from acu_tracker.servo import ends, floor, frozen, notch, position_loop, reference, unasked
from acu_tracker.servo.position_loop import Feedback, Instants
from pedestal_common import blockage, line_of_sight
from pedestal_common.compiled import compiled
from pedestal_common.parameters import record, record_type

ON_TARGET = 0.5
"""Largest intended pointing offset [beamwidths] at which the receiver's error is still used."""

STATE = np.dtype([
    ('stamp', 'f8'), ('mode', 'i8'), ('reason', 'i8'), ('pending', 'i8'), ('entered', 'i8'),
    ('resumption', resumption.RESUMPTION), ('unasked', unasked.ENVELOPE), ('frozen', frozen.FROZEN),
    ('encoders', encoders.ENCODERS), ('attitude', attitude.ATTITUDE), ('aligning', 'i8'),
    ('target', target.TARGET), ('error', 'f8', (2,)),                           # of this step, azimuth, elevation
    ('repetition', repetition.REPETITION), ('divergence', divergence.DIVERGENCE),
    ('preset', direction.DIRECTION), ('slave', direction.DIRECTION), ('manual', manual.MANUAL), ('fallback', 'i8'),
    ('table', 'i8'), ('stow', stow.STOW),                       # mode whose table was followed last
    ('azimuth', 'f8'), ('target_angles', 'f8', (2,)),  # raw azimuth of the last reference; deck angles of its target
    ('pointing_offset', 'f8'),                                  # intended angle between beam and target [rad]
    ('overtravel', 'i8'),                                       # 1: no azimuth wrap held the whole program
    ('outage', 'f8'), ('blocked', 'i8'),                        # stamp at which an outage had a reason last [s]
    ('bridge', bridge.BRIDGE),                                  # program where the target was last tracked
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
    s['stamp'] = s['outage'] = s['resumption']['until'] = -math.inf
    s['pending'] = modes.MODES.index(params.initial_mode)
    s['unasked']['since'] = -math.inf
    s['preset']['angle'] = params.azimuth.preset, params.elevation.preset
    s['fallback'], s['table'] = modes.FALLBACKS[params.fallback], modes.PROGRAM
    stow.initialise(s['stow'])
    s['manual']['until'] = s['slave']['stamp'] = s['preset']['stamp'] = -math.inf
    target.initialise(s['target'])
    acquisition.initialise(s['acquisition'])
    planner.initialise(s['lookahead'])
    conditions.initialise(s['supervision'])
    return s


@compiled
def _take_encoders(s, u):
    """Take the encoders of this step; signals.ENCODER where they are not valid, else 0."""
    return 0 if u.encoder_valid and encoders.take(s.encoders, u.stamp, u.position, u.velocity) else signals.ENCODER


@compiled
def _take_attitude(s, c, u):
    """Take the attitude of this step, also into the mean of the look-ahead; signals.ATTITUDE where it is not valid,
    else 0."""
    s.aligning = u.aligning
    if u.stabilised != s.attitude.stabilised:
        s.attitude.stabilised, s.target.tracker.running = u.stabilised, 0
        planner.forget(s.lookahead)
    if not u.stabilised:
        return 0
    if not u.attitude_valid:
        return signals.ATTITUDE
    outcome = attitude.take(s.attitude, c.p, u.stamp, u.attitude_stamp, u.quaternion, u.deck_rate, u.aligning)
    if outcome == attitude.NEW:
        deck = s.lookahead.deck
        if s.aligning:
            # Its heading is not known yet: the mean begins with the first one after the alignment.
            levelled_deck.restart(deck)
        h = s.attitude.history
        levelled_deck.take(deck, u.attitude_stamp, h.sample[h.newest], c.p.keyhole.mean_time)
    return signals.ATTITUDE if outcome == attitude.INVALID else 0


@compiled
def _take_error(s, c, u, o, program):
    """Filter y = encoder at the instant of the error, displaced by the error; a flag where it is not accepted, else 0.

    The error is a mean of samples that were taken while a beam jumped from step to step, so that target and beam each
    have an instant that the mean belongs to. Linear interpolation between two steps is exact for a ramp, whatever the
    weights of the samples are. No error is used while the beam is intentionally off the target.
    """
    s.error[0] = s.error[1] = math.nan
    receiver = c.p.tracker.receiver
    if not u.error_valid:
        return 0
    if not math.isfinite(u.cross_elevation + u.elevation + u.cn0_dbhz):
        return signals.ERROR
    if s.pointing_offset > ON_TARGET * receiver.beamwidth:
        return 0
    known, at = encoders.at(s.encoders, u.error_stamp - receiver.beam_age)
    if not known:
        return signals.ERROR_STAMP
    if repetition.take(s.repetition, u, at):
        return 0
    measured = line_of_sight.displaced(at.A, at.E, u.cross_elevation, u.elevation)
    s.error[0], s.error[1] = measured[0] - at.A, measured[1] - at.E
    by_level.check_slope(s, c, program, at, u.error_stamp - receiver.age, (u.cross_elevation, u.elevation))
    restart_gap = math.inf if _outage_permitted(s, c) else c.p.tracker.restart_gap
    outcome, innovation = target.take(s.target, c.p, c.tracker, s.attitude, u, at, measured, restart_gap)
    if outcome != target.NOISY and supervision.obeys(s):
        divergence.take(s.divergence, innovation)
    for i in range(2):
        one = innovation.axis[i]
        o.innovation[i], o.rate_innovation[i], o.nis[i] = one.nu, one.rate, measurement.nis(one)
        o.innovation_sigma[i] = math.nan if math.isnan(o.nis[0]) else math.sqrt(one.S)
    if outcome == target.NO_ATTITUDE:
        return signals.ATTITUDE
    if outcome == target.STALE:
        return signals.ERROR_STAMP
    if outcome == target.NOISY:
        return signals.ERROR_NOISY
    return signals.ERROR_GATED if outcome == target.GATED else 0


@compiled
def _take_preset(s, u):
    """Take a new preset; signals.PRESET where it is not finite, else 0."""
    if not u.preset_valid:
        return 0
    if not math.isfinite(u.preset[0] + u.preset[1]):
        return signals.PRESET
    s.preset.angle[0], s.preset.angle[1], s.preset.moves = u.preset[0], u.preset[1], 0.0
    return 0


@compiled
def _since_accepted(s, c):
    """Time [s] since the last accepted measurement, beyond the receiver's latency and the age of its errors."""
    return s.stamp - s.target.tracker.stamp - c.p.receiver_latency - c.p.tracker.receiver.age


@compiled
def _coasting(s, c):
    """Whether the estimate has gone without a measurement for coast_after."""
    return _since_accepted(s, c) > c.p.tracker.coast_after


@compiled
def _outage_permitted(s, c):
    """Whether a keyhole or a hidden sector explains an outage of the receiver, now or within the last coast_time."""
    return s.stamp - s.outage <= c.p.tracker.coast_time


@compiled
def _situation(s, c, u, of_all, request, fallback):
    """(modes.Situation at s.stamp, flags of the tables); a table is evaluated only where it matters."""
    t_m = s.stamp + c.lead
    unstable = modes.NONE
    if s.attitude.stabilised:
        # Before the first attitude the state of the INS may not have arrived yet.
        unstable = (modes.INS_ALIGNING if s.aligning and s.attitude.history.count > 0 else
                    modes.NONE if attitude.at(s.attitude, c.p, t_m) else modes.ATTITUDE_INVALID)
    since = _since_accepted(s, c)
    silent = not _outage_permitted(s, c)
    spread = by_level.sigma(s, c) if s.target.tracker.running and silent and _coasting(s, c) else 0.0
    lost = not s.target.tracker.running or (
        silent and coast.over(since, c.p.tracker.coast_time, spread, c.p.tracker.receiver.beamwidth))
    ends = modes.SIGNAL_LOST if lost else modes.SIDE_LOBE if by_level.in_side_lobe(s, c) else modes.NONE
    unfit = modes.NONE if tracker.locked(s.target.tracker, c.p.tracker, since) else modes.NOT_LOCKED
    if s.mode == modes.AUTOTRACK and supervision.obeys(s):
        divergence.watch(s.divergence, _coasting(s, c) and silent)
    if s.divergence.diverged:
        unfit = ends = modes.DIVERGED
    pins = stow.obstacle(s.stow, c.p.stow_pins, u.pins)
    falls_back = s.mode == modes.SEARCH or (s.mode == modes.AUTOTRACK and ends != modes.NONE)
    program, flags = modes.NONE, 0
    tle = sun = modes.NONE
    if unstable == modes.NONE:
        if reach.matters(s, modes.PROGRAM, request, fallback, falls_back):
            program, flags = reach.table(s, c, u, modes.PROGRAM, of_all)
        if reach.matters(s, modes.TLE, request, fallback, falls_back):
            tle, flag = reach.table(s, c, u, modes.TLE, of_all)
            flags |= flag
        if reach.matters(s, modes.SUN, request, fallback, falls_back):
            sun, flag = reach.table(s, c, u, modes.SUN, of_all)
            flags |= flag
    unchecked = modes.DIVERGED if s.divergence.diverged else modes.NONE
    stowed = reach.outside(c, c.axis[0].p.stow, c.axis[1].p.stow)
    preset = reach.outside(c, s.preset.angle[0], s.preset.angle[1])
    unled = modes.NONE if direction.there(s.slave, s.stamp) else modes.NO_DIRECTION
    obstacle = (modes.NONE, modes.NONE, stowed, modes.PINS_OUT, preset, modes.NONE, unled, program, tle, sun, unfit,
                unchecked, unchecked, modes.NONE)
    obeyed = u.drive_ready != 0 and supervision.distrust(s) == modes.DRIVE_NOT_READY
    drive = encoders.taken(s.encoders, s.stamp), obeyed
    return modes.situation(drive, unstable, pins, s.table, obstacle, (ends, by_level.end(s, c))), flags


@compiled
def _change_mode(s, c, u, o, of_all, request):
    """Run the mode machine at s.stamp with a `request` or NO_REQUEST: (result, flags of the tables)."""
    # There is no coasting on a filter that has begun anew.
    fallback = s.fallback if s.fallback != modes.AUTOTRACK or s.target.tracker.running else modes.PROGRAM
    now, flags = _situation(s, c, u, of_all, request, fallback)
    o.locked = now.obstacle[modes.AUTOTRACK] == modes.NONE
    handover = by_level.found(s, c) if modes.BY_LEVEL[s.mode] else c.p.tracker.handover != 0
    mode, reason, result = modes.next_mode(s.mode, request, now, handover, fallback)
    if result == modes.ACCEPTED:
        s.pending = modes.NO_REQUEST
        if modes.BY_TABLE[mode]:
            s.target.tracker.accepted_in_a_row = 0
    if modes.BY_TABLE[mode] and mode != s.table:
        s.table, s.bridge.valid = mode, 0
    if reason != modes.NONE:
        s.reason = supervision.distrust(s) if reason == modes.DRIVE_NOT_READY else reason
    if mode != s.mode and modes.BY_LEVEL[mode]:
        by_level.begin(s, c, tables.of_mode(of_all, s.table), mode, s.mode == modes.AUTOTRACK and not _coasting(s, c))
    if s.mode == modes.AUTOTRACK and now.end[modes.AUTOTRACK] != modes.NONE and mode != modes.AUTOTRACK:
        s.target.tracker.running = 0
    if mode != s.mode:
        s.mode, s.entered = mode, 1
        divergence.restart(s.divergence)
    return result, flags


@compiled
def _bridge_silence(s, c, stamp):
    """After a silence the axes stand. The mode goes on, from where they are, if it was short enough."""
    if s.mode != modes.STANDBY:
        s.mode = resumption.mode_after(s.resumption, s.mode, s.stamp, stamp, c.p.resume_time)
        if s.mode == modes.STANDBY:
            s.reason = modes.SILENCE
    unasked.restart(s.unasked, stamp)
    frozen.restart(s.frozen, stamp)


@compiled
def request(s, c, u, o, of_all, mode):
    """Request a mode (its code) between two steps; True when granted. Sets outputs.mode and outputs.reason.

    The decision uses the inputs of the last step; it takes effect on the command of the next. Arguments as of `step`.
    """
    result, _ = _change_mode(s, c, u, o, of_all, mode)
    o.mode, o.reason = s.mode, s.reason
    return result == modes.ACCEPTED


@compiled
def refusals(s, c, u, of_all, why):
    """Put into why (len(MODES),) for each mode NONE or why `request` would refuse it now. s: a copy of the state,
    which the question changes."""
    for mode in range(len(why)):
        now, _ = _situation(s, c, u, of_all, mode, s.fallback)
        why[mode] = modes.obstacle(mode, now)
        if why[mode] == modes.DRIVE_NOT_READY:
            why[mode] = supervision.distrust(s)


@compiled
def _source(s, c, program, t):
    """The target.Source of the mode at t [s]; the program bridges an outage that has a reason."""
    if s.mode == modes.SLAVE:
        return target.Source(0, direction.motion_at(s.slave, t))
    if modes.BY_TABLE[s.mode]:
        return target.Source(0, program_track.motion_at(program, t))
    if modes.BY_LEVEL[s.mode]:
        return by_level.source(s, c, program, t)
    if (s.bridge.valid and _coasting(s, c) and _outage_permitted(s, c)
            and program_track.status(program, t) == modes.NONE):
        return target.Source(0, bridge.motion_at(s.bridge, program, t))
    return target.outlook(s.target, c.tracker, t)


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
def _reference_of_axes(s, c, program, now):
    """`_reference` of each axis at the instant that its controller needs."""
    t_azimuth, t_elevation = (position_loop.instant(c.axis[0].p, now.t_k, now.t_m),
                              position_loop.instant(c.axis[1].p, now.t_k, now.t_m))
    motion = _reference(s, c, program, t_azimuth)
    if t_elevation != t_azimuth:
        motion = Motion(motion.azimuth, _reference(s, c, program, t_elevation).elevation)
    return motion


@compiled
def _deck_rates(s, c):
    """(azimuth, elevation) rate [rad/s] at which the deck's motion moves an earth-fixed direction at the beam; 0 where
    no axis compensates for it."""
    wanted = c.axis[0].p.beam.rate_compensation != 0.0 or c.axis[1].p.beam.rate_compensation != 0.0
    if wanted and s.attitude.stabilised and attitude.at(s.attitude, c.p, s.stamp):
        return deck_reference.fixed_rates(vector(s.attitude.w), s.axis[0].reference.angle, s.axis[1].reference.angle)
    return 0.0, 0.0


@compiled
def _follow(s, c, u, o, motion, now):
    """Run the position loops of both axes towards a Motion."""
    V, closed, now_ends = _deck_rates(s, c), s.mode == modes.AUTOTRACK, floor.ends(c, u, motion.azimuth.angle)
    for i in range(2):
        feedback = Feedback(u.position[i], u.velocity[i], s.error[i], V[i], closed, now_ends[i])
        _write(o, i, position_loop.follow(s.axis[i], c.axis[i], motion[i], feedback, now))


@compiled
def _write(o, i, command):
    """The Command of axis i into the outputs."""
    o.rate[i], o.torque[i] = command.rate, command.torque
    o.reference[i, 0], o.reference[i, 1], o.reference[i, 2] = command.reference
    o.angle_limited[i], o.rate_limited[i] = command.angle_limited, command.rate_limited
    o.acceleration_limited[i] = command.acceleration_limited


@compiled
def _watch_outage(s, c, program):
    """Note why the receiver may be without signal: the target is hidden, or the beam slews through the keyhole."""
    follows = modes.FOLLOWS[s.mode]
    s.blocked = follows and blockage.blocked(c.lookahead.sectors, s.target_angles[0], s.target_angles[1])
    reason = (modes.BLOCKED if s.blocked else
              modes.KEYHOLE if follows and planner.slewing(s.lookahead, s.stamp) else modes.NONE)
    if reason != modes.NONE:
        s.outage, s.reason = s.stamp, reason
        if s.mode == modes.AUTOTRACK and not _coasting(s, c):
            bridge.begin(s.bridge, program, s.stamp, target.earth_outlook(s.target, c.tracker, s.stamp).u)
    elif s.reason == modes.BLOCKED or s.reason == modes.KEYHOLE:
        s.reason = modes.NONE


@compiled
def _stow(s, c, u):
    """Ask for the stow pins, and say when they are in."""
    stow.step(s.stow, c, u, s.mode)
    if s.mode == modes.STOW and s.reason == modes.REQUESTED and u.pins == stow.BOTH_IN:
        s.reason = modes.PINS_IN


@compiled
def _read_estimate(s, c, o):
    """Put the estimate of the target at s.stamp, in earth angles of the antenna, into the outputs."""
    estimate = target.read(s.target, c.p, c.tracker, s.attitude, s.stamp)
    for i in range(2):
        o.estimate[i, 0], o.estimate[i, 1], o.estimate[i, 2] = estimate.motion[i]
        o.covariance[i, 0], o.covariance[i, 1], o.covariance[i, 2] = estimate.variances[i]
    target_filter.probabilities(s.target.tracker.filter, c.tracker.filter, o.probability)


@compiled
def _look_ahead(s, c, program):
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
    if s.mode == modes.AUTOTRACK and not _coasting(s, c):
        bridge.begin(s.bridge, program, s.stamp, sight.u)
    if s.bridge.valid and program_track.status(program, s.stamp) == modes.NONE:
        planner.look_along_program(h, c.lookahead, s.stamp, s.azimuth, program, s.bridge)
    else:
        planner.look_along_great_circle(h, c.lookahead, s.stamp, s.azimuth, sight.u, sight.du)


@compiled
def _start_from_actual(s, c, u, begins, gap):
    """Targets := actual, of both axes where they begin anew; of one that does not obey in every step until it does, or
    it would wind up behind its commands and make good for them at once when it hears them again."""
    if begins:
        s.azimuth = u.position[0]
    for i in range(2):
        rate = u.velocity[i]
        immobile = not begins and s.supervision.axis[i].immobile != 0
        if immobile:
            rate = position_loop.realised(s.axis[i].command, rate)
        if gap or immobile:
            s.axis[i].command = rate
        if begins or immobile:
            position_loop.initialise(s.axis[i], c.axis[i].p, s.stamp, u.position[i], rate)


@compiled
def step(s, c, u, o, of_all):
    """Run one drive step; records STATE, CONSTANTS, INPUTS, OUTPUTS and the Tables `of_all`.

    A stamp that does not advance (or is NaN) changes nothing: the last command stands, `stamp` is flagged.
    """
    dt = u.stamp - s.stamp
    if not (dt > 0.0 and math.isfinite(u.stamp)):
        o.invalid_input = signals.STAMP
        o.reason = modes.BAD_STAMP
        return
    signals.clear(o)
    jumped = dt > c.p.step_gap
    flags = 0
    if jumped and math.isfinite(s.stamp):
        flags = signals.STEP_GAP
        _bridge_silence(s, c, u.stamp)
    now = Instants(u.stamp, u.stamp + c.lead, c.p.period if jumped else dt)
    s.stamp = u.stamp
    program = tables.of_mode(of_all, s.table)

    tracker.transfer(s.target.tracker, c.p.tracker, c.tracker)
    flags |= _take_encoders(s, u) | _take_attitude(s, c, u) | _take_error(s, c, u, o, program) | _take_preset(s, u)

    if not u.drive_ready or not math.isfinite(s.unasked.since):
        unasked.restart(s.unasked, s.stamp)
    unasked.watch(s.unasked, s.stamp, u.velocity, c.p.unasked_rate)
    if c.axis[0].p.controller != position_loop.BEAM:
        frozen.watch(s.frozen, u, c.p.step_gap + c.p.command_delay)
    by_level.advance(s, c, u, program)
    rested = stow.rests(s.stow, c.p.stow_pins, u.pins, s.mode)
    _, program_flags = _change_mode(s, c, u, o, of_all, s.pending if s.mode == modes.STANDBY else modes.NO_REQUEST)
    program = tables.of_mode(of_all, s.table)
    if c.p.stow_pins:
        _stow(s, c, u)
    if resumption.waits(s.resumption):
        ended = s.mode == modes.STANDBY and s.reason == modes.DRIVE_NOT_READY
        s.pending = resumption.pending(s.resumption, s.stamp, ended, o.locked, s.pending)
    if encoders.taken(s.encoders, s.stamp):
        _start_from_actual(s, c, u, rested or jumped, flags & signals.STEP_GAP)

    travel = floor.by_hand(c, u, s.manual.angle[0])
    for i in range(2):
        if s.entered or rested or jumped:
            manual.begin(s.manual, i, reference.now(s.axis[i].reference))
        if s.mode == modes.STOP or s.mode == modes.RATE:
            heard = s.mode == modes.RATE and s.stamp <= s.manual.until
            manual.step(s.manual, i, c.axis[i].p.shaper, travel[i], heard, now.dt)

    if stow.rests(s.stow, c.p.stow_pins, u.pins, s.mode):
        for i in range(2):
            _write(o, i, position_loop.stop(s.axis[i], c.axis[i].p, now.dt))
    else:
        _follow(s, c, u, o, _reference_of_axes(s, c, program, now), now)
        s.entered = 0
        _watch_outage(s, c, program)
        o.blocked = s.blocked
        o.coasting = s.mode == modes.AUTOTRACK and _coasting(s, c)
    of_axes = floor.ends(c, u, u.position[0])

    for i in range(2):
        unasked.command(s.unasked, i, o.rate[i], s.stamp, min(now.dt, c.p.period), c.p.step_gap + c.p.command_delay)
        frozen.command(s.frozen, i, o.rate[i], c.p.period)
        o.time_to_limit[i] = ends.time_to(u.position[i], u.velocity[i], of_axes[i])
    t = s.target.tracker
    o.mode, o.reason, o.invalid_input = s.mode, s.reason, flags | program_flags
    o.gated, o.rates_gated, o.ranges_gated = t.gated, t.rates_gated, t.ranges_gated
    if t.running:
        _read_estimate(s, c, o)
    _look_ahead(s, c, program)
    o.pins, o.pins_wrong = s.stow.asked, stow.wrong(s.stow, c, u) if c.p.stow_pins else 0
    supervision.step(s, c, u, o, dt, s.reason == modes.SIGNAL_LOST or (o.coasting and not _outage_permitted(s, c)))
