"""What a recorded run achieved: pointing against truth, filter noise, lock, lost steps. Shared by run and report."""
import dataclasses
import functools
import math

import numpy as np

from pedestal_common import line_of_sight
from pedestal_common.compiled import compiled

SETTLING = 2.0
"""Seconds after the first hand-over to autotrack that are left out of every statistic."""


@compiled
def _pointing(beam, target, ship, attitude, known_attitude, estimate, error, filtered, beam_earth):
    """Fill, per row: the pointing error and the filtered error (cross-elevation, elevation), the beam's earth angles.

    attitude is the true one, known_attitude the INS's, in whose earth angles the estimate is given.
    """
    mat_ed, known = np.empty((3, 3)), np.empty((3, 3))
    for k in range(len(beam)):
        azimuth, elevation = beam[k, 0], beam[k, 1]
        line_of_sight.rotation(attitude[k, 0], attitude[k, 1], attitude[k, 2], attitude[k, 3], mat_ed)
        x, y, z = line_of_sight.to_deck(mat_ed, target[k, 0] - ship[k, 0], target[k, 1] - ship[k, 1],
                                        target[k, 2] - ship[k, 2])
        error[k, 0], error[k, 1] = line_of_sight.offsets(azimuth, elevation, x, y, z)
        x, y, z = line_of_sight.direction(azimuth, elevation)
        east, north, height = line_of_sight.to_earth(mat_ed, x, y, z)
        beam_earth[k, 0], beam_earth[k, 1] = line_of_sight.earth_angles(east, north, height)
        line_of_sight.rotation(known_attitude[k, 0], known_attitude[k, 1], known_attitude[k, 2], known_attitude[k, 3],
                               known)
        east, north, height = line_of_sight.earth_direction(estimate[k, 0], estimate[k, 1])
        x, y, z = line_of_sight.to_deck(known, east, north, height)
        filtered[k, 0], filtered[k, 1] = line_of_sight.offsets(azimuth, elevation, x, y, z)


@compiled
def _began(beam, error, out):
    for k in range(1, len(beam)):
        azimuth, elevation = line_of_sight.displaced(beam[k - 1, 0], beam[k - 1, 1], error[k - 1, 0], error[k - 1, 1])
        x, y, z = line_of_sight.direction(azimuth, elevation)
        out[k, 0], out[k, 1] = line_of_sight.offsets(beam[k, 0], beam[k, 1], x, y, z)


def began(beam, error):
    """Pointing error (n, 2) at the beginning of the intervals in which a beam (n, 2) [rad] that jumps at the steps
    stood, from the one (n, 2) at their ends, the stamps: beam k against the target of k - 1; NaN in the first."""
    out = np.full(beam.shape, np.nan)
    _began(np.ascontiguousarray(beam), np.ascontiguousarray(error), out)
    return out


@dataclasses.dataclass
class Tracking:
    """A run as arrays on the drive's steps; angles in rad, NaN where nothing was measured.

    t (n,) s; azimuth, elevation (n,) encoders; reference (n, 2) deck angles that the ACU follows, NaN in standby and
    of an electronic beam, which is told where to be later;
    cross_elevation, elevation_error (n,) true error; begun (n, 2) both at the beginning of the interval that ends
    there, of an electronic beam, else NaN;
    measured (n, 2) receiver errors and cn0 (n,) at their stamp; filtered (n, 2) the estimate seen from the
    beam, as cross-elevation and elevation; beam_earth (n, 2); target_earth (n, 2) and range (n,) m; mode (n,) text;
    tracking (n,) bool: in autotrack and settled, since (n,) bool: that or later; beamwidth rad, NaN when the bag does
    not say.
    """
    t: np.ndarray
    azimuth: np.ndarray
    elevation: np.ndarray
    reference: np.ndarray
    cross_elevation: np.ndarray
    elevation_error: np.ndarray
    measured: np.ndarray
    cn0: np.ndarray
    filtered: np.ndarray
    beam_earth: np.ndarray
    target_earth: np.ndarray
    range: np.ndarray
    mode: np.ndarray
    tracking: np.ndarray
    since: np.ndarray
    beamwidth: float
    begun: np.ndarray


def beamwidth(bag):
    """The beamwidth [rad] a bag was recorded with, NaN when it does not say."""
    try:
        return float(bag.metadata.get('beamwidth', 'nan'))
    except ValueError:
        return math.nan


def on_grid(bag, t, topic, columns):
    """Columns of a topic at the stamps t; NaN where it has no message of that stamp."""
    out = np.full((t.size, len(columns)), np.nan)
    table = bag.table(topic) if topic in bag.topics else {'t': ()}
    if len(table['t']):
        _, here, there = np.intersect1d(np.round(t * 1e9), np.round(table['t'] * 1e9), return_indices=True)
        for i, column in enumerate(columns):
            out[here, i] = table[column][there]
    return out


def lever_arm(bag, attitude):
    """(n, 3) ENU [m] from base_link to the antenna, at attitudes (n, 4) of the deck; 0 in a bag that says none."""
    told = bag.configuration['parameters'].get('tracking_receiver', {})
    arm = np.array([told.get(f'lever_arm.{axis}', 0.0) for axis in 'xyz'])
    found, mat_ed = np.zeros((len(attitude), 3)), np.empty((3, 3))
    if arm.any():
        for row, quaternion in zip(found, attitude):
            line_of_sight.rotation(*quaternion, mat_ed)
            row[:] = mat_ed @ arm
    return found


def tracking(bag) -> Tracking:
    """The Tracking of a bag (bag.Bag). Raises ValueError when it has no joint_states or target/truth."""
    missing = [name for name in ('joint_states', 'target/truth') if name not in bag.topics]
    if missing:
        raise ValueError(f'{bag.path}: no {" and no ".join(missing)} in it, so nothing can be compared with the truth')

    joints = bag.table('joint_states')
    t = joints['t']
    at_steps = functools.partial(on_grid, bag, t)
    beam = np.column_stack((joints['azimuth.position'], joints['elevation.position']))
    target = at_steps('target/truth', ('position.x', 'position.y', 'position.z'))
    quaternion = ('orientation.x', 'orientation.y', 'orientation.z', 'orientation.w')
    if 'ship/truth' in bag.topics:
        ship = at_steps('ship/truth', ('position.x', 'position.y', 'position.z'))
        attitude, known_attitude = at_steps('ship/truth', quaternion), at_steps('ship/imu/data', quaternion)
        ship = ship + lever_arm(bag, attitude)
    else:
        ship = np.zeros((t.size, 3))
        attitude = known_attitude = np.tile(line_of_sight.ASHORE, (t.size, 1))
    measured = at_steps('tracking_receiver/angle_error', ('x', 'y', 'z'))
    estimate = at_steps('acu/estimate', ('azimuth.position', 'elevation.position'))
    error, filtered, beam_earth = np.empty((3, t.size, 2))
    _pointing(beam, target, ship, attitude, known_attitude, estimate, error, filtered, beam_earth)
    relative = target - ship
    target_earth = np.column_stack((np.arctan2(relative[:, 0], relative[:, 1]),
                                    np.arctan2(relative[:, 2], np.hypot(relative[:, 0], relative[:, 1]))))
    mode = modes(bag, t)
    automatic = mode == 'autotrack'
    start = t[automatic][0] + SETTLING if automatic.any() else math.inf
    reference = at_steps('acu/reference', ('azimuth.position', 'elevation.position'))
    reference[(mode == 'standby') | (mode == '') | (bag.beams > 0)] = np.nan
    return Tracking(t, beam[:, 0], beam[:, 1], reference, error[:, 0], error[:, 1], measured[:, :2], measured[:, 2],
                    filtered, beam_earth, target_earth, np.linalg.norm(relative, axis=1), mode,
                    automatic & (t >= start), t >= start, beamwidth(bag),
                    began(beam, error) if bag.beams else np.full_like(error, np.nan))


def modes(bag, t):
    """The ACU's mode at every stamp t ('' before the first)."""
    if 'acu/mode' not in bag.topics:
        return np.full(t.size, '')
    table = bag.table('acu/mode')
    index = np.searchsorted(table['t'], t + 1e-9, side='right') - 1
    return np.where(index >= 0, np.array(['', *table['data']])[index + 1], '')


def rms(values):
    """Root mean square of the finite values; NaN when there are none."""
    values = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(values**2))) if values.size else math.nan


def summary(run: Tracking) -> dict:
    """{metric: (value, unit)} over the settled autotrack part of a run; NaN when it never tracked.

    *_following_*_deg: reference less encoder over every step outside standby, tracking or not, of a drive with motors;
    pointing_*_deg: both axes together, per axis and sample (not the angle off the beam); of an electronic beam, which
    stands from step to step, at the end or at the beginning of its intervals, whichever is larger;
    single_sample_noise_deg: rms of the receiver's error minus the true one, per axis and sample; of an electronic beam
    minus that of the middle of the interval, which the receiver measures;
    noise_reduction: that divided by the rms error of the filtered line of sight against truth;
    loss_s: how long the target was further than half a beamwidth off the beam, in whatever mode, from when on the run
    counts as tracking.
    """
    on = run.tracking
    degrees = math.degrees(1.0)
    true = np.column_stack((run.cross_elevation, run.elevation_error))[on]
    begun = run.begun[on]
    standing = np.isfinite(run.begun).any()
    raw = (run.measured[on] - (0.5 * (true + begun) if standing else true)) * degrees
    filtered = (run.filtered[on] - true) * degrees
    locked = np.isfinite(run.measured[:, 0])
    noise = rms(raw)

    def larger(measure, axis=slice(None)):
        return max(measure(error[:, axis]) for error in ((true, begun) if standing else (true,)))

    following = (run.reference - np.column_stack((run.azimuth, run.elevation))) * degrees
    followed = {} if standing else {
        'azimuth_following_rms_deg': (rms(following[:, 0]), 'deg'),
        'azimuth_following_max_deg': (_max(following[:, 0]), 'deg'),
        'elevation_following_rms_deg': (rms(following[:, 1]), 'deg'),
        'elevation_following_max_deg': (_max(following[:, 1]), 'deg')}
    values = {
        **followed,
        'pointing_rms_deg': (larger(rms) * degrees, 'deg'),
        'pointing_max_deg': (larger(_max) * degrees, 'deg'),
        'cross_elevation_rms_deg': (larger(rms, 0) * degrees, 'deg'),
        'elevation_rms_deg': (larger(rms, 1) * degrees, 'deg'),
        'cross_elevation_max_deg': (larger(_max, 0) * degrees, 'deg'),
        'elevation_max_deg': (larger(_max, 1) * degrees, 'deg'),
        'single_sample_noise_deg': (noise, 'deg'),
        'pointing_to_noise': (larger(rms) * degrees / noise, ''),
        'noise_reduction_cross_elevation': (rms(raw[:, 0]) / rms(filtered[:, 0]), ''),
        'noise_reduction_elevation': (rms(raw[:, 1]) / rms(filtered[:, 1]), ''),
        'noise_reduction': (noise / rms(filtered), ''),
        'lock_time_s': (float(run.t[locked][0]) if locked.any() else math.nan, 's'),
        'autotrack_time_s': (float(np.sum(run.mode == 'autotrack') * np.median(np.diff(run.t))), 's'),
        'tracked_percent': (100.0 * float(np.mean(run.mode == 'autotrack')), '%'),
        'loss_s': (_loss(run), 's'),
        'evaluated_time_s': (float(np.sum(on) * np.median(np.diff(run.t))), 's'),
    }
    return values


def _loss(run):
    if not (run.since.any() and math.isfinite(run.beamwidth)):
        return math.nan
    off = np.hypot(run.cross_elevation, run.elevation_error)[run.since]
    return float(np.sum(off > 0.5 * run.beamwidth) * np.median(np.diff(run.t)))


def announced_losses(bag) -> dict:
    """{'keyhole_loss_predicted_s': (value, unit)}: what the ACU said beforehand in its diagnostics that it would lose
    in keyholes, each counted once; nothing where it said nothing of the kind."""
    found = keyholes(bag)
    return {'keyhole_loss_predicted_s': (sum(loss for _, _, loss in found), 's')} if found else {}


def keyholes(bag):
    """[(begin, end, loss)] [s] of the slews that the ACU said in its diagnostics it would make."""
    found = {}
    for _, _, _, array in bag.messages('diagnostics') if 'diagnostics' in bag.topics else ():
        for status in array.status:
            said = {value.key: value.value for value in status.values}
            if 'keyhole_loss_s' in said:
                found[said['keyhole_begins_s']] = tuple(float(said[f'keyhole_{name}_s']) for name in (
                    'begins', 'ends', 'loss'))
    return list(found.values())


def _max(values):
    values = values[np.isfinite(values)]
    return float(np.max(np.abs(values))) if values.size else math.nan


TARGETS = {'pointing_to_noise': '<= 0.4', 'lost_steps': '0', 'realtime_factor': '>= 4 in lockstep',
           'isolation_db': '>= 60'}


def rows(case, values):
    """The rows of a --json file: value null where it could not be measured."""
    return [{'case': case, 'metric': metric, 'value': value if math.isfinite(value) else None, 'unit': unit,
             'paper': None, 'target': TARGETS.get(metric)} for metric, (value, unit) in values.items()]
