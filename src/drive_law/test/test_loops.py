"""The small laws of the controllers against closed forms."""
import math

import numpy as np
import pytest

from drive_law import axis_control, loops
from drive_law.axis_params import BiasParameters


@pytest.mark.parametrize('schedule, expected', [
    ('off', [0.0, 0.0, 0.0, 0.0, 0.0]), ('constant', [12.0, 12.0, 12.0, 12.0, 12.0]),
    ('fade', [12.0, 12.0 * 31.0 / 45.0, 12.0 * 15.5 / 45.0, 0.0, 0.0]), ('hold_fade', [12.0, 12.0, 6.0, 0.0, 0.0])])
def test_bias_schedules(schedule, expected):
    line = loops.bias_constants(BiasParameters(schedule=schedule))
    for sign in (1.0, -1.0):
        found = [loops.scheduled_bias(sign * T, *line) for T in (0.0, 14.0, 29.5, 45.0, 90.0)]
        assert found == pytest.approx(expected)


def test_differential_damping_and_limits_share_the_torque():
    assert loops.shared_torques(10.0, 10.0, 5.0, 1.0, 0.0, 2.0) == (13.0, 7.0)
    assert [loops.limited_torque(T, 90.0) for T in (-100.0, 12.0, 93.0)] == [-90.0, 12.0, 90.0]


def test_integral_is_held_only_into_the_limit():
    assert loops.integral(1.0, 2.0, 0.5, 0.0) == 2.0
    assert loops.integral(1.0, 2.0, 0.5, 3.0) == 1.0
    assert loops.integral(1.0, -2.0, 0.5, 3.0) == 0.0


def test_encoder_rounds_to_the_nearest_count():
    per_rad = 2.0 ** 22 / (2.0 * math.pi)
    for angle in (0.0, 1e-7, 1.0, -1.0, 40.0, -40.0):
        read = axis_control.counts(angle, per_rad) / per_rad
        assert abs(read - angle) <= 0.5 / per_rad * (1 + 1e-9)


def test_approach_rate_stops_inside_the_distance():
    """Following the law exactly, the axis never brakes harder than a and never gets past the end."""
    K, a, h = 10.0, 20.0, 1e-5
    distance, rates = 0.5, []
    while distance > 1e-6:
        rates.append(loops.approach_rate(distance, K, a))
        distance -= h * rates[-1]
    assert np.max(-np.diff(rates)) / h < a * 1.001
    assert np.max(-np.diff(rates)) / h > a * 0.99
    assert loops.approach_rate(-0.01, K, a) == pytest.approx(-0.1)
