"""The results of a run: one row for each, from which tables, --json rows, report and docs follow.

A result is measured on a part of what is known of a run; without that part it has no row:
motors      tracking.Tracking of a drive with motors    tracking    tracking.Tracking of any drive
encoders    the same where the true direction of its dish is known too
filter      consistency.Consistency                     isolation   isolation.Isolation
attitude    known_attitude.KnownAttitude                keyholes    tracking.keyholes
run         start.Outcome                               supervised  start.Outcome in realtime
Errors are per axis and sample: both axes together are all samples of both, not the angle off the beam.
"""
import math
import typing

from pedestal_analysis.results import consistency, isolation, known_attitude, tracking
from pedestal_analysis.results.tracking import DEG_PER_RAD, known_rms, largest


class Result(typing.NamedTuple):
    """name and unit; the part it is measured on and measure(part) -> value, NaN where it was not measured; what it is,
    a sentence; label: its name in the report, '' where the report does not show it; target, or None; mark(part) ->
    what is off about it, '' where nothing is."""
    name: str
    unit: str
    part: str
    measure: typing.Callable
    sentence: str
    label: str = ''
    target: str | None = None
    mark: typing.Callable = lambda part: ''


RESULTS = (
    Result('azimuth_following_rms_deg', 'deg', 'motors', lambda run: known_rms(run.following[:, 0]),
           'Rms of reference less encoder in azimuth, over every step outside standby.'),
    Result('azimuth_following_max_deg', 'deg', 'motors', lambda run: largest(run.following[:, 0]),
           'Largest of reference less encoder in azimuth, over every step outside standby.'),
    Result('elevation_following_rms_deg', 'deg', 'motors', lambda run: known_rms(run.following[:, 1]),
           'Rms of reference less encoder in elevation, over every step outside standby.'),
    Result('elevation_following_max_deg', 'deg', 'motors', lambda run: largest(run.following[:, 1]),
           'Largest of reference less encoder in elevation, over every step outside standby.'),
    Result('pointing_rms_deg', 'deg', 'tracking', lambda run: run.pointing(known_rms),
           'Rms of the true pointing error, the target off where the dish points, both axes together, in settled '
           'autotrack.'),
    Result('pointing_max_deg', 'deg', 'tracking', lambda run: run.pointing(largest),
           'Largest true pointing error of either axis in settled autotrack.'),
    Result('cross_elevation_rms_deg', 'deg', 'tracking', lambda run: run.pointing(known_rms, 0),
           'Rms of the true pointing error in cross-elevation.'),
    Result('elevation_rms_deg', 'deg', 'tracking', lambda run: run.pointing(known_rms, 1),
           'Rms of the true pointing error in elevation.'),
    Result('cross_elevation_max_deg', 'deg', 'tracking', lambda run: run.pointing(largest, 0),
           'Largest true pointing error in cross-elevation.'),
    Result('elevation_max_deg', 'deg', 'tracking', lambda run: run.pointing(largest, 1),
           'Largest true pointing error in elevation.'),
    Result('encoder_pointing_rms_deg', 'deg', 'encoders', lambda run: known_rms(run.by_encoders),
           'Rms of the pointing error that the encoders show, both axes together.'),
    Result('encoder_pointing_max_deg', 'deg', 'encoders', lambda run: largest(run.by_encoders),
           'Largest pointing error that the encoders show on either axis.'),
    Result('encoder_cross_elevation_rms_deg', 'deg', 'encoders', lambda run: known_rms(run.by_encoders[:, 0]),
           'Rms of the pointing error that the encoders show in cross-elevation.'),
    Result('encoder_elevation_rms_deg', 'deg', 'encoders', lambda run: known_rms(run.by_encoders[:, 1]),
           'Rms of the pointing error that the encoders show in elevation.'),
    Result('encoder_cross_elevation_max_deg', 'deg', 'encoders', lambda run: largest(run.by_encoders[:, 0]),
           'Largest pointing error that the encoders show in cross-elevation.'),
    Result('encoder_elevation_max_deg', 'deg', 'encoders', lambda run: largest(run.by_encoders[:, 1]),
           'Largest pointing error that the encoders show in elevation.'),
    Result('single_sample_noise_deg', 'deg', 'tracking', lambda run: known_rms(run.noise),
           "Rms of the receiver's error less the true one.", "receiver's single-sample noise"),
    Result('pointing_to_noise', '-', 'tracking', lambda run: run.pointing(known_rms) / known_rms(run.noise),
           'pointing_rms_deg over single_sample_noise_deg.', target='<= 0.4'),
    Result('noise_reduction_cross_elevation', '-', 'tracking',
           lambda run: known_rms(run.noise[:, 0]) / known_rms(run.filter_error[:, 0]),
           "The receiver's noise over the error of the filtered line of sight, in cross-elevation."),
    Result('noise_reduction_elevation', '-', 'tracking',
           lambda run: known_rms(run.noise[:, 1]) / known_rms(run.filter_error[:, 1]),
           "The receiver's noise over the error of the filtered line of sight, in elevation."),
    Result('noise_reduction', '-', 'tracking', lambda run: known_rms(run.noise) / known_rms(run.filter_error),
           "The receiver's noise over the error of the filtered line of sight, both axes together."),
    Result('lock_time_s', 's', 'tracking', lambda run: run.lock_time,
           'When the receiver locked for the first time.', 'first lock'),
    Result('autotrack_time_s', 's', 'tracking', lambda run: run.autotrack_time,
           'How long the ACU was in autotrack.', 'time in autotrack'),
    Result('tracked_percent', '%', 'tracking', lambda run: run.tracked_percent,
           'Share of the run in autotrack.'),
    Result('loss_s', 's', 'tracking', lambda run: run.loss,
           'How long the target was further than half a beamwidth off, in any mode, once the run counts as tracking.',
           'time further than half a beamwidth off, once tracking'),
    Result('evaluated_time_s', 's', 'tracking', lambda run: run.evaluated_time,
           f'How long the run was in autotrack, from {tracking.HANDOVER_SETTLING_S:g} s after its start.',
           'time evaluated'),
    Result('azimuth_nis_mean', '-', 'filter', lambda known: known.axes[0].nis,
           "Mean squared innovation of azimuth in units of the filter's variance; 1 for each number measured.",
           mark=lambda known: known.axes[0].nis_mark),
    Result('azimuth_nees_mean', '-', 'filter', lambda known: known.axes[0].nees,
           "Mean squared error of azimuth and its rate in units of the filter's covariance; 2 where that is true.",
           mark=lambda known: known.axes[0].nees_mark),
    Result('elevation_nis_mean', '-', 'filter', lambda known: known.axes[1].nis,
           "Mean squared innovation of elevation in units of the filter's variance; 1 for each number measured.",
           mark=lambda known: known.axes[1].nis_mark),
    Result('elevation_nees_mean', '-', 'filter', lambda known: known.axes[1].nees,
           "Mean squared error of elevation and its rate in units of the filter's covariance; 2 where that is true.",
           mark=lambda known: known.axes[1].nees_mark),
    Result('keyhole_loss_predicted_s', 's', 'keyholes', lambda slews: sum(loss for _, _, loss in slews),
           'How long the ACU announced that it would lose the target in keyholes.'),
    Result('ship_line_of_sight_rms_deg', 'deg', 'isolation', lambda ship: ship.motion * DEG_PER_RAD,
           "How far the ship's rotation moved the line of sight on the deck, rms per axis.",
           "line of sight moved by the ship's rotation, rms per axis"),
    Result('ship_coherent_error_rms_deg', 'deg', 'isolation', lambda ship: ship.coherent * DEG_PER_RAD,
           "Part of the pointing error that a linear law of the ship's rotation explains, rms per axis.",
           'pointing error that follows it, rms per axis'),
    Result('isolation_db', 'dB', 'isolation', lambda ship: ship.isolation,
           'ship_line_of_sight_rms_deg over ship_coherent_error_rms_deg.', 'isolation', '>= 60'),
    Result('isolation_limit_db', 'dB', 'isolation', lambda ship: ship.limit,
           'Isolation that a run of this length and noise can show at all.', 'isolation that noise alone would show'),
    Result('aligned_s', 's', 'attitude', lambda ins: ins.aligned,
           'When the INS reported that it was aligned.', 'INS aligned at'),
    Result('heading_at_alignment_deg', 'deg', 'attitude', lambda ins: ins.at_alignment[0] * DEG_PER_RAD,
           'Heading error of the INS when it was aligned, clockwise.', 'heading error then'),
    Result('heading_sigma_at_alignment_deg', 'deg', 'attitude', lambda ins: ins.at_alignment[1] * DEG_PER_RAD,
           'Standard deviation that the INS stated for its heading when it was aligned.',
           '1 sigma of heading then, as the INS says'),
    Result('heading_error_rms_deg', 'deg', 'attitude', lambda ins: known_rms(ins.heading[ins.after]) * DEG_PER_RAD,
           'Rms of the heading error of the INS since it was aligned.', 'heading error from then on, rms'),
    Result('level_error_rms_deg', 'deg', 'attitude', lambda ins: known_rms(ins.error[ins.after, :2]) * DEG_PER_RAD,
           'Rms of the level error of the INS since it was aligned, per axis.',
           'level error from then on, rms per axis'),
    Result('lost_steps', 'steps', 'run', lambda run: float(run.drive.get('lost_steps', math.nan)),
           'Steps that the drive made without the command for them.', target='0'),
    Result('realtime_factor', 's/s', 'run', lambda run: run.drive.get('realtime_factor', math.nan),
           "The drive's time over wall time.", target='>= 4 in lockstep'),
    Result('messages', 'messages', 'run', lambda run: float(run.recorder['messages']), 'Messages that were recorded.'),
    Result('restarts', 'restarts', 'supervised', lambda run: float(run.restarts),
           'How often `pedestal run` started a node again that had died, in realtime.'),
)

RESULT_BY_NAME = {result.name: result for result in RESULTS}


def of_tracking(run):
    """The parts {part: record} that a tracking.Tracking is."""
    return {'motors': None if run.electronic else run, 'encoders': run if run.has_encoders else None, 'tracking': run}


def of_bag(bag):
    """The parts {part: record} of a bag.Bag as one beam sees it (Bag.view); None or empty where it has not got one.

    Raises ValueError when it has no joint_states or target/truth.
    """
    run = tracking.read(bag)
    return {**of_tracking(run), 'filter': consistency.read(bag, run), 'keyholes': tracking.keyholes(bag),
            'isolation': isolation.read(bag, run), 'attitude': known_attitude.read(bag)}


def measured(parts, table=RESULTS) -> dict:
    """{name: (value, unit)} of the results of a table whose part is there, in its order."""
    return {result.name: (result.measure(parts[result.part]), result.unit) for result in table
            if parts.get(result.part)}


def marks(parts, table=RESULTS) -> dict:
    """{name: what is off about it} of the results whose part is there; only those about which something is."""
    found = {result.name: result.mark(parts[result.part]) for result in table if parts.get(result.part)}
    return {name: text for name, text in found.items() if text}


def row(case, metric, value, unit='', target=None):
    """A row of a --json file; value None where it could not be measured."""
    return {'case': case, 'metric': metric, 'value': value if math.isfinite(value) else None, 'unit': unit,
            'paper': None, 'target': target}


def rows(case, values):
    """The rows of a --json file of what `measured` gave."""
    return [row(case, name, value, unit, RESULT_BY_NAME[name].target) for name, (value, unit) in values.items()]


def documented(table=RESULTS):
    """[(name, unit, sentence, target or '')] of every result of a table, for the docs."""
    return [(result.name, result.unit, result.sentence, result.target or '') for result in table]
