"""Estimates of an axis from its Motion: friction, lash, bias, encoder. No estimate: the motions do not show it.

The intervals are by the jackknife over parts of the data (results.intervals).
"""
import math
from collections.abc import Callable, Iterable, Sequence
from typing import TypeAlias, TypeVar

import numpy as np
from numpy.typing import ArrayLike
from scipy.ndimage import binary_erosion
from scipy.optimize import least_squares

from pedestal_common.quantities import Estimate, Floats, NewtonMeters, Pairs, RadiansPerSecond, Vectors3
from pedestal_results import tracking
from pedestal_results.intervals import interval, pseudo_values
from pedestal_workbench.calibration.drive.motion_data import Motion

Estimates: TypeAlias = dict[str, Estimate]  # {name of a property: its estimate}
_Part = TypeVar('_Part')

PART_COUNT, BLOCK_COUNT = 10, 80
"""Numbers of parts of the jackknife, and of blocks of neighbouring steps that are distributed over the parts."""
PLATEAU_S, PLATEAU_SETTLING_S = 0.5, 0.5
"""Length of a piece of constant rate [s], and time after its beginning that is left out [s]."""
PLATEAU_CHANGE = 0.08  # largest change of the rate within a piece of constant rate, per rate [-]
MIN_PLATEAUS, MIN_RATES = 12, 3  # smallest number of pieces of constant rate, and of different rates among them
SLOW_RATE_RAD_S = 6e-3  # rate below which the static part of the friction shows [rad/s]
MIN_LASH_ROWS = 40  # smallest number of steps with each sign of the torque of a motor
STRONG_TORQUE_SHARE, CONTACT_TIME_S = 0.15, 0.02
"""Share of the largest torque of a motor [-], and time before and after a step [s]. With this torque during this time
the teeth are in firm contact. This avoids steps at which a motor still crosses the lash."""
MIN_TURN_RAD, TURN_RATE_SHARE, TURN_SETTLING_S = math.radians(300.0), 0.98, 1.0
"""Smallest angle of a turn [rad], least rate over the usual rate [-], and time at the begin that is left out [s]."""
TABLE_STEP_RAD = math.radians(5.0)
"""Step of the table of the encoder, and width of the angles whose mean is one row [rad]."""


def interleaved(rows: Floats) -> list[Floats]:
    """Return PART_COUNT parts of rows: each has every PART_COUNT-th of BLOCK_COUNT blocks, so that parts are alike."""
    blocks = np.array_split(rows, BLOCK_COUNT)
    return [np.concatenate(blocks[k::PART_COUNT]) for k in range(PART_COUNT)]


def jackknife(names: Sequence[str], parts: list[_Part], statistic: Callable[[list[_Part]], ArrayLike]) -> Estimates:
    """Return the estimates of a vector of statistics over parts."""
    whole = np.asarray(statistic(parts))
    values = pseudo_values(parts, lambda kept: np.asarray(statistic(kept)))
    found = {}
    for i, name in enumerate(names):
        mean, low, high = interval(values[:, i])
        found[name] = (float(whole[i]), float(whole[i] + low - mean), float(whole[i] + high - mean))
    return found


def plateaus(motion: Motion, torque: Floats) -> Vectors3:
    """Return mean rate [rad/s], torque on the load [Nm] and angle [rad] of the pieces of constant rate."""
    size, settling = round(PLATEAU_S / motion.period), round(PLATEAU_SETTLING_S / motion.period)
    slow = np.convolve(motion.v, np.ones(size) / size, 'same')
    steady = (np.abs(motion.v - slow) < PLATEAU_CHANGE * np.abs(slow) + 1e-4) & (np.abs(slow) > 2e-4)
    pieces = []
    for first, last in tracking.stretches(steady):
        for start in range(first + settling, last - size + 1, size):
            part = slice(start, start + size)
            pieces.append((motion.v[part].mean(), torque[part].mean(), motion.theta[part].mean()))
    return np.array(pieces).reshape(-1, 3)


def friction_torque(v: Floats, coulomb: NewtonMeters, breakaway: NewtonMeters, stribeck_rate: RadiansPerSecond,
                    viscous: float) -> Floats:
    """Return the friction torque [Nm] of the load at constant rates v [rad/s]: Coulomb, Stribeck and viscous parts.
    Canudas de Wit et al., IEEE Trans. Automatic Control 40 (1995) 419, at a constant rate."""
    static = (breakaway - coulomb) * np.exp(-(v / stribeck_rate)**2)
    return np.sign(v) * (coulomb + static) + viscous * v


FRICTION_NAMES = 'coulomb', 'breakaway', 'stribeck_rate', 'viscous', 'unbalance', 'offset'


def friction(pieces: Vectors3, gravity: bool) -> Estimates:
    """Return the estimates FRICTION_NAMES from pieces of constant rate. Raises ValueError for too few of them.
    `unbalance` is the torque of gravity at angle 0, `offset` a torque that does not depend on the rate, as by wind."""
    rates = np.unique(np.round(np.log10(np.abs(pieces[:, 0])), 1)) if len(pieces) else ()
    if len(pieces) < MIN_PLATEAUS or len(rates) < MIN_RATES:
        raise ValueError(f'{len(pieces)} pieces of constant rate at {len(rates)} rates, must be at least '
                         f'{MIN_PLATEAUS} at {MIN_RATES}: run the motions of --plan')
    if not (pieces[:, 0].min() < 0.0 < pieces[:, 0].max()):
        raise ValueError('all rates have one sign; the motions must go both ways')

    def statistic(parts: list[Floats]) -> Floats:
        rows = np.concatenate(parts)
        v, torque, theta = rows.T
        level = np.abs(torque).mean()

        def residual(x: Floats) -> Floats:
            gravity_torque = x[4] * np.cos(theta) if gravity else 0.0
            # Each rate has about the same number of pieces; a relative noise of the rate is a noise of the torque.
            return (friction_torque(v, x[0], x[0] + abs(x[1]), math.exp(x[2]), x[3]) + gravity_torque + x[5]
                    - torque) / level

        begin = np.array([level, 0.3 * level, math.log(2e-3), 0.0, 0.0, 0.0])
        x = least_squares(residual, begin, x_scale=np.array([level, level, 1.0, level, level, level])).x
        return np.array((x[0], x[0] + abs(x[1]), math.exp(x[2]), *x[3:]))

    found = jackknife(FRICTION_NAMES, [pieces[k::PART_COUNT] for k in range(PART_COUNT)], statistic)
    # Without slow rates, or without a static part, the data do not show the Stribeck rate.
    static, slow = found['breakaway'][0] - found['coulomb'][0], np.abs(pieces[:, 0]) < SLOW_RATE_RAD_S
    if slow.sum() < 4 or static < 0.02 * found['coulomb'][0]:
        found.pop('breakaway'), found.pop('stribeck_rate')
    if not gravity:
        found.pop('unbalance')
    return found


def lash(parts: Iterable[tuple[Motion, Pairs]], ratio: float) -> Estimates:
    """Return the estimates `lash` [rad] and `stiffness` [Nm/rad] of a mesh on the load axis.

        theta_i / N - theta = z_i + lash / 2 sign(T_i) + N T_i / k

    parts: motion and torques T of the motors on the gear [Nm] of each recording; N: ratio; theta_i: angle of motor i;
    z_i: zero of its encoder; k: stiffness. A motor shows the lash only if its torque changes the sign, without bias
    torque or at an acceleration above it. Then the teeth touch with both flanks.
    """
    rows, times, before = [], [], 0
    for motion, torque in parts:
        contact = np.ones(2 * round(CONTACT_TIME_S / motion.period) + 1)
        for i in range(2):
            T = torque[:, i]
            least = STRONG_TORQUE_SHARE * np.percentile(np.abs(T), 99.5)
            flanks = [binary_erosion(sign * T > least, contact) for sign in (1.0, -1.0)]
            if min(flank.sum() for flank in flanks) < MIN_LASH_ROWS:
                continue
            strong = flanks[0] | flanks[1]
            zeros = np.zeros((strong.sum(), 2))
            zeros[:, i] = 1.0
            rows.append(np.column_stack((0.5 * np.sign(T[strong]), ratio * T[strong], zeros,
                                         (motion.motor_angle[:, i] - motion.theta)[strong])))
            times.append(before + np.flatnonzero(strong))
        before += len(torque)
    if not rows:
        return {}
    A = np.concatenate(rows)
    shares = interleaved(A[np.argsort(np.concatenate(times), kind='stable')][:, np.abs(A).sum(0) > 0.0])

    def statistic(kept: list[Floats]) -> ArrayLike:
        table = np.concatenate(kept)
        return np.linalg.lstsq(table[:, :-1], table[:, -1], rcond=None)[0][:2]

    found = jackknife(('lash', 'compliance'), shares, statistic)
    value, low, high = found.pop('compliance')
    if low > 0.0:
        found['stiffness'] = (1.0 / value, 1.0 / high, 1.0 / low)
    return found


def bias(motion: Motion, hold: NewtonMeters) -> Estimates:
    """Return the estimate `torque` of the bias [Nm]: half the difference of the motors at a small common torque. hold:
    torque demand per motor up to which the bias is full."""
    common = np.abs(motion.motor_torque.mean(1))
    small = np.flatnonzero(common < 0.5 * hold)
    if small.size < PART_COUNT:
        return {}
    half = 0.5 * (motion.motor_torque[:, 0] - motion.motor_torque[:, 1])
    parts = [half[part] for part in np.array_split(small, PART_COUNT)]
    return jackknife(('torque',), parts, lambda kept: (np.median(np.concatenate(kept)),))


def encoder(motion: Motion, pinion_ratio: float) -> tuple[Estimates, Pairs]:
    """Return (estimates, table) of the error of the load encoder against the motors, over a turn.

    The table holds angle and error [rad] at every 5 deg: the mean of both directions, less the mean over the turn.
    Without a turn both ways, both are empty. pinion_ratio (bull gear to pinion) removes the error of the pinions.
    """
    forth, back = _turn(motion, 1.0), _turn(motion, -1.0)
    if forth is None or back is None:
        return {}, np.zeros((0, 2))
    ways, rows = (forth, back), []
    for sign, part in zip((1.0, -1.0), ways):
        theta = motion.theta[part]
        error = theta - motion.motor_angle[part].mean(1)
        rows.append(np.column_stack((np.sin(theta), np.cos(theta), np.ones_like(theta), np.full_like(theta, sign),
                                     np.sin(pinion_ratio * theta), np.cos(pinion_ratio * theta), error)))
    parts = interleaved(np.concatenate(rows))

    def statistic(kept: list[Floats]) -> ArrayLike:
        table = np.concatenate(kept)
        return np.linalg.lstsq(table[:, :-1], table[:, -1], rcond=None)[0][:2]

    found = jackknife(('eccentricity_sin', 'eccentricity_cos'), parts, statistic)
    return found, _table(motion, ways)


def _turn(motion: Motion, sign: float) -> slice | None:
    """Return the longest stretch in one direction, of at least MIN_TURN_RAD, without the accelerations at its ends.
    The torques of accelerations twist the gears."""
    longest, settling = None, round(TURN_SETTLING_S / motion.period)
    for first, last in tracking.stretches(sign * motion.v > 1e-2):
        rate = sign * motion.v[first:last]
        fast = first + np.flatnonzero(rate > TURN_RATE_SHARE * np.median(rate))
        way = abs(motion.theta[fast[-1]] - motion.theta[fast[0]])
        if way >= MIN_TURN_RAD and (longest is None or way > longest[0]):
            longest = way, slice(fast[0] + settling, fast[-1] + 1)
    return longest and longest[1]


def _table(motion: Motion, ways: Sequence[slice]) -> Pairs:
    """Return the table of `encoder` from the two parts of the turn."""
    half = 0.5 * TABLE_STEP_RAD
    low = max(motion.theta[part].min() for part in ways) + half
    high = min(motion.theta[part].max() for part in ways) - half
    angles = TABLE_STEP_RAD * np.arange(math.ceil(low / TABLE_STEP_RAD), math.floor(high / TABLE_STEP_RAD) + 1)
    errors = []
    for part in ways:
        theta = motion.theta[part]
        error = theta - motion.motor_angle[part].mean(1)
        errors.append([error[np.abs(theta - angle) < half].mean() for angle in angles])
    mean = np.mean(errors, axis=0)
    return np.column_stack((angles, mean - mean.mean()))
