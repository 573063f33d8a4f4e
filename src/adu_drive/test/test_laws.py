"""The small laws against closed forms."""
import math

import numpy as np
import pytest

from adu_drive.plant import mechanics


def test_own_exp_and_tanh_keep_their_stated_errors():
    y = np.concatenate([np.linspace(0.0, 60.0, 20001), np.logspace(-12, 3, 500)])
    x = np.concatenate([np.linspace(-20.0, 20.0, 20001), np.logspace(-12, 3, 500)])
    assert max(abs(mechanics.exp_minus(v) - math.exp(-v)) for v in y) < 6e-9
    assert max(abs(mechanics.tanh(v) - math.tanh(v)) for v in x) < 1.2e-8
    assert math.isnan(mechanics.tanh(math.nan))


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
