"""An error of the receiver on its way into the target filter: measure, gate, filter, monitor.

The error and the beam at its instant give the direction of the target, in the frame of the filter. A measurement that
differs too much from its prediction is rejected. `correct_error`, `used_error` and `take_error` are called in this
order in each step.
"""
import math
from typing import TYPE_CHECKING, NamedTuple

from acu_tracker import signals
from acu_tracker.estimation import departure, monitors, slope_ratio, target
from acu_tracker.estimation.filters import target_filter
from acu_tracker.estimation.filters.measurement import (
    NO_INNOVATION,
    AxisMeasurement,
    Innovation,
    Measurement,
    attitude_variances,
    error_variance,
    nis,
    with_azimuth_near,
    with_rate,
)
from acu_tracker.estimation.params import ErrorMatrixParameters, ReceiverModelParameters, TrackerParameters
from acu_tracker.estimation.target import Target
from acu_tracker.geometry import attitude, frames, history, lever_arm
from acu_tracker.geometry.azimuth_wrap import MAX_OFFSET_BEAMWIDTHS
from acu_tracker.geometry.frames import Attitude
from acu_tracker.geometry.history import Pointing
from acu_tracker.geometry.vector import ZERO_VECTOR, Rotation, Vector, rotated, rotation
from acu_tracker.pointing import model
from acu_tracker.program.program_track import ProgramTrack
from acu_tracker.signals import Inputs, Outputs
from pedestal_common.compiled import compiled, separate
from pedestal_common.geometry import line_of_sight as pointing
from pedestal_common.quantities import Meters, Radians, RadiansPerSecond, Seconds

if TYPE_CHECKING:
    from acu_tracker.control_unit import Constants
    from acu_tracker.params import SharedParameters
    from acu_tracker.tracking import Tracking

UNKNOWN_POINTING = Pointing(math.nan, math.nan, math.nan, math.nan)  # of the beam, if no error is used

OUTCOME_STARTED, OUTCOME_ACCEPTED, OUTCOME_GATED, OUTCOME_STALE, OUTCOME_NOISY, OUTCOME_NO_ATTITUDE = range(6)
"""Outcomes of a measurement: it starts the filter, is used, is rejected by the gate, is not newer than the last one,
is only noise, has no known attitude of the deck at its instant."""


MAX_RISE_DB = 0.5
"""Largest rise of the C/N0 from error to error that the filter uses [dB]. Errors are means, and after a fade they
hold the noise of the fade for longer than the published C/N0."""


class Loop(NamedTuple):
    """Conditions of the monitors. While a limit holds the beam off the target, both truth values are False."""
    closed: bool    # the loop is closed on the errors (autotrack)
    follows: bool   # the axes follow their commands
    program: ProgramTrack   # where the target is expected


@compiled
def correct_error(matrix: ErrorMatrixParameters, inputs: Inputs) -> None:
    """Multiply the error of a new message of the receiver with the matrix of its calibration. The rates of the error
    come from a tachometer, and stay as they are."""
    if inputs.error_came:
        x, e = inputs.cross_elevation, inputs.elevation
        inputs.cross_elevation, inputs.elevation = matrix.xx * x + matrix.xe * e, matrix.ex * x + matrix.ee * e


@compiled
def used_error(tracking: 'Tracking', constants: 'Constants', inputs: Inputs, by_level: bool,
               offset: Radians) -> tuple[int, bool, Pointing]:
    """Return (flags of the receiver's message, True if its error is used, the Pointing of the beam on the sky at the
    error). by_level, offset: uses_level and intended_offset of _error_at."""
    tracking.error[0] = tracking.error[1] = math.nan
    flags, used, at = _error_at(tracking.encoders, constants.p.tracker.receiver, inputs, by_level, offset)
    used = used and not monitors.take_repetition(tracking.repetition, inputs, at)
    return flags, used, model.to_sky(tracking.pointing.model, at)


@compiled
def _error_at(encoders: history.Encoders, receiver: ReceiverModelParameters, inputs: Inputs, uses_level: bool,
              intended_offset: Radians) -> tuple[int, bool, Pointing]:
    """Return (flags of the receiver's message, True if its error is used, the Pointing of the encoders at the error).

    uses_level: True if the mode uses the signal level; intended_offset: angle by which the beam is off the target on
    purpose, with which no error is used if it is too large.

    The receiver error is a weighted mean of samples; each sample is target minus beam. The mean of the target belongs
    to the instant receiver.age before the stamp of the error, that of the beam to receiver.beam_age before this stamp.
    The two ages may differ, because an electronic beam jumps from step to step (docs/understand/architecture.md). The
    pointing between two steps is interpolated linearly. For an axis of constant rate this is exact, whatever the
    weights are.
    """
    wrong = _wrong_level(encoders, inputs) if uses_level else 0
    if wrong or not inputs.error_valid:
        return wrong, False, UNKNOWN_POINTING
    if not math.isfinite(inputs.cross_elevation + inputs.elevation + inputs.cn0_dbhz):
        return signals.Flag.ERROR, False, UNKNOWN_POINTING
    if intended_offset > MAX_OFFSET_BEAMWIDTHS * receiver.beamwidth:
        return 0, False, UNKNOWN_POINTING
    known, pointing = history.encoders_at(encoders, inputs.error_stamp - receiver.beam_age)
    return 0 if known else signals.Flag.ERROR_STAMP, known, pointing


@compiled
def _wrong_level(encoders: history.Encoders, inputs: Inputs) -> int:
    """Return the flag of a message with an invalid signal level or stamp, else 0. The modes that use the signal level
    use it also while the receiver is not locked."""
    if not inputs.error_came:
        return 0
    if not math.isfinite(inputs.cn0_dbhz):
        return signals.Flag.ERROR
    known, _ = history.encoders_at(encoders, inputs.error_stamp)
    return 0 if known else signals.Flag.ERROR_STAMP


@compiled
def take_error(tracking: 'Tracking', constants: 'Constants', inputs: Inputs, outputs: Outputs, at: Pointing,
               restart_gap: Seconds, loop: Loop) -> int:
    """Filter an error of the receiver and run the monitors. Return a flag if the error is not accepted, else 0.

    at: the beam when the error was measured; restart_gap: time without accepted errors after which the filter
    restarts.
    """
    receiver, params = constants.p.tracker.receiver, constants.p.tracker
    measured = pointing.displaced(at.A, at.E, inputs.cross_elevation, inputs.elevation)
    tracking.error[0], tracking.error[1] = measured[0] - at.A, measured[1] - at.E
    risen = tracking.cn0 + MAX_RISE_DB if tracking.target.running else math.inf
    tracking.cn0 = min(inputs.cn0_dbhz, risen)
    outcome, innovation = OUTCOME_NO_ATTITUDE, NO_INNOVATION
    known, deck = attitude.at(tracking.attitude, constants.p, inputs.error_stamp - receiver.age)
    if known:
        measurement = _measure(tracking, constants, inputs, at, measured, deck)
        # gap: time without errors before this one and the gated ones before it.
        gap = measurement.stamp - tracking.target.stamp - tracking.target.gated_in_a_row * constants.p.period
        counts = loop.follows and gap <= params.coast_after
        if gap > params.coast_after:
            monitors.restart_growth(tracking.divergence)
        outcome, innovation = gate(tracking.target, params, constants.target, measurement, restart_gap)
        if outcome != OUTCOME_STALE:
            _follow_with_frame(tracking.target, constants.target)
        if outcome != OUTCOME_NOISY and counts:
            monitors.take_divergence(tracking.divergence, innovation, measurement, tracking.target.roughness.q)
    departure.take_level(tracking.departure, tracking.target, constants, loop.program, loop.closed and loop.follows,
                         inputs.error_stamp, inputs.cn0_dbhz)
    if loop.closed and known and monitors.shows_slope(inputs, receiver.beamwidth):
        _watch_slope(tracking, constants, inputs, at, deck.mat, loop.program)
    return _write_innovation(outputs, outcome, innovation)


@compiled
def _measure(tracking: 'Tracking', constants: 'Constants', inputs: Inputs, at: Pointing,
             measured: tuple[Radians, Radians], now: Attitude) -> Measurement:
    """Return the Measurement of an error. Also set the random walk that the filter assumes for it. at, now: antenna
    and attitude of the deck when the error was measured; measured: deck angles of the target."""
    state, deck, params = tracking.target, tracking.attitude, constants.p.tracker
    azimuth, elevation = _measured_direction(state, constants.p, now.mat,
                                             inputs.range if deck.stabilised else math.nan, measured)
    azimuth_rate, elevation_rate = math.nan, math.nan
    if math.isfinite(inputs.error_rate[0] + inputs.error_rate[1] + inputs.error_rate_sigma):
        azimuth_rate, elevation_rate = _measured_rates(state, now, inputs, at)
    # R_cross, R_elevation: variances of the measured direction in cross-elevation and elevation [rad2].
    R_cross = R_elevation = error_variance(inputs.cross_elevation, inputs.elevation, tracking.cn0, params.receiver)
    cos_el = max(math.cos(elevation), 0.01)     # This avoids a division by zero at the zenith.
    # walk_cross, walk_elevation: growth of these variances by the random walk of the attitude error [rad2/s].
    walk_cross = walk_elevation = 0.0
    if deck.stabilised:
        verticals = frames.verticals(state.frame, azimuth, elevation)
        noise, walk = attitude.expected_error(deck.error, params.attitude)
        cross, along = attitude_variances(verticals, *noise)
        R_cross, R_elevation = R_cross + cross, R_elevation + along
        walk_cross, walk_elevation = attitude_variances(verticals, *walk)
    target_filter.walk(state.filter, walk_cross / (cos_el * cos_el), walk_elevation)
    R_rate = inputs.error_rate_sigma * inputs.error_rate_sigma
    axis = (AxisMeasurement(azimuth, R_cross / (cos_el * cos_el), azimuth_rate, R_rate / (cos_el * cos_el)),
            AxisMeasurement(elevation, R_elevation, elevation_rate, R_rate))
    return Measurement(inputs.error_stamp - params.receiver.age, axis, inputs.range, inputs.range_variance)


@compiled
def _measured_direction(state: Target, params: 'SharedParameters', mat_ed: Rotation, distance: Meters,
                        measured: tuple[Radians, Radians]) -> tuple[Radians, Radians]:
    """Return (azimuth, elevation) in the frame of the filter of a direction `measured` in deck angles; distance:
    range, NaN without one. For a filter that does not run yet the frame is laid at this direction first."""
    x, y, z = pointing.direction(*measured)
    v = lever_arm.from_ins(state.lever_arm, params.lever_arm, distance, state.running, Vector(x, y, z))
    v = rotated(mat_ed, v)
    azimuth, elevation = pointing.earth_angles(v.x, v.y, v.z)
    if not state.running:
        e, n, u = pointing.earth_direction(azimuth, elevation)
        frames.lay(state.frame, Vector(e, n, u), ZERO_VECTOR)
    return frames.direction_to_frame(state.frame, azimuth, elevation)


@compiled
def _measured_rates(state: Target, deck: Attitude, inputs: Inputs,
                    at: Pointing) -> tuple[RadiansPerSecond, RadiansPerSecond]:
    """Return (azimuth rate, elevation rate) of the target in the frame of the filter. They are the sum of the rates of
    the antenna and of the receiver error; deck, at: when the error was measured."""
    n = pointing.displaced_motion(at.A, at.E, at.dA, at.dE, inputs.cross_elevation, inputs.elevation,
                                  inputs.error_rate[0], inputs.error_rate[1])
    v, dv = lever_arm.to_ins(state.lever_arm, Vector(n[0], n[1], n[2]), Vector(n[3], n[4], n[5]))
    return frames.earth_rates(frames.of_deck(state.frame, deck), v, dv)


@separate
def gate(state: Target, params: TrackerParameters, constants: target.Constants, measurement: Measurement,
         restart_gap: Seconds) -> tuple[int, Innovation]:
    """Filter a measurement. Return (its outcome, the innovation, of NaN if nothing was predicted).

    Errors that are only noise (monitors.Roughness) are ignored. The range, the two angles together, and each rate have
    their own gates. The filter restarts after gate_restart consecutive gated directions, or after restart_gap without
    an accepted one.
    """
    # T: time since the last accepted measurement [s]; f, k: state and constants of the filter.
    T = measurement.stamp - state.stamp
    if state.running and T <= 0.0:
        return OUTCOME_STALE, NO_INNOVATION
    f, k = state.filter, constants.filter
    measurement = target_filter.usable(k, measurement)
    outcome, innovation = OUTCOME_STARTED, NO_INNOVATION
    if state.running and T <= restart_gap:
        target_filter.predict(f, k, T)
        measurement = with_azimuth_near(measurement, target_filter.axes_azimuth(f))
        innovation = target_filter.innovation(f, k, measurement)
        if monitors.take_roughness(state.roughness, innovation, measurement) > params.gate:
            state.gated += 1
            state.accepted_in_a_row = state.rates_in_a_row[0] = state.rates_in_a_row[1] = 0
            return OUTCOME_NOISY, innovation
        if innovation.range_nu * innovation.range_nu > constants.gates[1] * innovation.range_S:
            state.ranges_gated += 1
            measurement = Measurement(measurement.stamp, measurement.axis, math.nan, measurement.range_variance)
        if _distance(innovation, measurement, constants.gate_floor) <= constants.gates[0]:
            measurement = _with_accepted_rates(state, params, constants, measurement, innovation)
            target_filter.correct(f, k, measurement)
            outcome = OUTCOME_ACCEPTED
        else:
            state.gated += 1
            if state.gated_in_a_row + 1 < params.gate_restart:
                state.gated_in_a_row += 1
                state.accepted_in_a_row = state.rates_in_a_row[0] = state.rates_in_a_row[1] = 0
                return OUTCOME_GATED, innovation
    if outcome == OUTCOME_STARTED:
        near = target.outlook(state, constants, state.stamp).azimuth.angle if state.running else math.nan
        near = near if math.isfinite(near) else measurement.axis[0].angle
        target_filter.start(f, k, with_azimuth_near(measurement, near), params.initial_rate)
        monitors.restart_roughness(state.roughness)
        state.accepted_in_a_row = state.rates_in_a_row[0] = state.rates_in_a_row[1] = 0
    state.running, state.stamp, state.gated_in_a_row = 1, measurement.stamp, 0
    target_filter.select(f, k, measurement)
    state.accepted_in_a_row = 1 if T > params.coast_after else state.accepted_in_a_row + 1
    state.converged = _converged(f, k, measurement, params.initial_rate)
    return outcome, innovation


@compiled
def _distance(innovation: Innovation, measurement: Measurement, floor: Radians) -> float:
    """Return nu' S^-1 nu of the two angles [-], with the variance floor^2 added to each S across the line of sight."""
    azimuth, elevation = innovation.axis
    added = floor * floor
    stretch = measurement.axis[0].variance / measurement.axis[1].variance   # ashore 1 / cos^2 of the elevation
    return (azimuth.nu * azimuth.nu / (azimuth.S + added * stretch)
            + elevation.nu * elevation.nu / (elevation.S + added))


@compiled
def _accepted_rate(state: Target, params: TrackerParameters, constants: target.Constants, i: int,
                   rate: RadiansPerSecond, chi_square: float) -> RadiansPerSecond:
    """Return the measured rate of axis i if it is accepted, else NaN.

    chi_square: squared innovation of the rate over its variance, after the angle was used. Only a rate that is
    estimated from angles alone can show that a measured rate is wrong. Therefore a measured rate is used only after
    lock_count consecutive measured rates have agreed with the estimated rate. This avoids a new filter that follows a
    stuck or biased sensor.
    """
    if math.isnan(chi_square):
        return math.nan
    if chi_square > constants.gates[1]:
        state.rates_gated += 1
        state.rates_in_a_row[i] = 0
        return math.nan
    state.rates_in_a_row[i] += 1
    return rate if state.rates_in_a_row[i] > params.lock_count else math.nan


@compiled
def _with_accepted_rates(state: Target, params: TrackerParameters, constants: target.Constants,
                         measurement: Measurement, innovation: Innovation) -> Measurement:
    (a, e), (i_a, i_e) = measurement.axis, innovation.axis
    a = with_rate(a, _accepted_rate(state, params, constants, 0, a.rate, i_a.rate_chi_square))
    e = with_rate(e, _accepted_rate(state, params, constants, 1, e.rate, i_e.rate_chi_square))
    return Measurement(measurement.stamp, (a, e), measurement.range, measurement.range_variance)


@compiled
def _converged(state: target_filter.Filter, constants: target_filter.Constants, measurement: Measurement,
               initial_rate: RadiansPerSecond) -> bool:
    """Return True if the standard deviation of the rates across the line of sight is below a quarter of initial_rate.

    initial_rate: standard deviation of the rates at the start. The angle is no criterion, because a filter of high
    bandwidth never estimates it much better than it is measured. The ratio of the measured variances converts the
    azimuth rate to a rate across the line of sight.
    """
    azimuth, elevation = target_filter.read_corrected(state, constants).variances
    known = (0.25 * initial_rate)**2
    return azimuth.p22 * measurement.axis[1].variance < known * measurement.axis[0].variance and elevation.p22 < known


@compiled
def _follow_with_frame(state: Target, constants: target.Constants) -> None:
    """Lay the frame along the motion of a target that is too far off its equator, and turn the filter with it."""
    motion = target.outlook(state, constants, state.stamp)
    if abs(motion.elevation.angle) <= frames.MAX_FRAME_ELEVATION_RAD:
        return
    before, sight = rotation(state.frame.mat), frames.to_earth(state.frame, motion)
    frames.lay(state.frame, sight.u, sight.du)
    target_filter.turn(state.filter, constants.filter, frames.from_earth(state.frame, before))


@compiled
def _watch_slope(tracking: 'Tracking', constants: 'Constants', inputs: Inputs, at: Pointing,
                 mat_ed: Rotation, program: ProgramTrack) -> None:
    """Test the slope with an error and its beam; latch the divergence if the slope is wrong."""
    params = constants.p.tracker
    error, beam = (inputs.cross_elevation, inputs.elevation), monitors.slope_beam(mat_ed, at.A, at.E)
    variance = error_variance(inputs.cross_elevation, inputs.elevation, inputs.cn0_dbhz, params.receiver)
    leaving = monitors.leaving_error(tracking.divergence, params.receiver.beamwidth)
    wrong = monitors.take_slope(tracking.wrong_slope, inputs.error_stamp - params.receiver.age, beam, error, variance,
                                params.coast_after, leaving)
    if params.keeps_program and constants.target.rigid and monitors.full(tracking.wrong_slope):
        walk = 0.0
        if tracking.attitude.stabilised:
            _, (tilt, heading) = attitude.expected_error(tracking.attitude.error, params.attitude)
            walk = tilt + heading * (beam.u.x * beam.u.x + beam.u.y * beam.u.y)
        wrong = slope_ratio.take(tracking.slope_ratio, tracking.wrong_slope, beam, program, walk,
                                 params.coast_after) or wrong
    if wrong:
        monitors.latch_divergence(tracking.divergence)


@compiled
def _write_innovation(outputs: Outputs, outcome: int, innovation: Innovation) -> int:
    """Write the Innovation of an error to the outputs. Return the flag of the outcome, 0 for an accepted error."""
    for i in range(2):
        axis = innovation.axis[i]
        outputs.innovation[i], outputs.rate_innovation[i], outputs.nis[i] = axis.nu, axis.rate, nis(axis)
        outputs.innovation_sigma[i] = math.nan if math.isnan(outputs.nis[0]) else math.sqrt(axis.S)
    if outcome == OUTCOME_NO_ATTITUDE:
        return signals.Flag.ATTITUDE
    if outcome == OUTCOME_STALE:
        return signals.Flag.ERROR_STAMP
    if outcome == OUTCOME_NOISY:
        return signals.Flag.ERROR_NOISY
    return signals.Flag.ERROR_GATED if outcome == OUTCOME_GATED else 0
