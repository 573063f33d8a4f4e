"""The mean of the innovations against scipy's filter of the same series."""
import math

import numpy as np
import pytest
from scipy.signal import lfilter

from acu_tracker.alarms.table import ALARM_ROWS
from acu_tracker.estimation import departure, monitors
from acu_tracker.estimation.filters.measurement import (
    NO_INNOVATION,
    AxisInnovation,
    AxisMeasurement,
    Innovation,
    Measurement,
)


def innovation(chi_square):
    axis = AxisInnovation(math.sqrt(chi_square), 1.0, chi_square, math.nan, math.nan)
    return Innovation((axis, axis), math.nan, math.nan)


R = 0.5
"""Variance of an error, of an innovation with the variance 1."""


def take(state, innovation, q=1.0):
    axis = AxisMeasurement(0.0, R, math.nan, math.nan)
    monitors.take_divergence(state, innovation, Measurement(0.0, (axis, axis), math.nan, math.nan), q)


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
        take(state, innovation(value))
        take(state, NO_INNOVATION)
        assert state['m'] == pytest.approx(mean, rel=1e-12)


def test_a_burst_of_interference_is_not_held_against_the_filter(state):
    for _ in range(20):
        take(state, innovation(1e6))
    assert not monitors.diverges(state, False)


@pytest.mark.parametrize('without_signal, errors', [(False, 94), (True, 4)])
def test_it_stays_until_it_is_reset(state, without_signal, errors):
    """m = 1 + 11.5 (1 - 0.99^k) passes 8 with the 94th error that counts 12.5. The growth is 1.81 with the 4th:
    1 + 11.5 (1 - 0.98^k) over 1 + 11.5 (1 - 0.999^k)."""
    for _ in range(errors):
        assert not monitors.diverges(state, without_signal)
        take(state, innovation(100.0))
    assert monitors.diverges(state, without_signal) and not state['diverged']
    monitors.latch_divergence(state)
    monitors.restart_divergence(state)
    assert not monitors.diverges(state, without_signal) and state['diverged'] and state['m'] == 1.0
    monitors.release_divergence(state)
    assert not state['diverged']


@pytest.mark.parametrize('noise, known, lost', [(1.0, 1.0, False), (8.0, 8.0, False), (8.0, 1.0, True)])
def test_noise_that_the_roughness_shows_is_no_divergence(state, noise, known, lost):
    """White innovations of the variance S + (noise - 1) R, while the roughness q is `known`."""
    chi_squares = (1.0 + (noise - 1.0) * R) * np.random.default_rng(2).chisquare(1, 300)
    for value in chi_squares:
        take(state, innovation(value), known)
    assert monitors.diverges(state, True) == lost and not monitors.diverges(state, False)


@pytest.mark.parametrize('usual, lost', [(1.0, True), (3.0, False)])
def test_a_filter_that_follows_badly_since_long_has_not_diverged(state, usual, lost):
    """The innovations are `usual` for 10 s, then 4.5 times their variance for 0.25 s; a growth decays in 0.5 s."""
    for value in [usual] * 2000 + [4.5] * 50:
        take(state, innovation(value))
    assert monitors.diverges(state, True) == lost
    for _ in range(500):
        take(state, innovation(usual))
    assert not monitors.diverges(state, True)


def test_the_text_of_the_alarm_states_the_limits():
    meaning = next(row.meaning for row in ALARM_ROWS if row.name == 'diverged')
    for text in (f'mean of the last {monitors.DIVERGENCE_ERROR_COUNT} squared',
                 f'exceeds {monitors.DIVERGENCE_LIMIT:g},',
                 f'mean of the last {monitors.SHORT_ERROR_COUNT} exceeds {monitors.COASTING_GROWTH_LIMIT:g} times',
                 f'that of the last {monitors.LONG_ERROR_COUNT},', f'within {departure.HOLD_TIME_S:g} s of its lock'):
        assert text in meaning
