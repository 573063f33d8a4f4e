"""The antenna control unit: one `step` per drive step, from encoders, receiver error and attitude to the rate command.

The estimate lives in earth angles, near the zenith in those of a tilted `estimate_frame`.
"""
import math

import numpy as np

from acu_tracker import modes
from acu_tracker.estimation import measurement, target, target_filter, tracker
from acu_tracker.estimation.motion_models import MODELS
from acu_tracker.geometry import attitude, azimuth_wrap, deck_reference
from acu_tracker.geometry.motion import AxisMotion, Motion
from acu_tracker.geometry.vector import vector
from acu_tracker.history import bracket, history_type, push
from acu_tracker.lookahead import levelled_deck, planner
from acu_tracker.params import AcuParameters
from acu_tracker.program import bridge, program_track
from acu_tracker.servo import notch, position_loop
from pedestal_common import blockage, line_of_sight
from pedestal_common.compiled import compiled
from pedestal_common.parameters import record, record_type

INVALID_INPUTS = ('stamp', 'encoder', 'error', 'error_stamp', 'error_gated', 'attitude', 'program', 'preset',
                  'step_gap')
"""Bit i of outputs.invalid_input stands for INVALID_INPUTS[i]."""
(_STAMP, _ENCODER, _ERROR, _ERROR_STAMP, _ERROR_GATED, _ATTITUDE, _PROGRAM, _PRESET,
 _STEP_GAP) = (1 << i for i in range(len(INVALID_INPUTS)))

BELIEVED = 0.5
"""Beamwidths that the beam may be meant to be off the target for the receiver's error still to be taken."""

INPUTS = np.dtype([
    ('stamp', 'f8'),                                                            # t_k [s]
    ('position', 'f8', (2,)), ('velocity', 'f8', (2,)), ('encoder_valid', 'i8'),  # deck azimuth, elevation
    ('error_stamp', 'f8'), ('error_valid', 'i8'),                               # 0: none came, or unlocked
    ('cross_elevation', 'f8'), ('elevation', 'f8'), ('cn0_dbhz', 'f8'),
    ('error_rate', 'f8', (2,)), ('error_rate_sigma', 'f8'),                     # of that error [rad/s]; NaN: none
    ('range', 'f8'), ('range_variance', 'f8'),                                  # to that target [m], [m2]; NaN: none
    ('stabilised', 'i8'),                                                       # 1: the pedestal stands on a ship
    ('attitude_stamp', 'f8'), ('attitude_valid', 'i8'),
    ('quaternion', 'f8', (4,)), ('deck_rate', 'f8', (3,)),                      # deck -> earth (xyzw); FLU [rad/s]
    ('aligning', 'i8'),                                                         # 1: the INS does not know it yet
    ('drive_ready', 'i8'),                                                      # 1: the drive follows the commands
    ('preset', 'f8', (2,)), ('preset_valid', 'i8'),                             # deck angles
], align=True)

OUTPUTS = np.dtype([
    ('mode', 'i8'), ('reason', 'i8'),                                            # codes of MODES and REASONS
    ('rate', 'f8', (2,)), ('torque', 'f8', (2,)),                               # command [rad/s], feed-forward [Nm]
    ('estimate', 'f8', (2, 3)),                                                 # target at t_k; NaN: no estimate
    ('reference', 'f8', (2, 3)),                                               # deck angle, rate, acceleration at t_k;
                                                                                # of a beam at t_m: the command
    ('covariance', 'f8', (2, 3)),                                              # p11, p12, p22 at t_k
    ('probability', 'f8', (2, len(MODELS))),                                   # of MODELS
    ('innovation', 'f8', (2,)), ('rate_innovation', 'f8', (2,)),                # nu of angle, rate; NaN: none came
    ('innovation_sigma', 'f8', (2,)),                                           # of the angle's, as predicted
    ('nis', 'f8', (2,)), ('gated', 'i8'),                                       # nu' S^-1 nu; errors gated so far
    ('rates_gated', 'i8'), ('ranges_gated', 'i8'),
    ('coasting', 'i8'), ('locked', 'i8'), ('blocked', 'i8'), ('invalid_input', 'i8'),
    ('angle_limited', 'i8', (2,)), ('rate_limited', 'i8', (2,)), ('acceleration_limited', 'i8', (2,)),
], align=True)

STATE = np.dtype([
    ('stamp', 'f8'), ('mode', 'i8'), ('reason', 'i8'), ('pending', 'i8'), ('entered', 'i8'),
    ('encoder', history_type(4)),                                               # azimuth, elevation, their rates
    ('attitude', attitude.ATTITUDE), ('target', target.TARGET),
    ('azimuth', position_loop.AXIS), ('elevation', position_loop.AXIS),
    ('turn', 'f8'), ('seen', 'f8', (2,)),         # raw azimuth last followed; deck angles of the target then
    ('preset', 'f8', (2,)),
    ('error', 'f8', (2,)),                                                      # of this step, azimuth, elevation
    ('lookahead', planner.PLANNER), ('aligning', 'i8'), ('blocked', 'i8'),
    ('overtravel', 'i8'),                                       # 1: no azimuth wrap held the whole program
    ('off', 'f8'), ('excused', 'f8'),                           # beam meant to be off by [rad]; last such stamp [s]
    ('bridge', bridge.BRIDGE),                                  # program where the target was last seen
], align=True)

CONSTANTS = np.dtype([('p', record_type(AcuParameters)), ('tracker', tracker.CONSTANTS), ('lead', 'f8'),
                      ('notch', 'f8', (2, 5)), ('lookahead', planner.CONSTANTS)], align=True)


def constants(params) -> np.ndarray:
    """Constants (1,) of AcuParameters: the parameters, those of the target filter, lead = t_m - t_k [s], the notches'
    coefficients, those of the look-ahead."""
    c = np.zeros(1, CONSTANTS)
    c['p'] = record(params, AcuParameters)
    c['tracker'] = tracker.constants(params.tracker, (params.azimuth.filter, params.elevation.filter))
    c['lookahead'] = planner.constants(params)
    c['lead'] = params.command_delay + 0.5 * params.period
    for i, axis in enumerate((params.azimuth, params.elevation)):
        c['notch'][0, i] = notch.coefficients(axis.notch.frequency, axis.notch.width, axis.notch.depth, params.period)
    return c


def initial_state(params) -> np.ndarray:
    """State (1,) before the first step: standby, the initial mode pending."""
    s = np.zeros(1, STATE)
    s['stamp'] = -math.inf
    s['pending'] = modes.MODES.index(params.initial_mode)
    s['preset'] = params.azimuth.preset, params.elevation.preset
    s['excused'] = -math.inf
    planner.initialise(s['lookahead'])
    target.initialise(s['target'])
    return s


@compiled
def take_encoder(s, u):
    """Remember the encoders of this step; False where they are not to be used."""
    ok = u.encoder_valid and math.isfinite(u.position[0] + u.position[1] + u.velocity[0] + u.velocity[1])
    if ok:
        row = push(s.encoder, u.stamp)
        for i in range(2):
            s.encoder.sample[row, i], s.encoder.sample[row, 2 + i] = u.position[i], u.velocity[i]
    return ok


@compiled
def take_attitude(s, p, u):
    """Take the attitude of this step, and into the mean of the look-ahead; False where it is unusable."""
    if not u.attitude_valid:
        return False
    outcome = attitude.take(s.attitude, p, u.stamp, u.attitude_stamp, u.quaternion, u.deck_rate)
    if outcome == attitude.NEW:
        if s.aligning:
            # Its heading is still being looked for: the mean begins with the one that is found.
            levelled_deck.restart(s.lookahead.deck)
        levelled_deck.take(s.lookahead.deck, u.attitude_stamp, attitude.quaternion(s.attitude), p.keyhole.mean_time)
    return outcome != attitude.INVALID


@compiled
def met(s, i, j, f, index):
    """Column `index` of the encoder's history, a share f between two rows."""
    a, b = s.encoder.sample[i, index], s.encoder.sample[j, index]
    return a + f * (b - a)


@compiled
def take_error(s, p, c, u, o):
    """Filter y = encoder at the instant of the error, displaced by the error, in the angles of the estimate.

    The error is the mean of samples that were taken while a beam jumped from step to step: target and beam each have
    an instant that they are the mean of. Between two steps the mean moves as a straight line does, so that it is exact
    of a ramp, whatever the weights of the samples are. While the beam is meant to be off the target the receiver's
    reading is none.
    """
    e = p.tracker.receiver
    if not math.isfinite(u.cross_elevation + u.elevation + u.cn0_dbhz):
        return _ERROR
    if s.off > BELIEVED * e.beamwidth:
        return 0
    i, j, f = bracket(s.encoder, u.error_stamp - e.beam_age)
    if i < 0:
        return _ERROR_STAMP
    at = target.Pointing(met(s, i, j, f, 0), met(s, i, j, f, 1), met(s, i, j, f, 2), met(s, i, j, f, 3))
    azimuth, elevation = line_of_sight.displaced(at.A, at.E, u.cross_elevation, u.elevation)
    s.error[0], s.error[1] = azimuth - at.A, elevation - at.E
    outcome, innovation = target.take(s.target, p, c, s.attitude, u, at,
                                      math.inf if excused(s, p) else p.tracker.restart_gap)
    if outcome == target.NO_ATTITUDE:
        return _ATTITUDE
    if outcome == target.STALE:
        return _ERROR_STAMP
    for k in range(2):
        one = innovation.axis[k]
        o.innovation[k], o.rate_innovation[k], o.nis[k] = one.nu, one.rate, measurement.nis(one)
    if o.nis[0] == o.nis[0]:
        for k in range(2):
            o.innovation_sigma[k] = math.sqrt(innovation.axis[k].S)
    return _ERROR_GATED if outcome == target.GATED else 0


@compiled
def excused(s, p):
    """Whether the receiver is silent for a reason, a keyhole or a hidden sector, or has been until just now."""
    return s.stamp - s.excused <= p.tracker.coast_time


@compiled
def followed(s, p, c, program, t):
    """The Followed at t [s]. An outage that has a reason is bridged by the program."""
    if s.mode == modes.PROGRAM:
        return target.Followed(0, program_track.motion_at(program, t))
    if s.bridge.valid and silent(s, p) and excused(s, p) and program_track.status(program, t) == modes.NONE:
        return target.Followed(0, bridge.motion_at(s.bridge, program, t))
    return target.outlook(s.target, c, t)


@compiled
def deck_rates(s, p, t):
    """(azimuth, elevation) rate [rad/s] at which a fixed target where the beam is seems to move because the deck does;
    0 where nobody compensates for it."""
    wanted = p.azimuth.beam.rate_compensation != 0.0 or p.elevation.beam.rate_compensation != 0.0
    if wanted and s.attitude.stabilised and attitude.at(s.attitude, p, t):
        return deck_reference.fixed_rates(vector(s.attitude.w), s.azimuth.position, s.elevation.position)
    return 0.0, 0.0


@compiled
def outside(azimuth, elevation, p):
    """OUTSIDE_LIMITS if deck angles cannot be pointed at, else NONE; NaN is outside."""
    a, e = p.azimuth.limits, p.elevation.limits
    inside = a.low <= azimuth <= a.high and e.low <= elevation <= e.high
    return modes.NONE if inside else modes.OUTSIDE_LIMITS


@compiled
def overdue(s, p):
    """How long [s] no error was believed, beyond the receiver's latency and the age of its errors."""
    return s.stamp - s.target.tracker.stamp - p.receiver_latency - p.tracker.receiver.age


@compiled
def change_mode(s, p, o, drive_ready, program, t_m, request):
    """Let the mode machine decide at s.stamp, asked for `request` or NO_REQUEST: (result, flags of the program)."""
    flags = 0
    encoder_ok = s.encoder.count > 0 and s.encoder.stamp[s.encoder.newest] == s.stamp
    unstable = modes.NONE
    if s.attitude.stabilised:
        # Before the first attitude it is not determined whether the INS has said how it is.
        unstable = (modes.INS_ALIGNING if s.aligning and s.attitude.history.count > 0 else
                    modes.NONE if attitude.at(s.attitude, p, t_m) else modes.ATTITUDE_INVALID)
    lost = not s.target.tracker.running or (overdue(s, p) > p.tracker.coast_time and not excused(s, p))
    obstacle = program_track.status(program, s.stamp)
    wanted = request == modes.PROGRAM or s.mode == modes.PROGRAM or (s.mode == modes.AUTOTRACK and lost)
    if obstacle == modes.NONE and unstable == modes.NONE and wanted:
        source = target.Followed(0, program_track.motion_at(program, t_m))
        motion = target.on_deck(s.target, p, s.attitude, t_m, source)
        A, E = motion.azimuth.angle, motion.elevation.angle
        if not math.isfinite(A + E):
            obstacle, flags = modes.NO_PROGRAM, _PROGRAM
        else:
            low, high = p.azimuth.limits.low, p.azimuth.limits.high
            obstacle = outside(azimuth_wrap.nearest(A, s.turn, low, high, azimuth_wrap.Travel(0.0, 0.0)), E, p)
    o.locked = tracker.locked(s.target.tracker, p.tracker, overdue(s, p))
    mode, reason, result = modes.next_mode(
        s.mode, request, encoder_ok, drive_ready, unstable, obstacle, outside(p.azimuth.stow, p.elevation.stow, p),
        outside(s.preset[0], s.preset[1], p), o.locked, lost, p.tracker.handover)
    if result == modes.ACCEPTED:
        s.pending = modes.NO_REQUEST
        if mode == modes.PROGRAM:
            s.target.tracker.accepted_in_a_row = 0
    if reason != modes.NONE:
        s.reason = reason
    if s.mode == modes.AUTOTRACK and lost:
        s.target.tracker.running = 0
    if mode != s.mode:
        s.mode, s.entered = mode, 1
    return result, flags


@compiled
def request(state, constants, inputs, outputs, program, mode):
    """Ask for a mode between two steps; True when granted. outputs.mode and .reason tell what is now.

    It is decided on what the last step knew, and takes effect on the command of the next step.
    """
    s, o = state[0], outputs[0]
    result, _ = change_mode(s, constants[0].p, o, inputs[0].drive_ready, program, s.stamp + constants[0].lead, mode)
    o.mode, o.reason = s.mode, s.reason
    return result == modes.ACCEPTED


@compiled
def seat(s, p, u):
    """Targets := actual."""
    position_loop.seat(s.azimuth, p.azimuth, u.stamp, u.position[0], u.velocity[0])
    position_loop.seat(s.elevation, p.elevation, u.stamp, u.position[1], u.velocity[1])
    s.turn = u.position[0]


@compiled
def look_ahead(s, p, c, program):
    """Now and then: what the target will ask of the axes."""
    h = s.lookahead
    if s.mode != modes.PROGRAM and s.mode != modes.AUTOTRACK:
        planner.forget(h)
        s.overtravel, s.off = 0, 0.0
        return
    if planner.another_program(h, program):
        # What was planned for the last one means nothing; this one begins as a mode does.
        planner.forget(h)
        s.bridge.valid, s.entered = 0, 1
    if not planner.due(h, s.stamp):
        return
    if s.mode == modes.PROGRAM:
        s.bridge.valid = 0
        planner.look_along_program(h, c.lookahead, s.stamp, s.turn, program, s.bridge)
        return
    sight = target.earth_outlook(s.target, c.tracker, s.stamp)
    if not silent(s, p):
        bridge.begin(s.bridge, program, s.stamp, sight.u)
    if s.bridge.valid and program_track.status(program, s.stamp) == modes.NONE:
        planner.look_along_program(h, c.lookahead, s.stamp, s.turn, program, s.bridge)
    else:
        planner.look_along_great_circle(h, c.lookahead, s.stamp, s.turn, sight.u, sight.du)


@compiled
def silent(s, p):
    """Whether no error is believed any more; an autotrack coasts."""
    return overdue(s, p) > p.tracker.coast_after


@compiled
def explain(s, p, c, program):
    """Note why the receiver hears nothing: the target is hidden, or the beam on its way through the keyhole."""
    follows = s.mode == modes.PROGRAM or s.mode == modes.AUTOTRACK
    s.blocked = follows and blockage.blocked(c.lookahead.sectors, s.seen[0], s.seen[1])
    why = (modes.BLOCKED if s.blocked else
           modes.KEYHOLE if follows and planner.slewing(s.lookahead, s.stamp) else modes.NONE)
    if why != modes.NONE:
        s.excused, s.reason = s.stamp, why
        if s.mode == modes.AUTOTRACK and not silent(s, p):
            sight = target.earth_outlook(s.target, c.tracker, s.stamp)
            bridge.begin(s.bridge, program, s.stamp, sight.u)
    elif s.reason == modes.BLOCKED or s.reason == modes.KEYHOLE:
        s.reason = modes.NONE


@compiled
def read_estimate(s, p, c, o):
    """What is known of the target now, in earth angles of the antenna."""
    estimate = target.read(s.target, p, c, s.attitude, s.stamp)
    for i in range(2):
        o.estimate[i, 0], o.estimate[i, 1], o.estimate[i, 2] = estimate.motion[i]
        o.covariance[i, 0], o.covariance[i, 1], o.covariance[i, 2] = estimate.variances[i]
    target_filter.probabilities(s.target.tracker.filter, c.filter, o.probability)


@compiled
def fixed(s, azimuth, elevation):
    """Motion of axes that are to stand at deck angles [rad]."""
    s.turn = s.azimuth.position
    return Motion(AxisMotion(azimuth, 0.0, 0.0), AxisMotion(elevation, 0.0, 0.0))


@compiled
def raw_target(s, p, c, program, t):
    """Motion on the deck at t [s] of what the mode follows, the azimuth on the wrap that fits."""
    if s.mode == modes.STOW:
        return fixed(s, p.azimuth.stow, p.elevation.stow)
    if s.mode == modes.PRESET:
        return fixed(s, s.preset[0], s.preset[1])
    source = followed(s, p, c.tracker, program, t)
    motion = target.on_deck(s.target, p, s.attitude, t, source)
    s.seen[0], s.seen[1] = motion.azimuth.angle, motion.elevation.angle
    s.off = 0.0
    if planner.slewing(s.lookahead, t):
        level = motion.azimuth
        if s.attitude.stabilised:
            level = target.levelled_azimuth(s.target, s.lookahead.level, source)
        slew, s.off = planner.motion_at(s.lookahead, c.lookahead, t, motion, level)
        s.turn = slew.azimuth.angle
        return slew
    begins = s.entered and s.mode == modes.PROGRAM
    travel = azimuth_wrap.Travel(0.0, 0.0)
    if begins:
        travel = program_track.azimuth_travel(program, t)
    low, high = p.azimuth.limits.low, p.azimuth.limits.high
    s.turn = azimuth_wrap.nearest(motion.azimuth.angle, s.turn, low, high, travel)
    if begins:
        s.overtravel = s.turn + travel.below < low or s.turn + travel.above > high
    return Motion(AxisMotion(s.turn, motion.azimuth.rate, motion.azimuth.acceleration), motion.elevation)


@compiled
def clear(o):
    """Outputs of a step in which nothing has happened yet."""
    o.coasting, o.blocked, o.invalid_input = 0, 0, 0
    o.torque[:] = 0.0
    o.innovation[:] = math.nan
    o.rate_innovation[:] = math.nan
    o.innovation_sigma[:] = math.nan
    o.nis[:] = math.nan
    o.estimate[:] = math.nan
    o.covariance[:] = math.nan
    o.probability[:] = math.nan
    o.reference[:] = 0.0
    o.angle_limited[:] = 0
    o.rate_limited[:] = 0
    o.acceleration_limited[:] = 0


@compiled
def step(state, constants, inputs, outputs, program):
    """One drive step; arrays (1,) of STATE, CONSTANTS, INPUTS, OUTPUTS and a ProgramTrack.

    A stamp that does not advance (or is NaN) changes nothing: the last command stands, `stamp` is flagged.
    """
    s, u, o = state[0], inputs[0], outputs[0]
    p = constants[0].p
    dt = u.stamp - s.stamp
    if not (dt > 0.0 and math.isfinite(u.stamp)):
        o.invalid_input = _STAMP
        o.reason = modes.BAD_STAMP
        return
    clear(o)
    tracker.transfer(s.target.tracker, p.tracker, constants[0].tracker)
    jumped = dt > p.step_gap
    flags = _STEP_GAP if jumped and math.isfinite(s.stamp) else 0
    dt = p.period if jumped else dt
    s.stamp, s.aligning = u.stamp, u.aligning

    encoder_ok = take_encoder(s, u)
    if not encoder_ok:
        flags |= _ENCODER
    s.error[0] = s.error[1] = math.nan
    if u.stabilised != s.attitude.stabilised:
        s.attitude.stabilised, s.target.tracker.running = u.stabilised, 0
        planner.forget(s.lookahead)
    if u.stabilised and not take_attitude(s, p, u):
        flags |= _ATTITUDE
    if u.error_valid:
        flags |= take_error(s, p, constants[0].tracker, u, o)
    if u.preset_valid:
        if math.isfinite(u.preset[0] + u.preset[1]):
            s.preset[0], s.preset[1] = u.preset[0], u.preset[1]
        else:
            flags |= _PRESET

    t_m = u.stamp + constants[0].lead
    rested = s.mode == modes.STANDBY
    _, program_flags = change_mode(s, p, o, u.drive_ready, program, t_m,
                                   s.pending if rested else modes.NO_REQUEST)
    if encoder_ok and (rested or jumped):
        seat(s, p, u)
    if s.mode == modes.STANDBY:
        position_loop.rest(s.azimuth, p.azimuth, dt, o, 0)
        position_loop.rest(s.elevation, p.elevation, dt, o, 1)
    else:
        # The azimuth wants its target at one instant, the elevation perhaps at another.
        t_azimuth = position_loop.instant(p.azimuth, u.stamp, t_m)
        t_elevation = position_loop.instant(p.elevation, u.stamp, t_m)
        motion = raw_target(s, p, constants[0], program, t_azimuth)
        if t_elevation != t_azimuth:
            motion = Motion(motion.azimuth, raw_target(s, p, constants[0], program, t_elevation).elevation)
        A, dA, ddA = motion.azimuth
        E, dE, ddE = motion.elevation
        autotrack, (V_A, V_E) = s.mode == modes.AUTOTRACK, deck_rates(s, p, u.stamp)
        position_loop.follow(s.azimuth, p.azimuth, constants[0].notch[0], A, dA, ddA, u.stamp, t_m, u.position[0],
                             u.velocity[0], s.error[0], V_A, autotrack, dt, o, 0)
        position_loop.follow(s.elevation, p.elevation, constants[0].notch[1], E, dE, ddE, u.stamp, t_m, u.position[1],
                             u.velocity[1], s.error[1], V_E, autotrack, dt, o, 1)
        s.entered = 0
        explain(s, p, constants[0], program)
        o.blocked = s.blocked
        o.coasting = s.mode == modes.AUTOTRACK and silent(s, p)

    o.mode, o.reason, o.invalid_input = s.mode, s.reason, flags | program_flags
    o.rate[0], o.rate[1] = s.azimuth.command, s.elevation.command
    t = s.target.tracker
    o.gated, o.rates_gated, o.ranges_gated = t.gated, t.rates_gated, t.ranges_gated
    if t.running:
        read_estimate(s, p, constants[0].tracker, o)
    look_ahead(s, p, constants[0], program)
