"""The antenna control unit: one `step` per drive step, from encoders, receiver error and attitude to the rate command.

The estimate lives in earth angles, near the zenith in those of a tilted `estimate_frame`.
"""
import math

import numpy as np

from acu_tracker import intake, modes, signals
from acu_tracker.alarms import conditions
from acu_tracker.estimation import divergence, repetition, slope_sign, target, tracker
from acu_tracker.estimation.filters import target_filter
from acu_tracker.geometry import attitude, deck_reference, direction, encoders
from acu_tracker.guidance import guidance, manual
from acu_tracker.lookahead import planner
from acu_tracker.mode import by_level, mode_change, outage, resumption, stow, supervision
from acu_tracker.params import AxisParameters, SharedParameters
from acu_tracker.program import bridge, tables
from acu_tracker.search import acquisition
from acu_tracker.servo import ends, floor, frozen, notch, position_loop, reference, unasked
from acu_tracker.servo.position_loop import Feedback, Instants
from pedestal_common.compiled import compiled
from pedestal_common.parameters import record, record_type

STATE = np.dtype([
    ('stamp', 'f8'), ('mode', 'i8'), ('reason', 'i8'), ('pending', 'i8'), ('entered', 'i8'),
    ('resumption', resumption.RESUMPTION), ('unasked', unasked.ENVELOPE), ('frozen', frozen.FROZEN),
    ('encoders', encoders.ENCODERS), ('attitude', attitude.ATTITUDE), ('aligning', 'i8'),
    ('target', target.TARGET), ('error', 'f8', (2,)),                           # of this step, azimuth, elevation
    ('repetition', repetition.REPETITION), ('divergence', divergence.DIVERGENCE),
    ('slope_sign', slope_sign.SLOPE_SIGN),
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
def request(s, c, u, o, of_all, mode):
    """Request a mode (its code) between two steps; True when granted. Sets outputs.mode and outputs.reason.

    The decision uses the inputs of the last step; it takes effect on the command of the next. Arguments as of `step`.
    """
    result, _ = mode_change.change(s, c, u, o, of_all, mode)
    o.mode, o.reason = s.mode, s.reason
    return result == modes.ACCEPTED


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
def observe(s, c, u, o, of_all):
    """Take in what has come for the step: encoders, attitude, receiver, preset, and what watches over them. Gives the
    bits of signals.INVALID_INPUTS."""
    program = tables.of_mode(of_all, s.table)
    tracker.transfer(s.target.tracker, c.p.tracker, c.tracker)
    flags = intake.take_encoders(s, u) | intake.take_attitude(s, c, u)
    flags |= intake.take_error(s, c, u, o, program) | intake.take_preset(s, u)

    if not u.drive_ready or not math.isfinite(s.unasked.since):
        unasked.restart(s.unasked, s.stamp)
    unasked.watch(s.unasked, s.stamp, u.velocity, c.p.unasked_rate)
    if c.axis[0].p.controller != position_loop.BEAM:
        frozen.watch(s.frozen, u, c.p.step_gap + c.p.command_delay)
    by_level.advance(s, c, u, program)
    return flags


@compiled
def act(s, c, u, o, of_all, dt, flags):
    """Decide on the mode, move the axes and tell, after `observe`. dt: time since the last step [s], infinite in the
    first; flags: bits of signals.INVALID_INPUTS so far."""
    jumped = dt > c.p.step_gap
    now = Instants(s.stamp, s.stamp + c.lead, c.p.period if jumped else dt)
    rested = stow.rests(s.stow, c.p.stow_pins, u.pins, s.mode)
    waiting = s.pending if s.mode == modes.STANDBY else modes.NO_REQUEST
    _, program_flags = mode_change.change(s, c, u, o, of_all, waiting)
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
        _follow(s, c, u, o, guidance.of_axes(s, c, program, now), now)
        s.entered = 0
        outage.watch(s, c, program)
        o.blocked = s.blocked
        o.coasting = s.mode == modes.AUTOTRACK and outage.coasting(s, c)
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
    guidance.look_ahead(s, c, program)
    o.pins, o.pins_wrong = s.stow.asked, stow.wrong(s.stow, c, u) if c.p.stow_pins else 0
    supervision.step(s, c, u, o, dt, s.reason == modes.SIGNAL_LOST or (o.coasting and not outage.permitted(s, c)))


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
    flags = 0
    if c.p.step_gap < dt < math.inf:
        flags = signals.STEP_GAP
        mode_change.bridge_silence(s, c, u.stamp)
    s.stamp = u.stamp
    flags |= observe(s, c, u, o, of_all)
    act(s, c, u, o, of_all, dt, flags)
