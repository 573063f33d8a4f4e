"""Search for the parameters of a filter that minimise a criterion, for `pedestal tune --filter` and the studies. The
search works on the logarithms of the parameters. One or two parameters are first searched on their grids. The simplex
method of Nelder and Mead then starts from the best point of the grid, with more than two parameters from the given
parameters. The result must be validated on other seeds, or on another part of the recording."""
import itertools
import math
from collections.abc import Callable, Iterable, Sequence
from typing import TypeVar

import numpy as np
from scipy.optimize import minimize

from acu_tracker.estimation.filters.kinds import named_models
from acu_tracker.estimation.params import FilterParameters
from pedestal_common import parameters

_Params = TypeVar('_Params', bound=parameters.Parameters)
LOG_TOLERANCE = 0.02  # difference between the logarithms of the parameters at which the simplex ends [-]

FAILED_COST = 1e300
"""Cost in place of a criterion that is not finite. Because the simplex subtracts costs, this cost is finite."""


def names(params: FilterParameters) -> tuple[str, ...]:
    """Return the names of the searched parameters."""
    if params.kind.startswith('imm'):
        return ('imm.dwell', *(f'imm.{name}' for model in named_models(params.imm.models) for name in _of_kind(model)))
    return _of_kind(params.kind)


def _of_kind(kind: str) -> tuple[str, ...]:
    return tuple(name for name, field in parameters.flatten(FilterParameters)
                 if name.startswith(f'{kind}.') and field.metadata.get('grid'))


def tuned(params: _Params, criterion: Callable[[_Params], float],
          searched: Iterable[str] | None = None) -> tuple[_Params, float]:
    """Return (best parameters, their criterion) of a search from given FilterParameters or UkfParameters. The
    criterion is infinite or NaN without a value. searched: names of the searched parameters, None for those of
    `names`. Raises ValueError if no parameters give a finite criterion."""
    if searched is None:
        assert isinstance(params, FilterParameters)
        searched = names(params)
    else:
        searched = tuple(searched)
    given = parameters.as_dict(params)
    fields = dict(parameters.flatten(type(params)))
    # The logarithm of 0 does not exist, so a range that begins at 0 is searched from 1e-9 on.
    bounds = [(math.log(fields[name].metadata['low'] or 1e-9), math.log(fields[name].metadata['high']))
              for name in searched]

    def at(x: Iterable[float]) -> _Params:
        limited = [min(max(value, low), high) for value, (low, high) in zip(x, bounds)]
        changes = {name: min(max(math.exp(value), fields[name].metadata['low']), fields[name].metadata['high'])
                   for name, value in zip(searched, limited)}
        return parameters.build(type(params), {**given, **changes})

    def cost(x: Iterable[float]) -> float:
        value = criterion(at(x))
        return value if math.isfinite(value) else FAILED_COST

    start: Sequence[float] = [math.log(given[name]) for name in searched]
    grids = [fields[name].metadata['grid'] for name in searched]
    if len(grids) <= 2 and all(grids):
        points = itertools.product(*(np.linspace(math.log(low), math.log(high), n) for low, high, n in grids))
        start = min([start, *points], key=cost)
    # Each further corner of the first simplex has one parameter doubled: exp(0.7) is about 2.
    corners = np.vstack((start, np.asarray(start) + 0.7 * np.eye(len(start))))
    options = {'initial_simplex': corners, 'xatol': LOG_TOLERANCE, 'fatol': math.inf, 'maxfev': 100 * len(start)}
    optimum = minimize(cost, start, method='Nelder-Mead', bounds=bounds, options=options)
    if optimum.fun >= FAILED_COST:
        raise ValueError(f'no {", ".join(searched)} gives a finite criterion')
    return at(optimum.x), float(optimum.fun)
