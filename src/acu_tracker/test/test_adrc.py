import math

import numpy as np
import pytest

from acu_tracker.servo import controllers


@pytest.mark.parametrize('w_o, w_s, h', [(100.0, 176.0, 0.005), (60.0, 176.0, 0.002), (300.0, 50.0, 0.002),
                                         (30.0, 800.0, 0.01)])
def test_gains_put_the_poles_of_the_observer_where_they_are_asked_for(w_o, w_s, h):
    gains = controllers.observer_gains(w_o, w_s, h)
    # The error of one predict and correct step, column by column through the law itself.
    error = np.array([controllers.observed(z, 0.0, 0.0, 0.0, w_o, w_s, h) for z in np.eye(3)]).T
    p = math.exp(-w_o * h)
    np.testing.assert_allclose(np.poly(error), [1.0, -3.0 * p, 3.0 * p * p, -p**3], atol=1e-9)
    measured = np.array(controllers.observed((0.0, 0.0, 0.0), 1.0, 0.0, 0.0, w_o, w_s, h))
    np.testing.assert_allclose(measured, gains, rtol=1e-12)


def test_gains_without_a_lag_are_those_of_the_integrator_chain():
    h, p = 0.01, math.exp(-1.0)
    np.testing.assert_allclose(controllers.observer_gains(100.0, 1e-2, h),
                               [1 - p**3, 1.5 * (1 - p)**2 * (1 + p) / h, (1 - p)**3 / h**2], rtol=1e-3)


def test_observer_finds_a_drive_that_behaves_otherwise():
    """y' obeys twice the command and the load has its own acceleration: angle, rate and disturbance are found."""
    z = (0.0, 0.0, 0.0)
    h, w_s, u = 0.005, 176.0, 0.1
    for k in range(1, 401):
        z = controllers.observed(z, 2.0 * u * k * h, u, 0.0, 100.0, w_s, h)
    np.testing.assert_allclose(z, [0.4, 0.2, w_s * 0.1], rtol=1e-9)


def test_a_quiet_drive_on_its_reference_gets_the_reference_rate():
    """No error, no disturbance: the feed-forward alone, whatever the gains."""
    for w_c in (10.0, 88.0, 200.0):
        assert controllers.adrc_rate((0.3, 0.5, 0.0), 0.3, 0.5, 0.52, w_c, 176.0) == 0.52


def test_command_cancels_the_disturbance_and_places_the_poles():
    """With the states known, y'' - v'' = -w_c^2 (y - v) - 2 w_c (y' - v')."""
    w_c, w_s, y, dy, v1, v2, v3, d = 40.0, 176.0, 1e-3, 0.51, 0.8e-3, 0.5, 1.5, 3.0
    u = controllers.adrc_rate((y, dy, d), v1, v2, v2, w_c, w_s)
    ddy = w_s * (u - dy) + v3 + d
    assert ddy - v3 == pytest.approx(-w_c * w_c * (y - v1) - 2.0 * w_c * (dy - v2), rel=1e-12)
