"""The one procedure by which the parameters of a filter are found.

The criterion (a number to make small: the angle rms of a study, the negative log-likelihood of a bag's innovations)
is taken as a function of the logarithms of the kind's own parameters. First on a grid over RANGES, for one or two of
them; then, from the best point (from the given parameters where there are more than two), downhill by the simplex of
Nelder and Mead until the parameters stay within 2 %. Judge the result on seeds, or a part of the recording, of its
own.
"""
import itertools
import math

import numpy as np
from scipy.optimize import minimize

from acu_tracker.estimation.kinds import named_models
from pedestal_common import parameters

RANGES = {'alpha_beta.alpha': (0.003, 0.8, 8), 'alpha_beta_gamma.alpha': (0.003, 0.8, 8),
          'cv.noise': (1e-6, 1.0, 7), 'ca.noise': (1e-6, 10.0, 8),
          'singer.alpha': (0.03, 3.0, 3), 'singer.sigma': (1e-5, 1.0, 6),
          'current_statistical.alpha': (0.03, 3.0, 3), 'current_statistical.a_max': (1e-4, 1.0, 5)}
"""Lowest and highest value and number of points of the grid; the search that follows may leave it."""

TOLERANCE = 0.02
"""Of the logarithms."""

FAILED = 1e300
"""Stands for the criterion where it does not work: finite, so that the simplex can tell its differences."""


def names(params):
    """The parameters that are searched for FilterParameters."""
    if params.kind.startswith('imm'):
        return ('imm.dwell', *(f'imm.{name}' for model in named_models(params.imm.models) for name in _of_kind(model)))
    return _of_kind(params.kind)


def _of_kind(kind):
    return tuple(name for name in RANGES if name.startswith(f'{kind}.'))


def tuned(params, criterion, searched=None):
    """(parameters with the least criterion found, that criterion), from FilterParameters or UkfParameters.

    criterion: function of them, infinite or NaN where it does not work. searched: names, None: those of `names`.
    Raises ValueError where it works nowhere.
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
        return value if math.isfinite(value) else FAILED

    start = [math.log(given[name]) for name in searched]
    if len(searched) <= 2 and set(searched) <= set(RANGES):
        grid = itertools.product(*(np.linspace(math.log(low), math.log(high), points)
                                   for low, high, points in (RANGES[name] for name in searched)))
        start = min([start, *grid], key=cost)
    corners = np.vstack((start, np.asarray(start) + 0.7 * np.eye(len(start))))
    options = {'initial_simplex': corners, 'xatol': TOLERANCE, 'fatol': math.inf, 'maxfev': 100 * len(start)}
    found = minimize(cost, start, method='Nelder-Mead', bounds=bounds, options=options)
    if found.fun >= FAILED:
        raise ValueError(f'no {", ".join(searched)} gives a finite criterion')
    return at(found.x), float(found.fun)
