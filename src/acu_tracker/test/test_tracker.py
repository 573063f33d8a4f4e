import math

import numpy as np
import pytest
from scipy.stats import chi2

from acu_tracker import axis_filter, tracker
from acu_tracker.axis_filter import KINDS
from acu_tracker.filter_params import Filter
from acu_tracker.params import TrackerParameters
from pedestal_common.parameters import build, record

DEG = math.pi / 180
T = 0.01
SIGMA = 0.03 * DEG
RATE_SIGMA = 0.1 * DEG
NONE = math.nan


class Target:
    """A tracker of both axes with the same filter; errors of variance SIGMA^2."""

    def __init__(self, tracker_params=None, **filter_params):
        self.params = TrackerParameters(**(tracker_params or {}))
        self.p, self.state = record(self.params)[0], np.zeros(1, tracker.TRACKER)
        self.put(**filter_params)

    def put(self, **filter_params):
        params = build(Filter, {'current_statistical.a_max': 0.02, **filter_params})
        self.c = tracker.constants(self.params, params, params)[0]
        tracker.adopt(self.state[0], self.c)

    def observe(self, stamp, azimuth, elevation=0.0, azimuth_rate=NONE, elevation_rate=NONE):
        """(outcome, nu azimuth, elevation, of their rates, nu' S^-1 nu of azimuth, elevation)."""
        return tracker.observe(self.state[0], self.p, self.c, stamp, azimuth, elevation, SIGMA**2, SIGMA**2,
                               azimuth_rate, elevation_rate, RATE_SIGMA**2, RATE_SIGMA**2, NONE, NONE,
                               self.p['restart_gap'])

    def outlook(self, stamp):
        return np.array(tracker.outlook(self.state[0], self.c, stamp))

    def variances(self, T=0.0):
        return axis_filter.variances(self.state[0]['azimuth'], self.c['azimuth'], T)

    def locked(self, overdue=0.0):
        return bool(tracker.locked(self.state[0], self.p, overdue))


def test_azimuth_is_unwrapped_against_the_estimate():
    target = Target()
    t = np.arange(0.0, 20.0, T)
    angle = 3.0 + 0.05 * t
    outcomes = [target.observe(stamp, (y + math.pi) % (2 * math.pi) - math.pi)[0] for stamp, y in zip(t, angle)]
    assert outcomes == [tracker.STARTED] + [tracker.BELIEVED] * (len(t) - 1)
    assert target.outlook(t[-1])[0] == pytest.approx(angle[-1], abs=1e-6)


def test_stale_gated_counted_and_restarted_measurements():
    target = Target()
    for k in range(300):
        target.observe(k * T, 0.1)
    before = target.state.copy()
    assert target.observe(299 * T, 0.1)[0] == tracker.STALE
    assert target.observe(1.0, 0.1)[0] == tracker.STALE
    np.testing.assert_array_equal(target.state, before)

    outcome, nu, _, _, _, nis, _ = target.observe(300 * T, 0.2)
    assert outcome == tracker.GATED and nu == pytest.approx(0.1, abs=1e-9) and nis > 25.0
    for name in ('x', 'p', 'mu'):
        np.testing.assert_array_equal(target.state['azimuth'][name], before['azimuth'][name])
    assert target.state['in_a_row'] == 0 and target.state['gated'] == 1

    for k in range(301, 301 + 18):
        assert target.observe(k * T, 0.2)[0] == tracker.GATED
    assert target.observe(320 * T, 0.2)[0] == tracker.STARTED
    assert target.outlook(320 * T)[0] == 0.2 and target.state['gated'] == 20

    assert target.observe(320 * T + 0.9, 0.2)[0] == tracker.BELIEVED
    assert target.observe(320 * T + 2.0, 0.7)[0] == tracker.STARTED
    assert target.outlook(320 * T + 2.0)[0] == pytest.approx(0.7)
    assert target.state['gated'] == 20


def test_only_refusals_in_a_row_restart():
    target = Target()
    outcomes = [target.observe(k * T, 0.1 if k < 300 or k % 15 == 0 else 0.2)[0] for k in range(400)]
    assert outcomes[0] == tracker.STARTED and tracker.STARTED not in outcomes[1:]
    assert outcomes[301:315] == [tracker.GATED] * 14 and outcomes[315] == tracker.BELIEVED


@pytest.mark.parametrize('gate', [1.0, 9.0, 25.0, 600.0])
@pytest.mark.parametrize('freedom', [3, 4])
def test_gate_with_rates_is_as_rarely_exceeded(gate, freedom):
    limit = tracker.constants(TrackerParameters(gate=gate), Filter(), Filter())['gates'][0, freedom - 2]
    assert chi2.logsf(limit, freedom) == pytest.approx(-gate / 2, rel=1e-9)


def test_rates_are_gated_together_with_the_angles():
    target = Target(rate_measurement=True)
    for k in range(300):
        assert target.observe(k * T, 0.1 + 0.01 * k * T, 0.0, 0.01, 0.0)[0] != tracker.GATED
    # Without a rate (the sensor is late) the angles alone are believed.
    assert target.observe(3.0, 0.13, 0.0)[0] == tracker.BELIEVED
    outcome, _, _, nu_rate, _, _, _ = target.observe(3.01, 0.1301, 0.0, 0.01 + 8 * RATE_SIGMA, 0.0)
    assert outcome == tracker.GATED and nu_rate == pytest.approx(8 * RATE_SIGMA, rel=1e-2)
    # A filter that is not to use the rate does not look at it.
    target.put(rate_measurement=False)
    assert target.observe(3.02, 0.1302, 0.0, 1.0, 0.0)[0] == tracker.BELIEVED


@pytest.mark.parametrize('kind', KINDS)
def test_lock_needs_a_row_of_fresh_errors_and_convergence(kind):
    target = Target({'lock_count': 50}, kind=kind)
    locks = []
    for k in range(300):
        target.observe(k * T, 0.1)
        locks.append(target.locked())
    assert not any(locks[:49]) and all(locks[60:])
    assert not target.locked(overdue=0.11)
    target.observe(299 * T + 0.5, 0.1)
    assert not target.locked()


@pytest.mark.parametrize('lively', [{'kind': 'alpha_beta', 'alpha_beta.alpha': 0.4}, {'kind': 'cv', 'cv.noise': 0.07}])
def test_a_filter_no_better_than_its_measurements_locks_too(lively):
    target = Target({'lock_count': 50}, **lively)
    for k in range(120):
        target.observe(k * T, 0.1)
    assert target.variances()[0] > 0.25 * SIGMA**2
    assert target.locked()


def moving(t):
    return 0.3 + 0.02 * t + 0.001 * t * t, 0.02 + 0.002 * t


@pytest.mark.parametrize('before', KINDS)
def test_filter_changes_without_a_bump(before):
    """Into every other kind and back, in the middle of an accelerated track: angle, rate and covariance go on as they
    were, no error is gated, and the error stays within five of the standard deviations the filter claims."""
    rng = np.random.default_rng(4)
    target, worst = Target(kind=before), 0.0
    others = [kind for after in KINDS for kind in (after, before)]
    for k in range(1, 200 * len(others)):
        angle, rate = moving(k * T)
        target.observe(k * T, angle + SIGMA * rng.standard_normal())
        if k > 200:
            worst = max(worst, abs(target.outlook(k * T)[0] - angle))
        if k % 200 == 0:
            was, known = target.outlook(k * T), target.variances()
            target.put(kind=others[k // 200 - 1])
            np.testing.assert_allclose(target.outlook(k * T)[:2], was[:2], rtol=1e-14)
            np.testing.assert_allclose(target.variances(), known, rtol=1e-9)
    assert worst < 5.0
    assert target.state['gated'] == 0


@pytest.mark.parametrize('kind', KINDS)
def test_covariance_grows_in_a_coast(kind):
    target = Target(kind=kind)
    for k in range(500):
        target.observe(k * T, 0.1)
    grown = np.array([target.variances(T) for T in (0.0, 0.1, 0.5, 1.0, 3.0)])
    assert (np.diff(grown[:, 0]) > 0).all()
    assert (np.diff(grown[:, 2]) >= (0 if kind == 'alpha_beta' else 1e-30)).all()


def test_receiver_law():
    # theta3 / (k_m sqrt(2 C/N0 tau)): 1 deg, 1.6, 40 dB-Hz, 10 ms -> 1 / (1.6 sqrt(200)) deg
    R = tracker.error_variance(0.0, 0.0, 40.0, DEG, 1.6, 0.01, 0.0)
    assert math.sqrt(R) == pytest.approx(DEG / (1.6 * math.sqrt(200.0)))
    assert tracker.error_variance(0.3 * DEG, 0.4 * DEG, 40.0, DEG, 1.6, 0.01, 0.0) == pytest.approx(1.64 * R)
    assert tracker.error_variance(0.0, 0.0, 300.0, DEG, 1.6, 0.01, 1e-3) == pytest.approx(1e-6)
