import math

import numpy as np
import pytest
from oracles import van_loan
from scipy.integrate import quad

from acu_tracker.estimation.filters import kalman, motion_models
from acu_tracker.geometry.vector import AxisMotion
from pedestal_common.graph import topics

CASES = [(0.1, 0.01), (0.5, 0.005), (0.5, 0.0999), (0.7, 0.3), (2.0, 0.24999), (2.0, 0.25001), (5.0, 0.4), (1.0, 3.0)]


def singer(alpha, T):
    """Phi and q of the continuous model, scaled to T = 1, so that the blocks of small T keep their digits."""
    S = np.diag([1.0, T, T * T])
    A = S @ np.array([[0, 1, 0], [0, 0, 1], [0, 0, -alpha]]) @ np.linalg.inv(S) * T
    phi, q = van_loan(A, [0, 0, 1], 1.0)
    S = np.linalg.inv(S)
    return S @ phi @ np.linalg.inv(S), S @ q @ S.T * T**5


def model(kind, **values):
    m = motion_models.MotionModelRecord.zeros()
    m['kind'] = motion_models.MODEL_NAMES.index(kind)
    for name, value in values.items():
        m[name] = value
    return m[0]


def symmetric(q11, q12, q13, q22, q23, q33):
    return np.array([[q11, q12, q13], [q12, q22, q23], [q13, q23, q33]])


@pytest.mark.parametrize('alpha, T', CASES)
def test_transition_and_noise_against_van_loan(alpha, T):
    phi, q = singer(alpha, T)
    f13, f23, f33 = motion_models.fading(alpha, T)
    np.testing.assert_allclose([[1, T, f13], [0, 1, f23], [0, 0, f33]], phi, rtol=1e-11, atol=1e-300)
    np.testing.assert_allclose(symmetric(*motion_models.fading_noise(alpha, T)), q, rtol=2e-9)


@pytest.mark.parametrize('alpha, T', CASES)
def test_noise_against_quadrature(alpha, T):
    def g(s):
        x = alpha * s
        if x < 1e-3:
            return s * s * (0.5 - x / 6 + x * x / 24), s * (1 - x / 2 + x * x / 6 - x**3 / 24), math.exp(-x)
        return (x + math.expm1(-x)) / alpha**2, -math.expm1(-x) / alpha, math.exp(-x)

    pairs = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))
    integrals = [quad(lambda s, i, j: g(s)[i] * g(s)[j], 0, T, args=(i, j), epsabs=0, epsrel=1e-10)[0]
                 for i, j in pairs]
    np.testing.assert_allclose(motion_models.fading_noise(alpha, T), integrals, rtol=1e-8)


@pytest.mark.parametrize('alpha', [1e-4, 0.1, 0.5])
@pytest.mark.parametrize('T', [1e-4, 0.005, 0.01])
def test_noise_stays_definite_for_small_alpha_t(alpha, T):
    scale = np.diag([T**-2.5, T**-1.5, T**-0.5])
    q = scale @ symmetric(*motion_models.fading_noise(alpha, T)) @ scale
    # In the limit of white jerk.
    np.testing.assert_allclose(q, [[1 / 20, 1 / 8, 1 / 6], [1 / 8, 1 / 3, 1 / 2], [1 / 6, 1 / 2, 1]], rtol=0.02)
    assert np.linalg.eigvalsh(q).min() > 1e-4


@pytest.mark.parametrize('alpha, T', CASES)
def test_prediction_of_current_statistical_is_phi_x_plus_u_abar(alpha, T):
    """Phi1 X for Phi X + U abar, abar the estimated acceleration (Ma 2023, eq. 2, 6)."""
    X = np.array([0.3, -0.2, 0.15])
    f13, f23, f33 = motion_models.fading(alpha, T)
    Phi = np.array([[1, T, f13], [0, 1, f23], [0, 0, f33]])
    # u1 with the inner 1/alpha that the print lacks; rise = 1 - e^(-alpha T).
    rise = -math.expm1(-alpha * T)
    U = np.array([(-T + alpha * T * T / 2 + rise / alpha) / alpha, T - rise / alpha, rise])
    m = model('current_statistical', alpha=alpha, a_max=1.0)
    mean = kalman.predicted_mean(AxisMotion(*X), motion_models.discretised(m, X[2], T).mean, T)
    np.testing.assert_allclose(mean, Phi @ X + U * X[2], rtol=1e-12)


CONTINUOUS = {'cv': ([[0, 1, 0], [0, 0, 0], [0, 0, 0]], [0, 0.3, 0]),
              'ca': ([[0, 1, 0], [0, 0, 1], [0, 0, 0]], [0, 0, 0.3]),
              'singer': ([[0, 1, 0], [0, 0, 1], [0, 0, -0.7]], [0, 0, math.sqrt(2 * 0.7) * 0.2])}


@pytest.mark.parametrize('kind', CONTINUOUS)
@pytest.mark.parametrize('T', [0.005, 0.3, 2.0])
def test_every_model_against_van_loan(kind, T):
    """dX = A X dt + g dw: transition and Q by one matrix exponential; the third state of cv is 0 at once."""
    phi, Q = van_loan(*CONTINUOUS[kind], T)
    m = model(kind, noise=0.3, alpha=0.7, sigma=0.2)
    discrete = motion_models.discretised(m, 5.0, T)
    f13, f23, f33 = discrete.F
    np.testing.assert_allclose([[1, T, f13], [0, 1, f23]], phi[:2], rtol=1e-12, atol=1e-15)
    assert f33 == (0.0 if kind == 'cv' else pytest.approx(phi[2, 2], rel=1e-12))
    assert discrete.mean == discrete.F
    np.testing.assert_allclose(symmetric(*discrete.Q), Q, rtol=1e-7, atol=1e-18)


def test_modified_rayleigh_variance_by_quadrature():
    a_max, abar = 3.0, 1.2
    mu2 = (a_max - abar)**2 * 2 / math.pi

    def density(a):
        return (a_max - a) / mu2 * math.exp(-(a_max - a)**2 / (2 * mu2))

    mean = quad(lambda a: a * density(a), -60, a_max, epsabs=1e-13, limit=400)[0]
    variance = quad(lambda a: (a - mean)**2 * density(a), -60, a_max, epsabs=1e-13, limit=400)[0]
    assert mean == pytest.approx(abar, abs=1e-9)
    assert variance == pytest.approx(0.885296, abs=5e-7)
    assert motion_models.acceleration_variance(abar, a_max, 0.0) == pytest.approx(variance, rel=1e-9)
    assert motion_models.acceleration_variance(-abar, a_max, 0.0) == pytest.approx(variance, rel=1e-9)


def test_floor_holds_beyond_a_max():
    for abar in (2.9, 3.0, 10.0, -10.0):
        assert motion_models.acceleration_variance(abar, 3.0, 0.3) == pytest.approx(0.81)


def test_every_model_has_its_column_in_the_filter_topic():
    assert motion_models.COLUMN_NAMES == topics.MOTION_MODELS
