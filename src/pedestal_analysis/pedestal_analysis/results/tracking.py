"""A recorded run on the drive's steps: beam, encoders, estimate and receiver against the recorded truth."""
import contextlib
import dataclasses
import functools
import math

import numpy as np

from pedestal_common.compiled import compiled
from pedestal_common.geometry import line_of_sight
from pedestal_common.graph.steps import NS_PER_SECOND
from pedestal_common.parameters import build
from tracking_receiver_sim.path import arrival
from tracking_receiver_sim.path.params import PathParameters

HANDOVER_SETTLING_S = 2.0
"""Seconds after the first hand-over to autotrack that are left out of every statistic."""
DEG_PER_RAD = math.degrees(1.0)
ENCODER_BEAM_NOTE = ('there is no adu/truth in it, so the beam is taken to be where joint_states say: what moves the dish '
                     'off its encoders does not show')
"""What is said of the numbers of a recording from before the drive told where its dish truly points."""


@compiled
def _true_error(direction, relative, attitude, error):
    """Fill the error (n, 2) (cross-elevation, elevation) [rad] of deck angles (n, 2) against the target.

    relative (n, 3): ENU [m] from the antenna to the target; attitude (n, 4): the true one.
    """
    mat_ed = np.empty((3, 3))
    for k in range(len(direction)):
        line_of_sight.rotation(attitude[k, 0], attitude[k, 1], attitude[k, 2], attitude[k, 3], mat_ed)
        x, y, z = line_of_sight.to_deck(mat_ed, relative[k, 0], relative[k, 1], relative[k, 2])
        error[k, 0], error[k, 1] = line_of_sight.offsets(direction[k, 0], direction[k, 1], x, y, z)


@compiled
def _view_from_beam(beam, attitude, known_attitude, estimate, filtered, beam_earth):
    """Fill, per row: the filtered error (cross-elevation, elevation) seen from the beam, the beam's earth angles.

    attitude is the true one, known_attitude the INS's, in whose earth angles the estimate is given.
    """
    mat_ed, known = np.empty((3, 3)), np.empty((3, 3))
    for k in range(len(beam)):
        azimuth, elevation = beam[k, 0], beam[k, 1]
        line_of_sight.rotation(attitude[k, 0], attitude[k, 1], attitude[k, 2], attitude[k, 3], mat_ed)
        x, y, z = line_of_sight.direction(azimuth, elevation)
        east, north, height = line_of_sight.to_earth(mat_ed, x, y, z)
        beam_earth[k, 0], beam_earth[k, 1] = line_of_sight.earth_angles(east, north, height)
        line_of_sight.rotation(known_attitude[k, 0], known_attitude[k, 1], known_attitude[k, 2], known_attitude[k, 3],
                               known)
        east, north, height = line_of_sight.earth_direction(estimate[k, 0], estimate[k, 1])
        x, y, z = line_of_sight.to_deck(known, east, north, height)
        filtered[k, 0], filtered[k, 1] = line_of_sight.offsets(azimuth, elevation, x, y, z)


@compiled
def _interval_start_error(beam, error, out):
    for k in range(1, len(beam)):
        azimuth, elevation = line_of_sight.displaced(beam[k - 1, 0], beam[k - 1, 1], error[k - 1, 0], error[k - 1, 1])
        x, y, z = line_of_sight.direction(azimuth, elevation)
        out[k, 0], out[k, 1] = line_of_sight.offsets(beam[k, 0], beam[k, 1], x, y, z)


def interval_start_error(beam, error):
    """Pointing error (n, 2) at the beginning of the intervals in which a beam (n, 2) [rad] that jumps at the steps
    stood, from the one (n, 2) at their ends, the stamps: beam k against the target of k - 1; NaN in the first."""
    out = np.full(beam.shape, np.nan)
    _interval_start_error(np.ascontiguousarray(beam), np.ascontiguousarray(error), out)
    return out


@dataclasses.dataclass
class Tracking:
    """A run as arrays on the drive's steps; angles in rad, NaN where nothing was measured. Two columns are azimuth (or
    cross-elevation) and elevation.

    t (n,) s; azimuth, elevation (n,): encoders; reference (n, 2): deck angles that the ACU follows, NaN in standby and
    of an electronic beam, which obeys them later; cross_elevation, elevation_error (n,): true error at the stamps, the
    target off where the dish points; encoder_error (n, 2): the target off where the encoders say, NaN of an electronic
    beam and where the bag does not tell the two apart; measured (n, 2): errors of the receiver; cn0 (n,) dB-Hz;
    filtered (n, 2): the estimate seen from the beam; beam_earth, target_earth (n, 2): earth angles; range (n,) m; mode
    (n,): text; tracking (n,) bool: in autotrack and settled, the evaluated part; since (n,) bool: that or later;
    beamwidth, NaN when the bag does not say; begun (n, 2): true error of an electronic beam at the beginning of the
    interval that ends at the stamp, else NaN.
    """
    t: np.ndarray
    azimuth: np.ndarray
    elevation: np.ndarray
    reference: np.ndarray
    cross_elevation: np.ndarray
    elevation_error: np.ndarray
    encoder_error: np.ndarray
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

    @property
    def period(self):
        """Of the drive's steps [s]."""
        return np.median(np.diff(self.t))

    @property
    def electronic(self):
        """Whether the beam is an electronic one, which stands from step to step."""
        return np.isfinite(self.begun).any()

    @property
    def following(self):
        """Reference less encoder (n, 2) [deg]."""
        return (self.reference - np.column_stack((self.azimuth, self.elevation))) * DEG_PER_RAD

    @functools.cached_property
    def true(self):
        """True error (k, 2) [rad] over the evaluated part."""
        return np.column_stack((self.cross_elevation, self.elevation_error))[self.tracking]

    @property
    def has_encoders(self):
        """Whether what the encoders say is known beside where the beam points."""
        return np.isfinite(self.encoder_error).any()

    @functools.cached_property
    def by_encoders(self):
        """Error by the encoders (k, 2) [deg] over the evaluated part."""
        return self.encoder_error[self.tracking] * DEG_PER_RAD

    @functools.cached_property
    def noise(self):
        """Measured less true error (k, 2) [deg] over the evaluated part; of an electronic beam less the true error in
        the middle of the interval, which the receiver measures."""
        true = 0.5 * (self.true + self.begun[self.tracking]) if self.electronic else self.true
        return (self.measured[self.tracking] - true) * DEG_PER_RAD

    @functools.cached_property
    def filter_error(self):
        """Filtered less true error (k, 2) [deg] over the evaluated part."""
        return (self.filtered[self.tracking] - self.true) * DEG_PER_RAD

    def pointing(self, measure, axis=slice(None)):
        """measure(true error) [deg] over the evaluated part; of an electronic beam at the end or at the beginning of
        its intervals, whichever is larger."""
        errors = (self.true, self.begun[self.tracking]) if self.electronic else (self.true,)
        return max(measure(error[:, axis]) for error in errors) * DEG_PER_RAD

    @property
    def lock_time(self):
        """Stamp [s] of the receiver's first error; NaN without an error, and in a recording that begins during the run
        with a locked receiver."""
        locked = np.isfinite(self.measured[:, 0])
        unknown = locked[:1].any() and self.t.size > 1 and self.t[0] > self.period
        return float(self.t[locked][0]) if locked.any() and not unknown else math.nan

    @property
    def known_mode(self):
        """Mask (n,) of the steps whose mode the recording states."""
        return self.mode != ''

    @property
    def autotrack_time(self):
        """Time in autotrack [s]; NaN without a known mode."""
        return float(np.sum(self.mode == 'autotrack') * self.period) if self.known_mode.any() else math.nan

    @property
    def evaluated_time(self):
        """Duration of the evaluated part [s]; NaN without a known mode."""
        return float(np.sum(self.tracking) * self.period) if self.known_mode.any() else math.nan

    @property
    def tracked_percent(self):
        """Share in autotrack of the steps with a known mode [%]; NaN without a known mode."""
        return 100.0 * float(np.mean(self.mode[self.known_mode] == 'autotrack')) if self.known_mode.any() else math.nan

    @property
    def loss(self):
        """How long [s] the target was further than half a beamwidth off the beam, in whatever mode, from the first
        evaluated step on; NaN without such a step or a beamwidth."""
        if not (self.since.any() and math.isfinite(self.beamwidth)):
            return math.nan
        distance = np.hypot(self.cross_elevation, self.elevation_error)[self.since]
        return float(np.sum(distance > 0.5 * self.beamwidth) * self.period)


def beamwidth(bag):
    """The beamwidth [rad] a bag was recorded with, NaN when it does not say."""
    try:
        return float(bag.metadata.get('beamwidth', 'nan'))
    except ValueError:
        return math.nan


def on_grid(bag, t, topic, columns):
    """Columns of a topic at the stamps t; NaN where it has no message of that stamp."""
    table = bag.table(topic) if topic in bag.topics else {'t': ()}
    if np.array_equal(table['t'], t) and (np.diff(t) > 1e-9).all():     # a message in every step
        return np.column_stack([table[column] for column in columns])
    out = np.full((t.size, len(columns)), np.nan)
    if len(table['t']):
        _, here, there = np.intersect1d(np.round(t * 1e9), np.round(table['t'] * 1e9), return_indices=True)
        for i, column in enumerate(columns):
            out[here, i] = table[column][there]
    return out


def _lever_arm(bag, attitude):
    """(n, 3) ENU [m] from base_link to the antenna, at attitudes (n, 4) of the deck; 0 when the bag does not say."""
    parameters = bag.configuration['parameters'].get('tracking_receiver', {})
    arm = np.array([parameters.get(f'lever_arm.{axis}', 0.0) for axis in 'xyz'], float)
    enu, mat_ed = np.zeros((len(attitude), 3)), np.empty((3, 3))
    if arm.any():
        for row, quaternion in zip(enu, attitude):
            line_of_sight.rotation(*quaternion, mat_ed)
            row[:] = mat_ed @ arm
    return enu


def _arriving(bag, relative, velocity):
    """(n, 3) ENU [m] from the antenna to where the target is seen, which is at `relative` with the velocity (n, 3):
    refracted and late as the bag says."""
    of_receiver = bag.configuration['parameters'].get('tracking_receiver', {})
    given = {key: of_receiver[key] for key in ('path.refractivity', 'path.light_time') if key in of_receiver}
    path = build(PathParameters, given, 'path.')
    return arrival.all_seen(path, relative, velocity) if given else relative


def by_encoders(bag):
    """Whether the beam of a bag is taken to be where its encoders say (ENCODER_BEAM_NOTE); an array's steering is the
    truth."""
    return not bag.beams and 'adu/truth' not in bag.topics


def read(bag) -> Tracking:
    """The Tracking of a bag (bag.Bag). Raises ValueError when it has no joint_states or target/truth."""
    missing = [name for name in ('joint_states', 'target/truth') if name not in bag.topics]
    if missing:
        raise ValueError(f'{bag.path}: no {" and no ".join(missing)} in it, so nothing can be compared with the truth')

    joints = bag.table('joint_states')
    t = joints['t']
    at_steps = functools.partial(on_grid, bag, t)
    encoders = np.column_stack((joints['azimuth.position'], joints['elevation.position']))
    beam = at_steps('adu/truth', ('azimuth.position', 'elevation.position')) if 'adu/truth' in bag.topics else encoders
    target = at_steps('target/truth', ('position.x', 'position.y', 'position.z'))
    quaternion = ('orientation.x', 'orientation.y', 'orientation.z', 'orientation.w')
    if 'ship/truth' in bag.topics:
        ship = at_steps('ship/truth', ('position.x', 'position.y', 'position.z'))
        attitude, known_attitude = at_steps('ship/truth', quaternion), at_steps('ship/imu/data', quaternion)
        ship = ship + _lever_arm(bag, attitude)
    else:
        ship = np.zeros((t.size, 3))
        attitude = known_attitude = np.tile(line_of_sight.ASHORE_ATTITUDE, (t.size, 1))
    measured = at_steps('tracking_receiver/angle_error', ('x', 'y', 'z'))
    estimate = at_steps('acu/estimate', ('azimuth.position', 'elevation.position'))
    error, encoder_error, filtered, beam_earth = np.full((4, t.size, 2), np.nan)
    velocity = at_steps('target/truth', ('twist.linear.x', 'twist.linear.y', 'twist.linear.z'))
    relative = _arriving(bag, target - ship, velocity)
    _true_error(beam, relative, attitude, error)
    if beam is not encoders and not bag.beams:
        _true_error(encoders, relative, attitude, encoder_error)
    _view_from_beam(beam, attitude, known_attitude, estimate, filtered, beam_earth)
    target_earth = np.column_stack((np.arctan2(relative[:, 0], relative[:, 1]),
                                    np.arctan2(relative[:, 2], np.hypot(relative[:, 0], relative[:, 1]))))
    mode = modes(bag, t)
    automatic = mode == 'autotrack'
    start = t[automatic][0] + HANDOVER_SETTLING_S if automatic.any() else math.inf
    reference = at_steps('acu/reference', ('azimuth.position', 'elevation.position'))
    reference[(mode == 'standby') | (mode == '') | (bag.beams > 0)] = np.nan
    return Tracking(t, *encoders.T, reference, *error.T, encoder_error, measured[:, :2], measured[:, 2],
                    filtered, beam_earth, target_earth, np.linalg.norm(relative, axis=1), mode,
                    automatic & (t >= start), t >= start, beamwidth(bag),
                    interval_start_error(beam, error) if bag.beams else np.full_like(error, np.nan))


def modes(bag, t):
    """Return the mode of the ACU at every stamp t, '' where the recording does not state it.

    acu/mode states each change. In a recording that begins during a run, the first diagnostics of the ACU state the
    mode before the first change.
    """
    if 'acu/mode' not in bag.topics:
        return np.full(t.size, '')
    table = bag.table('acu/mode')
    index = np.searchsorted(table['t'], t + 1e-9, side='right') - 1
    first = _first_mode(bag, table['t'][0] if len(table['t']) else math.inf) if (index < 0).any() else ''
    return np.array([first, *table['data']])[index + 1]


def _first_mode(bag, change):
    """Return the mode in the first diagnostics of the ACU before the first change [s]; '' without them."""
    for _, log, _, array in bag.messages('diagnostics') if 'diagnostics' in bag.topics else ():
        for status in array.status:
            if status.name == f'{bag.beam}acu' and (log - bag.start) / NS_PER_SECOND < change:
                return next((value.value for value in status.values if value.key == 'mode'), '')
    return ''


def keyholes(bag):
    """[(begin, end, loss)] [s] of the slews through a keyhole that the ACU announced in its diagnostics, each once."""
    slews = {}
    for _, _, _, array in bag.messages('diagnostics') if 'diagnostics' in bag.topics else ():
        for status in array.status:
            values = {value.key: value.value for value in status.values}
            with contextlib.suppress(KeyError, ValueError):  # announces none, or is of another node
                begin, end, loss = (float(values[f'keyhole_{name}_s']) for name in ('begins', 'ends', 'loss'))
                slews[begin] = begin, end, loss
    return list(slews.values())


def rms(values, axis=None):
    """Return the root mean square of values, of all or along an axis; NaN where one of them is NaN."""
    return np.sqrt(np.mean(np.square(values), axis=axis))


def known_rms(values):
    """Return the root mean square of the finite values; NaN when there are none."""
    values = values[np.isfinite(values)]
    return float(rms(values)) if values.size else math.nan


def largest(values):
    """Largest size of the finite values; NaN when there are none."""
    values = values[np.isfinite(values)]
    return float(np.max(np.abs(values))) if values.size else math.nan
