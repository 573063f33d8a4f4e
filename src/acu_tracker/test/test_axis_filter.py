import math

import numpy as np
import pytest

from acu_tracker import axis_filter
from acu_tracker.axis_filter import KINDS
from acu_tracker.filter_params import Filter
from pedestal_common.parameters import ParameterError, build

DEG = math.pi / 180
T = 0.01
SIGMA = 0.03 * DEG


def run(t, y, rate=None, rate_sigma=0.1 * DEG, sigma=SIGMA, initial_rate=0.1, **params):
    """Estimates of the filter over angles y, and rates where given."""
    out = np.zeros(len(t), axis_filter.ESTIMATE)
    ones = np.ones(len(t))
    axis_filter.estimates(axis_filter.constants(build(Filter, params)), t, y, sigma**2 * ones,
                          math.nan * ones if rate is None else rate, rate_sigma**2 * ones, initial_rate, out)
    return out


@pytest.mark.parametrize('kind', KINDS)
def test_every_kind_follows_a_ramp_without_bias_and_better_than_it_is_measured(kind):
    t = np.arange(0.0, 30.0, T)
    angle = 0.3 + 0.02 * t
    exact = run(t, angle, kind=kind)[-1]
    np.testing.assert_allclose([exact['angle'], exact['rate']], [angle[-1], 0.02], rtol=1e-6)
    noisy = run(t, angle + np.random.default_rng(2).normal(0, SIGMA, len(t)), kind=kind)[500:]
    assert np.sqrt(np.mean((noisy['angle'] - angle[500:])**2)) < 0.5 * SIGMA
    assert np.mean(noisy['nis']) == pytest.approx(1.0, abs=0.15)


def test_parameters_of_the_bank_are_checked():
    for models in ('cv', 'cv cv', 'cv constant', ''):
        with pytest.raises(ParameterError, match=f"imm.models = '{models}': must be two or more of cv, ca, singer"):
            build(Filter, {'imm.models': models})
