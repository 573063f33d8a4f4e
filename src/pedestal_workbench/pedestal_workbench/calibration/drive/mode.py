"""Inertia of the load and the first mode of the structure, from the torque on the load and the motion of its base.

The gears and the load encoder are on the base, on which the dish swings:

    T = J_b a + J_d a_d + friction,    a_d = H a,    H(s) = (2 zeta w s + w^2) / (s^2 + 2 zeta w s + w^2)

    T, a        torque on the load [Nm], acceleration of the base [rad/s2]
    a_d         acceleration of the dish [rad/s2]
    J_b, J_d    inertias of base and dish [kg m2]; their sum is the inertia of the load
    w, zeta     frequency [rad/s] and damping ratio of the dish on a locked base

For given w and zeta the other unknowns follow by linear least squares, so only w and zeta are searched (variable
projection, Golub and Pereyra, SIAM J. Numerical Analysis 10 (1973) 413). The control loops do not change this
relation.
"""
import math
from collections.abc import Callable, Iterable, Mapping, Sequence

import numpy as np
from scipy import signal
from scipy.optimize import minimize

from pedestal_common.quantities import Floats, Ints, RadiansPerSecond, Seconds
from pedestal_workbench.calibration.drive.estimates import (
    PART_COUNT,
    Estimates,
    friction_torque,
    interleaved,
    jackknife,
)
from pedestal_workbench.calibration.drive.motion_data import Motion

FREQUENCY_RANGE_HZ, FREQUENCY_COUNT = (2.0, 30.0), 90
"""Range of the searched frequencies [Hz] and number of trial frequencies."""
START_DAMPING, MAX_DAMPING = 0.02, 0.5  # first damping ratio and largest damping ratio of the search [-]
MIN_GAIN = 0.25  # least share of the squared residuals that a mode must explain [-]
MIN_SHARE = 0.03  # least inertia of the dish over the inertia without a mode [-]
FREQUENCY_STEP = 0.01  # relative step of the frequency for the interval of a frequency [-]
MIN_RATE_RAD_S = 0.01  # least rate of the steps that are used [rad/s]; at this rate the friction slides
ACTIVE_SHARE, ACTIVE_TIME_S = 0.02, 0.5
"""Share of the largest acceleration above which a step is active [-], and width of the time around it [s]."""
ROW_STEP, MIN_ROWS = 2, 200
"""Step from one used row to the next, which the smoothing allows, and smallest number of rows."""


def identify(parts: Iterable[tuple[Motion, Floats]], friction: Estimates, gravity: bool,
             flexible: bool = True) -> Estimates:
    """Return the estimates `inertia` [kg m2], and with a mode `dish_inertia` [kg m2], `frequency` [Hz] and `damping`.

    parts: motion and torque on the load [Nm] of each recording; friction: estimates.friction, whose torque at constant
    rate is subtracted; gravity: True if the torque of gravity depends on the angle.
    """
    known = {name: found[0] for name, found in friction.items()}
    data = [_rows(motion, torque, known, gravity) for motion, torque in parts]
    rows = np.concatenate([chosen for *_, chosen in data])
    if len(rows) < MIN_ROWS:
        return {}
    if not flexible:
        return _rigid(rows)

    def dish(w: float, zeta: float) -> Floats:
        return np.concatenate([_swing(period, a, used, w, zeta) for period, a, used, _ in data])

    def cost(x: Sequence[float]) -> float:
        return _cost(rows, dish(math.exp(x[0]), min(math.exp(x[1]), MAX_DAMPING)))

    trials = np.log(2.0 * math.pi * np.geomspace(*FREQUENCY_RANGE_HZ, FREQUENCY_COUNT))
    costs = [cost((trial, math.log(START_DAMPING))) for trial in trials]
    best = int(np.argmin(costs))
    if costs[best] < (1.0 - MIN_GAIN) * _cost(rows):
        found = minimize(cost, (trials[best], math.log(START_DAMPING)), method='Nelder-Mead',
                         options={'xatol': 1e-4, 'fatol': 1e-9 * costs[best], 'maxiter': 60})
        w, zeta = math.exp(found.x[0]), min(math.exp(found.x[1]), MAX_DAMPING)
        if _solved(rows, dish(w, zeta))[-1] > MIN_SHARE * abs(_solved(rows)[0]):
            return _flexible(rows, dish, w, zeta)
    return _rigid(rows)


def _rigid(rows: Floats) -> Estimates:
    return jackknife(('inertia',), interleaved(rows), lambda kept: _solved(np.concatenate(kept))[:1])


def inertia_torque(motion: Motion, found: Estimates) -> Floats:
    """Return the torque (n,) [Nm] that accelerates base and dish; found: estimates of `identify`."""
    if 'frequency' not in found:
        return found['inertia'][0] * motion.a if 'inertia' in found else np.zeros_like(motion.a)
    J, J_d, f, zeta = (found[name][0] for name in ('inertia', 'dish_inertia', 'frequency', 'damping'))
    return (J - J_d) * motion.a + J_d * _swing(motion.period, motion.a, slice(None), 2.0 * math.pi * f, zeta)


def _flexible(rows: Floats, dish: Callable[[float, float], Floats], w: RadiansPerSecond, zeta: float) -> Estimates:
    """Return the estimates of a structure near w, zeta; dish(w, zeta): acceleration of the dish."""
    # Around the optimum the cost of each part is a parabola over the frequency, so each part gives its frequency.
    around = [interleaved(np.column_stack((dish(w * math.exp(k * FREQUENCY_STEP), zeta), rows)))
              for k in (-1, 0, 1)]

    def statistic(kept: list[int]) -> tuple[float, float, float]:
        tables = [np.concatenate([parts[k] for k in kept]) for parts in around]
        low, middle, high = (_cost(table[:, 1:], table[:, 0]) for table in tables)
        curvature = low - 2.0 * middle + high
        shift = 0.5 * (low - high) / curvature if curvature > 0.0 else 0.0
        J_b, *_, J_d = _solved(tables[1][:, 1:], tables[1][:, 0])
        return J_b + J_d, J_d, w * math.exp(FREQUENCY_STEP * shift) / (2.0 * math.pi)

    found = jackknife(('inertia', 'dish_inertia', 'frequency'), list(range(PART_COUNT)), statistic)
    return {**found, 'damping': (zeta, math.nan, math.nan)}


def _rows(motion: Motion, torque: Floats, known: Mapping[str, float],
          gravity: bool) -> tuple[Seconds, Floats, Ints, Floats]:
    """Return (period, acceleration (n,), used steps, their rows (k, 4): acceleration, sign of the rate, rate, torque
    less friction)."""
    v, period = motion.v, motion.period
    kinds = {'coulomb': known['coulomb'], 'breakaway': known.get('breakaway', known['coulomb']),
             'stribeck_rate': known.get('stribeck_rate', 2e-3), 'viscous': known['viscous']}
    rest = torque - friction_torque(v, **kinds) - known['offset']
    if gravity:
        rest = rest - known['unbalance'] * np.cos(motion.theta)
    # Near the active steps the dish still swings; quiet steps at constant rate would only add noise.
    active = np.abs(motion.a) > ACTIVE_SHARE * np.abs(motion.a).max()
    size = max(1, round(ACTIVE_TIME_S / period))
    used = np.flatnonzero((np.abs(v) > MIN_RATE_RAD_S) & (np.convolve(active, np.ones(size), 'same') > 0))[::ROW_STEP]
    return period, motion.a, used, np.column_stack((motion.a, np.sign(v), v, rest))[used]


def _swing(period: Seconds, a: Floats, used: Ints | slice, w: RadiansPerSecond, zeta: float) -> Floats:
    """Return the acceleration [rad/s2] of the dish at the used steps; a (n,): of the base at all steps."""
    # Bilinear transform that is exact at w.
    K = w / math.tan(0.5 * w * period)
    both, damping = w * w, 2.0 * zeta * w * K
    b = both + damping, 2.0 * both, both - damping
    den = K * K + damping + both, 2.0 * (both - K * K), K * K - damping + both
    return signal.lfilter(b, den, a)[used]


def _normal(rows: Floats, dish: Floats | None) -> tuple[Floats, Floats, float]:
    """Return the normal equations (matrix, right side) and the sum of the squared torques of rows."""
    columns = rows[:, :-1] if dish is None else np.column_stack((rows[:, :-1], dish))
    torque = rows[:, -1]
    # For so few columns einsum is faster than BLAS, whose threads wait for each other on a busy machine.
    return (np.einsum('ij,ik->jk', columns, columns), np.einsum('ij,i->j', columns, torque),
            float(np.einsum('i,i->', torque, torque)))


def _solved(rows: Floats, dish: Floats | None = None) -> Floats:
    """Return the unknowns of rows by least squares: J_b, corrections of the friction, and J_d if `dish` is given."""
    matrix, right, _ = _normal(rows, dish)
    scale = 1.0 / np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    return scale * (np.linalg.pinv(matrix * np.outer(scale, scale), hermitian=True) @ (scale * right))


def _cost(rows: Floats, dish: Floats | None = None) -> float:
    _, right, whole = _normal(rows, dish)
    return max(whole - float(right @ _solved(rows, dish)), 0.0)
