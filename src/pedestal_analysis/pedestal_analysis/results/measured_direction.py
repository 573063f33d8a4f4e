"""Measured direction of the target: from encoders, receiver errors and attitude to earth angles."""
import numpy as np

from pedestal_common.compiled import compiled
from pedestal_common.geometry import line_of_sight


@compiled
def _displaced(azimuth, elevation, errors, quaternions, earth):
    """Fill the earth angles (n, 2) of a target at the errors (n, 2) from a beam at deck angles (n,)."""
    mat_ed = np.empty((3, 3))
    for k in range(azimuth.size):
        line_of_sight.rotation(quaternions[k, 0], quaternions[k, 1], quaternions[k, 2], quaternions[k, 3], mat_ed)
        at, up = line_of_sight.displaced(azimuth[k], elevation[k], errors[k, 0], errors[k, 1])
        x, y, z = line_of_sight.direction(at, up)
        east, north, height = line_of_sight.to_earth(mat_ed, x, y, z)
        earth[k, 0], earth[k, 1] = line_of_sight.earth_angles(east, north, height)


def earth_angles(beam, errors, quaternions=None):
    """Return earth azimuth in (-pi, pi] and elevation (n, 2) [rad] of the target, from beam and receiver errors.

    beam (n, 2): deck azimuth and elevation [rad]; errors (n, 2): cross-elevation and elevation [rad]; quaternions
    (n, 4): attitude deck -> earth, None ashore. NaN where an input is NaN.
    """
    if quaternions is None:
        quaternions = np.tile(np.array(line_of_sight.ASHORE_ATTITUDE), (len(beam), 1))
    earth = np.empty((len(beam), 2))
    _displaced(np.ascontiguousarray(beam[:, 0]), np.ascontiguousarray(beam[:, 1]), np.ascontiguousarray(errors),
               np.ascontiguousarray(quaternions), earth)
    return earth
