"""The study rate-measurement against Riccati, against a sine through the real filter, and its rows."""
import math

import numpy as np
import pytest
from scipy.linalg import expm, solve_discrete_are

from acu_tracker.estimation.filters import axis_filter
from pedestal_results import intervals, metrics
from pedestal_studies.p004_li_chen_wang import rate_measurement as study
from pedestal_studies.result import save

T, ALPHA, SIGMA = study.T, study.ALPHA, study.ANGLE_SIGMA_RAD
CASES = [(sigma_a, rate_sigma) for sigma_a in study.ACCELERATION_SIGMAS_DEG_S2
         for rate_sigma in study.RATE_SIGMAS_DEG_S.values()]


def riccati(sigma_a, rate_sigma):
    """(A, B) of the steady filter: Q by Van Loan's integral, gains by the algebraic Riccati equation."""
    drift = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, -ALPHA]])
    white = np.diag([0.0, 0.0, 2.0 * ALPHA * math.radians(sigma_a)**2])
    loan = expm(np.block([[-drift, white], [np.zeros((3, 3)), drift.T]]) * T)
    Phi = loan[3:, 3:].T
    Q = Phi @ loan[:3, 3:]
    rows = 2 if math.isfinite(rate_sigma) else 1
    H, R = np.eye(3)[:rows], np.diag([SIGMA**2, math.radians(rate_sigma)**2][:rows])
    P = solve_discrete_are(Phi.T, H.T, Q, R)
    K = P @ H.T @ np.linalg.inv(H @ P @ H.T + R)
    Phi1 = np.array([[1.0, T, 0.5 * T * T], [0.0, 1.0, T], [0.0, 0.0, 1.0]])
    return (np.eye(3) - K @ H) @ Phi1, np.column_stack([K, np.zeros((3, 2 - rows))])


@pytest.mark.parametrize('sigma_a, rate_sigma', CASES)
def test_the_settled_filter_is_that_of_the_riccati_equation(sigma_a, rate_sigma):
    A, B = study.steady_state_matrices(sigma_a, rate_sigma)
    expected_A, expected_B = riccati(sigma_a, rate_sigma)
    assert A == pytest.approx(expected_A, rel=1e-6, abs=1e-9)
    assert B == pytest.approx(expected_B, rel=1e-6, abs=1e-9)


@pytest.mark.parametrize('rate_sigma', study.RATE_SIGMAS_DEG_S.values())
@pytest.mark.parametrize('frequency', [0.2, 2.0])
def test_a_sine_through_the_filter(frequency, rate_sigma):
    """Amplitude and phase of the last 20 s of 120 s, without noise."""
    t = T * np.arange(12000)
    w = 2.0 * math.pi * frequency
    c = axis_filter.constants(study.filter_of(math.radians(study.MAIN_SIGMA_DEG_S2), 1.0))
    out = np.zeros(len(t), axis_filter.Estimate.dtype)
    axis_filter.estimates(c, t, np.sin(w * t), np.full(len(t), SIGMA**2),
                          w * np.cos(w * t) + (0.0 if math.isfinite(rate_sigma) else math.nan),
                          np.full(len(t), math.radians(rate_sigma)**2), 1.0, out)
    late = t >= 100.0
    (angle, rate) = study.responses(*study.steady_state_matrices(study.MAIN_SIGMA_DEG_S2, rate_sigma),
                                    np.array([frequency]))
    for field, turn, G in (('angle', 1.0, angle[0]), ('rate', 1j * w, rate[0])):
        _, a, b = metrics.harmonic_fit(t[late], out[field][late], w)
        assert (a + 1j * b) / turn == pytest.approx(G, abs=1e-5)


def test_bandwidth_of_a_lag_and_of_what_never_falls():
    assert study.bandwidth(1.0 / (1.0 + 1j * study.RESPONSE_FREQUENCIES_HZ / 3.0)) == pytest.approx(3.0, rel=1e-4)
    assert math.isnan(study.bandwidth(np.full(len(study.RESPONSE_FREQUENCIES_HZ), 0.8)))


@pytest.mark.parametrize('steps', study.DIFFERENCED_RATES.values())
def test_a_differenced_rate_and_its_variance(steps):
    t = T * np.arange(50000)
    rate, variance = study.differenced_rate(0.3 * t, steps)
    assert np.isnan(rate[:steps]).all() and np.abs(rate[steps:] - 0.3).max() < 1e-9
    noisy, _ = study.differenced_rate(SIGMA * np.random.default_rng(1).standard_normal(len(t)), steps)
    assert np.var(noisy[steps:]) == pytest.approx(variance, rel=0.05)


@pytest.fixture(scope='module')
def result():
    return study.run(lambda share, text: None, runs=5)


@pytest.mark.thorough
def test_rows(result):
    values = {(row['case'], row['metric']): row['value'] for row in result.rows}
    assert len(values) == len(result.rows)
    assert [row for row in result.rows if intervals.missed(row)] == []
    for name in ('position', 'position-rate'):
        assert values[name, 'rate_bandwidth_hz'] > 1.0 and values[name, 'dynamic_error_0p2hz'] < 0.02
    assert values['position-rate', 'rate_bandwidth_ratio'] == pytest.approx(
        values['position-rate', 'rate_bandwidth_hz'] / values['position', 'rate_bandwidth_hz'])
    assert values['position-rate', 'dynamic_error_ratio'] == pytest.approx(
        values['position', 'dynamic_error_0p2hz'] / values['position-rate', 'dynamic_error_0p2hz'])


@pytest.mark.thorough
def test_only_an_independent_rate_helps(result):
    error = {row['case'].partition('/')[2]: row['value'] for row in result.rows if row['metric'] == 'angle_rms_deg'}
    assert error['position-rate-0.02'] < 0.5 * error['position-rate'] < 0.3 * error['position']
    assert error['differenced-1'] == pytest.approx(error['position'], rel=0.02)
    assert error['differenced-20'] > 1.2 * error['position']


@pytest.mark.thorough
def test_every_figure_is_drawn(result, tmp_path):
    for name, draw in result.figures.items():
        save(draw, tmp_path / f'{name}.png')
        assert (tmp_path / f'{name}.png').stat().st_size > 10000
