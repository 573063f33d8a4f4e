"""Tracking of the target by the receiver: histories of beam and deck, target filter, and monitors of the errors.

`control_unit` and `guidance` call this module. The functions take each error of the receiver, and return the estimate
of the target and the conditions for autotrack. `gap` is the time without a signal of the receiver.
"""
import math
from typing import TYPE_CHECKING

from acu_tracker import measurements
from acu_tracker.estimation import divergence, repetition, slope_sign, target, tracker
from acu_tracker.estimation.filters import measurement, target_filter
from acu_tracker.geometry import attitude, deck_reference, encoders
from acu_tracker.geometry.motion import LineOfSight
from acu_tracker.geometry.vector import Vector, rotated
from acu_tracker.modes import Reason
from acu_tracker.pointing import model
from acu_tracker.pointing.params import PointingParameters
from acu_tracker.search import coast, place
from acu_tracker.signals import Inputs, Outputs
from pedestal_common.compiled import compiled
from pedestal_common.geometry import line_of_sight as pointing
from pedestal_common.quantities import Pair, Radians, RadiansPerSecond, Records, Seconds
from pedestal_common.record import Record

if TYPE_CHECKING:
    from acu_tracker.control_unit import Constants
    from acu_tracker.mode.outage import Outage


class Tracking(Record):
    """State of the tracking."""
    encoders: encoders.Encoders         # history of the encoder angles
    pointing: model.PointingRecord      # pointing model in force, between encoder angles and directions
    attitude: attitude.DeckAttitude     # history of the deck
    target: target.Target               # target filter
    error: Pair     # receiver error of this step, in deck angles [rad]; NaN: no error
    # monitors of the errors
    repetition: repetition.Repetition
    divergence: divergence.Divergence
    slope_sign: slope_sign.SlopeSign


def initialise(tracking: Records, pointing: PointingParameters) -> None:
    """Begin without an estimate."""
    target.initialise(tracking['target'])
    model.initialise(tracking['pointing'][0], pointing.terms, pointing.named)


@compiled
def take_place(tracking: Tracking, inputs: Inputs) -> bool:
    """Note whether the pedestal stands on a ship. Return True if that has changed; the estimate then ends."""
    another = attitude.put(tracking.attitude, inputs.stabilised)
    if another:
        tracker.stop(tracking.target.tracker)
    return another


@compiled
def used_error(tracking: Tracking, constants: 'Constants', inputs: Inputs, by_level: bool,
               offset: Radians) -> tuple[int, bool, encoders.Pointing]:
    """Return (flags of the receiver's message, True if its error is used, the Pointing of the beam at the error).

    The Pointing is on the sky. A repeated error is not used. by_level, offset: uses_level and intended_offset of
    measurements.error_at.
    """
    tracking.error[0] = tracking.error[1] = math.nan
    flags, used, at = measurements.error_at(tracking.encoders, constants.p.tracker.receiver, inputs, by_level, offset)
    used = used and not repetition.take(tracking.repetition, inputs, at)
    return flags, used, model.to_sky(tracking.pointing.model, at)


@compiled
def take_error(tracking: Tracking, constants: 'Constants', inputs: Inputs, outputs: Outputs, at: encoders.Pointing,
               restart_gap: Seconds, closed: bool, follows: bool) -> int:
    """Filter an error of the receiver and run the monitors. Return a flag if the error is not accepted, else 0.

    The filter receives the direction of the beam when the error was measured, displaced by the error.

    at           the beam when the error was measured
    restart_gap  time without accepted errors after which the filter restarts
    closed       True if the loop is closed on the errors (autotrack), and no limit holds the beam off the target
    follows      True if the axes follow their commands, and no limit holds the beam off the target
    """
    receiver = constants.p.tracker.receiver
    measured = pointing.displaced(at.A, at.E, inputs.cross_elevation, inputs.elevation)
    tracking.error[0], tracking.error[1] = measured[0] - at.A, measured[1] - at.E
    outcome, innovation = target.take(tracking.target, constants.p, constants.tracker, tracking.attitude, inputs, at,
                                      measured, restart_gap)
    if outcome != target.OUTCOME_NOISY and follows:
        divergence.take(tracking.divergence, innovation)
    if closed and outcome != target.OUTCOME_NO_ATTITUDE and slope_sign.near(inputs, receiver.beamwidth):
        _watch_slope(tracking, constants, inputs, at)
    return measurements.write_innovation(outputs, outcome, innovation)


@compiled
def _watch_slope(tracking: Tracking, constants: 'Constants', inputs: Inputs, at: encoders.Pointing) -> None:
    """Test the sign of the slope with an error, and latch the divergence if the sign is reversed.

    at: the beam when the error was measured.
    """
    p = constants.p.tracker
    t = inputs.error_stamp - p.receiver.age
    _, deck = attitude.at(tracking.attitude, constants.p, t)
    error, beam = (inputs.cross_elevation, inputs.elevation), slope_sign.beam(deck.mat, at.A, at.E)
    variance = measurement.error_variance(inputs.cross_elevation, inputs.elevation, inputs.cn0_dbhz, p.receiver)
    if slope_sign.take(tracking.slope_sign, t, beam, error, variance, p.coast_after):
        divergence.latch(tracking.divergence)


@compiled
def unstable(tracking: Tracking, constants: 'Constants', inputs: Inputs, t: Seconds) -> int:
    """Return Reason.NONE, or why the attitude of the deck is not known at the time when the command of t acts."""
    if not tracking.attitude.stabilised:
        return Reason.NONE
    # Before the first attitude the state of the INS may not have arrived; the reason is then ATTITUDE_INVALID.
    if inputs.aligning and tracking.attitude.history.count > 0:
        return Reason.INS_ALIGNING
    known, _ = attitude.at(tracking.attitude, constants.p, t + constants.lead)
    return Reason.NONE if known else Reason.ATTITUDE_INVALID


@compiled
def conditions(tracking: Tracking, constants: 'Constants', t: Seconds, gap: 'Outage',
               closed: bool) -> tuple[int, int, int]:
    """Return (lock, slope, track) of modes.Conditions at t.

    closed: True if the loop is closed in autotrack, and the axes follow their commands.
    """
    # unexplained: no keyhole, turn or hidden sector explains the outage; lost: autotrack must end.
    p, unexplained, running = constants.p.tracker, not gap.permitted, tracking.target.tracker.running
    spread_now = spread(tracking, constants, t) if running and unexplained and gap.coasting else 0.0
    lost = not running or (unexplained and coast.over(gap.since, p.coast_time, spread_now, p.receiver.beamwidth))
    if tracking.divergence.diverged or (
            closed and divergence.diverges(tracking.divergence, gap.coasting and unexplained)):
        return Reason.DIVERGED, Reason.DIVERGED, Reason.DIVERGED
    lock = Reason.NONE if tracker.locked(tracking.target.tracker, p, gap.since) else Reason.NOT_LOCKED
    return lock, Reason.NONE, Reason.SIGNAL_LOST if lost else Reason.NONE


@compiled
def restart(tracking: Tracking) -> None:
    """Restart the monitors of divergence and slope when a mode begins."""
    divergence.restart(tracking.divergence)
    slope_sign.restart(tracking.slope_sign)


@compiled
def spread(tracking: Tracking, constants: 'Constants', t: Seconds) -> Radians:
    """Return the standard deviation of the estimate across the line of sight at t."""
    estimate = target.read(tracking.target, constants.p, constants.tracker, tracking.attitude, t)
    azimuth, elevation = estimate.variances
    return coast.sigma(azimuth.p11, elevation.p11, estimate.motion.elevation.angle)


@compiled
def sight(tracking: Tracking, constants: 'Constants', t: Seconds) -> LineOfSight:
    """Return the line of sight (ENU) of the estimate at t."""
    return target.earth_outlook(tracking.target, constants.tracker, t)


@compiled
def beam(tracking: Tracking, constants: 'Constants', t: Seconds) -> tuple[Vector, Vector]:
    """Return (ENU unit vector along the beam at t, rate of the vector: taken as zero)."""
    _, at = encoders.at(tracking.encoders, t)
    at = model.to_sky(tracking.pointing.model, at)
    _, deck = attitude.at(tracking.attitude, constants.p, t)
    return rotated(deck.mat, Vector(*pointing.direction(at.A, at.E))), place.ZERO_VECTOR


@compiled
def deck_rates(tracking: Tracking, constants: 'Constants', t: Seconds, A: Radians,
               E: Radians) -> tuple[RadiansPerSecond, RadiansPerSecond]:
    """Return the rates at which the motion of the deck moves the deck angles of an earth-fixed direction.

    A, E: encoder angles of the direction at t. The rates are 0 if no axis uses them
    (beam.rate_compensation).
    """
    azimuth, elevation = constants.axis[0].p.beam, constants.axis[1].p.beam
    compensated = azimuth.rate_compensation != 0.0 or elevation.rate_compensation != 0.0
    if compensated and tracking.attitude.stabilised:
        known, deck = attitude.at(tracking.attitude, constants.p, t)
        if known:
            at = model.to_sky(tracking.pointing.model, encoders.Pointing(A, E, 0.0, 0.0))
            return deck_reference.fixed_rates(deck.w, at.A, at.E)
    return 0.0, 0.0


@compiled
def write_outputs(tracking: Tracking, constants: 'Constants', t: Seconds, outputs: Outputs) -> None:
    """Write the counts of gated measurements and the estimate at t to the outputs.

    The estimate is in earth angles, as seen from the antenna.
    """
    filtered = tracking.target.tracker
    outputs.gated, outputs.rates_gated = filtered.gated, filtered.rates_gated
    outputs.ranges_gated = filtered.ranges_gated
    if filtered.running:
        estimate = target.read(tracking.target, constants.p, constants.tracker, tracking.attitude, t)
        for i in range(2):
            outputs.estimate[i, 0], outputs.estimate[i, 1], outputs.estimate[i, 2] = estimate.motion[i]
            outputs.covariance[i, 0], outputs.covariance[i, 1], outputs.covariance[i, 2] = estimate.variances[i]
        target_filter.probabilities(filtered.filter, constants.tracker.filter, outputs.probability)
