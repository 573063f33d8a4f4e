"""The one procedure that tunes the parameters of a filter.

It minimises a criterion (the angle rms of a study, the negative log-likelihood of a bag's innovations) over the
logarithms of the kind's own parameters: first on their grids, for one or two of them; then, from the best point
(from the given parameters where there are more than two), by the simplex of Nelder and Mead until the parameters stay
within 2 %. The result must be judged on other seeds, or on another part of the recording.
"""
import itertools
import math

import numpy as np
from scipy.optimize import minimize

from acu_tracker.estimation.filters.kinds import named_models
from acu_tracker.estimation.params import FilterParameters
from pedestal_common import parameters

LOG_TOLERANCE = 0.02
"""Of the logarithms."""

FAILED_COST = 1e300
"""Value of a criterion that is not finite; finite itself, so that the simplex can take differences."""


def names(params):
    """The parameters that are searched for FilterParameters."""
    if params.kind.startswith('imm'):
        return ('imm.dwell', *(f'imm.{name}' for model in named_models(params.imm.models) for name in _of_kind(model)))
    return _of_kind(params.kind)


def _of_kind(kind):
    return tuple(name for name, field in parameters.flatten(FilterParameters)
                 if name.startswith(f'{kind}.') and field.metadata.get('grid'))


def tuned(params, criterion, searched=None):
    """(parameters with the least criterion, that criterion), searched from FilterParameters or UkfParameters.

    criterion: function of them, infinite or NaN where it has no value. searched: names, None: those of `names`.
    Raises ValueError where it has no value anywhere.
    """
    searched = names(params) if searched is None else tuple(searched)
    given = parameters.as_dict(params)
    fields = dict(parameters.flatten(type(params)))
    bounds = [(math.log(fields[name].metadata['low'] or 1e-9), math.log(fields[name].metadata['high']))
              for name in searched]

    def at(x):
        limited = [min(max(value, low), high) for value, (low, high) in zip(x, bounds)]
        changes = {name: min(max(math.exp(value), fields[name].metadata['low']), fields[name].metadata['high'])
                   for name, value in zip(searched, limited)}
        return parameters.build(type(params), {**given, **changes})

    def cost(x):
        value = criterion(at(x))
        return value if math.isfinite(value) else FAILED_COST

    start = [math.log(given[name]) for name in searched]
    grids = [fields[name].metadata['grid'] for name in searched]
    if len(grids) <= 2 and all(grids):
        points = itertools.product(*(np.linspace(math.log(low), math.log(high), n) for low, high, n in grids))
        start = min([start, *points], key=cost)
    corners = np.vstack((start, np.asarray(start) + 0.7 * np.eye(len(start))))
    options = {'initial_simplex': corners, 'xatol': LOG_TOLERANCE, 'fatol': math.inf, 'maxfev': 100 * len(start)}
    optimum = minimize(cost, start, method='Nelder-Mead', bounds=bounds, options=options)
    if optimum.fun >= FAILED_COST:
        raise ValueError(f'no {", ".join(searched)} gives a finite criterion')
    return at(optimum.x), float(optimum.fun)
