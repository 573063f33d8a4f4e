import numpy as np
from filterpy.kalman import KalmanFilter
from scipy.linalg import solve_discrete_are

from acu_tracker import kalman, motion_models

T, ALPHA, R = 0.01, 0.5, 2.5e-7
F13, F23, F33 = motion_models.fading(ALPHA, T)
F = np.array([[1, T, F13], [0, 1, F23], [0, 0, F33]])
QS = tuple(0.3 * q for q in motion_models.fading_noise(ALPHA, T))
H = np.array([[1.0, 0.0, 0.0]])


def full(p):
    return np.array([[p[0], p[1], p[2]], [p[1], p[3], p[4]], [p[2], p[4], p[5]]])


def run(measurements, x, p):
    for y in measurements:
        x = F @ x
        p = kalman.predict_covariance(*p, T, F13, F23, F33, *QS)
        prior = full(p)
        nu = y - x[0]
        nis = nu * nu / (p[0] + R)
        x1, x2, x3, *p = kalman.update(*x, *p, nu, R)
        x = np.array([x1, x2, x3])
        yield x, full(p), prior, nu, nis


def test_against_filterpy():
    rng = np.random.default_rng(3)
    measurements = np.cumsum(rng.normal(0, 5e-4, 400))
    oracle = KalmanFilter(3, 1)
    oracle.F, oracle.Q, oracle.H, oracle.R = F, full(QS), H, np.array([[R]])
    oracle.x, oracle.P = np.array([[0.1], [0.2], [-0.1]]), np.diag([1e-3, 0.04, 0.5])
    for y, (x, P, _, nu, nis) in zip(measurements, run(measurements, oracle.x[:, 0],
                                                      (1e-3, 0.0, 0.0, 0.04, 0.0, 0.5))):
        oracle.predict()
        oracle.update(np.array([[y]]))
        np.testing.assert_allclose(x, oracle.x[:, 0], rtol=1e-8, atol=1e-11)
        np.testing.assert_allclose(P, oracle.P, rtol=1e-7, atol=1e-16)
        np.testing.assert_allclose(nu, oracle.y[0, 0], rtol=1e-6, atol=1e-11)
        np.testing.assert_allclose(nis, oracle.y[0, 0]**2 / oracle.S[0, 0], rtol=1e-6, atol=1e-9)


def test_steady_state_solves_the_riccati_equation():
    *_, (x, P, prior, _, _) = run(np.zeros(6000), np.zeros(3), (1.0, 0.0, 0.0, 1.0, 0.0, 1.0))
    np.testing.assert_allclose(prior, solve_discrete_are(F.T, H.T, full(QS), [[R]]), rtol=1e-7)
    assert np.linalg.eigvalsh(P / np.sqrt(np.outer(P.diagonal(), P.diagonal()))).min() > 0
