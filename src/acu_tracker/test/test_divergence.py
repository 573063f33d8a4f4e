"""The mean of the innovations against scipy's filter of the same series."""
import math

import numpy as np
import pytest
from scipy.signal import lfilter

from acu_tracker.estimation import monitors
from acu_tracker.estimation.filters.measurement import NO_INNOVATION, AxisInnovation, Innovation


def innovation(chi_square):
    axis = AxisInnovation(math.sqrt(chi_square), 1.0, chi_square, math.nan, math.nan)
    return Innovation((axis, axis), math.nan, math.nan)


@pytest.fixture
def state():
    record = monitors.Divergence.zeros()[0]
    monitors.restart_divergence(record)
    return record


def test_mean(state):
    x = np.random.default_rng(1).chisquare(2, 500) * np.linspace(0.5, 4.0, 500)
    a = 1.0 / monitors.DIVERGENCE_ERROR_COUNT
    expected, _ = lfilter([a], [1.0, a - 1.0], np.minimum(x, monitors.MAX_COUNTED_ERROR), zi=[1.0 - a])
    for value, mean in zip(x, expected):
        monitors.take_divergence(state, innovation(value))
        monitors.take_divergence(state, NO_INNOVATION)
        assert state['m'] == pytest.approx(mean, rel=1e-12)


def test_a_burst_of_interference_is_not_held_against_the_filter(state):
    for _ in range(20):
        monitors.take_divergence(state, innovation(1e6))
    assert not monitors.diverges(state, False)


@pytest.mark.parametrize('without_signal, errors', [(False, 74), (True, 10)])
def test_it_stays_until_it_is_reset(state, without_signal, errors):
    """m = 1 + 11.5 (1 - 0.99^n) passes 7 with the 74th error that counts 12.5, and 2 with the 10th."""
    for _ in range(errors):
        assert not monitors.diverges(state, without_signal)
        monitors.take_divergence(state, innovation(100.0))
    assert monitors.diverges(state, without_signal) and not state['diverged']
    monitors.latch_divergence(state)
    monitors.restart_divergence(state)
    assert not monitors.diverges(state, without_signal) and state['diverged'] and state['m'] == 1.0
    monitors.release_divergence(state)
    assert not state['diverged']
