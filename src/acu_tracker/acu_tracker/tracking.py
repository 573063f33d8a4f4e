"""Tracking of the target by the receiver: histories of beam and deck, target filter, and monitors of the errors."""
import math
from typing import TYPE_CHECKING

from acu_tracker import signals
from acu_tracker.estimation import departure, monitors, slope_ratio, target
from acu_tracker.estimation.filters import target_filter
from acu_tracker.geometry import attitude, frames, history
from acu_tracker.geometry.vector import ZERO_VECTOR, Vector, rotated
from acu_tracker.modes import Reason
from acu_tracker.pointing import model
from acu_tracker.pointing.params import PointingParameters
from acu_tracker.program.program_track import ProgramTrack
from acu_tracker.signals import Inputs, Outputs
from pedestal_common.compiled import compiled
from pedestal_common.geometry import line_of_sight as pointing
from pedestal_common.quantities import DecibelHertz, Pair, Radians, Radians2, RadiansPerSecond, Records, Seconds
from pedestal_common.record import Record

if TYPE_CHECKING:
    from acu_tracker.control_unit import Constants
    from acu_tracker.mode.interruptions import Outage
    from acu_tracker.params import SharedParameters


class Tracking(Record):
    """State of the tracking."""
    encoders: history.Encoders         # history of the encoder angles
    pointing: model.PointingRecord      # pointing model in force, between encoder angles and directions
    attitude: attitude.DeckAttitude     # history of the deck
    target: target.Target               # target filter
    error: Pair     # receiver error of this step, in deck angles [rad]; NaN: no error
    cn0: DecibelHertz   # of the last error, as the filter takes it
    # monitors of the errors
    repetition: monitors.Repetition
    divergence: monitors.Divergence
    wrong_slope: monitors.WrongSlope
    slope_ratio: slope_ratio.SlopeRatio
    departure: departure.Departure


def initialise(tracking: Records, pointing: PointingParameters) -> None:
    """Begin without an estimate."""
    target.initialise(tracking['target'])
    departure.initialise(tracking['departure'])
    model.initialise(tracking['pointing'][0], pointing.terms, pointing.named)


@compiled
def take_place(tracking: Tracking, inputs: Inputs) -> bool:
    """Note whether the pedestal stands on a ship. Return True if that has changed; the estimate then ends."""
    another = attitude.put(tracking.attitude, inputs.stabilised)
    if another:
        target.stop(tracking.target)
    return another


@compiled
def take_encoders(encoders: history.Encoders, inputs: Inputs) -> int:
    """Take the encoder angles of this step. Return signals.Flag.ENCODER if they are invalid, else 0."""
    taken = inputs.encoder_valid and history.take_encoders(encoders, inputs.stamp, inputs.position, inputs.velocity)
    return 0 if taken else signals.Flag.ENCODER


@compiled
def take_attitude(deck: attitude.DeckAttitude, params: 'SharedParameters', inputs: Inputs) -> tuple[int, bool]:
    """Take the attitude of this step, and the statistics of its error that the INS publishes. Return (flags of invalid
    values, True if the attitude is a new one)."""
    if not inputs.stabilised:
        return 0, False
    flags = 0
    if inputs.attitude_error_came and not attitude.take_statistics(deck.error, inputs.attitude_noise,
                                                                   inputs.attitude_walk):
        flags = signals.Flag.ATTITUDE_ERROR
    if not inputs.attitude_valid:
        return flags | signals.Flag.ATTITUDE, False
    outcome = attitude.take(deck, params, inputs.stamp, inputs.attitude_stamp, inputs.quaternion, inputs.deck_rate,
                            inputs.aligning)
    return flags | (signals.Flag.ATTITUDE if outcome == attitude.SAMPLE_INVALID else 0), outcome == attitude.SAMPLE_NEW


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
def conditions(tracking: Tracking, constants: 'Constants', t: Seconds, gap: 'Outage', closed: bool,
               program: ProgramTrack) -> tuple[int, int, int]:
    """Return (lock, slope, track) of modes.Conditions at t. closed: True if the loop is closed in autotrack, and the
    axes follow their commands; program: where the target is expected."""
    # unexplained: no keyhole, turn or hidden sector explains the outage; lost: autotrack must end.
    p, unexplained, running = constants.p.tracker, not gap.permitted, tracking.target.running
    lost = not running or (unexplained and gap.since > p.coast_time)
    departed = False
    if running and unexplained and gap.coasting:
        lost |= leaves_beam(spread(tracking, constants, t),
                            departure.in_coast(tracking.target, constants, program, t), p.receiver.beamwidth)
    elif running and unexplained and closed:
        departed = departure.departed(tracking.departure, tracking.target, constants, program, t)
    if tracking.divergence.diverged or (
            closed and monitors.diverges(tracking.divergence, departed or (gap.coasting and unexplained))):
        return Reason.DIVERGED, Reason.DIVERGED, Reason.DIVERGED
    lock = Reason.NONE if target.locked(tracking.target, p, gap.since) else Reason.NOT_LOCKED
    return lock, Reason.NONE, Reason.DEPARTED if departed else Reason.SIGNAL_LOST if lost else Reason.NONE


@compiled
def end(tracking: Tracking, t: Seconds, reason: int) -> None:
    """End autotrack at t. reason: why the target was lost, or Reason.NONE. Discard the estimate of a lost target, and
    latch the divergence if autotrack has departed from the program repeatedly."""
    if reason != Reason.NONE:
        target.stop(tracking.target)
    if departure.note_end(tracking.departure, t, reason == Reason.DEPARTED):
        monitors.latch_divergence(tracking.divergence)


@compiled
def release(tracking: Tracking) -> None:
    """Reset the latched divergence."""
    departure.release(tracking.departure)
    monitors.release_divergence(tracking.divergence)


@compiled
def restart(tracking: Tracking, t: Seconds) -> None:
    """Restart the monitors of divergence, slope and departure when a mode begins at t."""
    departure.restart(tracking.departure, t)
    monitors.restart_divergence(tracking.divergence)
    monitors.restart_slope(tracking.wrong_slope)
    slope_ratio.restart(tracking.slope_ratio)


@compiled
def spread(tracking: Tracking, constants: 'Constants', t: Seconds) -> Radians:
    """Return the standard deviation of the estimate across the line of sight at t."""
    estimate = target.read(tracking.target, constants.p, constants.target, tracking.attitude, t)
    azimuth, elevation = estimate.variances
    return sigma_across(azimuth.p11, elevation.p11, estimate.motion.elevation.angle)


@compiled
def sigma_across(azimuth_variance: Radians2, elevation_variance: Radians2, elevation: Radians) -> Radians:
    """Return the larger of the two standard deviations across the line of sight: cross-elevation and elevation."""
    c = math.cos(elevation)
    return math.sqrt(max(azimuth_variance * c * c, elevation_variance))


@compiled
def leaves_beam(sigma: Radians, departed: Radians, beamwidth: Radians) -> bool:
    """Return True if a coast has become useless: sigma of the estimate is above half a beamwidth, or the estimate has
    departed from the program by more than departure.MAX_OFFSET_BEAMWIDTHS."""
    return sigma > 0.5 * beamwidth or departed > departure.MAX_OFFSET_BEAMWIDTHS * beamwidth


@compiled
def beam(tracking: Tracking, constants: 'Constants', t: Seconds) -> tuple[Vector, Vector]:
    """Return (ENU unit vector along the beam at t, rate of the vector: taken as zero)."""
    _, at = history.encoders_at(tracking.encoders, t)
    at = model.to_sky(tracking.pointing.model, at)
    _, deck = attitude.at(tracking.attitude, constants.p, t)
    return rotated(deck.mat, Vector(*pointing.direction(at.A, at.E))), ZERO_VECTOR


@compiled
def deck_rates(tracking: Tracking, constants: 'Constants', t: Seconds, A: Radians,
               E: Radians) -> tuple[RadiansPerSecond, RadiansPerSecond]:
    """Return the rates at which the motion of the deck moves the deck angles of an earth-fixed direction at t; 0 if no
    axis uses them (beam.rate_compensation). A, E: encoder angles of the direction."""
    azimuth, elevation = constants.axis[0].p.beam, constants.axis[1].p.beam
    compensated = azimuth.rate_compensation != 0.0 or elevation.rate_compensation != 0.0
    if compensated and tracking.attitude.stabilised:
        known, deck = attitude.at(tracking.attitude, constants.p, t)
        if known:
            at = model.to_sky(tracking.pointing.model, history.Pointing(A, E, 0.0, 0.0))
            return frames.fixed_rates(deck.w, at.A, at.E)
    return 0.0, 0.0


@compiled
def write_outputs(tracking: Tracking, constants: 'Constants', t: Seconds, outputs: Outputs) -> None:
    """Write the counts of gated measurements and the estimate at t, in earth angles as seen from the antenna."""
    filtered = tracking.target
    outputs.gated, outputs.rates_gated = filtered.gated, filtered.rates_gated
    outputs.ranges_gated = filtered.ranges_gated
    if filtered.running:
        estimate = target.read(tracking.target, constants.p, constants.target, tracking.attitude, t)
        for i in range(2):
            outputs.estimate[i, 0], outputs.estimate[i, 1], outputs.estimate[i, 2] = estimate.motion[i]
            outputs.covariance[i, 0], outputs.covariance[i, 1], outputs.covariance[i, 2] = estimate.variances[i]
        target_filter.probabilities(filtered.filter, constants.target.filter, outputs.probability)
