"""The kinds of target filter: one row each, which says of what an axis's bank of motion models is made.

    alpha_beta, alpha_beta_gamma    cv or ca without process noise, corrected with constant gains
    cv, ca, singer, current_statistical     a Kalman filter with that model of motion
    imm             interacting models
    imm_ukf         the Cartesian filter where the range is measured; without it the axes have what imm has
"""
import functools
import typing

import numpy as np

from acu_tracker.estimation import alpha_beta, motion_models
from acu_tracker.estimation.motion_models import MODELS
from pedestal_common.parameters import ParameterError


class Bank(typing.NamedTuple):
    """models (count,): records of motion_models.MODEL; dwell: mean time that one of several holds [s]; gains: alpha,
    beta, gamma [-] of a filter of constant gains, alpha 0 for Kalman's."""
    models: np.ndarray
    dwell: float = 0.0
    gains: tuple = (0.0, 0.0, 0.0)


class Kind(typing.NamedTuple):
    """bank: function of FilterParameters that makes the Bank of an axis; cartesian: use the Cartesian filter too."""
    bank: typing.Callable
    cartesian: bool = False


def _alpha_beta(params):
    alpha = params.alpha_beta.alpha
    return Bank(motion_models.constants('cv', params.cv, noise=0.0),
                gains=(alpha, alpha_beta.benedict_bordner(alpha), 0.0))


def _alpha_beta_gamma(params):
    alpha = params.alpha_beta_gamma.alpha
    return Bank(motion_models.constants('ca', params.ca, noise=0.0), gains=(alpha, *alpha_beta.kalata(alpha)))


def _alone(name, params):
    return Bank(motion_models.constants(name, getattr(params, name)))


def _interacting(params):
    models = [motion_models.constants(name, getattr(params.imm, name)) for name in named_models(params.imm.models)]
    return Bank(np.concatenate(models), params.imm.dwell)


KINDS = {'alpha_beta': Kind(_alpha_beta), 'alpha_beta_gamma': Kind(_alpha_beta_gamma),
         **{name: Kind(functools.partial(_alone, name)) for name in MODELS},
         'imm': Kind(_interacting), 'imm_ukf': Kind(_interacting, cartesian=True)}


def named_models(names) -> tuple:
    """Names of the models in a text such as 'cv ca', in the order of MODELS. Raises ParameterError."""
    models = names.split()
    if not (2 <= len(models) == len(set(models)) and set(models) <= set(MODELS)):
        raise ParameterError(f"models = '{names}': must be two or more of {', '.join(MODELS)}, each once")
    return tuple(sorted(models, key=MODELS.index))
