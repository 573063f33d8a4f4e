"""Tracking of a recorded run: errors of beam, encoders, receiver and filter against the recorded truth, at each step.

Deck angles are azimuth (clockwise) and elevation on the deck; an attitude is the quaternion x, y, z, w of the rotation
deck -> earth. An error is the direction to the target minus that of the beam, in cross-elevation and elevation.
"""
import contextlib
import dataclasses
import functools
import math
from collections.abc import Callable
from typing import Annotated, NamedTuple, overload

import numpy as np

from pedestal_common.compiled import compiled
from pedestal_common.geometry import line_of_sight
from pedestal_common.parameters import build
from pedestal_common.quantities import (
    Bools,
    Decibels,
    Degrees,
    Floats,
    Ints,
    Matrix3,
    Pair,
    Pairs,
    Quaternions,
    Radians,
    Seconds,
    Texts,
    Times,
    Vectors3,
)
from pedestal_recording import recording as recordings
from pedestal_recording.recording import Recording
from pedestal_results import directions, sensor_frame, trackable
from receiver_law.monopulse import sum_pattern
from tracking_receiver_sim import wave_path
from tracking_receiver_sim.params import PathParameters

HANDOVER_SETTLING_S = 2.0
"""Time after the first hand-over to autotrack that every statistic leaves out [s]. After it, autotrack is settled."""
DEG_PER_RAD = math.degrees(1.0)
ENCODER_BEAM_NOTE = ('the recording has no adu/truth, so the direction of the beam is taken from joint_states: errors '
                     'between encoders and dish do not show')
"""Note on the results of an old recording, whose drive did not publish the true direction of its dish."""

LEAST_POWER = 1e-12
"""Smallest received power over that on the beam axis [-]. This avoids an infinite loss in a null of the pattern."""
ERROR_MATRIX_NAMES = ('xx', 'xe'), ('ex', 'ee')
"""Names of the elements of the matrix of the receiver's errors, by row and column."""


@compiled
def _true_error(direction: Pairs, relative: Vectors3, attitude: Quaternions, error: Pairs) -> None:
    """Fill error (cross-elevation, elevation) [rad]: target minus direction.

    direction: deck angles [rad]; relative: ENU [m] from the antenna to the target; attitude: that of the deck, true.
    """
    mat_ed = np.empty((3, 3))
    for k in range(len(direction)):
        line_of_sight.rotation(attitude[k, 0], attitude[k, 1], attitude[k, 2], attitude[k, 3], mat_ed)
        x, y, z = line_of_sight.to_deck(mat_ed, relative[k, 0], relative[k, 1], relative[k, 2])
        error[k, 0], error[k, 1] = line_of_sight.offsets(direction[k, 0], direction[k, 1], x, y, z)


@compiled
def _deck_direction(mat_ed: Matrix3, azimuth: Radians, elevation: Radians) -> tuple[float, float, float]:
    """Return the unit vector FLU of earth angles on a deck."""
    east, north, up = line_of_sight.earth_direction(azimuth, elevation)
    return line_of_sight.to_deck(mat_ed, east, north, up)


@compiled
def _earth_angles(mat_ed: Matrix3, x: float, y: float, z: float) -> tuple[Radians, Radians]:
    east, north, up = line_of_sight.to_earth(mat_ed, x, y, z)
    return line_of_sight.earth_angles(east, north, up)


@compiled
def _view_from_beam(beam: Pairs, attitude: Quaternions, known_attitude: Quaternions, estimate: Pairs, truth: Pairs,
                    error: Pairs, beam_earth: Pairs, estimate_earth: Pairs) -> None:
    """Fill error, beam_earth and estimate_earth; all angles in rad.

    error            estimate minus its truth (cross-elevation, elevation), seen from the beam
    beam_earth       earth angles of the beam
    estimate_earth   true earth angles of the estimate's direction on the deck
    beam             deck angles
    known_attitude   attitude that the INS reports
    estimate         earth angles, computed with the attitude that the INS reports
    truth            earth angles of the target in the frame of the sensors
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
def _interval_start_error(beam: Pairs, error: Pairs, out: Pairs) -> None:
    for k in range(1, len(beam)):
        azimuth, elevation = line_of_sight.displaced(beam[k - 1, 0], beam[k - 1, 1], error[k - 1, 0], error[k - 1, 1])
        x, y, z = line_of_sight.direction(azimuth, elevation)
        out[k, 0], out[k, 1] = line_of_sight.offsets(beam[k, 0], beam[k, 1], x, y, z)


@compiled
def _fill_power(error: Pairs, beamwidth: Radians, power: Floats) -> None:
    """Fill power: received power over that on the beam axis [-], for pointing errors [rad]."""
    for k in range(len(error)):
        voltage = sum_pattern(error[k, 0] / beamwidth) * sum_pattern(error[k, 1] / beamwidth)
        power[k] = voltage * voltage


def interval_start_error(beam: Pairs, error: Pairs) -> Pairs:
    """Return the pointing error [rad] of an electronic beam at the beginning of the interval before each stamp.

    The beam of an array jumps at each step, and stands during the interval until the next step. At the beginning of
    the interval that ends at stamp k, the beam is already beam k, but the target is still that of stamp k - 1. The
    first row is NaN. beam: its deck angles [rad]; error: pointing error at the stamps [rad].
    """
    out = np.full(beam.shape, np.nan)
    _interval_start_error(np.ascontiguousarray(beam), np.ascontiguousarray(error), out)
    return out


class Slew(NamedTuple):
    """Slew through a keyhole, as the ACU predicted it."""
    begin: Seconds
    end: Seconds
    loss: Seconds   # time with the target off the beam


@dataclasses.dataclass(kw_only=True)
class Tracking:
    """A recorded run as arrays, one row per step of the drive. NaN where nothing was measured. Pairs are angles [rad].

    An electronic beam is that of an array. Its reference is meant for a later interval than the measured beam, so it
    has no following error.
    """
    t: Times        # of the step
    encoders: Pairs         # deck angles of the beam by encoders and pointing model, or of an electronic beam
    reference: Pairs        # the same of the ACU's reference; NaN in standby or for an electronic beam
    error: Pairs    # true pointing error at the stamps: target minus direction of the beam
    # true target minus `encoders`, with all errors of the encoders; NaN for an electronic beam or without adu/truth
    encoder_error: Pairs
    measured: Pairs         # receiver error
    cn0: Floats     # C/N0 [dB-Hz]
    estimate_error: Pairs   # the filter's estimate minus `sensor_truth`, in the axes of the beam
    beam_earth: Pairs       # earth angles of the beam
    target_earth: Pairs     # earth angles of the target
    estimate_earth: Pairs   # true earth angles of the direction on the deck that the filter states
    sensor_truth: Pairs     # earth angles of the target in the frame of the sensors, see sensor_frame
    range: Floats   # distance to the target [m]
    mode: Texts     # mode of the ACU, '' if unknown
    tracking: Bools         # the evaluated part of the run, which is settled autotrack
    since: Bools    # all steps from the first evaluated step on, in any mode
    obstacle: Ints  # reason why the target cannot be tracked, see the module trackable
    beamwidth: Radians      # half-power, NaN if the bag does not state it
    boresight: Pair         # boresight offset of the receiver
    # true pointing error of an electronic beam at the beginning of the interval that ends at the stamp, else NaN
    begun: Pairs

    @property
    def parts(self) -> dict[str, object]:
        """The parts by name for results.measured that the run provides, None for a missing part."""
        return {'motors': None if self.electronic else self, 'encoders': self if self.has_encoders else None,
                'tracking': self, 'receiver': None if np.isfinite(self.target_earth).any() else self}

    @property
    def period(self) -> Seconds:
        """Period of the drive."""
        return np.median(np.diff(self.t))

    @property
    def electronic(self) -> bool:
        """True for the beam of an array, which jumps at each step and stands between two steps."""
        return bool(np.isfinite(self.begun).any())

    @property
    def following(self) -> Pairs:
        """Following error: reference minus encoder [deg]."""
        return (self.reference - self.encoders) * DEG_PER_RAD

    @property
    def distance(self) -> Floats:
        """Angle from the beam to the target [rad]."""
        return np.hypot(self.error[:, 0], self.error[:, 1])

    @functools.cached_property
    def true(self) -> Pairs:
        """True pointing error [rad] in the steps of the evaluated part."""
        return self.error[self.tracking]

    @property
    def has_encoders(self) -> bool:
        """True if the bag holds both the encoders and the true direction of the beam."""
        return bool(np.isfinite(self.encoder_error).any())

    @functools.cached_property
    def by_encoders(self) -> Pairs:
        """Pointing error computed from the encoders [deg] over the evaluated part."""
        return self.encoder_error[self.tracking] * DEG_PER_RAD

    @functools.cached_property
    def noise(self) -> Pairs:
        """Receiver error minus the error without noise [deg] over the evaluated part.

        The error without noise is the true error minus the boresight offset. The receiver of an electronic beam
        measures the error in the middle of the interval between two steps. The true error there is the mean of those
        at both ends.
        """
        true = 0.5 * (self.true + self.begun[self.tracking]) if self.electronic else self.true
        return (self.measured[self.tracking] - (true - self.boresight)) * DEG_PER_RAD

    @functools.cached_property
    def filtered(self) -> Pairs:
        """Pointing error by the filter [rad]: true pointing error plus error of the estimate."""
        return self.error + self.estimate_error

    @functools.cached_property
    def filter_error(self) -> Pairs:
        """Error of the filter, estimate minus its truth [deg], over the evaluated part."""
        return self.estimate_error[self.tracking] * DEG_PER_RAD

    def pointing(self, measure: Callable[[Floats], float], axis: int | slice = slice(None)) -> Degrees:
        """Return a statistic of the true pointing error over the evaluated part, by default of both axes.

        For an electronic beam, return the larger of the two values at the beginnings and at the ends of the intervals.
        """
        errors = (self.true, self.begun[self.tracking]) if self.electronic else (self.true,)
        return max(measure(error[:, axis]) for error in errors) * DEG_PER_RAD

    @functools.cached_property
    def power(self) -> Floats:
        """Received power over that on the beam axis [-], by the sum pattern of the beam, in the evaluated part.

        Empty without a beamwidth.
        """
        if not math.isfinite(self.beamwidth):
            return np.zeros(0)
        error = np.concatenate((self.true, self.begun[self.tracking])) if self.electronic else self.true
        error = np.ascontiguousarray(error[np.isfinite(error).all(axis=1)])
        power = np.empty(len(error))
        _fill_power(error, self.beamwidth, power)
        return np.maximum(power, LEAST_POWER)

    @property
    def mean_power_loss(self) -> Decibels:
        """Loss of the mean received power by the pointing error; NaN without an evaluated part."""
        return -10.0 * math.log10(self.power.mean()) if self.power.size else math.nan

    @property
    def max_power_loss(self) -> Decibels:
        """Largest loss of received power by the pointing error; NaN without an evaluated part."""
        return -10.0 * math.log10(self.power.min()) if self.power.size else math.nan

    @property
    def lock_time(self) -> Seconds:
        """Stamp of the receiver's first error; NaN without an error, and in a recording that begins with a locked
        receiver.
        """
        locked = np.isfinite(self.measured[:, 0])
        unknown = locked[:1].any() and self.t.size > 1 and self.t[0] > self.period
        return float(self.t[locked][0]) if locked.any() and not unknown else math.nan

    @property
    def known_mode(self) -> Bools:
        """The steps whose mode the recording states."""
        return self.mode != ''

    @property
    def autotrack_time(self) -> Seconds:
        """Time in autotrack; NaN without a known mode."""
        return float(np.sum(self.mode == 'autotrack') * self.period) if self.known_mode.any() else math.nan

    @property
    def evaluated_time(self) -> Seconds:
        """Duration of the evaluated part; NaN without a known mode."""
        return float(np.sum(self.tracking) * self.period) if self.known_mode.any() else math.nan

    @functools.cached_property
    def trackable(self) -> Bools:
        """The steps in which the target could be tracked, see the module trackable."""
        return self.obstacle == trackable.NONE

    @property
    def trackable_time(self) -> Seconds:
        """Time in which the target could be tracked."""
        return float(np.sum(self.trackable) * self.period)

    def share(self, mode: str) -> float:
        """Return the share in a mode of the steps with a known mode in which the target could be tracked [%]; NaN
        without such a step."""
        counted = self.mode[self.known_mode & self.trackable]
        return 100.0 * float(np.mean(counted == mode)) if counted.size else math.nan

    @property
    def tracked_percent(self) -> float:
        """The share in autotrack [%], see `share`."""
        return self.share('autotrack')

    @property
    def loss(self) -> Seconds:
        """Time, in any mode from the first evaluated step on, in which the target could be tracked and was further
        than half a beamwidth off; else NaN.
        """
        counted = self.since & self.trackable
        if not (counted.any() and math.isfinite(self.beamwidth) and np.isfinite(self.distance).any()):
            return math.nan
        return float(np.sum(self.distance[counted] > 0.5 * self.beamwidth) * self.period)


def error_matrix(bag: Recording) -> Annotated[Floats, (2, 2)]:
    """Return the matrix [-] with which the control unit multiplied the errors of the receiver."""
    known = recordings.parameters(bag, 'acu')
    return np.array([[known.get(f'tracker.matrix.{name}', float(i == j)) for j, name in enumerate(names)]
                     for i, names in enumerate(ERROR_MATRIX_NAMES)])


def _lever_arm(bag: Recording, attitude: Quaternions) -> Vectors3:
    """Return the lever arm ENU [m] from base_link to the antenna at each attitude; without one, 0."""
    parameters = recordings.parameters(bag, 'tracking_receiver')
    arm = np.array([parameters.get(f'lever_arm.{axis}', 0.0) for axis in 'xyz'], float)
    enu, mat_ed = np.zeros((len(attitude), 3)), np.empty((3, 3))
    if arm.any():
        for row, quaternion in zip(enu, attitude):
            x, y, z, w = quaternion
            line_of_sight.rotation(x, y, z, w, mat_ed)
            row[:] = mat_ed @ arm
    return enu


def _arriving(bag: Recording, relative: Vectors3, velocity: Vectors3) -> Vectors3:
    """Return the vector ENU [m] from the antenna to the apparent position, shifted by refraction and light time.

    relative: vector to the true position, ENU [m]; velocity: velocity of the target, ENU [m/s].
    """
    of_receiver = recordings.parameters(bag, 'tracking_receiver')
    given = {key: value for key, value in of_receiver.items() if key in ('path.refractivity', 'path.light_time')}
    path = build(PathParameters, given, 'path.')
    return wave_path.all_seen(path, relative, velocity) if given else relative


def by_encoders(bag: Recording) -> bool:
    """Return True if Tracking takes the direction of the beam from the encoders, because the bag has no adu/truth.

    An array has no encoders: the angles to which it steers its beam are the true direction.
    """
    return not bag.beams and 'adu/truth' not in bag.topics


def read(bag: Recording, needs_truth: bool = True) -> Tracking:
    """Return the Tracking of a recording of one beam. Raises ValueError without joint_states or target/truth. Without
    `needs_truth`, all errors against a missing target/truth are NaN."""
    if missing := recordings.missing(bag, 'joint_states', *['target/truth'] * needs_truth):
        raise ValueError(f'{bag.path}: no {missing} in the bag, so no comparison with the truth is possible')
    joints = bag.table('joint_states')
    t = joints['t']
    if t.size < 2:
        raise ValueError(f'{bag.path}: {t.size} steps of joint_states: must be at least 2')
    at_steps = functools.partial(recordings.at, bag, t)
    raw = np.column_stack((joints['azimuth.position'], joints['elevation.position']))
    encoders = directions.on_sky(bag, t, raw)
    beam = at_steps('adu/truth', ('azimuth.position', 'elevation.position')) if 'adu/truth' in bag.topics else encoders
    target = at_steps('target/truth', ('position.x', 'position.y', 'position.z'))
    quaternion = ('orientation.x', 'orientation.y', 'orientation.z', 'orientation.w')
    if 'ship/truth' in bag.topics:
        ship = at_steps('ship/truth', ('position.x', 'position.y', 'position.z'))
        attitude = at_steps('ship/truth', quaternion)
        known_attitude = recordings.of_equipment(bag, t, 'ship/imu/data', quaternion)
        stamped = at_steps('ship/imu/data', quaternion)
        ship = ship + _lever_arm(bag, attitude)
    else:
        ship = np.zeros((t.size, 3))
        attitude = known_attitude = stamped = np.tile(line_of_sight.ASHORE_ATTITUDE, (t.size, 1))
    measured = recordings.of_equipment(bag, t, 'tracking_receiver/angle_error', ('x', 'y', 'z'))
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
    mode = recordings.modes(bag, t)
    automatic = mode == 'autotrack'
    start = t[automatic][0] + HANDOVER_SETTLING_S if automatic.any() else math.inf
    reference = directions.on_sky(bag, t, at_steps('acu/reference', ('azimuth.position', 'elevation.position')))
    reference[(mode == 'standby') | (mode == '') | (bag.beams > 0)] = np.nan
    return Tracking(t=t, encoders=encoders, reference=reference, error=error, encoder_error=encoder_error,
                    measured=measured[:, :2], cn0=measured[:, 2], estimate_error=estimate_error,
                    beam_earth=beam_earth, target_earth=target_earth, estimate_earth=estimate_earth,
                    sensor_truth=sensor_truth, range=np.linalg.norm(relative, axis=1), mode=mode,
                    tracking=automatic & (t >= start), since=t >= start,
                    obstacle=trackable.obstacles(bag, relative, attitude, raw - encoders),
                    beamwidth=recordings.beamwidth(bag), boresight=boresight,
                    begun=interval_start_error(beam, error) if bag.beams else np.full_like(error, np.nan))


def keyholes(bag: Recording) -> list[Slew]:
    """Return the slews through a keyhole that the ACU predicted in its diagnostics, each once.

    A renewed plan replaces the earlier plan of the same slew. A plan that is cancelled before its slew does not count.
    """
    slews: list[Slew] = []
    for t, status in recordings.diagnostics(bag):
        values = {value.key: value.value for value in status.values}
        if values.get('keyhole') == 'none' and slews and t < slews[-1].begin:
            slews.pop()
        with contextlib.suppress(KeyError, ValueError):  # the status is of another node or predicts no slew
            begin, end, loss = (float(values[f'keyhole_{name}_s']) for name in ('begins', 'ends', 'loss'))
            if slews and begin < slews[-1].end:
                slews.pop()
            slews.append(Slew(begin, end, loss))
    return slews


def stretches(flags: Bools) -> list[tuple[int, int]]:
    """Return [(first, last + 1)] of the stretches of neighbouring rows in which flags are true."""
    edges = np.flatnonzero(np.diff(np.concatenate(([0], flags.astype(int), [0]))))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist()))


def settled(inside: Bools, t: Times) -> Bools:
    """Return the rows of `inside` without the first HANDOVER_SETTLING_S of each stretch; t: times of the rows."""
    mask = np.zeros(t.size, bool)
    for first, last in stretches(inside):
        mask[first:last] = t[first:last] >= t[first] + HANDOVER_SETTLING_S
    return mask


@overload
def rms(values: Floats) -> float: ...
@overload
def rms(values: Floats, axis: int) -> Floats: ...
def rms(values: Floats, axis: int | None = None) -> float | Floats:
    """Return the root mean square of all values, or along an axis; NaN where a value is NaN."""
    return np.sqrt(np.mean(np.square(values), axis=axis))


def known_rms(values: Floats) -> float:
    """Return the root mean square of the finite values; NaN if there are none."""
    values = values[np.isfinite(values)]
    return float(rms(values)) if values.size else math.nan


def largest(values: Floats) -> float:
    """Return the largest absolute value of the finite values; NaN if there are none."""
    values = values[np.isfinite(values)]
    return float(np.max(np.abs(values))) if values.size else math.nan
