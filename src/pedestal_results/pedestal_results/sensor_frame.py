"""Truth of the estimate: the direction of the target that the sensors of a recorded run would measure without noise.

The control unit estimates the target in the frame of its sensors: encoders, receiver and INS. The slow errors of these
sensors turn this frame. Examples are the bend between dish and encoder, a tilted mount, the boresight offset of the
receiver, and a wrong heading of the INS. Because the measurements cannot show these errors, and the antenna points in
the same frame, they are no error of the filter. The faster errors are noise, which the filter must expect.
"""
import numpy as np

from pedestal_common.compiled import compiled
from pedestal_common.geometry import line_of_sight
from pedestal_common.quantities import Pair, Pairs, Quaternions, Seconds, Times
from pedestal_recording import recording as recordings
from pedestal_recording.recording import Recording

SLOW_ERROR_TIME_S = 1.0
"""Time over which the errors of the sensors are averaged to find their slow part [s].

The filter follows the slow errors. The faster errors are noise, which the filter must expect.
"""

DEFINITION = 'Slow errors of the sensors, such as the bend between dish and encoders, are no error of the filter.'
"""Sentence in the definitions of the results that compare the estimate with this truth."""


@compiled
def _offsets_of_sensors(deck: Pairs, error: Pairs, known_attitude: Quaternions, target: Pairs, offsets: Pairs) -> None:
    """Fill offsets (cross-elevation, elevation) [rad]: the direction that the sensors measure without noise, seen from
    the true direction; arguments as of `truth`.
    """
    mat = np.empty((3, 3))
    for k in range(len(deck)):
        azimuth, elevation = line_of_sight.displaced(deck[k, 0], deck[k, 1], error[k, 0], error[k, 1])
        x, y, z = line_of_sight.direction(azimuth, elevation)
        q = known_attitude[k]
        line_of_sight.rotation(q[0], q[1], q[2], q[3], mat)
        east, north, up = line_of_sight.to_earth(mat, x, y, z)
        # Earth angles turn clockwise like deck angles, so north, west, up take the place of FLU.
        offsets[k, 0], offsets[k, 1] = line_of_sight.offsets(target[k, 0], target[k, 1], north, -east, up)


@compiled
def _displace_rows(angles: Pairs, offsets: Pairs) -> None:
    """Displace earth angles [rad] in place by offsets (cross-elevation, elevation) [rad]."""
    for k in range(len(angles)):
        angles[k, 0], angles[k, 1] = line_of_sight.displaced(angles[k, 0], angles[k, 1], offsets[k, 0], offsets[k, 1])


def _slow(values: Pairs, period: Seconds) -> Pairs:
    """Return values averaged over SLOW_ERROR_TIME_S about each row, without NaN; in a shorter recording over at most
    its rows.
    """
    longest = (len(values) - 1) // 2
    half = min(round(0.5 * SLOW_ERROR_TIME_S / period), longest) if longest > 0 and period > 0.0 else 0
    window = np.ones(2 * half + 1)
    known = np.isfinite(values)
    with np.errstate(invalid='ignore'):
        return np.column_stack([
            np.convolve(np.where(there, column, 0.0), window, 'same') / np.convolve(there, window, 'same')
            for column, there in zip(values.T, known.T)])


def boresight(bag: Recording) -> Pair:
    """Return the boresight offset (cross-elevation, elevation) [rad] of the receiver, from the recorded parameters.

    It is the direction in which the receiver measures no error, seen from the beam.
    """
    of_receiver = recordings.parameters(bag, 'tracking_receiver')
    return np.array([of_receiver.get(f'antenna.boresight_{axis}', 0.0) for axis in ('cross_elevation', 'elevation')])


def truth(t: Times, encoders: Pairs, error: Pairs, known_attitude: Quaternions, target: Pairs) -> Pairs:
    """Return the earth angles [rad] of a target in the frame of the sensors, at the times t.

    encoders         deck angles of the beam by the encoders [rad]
    error            error that the receiver measures without noise (cross-elevation, elevation) [rad]: the true
                     pointing error without the `boresight`
    known_attitude   attitude that the INS reports
    target           true earth angles of the target [rad]
    """
    if not t.size:
        return target.copy()
    offsets, angles = np.empty((t.size, 2)), target.copy()
    _offsets_of_sensors(np.ascontiguousarray(encoders), error, known_attitude, target, offsets)
    _displace_rows(angles, _slow(offsets, np.median(np.diff(t)) if t.size > 1 else 0.0))
    return angles
