"""Measured direction of the target in earth angles, from beam direction, receiver errors and attitude of the deck.

The report shows this direction beside the truth, and `pedestal export --format tdm` writes it.
"""
import numpy as np

from pedestal_common.compiled import compiled
from pedestal_common.geometry import line_of_sight
from pedestal_common.quantities import Floats, Pairs, Quaternions


@compiled
def _displaced(azimuth: Floats, elevation: Floats, errors: Pairs, quaternions: Quaternions, earth: Pairs) -> None:
    """Fill earth with the earth angles [rad] of a target. azimuth, elevation: deck angles of the beam; the rest as in
    `earth_angles`.
    """
    mat_ed = np.empty((3, 3))
    for k in range(azimuth.size):
        line_of_sight.rotation(quaternions[k, 0], quaternions[k, 1], quaternions[k, 2], quaternions[k, 3], mat_ed)
        at, up = line_of_sight.displaced(azimuth[k], elevation[k], errors[k, 0], errors[k, 1])
        x, y, z = line_of_sight.direction(at, up)
        east, north, height = line_of_sight.to_earth(mat_ed, x, y, z)
        earth[k, 0], earth[k, 1] = line_of_sight.earth_angles(east, north, height)


def earth_angles(beam: Pairs, errors: Pairs, quaternions: Quaternions | None = None) -> Pairs:
    """Return the earth angles [rad] of the target: azimuth in (-pi, pi] and elevation.

    beam          azimuth and elevation of the beam on the deck [rad]
    errors        receiver errors in cross-elevation and elevation [rad]
    quaternions   rotation deck -> earth, None ashore

    The result is NaN where an input is NaN.
    """
    if quaternions is None:
        quaternions = np.tile(np.array(line_of_sight.ASHORE_ATTITUDE), (len(beam), 1))
    earth = np.empty((len(beam), 2))
    _displaced(np.ascontiguousarray(beam[:, 0]), np.ascontiguousarray(beam[:, 1]), np.ascontiguousarray(errors),
               np.ascontiguousarray(quaternions), earth)
    return earth
