import numpy as np
from filterpy.kalman import KalmanFilter

from acu_tracker.estimation import kalman, motion_models

T, ALPHA, R, R_RATE = 0.01, 0.5, 2.5e-7, 4e-6
F13, F23, F33 = motion_models.fading(ALPHA, T)
F = np.array([[1, T, F13], [0, 1, F23], [0, 0, F33]])
QS = tuple(0.3 * q for q in motion_models.fading_noise(ALPHA, T))
START = np.array([0.1, 0.2, -0.1]), (1e-3, 0.0, 0.0, 0.04, 0.0, 0.5)


def full(p):
    return np.array([[p[0], p[1], p[2]], [p[1], p[3], p[4]], [p[2], p[4], p[5]]])


def filterpys(measured):
    oracle = KalmanFilter(3, measured)
    oracle.F, oracle.Q, oracle.H, oracle.R = F, full(QS), np.eye(3)[:measured], np.diag([R, R_RATE][:measured])
    oracle.x, oracle.P = START[0][:, None].copy(), full(START[1])
    return oracle


def test_angle_and_rate_one_after_the_other_against_both_at_once():
    rng = np.random.default_rng(3)
    for measured in (1, 2):
        oracle, (x, p) = filterpys(measured), START
        for y, y_rate in zip(np.cumsum(rng.normal(0, 5e-4, 400)), rng.normal(0.0, 0.1, 400)):
            oracle.predict()
            oracle.update(np.array([[y], [y_rate]])[:measured])
            x, p = F @ x, kalman.predict_covariance(*p, T, F13, F23, F33, *QS)
            nu = y - x[0]
            logs = kalman.log_likelihood(nu, p[0] + R)
            x1, x2, x3, *p = kalman.update(*x, *p, nu, R)
            if measured == 2:
                logs += kalman.log_likelihood(y_rate - x2, p[3] + R_RATE)
                x1, x2, x3, *p = kalman.update_rate(x1, x2, x3, *p, y_rate - x2, R_RATE)
            x = np.array([x1, x2, x3])
            np.testing.assert_allclose(x, oracle.x[:, 0], rtol=1e-8, atol=1e-11)
            np.testing.assert_allclose(full(p), oracle.P, rtol=1e-7, atol=1e-16)
            np.testing.assert_allclose(logs - 0.5 * measured * np.log(2 * np.pi), oracle.log_likelihood, rtol=1e-6)


def test_covariance_of_any_gain_is_the_sum_of_what_is_left_and_what_is_let_in():
    p, K = (3e-7, 2e-6, 1e-6, 5e-4, 3e-4, 2e-2), np.array([[0.3], [2.0], [5.0]])
    left = np.eye(3) - K @ np.array([[1.0, 0.0, 0.0]])
    x1, x2, x3, *updated = kalman.update_with_gain(0.1, 0.2, 0.3, *p, 1e-3, R, *K[:, 0])
    np.testing.assert_allclose(full(updated), left @ full(p) @ left.T + R * K @ K.T, rtol=1e-12)
    np.testing.assert_allclose((x1, x2, x3), np.array([0.1, 0.2, 0.3]) + 1e-3 * K[:, 0], rtol=1e-15)


def test_covariance_stays_definite_through_a_hundred_thousand_exact_measurements():
    x, p = START
    for _ in range(100_000):
        p = kalman.predict_covariance(*p, T, F13, F23, F33, *QS)
        x1, x2, x3, *p = kalman.update(*x, *p, 0.0, 1e-16)
        x1, x2, x3, *p = kalman.update_rate(x1, x2, x3, *p, 0.0, 1e-16)
    P = full(p)
    assert np.linalg.eigvalsh(P / np.sqrt(np.outer(P.diagonal(), P.diagonal()))).min() > 0
