"""The mean of the innovations against scipy's filter of the same series."""
import math

import numpy as np
import pytest
from scipy.signal import lfilter

from acu_tracker.estimation import divergence
from acu_tracker.estimation.filters.measurement import NO_INNOVATION, AxisInnovation, Innovation


def innovation(chi_square):
    axis = AxisInnovation(math.sqrt(chi_square), 1.0, chi_square, math.nan, math.nan)
    return Innovation((axis, axis), math.nan, math.nan)


@pytest.fixture
def state():
    record = divergence.Divergence.zeros()[0]
    divergence.restart(record)
    return record


def test_mean(state):
    x = np.random.default_rng(1).chisquare(2, 500) * np.linspace(0.5, 4.0, 500)
    a = 1.0 / divergence.DIVERGENCE_ERROR_COUNT
    expected, _ = lfilter([a], [1.0, a - 1.0], np.minimum(x, divergence.MAX_COUNTED_ERROR), zi=[1.0 - a])
    for value, mean in zip(x, expected):
        divergence.take(state, innovation(value))
        divergence.take(state, NO_INNOVATION)
        assert state['m'] == pytest.approx(mean, rel=1e-12)


def test_a_burst_of_interference_is_not_held_against_the_filter(state):
    for _ in range(20):
        divergence.take(state, innovation(1e6))
    assert not divergence.diverges(state, False)


@pytest.mark.parametrize('without_signal, errors', [(False, 74), (True, 10)])
def test_it_stays_until_it_is_reset(state, without_signal, errors):
    """m = 1 + 11.5 (1 - 0.99^n) passes 7 with the 74th error that counts 12.5, and 2 with the 10th."""
    for _ in range(errors):
        assert not divergence.diverges(state, without_signal)
        divergence.take(state, innovation(100.0))
    assert divergence.diverges(state, without_signal) and not state['diverged']
    divergence.latch(state)
    divergence.restart(state)
    assert not divergence.diverges(state, without_signal) and state['diverged'] and state['m'] == 1.0
    divergence.release(state)
    assert not state['diverged']
