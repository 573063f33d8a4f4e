"""How rough the errors of the receiver are: by how much they turn back from one to the next."""
import math

import numpy as np
import pytest
from scipy.signal import lfilter

from acu_tracker.estimation import roughness
from acu_tracker.estimation.measurement import AxisInnovation, AxisMeasurement, Innovation, Measurement

GATE, SIGMA = 25.0, 1e-4


def take(state, x, e):
    axes = tuple(AxisInnovation(nu, 1.0, 1.0, math.nan, math.nan) for nu in (x, e))
    innovation = Innovation(axes, math.nan, math.nan)
    axis = AxisMeasurement(0.0, SIGMA**2, math.nan, math.nan)
    roughness.take(state, innovation, Measurement(0.0, (axis, axis), math.nan, math.nan), GATE)
    return state['q']


@pytest.fixture
def state():
    record = np.zeros(1, roughness.ROUGHNESS)[0]
    roughness.restart(record)
    return record


def test_the_mean_product_of_differences_of_opposite_signs(state):
    nu = np.random.default_rng(1).normal(0.0, SIGMA, (400, 2))
    q = [take(state, *one) for one in nu]
    a, d = 1.0 / roughness.ERRORS, np.diff(nu, axis=0)
    x = np.zeros(len(nu))
    x[2:] = np.maximum(-d[1:] * d[:-1] / SIGMA**2, 0.0).mean(axis=1)
    expected, _ = lfilter([a], [1.0, a - 1.0], x, zi=[1.0 - a])
    assert q == pytest.approx(expected, rel=1e-12)
    assert 1.0 < np.mean(q) < 1.5 and np.max(q) < 0.2 * GATE


@pytest.mark.parametrize('times', [8, 20, 100])
def test_noise_many_times_as_large_is_known_and_forgotten_within_a_fifth_of_a_second(times):
    for seed in range(100):
        rng, state = np.random.default_rng(seed), np.zeros(1, roughness.ROUGHNESS)[0]
        roughness.restart(state)
        noisy = []
        for sigma in [times * SIGMA] * 200 + [SIGMA] * 50:
            take(state, *rng.normal(0.0, sigma, 2))
            noisy.append(bool(state['noisy']))
        assert all(noisy[30:200]) and not any(noisy[240:])


def test_what_changes_slowly_and_single_outliers_are_no_noise(state):
    """A wrong slope makes the error grow by a tenth in a step, an outlier comes and goes, a target hops once."""
    rng = np.random.default_rng(3)
    for e in np.concatenate((1e-5 * 1.1**np.arange(50), np.zeros(20))):
        assert take(state, e, 0.0) < GATE or e == 0.0
    for k in range(100):
        hop = 0.01 if k > 60 else 0.0
        outlier = 0.3 if k == 30 else 0.0
        assert take(state, hop + outlier + rng.normal(0.0, SIGMA), 0.0) < GATE


@pytest.mark.parametrize('steps', [1, 7, 30])
def test_a_beam_that_is_behind_more_in_every_error_is_no_noise(state, steps):
    """A filter that began while the dish slewed at 0.3 rad/s, with steps lost in between."""
    rng, nu = np.random.default_rng(4), 0.0
    for _ in range(300):
        nu += 0.3 * 0.005 * rng.integers(1, steps + 1)
        assert take(state, nu + rng.normal(0.0, SIGMA), 0.5 * nu) < 0.2 * GATE
