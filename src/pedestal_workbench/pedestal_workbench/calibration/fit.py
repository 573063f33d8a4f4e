"""Fit of the terms of the pointing model to offsets: weighted least squares on the sky by SVD.

The unknowns x solve A x = b. A row of A is the effect of the terms on one offset (terms.design), divided by the
standard deviation of this offset; b holds the offsets, divided likewise. The two rows of a point are its
cross-elevation and its elevation. With the singular values s of A, whose columns are scaled to length 1, U and V:

    x = V (U' b / s)          estimate
    C = V diag(1 / s^2) V'    covariance, times the variance of the residuals
    H = U U'                  leverage: the influence of an offset on its own fitted value

The residual of a point against the fit without this point is (I - H_i)^-1 r_i, where H_i is the 2 x 2 block of the
point in H and r_i its residual. Their rms is the leave-one-out rms, the error to be expected in a new direction.

The exact form takes the law of the control unit in place of A x, by the method of Gauss and Newton.
"""
import dataclasses
import math
from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple

import numpy as np
from scipy.special import stdtrit

from pedestal_common.compiled import compiled
from pedestal_common.geometry import pointing_model
from pedestal_common.geometry.line_of_sight import wrap
from pedestal_common.quantities import Degrees, Floats, Ints, Pairs, Records
from pedestal_results.intervals import CONFIDENCE_LEVEL
from pedestal_workbench.calibration import terms
from pedestal_workbench.calibration.calibration import CalibrationError

MIN_POINTS, GOOD_POINTS = 10, 20
"""Smallest number of points for a fit, and number below which a sentence recommends more of them."""
EXTRA_POINTS = 3  # smallest number of points above the number of terms
MIN_ELEVATION_SPAN_DEG = 20.0  # smallest range of the elevations [deg]
MAX_AZIMUTH_GAP_DEG = 160.0  # largest range of azimuths without a point [deg]
_ELEVATION_TERMS = {'P1', 'P3', 'P4'}, {'P7', 'P8', 'P9', 'P11', 'P19', 'P20'}
"""Sets of terms that differ by the elevation only."""

SMALLEST_SINGULAR_VALUE = 1e-8
"""Ratio to the largest singular value below which terms have the same effect at all points [-]."""
SHARED_PART = 0.1  # part of a term in a direction that the data do not determine, from which the term is named [-]
STRONG_CORRELATION = 0.95  # correlation of two terms from which their values must not be trusted, only their sum [-]
OUTLIER_SIGMAS = 4.5
"""Size of a residual above which a point is an outlier [standard deviations]; 1 of 25 000 points without a fault."""
MEDIAN_RAYLEIGH = math.sqrt(math.log(4.0))
"""Median of the length of a vector of two normal numbers [standard deviations]."""

MAX_ITERATIONS, CONVERGENCE_DEG = 30, 1e-10
"""Largest number of iterations of the exact form, and change of the terms that ends them [deg]."""
DIFFERENCE_DEG = 1e-3
"""Change of a term by which the derivative of the law is measured [deg]; the error is of third order."""


def check_distribution(names: Sequence[str], directions: Pairs) -> None:
    """Raise CalibrationError for too few directions [deg], or for directions that leave terms undetermined."""
    az, el = directions.T
    least = max(MIN_POINTS, len(names) + EXTRA_POINTS)
    if len(az) < least:
        raise CalibrationError(f'{len(az)} points, must be at least {least} for {len(names)} terms; {GOOD_POINTS} to '
                               '40 points all over the sky are recommended (--plan)')
    alike = [sorted(group & set(names), key=names.index) for group in _ELEVATION_TERMS if len(group & set(names)) > 1]
    if alike and np.ptp(el) < MIN_ELEVATION_SPAN_DEG:
        raise CalibrationError(f'bad distribution: all elevations are within {el.min():.4g} to {el.max():.4g} deg, '
                               f'and must span at least {MIN_ELEVATION_SPAN_DEG:g} deg to tell '
                               f'{" and ".join(", ".join(group) for group in alike)} apart')
    turning = [name for name in names if name in terms.FULL_TURN_TERMS]
    gap, start = largest_gap(az)
    if turning and gap > MAX_AZIMUTH_GAP_DEG:
        raise CalibrationError(f'bad distribution: no point between azimuth {start % 360.0:.4g} and '
                               f'{(start + gap) % 360.0:.4g} deg, a gap of {gap:.4g} deg, must be at most '
                               f'{MAX_AZIMUTH_GAP_DEG:g} deg for {", ".join(turning)}')


def largest_gap(azimuths: Floats) -> tuple[Degrees, Degrees]:
    """Return (size, start) of the largest range without any of the azimuths [deg], modulo a turn."""
    ordered = np.unique(np.mod(azimuths, 360.0))
    gaps = np.diff(ordered, append=ordered[0] + 360.0)
    place = int(np.argmax(gaps))
    return float(gaps[place]), float(ordered[place])


class Solved(NamedTuple):
    """Singular value decomposition of A, whose columns are scaled to length 1."""
    U: Floats           # (2 n, p)
    s: Floats           # (p,)
    V: Floats           # (p, p), transposed
    lengths: Floats     # (p,) of the columns of A before


@dataclasses.dataclass(frozen=True)
class Fit:
    """Fit of p terms to n offsets."""
    form: str               # `linear`: first order in the terms, as in katpoint; `exact`: the law of the control unit
    names: tuple[str, ...]  # of the p terms
    values: Floats          # (p,) of the terms [deg, or - for a factor]
    covariance: Floats      # (p, p) of the terms, from the noise of the offsets
    of_dropped: Floats      # (p,) variance by the dropped terms, because their effect goes to the terms that are kept
    interval: float         # half the width of the confidence interval of a term [standard deviations]
    condition: float        # ratio of the largest to the smallest singular value, with columns of length 1 [-]
    residuals: Pairs        # offsets minus model [deg]
    left_out: Pairs         # the same against the fit without the point
    scale: float            # standard deviation of the residuals per stated sigma [-], or [deg] without stated sigmas

    @property
    def sigma(self) -> Floats:
        """Standard deviations (p,) of the terms."""
        return np.sqrt(np.diag(self.covariance) + self.of_dropped)

    @property
    def correlation(self) -> Floats:
        """Correlations (p, p) of the terms; 0 where a standard deviation is 0."""
        sigma = np.sqrt(np.diag(self.covariance))
        scale = np.outer(sigma, sigma)
        return np.divide(self.covariance, scale, out=np.eye(len(sigma)), where=scale > 0.0)

    def outliers(self, sigma: Pairs) -> Ints:
        """Return the places of the points whose left-out residual exceeds OUTLIER_SIGMAS of the stated sigma [deg].
        The scale of sigma is taken from the median of the residuals, because an outlier does not move the median."""
        size = np.hypot(*(self.left_out / sigma).T)
        own = np.median(np.hypot(*(self.residuals / sigma).T)) / MEDIAN_RAYLEIGH
        return np.flatnonzero(size > max(OUTLIER_SIGMAS * own, 1e-9))

    def correlated(self) -> list[tuple[str, str, float]]:
        """Return both names and the correlation of the pairs with a strong correlation, the strongest first."""
        matrix = self.correlation
        pairs = [(self.names[j], self.names[i], float(matrix[i, j]))
                 for i in range(len(self.names)) for j in range(i) if abs(matrix[i, j]) > STRONG_CORRELATION]
        return sorted(pairs, key=lambda pair: -abs(pair[2]))


def linear(names: Sequence[str], directions: Pairs, values: Pairs, sigma: Pairs) -> Fit:
    """Return the Fit of terms, to first order, to offsets `values` with standard deviations sigma, all [deg]. Raises
    CalibrationError."""
    A = terms.design(names, directions)
    x, solved = solve(names, A, values, sigma)
    return _fitted('linear', names, x, solved, values - A @ x, sigma)


def solve(names: Sequence[str], A: Floats, values: Pairs, sigma: Pairs) -> tuple[Floats, Solved]:
    """Return (x, Solved) of the weighted least squares. Raises CalibrationError."""
    rows = (A / sigma[:, :, None]).reshape(-1, len(names))
    lengths = np.linalg.norm(rows, axis=0)
    for name, length in zip(names, lengths):
        if length == 0.0:
            raise CalibrationError(f'{name}: has no effect at any of the points')
    U, s, V = np.linalg.svd(rows / lengths, full_matrices=False)
    unknown = V[s < SMALLEST_SINGULAR_VALUE * s[0]]
    if len(unknown):
        shared = [name for name, part in zip(names, np.abs(unknown).max(0)) if part > SHARED_PART]
        raise CalibrationError(f'the offsets cannot tell these terms apart: {", ".join(shared)}; leave one of them '
                               'out (--terms), or add points in other directions')
    b = (values / sigma).reshape(-1)
    return V.T @ (U.T @ b / s) / lengths, Solved(U, s, V, lengths)


def _fitted(form: str, names: Sequence[str], x: Floats, solved: Solved, residuals: Pairs, sigma: Pairs) -> Fit:
    U, s, V, lengths = solved
    n, p = len(residuals), len(names)
    r = residuals / sigma
    degrees = 2 * n - p
    scale = math.sqrt(float((r * r).sum()) / degrees)
    C = (V.T / s**2) @ V / np.outer(lengths, lengths)
    blocks = U.reshape(n, 2, p)
    kept = np.eye(2) - blocks @ blocks.transpose(0, 2, 1)
    if np.linalg.det(kept).min() < SMALLEST_SINGULAR_VALUE:
        place = int(np.argmin(np.linalg.det(kept)))
        raise CalibrationError(f'the offset number {place + 1} determines a term alone; add points near it, or '
                               'correct its sigma if it is far below that of the other offsets')
    left_out = np.linalg.solve(kept, r[:, :, None])[:, :, 0] * sigma
    half = float(stdtrit(degrees, 0.5 * (1.0 + CONFIDENCE_LEVEL)))
    return Fit(form, tuple(names), x, scale**2 * C, np.zeros(p), half, float(s[0] / s[-1]), residuals, left_out, scale)


@compiled
def _exact_offsets(model: Records, directions: Pairs) -> Pairs:
    """Return the offsets [rad] of a PointingModel (1,) at wanted directions [rad]."""
    offsets = np.empty_like(directions)
    for i in range(len(directions)):
        azimuth, elevation = directions[i]
        A, E, _ = pointing_model.encoder_of(model[0], azimuth, elevation)
        offsets[i, 0], offsets[i, 1] = wrap(A - azimuth) * np.cos(elevation), E - elevation
    return offsets


def model(names: Iterable[str], values: Iterable[float]) -> Records:
    """Return the PointingModel (1,) with terms [deg, -]."""
    return pointing_model.model({name.lower(): float(value if terms.TERM_BY_NAME[name].factor else np.radians(value))
                                 for name, value in zip(names, values)})


def exact_offsets(names: Sequence[str], values: Floats, directions: Pairs) -> Pairs:
    """Return the exact offsets [deg] of terms `values` (p,) [deg, -] at directions [deg]."""
    return np.degrees(_exact_offsets(model(names, values), np.radians(directions)))


def exact(names: Sequence[str], directions: Pairs, values: Pairs, sigma: Pairs) -> Fit:
    """Return the Fit of terms as `linear` does, but with the exact law. Raises CalibrationError."""
    x = linear(names, directions, values, sigma).values
    steps = np.array([np.radians(DIFFERENCE_DEG) if terms.TERM_BY_NAME[name].factor else DIFFERENCE_DEG
                      for name in names])
    for _ in range(MAX_ITERATIONS):
        residuals = values - exact_offsets(names, x, directions)
        A = np.stack([(exact_offsets(names, x + step, directions) - exact_offsets(names, x - step, directions))
                      / (2.0 * step.sum()) for step in np.diag(steps)], axis=2)
        change, solved = solve(names, A, residuals, sigma)
        x = x + change
        if np.abs(change).max() < CONVERGENCE_DEG:
            return _fitted('exact', names, x, solved, values - exact_offsets(names, x, directions), sigma)
    raise CalibrationError(f'the exact fit has not converged in {MAX_ITERATIONS} iterations; remove outliers and '
                           'points at the zenith')


def without_doubtful(names: Sequence[str],
                     fit: Callable[[Sequence[str]], Fit]) -> tuple[Fit, list[tuple[str, float, float]]]:
    """Return (Fit, [(name, value, sigma)] of the dropped terms) after each term below its sigma is dropped.

    The most doubtful term is dropped first, because each drop changes the other terms. A dropped term is not 0, but
    smaller than its sigma. So the variance of a kept term is at least its variance in the fit of all terms.
    """
    whole = found = fit(names)
    dropped = []
    while len(found.names) > 1:
        doubt = found.sigma / np.maximum(np.abs(found.values), 1e-300)
        worst = int(np.argmax(doubt))
        if doubt[worst] <= 1.0:
            break
        dropped.append((found.names[worst], float(found.values[worst]), float(found.sigma[worst])))
        found = fit(tuple(name for name in found.names if name != found.names[worst]))
    with_all = dict(zip(whole.names, np.diag(whole.covariance)))
    extra = [max(with_all[name] - own, 0.0) for name, own in zip(found.names, np.diag(found.covariance))]
    return dataclasses.replace(found, of_dropped=np.array(extra)), dropped


def unit_covariance(names: Sequence[str], directions: Pairs) -> Floats:
    """Return the covariance (p, p) of terms that are fitted to offsets with a standard deviation of 1 deg."""
    rows = terms.design(names, directions).reshape(-1, len(names))
    return np.linalg.inv(rows.T @ rows)


def model_error(names: Sequence[str], covariance: Floats, directions: Pairs) -> Degrees:
    """Return the rms error of a model with a covariance (p, p) on the sky, of both axes together, over directions."""
    A = terms.design(names, directions)
    return math.sqrt(float(np.einsum('nip,pq,niq->', A, covariance, A)) / (2 * len(directions)))
