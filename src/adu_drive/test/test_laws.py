"""The small laws against closed forms."""
import math

import numpy as np
import pytest

from adu_drive.controller import encoder, loops
from adu_drive.params import BiasParameters
from adu_drive.plant import mechanics


def test_own_exp_and_tanh_keep_their_stated_errors():
    y = np.concatenate([np.linspace(0.0, 60.0, 20001), np.logspace(-12, 3, 500)])
    x = np.concatenate([np.linspace(-20.0, 20.0, 20001), np.logspace(-12, 3, 500)])
    assert max(abs(mechanics.exp_minus(v) - math.exp(-v)) for v in y) < 6e-9
    assert max(abs(mechanics.tanh(v) - math.tanh(v)) for v in x) < 1.2e-8
    assert math.isnan(mechanics.tanh(math.nan))


@pytest.mark.parametrize('schedule, expected', [
    ('off', [0.0, 0.0, 0.0, 0.0, 0.0]), ('constant', [12.0, 12.0, 12.0, 12.0, 12.0]),
    ('fade', [12.0, 12.0 * 31.0 / 45.0, 12.0 * 15.5 / 45.0, 0.0, 0.0]), ('hold_fade', [12.0, 12.0, 6.0, 0.0, 0.0])])
def test_bias_schedules(schedule, expected):
    line = loops.bias_constants(BiasParameters(schedule=schedule))
    for sign in (1.0, -1.0):
        found = [loops.scheduled_bias(sign * T, *line) for T in (0.0, 14.0, 29.5, 45.0, 90.0)]
        assert found == pytest.approx(expected)


def test_mesh_has_a_dead_zone_and_never_pulls():
    mesh = [mechanics.mesh_torque(d, r, 5e6, 5e3, 5e-4) for d, r in
            ((4.9e-4, 1.0), (-4.9e-4, -1.0), (7e-4, 0.0), (-7e-4, 0.0), (7e-4, 0.1), (5.1e-4, -1.0), (-5.1e-4, 1.0))]
    assert mesh == pytest.approx([0.0, 0.0, 1000.0, -1000.0, 1500.0, 0.0, 0.0])


def test_lugre_settles_on_the_stribeck_curve_and_sticks_like_a_spring():
    T_c, T_s, v_s, sigma_0, sigma_1, h = 60.0, 80.0, 2e-3, 2e5, 400.0, 50e-6

    def slide(v, seconds):
        z = 0.0
        for _ in range(round(seconds / h)):
            force, z = mechanics.lugre(z, v, T_c, T_s - T_c, v_s ** -2, sigma_0, h * sigma_0, sigma_1 / h, h)
        return force

    for v in (1e-4, 1e-3, 2e-3, -4e-3, 0.5):
        settled = slide(v, 8.0 * T_s / (sigma_0 * abs(v)) + 0.1)
        assert settled == pytest.approx(math.copysign(T_c + 20.0 * math.exp(-(v / v_s) ** 2), v), rel=5e-3)
    assert slide(1e-4, 0.1) == pytest.approx(sigma_0 * 1e-5, rel=0.02)      # before sliding: sigma_0 x + small


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
        read = encoder.counts(angle, per_rad) / per_rad
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
