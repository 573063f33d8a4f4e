"""The law of the antenna control unit: `step` runs once per drive step and computes the rate command of both axes.

docs/understand/architecture.md explains the order of a step. Each part of the state is written by its own module;
this module connects the parts. `unit` calls `step`, and between two steps `request`, `refusals` and `reset`.
"""
import math
from typing import Annotated

import numpy as np

from acu_tracker import modes, signals, structure, tracking
from acu_tracker.alarms import annunciator, conditions
from acu_tracker.estimation import monitors, receiver_error, target
from acu_tracker.estimation.filters import target_filter
from acu_tracker.geometry import attitude, direction, history
from acu_tracker.guidance import guidance
from acu_tracker.lookahead import planner
from acu_tracker.mode import interruptions, reachability, stow
from acu_tracker.modes import Mode, Reason
from acu_tracker.params import AcuParameters, AxisParameters, SharedParameters
from acu_tracker.pointing import model
from acu_tracker.program import bridge, program_track
from acu_tracker.program.program_track import ProgramTrack
from acu_tracker.search import acquisition
from acu_tracker.servo import axes, controllers, drive_watch, excitation, position_loop, travel
from acu_tracker.servo.position_loop import Instants
from acu_tracker.signals import Inputs, Outputs
from pedestal_common.compiled import compiled, separate
from pedestal_common.geometry import blockage
from pedestal_common.parameters import record
from pedestal_common.quantities import BothAxes, Floats, Ints, RadiansPerSecond2, Records, Seconds
from pedestal_common.record import Record


class State(Record):
    """State of the control unit."""
    stamp: Seconds  # t_k of the last step
    mode: modes.ModeState
    resumption: interruptions.Resumption
    stow: stow.Stow
    tracking: tracking.Tracking
    outage: interruptions.OutageRecord
    guidance: guidance.Guidance
    axis: BothAxes[position_loop.AxisLoop]
    excitation: excitation.Excitation
    unasked: drive_watch.Envelope
    frozen: drive_watch.Frozen
    supervision: conditions.Supervision


class AxisConstants(Record):
    """Constants of an axis."""
    p: AxisParameters
    notch: Annotated[Floats, (5,)]  # coefficients of the notch filter
    reaction: Seconds               # reaction time in front of a limit, see AcuParameters.reaction
    braking: RadiansPerSecond2      # deceleration in front of a limit


class Constants(Record):
    """Constants of the control unit, and of each axis."""
    p: SharedParameters
    axis: BothAxes[AxisConstants]
    lead: Seconds       # t_m - t_k; t_m: middle of the interval in which the command of the step at t_k is in force
    target: target.Constants
    lookahead: planner.Constants
    floor: travel.Floor


def axis_constants(params: AxisParameters, period: Seconds, reaction: Seconds) -> Records:
    """Return the constants (1,) of an axis."""
    made, notch = AxisConstants.zeros(), params.notch
    made['p'] = record(params, AxisParameters)
    made['notch'] = controllers.notch_coefficients(notch.frequency, notch.width, notch.depth, period)
    made['reaction'], made['braking'] = reaction, params.limits.deceleration
    return made


def constants(params: AcuParameters) -> Records:
    """Return the constants (1,)."""
    made, axes = Constants.zeros(), (params.azimuth, params.elevation)
    made['p'] = record(params, SharedParameters)
    made['lead'] = params.command_delay + 0.5 * params.period
    made['axis'] = np.concatenate([axis_constants(position_loop.slowed(axis, params.command_delay), params.period,
                                                  params.reaction) for axis in axes])
    made['floor'] = travel.floor_table(params.floor)
    made['target'] = target.constants(params.tracker, structure.filters(params),
                                      all(axis.structure.inertia_share == 0.0 for axis in axes))
    made['lookahead'] = planner.constants(params)
    return made


def initial_state(params: AcuParameters) -> Records:
    """Return the state (1,) before the first step."""
    state = State.zeros()
    state['stamp'] = -math.inf
    modes.initialise(state['mode'], params)
    guidance.initialise(state['guidance'], (params.azimuth.preset, params.elevation.preset))
    tracking.initialise(state['tracking'], params.pointing)
    interruptions.initialise(state['outage'], state['resumption'])
    stow.initialise(state['stow'])
    drive_watch.initialise(state['unasked'])
    conditions.initialise(state['supervision'])
    return state


@compiled
def latched(state: State) -> int:
    """Return the bits of the alarms of the latched faults, which wait for a reset."""
    return (state.unasked.moves << interruptions.UNCOMMANDED_MOTION_ALARM
            | state.frozen.frozen << interruptions.FROZEN_DRIVE_ALARM
            | state.tracking.divergence.diverged << interruptions.DIVERGENCE_ALARM)


@compiled
def request(state: State, constants: Constants, inputs: Inputs, outputs: Outputs, all_tables: program_track.Tables,
            mode: int) -> bool:
    """Request a mode (its code) between two steps; return True if the request is accepted.

    A change of mode acts on the command of the next step. The outputs mode and reason are set at once.
    """
    result, _ = _change(state, constants, inputs, outputs, all_tables, mode, _outage(state, constants))
    outputs.mode, outputs.reason = state.mode.now, state.mode.reason
    return result == modes.REQUEST_ACCEPTED


@compiled
def refusals(state: State, constants: Constants, inputs: Inputs, all_tables: program_track.Tables, why: Ints) -> None:
    """Set why[mode] of each mode to Reason.NONE, or to the reason why `request` would refuse the mode now."""
    for mode in range(len(why)):
        now, _ = _situation(state, constants, inputs, all_tables, mode, _outage(state, constants))
        why[mode] = modes.obstacle(mode, now)


@compiled
def reset(state: State) -> int:
    """Reset the latched faults and alarms between two steps.

    Return annunciator.NO_ALARM, or the index of an alarm whose cause is still present; the state then stays unchanged.
    A reset also discards a mode that waits to be entered, so that nothing moves until a mode is commanded.
    """
    alarms, t, fault = state.supervision.alarms, state.stamp, latched(state) != 0
    if state.unasked.moves and drive_watch.motion_beyond(state.unasked, t):
        return interruptions.UNCOMMANDED_MOTION_ALARM
    cause = annunciator.persisting_alarm(alarms, interruptions.LATCHED_FAULT_BITS)
    if cause != annunciator.NO_ALARM:
        return cause
    drive_watch.release(state.unasked, state.frozen, t)
    tracking.release(state.tracking)
    if interruptions.reset_latched(alarms, t) or fault:
        modes.set_pending(state.mode, modes.NO_REQUEST)
        interruptions.cancel_resumption(state.resumption)
    return annunciator.NO_ALARM


@separate
def step(state: State, constants: Constants, inputs: Inputs, outputs: Outputs,
         all_tables: program_track.Tables) -> None:
    """Run one drive step.

    A stamp that does not advance, or is NaN, changes nothing: the last command stays in force, and the flag `stamp` is
    set in invalid_input.
    """
    dt = inputs.stamp - state.stamp
    if not (dt > 0.0 and math.isfinite(inputs.stamp)):
        outputs.invalid_input = signals.Flag.STAMP
        outputs.reason = Reason.BAD_STAMP
        return
    signals.clear(outputs)
    silence = constants.p.step_gap < dt < math.inf
    if silence and state.mode.now != Mode.STANDBY:
        # The axes have stopped. After a short silence the mode continues from their actual angles.
        modes.continue_in(state.mode, interruptions.mode_after(state.resumption, state.mode.now, state.stamp,
                                                               inputs.stamp, constants.p.resume_time))
    if silence:
        excitation.end(state.excitation)
    state.stamp = inputs.stamp
    flags = _observe(state, constants, inputs, outputs, program_track.of_mode(all_tables, state.mode.table), silence)
    # The axes have rested if they had no motion command before this step, or after a gap between the steps.
    rested = stow.commands_no_motion(state.stow, constants, inputs, state.mode.now) or dt > constants.p.step_gap
    no_signal = _outage(state, constants)
    waiting = state.mode.pending if state.mode.now == Mode.STANDBY else modes.NO_REQUEST
    _, of_tables = _change(state, constants, inputs, outputs, all_tables, waiting, no_signal)
    _wait(state, constants, inputs, outputs)
    if history.encoders_taken(state.tracking.encoders, state.stamp):
        _start_from_actual(state, constants, inputs, rested, silence)
    # The table that was followed last: the program track, or the predicted track of satellite or sun.
    program = program_track.of_mode(all_tables, state.mode.table)
    _move(state, constants, inputs, outputs, program, no_signal, rested,
          constants.p.period if dt > constants.p.step_gap else dt)
    _write_outputs(state, constants, inputs, outputs, flags | of_tables)
    if guidance.look_ahead(state.guidance, state.tracking, constants, state.mode.now, program, no_signal, state.stamp):
        modes.restart(state.mode)
    _supervise(state, constants, inputs, outputs, dt)


@compiled
def _observe(state: State, constants: Constants, inputs: Inputs, outputs: Outputs, program: ProgramTrack,
             silence: bool) -> int:
    """Take the inputs of the step, and run the monitors on them. Return the bits of signals.INVALID_INPUTS."""
    way = bridge.way(state.guidance.bridge, program)
    model.step(state.tracking.pointing, state.stamp)
    estimate = state.tracking.target
    target_filter.transfer(estimate.filter, constants.target.filter, estimate.running)
    flags = signals.Flag.STEP_GAP if silence else 0
    flags |= tracking.take_encoders(state.tracking.encoders, inputs) | _take_attitude(state, constants, inputs)
    flags |= _take_receiver(state, constants, inputs, outputs, way)
    if inputs.preset_valid and not direction.put(state.guidance.preset, inputs.preset):
        flags |= signals.Flag.PRESET
    drive_watch.watch_motion(state.unasked, state.stamp, inputs.velocity, constants.p.unasked_rate,
                             silence or not inputs.drive_ready)
    if int(constants.axis[0].p.controller) != position_loop.CONTROLLER_BEAM:
        drive_watch.watch_frozen(state.frozen, inputs, constants.p.step_gap + constants.p.command_delay, silence)
    if acquisition.advance(state.guidance.acquisition, state.mode.now, constants, inputs, way):
        monitors.latch_divergence(state.tracking.divergence)
    return flags


@compiled
def _take_attitude(state: State, constants: Constants, inputs: Inputs) -> int:
    if tracking.take_place(state.tracking, inputs):
        planner.clear_plan(state.guidance.lookahead)
    flags, new = tracking.take_attitude(state.tracking.attitude, constants.p, inputs)
    if new:
        # While the INS aligns, its heading is not known. The mean begins with the first attitude after the alignment.
        planner.take_attitude(state.guidance.lookahead.deck, inputs.attitude_stamp,
                              attitude.newest(state.tracking.attitude), constants.p.keyhole.mean_time, inputs.aligning)
    return flags


@compiled
def _take_receiver(state: State, constants: Constants, inputs: Inputs, outputs: Outputs, way: bridge.Way) -> int:
    mode = state.mode.now
    offset = guidance.pointing_offset(state.guidance, inputs.error_stamp - constants.p.tracker.receiver.age)
    flags, used, at = receiver_error.used_error(state.tracking, constants, inputs, modes.USES_SIGNAL_LEVEL[mode],
                                                offset)
    if not used:
        return flags
    if mode == Mode.ACQUIRE:
        guidance.check_slope(state.guidance, state.tracking, constants, inputs, at, way)
    restart_gap = math.inf if _outage(state, constants).permitted else constants.p.tracker.restart_gap
    judged = not guidance.held(state.guidance, constants, state.stamp)
    loop = receiver_error.Loop(mode == Mode.AUTOTRACK and judged,
                               interruptions.axes_follow_commands(state.supervision) and judged, way.program)
    return receiver_error.take_error(state.tracking, constants, inputs, outputs, at, restart_gap, loop)


@compiled
def _outage(state: State, constants: Constants) -> interruptions.Outage:
    filtered = state.tracking.target
    settled = target.settled(filtered, constants.p.tracker)
    return interruptions.outage_now(state.outage, filtered.stamp, settled, state.stamp, constants.p)


@separate
def _change(state: State, constants: Constants, inputs: Inputs, outputs: Outputs, all_tables: program_track.Tables,
            request: int, no_signal: interruptions.Outage) -> tuple[int, int]:
    """Select the mode at the stamp of the step, and carry out the consequences of a change of mode.

    request: a mode or NO_REQUEST. Return (result of the request, flags of bad tables).
    """
    before, table = state.mode.now, state.mode.table
    now, flags = _situation(state, constants, inputs, all_tables, request, no_signal)
    # A divergence, or a slope of the wrong sign, is latched.
    if now.conditions.slope != Reason.NONE:
        monitors.latch_divergence(state.tracking.divergence)
    outputs.locked = now.conditions.lock == Reason.NONE
    result = modes.change(state.mode, now, request)
    mode = state.mode.now
    if result == modes.REQUEST_ACCEPTED or mode != before:
        excitation.end(state.excitation)
    if result == modes.REQUEST_ACCEPTED and modes.FOLLOWS_TABLE[mode]:
        # After this, autotrack needs lock_count new measurements to begin.
        target.reset_accepted_count(state.tracking.target)
    if state.mode.table != table:
        bridge.clear(state.guidance.bridge)
    if mode != before:
        if modes.USES_SIGNAL_LEVEL[mode]:
            if before == Mode.AUTOTRACK and not no_signal.coasting:
                guidance.bridge_to(state.guidance, state.tracking, constants,
                                   program_track.of_mode(all_tables, state.mode.table), state.stamp)
            guidance.begin_by_level(state.guidance, state.tracking, constants, before, mode, state.stamp)
        if before == Mode.AUTOTRACK:
            tracking.end(state.tracking, state.stamp, now.conditions.track)
        tracking.restart(state.tracking, state.stamp)
    return result, flags


@separate
def _situation(state: State, constants: Constants, inputs: Inputs, all_tables: program_track.Tables, request: int,
               no_signal: interruptions.Outage) -> tuple[modes.Situation, int]:
    """Return (Situation at the stamp of the step, flags of bad tables)."""
    mode, t = state.mode.now, state.stamp
    unstable = tracking.unstable(state.tracking, constants, inputs, t)
    pins = stow.obstacle(state.stow, constants, inputs)
    closed = mode == Mode.AUTOTRACK and interruptions.axes_follow_commands(state.supervision)
    lock, slope, track = tracking.conditions(state.tracking, constants, t, no_signal, closed,
                                             program_track.of_mode(all_tables, state.mode.table))
    if track == Reason.NONE and acquisition.in_side_lobe(state.guidance.acquisition, constants, t):
        track = Reason.SIDE_LOBE
    # The fallback AUTOTRACK means coasting. Because a filter without an estimate cannot coast, the fallback is then
    # the program.
    possible = state.mode.fallback != Mode.AUTOTRACK or state.tracking.target.running
    chosen = state.mode.fallback if possible else Mode.PROGRAM
    falls_back = mode == Mode.SEARCH or (mode == Mode.AUTOTRACK and track != Reason.NONE)
    # Modes whose table can matter in this step.
    wanted = request, mode, state.mode.table if falls_back else mode, chosen if falls_back else mode
    program, tle, sun, flags = Reason.NONE, Reason.NONE, Reason.NONE, 0
    if unstable == Reason.NONE:
        program, tle, sun, flags = reachability.judge_tables(state.tracking, constants, inputs, wanted, all_tables, t,
                                                             state.guidance.azimuth)
    why = modes.Conditions(
        nothing=Reason.NONE, stow=reachability.outside(constants, constants.axis[0].p.stow, constants.axis[1].p.stow),
        pin=Reason.PINS_OUT if pins == Reason.NONE else Reason.NONE,
        preset=reachability.judge_direction(state.tracking.pointing.model, constants, state.guidance.preset.angle[0],
                                            state.guidance.preset.angle[1]),
        direction=Reason.NONE if direction.valid_at(state.guidance.slave, t) else Reason.NO_DIRECTION,
        program=program, tle=tle, sun=sun, lock=lock, slope=slope, track=track,
        level=acquisition.end(state.guidance.acquisition, mode, constants, t))
    return modes.Situation(
        encoder_valid=history.encoders_taken(state.tracking.encoders, t), attitude=unstable, pins=pins,
        table=state.mode.table, chosen=chosen,
        drive=interruptions.drive_refusal(inputs.drive_ready, state.unasked.moves, state.frozen.frozen),
        conditions=why,
        handover=(acquisition.found(state.guidance.acquisition, mode, constants)
                  if modes.USES_SIGNAL_LEVEL[mode] else constants.p.tracker.handover != 0)), flags


@compiled
def _wait(state: State, constants: Constants, inputs: Inputs, outputs: Outputs) -> None:
    if constants.p.stow_pins:
        modes.mark_stowed(state.mode, stow.step(state.stow, constants, inputs, state.mode.now))
    ended = state.mode.now == Mode.STANDBY and state.mode.reason == Reason.DRIVE_NOT_READY
    modes.set_pending(state.mode, interruptions.pending_mode(state.resumption, state.stamp, ended, outputs.locked,
                                                             state.mode.pending))


@compiled
def _start_from_actual(state: State, constants: Constants, inputs: Inputs, rested: bool, silence: bool) -> None:
    """Start the references from the actual angles: of both axes if they begin to move, and of an immobile axis."""
    if rested:
        guidance.start_from(state.guidance, inputs.position[0])
    watched = state.supervision.axis
    immobile = watched[0].immobile != 0, watched[1].immobile != 0
    axes.start_from_actual(state.axis, constants, inputs, immobile, rested, silence)


@compiled
def _move(state: State, constants: Constants, inputs: Inputs, outputs: Outputs, program: ProgramTrack,
          no_signal: interruptions.Outage, rested: bool, dt: Seconds) -> None:
    mode, t = state.mode.now, state.stamp
    actual = axes.now(state.axis)
    order = guidance.Order(mode, state.mode.begins or rested, actual.azimuth.angle, t)
    by_hand = travel.by_hand(constants, inputs, state.guidance.manual.angle[0])
    guidance.move_by_hand(state.guidance, constants, order, by_hand, actual, dt)
    if stow.commands_no_motion(state.stow, constants, inputs, mode):
        axes.rest(state.axis, constants, outputs, dt)
    else:
        now = Instants(t, t + constants.lead, dt)
        order = guidance.Order(mode, state.mode.begins, actual.azimuth.angle, t)
        motion = guidance.motion(state.guidance, state.tracking, constants, order,
                                 bridge.way(state.guidance.bridge, program), no_signal, now)
        deck_rates = tracking.deck_rates(state.tracking, constants, t, actual.azimuth.angle, actual.elevation.angle)
        beam = axes.BeamInputs(state.tracking.error, deck_rates, mode == Mode.AUTOTRACK)
        axes.follow(state.axis, constants, inputs, outputs, motion, now, beam)
        if state.excitation.count > 0:
            excitation.add(state.excitation, outputs, constants.axis[state.excitation.axis].p.limits.rate, t)
        modes.mark_started(state.mode)
        if mode != Mode.STOW or not constants.p.stow_pins:
            modes.watch_arrival(state.mode, axes.distance(constants, inputs, motion, mode))
        limited = outputs.angle_limited[0] != 0 or outputs.angle_limited[1] != 0
        guidance.watch_beam(state.guidance, constants, mode, axes.now(state.axis), limited, now.t_m)
        if _note_outage_reason(state, constants) and mode == Mode.AUTOTRACK and not no_signal.coasting:
            guidance.bridge_to(state.guidance, state.tracking, constants, program, t)
        outputs.blocked, outputs.coasting = state.outage.blocked, mode == Mode.AUTOTRACK and no_signal.coasting
    for i in range(2):
        drive_watch.command_motion(state.unasked, i, outputs.rate[i], t, min(dt, constants.p.period),
                                   constants.p.step_gap + constants.p.command_delay)
        drive_watch.command_frozen(state.frozen, i, outputs.rate[i], constants.p.period)


@compiled
def _note_outage_reason(state: State, constants: Constants) -> bool:
    """Note the reason why the receiver may be without signal. Return True if there is such a reason.

    The target may be hidden, the beam may slew through the keyhole, or the azimuth may turn at a limit of its travel.
    """
    follows, aim = modes.FOLLOWS_TARGET[state.mode.now], state.guidance.direction
    hidden = follows and blockage.blocked(constants.lookahead.sectors, aim[0], aim[1])
    turning = state.guidance.turn.under_way and interruptions.axes_follow_commands(state.supervision)
    slewing = follows and planner.slewing(state.guidance.lookahead, state.stamp)
    reason = interruptions.explain_outage(state.outage, hidden, slewing, follows and turning, state.stamp)
    modes.set_outage_reason(state.mode, reason)
    return reason != Reason.NONE


@compiled
def _write_outputs(state: State, constants: Constants, inputs: Inputs, outputs: Outputs, flags: int) -> None:
    of_axes = travel.ends(constants, inputs, inputs.position[0])
    for i in range(2):
        outputs.time_to_limit[i] = travel.time_to(inputs.position[i], inputs.velocity[i], of_axes[i])
    outputs.mode, outputs.reason, outputs.invalid_input = state.mode.now, state.mode.reason, flags
    outputs.pins, outputs.arrived = state.stow.requested, state.mode.arrived
    outputs.pins_wrong = stow.misplaced_pins(state.stow, constants, inputs) if constants.p.stow_pins else 0
    tracking.write_outputs(state.tracking, constants, state.stamp, outputs)


@compiled
def _supervise(state: State, constants: Constants, inputs: Inputs, outputs: Outputs, dt: Seconds) -> None:
    params, deck = constants.p, state.tracking.attitude
    jumped = dt > params.step_gap
    ship = deck.stabilised != 0 and deck.history.count > 0
    # signal_lost: autotrack has no signal, and no hidden sector, keyhole or turn explains this.
    unexplained = outputs.coasting != 0 and not _outage(state, constants).permitted
    ended = state.mode.reason == Reason.SIGNAL_LOST or state.mode.reason == Reason.DEPARTED
    signal_lost = unexplained or ended
    attitude_known, _ = attitude.at(deck, params, state.stamp + constants.lead)
    facts = conditions.Facts(
        dt=0.0 if jumped else dt, gap=dt if jumped else 0.0, lost=dt > 1.5 * params.period, latched=latched(state),
        attitude_lost=ship and not attitude_known, attitude_jumped=ship and deck.jump.apart != 0,
        signal_lost=signal_lost, unasked_rate=params.unasked_rate, beamwidth=params.tracker.receiver.beamwidth)
    rests = stow.commands_no_motion(state.stow, constants, inputs, state.mode.now)
    mode = Mode.STANDBY if rests else state.mode.now
    conditions.take(state.supervision, mode, inputs, outputs, constants.axis, state.unasked, facts)
    if state.excitation.count > 0 and annunciator.raised_after(state.supervision.alarms, state.excitation.begin):
        excitation.end(state.excitation)
    # A new revision makes the unit publish the list of alarms.
    outputs.alarms = state.supervision.alarms.revision
