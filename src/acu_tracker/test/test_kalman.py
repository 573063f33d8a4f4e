import numpy as np
from filterpy.kalman import KalmanFilter

from acu_tracker.estimation.filters import kalman, motion_models
from acu_tracker.estimation.filters.kalman import Gaussian, Symmetric
from acu_tracker.geometry.vector import AxisMotion

T, ALPHA, R, R_RATE = 0.01, 0.5, 2.5e-7, 4e-6
TRANSITION = motion_models.fading(ALPHA, T)
F = np.array([[1, T, TRANSITION.f13], [0, 1, TRANSITION.f23], [0, 0, TRANSITION.f33]])
Q = Symmetric(*(0.3 * q for q in motion_models.fading_noise(ALPHA, T)))
START = Gaussian(AxisMotion(0.1, 0.2, -0.1), Symmetric(1e-3, 0.0, 0.0, 0.04, 0.0, 0.5))


def full(p):
    return np.array([[p[0], p[1], p[2]], [p[1], p[3], p[4]], [p[2], p[4], p[5]]])


def predicted(g):
    return Gaussian(kalman.predicted_mean(g.x, TRANSITION, T), kalman.predicted_covariance(g.P, TRANSITION, Q, T))


def filterpys(measured):
    oracle = KalmanFilter(3, measured)
    oracle.F, oracle.Q, oracle.H, oracle.R = F, full(Q), np.eye(3)[:measured], np.diag([R, R_RATE][:measured])
    oracle.x, oracle.P = np.array(START.x)[:, None], full(START.P)
    return oracle


def log_density(nu, S):
    return kalman.exponent(nu, S) - 0.5 * np.log(2 * np.pi * S)


def test_angle_and_rate_one_after_the_other_against_both_at_once():
    rng = np.random.default_rng(3)
    for measured in (1, 2):
        oracle, g = filterpys(measured), START
        for y, y_rate in zip(np.cumsum(rng.normal(0, 5e-4, 400)), rng.normal(0.0, 0.1, 400)):
            oracle.predict()
            oracle.update(np.array([[y], [y_rate]])[:measured])
            g = predicted(g)
            nu = y - g.x.angle
            logs = log_density(nu, g.P.p11 + R)
            g = kalman.update(g, nu, R)
            if measured == 2:
                nu = y_rate - g.x.rate
                logs += log_density(nu, g.P.p22 + R_RATE)
                g = kalman.update_rate(g, nu, R_RATE)
            np.testing.assert_allclose(g.x, oracle.x[:, 0], rtol=1e-8, atol=1e-11)
            np.testing.assert_allclose(full(g.P), oracle.P, rtol=1e-7, atol=1e-16)
            np.testing.assert_allclose(logs, oracle.log_likelihood, rtol=1e-6)


def test_covariance_of_any_gain_is_the_sum_of_what_is_left_and_what_is_let_in():
    P, K = Symmetric(3e-7, 2e-6, 1e-6, 5e-4, 3e-4, 2e-2), np.array([[0.3], [2.0], [5.0]])
    left = np.eye(3) - K @ np.array([[1.0, 0.0, 0.0]])
    updated = kalman.update_with_gain(Gaussian(AxisMotion(0.1, 0.2, 0.3), P), 1e-3, R, tuple(K[:, 0]))
    np.testing.assert_allclose(full(updated.P), left @ full(P) @ left.T + R * K @ K.T, rtol=1e-12)
    np.testing.assert_allclose(updated.x, np.array([0.1, 0.2, 0.3]) + 1e-3 * K[:, 0], rtol=1e-15)


def test_covariance_stays_definite_through_a_hundred_thousand_exact_measurements():
    g = START
    for _ in range(100_000):
        g = Gaussian(START.x, kalman.predicted_covariance(g.P, TRANSITION, Q, T))
        g = kalman.update_rate(kalman.update(g, 0.0, 1e-16), 0.0, 1e-16)
    P = full(g.P)
    assert np.linalg.eigvalsh(P / np.sqrt(np.outer(P.diagonal(), P.diagonal()))).min() > 0
