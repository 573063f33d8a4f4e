"""The kinds of target filter: one row each, which says of what an axis's bank of motion models is made."""
import functools
import typing

import numpy as np

from acu_tracker.estimation.filters import constant_gain, motion_models
from acu_tracker.estimation.filters.motion_models import MODEL_NAMES, MODEL_ROWS
from pedestal_common.parameters import ParameterError


class Bank(typing.NamedTuple):
    """models (count,): records of motion_models.MODEL; dwell: mean time that one of several holds [s]; gains: alpha,
    beta, gamma [-] of a filter of constant gains, alpha 0 for Kalman's."""
    models: np.ndarray
    dwell: float = 0.0
    gains: tuple = (0.0, 0.0, 0.0)


class Kind(typing.NamedTuple):
    """doc: what it is; bank: function of FilterParameters that makes the Bank of an axis; cartesian: use the Cartesian
    filter too."""
    doc: str
    bank: typing.Callable
    cartesian: bool = False


def _alpha_beta(params):
    alpha = params.alpha_beta.alpha
    return Bank(motion_models.constants('cv', params.cv, noise=0.0),
                gains=(alpha, constant_gain.benedict_bordner(alpha), 0.0))


def _alpha_beta_gamma(params):
    alpha = params.alpha_beta_gamma.alpha
    return Bank(motion_models.constants('ca', params.ca, noise=0.0), gains=(alpha, *constant_gain.kalata(alpha)))


def _alone(name, params):
    return Bank(motion_models.constants(name, getattr(params, name)))


def _interacting(params):
    models = [motion_models.constants(name, getattr(params.imm, name)) for name in named_models(params.imm.models)]
    return Bank(np.concatenate(models), params.imm.dwell)


FILTER_KINDS = {
    'alpha_beta': Kind('constant gains on the model cv', _alpha_beta),
    'alpha_beta_gamma': Kind('constant gains on the model ca', _alpha_beta_gamma),
    **{model.name: Kind(f'Kalman filter: {model.doc}', functools.partial(_alone, model.name)) for model in MODEL_ROWS},
    'imm': Kind('interacting models, those of `imm.models`', _interacting),
    'imm_ukf': Kind('interacting unscented filters of the position where the range is measured, otherwise `imm`',
                    _interacting, cartesian=True)}


def named_models(names) -> tuple:
    """Names of the models in a text such as 'cv ca', in the order of MODELS. Raises ParameterError."""
    models = names.split()
    if not (2 <= len(models) == len(set(models)) and set(models) <= set(MODEL_NAMES)):
        raise ParameterError(f"models = '{names}': must be two or more of {', '.join(MODEL_NAMES)}, each once")
    return tuple(sorted(models, key=MODEL_NAMES.index))
