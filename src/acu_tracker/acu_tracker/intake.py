"""What a step hears: the encoders, the ship's attitude, the error of the receiver, a preset.

s, c, u, o: records of control_unit.STATE and CONSTANTS, of signals.INPUTS and OUTPUTS.
"""
import math

from acu_tracker import modes, signals
from acu_tracker.estimation import divergence, repetition, slope_sign, target
from acu_tracker.estimation.filters import measurement
from acu_tracker.geometry import attitude, attitude_error, encoders
from acu_tracker.lookahead import levelled_deck, planner
from acu_tracker.mode import by_level, outage, supervision
from pedestal_common.compiled import compiled
from pedestal_common.geometry import line_of_sight

ON_TARGET = 0.5
"""Largest intended pointing offset [beamwidths] at which the receiver's error is still used."""


@compiled
def take_encoders(s, u):
    """Take the encoders of this step; signals.ENCODER where they are not valid, else 0."""
    return 0 if u.encoder_valid and encoders.take(s.encoders, u.stamp, u.position, u.velocity) else signals.ENCODER


@compiled
def take_attitude(s, c, u):
    """Take the attitude of this step, also into the mean of the look-ahead, and what its INS says of its error; flags
    signals.ATTITUDE, ATTITUDE_ERROR of what is not valid."""
    s.aligning = u.aligning
    if u.stabilised != s.attitude.stabilised:
        s.attitude.stabilised, s.target.tracker.running = u.stabilised, 0
        planner.forget(s.lookahead)
    if not u.stabilised:
        return 0
    flags = 0
    if u.attitude_error_came and not attitude_error.take(s.attitude.error, u.attitude_noise, u.attitude_walk):
        flags = signals.ATTITUDE_ERROR
    if not u.attitude_valid:
        return flags | signals.ATTITUDE
    outcome = attitude.take(s.attitude, c.p, u.stamp, u.attitude_stamp, u.quaternion, u.deck_rate, u.aligning)
    if outcome == attitude.NEW:
        deck = s.lookahead.deck
        if s.aligning:
            # Its heading is not known yet: the mean begins with the first one after the alignment.
            levelled_deck.restart(deck)
        h = s.attitude.history
        levelled_deck.take(deck, u.attitude_stamp, h.sample[h.newest], c.p.keyhole.mean_time)
    return flags | (signals.ATTITUDE if outcome == attitude.INVALID else 0)


@compiled
def _wrong_level(s, u):
    """The flag of a message, of a locked receiver or not, that a mode goes by the level of and must not believe,
    else 0."""
    if not u.error_came or not modes.BY_LEVEL[s.mode]:
        return 0
    if not math.isfinite(u.cn0_dbhz):
        return signals.ERROR
    known, _ = encoders.at(s.encoders, u.error_stamp)
    return 0 if known else signals.ERROR_STAMP


@compiled
def take_error(s, c, u, o, program):
    """Filter y = encoder at the instant of the error, displaced by the error; a flag where it is not accepted, else 0.

    The error is a mean of samples that were taken while a beam jumped from step to step, so that target and beam each
    have an instant that the mean belongs to. Linear interpolation between two steps is exact for a ramp, whatever the
    weights of the samples are. No error is used while the beam is intentionally off the target.
    """
    s.error[0] = s.error[1] = math.nan
    receiver = c.p.tracker.receiver
    wrong = _wrong_level(s, u)
    if wrong or not u.error_valid:
        return wrong
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
    restart_gap = math.inf if outage.permitted(s, c) else c.p.tracker.restart_gap
    outcome, innovation = target.take(s.target, c.p, c.tracker, s.attitude, u, at, measured, restart_gap)
    if outcome != target.NOISY and supervision.obeys(s):
        divergence.take(s.divergence, innovation)
    if s.mode == modes.AUTOTRACK and outcome != target.NO_ATTITUDE and slope_sign.near(u, receiver.beamwidth):
        _watch_slope(s, c, u, at)
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
def _watch_slope(s, c, u, at):
    """Note an error that shows that the slope of autotrack is reversed; at: Pointing of the beam it belongs to."""
    p = c.p.tracker
    t = u.error_stamp - p.receiver.age
    _, deck = attitude.at(s.attitude, c.p, t)
    error, beam = (u.cross_elevation, u.elevation), slope_sign.beam(deck.mat, at.A, at.E)
    variance = measurement.error_variance(u.cross_elevation, u.elevation, u.cn0_dbhz, p.receiver)
    if slope_sign.take(s.slope_sign, t, beam, error, variance, p.coast_after):
        s.divergence.diverged = 1


@compiled
def take_preset(s, u):
    """Take a new preset; signals.PRESET where it is not finite, else 0."""
    if not u.preset_valid:
        return 0
    if not math.isfinite(u.preset[0] + u.preset[1]):
        return signals.PRESET
    s.preset.angle[0], s.preset.angle[1], s.preset.moves = u.preset[0], u.preset[1], 0.0
    return 0
