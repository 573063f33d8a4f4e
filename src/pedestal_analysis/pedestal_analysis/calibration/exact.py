"""Fit of the terms by the method of Gauss and Newton. It uses the exact law of the pointing model, as the control
unit does."""
from collections.abc import Iterable, Sequence

import numpy as np

from pedestal_analysis.calibration import fit, terms
from pedestal_common.compiled import compiled
from pedestal_common.geometry import pointing_model
from pedestal_common.geometry.line_of_sight import wrap
from pedestal_common.quantities import Floats, Pairs, Records

MAX_ITERATIONS, CONVERGENCE_DEG = 30, 1e-10
"""Largest number of iterations, and change of the terms that ends them [deg]."""
DIFFERENCE_DEG = 1e-3
"""Change of a term by which the derivative of the law is measured [deg]; the error is of third order."""


@compiled
def _offsets(model: Records, directions: Pairs) -> Pairs:
    """Return the offsets of a PointingModel (1,) on the sky [rad]: cross-elevation and elevation to add to the
    command.

    directions: wanted azimuth and elevation [rad]
    """
    offsets = np.empty_like(directions)
    for i in range(len(directions)):
        azimuth, elevation = directions[i]
        A, E, _ = pointing_model.encoder_of(model[0], azimuth, elevation)
        offsets[i, 0], offsets[i, 1] = wrap(A - azimuth) * np.cos(elevation), E - elevation
    return offsets


def model(names: Iterable[str], values: Iterable[float]) -> Records:
    """Return the PointingModel (1,) with terms [deg, -]; see pointing_model.model."""
    return pointing_model.model({name.lower(): float(value if terms.TERM_BY_NAME[name].factor else np.radians(value))
                                 for name, value in zip(names, values)})


def offsets(names: Sequence[str], values: Floats, directions: Pairs) -> Pairs:
    """Return the exact offsets [deg] of terms `values` (p,) [deg, -] at directions [deg]."""
    return np.degrees(_offsets(model(names, values), np.radians(directions)))


def exact(names: Sequence[str], directions: Pairs, values: Pairs, sigma: Pairs) -> fit.Fit:
    """Return the Fit of terms as fit.linear does, but with the exact law. Raises FitError."""
    x = fit.linear(names, directions, values, sigma).values
    steps = np.array([np.radians(DIFFERENCE_DEG) if terms.TERM_BY_NAME[name].factor else DIFFERENCE_DEG
                      for name in names])
    for _ in range(MAX_ITERATIONS):
        residuals = values - offsets(names, x, directions)
        A = np.stack([(offsets(names, x + step, directions) - offsets(names, x - step, directions))
                      / (2.0 * step.sum()) for step in np.diag(steps)], axis=2)
        change, solved = fit.solve(names, A, residuals, sigma)
        x = x + change
        if np.abs(change).max() < CONVERGENCE_DEG:
            return fit.fitted('exact', names, x, solved, values - offsets(names, x, directions), sigma)
    raise fit.FitError(f'the exact fit has not converged in {MAX_ITERATIONS} iterations; remove outliers and points '
                       'at the zenith')
