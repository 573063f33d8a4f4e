"""Comparison of the attitude of an INS with its rates, which finds a wrong frame; and the frames that would fit.

Both give the rotation of the deck during a block of BLOCK_TIME_S: a from the attitudes at its begin and end, r from
the rates. Sums over the last blocks, which fade with MEMORY_TIME_S, give for each axis

    slope          sum a_i r_i / sum r_i^2                        1 in equal frames with equal units
    correlation    sum a_i r_i / sqrt(sum a_i^2 sum r_i^2)        1 in equal frames

The slope decides for gyros, because noise of the attitude does not change its mean. A compass smooths its rate of turn
by an unknown filter, so for it only the sign of the correlation decides.

A body frame that differs between attitude and rates exchanges axes or signs. A frame that both share, but not with the
parameters, leaves a and r equal; the direction of the specific force, which points upwards, then finds it.
"""
import itertools
import math
from collections.abc import Sequence
from typing import TypeAlias

import numpy as np

from pedestal_common.compiled import compiled
from pedestal_common.geometry import line_of_sight
from pedestal_common.quantities import AnyRecord, Bit, Matrix3, Nanoseconds, Quaternion, Vector3
from pedestal_common.record import Record
from pedestal_hardware.ins.frames import BODY_MATRICES, EARTH_MATRICES, rotation_vector

BLOCK_TIME_S = 0.2  # length of a block [s]; noise of the attitude matters little over this time
MEMORY_TIME_S = 5.0  # time constant with which old blocks fade [s]
MIN_CHECK_TIME_S = 3.0  # time with motion after which a verdict is given [s]
MIN_RATE_RAD_S = math.radians(0.5)  # rms of the rates of an axis from which it is compared [rad/s]
MIN_ATTITUDE_RATE_RAD_S = math.radians(2.0)  # rms change of the attitude from which an axis is compared [rad/s]
SLOPE_RANGE = 0.3, 3.0  # slopes of an axis that agrees
MIN_TURN_CORRELATION = -0.5  # smallest correlation of a heading that agrees with a rate of turn

JUMP_RAD = math.radians(0.5)
"""Rotation [rad] of the attitude in a block that is a jump of the attitude if the rates explain less than a fifth of
it. A correction of the heading is no wrong frame."""

JUMP_REST_BLOCKS = 10  # number of blocks without a further jump; rates that are always too small are no jumps
GRAVITY_M_S2 = 5.0  # mean specific force [m/s2] whose direction is compared; less: gravity was removed
ALL_AXES, TURN_AXIS = 0b111, 0b100  # bit masks of the axes whose rates are known
MAX_FORCE_M_S2 = 1000.0  # specific force [m/s2] that no ship has; more is not used
FRAME_UNKNOWN, FRAME_RIGHT, FRAME_WRONG = range(3)  # not enough motion, all axes agree, an axis disagrees


class Check(Record):
    """State of the check."""
    runs: Bit               # 1 after the first sample
    begin: Nanoseconds      # stamp of the begin of the block
    last: Nanoseconds       # stamp of the last sample
    q: Quaternion           # at the begin of the block
    w: Vector3              # rate of the last sample [rad/s]
    integral: Vector3       # of the rate since the begin of the block [rad]
    cross: Matrix3          # faded sums r_i a_j [rad2]
    attitude: Vector3       # faded sums a_i^2 [rad2]
    rates: Vector3          # faded sums r_i^2 [rad2]
    weight: float           # faded sum of the blocks
    force: Vector3          # faded sum of the specific force [m/s2]
    force_weight: float     # faded sum of the samples of the specific force
    moved: Vector3          # time during which an axis was compared [s]
    jumps: int              # number of jumps of the attitude
    rest: int               # blocks until the next jump may be
    verdict: int            # FRAME_UNKNOWN, FRAME_RIGHT or FRAME_WRONG
    down: Bit               # 1 if the specific force points downwards


@compiled
def restart(check: Check) -> None:
    """Begin a new block; the sums stay."""
    check.runs = 0


@compiled
def slope(check: Check, i: int) -> float:
    """Return the slope of an axis; infinite without rates."""
    return check.cross[i, i] / check.rates[i]


@compiled
def is_compared(check: Check, i: int) -> bool:
    """Return True if an axis moves enough to be compared."""
    blocks = BLOCK_TIME_S**2 * check.weight
    return check.rates[i] > MIN_RATE_RAD_S**2 * blocks or check.attitude[i] > MIN_ATTITUDE_RATE_RAD_S**2 * blocks


@compiled
def agrees(check: Check, i: int, axes: int) -> bool:
    """Return True if attitude and rates of an axis agree; axes: those of `take`."""
    if axes == ALL_AXES:
        return SLOPE_RANGE[0] <= slope(check, i) <= SLOPE_RANGE[1]
    return check.cross[i, i] >= MIN_TURN_CORRELATION * math.sqrt(check.attitude[i] * check.rates[i])


@compiled
def _close_block(check: Check, q: Quaternion, axes: int) -> None:
    a = rotation_vector(check.q, q)
    size_a, size_r = math.sqrt(a[0]**2 + a[1]**2 + a[2]**2), 0.0
    for i in range(3):
        size_r += check.integral[i]**2
    check.rest = max(check.rest - 1, 0)
    if axes == ALL_AXES and size_a > JUMP_RAD and size_a > 5.0 * math.sqrt(size_r) and check.rest == 0:
        check.jumps += 1
        check.rest = JUMP_REST_BLOCKS
        return
    fade = math.exp(-BLOCK_TIME_S / MEMORY_TIME_S)
    check.weight = fade * check.weight + 1.0
    for i in range(3):
        for j in range(3):
            check.cross[i, j] = fade * check.cross[i, j] + check.integral[i] * a[j]
        check.attitude[i] = fade * check.attitude[i] + a[i]**2
        check.rates[i] = fade * check.rates[i] + check.integral[i]**2
    wrong, right = False, False
    for i in range(3):
        if axes & (1 << i) == 0:
            continue
        if is_compared(check, i):
            check.moved[i] += BLOCK_TIME_S
            if check.moved[i] >= MIN_CHECK_TIME_S:
                good = agrees(check, i, axes)
                right, wrong = right or good, wrong or not good
        else:
            check.moved[i] = 0.0
    if wrong or right:
        check.verdict = FRAME_WRONG if wrong else FRAME_RIGHT


@compiled
def take(check: Check, stamp: Nanoseconds, q: Quaternion, w: Vector3, force: Vector3, axes: int) -> None:
    """Take a sample in the frames that the parameters declare, newer than the last. force: NaN for none; axes:
    ALL_AXES of gyros, TURN_AXIS of a rate of turn."""
    if abs(force[0]) + abs(force[1]) + abs(force[2]) < MAX_FORCE_M_S2:      # also excludes NaN
        k = math.exp(-(stamp - check.last) * 1e-9 / MEMORY_TIME_S) if check.runs else 1.0
        check.force_weight = k * check.force_weight + 1.0
        for i in range(3):
            check.force[i] = k * check.force[i] + force[i]
        check.down = 1 if check.force[2] < -GRAVITY_M_S2 * check.force_weight else 0
    if check.runs:
        T = (stamp - check.last) * 1e-9
        for i in range(3):
            check.integral[i] += 0.5 * T * (check.w[i] + w[i])
    if check.runs and (stamp - check.begin) * 1e-9 > 0.999 * BLOCK_TIME_S:
        _close_block(check, q, axes)
    if check.runs == 0 or (stamp - check.begin) * 1e-9 > 0.999 * BLOCK_TIME_S:
        check.runs, check.begin = 1, stamp
        for i in range(4):
            check.q[i] = q[i]
        for i in range(3):
            check.integral[i] = 0.0
    check.last = stamp
    for i in range(3):
        check.w[i] = w[i]


Convention: TypeAlias = tuple[str, str, str]     # the parameters earth, body, rate_body

MIN_FIT = 0.9  # smallest slope of all axes together of a convention that fits, relative to the best one
MIN_UPRIGHT = 0.5  # smallest cosine of the tilt of a deck; a ship is never further from the horizontal


def fitting_conventions(check: AnyRecord, declared: Convention, case: Matrix3, q: Quaternion) -> list[Convention]:
    """Return the conventions that fit, those with the fewest changes from the declared one only. case: rotation case
    -> deck; q: last quaternion of the device, in its own frames."""
    body, rate_body = (BODY_MATRICES[name] for name in declared[1:])
    cross = case.T @ check['cross'] @ case
    moved, lowest = np.any(check['moved'] > 0.0), SLOPE_RANGE[0] * check['rates'].sum()
    force = check['force'] / max(check['force_weight'], 1.0)
    attitude = np.array(line_of_sight.rows(*q))
    sizes: list[tuple[Convention, float]] = []
    for candidate in itertools.product(EARTH_MATRICES, BODY_MATRICES, BODY_MATRICES):
        E, B, R = EARTH_MATRICES[candidate[0]], BODY_MATRICES[candidate[1]], BODY_MATRICES[candidate[2]]
        # In this candidate the attitude turns as a = body B^T w, and the rates are r = rate_body R^T w.
        size = np.sum((rate_body @ R.T @ B @ body.T) * cross)
        upright = (E @ attitude @ B.T @ case.T)[2, 2] >= MIN_UPRIGHT
        upwards = (case @ R @ rate_body.T @ case.T @ force)[2] > -GRAVITY_M_S2
        if candidate != declared and upright and upwards and (not moved or size >= lowest):
            sizes.append((candidate, size))
    best = max((size for _, size in sizes), default=0.0)
    found = [candidate for candidate, size in sizes if not moved or size >= MIN_FIT * best]
    changes = [sum(one != other for one, other in zip(candidate, declared)) for candidate in found]
    return [candidate for candidate, count in zip(found, changes) if count == min(changes)]


def text_of(candidates: Sequence[Convention]) -> str:
    """Return the text of fitting conventions, with the names of the parameters."""
    if not candidates:
        return 'no convention fits: compare the axes and the unit of its rates by hand'
    return 'it would fit: ' + ', or '.join('imu.earth = {}, imu.body = {}, imu.rate_body = {}'.format(*candidate)
                                           for candidate in candidates)
