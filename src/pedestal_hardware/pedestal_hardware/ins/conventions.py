"""Frames that would fit an INS whose check has failed, to state them in the diagnostics."""
import itertools
from collections.abc import Sequence
from typing import TypeAlias

import numpy as np

from pedestal_common.geometry import line_of_sight
from pedestal_common.quantities import AnyRecord, Matrix3, Quaternion
from pedestal_hardware.ins import frame_check
from pedestal_hardware.ins.frames import BODY_MATRICES, EARTH_MATRICES

Convention: TypeAlias = tuple[str, str, str]     # the parameters earth, body, rate_body

MIN_FIT = 0.9
"""Smallest slope of all axes together of a convention that fits, relative to the convention that fits best."""

MIN_UPRIGHT = 0.5  # smallest cosine of the tilt of a deck; a ship is never further from the horizontal


def fitting(check: AnyRecord, declared: Convention, case: Matrix3, q: Quaternion) -> list[Convention]:
    """Return the conventions that fit, those with the fewest changes from the declared one only.

    check     a frame_check.Check
    declared  of the parameters, which does not fit
    case      rotation case -> deck
    q         last quaternion of the device, in its own frames
    """
    body, rate_body = (BODY_MATRICES[name] for name in declared[1:])
    cross = case.T @ check['cross'] @ case
    moved, lowest = np.any(check['moved'] > 0.0), frame_check.SLOPE_RANGE[0] * check['rates'].sum()
    force = check['force'] / max(check['force_weight'], 1.0)
    attitude = np.array(line_of_sight.rows(*q))
    sizes: list[tuple[Convention, float]] = []
    for candidate in itertools.product(EARTH_MATRICES, BODY_MATRICES, BODY_MATRICES):
        E, B, R = EARTH_MATRICES[candidate[0]], BODY_MATRICES[candidate[1]], BODY_MATRICES[candidate[2]]
        # In this candidate the attitude turns as a = body B^T w, and the rates are r = rate_body R^T w.
        size = np.sum((rate_body @ R.T @ B @ body.T) * cross)
        upright = (E @ attitude @ B.T @ case.T)[2, 2] >= MIN_UPRIGHT
        upwards = (case @ R @ rate_body.T @ case.T @ force)[2] > -frame_check.GRAVITY_M_S2
        if candidate != declared and upright and upwards and (not moved or size >= lowest):
            sizes.append((candidate, size))
    best = max((size for _, size in sizes), default=0.0)
    found = [candidate for candidate, size in sizes if not moved or size >= MIN_FIT * best]
    changes = [sum(one != other for one, other in zip(candidate, declared)) for candidate in found]
    return [candidate for candidate, count in zip(found, changes) if count == min(changes)]


def text(candidates: Sequence[Convention]) -> str:
    """Return the text of fitting conventions, with the names of the parameters."""
    if not candidates:
        return 'no convention fits: compare the axes and the unit of its rates by hand'
    return 'it would fit: ' + ', or '.join('imu.earth = {}, imu.body = {}, imu.rate_body = {}'.format(*candidate)
                                           for candidate in candidates)
