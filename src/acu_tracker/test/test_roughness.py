"""How rough the errors of the receiver are: the mean square successive difference."""
import math

import numpy as np
import pytest
from scipy.signal import lfilter

from acu_tracker.estimation import monitors
from acu_tracker.estimation.filters.measurement import AxisInnovation, AxisMeasurement, Innovation, Measurement

GATE, SIGMA = 25.0, 1e-4


def take(state, x, e):
    axes = tuple(AxisInnovation(nu, 1.0, 1.0, math.nan, math.nan) for nu in (x, e))
    innovation = Innovation(axes, math.nan, math.nan)
    axis = AxisMeasurement(0.0, SIGMA**2, math.nan, math.nan)
    return monitors.take_roughness(state, innovation, Measurement(0.0, (axis, axis), math.nan, math.nan))


@pytest.fixture
def state():
    record = monitors.Roughness.zeros()[0]
    monitors.restart_roughness(record)
    return record


def test_the_mean_square_successive_difference(state):
    nu = np.random.default_rng(1).normal(0.0, SIGMA, (400, 2))
    q = [take(state, *one) for one in nu]
    a = 1.0 / monitors.ROUGHNESS_ERROR_COUNT
    x = np.minimum(np.diff(nu, axis=0)**2 / (2.0 * SIGMA**2), np.inf).mean(axis=1)
    expected, _ = lfilter([a], [1.0, a - 1.0], x, zi=[1.0 - a])
    assert q[0] == 1.0 and q[1:] == pytest.approx(expected, rel=1e-12)
    assert 0.8 < np.mean(q) < 1.2 and np.max(q) < 0.2 * GATE


def test_noise_a_hundred_times_as_large_is_known_within_four_errors_and_forgotten_within_a_tenth_of_a_second(state):
    rng = np.random.default_rng(2)
    noise = rng.normal(0.0, 100.0 * SIGMA, (50, 2))
    assert np.argmax([take(state, *one) > GATE for one in noise]) <= 4
    assert sum(take(state, *one) > GATE for one in rng.normal(0.0, SIGMA, (50, 2))) <= 20


def test_what_changes_slowly_and_single_outliers_are_no_noise(state):
    """A wrong slope makes the error grow by a tenth in a step, an outlier comes and goes, a target hops once."""
    rng = np.random.default_rng(3)
    for e in np.concatenate((1e-5 * 1.1**np.arange(50), np.zeros(20))):
        assert take(state, e, 0.0) < GATE or e == 0.0
    for k in range(100):
        hop = 0.01 if k > 60 else 0.0
        outlier = 0.3 if k == 30 else 0.0
        assert take(state, hop + outlier + rng.normal(0.0, SIGMA), 0.0) < GATE
