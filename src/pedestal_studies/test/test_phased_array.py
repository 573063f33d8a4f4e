"""The study of Jia 2025: its kernels against closed forms and steady states, its rows against their targets."""
import dataclasses
import math

import numpy as np
import pytest
from scipy import linalg

from acu_tracker.estimation.filters.kalman import benedict_bordner
from pedestal_results import intervals, metrics, tracking
from pedestal_studies.p002_jia import compared_loops, phased_array
from pedestal_studies.p002_jia.angle_loop import (
    GRID_STEP_S,
    SMOOTHING_SAMPLES,
    FilterLoop,
    PaperLoop,
    Receiver,
    receiver_reading,
)
from pedestal_studies.p002_jia.compared_loops import instants, settled
from pedestal_studies.result import save
from receiver_law import monopulse


@pytest.fixture(scope='module', name='result')
def study():
    return phased_array.run(lambda *_: None, runs=8)


@pytest.fixture(scope='module', name='values')
def values_of(result):
    return {(row['case'], row['metric']): row['value'] for row in result.rows}


@pytest.mark.thorough
def test_every_target_is_met(result):
    targets = {(row['case'], row['metric']): row['target'] for row in result.rows if row['target'] is not None}
    assert targets == phased_array.METRIC_TARGETS
    assert [row for row in result.rows if intervals.missed(row)] == []


@pytest.mark.thorough
def test_limits_found_by_bisection_are_those_of_the_eigenvalues(values):
    cases = {case for case, metric in values if case.startswith('delay-limit/')}
    assert len(cases) == 29
    for case in cases:
        assert values[case, 'delay_ms'] == values[case, 'eigenvalue_delay_ms'] > 0


@pytest.mark.thorough
def test_without_smoothing_the_limit_is_in_whole_periods(values):
    """20, 10, 4, 3 periods: delays up to just below the next one act alike (nav.md 2.2, by eigenvalues there too)."""
    for alpha, periods in ((0.05, 20), (0.1, 10), (0.2, 4), (0.3, 3)):
        for T in (10, 5):
            assert values[f'delay-limit/alpha={alpha:g}/T={T}ms/S0', 'delay_ms'] == (periods + 1) * T - 1


@pytest.mark.thorough
def test_readings_are_the_closed_forms(values):
    for rate in (10, 20, 30, 40):
        assert values[f'ramp/{rate}deg_s/T=10ms', 'lag_deg'] == pytest.approx(rate * 0.01, abs=1e-9)
    beta = benedict_bordner(0.1)
    assert values['sine', 'lag_deg'] == pytest.approx(math.hypot(30.0 * 0.01, 10.0 * 1e-4 / beta), rel=2e-3)
    assert values['sway/delta=0', 'lag_deg'] / values['sway/delta=0.85', 'lag_deg'] == pytest.approx(
        1.0 / 0.15, rel=1e-3)


@pytest.mark.thorough
def test_the_beam_is_lost_when_its_lag_passes_half_a_beamwidth(values):
    for form in ('type-1', 'type-2'):
        assert values[f'loss/half-beamwidth/{form}', 'linear_lag_beamwidths'] == pytest.approx(0.5, abs=0.05)
        assert values[f'loss/pattern/{form}', 'linear_lag_beamwidths'] > 0.7


@pytest.mark.thorough
def test_the_graph_has_no_more_than_half_a_period_and_the_loops_own_error(values):
    """A beam that stands for T is off by half of it at either end; the paper's loop lags by more."""
    rate = math.degrees(compared_loops.SWAY_AMPLITUDE_RAD) * 2.0 * math.pi / compared_loops.SWAY_PERIOD_S
    for T in (0.01, 0.001):
        hold = 0.5 * rate * T
        assert hold * 0.99 < values[f'graph/T={T * 1e3:g}ms', 'max_error_deg'] < hold + 1e-3
    assert values['graph/T=10ms/paper-delta', 'max_error_deg'] > 1.2 * values['graph/T=10ms', 'max_error_deg']


@pytest.mark.thorough
def test_figures_are_drawn(result, tmp_path):
    assert set(result.figures) >= {f'figure-{n}' for n in (3, 4, 5, 7, 9)} | {'figure-6-left', 'figure-6-right'}
    for name, draw in result.figures.items():
        figure = draw()
        lines = [line for axes in figure.axes for line in axes.get_lines()]
        assert lines and all(np.isfinite(line.get_ydata()).any() for line in lines), name
    save(result.figures['figure-7'], tmp_path / 'figure-7.png')
    assert (tmp_path / 'figure-7.png').stat().st_size > 10000


@pytest.mark.thorough
def test_a_beam_that_is_right_in_the_middle_is_off_at_the_ends_of_its_millisecond(values):
    """By the rate of the target: 30 deg/s, and what is left of the sway's 7.85 deg/s."""
    assert values['best/ramp', 'ends_max_error_deg'] == pytest.approx(0.015, abs=1e-4)
    rate = compared_loops.SWAY_AMPLITUDE_RAD * 2.0 * math.pi / compared_loops.SWAY_PERIOD_S
    limit = compared_loops.isolation(0.5 * rate * GRID_STEP_S)
    for case in ('best/sway-ins', 'best/sway-ins/exact-stamps'):
        assert values[case, 'ends_isolation_db'] == pytest.approx(limit, abs=4.0)
        assert values[case, 'ends_isolation_db'] < limit + 0.01


@pytest.mark.parametrize('hold, delay', [(1, 20), (10, 20), (5, 150)])
def test_better_loop_meets_a_ramp_but_for_its_hold(hold, delay):
    """For any delay; a command that stands for `hold` is off by half of it at either end."""
    target = math.radians(30.0) * instants(10.0)
    beam, _ = FilterLoop(1e-2, 1e-3, hold=hold, delay=delay).run(target)
    error = np.degrees(target - beam)[-1000:]
    assert np.abs(error).max() == pytest.approx(30.0 * 0.5 * (hold - 1) * GRID_STEP_S, abs=1e-9)


def test_jitter_is_that_of_the_steady_filter():
    """Riccati gain of the 10 ms blocks, Lyapunov covariance of what white noise does, carried to where it is used."""
    q, sigma, T = 0.01, 1e-3, 0.01
    F = np.array([[1.0, T, T * T / 2], [0.0, 1.0, T], [0.0, 0.0, 1.0]])
    Q = q * q * np.array([[T**5 / 20, T**4 / 8, T**3 / 6], [T**4 / 8, T**3 / 3, T * T / 2], [T**3 / 6, T * T / 2, T]])
    H, R = np.array([[1.0, 0.0, 0.0]]), sigma**2 / 10
    P = linalg.solve_discrete_are(F.T, H.T, Q, [[R]])
    K = P @ H.T / (P[0, 0] + R)
    A = (np.eye(3) - K @ H) @ F
    covariance = linalg.solve_discrete_lyapunov(A, K @ K.T * R)
    ahead = 0.02 + 0.5 * T + GRID_STEP_S * (np.arange(10) + 0.5)
    expected = math.sqrt(np.mean([g @ covariance @ g for g in (np.array([1.0, a, a * a / 2]) for a in ahead)]))
    noise = sigma * np.random.default_rng(2).standard_normal(200_000)
    beam, _ = FilterLoop(q, sigma).run(np.zeros(200_000), noise)
    assert tracking.rms(beam[20_000:]) == pytest.approx(expected, rel=0.06)


def test_with_the_ins_only_what_the_attitude_is_late_is_left():
    """A fixed target on a swaying deck: exact stamps leave almost nothing, late ones what the filter cannot follow."""
    sway, rate = compared_loops.sway_target()
    loops = {late: FilterLoop(1e-4, 1e-3, use_ins=True, stamp_error=late) for late in (0, 5, 20)}
    errors = {late: settled(sway - loop.run(sway, None, sway, rate)[0]) for late, loop in loops.items()}
    assert metrics.peak(errors[0]) < 2e-5 * compared_loops.SWAY_AMPLITUDE_RAD
    # The attitude error is a sine of rate x late, of which the slow filter takes little away again.
    assert metrics.peak(errors[20]) / metrics.peak(errors[5]) == pytest.approx(4.0, rel=0.1)


def test_receiver_is_the_monopulse_pattern():
    width = math.radians(1.0)
    v = np.linspace(-0.7, 0.7, 29)
    errors = np.array([receiver_reading(x * width, Receiver(1.0, width, 0.4)) for x in v])
    S = np.array([monopulse.sum_pattern(x) for x in v])
    expected = np.array([monopulse.difference_pattern(x, 1.0) for x in v]) / S
    np.testing.assert_allclose(errors[S * S >= 0.4], np.clip(expected, -0.7, 0.7)[S * S >= 0.4] * width, atol=1e-15)
    assert np.all(np.isnan(errors[S * S < 0.4])) and np.sum(S * S < 0.4) > 2
    assert receiver_reading(0.3, Receiver(1.5, 0.0, 0.5)) == pytest.approx(0.45)


@pytest.mark.parametrize('smoothing', ['S0', 'S1', 'S2'])
def test_paper_loop_against_its_equations_written_out(smoothing):
    """Eq. (1), (3), (4) sample by sample on plain lists, with a list of all beams as the delay."""
    loop = dataclasses.replace(PaperLoop(alpha=0.2, period=5, delay=13, slope=1.3), smoothing=smoothing)
    rng = np.random.default_rng(3)
    target, noise = np.cumsum(1e-4 * rng.standard_normal(600)), 1e-4 * rng.standard_normal(600)
    beams, errors, x, R, v = [0.0] * 14, [], 0.0, 0.0, 0.0
    in_force = []
    for i in range(600):
        in_force.append(beams[-14])
        errors.append(1.3 * (target[i] - in_force[-1]) + noise[i])
        x = (SMOOTHING_SAMPLES - 1) / SMOOTHING_SAMPLES * x + errors[-1] / SMOOTHING_SAMPLES
        if i % 5 == 0:
            e = {'S0': errors[-1], 'S1': x, 'S2': np.mean(errors[-SMOOTHING_SAMPLES:])}[smoothing]
            predicted = R + v * 0.005
            nu = R + e - predicted
            R, v = predicted + 0.2 * nu, v + 0.04 / 1.8 / 0.005 * nu
        beams.append(R)
    np.testing.assert_allclose(loop.run(target, noise=noise)[0], in_force, atol=1e-13)


@pytest.mark.thorough
def test_a_steeper_slope_divides_the_lag(values):
    """Without smoothing the true lag is that of slope 1 over the slope, and the reading stays v T."""
    for case in ('ramp/30deg_s/T=10ms', 'sine'):
        steep = values[f'{case}/slope=2/S0', 'true_lag_deg']
        assert values[f'{case}/S0', 'true_lag_deg'] / steep == pytest.approx(2.0, rel=2e-3)
        assert values[f'{case}/slope=2', 'lag_deg'] == pytest.approx(values[case, 'lag_deg'], rel=2e-3)
    assert (values['delay-limit/alpha=0.1/T=10ms/S1/slope=2', 'delay_ms']
            < values['delay-limit/alpha=0.1/T=10ms/S1', 'delay_ms'])


@pytest.mark.thorough
def test_a_larger_gain_is_faster_and_noisier(values):
    alphas = [f'alpha={alpha:g}' for alpha in phased_array.ALPHA_GAINS]
    rise = [values[f'step/{alpha}/T=10ms/S1', 'rise_90percent_s'] for alpha in alphas]
    jitter = [values[f'noise/{alpha}', 'jitter_rms_deg'] for alpha in alphas]
    assert rise == sorted(rise, reverse=True) and jitter == sorted(jitter) and rise[0] > 4.0 * rise[-1]


@pytest.mark.thorough
def test_a_delay_hardly_changes_the_rise_and_adds_overshoot(values):
    step, delayed = 'step/alpha=0.1/T=10ms/S0', 'step/alpha=0.1/T=10ms/S0/delay=20ms'
    assert values[delayed, 'rise_90percent_s'] == pytest.approx(values[step, 'rise_90percent_s'], abs=0.01)
    assert 1.2 < values[delayed, 'overshoot_percent'] / values[step, 'overshoot_percent'] < 1.5
