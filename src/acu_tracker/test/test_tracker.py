import math

import numba
import numpy as np
import pytest

from acu_tracker import tracker
from acu_tracker.params import TrackerParameters
from pedestal_common.parameters import record

DEG = math.pi / 180
T = 0.01
SIGMA = 0.03 * DEG


@numba.njit(error_model='numpy')
def filtered(state, constants, a_max, stamps, measured, R, estimates, nis):
    for k in range(len(stamps)):
        t = state[0]
        _, _, _, nis[k], _ = tracker.observe(t, constants[0], a_max, a_max, stamps[k], measured[k], 0.0, R, R)
        estimates[k, 0], estimates[k, 1], estimates[k, 2] = t.azimuth.x1, t.azimuth.x2, t.azimuth.x3


def track(stamps, measured, a_max, sigma=SIGMA, **changes):
    constants = record(TrackerParameters(**{'gate': 1e6, **changes}))
    estimates, nis = np.empty((len(stamps), 3)), np.empty(len(stamps))
    state = np.zeros(1, tracker.TRACKER)
    filtered(state, constants, a_max, stamps, measured, sigma * sigma, estimates, nis)
    return estimates, nis, state[0]


def flyby(distance, speed=15.0, seconds=60.0):
    t = np.arange(0.0, seconds, T)
    x = speed * (t - seconds / 2) / distance
    peak = 0.375 * math.sqrt(3) * (speed / distance)**2
    return t, np.arctan(x), speed / distance / (1 + x * x), peak


def s_turns(rate=3.5 * DEG, reversal=1.0, uniform=10.0, seconds=60.0):
    """Constant rate up and down, half-cosine reversals: peak acceleration pi * rate / reversal."""
    t = np.arange(0.0, seconds, T)
    half = uniform + reversal
    phase, sign = t % half, 1 - 2 * (np.floor(t / half) % 2)
    turning = np.clip((phase - uniform) / reversal, 0, 1)
    rates = sign * rate * np.cos(np.pi * turning)
    return t, np.concatenate(([0.0], np.cumsum(0.5 * (rates[1:] + rates[:-1]) * T))), rates


def reductions(distance, runs=8):
    t, angle, rate, peak = flyby(distance)
    later = t > 3.0
    squares = []
    for seed in range(runs):
        noise = np.random.default_rng(seed).normal(0, SIGMA, len(t))
        estimates, _, _ = track(t, angle + noise, 1.2 * peak)
        squares.append(np.mean((estimates[later, 0] - angle[later])**2))
    return SIGMA / math.sqrt(np.mean(squares))


@pytest.mark.parametrize('distance, least', [(500.0, 6.5), (60.0, 2.8)])
def test_noise_reduction_on_the_flyby(distance, least):
    reduction = reductions(distance)
    print(f'flyby at {distance:g} m, 0.03 deg white at 100 Hz: noise reduced {reduction:.2f} times')
    assert reduction >= least


def test_target_beyond_a_max_locks_the_filter_and_the_floor_cures_it():
    t, angle, _ = s_turns()
    noisy = angle + np.random.default_rng(1).normal(0, SIGMA, len(t))
    locked, _, _ = track(t, noisy, 3.0 * DEG, alpha=0.5, sigma_a_floor=0.0)
    floored, _, _ = track(t, noisy, 3.0 * DEG, alpha=0.5)
    later = t > 3.0
    assert np.abs(locked[later, 0] - angle[later]).max() > 1.0 * DEG
    assert np.sqrt(np.mean((floored[later, 0] - angle[later])**2)) < 0.035 * DEG


def test_innovations_are_white_and_of_unit_variance_when_the_model_fits():
    rng = np.random.default_rng(5)
    t = np.arange(0.0, 400.0, T)
    a_max, alpha = 0.02, 0.5
    # A Singer process, its variance the least the filter assumes (sigma_a is 0.3 to 0.52 a_max).
    e = math.exp(-alpha * T)
    a = np.empty(len(t))
    a[0] = 0.0
    drive = 0.3 * a_max * math.sqrt(1 - e * e) * rng.standard_normal(len(t))
    for k in range(1, len(t)):
        a[k] = e * a[k - 1] + drive[k]
    angle = np.cumsum(np.cumsum(a) * T) * T
    _, nis, _ = track(t, angle + rng.normal(0, SIGMA, len(t)), a_max, alpha=alpha)
    assert np.mean(nis[500:]) == pytest.approx(1.0, abs=0.03)


def test_quadratic_motion_is_followed_without_bias():
    t = np.arange(0.0, 20.0, T)
    estimates, _, _ = track(t, 0.3 + 0.02 * t + 0.5 * 0.004 * t * t, 0.02)
    np.testing.assert_allclose(estimates[-1], [0.3 + 0.02 * t[-1] + 0.002 * t[-1]**2, 0.02 + 0.004 * t[-1], 0.004],
                               rtol=1e-6)


def test_azimuth_is_unwrapped_against_the_estimate():
    t = np.arange(0.0, 20.0, T)
    angle = 3.0 + 0.05 * t
    estimates, nis, _ = track(t, (angle + math.pi) % (2 * math.pi) - math.pi, 0.02, gate=25.0)
    assert estimates[-1, 0] == pytest.approx(angle[-1], abs=1e-6)
    assert nis.max() < 100.0


def observe(state, stamp, azimuth, R=SIGMA**2, **changes):
    constants = record(TrackerParameters(**changes))
    return tracker.observe(state[0], constants[0], 0.02, 0.02, stamp, azimuth, 0.0, R, R)


def test_stale_gated_and_restarted_measurements():
    state = np.zeros(1, tracker.TRACKER)
    for k in range(300):
        observe(state, k * T, 0.1)
    before = state.copy()
    assert observe(state, 299 * T, 0.1)[0] == tracker.STALE
    assert observe(state, 1.0, 0.1)[0] == tracker.STALE
    np.testing.assert_array_equal(state, before)

    outcome, nu, _, nis, _ = observe(state, 300 * T, 0.2)
    assert outcome == tracker.GATED and nu == pytest.approx(0.1, abs=1e-9) and nis > 25.0
    assert state['azimuth'] == before['azimuth'] and state['in_a_row'] == 0

    for k in range(301, 301 + 18):
        assert observe(state, k * T, 0.2)[0] == tracker.GATED
    assert observe(state, 320 * T, 0.2)[0] == tracker.STARTED
    assert state['azimuth']['x1'] == 0.2

    assert observe(state, 320 * T + 0.9, 0.2)[0] == tracker.BELIEVED
    assert observe(state, 320 * T + 2.0, 0.7)[0] == tracker.STARTED
    assert state['azimuth']['x1'] == pytest.approx(0.7)


def test_only_refusals_in_a_row_restart():
    state = np.zeros(1, tracker.TRACKER)
    outcomes = [observe(state, k * T, 0.1 if k < 300 or k % 15 == 0 else 0.2)[0] for k in range(400)]
    assert outcomes[0] == tracker.STARTED and tracker.STARTED not in outcomes[1:]
    assert outcomes[301:315] == [tracker.GATED] * 14 and outcomes[315] == tracker.BELIEVED


def test_lock_needs_a_row_of_fresh_errors_and_convergence():
    constants = record(TrackerParameters(lock_count=50))
    state = np.zeros(1, tracker.TRACKER)
    locks = []
    for k in range(200):
        observe(state, k * T, 0.1)
        locks.append(bool(tracker.locked(state[0], constants[0], 0.0)))
    assert not any(locks[:49]) and all(locks[60:])
    assert not tracker.locked(state[0], constants[0], 0.11)
    observe(state, 199 * T + 0.5, 0.1)
    assert not tracker.locked(state[0], constants[0], 0.0)


def test_outlook_coasts_with_fading_acceleration():
    axis = np.zeros(1, tracker.AXIS)
    axis['x1'], axis['x2'], axis['x3'] = 0.1, 0.2, 0.3
    alpha, t = 0.5, np.linspace(0, 3, 30001)
    a = 0.3 * np.exp(-alpha * t)
    v = 0.2 + np.concatenate(([0], np.cumsum(0.5 * (a[1:] + a[:-1]) * np.diff(t))))
    p = 0.1 + np.concatenate(([0], np.cumsum(0.5 * (v[1:] + v[:-1]) * np.diff(t))))
    np.testing.assert_allclose(tracker.outlook(axis[0], 3.0, alpha), (p[-1], v[-1], a[-1]), rtol=1e-8)


def test_receiver_law():
    # theta3 / (k_m sqrt(2 C/N0 tau)): 1 deg, 1.6, 40 dB-Hz, 10 ms -> 1 / (1.6 sqrt(200)) deg
    R = tracker.error_variance(0.0, 0.0, 40.0, DEG, 1.6, 0.01, 0.0)
    assert math.sqrt(R) == pytest.approx(DEG / (1.6 * math.sqrt(200.0)))
    assert tracker.error_variance(0.3 * DEG, 0.4 * DEG, 40.0, DEG, 1.6, 0.01, 0.0) == pytest.approx(1.64 * R)
    assert tracker.error_variance(0.0, 0.0, 300.0, DEG, 1.6, 0.01, 1e-3) == pytest.approx(1e-6)
