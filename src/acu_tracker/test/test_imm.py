import math

import numpy as np
import pytest
from filterpy.kalman import IMMEstimator, KalmanFilter
from oracles import van_loan
from scipy.linalg import expm

from acu_tracker.estimation.filters import axis_filter, imm
from acu_tracker.estimation.filters.measurement import AxisMeasurement
from acu_tracker.estimation.params import FilterParameters
from pedestal_common.parameters import build

T, SIGMA, RATE_SIGMA = 0.01, 5e-4, 2e-3
MODELS = {'imm.models': 'cv ca singer', 'imm.rungs': 1, 'imm.cv.noise': 1e-3, 'imm.ca.noise': 0.3,
          'imm.singer.sigma': 0.1, 'imm.singer.alpha': 2.0, 'imm.dwell': 0.5}


def filterpys(y, with_rate):
    """filterpy's bank of cv, ca and singer from the same start; cv padded to three states."""
    sources = [([[0, 1, 0], [0, 0, 0], [0, 0, 0]], [0, 1e-3, 0], 0.0),
               ([[0, 1, 0], [0, 0, 1], [0, 0, 0]], [0, 0, 0.3], 10.0 * 0.3**2),
               ([[0, 1, 0], [0, 0, 1], [0, 0, -2.0]], [0, 0, math.sqrt(4.0) * 0.1], 0.1**2)]
    filters = []
    for A, g, variance in sources:
        made = KalmanFilter(3, 2 if with_rate else 1)
        made.F, made.Q = van_loan(A, g, T)
        if variance == 0.0:
            made.F[2, 2] = 0.0
        made.H = np.eye(3)[:2 if with_rate else 1]
        made.R = np.diag([SIGMA**2, RATE_SIGMA**2][:len(made.H)])
        made.x, made.P = np.array([[y], [0.0], [0.0]]), np.diag([SIGMA**2, 0.1**2, variance])
        filters.append(made)
    stay = 1 / 3 + 2 / 3 * math.exp(-1.5 * T / 0.5)
    return IMMEstimator(filters, np.full(3, 1 / 3), np.where(np.eye(3), stay, (1 - stay) / 2))


@pytest.mark.parametrize('with_rate', [False, True])
def test_against_filterpy(with_rate):
    """Where filterpy is right: x, P and mu after a real update with likelihoods it can hold.

    Not compared: its x_prior mixes with mu instead of cbar; its update(None) moves mu; it floors likelihoods.
    """
    rng = np.random.default_rng(8)
    t = T * np.arange(400)
    rate = 0.05 * np.cos(np.clip(t - 1.0, 0.0, 1.0) * math.pi)
    y = np.cumsum(rate) * T + SIGMA * rng.standard_normal(len(t))
    y_rate = rate + RATE_SIGMA * rng.standard_normal(len(t)) if with_rate else np.full(len(t), math.nan)
    out = np.zeros(len(t), axis_filter.Estimate.dtype)
    c = axis_filter.constants(build(FilterParameters, {'kind': 'imm', 'rate_measurement': True, **MODELS}))
    axis_filter.estimates(c, t, y, np.full(len(t), SIGMA**2), y_rate, np.full(len(t), RATE_SIGMA**2), 0.1, out)
    oracle = filterpys(y[0], with_rate)
    for k in range(1, len(t)):
        oracle.predict()
        oracle.update(np.array([[y[k]], [y_rate[k]]]) if with_rate else np.array([[y[k]]]))
        np.testing.assert_allclose([out[k][name] for name in ('angle', 'rate', 'acceleration')], oracle.x[:, 0],
                                   rtol=1e-6, atol=1e-8)
        np.testing.assert_allclose(out[k]['of_bank'], oracle.P[(0, 0, 1), (0, 1, 1)], rtol=1e-6)
        np.testing.assert_allclose(out[k]['mu'][:3], oracle.mu, rtol=1e-6, atol=1e-9)
    # The bank has used all its models on the way.
    assert (out['mu'][:, :3].max(axis=0) > 0.5).sum() >= 2 and np.isnan(out['mu'][:, 3:]).all()


@pytest.mark.parametrize('T', [1e-4, 0.3, 20.0])
@pytest.mark.parametrize('count', [2, 3, 4])
def test_switching_is_the_chain_in_continuous_time(T, count):
    dwell, arrival = 2.5, np.arange(1.0, count + 1.0) / np.arange(1.0, count + 1.0).sum()
    chain = expm(count / ((count - 1) * dwell) * (np.tile(arrival, (count, 1)) - np.eye(count)) * T)
    held = np.linspace(0.1, 1.0, count) / np.linspace(0.1, 1.0, count).sum()
    for j in range(count):
        cbar, share = imm.mix(held[j], imm.ending(T, dwell, count), arrival[j])
        assert cbar == pytest.approx(held @ chain[:, j], rel=1e-12)
        # The share is spread over the bank by its probabilities; the rest is the model itself.
        weights = share * held + np.where(np.arange(count) == j, 1.0 - share, 0.0)
        np.testing.assert_allclose(weights, held * chain[:, j] / cbar, rtol=1e-10)


@pytest.mark.parametrize('distance', [1e-2, 1.0, 100.0])
def test_a_far_measurement_keeps_its_evidence(distance):
    """Far from all models, the one that expects most is right; filterpy's floored likelihoods leave [1/3, 1/3, 1/3].

    The oracle is a ratio of densities: log mu_i - log mu_j = log(cbar_i / cbar_j) + (nu_j^2/S_j - nu_i^2/S_i)/2 + ...
    """
    c = axis_filter.constants(build(FilterParameters, {'kind': 'imm', **MODELS}))[0]
    f = axis_filter.Filter.zeros()[0]
    axis_filter.start(f, c, 0.0, SIGMA**2, 0.1)
    for _ in range(300):
        axis_filter.predict(f, c, T)
        axis_filter.correct(f, c, AxisMeasurement(0.0, SIGMA**2, math.nan, math.nan))
    axis_filter.predict(f, c, T)
    S = f['p_prior'][:3, 0] + SIGMA**2
    nu = distance - f['x_prior'][:3, 0]
    axis_filter.correct(f, c, AxisMeasurement(distance, SIGMA**2, math.nan, math.nan))
    expected = np.log(f['mu_prior'][:3] / np.sqrt(S)) - 0.5 * nu**2 / S
    mu = f['mu'][:3]
    assert mu.sum() == pytest.approx(1.0) and np.argmax(mu) == np.argmax(expected)
    possible = mu > 1e-300
    np.testing.assert_allclose(np.log(mu[possible]), (expected - expected.max())[possible] - math.log(
        np.exp(expected - expected.max()).sum()), rtol=1e-9, atol=1e-9)
    # And the next measurements bring the others back.
    for _ in range(2000):
        axis_filter.predict(f, c, T)
        axis_filter.correct(f, c, AxisMeasurement(distance, SIGMA**2, math.nan, math.nan))
    assert f['mu'][0] > 0.5
    estimate = axis_filter.outlook(f, c, 0.0)
    np.testing.assert_allclose(estimate[:2], (distance, 0.0), atol=1e-2 * distance)
