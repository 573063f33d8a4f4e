"""Table of the results of a run, such as the rms pointing error: for each its name, unit, definition and measurement.

The printed tables, the --json rows, the report and the documentation are generated from this table. A result is
measured on one part of the data of a run, and has no value without that part:
tracking    tracking.Tracking
motors      tracking.Tracking of a drive with motors, not of an array
encoders    tracking.Tracking of a bag that holds the true direction of the dish beside the encoders
filter      consistency.Consistency
receiver    the same Tracking, of a recording without the true target
keyholes    the slews through a keyhole, of tracking.keyholes
isolation   isolation.Isolation
attitude    known_attitude.KnownAttitude
run         pedestal_bringup.graph.start.Outcome
supervised  the same Outcome, of a run in realtime
MODE        pointing errors of mode_pointing.read in this mode, one of its FOLLOWED_DIRECTIONS
"Both axes together" pools the samples of both axes; the result is not the angle between beam and target.
"""
import itertools
import math
import typing
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TypeAlias

from pedestal_common.quantities import Row
from pedestal_results import intervals, mode_pointing, sensor_frame, tracking
from pedestal_results.tracking import DEG_PER_RAD, known_rms, largest

Values: TypeAlias = dict[str, tuple[float, str]]    # {name of a result: (value, unit)}


class Result(typing.NamedTuple):
    """A result: a row of the table RESULTS."""
    name: str
    unit: str   # of the value
    part: str   # name of the part of the data on which the result is measured, see the module
    measure: Callable[..., float]   # measure(part) -> value, NaN if not measured
    sentence: str   # definition of the result
    label: str = ''     # name in the report, '' if the report does not show the result
    target: str | None = None   # text of an intervals.Target, such as '<= 0.4'
    mark: Callable[..., str] = lambda part: ''  # mark(part) -> note on a value that is not as expected, else ''
    brief: bool = False     # True for a result that a run prints by default


BRIEF_COUNT = 8  # number of results that a run prints by default

ENCODER_DEFINITION = 'This result includes all errors between dish and encoders, such as the bend.'
"""Sentence in the definitions of the results by the encoders."""


def _of_mode(mode: str) -> tuple[Result, Result]:
    against = f'{mode_pointing.FOLLOWED_DIRECTIONS[mode]} minus true beam'
    return (Result(f'{mode}_pointing_rms_deg', 'deg', mode, known_rms,
                   f'Rms of the true pointing error ({against}), both axes together, in settled `{mode}`.'),
            Result(f'{mode}_pointing_max_deg', 'deg', mode, largest,
                   f'Largest true pointing error ({against}) of either axis in settled `{mode}`.'))


RESULTS = (
    Result('azimuth_following_rms_deg', 'deg', 'motors', lambda run: known_rms(run.following[:, 0]),
           'Rms following error (reference minus encoder) in azimuth, over all steps outside standby.'),
    Result('azimuth_following_max_deg', 'deg', 'motors', lambda run: largest(run.following[:, 0]),
           'Largest following error (reference minus encoder) in azimuth, over all steps outside standby.'),
    Result('elevation_following_rms_deg', 'deg', 'motors', lambda run: known_rms(run.following[:, 1]),
           'Rms following error (reference minus encoder) in elevation, over all steps outside standby.'),
    Result('elevation_following_max_deg', 'deg', 'motors', lambda run: largest(run.following[:, 1]),
           'Largest following error (reference minus encoder) in elevation, over all steps outside standby.'),
    Result('pointing_rms_deg', 'deg', 'tracking', lambda run: run.pointing(known_rms),
           'Rms of the true pointing error (true target minus true beam), both axes together, in settled autotrack.',
           brief=True),
    Result('pointing_max_deg', 'deg', 'tracking', lambda run: run.pointing(largest),
           'Largest true pointing error of either axis in settled autotrack.', brief=True),
    Result('pointing_loss_mean_db', 'dB', 'tracking', lambda run: run.mean_power_loss,
           'Loss of the mean received power by the true pointing error, from the pattern of the beam, in settled '
           'autotrack.', 'loss of the mean received power by the pointing error', brief=True),
    Result('pointing_loss_max_db', 'dB', 'tracking', lambda run: run.max_power_loss,
           'Largest loss of received power by the true pointing error, from the pattern of the beam, in settled '
           'autotrack.', 'largest loss of received power by the pointing error', brief=True),
    Result('measured_pointing_rms_deg', 'deg', 'receiver',
           lambda run: known_rms(run.measured[run.tracking]) * DEG_PER_RAD,
           'Rms of the angle error that the receiver measured, both axes together, in settled autotrack of a run '
           'without a true target.', 'pointing error that the receiver measured, rms', brief=True),
    Result('measured_pointing_max_deg', 'deg', 'receiver',
           lambda run: largest(run.measured[run.tracking]) * DEG_PER_RAD,
           'Largest angle error that the receiver measured on either axis, in settled autotrack of a run without a '
           'true target.', 'pointing error that the receiver measured, largest', brief=True),
    *itertools.chain.from_iterable(map(_of_mode, mode_pointing.FOLLOWED_DIRECTIONS)),
    Result('cross_elevation_rms_deg', 'deg', 'tracking', lambda run: run.pointing(known_rms, 0),
           'Rms of the true pointing error in cross-elevation, in settled autotrack.'),
    Result('elevation_rms_deg', 'deg', 'tracking', lambda run: run.pointing(known_rms, 1),
           'Rms of the true pointing error in elevation, in settled autotrack.'),
    Result('cross_elevation_max_deg', 'deg', 'tracking', lambda run: run.pointing(largest, 0),
           'Largest true pointing error in cross-elevation, in settled autotrack.'),
    Result('elevation_max_deg', 'deg', 'tracking', lambda run: run.pointing(largest, 1),
           'Largest true pointing error in elevation, in settled autotrack.'),
    Result('encoder_pointing_rms_deg', 'deg', 'encoders', lambda run: known_rms(run.by_encoders),
           'Rms of the pointing error computed from the encoders (true target minus encoders), both axes together, '
           f'in settled autotrack. {ENCODER_DEFINITION}'),
    Result('encoder_pointing_max_deg', 'deg', 'encoders', lambda run: largest(run.by_encoders),
           'Largest pointing error of either axis computed from the encoders, in settled autotrack. '
           f'{ENCODER_DEFINITION}'),
    Result('encoder_cross_elevation_rms_deg', 'deg', 'encoders', lambda run: known_rms(run.by_encoders[:, 0]),
           'Rms of the pointing error in cross-elevation computed from the encoders, in settled autotrack. '
           f'{ENCODER_DEFINITION}'),
    Result('encoder_elevation_rms_deg', 'deg', 'encoders', lambda run: known_rms(run.by_encoders[:, 1]),
           'Rms of the pointing error in elevation computed from the encoders, in settled autotrack. '
           f'{ENCODER_DEFINITION}'),
    Result('encoder_cross_elevation_max_deg', 'deg', 'encoders', lambda run: largest(run.by_encoders[:, 0]),
           'Largest pointing error in cross-elevation computed from the encoders, in settled autotrack. '
           f'{ENCODER_DEFINITION}'),
    Result('encoder_elevation_max_deg', 'deg', 'encoders', lambda run: largest(run.by_encoders[:, 1]),
           'Largest pointing error in elevation computed from the encoders, in settled autotrack. '
           f'{ENCODER_DEFINITION}'),
    Result('single_sample_noise_deg', 'deg', 'tracking', lambda run: known_rms(run.noise),
           'Rms of the difference between receiver error and true pointing error minus boresight offset, both axes '
           'together, in settled autotrack.', "receiver's single-sample noise"),
    Result('pointing_to_noise', '-', 'tracking', lambda run: run.pointing(known_rms) / known_rms(run.noise),
           'Ratio of pointing_rms_deg to single_sample_noise_deg.', target='<= 0.4'),
    Result('noise_reduction_cross_elevation', '-', 'tracking',
           lambda run: known_rms(run.noise[:, 0]) / known_rms(run.filter_error[:, 0]),
           'Noise of one receiver sample, divided by the error of the filtered line of sight, in cross-elevation. '
           f'{sensor_frame.DEFINITION}'),
    Result('noise_reduction_elevation', '-', 'tracking',
           lambda run: known_rms(run.noise[:, 1]) / known_rms(run.filter_error[:, 1]),
           'Noise of one receiver sample, divided by the error of the filtered line of sight, in elevation. '
           f'{sensor_frame.DEFINITION}'),
    Result('noise_reduction', '-', 'tracking', lambda run: known_rms(run.noise) / known_rms(run.filter_error),
           'Noise of one receiver sample, divided by the error of the filtered line of sight, both axes together. '
           f'{sensor_frame.DEFINITION}'),
    Result('lock_time_s', 's', 'tracking', lambda run: run.lock_time,
           'Time of the first lock of the receiver.', 'first lock', brief=True),
    Result('autotrack_time_s', 's', 'tracking', lambda run: run.autotrack_time,
           'Total time of the ACU in autotrack.', 'time in autotrack'),
    Result('trackable_time_s', 's', 'tracking', lambda run: run.trackable_time,
           'Total time in which the target could be tracked: above the horizon mask of the receiver, in no hidden '
           'sector, above the floor and within the travel of the axes.', 'time in which the target could be tracked'),
    Result('tracked_percent', '%', 'tracking', lambda run: run.tracked_percent,
           'Share in autotrack of the time in which the target could be tracked (trackable_time_s).',
           'share of this time in autotrack', brief=True),
    Result('loss_s', 's', 'tracking', lambda run: run.loss,
           'Total time, in any mode, in which the target could be tracked and was further than half a beamwidth off '
           'the beam, counted from the first step in settled autotrack.',
           'time with the target further than half a beamwidth off', brief=True),
    Result('evaluated_time_s', 's', 'tracking', lambda run: run.evaluated_time,
           f'Total time in settled autotrack: from {tracking.HANDOVER_SETTLING_S:g} s after the first hand-over to '
           'autotrack.', 'evaluated time'),
    Result('azimuth_nis_mean', '-', 'filter', lambda known: known.axes[0].nis,
           "Mean squared innovation of azimuth, divided by the filter's variance, summed over the measured numbers. "
           'Expected: 1 (angle only) or 2 (angle and rate).',
           mark=lambda known: known.axes[0].nis_mark),
    Result('azimuth_nees_mean', '-', 'filter', lambda known: known.axes[0].nees,
           "Mean squared error of azimuth and azimuth rate, weighted with the inverse of the filter's covariance. "
           'Expected: 2, for two states.',
           mark=lambda known: known.axes[0].nees_mark),
    Result('elevation_nis_mean', '-', 'filter', lambda known: known.axes[1].nis,
           "Mean squared innovation of elevation, divided by the filter's variance, summed over the measured numbers. "
           'Expected: 1 (angle only) or 2 (angle and rate).',
           mark=lambda known: known.axes[1].nis_mark),
    Result('elevation_nees_mean', '-', 'filter', lambda known: known.axes[1].nees,
           "Mean squared error of elevation and elevation rate, weighted with the inverse of the filter's "
           'covariance. Expected: 2, for two states.',
           mark=lambda known: known.axes[1].nees_mark),
    Result('keyhole_loss_predicted_s', 's', 'keyholes', lambda slews: sum(loss for _, _, loss in slews),
           'Total time with the target off the beam in keyholes, as the ACU predicted it.'),
    Result('ship_line_of_sight_rms_deg', 'deg', 'isolation', lambda ship: ship.motion * DEG_PER_RAD,
           'Rms motion of the line of sight on the deck caused by the rotation of the ship, per axis.',
           'motion of the line of sight by the rotation of the ship, rms per axis'),
    Result('ship_coherent_error_rms_deg', 'deg', 'isolation', lambda ship: ship.coherent * DEG_PER_RAD,
           'Rms of the part of the pointing error that is linearly correlated with the rotation of the ship, per '
           'axis.',
           'pointing error correlated with the rotation of the ship, rms per axis'),
    Result('isolation_db', 'dB', 'isolation', lambda ship: ship.isolation,
           'Ratio of ship_line_of_sight_rms_deg to ship_coherent_error_rms_deg.', 'isolation', '>= 60'),
    Result('isolation_limit_db', 'dB', 'isolation', lambda ship: ship.limit,
           'Isolation that a perfect antenna would show in a run of this length and noise.',
           'isolation that noise alone would show'),
    Result('aligned_s', 's', 'attitude', lambda ins: ins.aligned,
           'Time at which the INS reported `aligned`.', 'INS aligned at'),
    Result('heading_at_alignment_deg', 'deg', 'attitude', lambda ins: ins.at_alignment[0] * DEG_PER_RAD,
           'Heading error of the INS at alignment, clockwise.', 'heading error at alignment'),
    Result('heading_sigma_at_alignment_deg', 'deg', 'attitude', lambda ins: ins.at_alignment[1] * DEG_PER_RAD,
           'Standard deviation of heading that the INS stated at alignment.',
           '1 sigma of heading at alignment, stated by the INS'),
    Result('heading_error_rms_deg', 'deg', 'attitude',
           lambda ins: known_rms(ins.heading[ins.is_aligned]) * DEG_PER_RAD,
           'Rms of the heading error of the INS after alignment.', 'heading error after alignment, rms'),
    Result('level_error_rms_deg', 'deg', 'attitude',
           lambda ins: known_rms(ins.error[ins.is_aligned, :2]) * DEG_PER_RAD,
           'Rms of the level error of the INS after alignment, per axis.',
           'level error after alignment, rms per axis'),
    Result('lost_steps', 'steps', 'run', lambda run: float(run.drive.get('lost_steps', math.nan)),
           'Number of steps of the drive that were missed, or made without the command of the previous step.',
           target='0', brief=True),
    Result('realtime_factor', 's/s', 'run', lambda run: run.drive.get('realtime_factor', math.nan),
           'Ratio of the time of the drive to wall time.', target='>= 4 in lockstep'),
    Result('messages', 'messages', 'run', lambda run: float(run.recorder['messages']), 'Number of recorded messages.'),
    Result('restarts', 'restarts', 'supervised', lambda run: float(run.restarts),
           'Number of times that `pedestal run` restarted a node that had died, in realtime.'),
)
"""All results, in the order in which tables show them."""

RESULT_BY_NAME = {result.name: result for result in RESULTS}


def measured(parts: Mapping[str, object], table: Sequence[Result] = RESULTS) -> Values:
    """Return the values of the Results in a table whose part exists, in the order of the table."""
    return {result.name: (result.measure(parts[result.part]), result.unit) for result in table
            if _exists(parts, result)}


def _exists(parts: Mapping[str, object], result: Result) -> bool:
    part = parts.get(result.part)
    return part is not None and (not isinstance(part, list | dict) or bool(part))


def marks(parts: Mapping[str, object], table: Sequence[Result] = RESULTS) -> dict[str, str]:
    """Return {name: note} of the results whose value is not as expected (Result.mark)."""
    found = {result.name: result.mark(parts[result.part]) for result in table if _exists(parts, result)}
    return {name: text for name, text in found.items() if text}


def brief(columns: Iterable[Values], count: int = BRIEF_COUNT) -> list[str]:
    """Return the names of the results that are printed by default, in the order of the table.

    columns: those of `measured`, for each beam and for the run. Results with the flag `brief` have precedence; other
    measured results fill the remaining of `count` places.
    """
    found = [result for result in RESULTS
             if any(name == result.name and math.isfinite(value) for values in columns
                    for name, (value, _) in values.items())]
    chosen = sorted(found, key=lambda result: not result.brief)[:count]
    return [result.name for result in found if result in chosen]


def rows(case: str, values: Values) -> list[Row]:
    """Return the rows of a --json file for the values that `measured` returns."""
    return [intervals.single(case, name, value, unit, RESULT_BY_NAME[name].target)
            for name, (value, unit) in values.items()]


def documented(table: Sequence[Result] = RESULTS) -> list[tuple[str, str, str, str]]:
    """Return [(name, unit, sentence, target or '')] of all results of a table, for the docs."""
    return [(result.name, result.unit, result.sentence, result.target or '') for result in table]
