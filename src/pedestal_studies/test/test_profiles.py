"""The target motions: rate and acceleration are the derivatives of the angle, the peaks have the requested size."""
import math

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from pedestal_studies import profiles

T = np.arange(0.0, profiles.RECORD_DURATION_S, 1e-3)


@pytest.mark.parametrize('name', profiles.PROFILES)
def test_rate_and_acceleration_are_the_derivatives(name):
    angle, rate, acceleration = profiles.truth(name, T)
    inner = slice(10, -10)
    assert np.allclose(CubicSpline(T, angle)(T, 1)[inner], rate[inner], rtol=0.0, atol=1e-6 * np.max(np.abs(rate)))
    # A half cosine begins with a corner of the acceleration, where a spline of the rate is off by a step's worth.
    assert np.allclose(CubicSpline(T, rate)(T, 1)[inner], acceleration[inner], rtol=0.0,
                       atol=4e-3 * np.max(np.abs(acceleration)))


@pytest.mark.parametrize('name, peak', [
    ('flyby-500m', 0.375 * math.sqrt(3.0) * (15.0 / 500.0) ** 2), ('s-turn-500m', 3.0 / 500.0),
    ('flyby-60m', 0.375 * math.sqrt(3.0) * (15.0 / 60.0) ** 2), ('s-20deg', math.pi * math.radians(3.5))])
def test_the_peak_acceleration(name, peak):
    assert np.max(np.abs(profiles.truth(name, T)[2])) == pytest.approx(peak, rel=1e-3)


def test_the_s_motion_goes_from_end_to_end():
    angle, rate, _ = profiles.s_motion(T, math.radians(20.0), math.radians(3.5), 1.6)
    assert np.max(angle) == pytest.approx(math.radians(10.0), rel=1e-6) == -np.min(angle)
    assert angle[0] == 0.0 and rate[0] == np.max(rate) == math.radians(3.5)
    half_period = math.radians(20.0) / math.radians(3.5) - 3.2 / math.pi + 1.6
    assert profiles.s_motion(np.array([half_period]), math.radians(20.0), math.radians(3.5), 1.6)[0] == (
        pytest.approx(0.0, abs=1e-12))


def test_reversals_longer_than_the_stroke_are_refused():
    with pytest.raises(ValueError, match=r'reversal = 10 s: must be at most'):
        profiles.s_motion(T, math.radians(20.0), math.radians(3.5), 10.0)
