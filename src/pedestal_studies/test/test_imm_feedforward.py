"""The study imm-feedforward: its loop against closed forms and against filterpy and scipy, its rows."""
import math
import weakref

import control
import filterpy.kalman
import numpy as np
import pytest
from scipy.linalg import solve_discrete_are, solve_discrete_lyapunov

from acu_tracker.estimation.filters import axis_filter
from acu_tracker.estimation.params import FilterParameters
from pedestal_results import intervals, tracking
from pedestal_studies.p003_lin_wu_zhu import feedforward_loop as loop
from pedestal_studies.p003_lin_wu_zhu import feedforward_speed
from pedestal_studies.p003_lin_wu_zhu import imm_feedforward as study
from pedestal_studies.result import save
from pedestal_workbench.trials import monte_carlo

T, W, ZETA = loop.T, *loop.RATE_LOOP_CONSTANTS


def rate_loop():
    """(theta, omega, omega') over T under a rate command that is held."""
    return control.sample_system(control.ss([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, -W * W, -2.0 * ZETA * W]],
                                            [[0.0], [0.0], [W * W]], np.eye(3), np.zeros((3, 1))), T, 'zoh')


def test_the_rate_loop_is_the_sampled_one():
    plant = rate_loop()
    assert loop.rate_loop_step(W, ZETA) == pytest.approx(np.hstack([plant.A, plant.B]), rel=1e-9, abs=1e-12)
    z = np.exp(2j * math.pi * np.array([0.5, 5.0, 40.0]) * T)
    transfer = control.sample_system(control.tf([W * W], [1.0, 2.0 * ZETA * W, W * W, 0.0]), T, 'zoh')
    assert [plant(x)[0, 0] for x in z] == pytest.approx(transfer(z), rel=1e-6)


def test_the_gains_leave_only_the_jerk():
    """1 - W(s) (k_v + k_a s) = s^2 / w^2 - ...: at 0.1 Hz what is left is (s / w)^2 and turned by 180 deg."""
    k_v, k_a = loop.feedforward_gains(W, ZETA)
    s = 2j * math.pi * 0.1
    assert 1.0 - W * W * (k_v + k_a * s) / (s * s + 2.0 * ZETA * W * s + W * W) == pytest.approx((s / W)**2, rel=0.03)


def steady_miss(angle, late):
    """Miss after 8 s, no noise, of a target with a polynomial angle; its true state fed forward, `late` [s]."""
    t = T * np.arange(800)
    target = np.column_stack([angle.deriv(i)(t) if i else angle(t) for i in range(3)])
    known = np.column_stack([angle.deriv(i)(t + 0.5 * T - late) for i in (1, 2)])
    out = np.zeros((1, len(t)), loop.Step.dtype)
    loop._follow(target, known, axis_filter.Filter.zeros(), axis_filter.constants(FilterParameters()), 0.0,
                  loop.rate_loop_step(W, ZETA), np.zeros((1, len(t))), out)
    return out['miss'][0, -1]


@pytest.mark.parametrize('coefficients, late, left', [
    ([0.1, 0.2], 0.0, 0.0), ([0.1, 0.2], 0.045, 0.0), ([0.1, 0.2, 0.05], 0.0, 0.0),
    ([0.1, 0.2, 0.05], 0.045, 0.1 * 0.045 / loop.K_P),
    ([0.0, 0.1, 0.0, 0.01], 0.0, 0.06 * (1.0 / W**2 - T * T / 24.0) / loop.K_P)])
def test_what_a_polynomial_leaves(coefficients, late, left):
    """Of a delay a * late / K_p; of jerk j what W lacks, j / w^2, less what holding a rate over T adds, j T^2 / 24."""
    assert steady_miss(np.polynomial.Polynomial(coefficients), late) == pytest.approx(left, rel=1e-4, abs=1e-9)


def test_one_run_is_what_filterpy_and_scipy_make_of_it():
    q, axis = math.radians(0.3), 'elevation'
    t, target, _ = loop.motion(axis)
    ours = loop.steps_of(axis, loop.cv(0.3), 3, 1)[0]
    normals = np.random.default_rng((loop.NOISE_SEED, 3)).standard_normal(len(t))
    kalman = filterpy.kalman.KalmanFilter(2, 1)
    kalman.F = np.array([[1.0, T], [0.0, 1.0]])
    kalman.H, kalman.R = np.array([[1.0, 0.0]]), np.array([[loop.MISS_SIGMA_RAD**2]])
    kalman.Q = q * q * np.array([[T**3 / 3.0, T * T / 2.0], [T * T / 2.0, T]])
    kalman.P = np.diag([loop.MISS_SIGMA_RAD**2, loop.S_MOTION_RATE_RAD_S**2])
    plant, x = rate_loop(), target[0].copy()
    theta, miss = [], []
    for k in range(len(t)):
        theta.append(x[0])
        miss.append(target[k, 0] - theta[-1])
        u, j = target[0, 1] + loop.K_A * target[0, 2], k - 4
        if j >= 0:
            y = target[j, 0] + loop.MISS_SIGMA_RAD * normals[j]
            if j == 0:
                kalman.x = np.array([[y], [0.0]])
            else:
                kalman.predict()
                kalman.update(y)
            u = 5.0 * (y - theta[j]) + kalman.x[1, 0]
        x = plant.A @ x + plant.B[:, 0] * u
    assert ours['miss'] == pytest.approx(np.array(miss), abs=1e-9)


def test_noise_of_the_rate_is_the_steady_states():
    """Gains by Riccati; as the target has no noise, the measured one through them by Lyapunov."""
    q, R = math.radians(0.5), loop.MISS_SIGMA_RAD**2
    F, H = np.array([[1.0, T], [0.0, 1.0]]), np.array([[1.0, 0.0]])
    P = solve_discrete_are(F.T, H.T, q * q * np.array([[T**3 / 3.0, T * T / 2.0], [T * T / 2.0, T]]), R)
    K = P @ H.T / (P[0, 0] + R)
    expected = math.degrees(math.sqrt(solve_discrete_lyapunov((np.eye(2) - K @ H) @ F, K @ K.T * R)[1, 1]))
    result = loop.statistics({'cv': ('azimuth', loop.cv(0.5))}, 50, monte_carlo.Pool(1))['cv']
    assert tracking.rms(result.of('rate_noise_deg_s')) == pytest.approx(expected, rel=0.03)


def test_an_outcome_is_that_of_all_its_runs():
    """More than one batch, against one array of all runs."""
    case = ('azimuth', study.FEEDFORWARD_SOURCES['imm-predicted'])
    count = loop.BATCH_RUNS + 3
    result = loop.statistics({'case': case}, count, monte_carlo.Pool(1))['case']
    miss = loop.steps_of(*case, 0, count)['miss']
    t, _, period = loop.motion('azimuth')
    assert result.miss_mean == pytest.approx(miss.mean(axis=0), abs=1e-12)
    counts = t >= 0.5 * period
    assert tracking.rms(result.of('miss_rms_deg')) == pytest.approx(math.degrees(tracking.rms(miss[:, counts])))
    assert result.of('miss_peak_deg') == pytest.approx(np.degrees(np.abs(miss[:, counts]).max(axis=1)))
    assert (result.of('miss_rms_deg') < result.of('miss_worst_second_deg')).all()
    assert (result.of('miss_worst_second_deg') < result.of('miss_peak_deg')).all()


@pytest.fixture(scope='module')
def result():
    return study.run(lambda share, text: None, runs=12)


@pytest.mark.thorough
def test_no_row_misses_its_target_but_those_that_are_said_to(result):
    """Through the product, with 40 ms of latency, the default bank is not three times as good as kalman-cv."""
    named = {(row['case'], row['metric']): row for row in result.rows}
    assert len(named) == len(result.rows)
    for axis in study.REVERSAL_S_BY_AXIS:
        for name in ('kalman-cv', 'imm', 'imm-predicted', 'perfect-state'):
            assert {(f'{axis}/{name}', 'miss_rms_deg'), (f'{axis}/{name}', 'rate_noise_deg_s')} <= named.keys()
    assert sum(row['target'] is not None for row in result.rows) == 15
    assert [(row['case'], row['metric']) for row in result.rows if intervals.missed(row)] == [
        ('elevation/drive-imm', 'miss_ratio_to_kalman_cv')]


@pytest.mark.thorough
def test_every_figure_is_drawn(result, tmp_path):
    for name, draw in result.figures.items():
        save(draw, tmp_path / f'{name}.png')
        assert (tmp_path / f'{name}.png').stat().st_size > 10000


def test_batches_are_added_as_they_come():
    """However many runs: of all their sums there are never more than the last, the one before and the total."""
    made, most = [], 0

    class Pool:
        @staticmethod
        def map(function, items, progress):
            nonlocal most
            for k, _ in enumerate(items):
                miss = np.full(3, float(k))
                made.append(weakref.ref(miss))
                most = max(most, sum(one() is not None for one in made))
                yield miss, np.ones((loop.BATCH_RUNS, len(loop.METRIC_UNITS)))

    runs = 12 * loop.BATCH_RUNS
    outcome = loop.statistics({'case': ('azimuth', loop.cv(0.1))}, runs, Pool())['case']
    assert most <= 3
    assert outcome.miss_mean == pytest.approx(66.0 / runs) and outcome.values.shape == (runs, len(loop.METRIC_UNITS))


@pytest.mark.parametrize('steps', [1, 15])
def test_differences_are_those_of_a_parabola(steps):
    """A rate is that of the middle of its span, `steps` / 2 before the miss; an acceleration is exact."""
    t = T * np.arange(200)
    known = loop.differenced(0.2 + 0.1 * t + 0.05 * t * t, steps)
    first = 2 * steps + loop.MISS_DELAY_STEPS
    middle = t[first:] - T * (loop.MISS_DELAY_STEPS + 0.5 * steps)
    assert known[first:, 0] == pytest.approx(0.1 + 0.1 * middle, rel=1e-9)
    assert known[first:, 1] == pytest.approx(np.full(len(middle), 0.1), rel=1e-6)
    assert not known[:first, 1].any()


def test_the_noise_of_a_difference_is_that_of_its_two_angles():
    axis, rate = 'azimuth', loop.S_MOTION_RATE_RAD_S
    source = feedforward_speed.sources(axis)['difference-1']
    errors = feedforward_speed.estimate_errors(axis, loop.steps_of(axis, source, 0, 3), rate)
    sigma = math.degrees(loop.MISS_SIGMA_RAD)
    assert errors.mean(axis=0) == pytest.approx((math.sqrt(2.0) * sigma / T, math.sqrt(6.0) * sigma / T**2), rel=0.02)


@pytest.fixture(scope='module')
def speed_rows():
    found = feedforward_speed.run(lambda share, text: None, runs=3)
    assert len(found.figures['rates']().axes) == 4
    return {(row['case'], row['metric']): row for row in found.rows}


@pytest.mark.thorough
def test_at_50_m_s_the_imm_still_is_three_times_as_good(speed_rows):
    for axis in study.REVERSAL_S_BY_AXIS:
        slow, fast = (speed_rows[f'{axis}/{speed}/imm', 'miss_rms_deg']['value'] for speed in ('30m_s', '50m_s'))
        assert slow < fast < 3.0 * slow
        assert not intervals.missed(speed_rows[f'{axis}/50m_s/imm', 'miss_ratio_to_kalman_cv'])
        assert speed_rows[f'{axis}/50m_s/drive-imm', 'autotrack_percent']['value'] == 100.0
    assert ('azimuth/50m_s/drive-imm', 'miss_ratio_to_kalman_cv') not in speed_rows     # kalman-cv leaves autotrack


@pytest.mark.thorough
def test_differences_are_worse_estimates(speed_rows):
    for axis in study.REVERSAL_S_BY_AXIS:
        for name in ('difference-1', 'difference-15'):
            assert speed_rows[f'{axis}/30m_s/{name}', 'rate_ratio_to_imm']['value'] > 1.2
