"""Frames that would fit an INS whose check has failed, to state them in the diagnostics."""
import itertools

import numpy as np

from pedestal_hardware.ins import frame_check
from pedestal_hardware.ins.frames import BODY_MATRICES, EARTH_MATRICES

MIN_FIT = 0.9
"""Smallest slope of all axes together of a convention that fits, relative to the convention that fits best."""

MIN_UPRIGHT = 0.5  # smallest cosine of the tilt of a deck; a ship is never further from the horizontal


def fitting(check, declared, case, q):
    """Return the (earth, body, rate_body) that fit, those with the fewest changes from the declared ones only.

    check     record of frame_check.Check
    declared  (earth, body, rate_body) of the parameters, which do not fit
    case      rotation case -> deck (3, 3)
    q         last quaternion of the device, in its own frames
    """
    _, body, rate_body = (BODY_MATRICES.get(name) for name in declared)
    cross = case.T @ check['cross'] @ case
    moved, lowest = np.any(check['moved'] > 0.0), frame_check.SLOPE_RANGE[0] * check['rates'].sum()
    force = check['force'] / max(check['force_weight'], 1.0)
    found = []
    for candidate in itertools.product(EARTH_MATRICES, BODY_MATRICES, BODY_MATRICES):
        E, B, R = EARTH_MATRICES[candidate[0]], BODY_MATRICES[candidate[1]], BODY_MATRICES[candidate[2]]
        # In this candidate the attitude turns as a = body B^T w, and the rates are r = rate_body R^T w.
        size = np.sum((rate_body @ R.T @ B @ body.T) * cross)
        upright = (E @ _matrix(q) @ B.T @ case.T)[2, 2] >= MIN_UPRIGHT
        upwards = (case @ R @ rate_body.T @ case.T @ force)[2] > -frame_check.GRAVITY_M_S2
        if candidate != declared and upright and upwards and (not moved or size >= lowest):
            found.append((candidate, size))
    best = max((size for _, size in found), default=0.0)
    found = [candidate for candidate, size in found if not moved or size >= MIN_FIT * best]
    changes = [sum(one != other for one, other in zip(candidate, declared)) for candidate in found]
    return [candidate for candidate, count in zip(found, changes) if count == min(changes)]


def _matrix(q):
    """Return the rotation matrix of a quaternion (x, y, z, w)."""
    x, y, z, w = q
    return np.array(((1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)),
                     (2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)),
                     (2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y))))


def text(candidates):
    """Return the text of fitting conventions, with the names of the parameters."""
    if not candidates:
        return 'no convention fits: compare the axes and the unit of its rates by hand'
    return 'it would fit: ' + ', or '.join('imu.earth = {}, imu.body = {}, imu.rate_body = {}'.format(*candidate)
                                           for candidate in candidates)
