import math

import numpy as np
import pytest
from scipy import signal

from acu_tracker.servo import controllers

T = 0.002


def filtered(x, *parameters):
    c, memory = np.array(controllers.notch_coefficients(*parameters, T)), np.zeros(4)
    return np.array([value - controllers.notch_removed(value, memory, c) for value in x])


@pytest.mark.parametrize('frequency, width, depth', [(70.0, 0.5, 0.1), (12.0, 0.1, 0.0), (240.0, 1.0, 0.5)])
def test_it_is_the_analog_notch_on_the_warped_axis(frequency, width, depth):
    b0, b1, b2, a1, a2 = controllers.notch_coefficients(frequency, width, depth, T)
    f = np.linspace(0.1, 249.0, 500)
    _, digital = signal.freqz([b0, b1, b2], [1.0, a1, a2], worN=2.0 * math.pi * f * T)
    w = 2.0 * math.pi * frequency
    warped = w * np.tan(math.pi * f * T) / math.tan(math.pi * frequency * T)
    _, analog = signal.freqs([1.0, 2.0 * depth * width * w, w * w], [1.0, 2.0 * width * w, w * w], worN=warped)
    np.testing.assert_allclose(digital, analog, atol=1e-9)
    centre = signal.freqz([b0, b1, b2], [1.0, a1, a2], worN=[2.0 * math.pi * frequency * T])[1][0]
    assert abs(centre) == pytest.approx(depth, abs=1e-12)


def test_it_filters_as_scipy_does():
    x = np.random.default_rng(0).normal(size=500)
    b0, b1, b2, a1, a2 = controllers.notch_coefficients(70.0, 0.5, 0.1, T)
    np.testing.assert_allclose(filtered(x, 70.0, 0.5, 0.1), signal.lfilter([b0, b1, b2], [1.0, a1, a2], x), atol=1e-13)


def test_off_it_removes_nothing():
    x = np.random.default_rng(0).normal(size=500)
    assert filtered(x, 0.0, 0.5, 0.1).tobytes() == x.tobytes()


def test_it_may_be_changed_at_rest_without_a_bump():
    memory, coefficients = np.full(4, 0.3), np.array(controllers.notch_coefficients(70.0, 0.5, 0.1, T))
    assert controllers.notch_removed(0.3, memory, coefficients) == pytest.approx(0.0, abs=1e-15)
