import math

import numpy as np
import pytest
from scipy.linalg import solve_discrete_are, solve_discrete_lyapunov
from scipy.optimize import minimize

from acu_tracker.estimation.filters import kalman

T, R = 0.02, 2.5e-7
H = np.array([[1.0, 0.0, 0.0]])
RAMP = np.array([[1.0, T], [0.0, 1.0]])
PARABOLA = np.array([[1.0, T, T * T / 2], [0.0, 1.0, T], [0.0, 0.0, 1.0]])


@pytest.mark.parametrize('alpha', [0.02, 0.15, 0.5, 0.9])
def test_kalata_is_the_steady_kalman_filter_of_acceleration_steps(alpha):
    """The step that makes the Riccati equation give this alpha makes it give beta and gamma too."""
    beta, gamma = kalman.kalata(alpha)
    step = gamma * math.sqrt(R / (1.0 - alpha)) / (2.0 * T * T)
    g = np.array([[T * T / 2], [T], [1.0]])
    scale = np.diag([1.0, T, T * T])
    F, G = scale @ PARABOLA @ np.linalg.inv(scale), scale @ g * step / math.sqrt(R)
    P = solve_discrete_are(F.T, H.T, G @ G.T, [[1.0]])
    K = np.linalg.solve(scale, P[:, 0] / (P[0, 0] + 1.0))
    np.testing.assert_allclose(kalman.constant_gain(alpha, beta, gamma, T), K, rtol=1e-4)


def noise_and_transient(gains):
    """(variance of the predicted angle over R, sum of the squared errors after a step of the rate) of an alpha-beta
    filter, both from Lyapunov equations."""
    alpha, beta = gains
    K, C = np.array([[alpha], [beta / T]]), np.array([[1.0, 0.0]])
    closed = RAMP @ (np.eye(2) - K @ C)
    if max(abs(np.linalg.eigvals(closed))) >= 1.0:
        return math.inf, math.inf
    noise = solve_discrete_lyapunov(closed, RAMP @ K @ K.T @ RAMP.T)[0, 0]
    error = RAMP @ np.array([[0.0], [1.0]])
    return noise, solve_discrete_lyapunov(closed, error @ error.T)[0, 0]


@pytest.mark.parametrize('weight', [0.3, 30.0, 3000.0])
def test_benedict_bordner_is_best_for_noise_and_transient(weight):
    def cost(gains):
        noise, transient = noise_and_transient(gains)
        return noise + weight * transient

    alpha, beta = minimize(cost, (0.3, 0.05), method='Nelder-Mead', options={'xatol': 1e-9, 'fatol': 1e-15}).x
    print(f'weight {weight:g}: alpha {alpha:.4f}, beta {beta:.5f}')
    assert beta == pytest.approx(kalman.benedict_bordner(alpha), rel=1e-4)
