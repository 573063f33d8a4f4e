"""The antenna control unit: one `step` per drive step, from encoders, receiver error and attitude to the rate command.

The estimate lives in earth angles, near the zenith in those of a tilted `estimate_frame`.
"""
import math

import numpy as np

from acu_tracker import modes
from acu_tracker.estimation import tracker
from acu_tracker.geometry import deck_reference, estimate_frame, lever_arm
from acu_tracker.geometry.attitude import (
    attitude_at,
    deck_rates,
    estimate_from_deck,
    levelled,
    seen_from_deck,
    take_attitude,
)
from acu_tracker.history import bracket, history_type, push
from acu_tracker.lookahead import ahead
from acu_tracker.params import AcuParameters
from acu_tracker.program import bridge, program_track
from acu_tracker.servo import notch, position_loop
from pedestal_common import blockage
from pedestal_common.compiled import compiled
from pedestal_common.line_of_sight import ASHORE, displaced, displaced_motion, earth_angles, earth_direction, to_earth
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
    ('program_count', 'i8'),                                                    # rows of the table in use
    ('preset', 'f8', (2,)), ('preset_valid', 'i8'),                             # deck angles
], align=True)

OUTPUTS = np.dtype([
    ('mode', 'i8'), ('reason', 'i8'),                                            # codes of MODES and REASONS
    ('rate', 'f8', (2,)), ('torque', 'f8', (2,)),                               # command [rad/s], feed-forward [Nm]
    ('estimate', 'f8', (2, 3)),                                                 # target at t_k; NaN: no estimate
    ('reference', 'f8', (2, 3)),                                               # deck angle, rate, acceleration at t_k;
                                                                                # of a beam at t_m: the command
    ('covariance', 'f8', (2, 3)), ('probability', 'f8', (2, 4)),                # p11, p12, p22 at t_k; of MODELS
    ('innovation', 'f8', (2,)), ('rate_innovation', 'f8', (2,)),                # nu of angle, rate; NaN: none came
    ('innovation_sigma', 'f8', (2,)),                                           # of the angle's, as predicted
    ('nis', 'f8', (2,)), ('gated', 'i8'),                                       # nu' S^-1 nu; errors gated so far
    ('rates_gated', 'i8'), ('ranges_gated', 'i8'),
    ('coasting', 'i8'), ('locked', 'i8'), ('blocked', 'i8'), ('invalid_input', 'i8'),
    ('angle_limited', 'i8', (2,)), ('rate_limited', 'i8', (2,)), ('acceleration_limited', 'i8', (2,)),
], align=True)

STATE = np.dtype([
    ('stamp', 'f8'), ('mode', 'i8'), ('reason', 'i8'), ('pending', 'i8'), ('entered', 'i8'), ('stabilised', 'i8'),
    ('encoder', history_type(4)),                                               # azimuth, elevation, their rates
    ('attitude', history_type(10)),                                             # quaternion, w, dw
    ('tracker', tracker.TRACKER), ('azimuth', position_loop.AXIS), ('elevation', position_loop.AXIS),
    ('turn', 'f8'), ('seen', 'f8', (2,)),         # raw azimuth last followed; deck angles of the target then
    ('preset', 'f8', (2,)),
    ('error', 'f8', (2,)),                                                      # of this step, azimuth, elevation
    ('mat_ed', 'f8', (3, 3)), ('w', 'f8', (3,)), ('dw', 'f8', (3,)),          # attitude last asked for
    ('frame', estimate_frame.FRAME), ('mat_fd', 'f8', (3, 3)),                 # of the filter; deck -> it
    ('ahead', ahead.AHEAD), ('aligning', 'i8'), ('blocked', 'i8'),
    ('cramped', 'i8'),                                          # 1: no turn of the azimuth held the whole program
    ('off', 'f8'), ('excused', 'f8'),                           # beam meant to be off by [rad]; last such stamp [s]
    ('bridge', bridge.BRIDGE),                                  # program where the target was last seen
    ('arm', 'f8', (3,)), ('range', 'f8'),                       # lever arm over range [-]; from the INS [m], 0: none
], align=True)

CONSTANTS = np.dtype([('p', record_type(AcuParameters)), ('tracker', tracker.CONSTANTS), ('ahead', 'f8'),
                      ('notch', 'f8', (2, 5)), ('sectors', 'f8', (blockage.MOST, 3))], align=True)


def constants(params) -> np.ndarray:
    """Constants (1,) of an AcuParameters: the parameters, those of the target filter, `ahead` = t_m - t_k [s], the
    notches' coefficients, hidden sectors."""
    c = np.zeros(1, CONSTANTS)
    c['p'] = record(params, AcuParameters)
    c['tracker'] = tracker.constants(params.tracker, params.azimuth.filter, params.elevation.filter)
    c['sectors'] = blockage.sectors(params.blockage)
    c['ahead'] = params.command_delay + 0.5 * params.period
    for i, axis in enumerate((params.azimuth, params.elevation)):
        c['notch'][0, i] = notch.coefficients(axis.notch.frequency, axis.notch.width, axis.notch.depth, params.period)
    return c


def initial_state(params) -> np.ndarray:
    """State (1,) before the first step: standby, the initial mode pending."""
    s = np.zeros(1, STATE)
    s['stamp'] = -math.inf
    s['pending'] = modes.MODES.index(params.initial_mode)
    s['preset'] = params.azimuth.preset, params.elevation.preset
    s['excused'] = s['ahead']['looked'] = s['ahead']['latest'] = -math.inf
    s['ahead']['hidden'] = math.nan
    s['ahead']['mean'] = ASHORE
    s['frame']['mat'] = np.eye(3)
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
def met(s, i, j, f, index):
    """Column `index` of the encoder's history, a share f between two rows."""
    a, b = s.encoder.sample[i, index], s.encoder.sample[j, index]
    return a + f * (b - a)


@compiled
def target_rates(s, u, A, E, dA, dE):
    """Rates (azimuth, elevation) of the target: those of the antenna at A, E and of the error, turned into the frame
    of the filter by the attitude `s` was last asked for."""
    x, y, z, dx, dy, dz = displaced_motion(A, E, dA, dE, u.cross_elevation, u.elevation, u.error_rate[0],
                                           u.error_rate[1])
    if s.stabilised or s.frame.tilted:
        estimate_frame.from_deck(s.frame, s.mat_ed, s.mat_fd)
        x, y, z, dx, dy, dz, _, _, _ = deck_reference.from_lever_arm(-s.arm[0], -s.arm[1], -s.arm[2], x, y, z, dx, dy,
                                                                    dz, 0.0, 0.0, 0.0)
        return deck_reference.earth_rates(s.mat_fd, s.w[0], s.w[1], s.w[2], x, y, z, dx, dy, dz)
    _, dA, _, _, dE, _ = deck_reference.moving_angles(x, y, z, dx, dy, dz, 0.0, 0.0, 0.0)
    return dA, dE


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
    if not s.tracker.running:
        estimate_frame.level(s.frame)
    t = u.error_stamp - e.age
    i, j, f = bracket(s.encoder, u.error_stamp - e.beam_age)
    if i < 0:
        return _ERROR_STAMP
    A, E = met(s, i, j, f, 0), met(s, i, j, f, 1)
    azimuth, elevation = displaced(A, E, u.cross_elevation, u.elevation)
    s.error[0], s.error[1] = azimuth - A, elevation - E
    if s.stabilised or s.frame.tilted:
        if not attitude_at(s, p, t):
            return _ATTITUDE
        # The deck's azimuth is clockwise from the bow: a direction in FLU is (north, west, up) of an ENU vector.
        y, x, z = earth_direction(azimuth, elevation)
        azimuth, elevation = earth_angles(*to_earth(s.mat_ed, *lever_arm.from_ins(s, p.lever_arm, u.range, x, -y, z)))
        if s.frame.tilted:
            azimuth, elevation = estimate_frame.measured(s.frame, azimuth, elevation)
    azimuth_rate, elevation_rate = math.nan, math.nan
    if math.isfinite(u.error_rate[0] + u.error_rate[1] + u.error_rate_sigma):
        azimuth_rate, elevation_rate = target_rates(s, u, A, E, met(s, i, j, f, 2), met(s, i, j, f, 3))
    R = tracker.error_variance(u.cross_elevation, u.elevation, u.cn0_dbhz, e.beamwidth, e.slope, e.integration,
                               e.sigma_floor)
    R_rate = u.error_rate_sigma * u.error_rate_sigma
    cos_el = max(math.cos(elevation), 0.01)
    (outcome, o.innovation[0], o.innovation[1], o.rate_innovation[0], o.rate_innovation[1], o.nis[0],
     o.nis[1]) = tracker.observe(s.tracker, p.tracker, c, t, azimuth, elevation, R / (cos_el * cos_el), R,
                                 azimuth_rate, elevation_rate, R_rate / (cos_el * cos_el), R_rate, u.range,
                                 u.range_variance, math.inf if excused(s, p) else p.tracker.restart_gap)
    if outcome == tracker.STALE:
        return _ERROR_STAMP
    reframe(s, c)
    if o.nis[0] == o.nis[0]:
        o.innovation_sigma[0], o.innovation_sigma[1] = math.sqrt(s.tracker.S[0]), math.sqrt(s.tracker.S[1])
    return _ERROR_GATED if outcome == tracker.GATED else 0


@compiled
def reframe(s, c):
    """Let the filter go on in the frame that suits the elevation of the target."""
    t, f = s.tracker, s.frame
    A, dA, ddA, E, dE, ddE = tracker.outlook(t, c, t.stamp)
    if not (f.tilted or E > estimate_frame.RAISE):
        return
    e, n, u, de, dn, du, dde, ddn, ddu = estimate_frame.moving_in_earth(f, A, dA, ddA, E, dE, ddE)
    if f.tilted and u >= math.sin(estimate_frame.LOWER):
        return
    if f.tilted:
        estimate_frame.level(f)
    else:
        estimate_frame.tilt(f, e, n, u, de, dn, du)
    tracker.turn(t, c, *estimate_frame.moving_in_frame(f, e, n, u, de, dn, du, dde, ddn, ddu))


@compiled
def excused(s, p):
    """Whether the receiver is silent for a reason, a keyhole or a hidden sector, or has been until just now."""
    return s.stamp - s.excused <= p.tracker.coast_time


@compiled
def followed(s, p, c, times, angles, t):
    """(in the frame of the filter, A, dA, ddA, E, dE, ddE) at t of what program or autotrack follows: 1 for angles in
    that frame, 0 for earth angles. A silence that has a reason is bridged by the program."""
    if s.mode == modes.PROGRAM:
        A, dA, ddA, E, dE, ddE = program_track.outlook(times, angles, t)
        return 0, A, dA, ddA, E, dE, ddE
    if s.bridge.there and silent(s, p) and excused(s, p) and program_track.status(times, t) == modes.NONE:
        A, dA, ddA, E, dE, ddE = bridge.outlook(s.bridge, times, angles, t)
        return 0, A, dA, ddA, E, dE, ddE
    A, dA, ddA, E, dE, ddE = tracker.outlook(s.tracker, c, t)
    return 1, A, dA, ddA, E, dE, ddE


@compiled
def program_target(s, p, times, angles, t):
    """Deck angles of the program track at t; the azimuth not yet on a turn."""
    A, dA, ddA, E, dE, ddE = program_track.outlook(times, angles, t)
    return seen_from_deck(s, p, t, A, dA, ddA, E, dE, ddE)


@compiled
def outside(azimuth, elevation, p):
    """OUTSIDE_LIMITS if deck angles cannot be pointed at, else NONE; NaN is outside."""
    a, e = p.azimuth.limits, p.elevation.limits
    inside = a.low <= azimuth <= a.high and e.low <= elevation <= e.high
    return modes.NONE if inside else modes.OUTSIDE_LIMITS


@compiled
def overdue(s, p):
    """How long [s] no error was believed, beyond the receiver's latency and the age of its errors."""
    return s.stamp - s.tracker.stamp - p.receiver_latency - p.tracker.receiver.age


@compiled
def change_mode(s, p, o, drive_ready, times, angles, t_m, request):
    """Let the mode machine decide at s.stamp, asked for `request` or NO_REQUEST: (result, flags of the program)."""
    flags = 0
    encoder_ok = s.encoder.count > 0 and s.encoder.stamp[s.encoder.newest] == s.stamp
    attitude = modes.NONE
    if s.stabilised:
        # Before the first attitude it is not determined whether the INS has said how it is.
        attitude = (modes.INS_ALIGNING if s.aligning and s.attitude.count > 0 else
                    modes.NONE if attitude_at(s, p, t_m) else modes.ATTITUDE_INVALID)
    lost = not s.tracker.running or (overdue(s, p) > p.tracker.coast_time and not excused(s, p))
    program = program_track.status(times, s.stamp)
    wanted = request == modes.PROGRAM or s.mode == modes.PROGRAM or (s.mode == modes.AUTOTRACK and lost)
    if program == modes.NONE and attitude == modes.NONE and wanted:
        A, _, _, E, _, _ = program_target(s, p, times, angles, t_m)
        if not math.isfinite(A + E):
            program, flags = modes.NO_PROGRAM, _PROGRAM
        else:
            low, high = p.azimuth.limits.low, p.azimuth.limits.high
            program = outside(deck_reference.nearest_turn(A, s.turn, low, high, 0.0, 0.0), E, p)
    o.locked = tracker.locked(s.tracker, p.tracker, overdue(s, p))
    mode, reason, result = modes.next_mode(
        s.mode, request, encoder_ok, drive_ready, attitude, program, outside(p.azimuth.stow, p.elevation.stow, p),
        outside(s.preset[0], s.preset[1], p), o.locked, lost, p.tracker.handover)
    if result == modes.ACCEPTED:
        s.pending = modes.NO_REQUEST
        if mode == modes.PROGRAM:
            s.tracker.in_a_row = 0
    if reason != modes.NONE:
        s.reason = reason
    if s.mode == modes.AUTOTRACK and lost:
        s.tracker.running = 0
    if mode != s.mode:
        s.mode, s.entered = mode, 1
    return result, flags


@compiled
def request(s, c, u, o, mode, program_times, program_angles):
    """Ask for a mode between two steps; True when granted. outputs.mode and .reason tell what is now.

    It is decided on what the last step knew, and takes effect on the command of the next step.
    """
    rows = max(u.program_count, 0)
    result, _ = change_mode(s, c.p, o, u.drive_ready, program_times[:rows], program_angles[:rows], s.stamp + c.ahead,
                            mode)
    o.mode, o.reason = s.mode, s.reason
    return result == modes.ACCEPTED


@compiled
def seat(s, p, u):
    """Targets := actual."""
    position_loop.seat(s.azimuth, p.azimuth, u.stamp, u.position[0], u.velocity[0])
    position_loop.seat(s.elevation, p.elevation, u.stamp, u.position[1], u.velocity[1])
    s.turn = u.position[0]


@compiled
def look_ahead(s, p, c, sectors, times, angles):
    """Now and then: what the target will ask of the axes."""
    h = s.ahead
    if s.mode != modes.PROGRAM and s.mode != modes.AUTOTRACK:
        ahead.forget(h)
        s.cramped, s.off = 0, 0.0
        return
    if ahead.another_program(h, times, angles):
        # What was planned for the last one means nothing; this one begins as a mode does.
        ahead.forget(h)
        s.bridge.there, s.entered = 0, 1
    if s.stamp - h.looked < ahead.INTERVAL or (h.what == ahead.KEYHOLE and s.stamp <= h.plan.t2):
        return
    known, e, n, u, de, dn, du = True, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    if s.mode == modes.PROGRAM:
        s.bridge.there = 0
    else:
        e, n, u, de, dn, du, _, _, _ = estimate_frame.moving_in_earth(s.frame, *tracker.outlook(s.tracker, c, s.stamp))
        if not silent(s, p):
            bridge.begin(s.bridge, times, angles, s.stamp, e, n, u)
        known = s.bridge.there != 0 and program_track.status(times, s.stamp) == modes.NONE
    ahead.look(h, s.bridge, p, sectors, s.stamp, s.turn, times, angles, known, e, n, u, de, dn, du)


@compiled
def silent(s, p):
    """Whether no error is believed any more; an autotrack coasts."""
    return overdue(s, p) > p.tracker.coast_after


@compiled
def explain(s, p, c, times, angles):
    """Note why the receiver hears nothing: the target is hidden, or the beam on its way through the keyhole."""
    follows = s.mode == modes.PROGRAM or s.mode == modes.AUTOTRACK
    s.blocked = follows and blockage.blocked(c.sectors, s.seen[0], s.seen[1])
    why = (modes.BLOCKED if s.blocked else
           modes.KEYHOLE if follows and ahead.slewing(s.ahead, s.stamp) else modes.NONE)
    if why != modes.NONE:
        s.excused, s.reason = s.stamp, why
        if s.mode == modes.AUTOTRACK and not silent(s, p):
            motion = estimate_frame.moving_in_earth(s.frame, *tracker.outlook(s.tracker, c.tracker, s.stamp))
            bridge.begin(s.bridge, times, angles, s.stamp, motion[0], motion[1], motion[2])
    elif s.reason == modes.BLOCKED or s.reason == modes.KEYHOLE:
        s.reason = modes.NONE


@compiled
def read_estimate(s, p, c, o):
    """What is known of the target now, in earth angles of the antenna."""
    tracker.read(s.tracker, c, s.stamp, o)
    if s.frame.tilted:
        estimate_frame.put_in_earth(s.frame, o.estimate, o.covariance)
    if s.range > 0.0 and attitude_at(s, p, s.stamp):
        lever_arm.to_antenna(s, o.estimate)


@compiled
def raw_target(s, p, c, times, angles, t):
    """Deck (A, dA, ddA, E, dE, ddE) at t of what the mode follows, the azimuth on the turn that fits."""
    if s.mode == modes.STOW:
        s.turn = s.azimuth.position
        return p.azimuth.stow, 0.0, 0.0, p.elevation.stow, 0.0, 0.0
    if s.mode == modes.PRESET:
        s.turn = s.azimuth.position
        return s.preset[0], 0.0, 0.0, s.preset[1], 0.0, 0.0
    framed, B, dB, ddB, F, dF, ddF = followed(s, p, c, times, angles, t)
    if framed:
        A, dA, ddA, E, dE, ddE = estimate_from_deck(s, p, t, B, dB, ddB, F, dF, ddF)
    else:
        A, dA, ddA, E, dE, ddE = seen_from_deck(s, p, t, B, dB, ddB, F, dF, ddF)
    s.seen[0], s.seen[1] = A, E
    s.off = 0.0
    if ahead.slewing(s.ahead, t):
        B, dB, ddB = levelled(s, framed, B, dB, ddB, F, dF, ddF) if s.stabilised else (A, dA, ddA)
        s.turn, dA, ddA, E, dE, ddE, s.off = ahead.through(s.ahead, t, A, dA, ddA, E, dE, ddE, B, dB, ddB,
                                                           p.elevation.limits.high - p.keyhole.elevation_margin)
        return s.turn, dA, ddA, E, dE, ddE
    below = above = 0.0
    if s.entered and s.mode == modes.PROGRAM:
        below, above = program_track.azimuth_travel(times, angles, t)
    s.turn = deck_reference.nearest_turn(A, s.turn, p.azimuth.limits.low, p.azimuth.limits.high, below, above)
    if s.entered and s.mode == modes.PROGRAM:
        s.cramped = s.turn + below < p.azimuth.limits.low or s.turn + above > p.azimuth.limits.high
    return s.turn, dA, ddA, E, dE, ddE


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
def step(s, c, u, o, program_times, program_angles):
    """One drive step; records STATE, CONSTANTS, INPUTS, OUTPUTS, the table (n,) [s] and (n, 2) [rad] earth.

    A stamp that does not advance (or is NaN) changes nothing: the last command stands, `stamp` is flagged.
    """
    p = c.p
    dt = u.stamp - s.stamp
    if not (dt > 0.0 and math.isfinite(u.stamp)):
        o.invalid_input = _STAMP
        o.reason = modes.BAD_STAMP
        return
    clear(o)
    tracker.adopt(s.tracker, p.tracker, c.tracker)
    rows = max(u.program_count, 0)
    times, angles = program_times[:rows], program_angles[:rows]
    jumped = dt > p.step_gap
    flags = _STEP_GAP if jumped and math.isfinite(s.stamp) else 0
    dt = p.period if jumped else dt
    s.stamp, s.aligning = u.stamp, u.aligning

    encoder_ok = take_encoder(s, u)
    if not encoder_ok:
        flags |= _ENCODER
    s.error[0] = s.error[1] = math.nan
    if u.stabilised != s.stabilised:
        s.stabilised, s.tracker.running = u.stabilised, 0
        ahead.forget(s.ahead)
    if u.stabilised and not take_attitude(s, p, u):
        flags |= _ATTITUDE
    if u.error_valid:
        flags |= take_error(s, p, c.tracker, u, o)
    if u.preset_valid:
        if math.isfinite(u.preset[0] + u.preset[1]):
            s.preset[0], s.preset[1] = u.preset[0], u.preset[1]
        else:
            flags |= _PRESET

    t_m = u.stamp + c.ahead
    rested = s.mode == modes.STANDBY
    _, program_flags = change_mode(s, p, o, u.drive_ready, times, angles, t_m,
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
        A = dA = ddA = E = dE = ddE = 0.0
        for i in range(1 if t_elevation == t_azimuth else 2):
            B, dB, ddB, E, dE, ddE = raw_target(s, p, c.tracker, times, angles,
                                                t_azimuth if i == 0 else t_elevation)
            if i == 0:
                A, dA, ddA = B, dB, ddB
        autotrack, (V_A, V_E) = s.mode == modes.AUTOTRACK, deck_rates(s, p, u.stamp)
        position_loop.follow(s.azimuth, p.azimuth, c.notch[0], A, dA, ddA, u.stamp, t_m, u.position[0],
                             u.velocity[0], s.error[0], V_A, autotrack, dt, o, 0)
        position_loop.follow(s.elevation, p.elevation, c.notch[1], E, dE, ddE, u.stamp, t_m, u.position[1],
                             u.velocity[1], s.error[1], V_E, autotrack, dt, o, 1)
        s.entered = 0
        explain(s, p, c, times, angles)
        o.blocked = s.blocked
        o.coasting = s.mode == modes.AUTOTRACK and silent(s, p)

    o.mode, o.reason, o.invalid_input = s.mode, s.reason, flags | program_flags
    o.rate[0], o.rate[1] = s.azimuth.command, s.elevation.command
    o.gated, o.rates_gated, o.ranges_gated = s.tracker.gated, s.tracker.rates_gated, s.tracker.ranges_gated
    if s.tracker.running:
        read_estimate(s, p, c.tracker, o)
    look_ahead(s, p, c.tracker, c.sectors, times, angles)
