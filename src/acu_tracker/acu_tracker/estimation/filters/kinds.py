"""The table of filter kinds, which the parameter acu.AXIS.filter.kind selects. A kind makes the bank of an axis."""
import functools
import math
from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from acu_tracker.estimation.filters import kalman, motion_models
from acu_tracker.estimation.filters.motion_models import MODEL_NAMES, MODEL_ROWS
from pedestal_common import reproducible
from pedestal_common.parameters import ParameterError
from pedestal_common.quantities import Floats, Records, Seconds, Xyz

if TYPE_CHECKING:
    from acu_tracker.estimation.params import FilterParameters

UNKNOWN_ACCELERATION_RAD_S2 = 1e3
"""Standard deviation of the acceleration at the start of a filter of constant gains: none is assumed, and the filter
starts as a least-squares fit."""


ARRIVAL_EXPONENT = 0.3
"""Exponent of the noise of a rung, to which the probability of this rung after the end of another grows.

A filter with more noise forgets sooner. An unneeded rung is therefore ruled out sooner, and may arrive oftener at the
same price in accuracy. With the same probability for all, the bank would begin late with a hard manoeuvre.
"""


class Bank(NamedTuple):
    """The motion models of the filter of one axis."""
    models: Records         # (count,) of motion_models.MotionModelRecord
    dwell: Seconds = 0.0    # mean time for which one of several models holds
    arrival: Floats = np.ones(1)    # probability of each model after the end of another one
    # alpha, beta, gamma of a filter of constant gain [-]; alpha is 0 for a Kalman filter
    gains: Xyz = (0.0, 0.0, 0.0)


class Kind(NamedTuple):
    """A row of FILTER_KINDS."""
    doc: str                    # meaning of the kind
    bank: 'Callable[[FilterParameters], Bank]'  # returns the bank of an axis
    cartesian: bool = False     # True if the Cartesian filter is used as well
    ladder: bool = False        # True if its models ca form a ladder of `imm.rungs`


def _bank_of_alpha_beta(params: 'FilterParameters') -> Bank:
    alpha = params.alpha_beta.alpha
    return Bank(motion_models.constants('cv', params.cv, noise=0.0),
                gains=(alpha, kalman.benedict_bordner(alpha), 0.0))


def _bank_of_alpha_beta_gamma(params: 'FilterParameters') -> Bank:
    alpha = params.alpha_beta_gamma.alpha
    return Bank(motion_models.constants('ca', params.ca, noise=0.0, initial_sigma=UNKNOWN_ACCELERATION_RAD_S2),
                gains=(alpha, *kalman.kalata(alpha)))


def _bank_of_one(name: str, params: 'FilterParameters') -> Bank:
    return Bank(motion_models.constants(name, getattr(params, name)))


def _bank_of_several(params: 'FilterParameters') -> Bank:
    imm = params.imm
    models = [motion_models.ladder(imm.ca, imm.rungs, imm.rung_ratio) if name == 'ca'
              else motion_models.constants(name, getattr(imm, name)) for name in named_models(imm.models)]
    factor = 1.0 if imm.rungs == 1 else imm.rung_ratio**ARRIVAL_EXPONENT
    arrival = reproducible.power(factor, np.arange(sum(map(len, models))))
    return Bank(np.concatenate(models), imm.dwell, arrival / math.fsum(arrival))


FILTER_KINDS = {
    'alpha_beta': Kind('constant gains on the model cv', _bank_of_alpha_beta),
    'alpha_beta_gamma': Kind('constant gains on the model ca', _bank_of_alpha_beta_gamma),
    **{model.name: Kind(f'Kalman filter: {model.doc}', functools.partial(_bank_of_one, model.name))
       for model in MODEL_ROWS},
    'imm': Kind('interacting models, those of `imm.models`', _bank_of_several, ladder=True),
    'imm_ukf': Kind('interacting unscented filters of the position where the range is measured, otherwise `imm`',
                    _bank_of_several, cartesian=True, ladder=True)}
"""{name of a kind: its Kind}."""


def named_models(names: str) -> tuple[str, ...]:
    """Return the names of the models in a text such as 'cv ca', sorted; raise ParameterError for a wrong text."""
    models = names.split()
    if not (2 <= len(models) == len(set(models)) and set(models) <= set(MODEL_NAMES)):
        raise ParameterError(f"models = '{names}': must be two or more of {', '.join(MODEL_NAMES)}, each once")
    return tuple(sorted(models, key=MODEL_NAMES.index))
