"""Tracking of the target by the receiver: histories of beam and deck, target filter, and monitors of the errors.

`control_unit` and `guidance` call this module. The functions take each error of the receiver, and return the estimate
of the target and the conditions for autotrack.

k     record of Tracking
c     record of control_unit.Constants
u, o  records of signals.Inputs.dtype and of signals.Outputs
gap   outage.Outage: the time without a signal of the receiver
"""
import math

from acu_tracker import measurements
from acu_tracker.estimation import divergence, repetition, slope_sign, target, tracker
from acu_tracker.estimation.filters import measurement, target_filter
from acu_tracker.geometry import attitude, deck_reference, encoders
from acu_tracker.geometry.vector import Vector, rotated
from acu_tracker.modes import Reason
from acu_tracker.pointing import model
from acu_tracker.search import coast, place
from pedestal_common.compiled import compiled
from pedestal_common.geometry import line_of_sight as pointing
from pedestal_common.quantities import Pair
from pedestal_common.record import Record


class Tracking(Record):
    """State of the tracking."""
    encoders: encoders.Encoders  # encoders, attitude: histories of the encoder angles and of the deck
    pointing: model.PointingRecord  # pointing model in force, between encoder angles and directions
    attitude: attitude.DeckAttitude
    target: target.Target  # target filter
    error: Pair  # receiver error of this step, in deck angles (azimuth, elevation) [rad]; NaN: no error
    repetition: repetition.Repetition  # repetition, divergence, slope_sign: monitors of the errors
    divergence: divergence.Divergence
    slope_sign: slope_sign.SlopeSign


def initialise(k, pointing):
    """Begin without an estimate; k: view of Tracking; pointing: PointingParameters."""
    target.initialise(k['target'])
    model.initialise(k['pointing'][0], pointing.terms, pointing.named)


@compiled
def take_place(k, u):
    """Note whether the pedestal stands on a ship. Return True if that has changed; the estimate then ends."""
    another = attitude.put(k.attitude, u.stabilised)
    if another:
        tracker.stop(k.target.tracker)
    return another


@compiled
def used_error(k, c, u, by_level, offset):
    """Return (flags of the receiver's message, True if its error is used, the Pointing of the beam at the error).

    The Pointing is on the sky. A repeated error is not used. by_level, offset: uses_level and intended_offset of
    measurements.error_at.
    """
    k.error[0] = k.error[1] = math.nan
    flags, used, at = measurements.error_at(k.encoders, c.p.tracker.receiver, u, by_level, offset)
    return flags, used and not repetition.take(k.repetition, u, at), model.to_sky(k.pointing.model, at)


@compiled
def take_error(k, c, u, o, at, restart_gap, closed, follows):
    """Filter an error of the receiver and run the monitors. Return a flag if the error is not accepted, else 0.

    The filter receives the direction of the beam when the error was measured, displaced by the error.

    at           Pointing of the beam when the error was measured
    restart_gap  time without accepted errors after which the filter restarts [s]
    closed       True if the loop is closed on the errors (autotrack), and no limit holds the beam off the target
    follows      True if the axes follow their commands, and no limit holds the beam off the target
    """
    receiver = c.p.tracker.receiver
    measured = pointing.displaced(at.A, at.E, u.cross_elevation, u.elevation)
    k.error[0], k.error[1] = measured[0] - at.A, measured[1] - at.E
    outcome, innovation = target.take(k.target, c.p, c.tracker, k.attitude, u, at, measured, restart_gap)
    if outcome != target.OUTCOME_NOISY and follows:
        divergence.take(k.divergence, innovation)
    if closed and outcome != target.OUTCOME_NO_ATTITUDE and slope_sign.near(u, receiver.beamwidth):
        _watch_slope(k, c, u, at)
    return measurements.write_innovation(o, outcome, innovation)


@compiled
def _watch_slope(k, c, u, at):
    """Test the sign of the slope with an error, and latch the divergence if the sign is reversed.

    at: Pointing of the beam when the error was measured.
    """
    p = c.p.tracker
    t = u.error_stamp - p.receiver.age
    _, deck = attitude.at(k.attitude, c.p, t)
    error, beam = (u.cross_elevation, u.elevation), slope_sign.beam(deck.mat, at.A, at.E)
    variance = measurement.error_variance(u.cross_elevation, u.elevation, u.cn0_dbhz, p.receiver)
    if slope_sign.take(k.slope_sign, t, beam, error, variance, p.coast_after):
        divergence.latch(k.divergence)


@compiled
def unstable(k, c, u, t):
    """Return Reason.NONE, or why the attitude of the deck is not known at the time when the command of t [s] acts."""
    if not k.attitude.stabilised:
        return Reason.NONE
    # Before the first attitude the state of the INS may not have arrived; the reason is then ATTITUDE_INVALID.
    if u.aligning and k.attitude.history.count > 0:
        return Reason.INS_ALIGNING
    known, _ = attitude.at(k.attitude, c.p, t + c.lead)
    return Reason.NONE if known else Reason.ATTITUDE_INVALID


@compiled
def conditions(k, c, t, gap, closed):
    """Return (lock, slope, track) of modes.Conditions at t [s].

    closed: True if the loop is closed in autotrack, and the axes follow their commands.
    """
    # unexplained: no keyhole, turn or hidden sector explains the outage; lost: autotrack must end.
    p, unexplained, running = c.p.tracker, not gap.permitted, k.target.tracker.running
    spread_now = spread(k, c, t) if running and unexplained and gap.coasting else 0.0
    lost = not running or (unexplained and coast.over(gap.since, p.coast_time, spread_now, p.receiver.beamwidth))
    if k.divergence.diverged or (closed and divergence.diverges(k.divergence, gap.coasting and unexplained)):
        return Reason.DIVERGED, Reason.DIVERGED, Reason.DIVERGED
    lock = Reason.NONE if tracker.locked(k.target.tracker, p, gap.since) else Reason.NOT_LOCKED
    return lock, Reason.NONE, Reason.SIGNAL_LOST if lost else Reason.NONE


@compiled
def restart(k):
    """Restart the monitors of divergence and slope when a mode begins."""
    divergence.restart(k.divergence)
    slope_sign.restart(k.slope_sign)


@compiled
def spread(k, c, t):
    """Return the standard deviation of the estimate across the line of sight at t [s] [rad]."""
    estimate = target.read(k.target, c.p, c.tracker, k.attitude, t)
    azimuth, elevation = estimate.variances
    return coast.sigma(azimuth.p11, elevation.p11, estimate.motion.elevation.angle)


@compiled
def sight(k, c, t):
    """Return the LineOfSight (ENU) of the estimate at t [s]."""
    return target.earth_outlook(k.target, c.tracker, t)


@compiled
def beam(k, c, t):
    """Return (ENU unit vector along the beam at t [s], rate of the vector: taken as zero)."""
    _, at = encoders.at(k.encoders, t)
    at = model.to_sky(k.pointing.model, at)
    _, deck = attitude.at(k.attitude, c.p, t)
    return rotated(deck.mat, Vector(*pointing.direction(at.A, at.E))), place.ZERO_VECTOR


@compiled
def deck_rates(k, c, t, A, E):
    """Return the rates [rad/s] at which the motion of the deck moves the deck angles of an earth-fixed direction.

    A, E: encoder angles of the direction at t [s], in rad. The rates are 0 if no axis uses them
    (beam.rate_compensation).
    """
    compensated = c.axis[0].p.beam.rate_compensation != 0.0 or c.axis[1].p.beam.rate_compensation != 0.0
    if compensated and k.attitude.stabilised:
        known, deck = attitude.at(k.attitude, c.p, t)
        if known:
            at = model.to_sky(k.pointing.model, encoders.Pointing(A, E, 0.0, 0.0))
            return deck_reference.fixed_rates(deck.w, at.A, at.E)
    return 0.0, 0.0


@compiled
def write_outputs(k, c, t, o):
    """Write the counts of gated measurements and the estimate at t [s] to the outputs.

    The estimate is in earth angles, as seen from the antenna.
    """
    filtered = k.target.tracker
    o.gated, o.rates_gated, o.ranges_gated = filtered.gated, filtered.rates_gated, filtered.ranges_gated
    if filtered.running:
        estimate = target.read(k.target, c.p, c.tracker, k.attitude, t)
        for i in range(2):
            o.estimate[i, 0], o.estimate[i, 1], o.estimate[i, 2] = estimate.motion[i]
            o.covariance[i, 0], o.covariance[i, 1], o.covariance[i, 2] = estimate.variances[i]
        target_filter.probabilities(filtered.filter, c.tracker.filter, o.probability)
