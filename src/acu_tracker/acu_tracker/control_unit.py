"""The law of the antenna control unit: `step` runs once per drive step and computes the rate command of both axes.

Inputs are the encoder angles, the error of the receiver and the attitude of the deck. docs/architecture.md explains
the order of a step. Each part of the state is written by its own module; this module connects the parts. `unit` calls
`step`, and between two steps `request`, `refusals` and `reset`.

One-letter names in all functions:
s, c, u, o   records of State, Constants, signals.Inputs.dtype and Outputs
g, k, m      parts of s: guidance, tracking, mode
t            s.stamp [s], also called t_k

Other names:
all_tables   tables.Tables: the tables of directions that modes follow
program      table that was followed last: the program track, or the predicted track of satellite or sun
no_signal    outage.Outage: the time without a signal of the receiver
silence      True if the previous step is more than step_gap ago
rested       True if the axes had no motion command before this step, or the previous step is more than step_gap ago
way          bridge.Way: the program, rotated to the place where the target was last tracked
table        mode whose table was followed last (s.mode.table)
lock, slope, track   of modes.Conditions: autotrack can begin, has not diverged, has its target
unasked      state of uncommanded_motion
"""
import math
from typing import Annotated

import numpy as np

from acu_tracker import measurements, modes, signals, tracking
from acu_tracker.alarms import annunciator, conditions
from acu_tracker.estimation import divergence, tracker
from acu_tracker.geometry import attitude, direction, encoders
from acu_tracker.guidance import guidance
from acu_tracker.lookahead import levelled_deck, planner
from acu_tracker.mode import mode_change, outage, reachability, resumption, signal_level_modes, stow, supervision
from acu_tracker.modes import Mode, Reason
from acu_tracker.params import AxisParameters, SharedParameters
from acu_tracker.pointing import model
from acu_tracker.program import bridge, tables
from acu_tracker.servo import axes, ends, floor, frozen, notch, position_loop, uncommanded_motion
from acu_tracker.servo.position_loop import Instants
from pedestal_common.compiled import compiled, separate
from pedestal_common.geometry import blockage
from pedestal_common.parameters import record
from pedestal_common.quantities import BothAxes, Floats
from pedestal_common.record import Record


class State(Record):
    """Record."""
    stamp: float
    mode: mode_change.ModeState
    resumption: resumption.Resumption
    stow: stow.Stow
    tracking: tracking.Tracking
    outage: outage.OutageRecord
    guidance: guidance.Guidance
    axis: BothAxes[position_loop.AxisLoop]
    unasked: uncommanded_motion.Envelope
    frozen: frozen.Frozen
    supervision: conditions.Supervision


class AxisConstants(Record):
    """Record."""
    p: AxisParameters
    notch: Annotated[Floats, (5,)]
    reaction: float
    braking: float


class Constants(Record):
    """Constants of the control unit, and of each axis."""
    p: SharedParameters  # parameters: SharedParameters, or AxisParameters of an axis
    axis: BothAxes[AxisConstants]
    lead: float  # t_m - t_k [s]; t_m: middle of the interval in which the command of the step at t_k is in force
    tracker: tracker.Constants  # tracker, lookahead, floor: constants of these modules
    lookahead: planner.Constants
    floor: floor.Floor
    # notch: coefficients of the notch filter of an axis; reaction: reaction time of an axis in front of a limit [s]; see AcuParameters.reaction; braking: deceleration of an axis in front of a limit [rad/s2]


def axis_constants(params, period, reaction) -> np.ndarray:
    """Return the constants (1,) of an axis.

    params: AxisParameters; period: of the steps [s]; reaction: AcuParameters.reaction [s].
    """
    c, n = AxisConstants.zeros(), params.notch
    c['p'] = record(params, AxisParameters)
    c['notch'] = notch.coefficients(n.frequency, n.width, n.depth, period)
    c['reaction'], c['braking'] = reaction, params.limits.deceleration
    return c


def constants(params) -> np.ndarray:
    """Return the constants (1,) of AcuParameters."""
    c, axes = Constants.zeros(), (params.azimuth, params.elevation)
    c['p'] = record(params, SharedParameters)
    c['lead'] = params.command_delay + 0.5 * params.period
    c['axis'] = np.concatenate([axis_constants(position_loop.slowed(axis, params.command_delay), params.period,
                                               params.reaction) for axis in axes])
    c['floor'] = floor.table(params.floor)
    c['tracker'] = tracker.constants(params.tracker, [axis.filter for axis in axes])
    c['lookahead'] = planner.constants(params)
    return c


def initial_state(params) -> np.ndarray:
    """Return the state (1,) of AcuParameters before the first step.

    The mode is standby, and the initial mode is pending.
    """
    s = State.zeros()
    s['stamp'] = -math.inf
    mode_change.initialise(s['mode'], params)
    guidance.initialise(s['guidance'], (params.azimuth.preset, params.elevation.preset))
    tracking.initialise(s['tracking'], params.pointing)
    for name, module in (('resumption', resumption), ('stow', stow), ('outage', outage),
                         ('unasked', uncommanded_motion), ('supervision', conditions)):
        module.initialise(s[name])
    return s


@compiled
def latched(s):
    """Return the bits of the alarms of the latched faults, which wait for a reset."""
    return supervision.latched(s.unasked.moves, s.frozen.frozen, s.tracking.divergence.diverged)


@compiled
def request(s, c, u, o, all_tables, mode):
    """Request a mode (its code) between two steps; return True if the request is accepted.

    The decision uses the inputs of the last step. A change of mode acts on the command of the next step. The outputs
    mode and reason are set at once.
    """
    result, _ = _change(s, c, u, o, all_tables, mode, _outage(s, c))
    o.mode, o.reason = s.mode.now, s.mode.reason
    return result == modes.REQUEST_ACCEPTED


@compiled
def refusals(s, c, u, all_tables, why):
    """Set why[mode] of each mode to Reason.NONE, or to the reason why `request` would refuse the mode now."""
    for mode in range(len(why)):
        now, _ = _situation(s, c, u, all_tables, mode, _outage(s, c))
        why[mode] = modes.obstacle(mode, now)


@compiled
def reset(s):
    """Reset the latched faults and alarms between two steps.

    Return annunciator.NO_ALARM, or the index of an alarm whose cause is still present. In the second case nothing is
    changed. A reset also discards a mode that waits to be entered, so that nothing moves until a mode is commanded.
    """
    alarms, t, fault = s.supervision.alarms, s.stamp, latched(s) != 0
    if s.unasked.moves and uncommanded_motion.beyond(s.unasked, t):
        return supervision.UNCOMMANDED_MOTION_ALARM
    cause = annunciator.persisting_alarm(alarms, supervision.LATCHED_FAULT_BITS)
    if cause != annunciator.NO_ALARM:
        return cause
    uncommanded_motion.release(s.unasked)
    frozen.release(s.frozen, t)
    divergence.release(s.tracking.divergence)
    if supervision.reset(alarms, t) or fault:
        mode_change.set_pending(s.mode, modes.NO_REQUEST)
        resumption.cancel(s.resumption)
    return annunciator.NO_ALARM


@separate
def step(s, c, u, o, all_tables):
    """Run one drive step.

    A stamp that does not advance, or is NaN, changes nothing: the last command stays in force, and the flag `stamp` is
    set in invalid_input.
    """
    dt = u.stamp - s.stamp
    if not (dt > 0.0 and math.isfinite(u.stamp)):
        o.invalid_input = signals.Flag.STAMP
        o.reason = Reason.BAD_STAMP
        return
    signals.clear(o)
    silence = c.p.step_gap < dt < math.inf
    if silence and s.mode.now != Mode.STANDBY:
        # The axes have stopped. After a short silence the mode continues from their actual angles.
        mode_change.continue_in(s.mode, resumption.mode_after(s.resumption, s.mode.now, s.stamp, u.stamp,
                                                              c.p.resume_time))
    s.stamp = u.stamp
    flags = _observe(s, c, u, o, tables.of_mode(all_tables, s.mode.table), silence)
    no_signal, rested = _outage(s, c), _rests(s, c, u) or dt > c.p.step_gap
    waiting = s.mode.pending if s.mode.now == Mode.STANDBY else modes.NO_REQUEST
    _, of_tables = _change(s, c, u, o, all_tables, waiting, no_signal)
    _wait(s, c, u, o)
    if encoders.taken(s.tracking.encoders, s.stamp):
        _start_from_actual(s, c, u, rested, silence)
    program = tables.of_mode(all_tables, s.mode.table)
    _move(s, c, u, o, program, no_signal, rested, c.p.period if dt > c.p.step_gap else dt)
    _write_outputs(s, c, u, o, flags | of_tables)
    if guidance.look_ahead(s.guidance, s.tracking, c, s.mode.now, program, no_signal, s.stamp):
        mode_change.restart(s.mode)
    _supervise(s, c, u, o, dt)


@compiled
def _observe(s, c, u, o, program, silence):
    """Take the inputs of the step (encoders, attitude, receiver, preset), and run the monitors on them.

    Return the bits of signals.INVALID_INPUTS.
    """
    g, k, mode = s.guidance, s.tracking, s.mode.now
    way = bridge.way(g.bridge, program)
    model.step(k.pointing, s.stamp)
    tracker.transfer(k.target.tracker, c.tracker)
    flags = signals.Flag.STEP_GAP if silence else 0
    flags |= measurements.take_encoders(k.encoders, u) | _take_attitude(s, c, u) | _take_receiver(s, c, u, o, way)
    flags |= measurements.take_preset(g.preset, u)
    uncommanded_motion.watch(s.unasked, s.stamp, u.velocity, c.p.unasked_rate, silence or not u.drive_ready)
    if c.axis[0].p.controller != position_loop.CONTROLLER_BEAM:
        frozen.watch(s.frozen, u, c.p.step_gap + c.p.command_delay, silence)
    if signal_level_modes.advance(g.acquisition, mode, c, u, way):
        divergence.latch(k.divergence)
    return flags


@compiled
def _take_attitude(s, c, u):
    """Take the attitude of this step; also add it to the levelled deck. Return the flags of invalid values."""
    h = s.guidance.lookahead
    if tracking.take_place(s.tracking, u):
        planner.clear_plan(h)
    flags, new = measurements.take_attitude(s.tracking.attitude, c.p, u)
    if new:
        # While the INS aligns, its heading is not known. The mean begins with the first attitude after the alignment.
        levelled_deck.take(h.deck, u.attitude_stamp, attitude.newest(s.tracking.attitude), c.p.keyhole.mean_time,
                           u.aligning)
    return flags


@compiled
def _take_receiver(s, c, u, o, way):
    """Take the error of the receiver of this step. Return flags if it is not accepted, else 0."""
    g, k, mode = s.guidance, s.tracking, s.mode.now
    offset = guidance.pointing_offset(g, u.error_stamp - c.p.tracker.receiver.age)
    flags, used, at = tracking.used_error(k, c, u, modes.USES_SIGNAL_LEVEL[mode], offset)
    if not used:
        return flags
    if mode == Mode.ACQUIRE:
        guidance.check_slope(g, k, c, u, at, way)
    restart_gap = math.inf if _outage(s, c).permitted else c.p.tracker.restart_gap
    judged = not guidance.held(g, c, s.stamp)
    return tracking.take_error(k, c, u, o, at, restart_gap, mode == Mode.AUTOTRACK and judged,
                               supervision.axes_follow_commands(s.supervision) and judged)


@compiled
def _outage(s, c):
    """Return the outage.Outage of the receiver at s.stamp."""
    return outage.now(s.outage, s.tracking.target.tracker.stamp, s.stamp, c.p)


@compiled
def _rests(s, c, u):
    """Return True if the mode commands no motion."""
    return stow.commands_no_motion(s.stow, c.p.stow_pins, u.pins, s.mode.now)


@separate
def _change(s, c, u, o, all_tables, request, no_signal):
    """Select the mode at s.stamp, and carry out the consequences of a change of mode.

    request: a mode or NO_REQUEST. Return (result of the request, flags of bad tables).
    """
    g, k, before, table = s.guidance, s.tracking, s.mode.now, s.mode.table
    now, flags = _situation(s, c, u, all_tables, request, no_signal)
    # A divergence, or a slope of the wrong sign, is latched.
    if now.conditions.slope != Reason.NONE:
        divergence.latch(k.divergence)
    o.locked = now.conditions.lock == Reason.NONE
    result = mode_change.change(s.mode, now, request)
    mode = s.mode.now
    if result == modes.REQUEST_ACCEPTED and modes.FOLLOWS_TABLE[mode]:
        # After this, autotrack needs lock_count new measurements to begin.
        tracker.reset_accepted_count(k.target.tracker)
    if s.mode.table != table:
        bridge.clear(g.bridge)
    if mode != before:
        if modes.USES_SIGNAL_LEVEL[mode]:
            if before == Mode.AUTOTRACK and not no_signal.coasting:
                # The rotated program begins where the target was last tracked. This avoids a jump of the antenna.
                guidance.bridge_to(g, k, c, tables.of_mode(all_tables, s.mode.table), s.stamp)
            guidance.begin_by_level(g, k, c, before, mode, s.stamp)
        if before == Mode.AUTOTRACK and now.conditions.track != Reason.NONE:
            tracker.stop(k.target.tracker)
        tracking.restart(k)
    return result, flags


@separate
def _situation(s, c, u, all_tables, request, no_signal):
    """Return (modes.Situation at s.stamp, flags of bad tables).

    To save time, a table is evaluated only if its mode can matter in this step. `wanted` holds these modes: the
    request, the running mode, the mode whose table was followed last, and the fallback of the running mode.
    """
    m, g, k, t = s.mode, s.guidance, s.tracking, s.stamp
    unstable, pins = tracking.unstable(k, c, u, t), stow.obstacle(s.stow, c.p.stow_pins, u.pins)
    closed = m.now == Mode.AUTOTRACK and supervision.axes_follow_commands(s.supervision)
    lock, slope, track = tracking.conditions(k, c, t, no_signal, closed)
    if track == Reason.NONE and signal_level_modes.in_side_lobe(g.acquisition, c, t):
        track = Reason.SIDE_LOBE
    # The fallback AUTOTRACK means coasting. Because a filter without an estimate cannot coast, the fallback is then
    # the program.
    chosen = m.fallback if m.fallback != Mode.AUTOTRACK or k.target.tracker.running else Mode.PROGRAM
    falls_back = m.now == Mode.SEARCH or (m.now == Mode.AUTOTRACK and track != Reason.NONE)
    wanted = request, m.now, m.table if falls_back else m.now, chosen if falls_back else m.now
    program = tle = sun = Reason.NONE
    flags = flag = 0
    if unstable == Reason.NONE:
        if Mode.PROGRAM in wanted:
            program, flags = reachability.judge_table(k, c, u, Mode.PROGRAM, all_tables, t, g.azimuth)
        if Mode.TLE in wanted:
            tle, flag = reachability.judge_table(k, c, u, Mode.TLE, all_tables, t, g.azimuth)
            flags |= flag
        if Mode.SUN in wanted:
            sun, flag = reachability.judge_table(k, c, u, Mode.SUN, all_tables, t, g.azimuth)
            flags |= flag
    why = modes.Conditions(
        nothing=Reason.NONE, stow=reachability.outside(c, c.axis[0].p.stow, c.axis[1].p.stow),
        pin=Reason.PINS_OUT if pins == Reason.NONE else Reason.NONE,
        preset=reachability.judge_direction(k.pointing.model, c, g.preset.angle[0], g.preset.angle[1]),
        direction=Reason.NONE if direction.valid_at(g.slave, t) else Reason.NO_DIRECTION,
        program=program, tle=tle, sun=sun, lock=lock, slope=slope, track=track,
        level=signal_level_modes.end(g.acquisition, m.now, c, t))
    return modes.Situation(
        encoder_valid=encoders.taken(k.encoders, t), attitude=unstable, pins=pins, table=m.table, chosen=chosen,
        drive=supervision.drive_refusal(u.drive_ready, s.unasked.moves, s.frozen.frozen), conditions=why,
        handover=(signal_level_modes.found(g.acquisition, m.now, c) if modes.USES_SIGNAL_LEVEL[m.now]
                  else c.p.tracker.handover != 0)), flags


@compiled
def _wait(s, c, u, o):
    """Advance the stow pins. When the drive is ready again, resume the mode that the drive interrupted."""
    m = s.mode
    if c.p.stow_pins and stow.step(s.stow, c, u, m.now):
        mode_change.mark_stowed(m)
    if resumption.is_pending(s.resumption):
        ended = m.now == Mode.STANDBY and m.reason == Reason.DRIVE_NOT_READY
        mode_change.set_pending(m, resumption.pending(s.resumption, s.stamp, ended, o.locked, m.pending))


@compiled
def _start_from_actual(s, c, u, rested, silence):
    """Start the references from the actual angles: of both axes if they begin to move, and of an immobile axis."""
    if rested:
        guidance.start_from(s.guidance, u.position[0])
    watched = s.supervision.axis
    axes.start_from_actual(s.axis, c, u, (watched[0].immobile != 0, watched[1].immobile != 0), rested, silence)


@compiled
def _move(s, c, u, o, program, no_signal, rested, dt):
    """Move the axes, or let the axes rest; dt [s]: duration of the motion."""
    g, k, m, t = s.guidance, s.tracking, s.mode, s.stamp
    actual = axes.now(s.axis)
    order = guidance.Order(m.now, m.begins or rested, actual.azimuth.angle, t)
    guidance.move_by_hand(g, c, order, floor.by_hand(c, u, g.manual.angle[0]), actual, dt)
    if _rests(s, c, u):
        axes.rest(s.axis, c, o, dt)
    else:
        now, order = Instants(t, t + c.lead, dt), guidance.Order(m.now, m.begins, actual.azimuth.angle, t)
        motion = guidance.motion(g, k, c, order, bridge.way(g.bridge, program), no_signal, now)
        deck_rates = tracking.deck_rates(k, c, t, actual.azimuth.angle, actual.elevation.angle)
        beam = axes.BeamInputs(k.error, deck_rates, m.now == Mode.AUTOTRACK)
        axes.follow(s.axis, c, u, o, motion, now, beam)
        mode_change.mark_started(m)
        limited = o.angle_limited[0] != 0 or o.angle_limited[1] != 0
        guidance.watch_beam(g, c, m.now, axes.now(s.axis), limited, now.t_m)
        if _note_outage_reason(s, c) and m.now == Mode.AUTOTRACK and not no_signal.coasting:
            # The rotated program begins where the target was last tracked. This avoids a jump of the antenna.
            guidance.bridge_to(g, k, c, program, t)
        o.blocked, o.coasting = s.outage.blocked, m.now == Mode.AUTOTRACK and no_signal.coasting
    for i in range(2):
        uncommanded_motion.command(s.unasked, i, o.rate[i], t, min(dt, c.p.period), c.p.step_gap + c.p.command_delay)
        frozen.command(s.frozen, i, o.rate[i], c.p.period)


@compiled
def _note_outage_reason(s, c):
    """Note the reason why the receiver may be without signal. Return True if there is such a reason.

    The target may be hidden, the beam may slew through the keyhole, or the azimuth may turn at a limit of its travel.
    """
    g, follows = s.guidance, modes.FOLLOWS_TARGET[s.mode.now]
    hidden = follows and blockage.blocked(c.lookahead.sectors, g.direction[0], g.direction[1])
    turning = g.turn.under_way and supervision.axes_follow_commands(s.supervision)
    reason = outage.watch(s.outage, hidden, follows and planner.slewing(g.lookahead, s.stamp), follows and turning,
                          s.stamp)
    mode_change.set_outage_reason(s.mode, reason)
    return reason != Reason.NONE


@compiled
def _write_outputs(s, c, u, o, flags):
    """Write mode, flags, pins, times to the limits, and the estimate to the outputs."""
    of_axes = floor.ends(c, u, u.position[0])
    for i in range(2):
        o.time_to_limit[i] = ends.time_to(u.position[i], u.velocity[i], of_axes[i])
    o.mode, o.reason, o.invalid_input = s.mode.now, s.mode.reason, flags
    o.pins, o.pins_wrong = s.stow.requested, stow.misplaced_pins(s.stow, c, u) if c.p.stow_pins else 0
    tracking.write_outputs(s.tracking, c, s.stamp, o)


@compiled
def _supervise(s, c, u, o, dt):
    """Update the alarms; dt: time since the previous step [s]."""
    jumped, deck = dt > c.p.step_gap, s.tracking.attitude
    ship = deck.stabilised and deck.history.count > 0
    # signal_lost: autotrack has no signal, and no hidden sector, keyhole or turn explains this.
    signal_lost = s.mode.reason == Reason.SIGNAL_LOST or (o.coasting and not _outage(s, c).permitted)
    attitude_known, _ = attitude.at(deck, c.p, s.stamp + c.lead)
    facts = conditions.Facts(
        dt=0.0 if jumped else dt, gap=dt if jumped else 0.0, lost=dt > 1.5 * c.p.period, latched=latched(s),
        attitude_lost=ship and not attitude_known, attitude_jumped=ship and deck.jump.apart, signal_lost=signal_lost,
        unasked_rate=c.p.unasked_rate, beamwidth=c.p.tracker.receiver.beamwidth)
    mode = Mode.STANDBY if _rests(s, c, u) else s.mode.now
    conditions.take(s.supervision, mode, u, o, c.axis, s.unasked, facts)
    # A new revision makes the unit publish the list of alarms.
    o.alarms = s.supervision.alarms.revision
