"""Tracking of a recorded run: errors of beam, encoders, receiver and filter against the recorded truth, at each step.

The results, the verdict, the report and the trials take their data from Tracking. In this module deck angles are
azimuth (clockwise) and elevation on the deck; an attitude is the quaternion x, y, z, w of the rotation deck -> earth.
An error is the direction to the target minus the direction of the beam, in cross-elevation and elevation.
"""
import contextlib
import dataclasses
import functools
import math

import numpy as np

from pedestal_analysis.results import beam_direction, sensor_frame
from pedestal_common.compiled import compiled
from pedestal_common.geometry import line_of_sight
from pedestal_common.graph.steps import NS_PER_SECOND
from pedestal_common.parameters import build
from pedestal_common.wire import commands
from tracking_receiver_sim.path import arrival
from tracking_receiver_sim.path.params import PathParameters

HANDOVER_SETTLING_S = 2.0
"""Time after the first hand-over to autotrack that every statistic leaves out [s]. After it, autotrack is settled."""
DEG_PER_RAD = math.degrees(1.0)
ENCODER_BEAM_NOTE = ('the recording has no adu/truth, so the direction of the beam is taken from joint_states: errors '
                     'between encoders and dish do not show')
"""Note on the results of an old recording, whose drive did not publish the true direction of its dish."""


MAX_AGE_STEPS, MAX_AGE_INTERVALS = 4.0, 2.5
"""Largest age of a value of real equipment [steps, intervals between its messages]; the larger one counts."""
ERROR_MATRIX_NAMES = ('xx', 'xe'), ('ex', 'ee')
"""Names of the elements of the matrix of the receiver's errors, by row and column."""
MIN_ON_GRID_SHARE = 0.5
"""Share of the messages with the stamp of a step, from which on a topic counts as one of the steps [-]."""


@compiled
def _true_error(direction, relative, attitude, error):
    """Fill error (n, 2) (cross-elevation, elevation) [rad]: target minus direction.

    direction (n, 2): deck angles [rad]; relative (n, 3): ENU [m] from the antenna to the target;
    attitude (n, 4): true attitude of the deck.
    """
    mat_ed = np.empty((3, 3))
    for k in range(len(direction)):
        line_of_sight.rotation(attitude[k, 0], attitude[k, 1], attitude[k, 2], attitude[k, 3], mat_ed)
        x, y, z = line_of_sight.to_deck(mat_ed, relative[k, 0], relative[k, 1], relative[k, 2])
        error[k, 0], error[k, 1] = line_of_sight.offsets(direction[k, 0], direction[k, 1], x, y, z)


@compiled
def _deck_direction(mat_ed, azimuth, elevation):
    """Return the unit vector FLU of earth angles [rad] on a deck; mat_ed: rotation deck -> earth."""
    east, north, up = line_of_sight.earth_direction(azimuth, elevation)
    return line_of_sight.to_deck(mat_ed, east, north, up)


@compiled
def _earth_angles(mat_ed, x, y, z):
    """Return the earth angles [rad] of a vector FLU; mat_ed: rotation deck -> earth."""
    east, north, up = line_of_sight.to_earth(mat_ed, x, y, z)
    return line_of_sight.earth_angles(east, north, up)


@compiled
def _view_from_beam(beam, attitude, known_attitude, estimate, truth, error, beam_earth, estimate_earth):
    """Fill error, beam_earth and estimate_earth (n, 2) [rad].

    error                   estimate minus its truth (cross-elevation, elevation), seen from the beam
    beam_earth              earth angles of the beam
    estimate_earth          true earth angles of the estimate's direction on the deck
    beam (n, 2)             deck angles [rad]
    attitude (n, 4)         true attitude
    known_attitude (n, 4)   attitude that the INS reports
    estimate (n, 2)         earth angles [rad], computed with the attitude that the INS reports
    truth (n, 2)            earth angles [rad] of the target in the frame of the sensors
    """
    mat_ed, known = np.empty((3, 3)), np.empty((3, 3))
    for k in range(len(beam)):
        azimuth, elevation = beam[k, 0], beam[k, 1]
        line_of_sight.rotation(attitude[k, 0], attitude[k, 1], attitude[k, 2], attitude[k, 3], mat_ed)
        line_of_sight.rotation(known_attitude[k, 0], known_attitude[k, 1], known_attitude[k, 2], known_attitude[k, 3],
                               known)
        x, y, z = line_of_sight.direction(azimuth, elevation)
        beam_earth[k, 0], beam_earth[k, 1] = _earth_angles(mat_ed, x, y, z)
        x, y, z = _deck_direction(known, truth[k, 0], truth[k, 1])
        true_cross_elevation, true_elevation = line_of_sight.offsets(azimuth, elevation, x, y, z)
        x, y, z = _deck_direction(known, estimate[k, 0], estimate[k, 1])
        cross_elevation, up = line_of_sight.offsets(azimuth, elevation, x, y, z)
        error[k, 0], error[k, 1] = cross_elevation - true_cross_elevation, up - true_elevation
        estimate_earth[k, 0], estimate_earth[k, 1] = _earth_angles(mat_ed, x, y, z)


@compiled
def _interval_start_error(beam, error, out):
    """Fill `out` (n, 2) as interval_start_error states."""
    for k in range(1, len(beam)):
        azimuth, elevation = line_of_sight.displaced(beam[k - 1, 0], beam[k - 1, 1], error[k - 1, 0], error[k - 1, 1])
        x, y, z = line_of_sight.direction(azimuth, elevation)
        out[k, 0], out[k, 1] = line_of_sight.offsets(beam[k, 0], beam[k, 1], x, y, z)


def interval_start_error(beam, error):
    """Return the pointing error (n, 2) [rad] of an electronic beam at the beginning of the interval before each stamp.

    The beam of an array jumps at each step, and stands during the interval until the next step.

    beam (n, 2)    its deck angles in the interval that ends at stamp k [rad]
    error (n, 2)   pointing error at stamp k [rad]

    At the beginning of this interval the beam is already beam k, but the target is still that of stamp k - 1. The
    first row is NaN.
    """
    out = np.full(beam.shape, np.nan)
    _interval_start_error(np.ascontiguousarray(beam), np.ascontiguousarray(error), out)
    return out


@dataclasses.dataclass
class Tracking:
    """A recorded run as arrays, one row per step of the drive. Angles are in rad; NaN where nothing was measured.

    The two columns of an array (n, 2) are azimuth and elevation, or for errors cross-elevation and elevation. An
    electronic beam is that of an array. Its reference is meant for a later interval than the measured beam, so it has
    no following error.

    t                               (n,) time of the step [s]
    azimuth, elevation              (n,) deck angles of the beam by encoders and pointing model, or of an
                                    electronic beam
    reference                       (n, 2) the same of the ACU's reference; NaN in standby or for an electronic beam
    cross_elevation,
    elevation_error                 (n,) true pointing error at the stamps: target minus direction of the beam
    encoder_error                   (n, 2) true target minus `azimuth`, `elevation`, with all errors of the encoders;
                                    NaN for an electronic beam, and for a bag without adu/truth
    measured, cn0                   (n, 2) receiver error; (n,) C/N0 [dB-Hz]
    estimate_error                  (n, 2) the filter's estimate minus `sensor_truth`, in the axes of the beam
    beam_earth, target_earth        (n, 2) earth angles of the beam and of the target
    estimate_earth                  (n, 2) true earth angles of the direction on the deck that the filter states
    sensor_truth                    (n, 2) earth angles of the target in the frame of the sensors, see sensor_frame
    range                           (n,) distance to the target [m]
    mode                            (n,) mode of the ACU as a text, '' if unknown
    tracking                        (n,) bool: the evaluated part of the run, which is settled autotrack
    since                           (n,) bool: all steps from the first evaluated step on, in any mode
    beamwidth                       half-power beamwidth, NaN if the bag does not state it
    boresight                       (2,) boresight offset of the receiver (cross-elevation, elevation)
    begun                           (n, 2) true pointing error of an electronic beam at the beginning of the interval
                                    that ends at the stamp, else NaN
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
    estimate_error: np.ndarray
    beam_earth: np.ndarray
    target_earth: np.ndarray
    estimate_earth: np.ndarray
    sensor_truth: np.ndarray
    range: np.ndarray
    mode: np.ndarray
    tracking: np.ndarray
    since: np.ndarray
    beamwidth: float
    boresight: np.ndarray
    begun: np.ndarray

    @property
    def period(self):
        """Period of the drive [s]."""
        return np.median(np.diff(self.t))

    @property
    def electronic(self):
        """True for the beam of an array, which jumps at each step and stands between two steps."""
        return np.isfinite(self.begun).any()

    @property
    def following(self):
        """Following error: reference minus encoder (n, 2) [deg]."""
        return (self.reference - np.column_stack((self.azimuth, self.elevation))) * DEG_PER_RAD

    @functools.cached_property
    def true(self):
        """True pointing error (k, 2) [rad] in the k steps of the evaluated part."""
        return np.column_stack((self.cross_elevation, self.elevation_error))[self.tracking]

    @property
    def has_encoders(self):
        """True if the bag holds both the encoders and the true direction of the beam."""
        return np.isfinite(self.encoder_error).any()

    @functools.cached_property
    def by_encoders(self):
        """Pointing error computed from the encoders (k, 2) [deg] over the evaluated part."""
        return self.encoder_error[self.tracking] * DEG_PER_RAD

    @functools.cached_property
    def noise(self):
        """Receiver error minus the error without noise (k, 2) [deg] over the evaluated part.

        The error without noise is the true error minus the boresight offset. The receiver of an electronic beam
        measures the error in the middle of the interval between two steps. The true error there is the mean of those
        at the beginning and at the end.
        """
        true = 0.5 * (self.true + self.begun[self.tracking]) if self.electronic else self.true
        return (self.measured[self.tracking] - (true - self.boresight)) * DEG_PER_RAD

    @functools.cached_property
    def filtered(self):
        """Pointing error by the filter (n, 2) [rad]: true pointing error plus error of the estimate."""
        return np.column_stack((self.cross_elevation, self.elevation_error)) + self.estimate_error

    @functools.cached_property
    def filter_error(self):
        """Error of the filter, estimate minus its truth (k, 2) [deg], over the evaluated part."""
        return self.estimate_error[self.tracking] * DEG_PER_RAD

    def pointing(self, measure, axis=slice(None)):
        """Return a statistic of the true pointing error over the evaluated part [deg].

        measure: function of the errors, such as known_rms; axis: 0 cross-elevation, 1 elevation, by default both. For
        an electronic beam, return the larger of the two values at the beginnings and at the ends of the intervals.
        """
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
        """Time [s], in any mode from the first evaluated step on, with the target further than half a beamwidth off.

        NaN without an evaluated step or without a beamwidth.
        """
        if not (self.since.any() and math.isfinite(self.beamwidth)):
            return math.nan
        distance = np.hypot(self.cross_elevation, self.elevation_error)[self.since]
        return float(np.sum(distance > 0.5 * self.beamwidth) * self.period)


def beamwidth(bag):
    """Return the beamwidth [rad] that a bag states, NaN if it states none."""
    try:
        return float(bag.metadata.get('beamwidth', 'nan'))
    except ValueError:
        return math.nan


def error_matrix(bag):
    """Return the matrix (2, 2) [-] with which the control unit of a bag.Bag multiplied the errors of the receiver."""
    known = bag.configuration['parameters'].get('acu', {})
    return np.array([[known.get(f'tracker.matrix.{name}', float(i == j)) for j, name in enumerate(names)]
                     for i, names in enumerate(ERROR_MATRIX_NAMES)])


def on_grid(bag, t, topic, columns):
    """Return columns (n, m) of a topic, by their m names, at the stamps t (n,) [s].

    The value is NaN where the topic has no message, and in a column that the recording of an older version lacks.
    """
    table = bag.table(topic) if topic in bag.topics else {'t': ()}
    if np.array_equal(table['t'], t) and (np.diff(t) > 1e-9).all():     # a message in every step
        return np.column_stack([table[column] if column in table else np.full(t.size, np.nan) for column in columns])
    out = np.full((t.size, len(columns)), np.nan)
    if len(table['t']):
        _, here, there = np.intersect1d(np.round(t * 1e9), np.round(table['t'] * 1e9), return_indices=True)
        for i, column in enumerate(columns):
            if column in table:
                out[here, i] = table[column][there]
    return out


def of_equipment(bag, t, topic, columns):
    """Return columns (n, m) of a topic of the receiver or of the INS, by their m names, at the stamps t (n,) [s].

    Simulated equipment stamps its messages with the steps; the result is that of on_grid. Real equipment has stamps
    or an interval of its own; the result is then that of its newest message, NaN where this message is too old.
    """
    stamps = bag.table(topic)['t'] if topic in bag.topics else np.zeros(0)
    if not len(stamps) or t.size < 2:
        return on_grid(bag, t, topic, columns)
    step, interval = np.median(np.diff(t)), np.median(np.diff(stamps)) if len(stamps) > 1 else 0.0
    on_steps = np.isin(np.round(stamps * 1e9), np.round(t * 1e9)).mean() >= MIN_ON_GRID_SHARE
    if on_steps and interval < 1.5 * step:
        return on_grid(bag, t, topic, columns)
    oldest = max(MAX_AGE_STEPS * step, MAX_AGE_INTERVALS * interval)
    index = np.searchsorted(stamps, t + 1e-9, side='right') - 1
    known = (index >= 0) & (t - stamps[np.maximum(index, 0)] < oldest)
    table, out = bag.table(topic), np.full((t.size, len(columns)), np.nan)
    for i, column in enumerate(columns):
        if column in table:
            out[known, i] = np.asarray(table[column])[index[known]]
    return out


def _lever_arm(bag, attitude):
    """Return the lever arm (n, 3) ENU [m] from base_link to the antenna at attitudes (n, 4); without one, 0."""
    parameters = bag.configuration['parameters'].get('tracking_receiver', {})
    arm = np.array([parameters.get(f'lever_arm.{axis}', 0.0) for axis in 'xyz'], float)
    enu, mat_ed = np.zeros((len(attitude), 3)), np.empty((3, 3))
    if arm.any():
        for row, quaternion in zip(enu, attitude):
            line_of_sight.rotation(*quaternion, mat_ed)
            row[:] = mat_ed @ arm
    return enu


def _arriving(bag, relative, velocity):
    """Return the vector (n, 3) ENU [m] from the antenna to the apparent position of the target.

    relative (n, 3): vector to its true position, ENU [m]; velocity (n, 3): its velocity, ENU [m/s]. Refraction and
    light time of the signal, by the parameters in the bag, shift the apparent position.
    """
    of_receiver = bag.configuration['parameters'].get('tracking_receiver', {})
    given = {key: of_receiver[key] for key in ('path.refractivity', 'path.light_time') if key in of_receiver}
    path = build(PathParameters, given, 'path.')
    return arrival.all_seen(path, relative, velocity) if given else relative


def by_encoders(bag):
    """Return True if Tracking takes the direction of the beam from the encoders, because the bag has no adu/truth.

    ENCODER_BEAM_NOTE is the note for this case. An array has no encoders: the angles to which it steers its beam are
    the true direction.
    """
    return not bag.beams and 'adu/truth' not in bag.topics


def read(bag) -> Tracking:
    """Return the Tracking of a bag.Bag. Raises ValueError if the bag has no joint_states or no target/truth."""
    missing = [name for name in ('joint_states', 'target/truth') if name not in bag.topics]
    if missing:
        raise ValueError(f'{bag.path}: no {" and no ".join(missing)} in the bag, so no comparison with the truth is '
                         'possible')

    joints = bag.table('joint_states')
    t = joints['t']
    at_steps = functools.partial(on_grid, bag, t)
    encoders = np.column_stack((joints['azimuth.position'], joints['elevation.position']))
    encoders = beam_direction.on_sky(bag, t, encoders)
    beam = at_steps('adu/truth', ('azimuth.position', 'elevation.position')) if 'adu/truth' in bag.topics else encoders
    target = at_steps('target/truth', ('position.x', 'position.y', 'position.z'))
    quaternion = ('orientation.x', 'orientation.y', 'orientation.z', 'orientation.w')
    if 'ship/truth' in bag.topics:
        ship = at_steps('ship/truth', ('position.x', 'position.y', 'position.z'))
        attitude = at_steps('ship/truth', quaternion)
        known_attitude = of_equipment(bag, t, 'ship/imu/data', quaternion)
        stamped = at_steps('ship/imu/data', quaternion)
        ship = ship + _lever_arm(bag, attitude)
    else:
        ship = np.zeros((t.size, 3))
        attitude = known_attitude = stamped = np.tile(line_of_sight.ASHORE_ATTITUDE, (t.size, 1))
    measured = of_equipment(bag, t, 'tracking_receiver/angle_error', ('x', 'y', 'z'))
    estimate = at_steps('acu/estimate', ('azimuth.position', 'elevation.position'))
    error, encoder_error, estimate_error, beam_earth, estimate_earth = np.full((5, t.size, 2), np.nan)
    velocity = at_steps('target/truth', ('twist.linear.x', 'twist.linear.y', 'twist.linear.z'))
    relative = _arriving(bag, target - ship, velocity)
    _true_error(beam, relative, attitude, error)
    if beam is not encoders and not bag.beams:
        _true_error(encoders, relative, attitude, encoder_error)
    target_earth = np.column_stack((np.arctan2(relative[:, 0], relative[:, 1]),
                                    np.arctan2(relative[:, 2], np.hypot(relative[:, 0], relative[:, 1]))))
    # An attitude of the step itself has no age. An INS with stamps of its own has none of these.
    boresight = sensor_frame.boresight(bag)
    sensor_truth = sensor_frame.truth(t, encoders, error - boresight,
                                      stamped if np.isfinite(stamped).any() else known_attitude, target_earth)
    _view_from_beam(beam, attitude, known_attitude, estimate, sensor_truth, estimate_error, beam_earth, estimate_earth)
    mode = modes(bag, t)
    automatic = mode == 'autotrack'
    start = t[automatic][0] + HANDOVER_SETTLING_S if automatic.any() else math.inf
    reference = beam_direction.on_sky(bag, t, at_steps('acu/reference', ('azimuth.position', 'elevation.position')))
    reference[(mode == 'standby') | (mode == '') | (bag.beams > 0)] = np.nan
    return Tracking(t, encoders[:, 0], encoders[:, 1], reference, error[:, 0], error[:, 1], encoder_error,
                    measured[:, :2], measured[:, 2], estimate_error, beam_earth, target_earth, estimate_earth,
                    sensor_truth, np.linalg.norm(relative, axis=1), mode, automatic & (t >= start), t >= start,
                    beamwidth(bag), boresight,
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


def replies(bag, topic):
    """Yield (time [s], Command, Reply) of the replies on a topic of a bag; nothing for a topic of another type."""
    there = bag.topics.get(topic) == 'diagnostic_msgs/msg/DiagnosticStatus'
    for _, log, _, message in bag.messages(topic) if there else ():
        with contextlib.suppress(ValueError):  # the message is no reply
            yield ((log - bag.start) / NS_PER_SECOND, *commands.of_reply(message))


def keyholes(bag):
    """Return [(begin, end, loss)] of the slews through a keyhole that the ACU predicted in its diagnostics, each once.

    begin, end: times of the slew [s]; loss: predicted time with the target off the beam [s]. A renewed plan replaces
    the earlier plan of the same slew. A plan that is cancelled before its slew begins does not count.
    """
    slews = []
    for _, log, _, array in bag.messages('diagnostics') if 'diagnostics' in bag.topics else ():
        for status in array.status:
            values = {value.key: value.value for value in status.values}
            if values.get('keyhole') == 'none' and slews and (log - bag.start) / NS_PER_SECOND < slews[-1][0]:
                slews.pop()
            with contextlib.suppress(KeyError, ValueError):  # the status is of another node or predicts no slew
                begin, end, loss = (float(values[f'keyhole_{name}_s']) for name in ('begins', 'ends', 'loss'))
                if slews and begin < slews[-1][1]:
                    slews.pop()
                slews.append((begin, end, loss))
    return slews


def stretches(flags):
    """Return [(first, last + 1)] of the stretches of neighbouring rows in which flags (n,) bool are true."""
    edges = np.flatnonzero(np.diff(np.concatenate(([0], flags.astype(int), [0]))))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist()))


def settled(inside, t):
    """Return the mask (n,) of the rows of `inside` (n,) bool without the first HANDOVER_SETTLING_S of each stretch.

    t (n,): times [s].
    """
    mask = np.zeros(t.size, bool)
    for first, last in stretches(inside):
        mask[first:last] = t[first:last] >= t[first] + HANDOVER_SETTLING_S
    return mask


def rms(values, axis=None):
    """Return the root mean square of all values, or along an axis; NaN where a value is NaN."""
    return np.sqrt(np.mean(np.square(values), axis=axis))


def known_rms(values):
    """Return the root mean square of the finite values; NaN if there are none."""
    values = values[np.isfinite(values)]
    return float(rms(values)) if values.size else math.nan


def largest(values):
    """Return the largest absolute value of the finite values; NaN if there are none."""
    values = values[np.isfinite(values)]
    return float(np.max(np.abs(values))) if values.size else math.nan
