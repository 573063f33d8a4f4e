import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from acu_tracker.estimation import receiver_error
from acu_tracker.estimation import target as estimate
from acu_tracker.estimation.filters import axis_filter, target_filter
from acu_tracker.estimation.filters.kinds import FILTER_KINDS
from acu_tracker.estimation.filters.measurement import (
    AxisMeasurement,
    Measurement,
    attitude_variances,
    error_variance,
    nis,
)
from acu_tracker.estimation.params import FilterParameters, ReceiverModelParameters, TrackerParameters
from acu_tracker.geometry import frames
from acu_tracker.geometry.vector import ZERO_VECTOR, Vector
from pedestal_common.geometry import line_of_sight
from pedestal_common.parameters import build, record

DEG = math.pi / 180
T = 0.01
SIGMA = 0.03 * DEG
RATE_SIGMA = 0.1 * DEG
NONE = math.nan


class Target:
    """A filter of both axes with the same filter; errors of variance SIGMA^2."""

    def __init__(self, tracker_params=None, **filter_params):
        self.params = TrackerParameters(**(tracker_params or {}))
        self.p, self.state = record(self.params)[0], estimate.Target.zeros()
        self.put(**filter_params)

    def put(self, **filter_params):
        params = build(FilterParameters, {'kind': 'current_statistical', **filter_params})
        self.c = estimate.constants(self.params, (params, params))[0]
        state = self.state[0]
        target_filter.transfer(state['filter'], self.c['filter'], state['running'])

    def observe(self, stamp, azimuth, elevation=0.0, azimuth_rate=NONE, elevation_rate=NONE, sigma=SIGMA):
        """(outcome, AxisInnovation of the azimuth)."""
        axis = (AxisMeasurement(azimuth, sigma**2, azimuth_rate, RATE_SIGMA**2),
                AxisMeasurement(elevation, sigma**2, elevation_rate, RATE_SIGMA**2))
        outcome, innovation = receiver_error.gate(self.state[0], self.p, self.c, Measurement(stamp, axis, NONE, NONE),
                                              self.p['restart_gap'])
        return outcome, innovation.axis[0]

    def outlook(self, stamp):
        return np.ravel(estimate.outlook(self.state[0], self.c, stamp))

    def variances(self, T=0.0):
        """(p11, p12, p22) of the azimuth T after the last measurement."""
        f = self.state[0]['filter']
        target_filter.predict(f, self.c['filter'], T)
        return target_filter.read(f).variances[0]

    def locked(self, since_accepted=0.0):
        return bool(estimate.locked(self.state[0], self.p, since_accepted))


def test_azimuth_is_unwrapped_against_the_estimate():
    target = Target()
    t = np.arange(0.0, 20.0, T)
    angle = 3.0 + 0.05 * t
    outcomes = [target.observe(stamp, (y + math.pi) % (2 * math.pi) - math.pi)[0] for stamp, y in zip(t, angle)]
    assert outcomes == [receiver_error.OUTCOME_STARTED] + [receiver_error.OUTCOME_ACCEPTED] * (len(t) - 1)
    assert target.outlook(t[-1])[0] == pytest.approx(angle[-1], abs=1e-6)


def test_stale_gated_counted_and_restarted_measurements():
    target = Target()
    for k in range(300):
        target.observe(k * T, 0.1)
    before = target.state.copy()
    assert target.observe(299 * T, 0.1)[0] == receiver_error.OUTCOME_STALE
    assert target.observe(1.0, 0.1)[0] == receiver_error.OUTCOME_STALE
    assert target.state.tobytes() == before.tobytes()

    outcome, azimuth = target.observe(300 * T, 0.2)
    assert outcome == receiver_error.OUTCOME_GATED and azimuth.nu == pytest.approx(0.1,
                                                                            abs=1e-9) and azimuth.chi_square > 25.0
    for name in ('x', 'p', 'mu'):
        np.testing.assert_array_equal(target.state['filter']['axis'][name], before['filter']['axis'][name])
    assert target.state['accepted_in_a_row'] == 0 and target.state['gated'] == 1

    for k in range(301, 301 + 18):
        assert target.observe(k * T, 0.2)[0] == receiver_error.OUTCOME_GATED
    assert target.observe(320 * T, 0.2)[0] == receiver_error.OUTCOME_STARTED
    assert target.outlook(320 * T)[0] == 0.2 and target.state['gated'] == 20

    assert target.observe(320 * T + 0.9, 0.2)[0] == receiver_error.OUTCOME_ACCEPTED
    assert target.observe(320 * T + 2.0, 0.7)[0] == receiver_error.OUTCOME_STARTED
    assert target.outlook(320 * T + 2.0)[0] == pytest.approx(0.7)
    assert target.state['gated'] == 20


@pytest.mark.parametrize('kind', ['imm', 'ca'])
def test_a_strong_signal_does_not_gate_a_target_that_begins_to_turn(kind):
    """Noise of 0.2 mdeg; after 3 s the target accelerates by 10 deg/s2. An outlier of 0.06 beamwidths is gated."""
    target, sigma = Target(kind=kind), math.radians(2e-4)
    t, rng = np.arange(0.0, 4.0, T), np.random.default_rng(1)
    angle = 0.5 * math.radians(10.0) * np.maximum(t - 3.0, 0.0)**2 + rng.normal(0.0, sigma, len(t))
    outcomes = [target.observe(stamp, y, sigma=sigma)[0] for stamp, y in zip(t, angle)]
    assert outcomes[1:] == [receiver_error.OUTCOME_ACCEPTED] * (len(t) - 1)
    outlier = target.outlook(t[-1] + T)[0] + 0.06 * target.params.receiver.beamwidth
    assert target.observe(t[-1] + T, outlier, sigma=sigma)[0] == receiver_error.OUTCOME_GATED


def test_only_refusals_in_a_row_restart():
    target = Target()
    outcomes = [target.observe(k * T, 0.1 if k < 300 or k % 15 == 0 else 0.2)[0] for k in range(400)]
    assert outcomes[0] == receiver_error.OUTCOME_STARTED and receiver_error.OUTCOME_STARTED not in outcomes[1:]
    assert outcomes[301:315] == [receiver_error.OUTCOME_GATED] * 14
    assert outcomes[315] == receiver_error.OUTCOME_ACCEPTED


@pytest.mark.parametrize('gate', [1.0, 9.0, 25.0, 600.0, 1e6])
def test_gate_of_a_rate_is_as_rarely_exceeded(gate):
    limit = estimate.constants(TrackerParameters(gate=gate), 2 * (FilterParameters(),))['gates'][0, 1]
    assert 0.0 < limit < gate
    if gate <= 600.0:
        assert chi2.logsf(limit, 1) == pytest.approx(-gate / 2, rel=1e-9)


def test_a_rate_is_believed_by_itself():
    target, alone = (Target({'lock_count': 50}, rate_measurement=used) for used in (True, False))
    for k in range(300):
        for one in (target, alone):
            assert one.observe(k * T, 0.1 + 0.01 * k * T, 0.0, 0.01, 0.0)[0] != receiver_error.OUTCOME_GATED
        # Fifty of them have to agree with the angles first.
        assert (target.variances() == alone.variances()) == (k <= 50)
    assert target.variances()[2] < 0.7 * alone.variances()[2] and target.state['rates_gated'] == 0
    # Without a rate (the sensor is late) the angles alone are believed, and with one that is off.
    assert target.observe(3.0, 0.13, 0.0)[0] == receiver_error.OUTCOME_ACCEPTED
    rate = target.outlook(3.0)[1]
    outcome, azimuth = target.observe(3.01, 0.1301, 0.0, 0.01 + 8 * RATE_SIGMA, 0.0)
    assert outcome == receiver_error.OUTCOME_ACCEPTED and azimuth.rate == pytest.approx(8 * RATE_SIGMA, rel=1e-2)
    assert nis(azimuth) > 50.0
    assert target.outlook(3.01)[1] == pytest.approx(rate, abs=1e-6)
    assert target.state['rates_gated'] == 1 and target.state['gated'] == 0
    # The other axis goes on with its own.
    assert target.state['rates_in_a_row'].tolist() == [[0, 300]]
    # A filter that is not to use the rate does not look at it.
    target.put(rate_measurement=False)
    assert target.observe(3.02, 0.1302, 0.0, 1.0, 0.0)[0] == receiver_error.OUTCOME_ACCEPTED
    assert target.state['rates_gated'] == 1


@pytest.mark.parametrize('share, bias', [(1.0, 6.0 * RATE_SIGMA), (0.0, 0.0), (1.0, 3.0 * RATE_SIGMA)])
@pytest.mark.parametrize('kind', ['alpha_beta', 'cv', 'current_statistical', 'imm'])
def test_a_rate_sensor_that_is_off_or_stuck_does_not_cost_the_lock(kind, share, bias):
    """A target of 2.9 deg/s with good angles: locked nearly always, on the target, without a restart; a bias that is
    small enough to be believed at times is noticed when the angles do not fit any more."""
    rng, target, speed = np.random.default_rng(3), Target(kind=kind, rate_measurement=True), 2.9 * DEG
    outcomes, locks, errors = [], 0, []
    for k in range(2000):
        nu = rng.standard_normal(4)
        t = k * T
        outcomes.append(target.observe(t, 0.1 + speed * t + SIGMA * nu[0], SIGMA * nu[1],
                                       share * (speed + RATE_SIGMA * nu[2]) + bias, RATE_SIGMA * nu[3])[0])
        locks += target.locked()
        errors.append(target.outlook(t)[0] - 0.1 - speed * t)
    assert outcomes.count(receiver_error.OUTCOME_STARTED) == 1 and np.abs(errors).max() < 5.0 * SIGMA
    assert locks > (1000 if bias == 3.0 * RATE_SIGMA else 1800)
    assert target.state['rates_gated'] > 0


@pytest.mark.parametrize('kind', FILTER_KINDS)
def test_lock_needs_a_row_of_fresh_errors_and_convergence(kind):
    target = Target({'lock_count': 50}, kind=kind)
    locks = []
    for k in range(300):
        target.observe(k * T, 0.1)
        locks.append(target.locked())
    assert not any(locks[:49]) and all(locks[60:])
    assert not target.locked(since_accepted=0.11)
    target.observe(299 * T + 0.5, 0.1)
    assert not target.locked()


@pytest.mark.parametrize('lively', [{'kind': 'alpha_beta', 'alpha_beta.alpha': 0.4}, {'kind': 'cv', 'cv.noise': 0.07}])
def test_a_filter_no_better_than_its_measurements_locks_too(lively):
    target = Target({'lock_count': 50}, **lively)
    for k in range(120):
        target.observe(k * T, 0.1)
    assert target.variances()[0] > 0.25 * SIGMA**2
    assert target.locked()


@pytest.mark.parametrize('before', FILTER_KINDS)
def test_filter_changes_without_a_bump(before):
    """Into every other kind and back, on a target that accelerates by as much as a constant rate still stands: angle,
    rate and their covariance go on as they were, no error is gated, and angle and rate stay within six of the
    standard deviations the filter claims."""
    rng, acceleration = np.random.default_rng(4), 0.5 * DEG
    target, worst = Target(kind=before), np.zeros(2)
    others = [kind for after in FILTER_KINDS for kind in (after, before)]
    for k in range(1, 200 * len(others)):
        t = k * T
        truth = 0.3 + 0.5 * acceleration * t * t, acceleration * t
        target.observe(t, truth[0] + SIGMA * rng.standard_normal())
        if k > 200:
            sigma = np.sqrt(target.variances())[[0, 2]]
            worst = np.maximum(worst, np.abs(target.outlook(t)[:2] - truth) / sigma)
        if k % 200 == 0:
            was, known = target.outlook(t), target.variances()
            target.put(kind=others[k // 200 - 1])
            np.testing.assert_allclose(target.outlook(t)[:2], was[:2], rtol=1e-14)
            np.testing.assert_allclose(target.variances(), known, rtol=1e-9)
    assert (worst < 6.0).all()
    assert target.state['gated'] == 0


@pytest.mark.parametrize('kind', FILTER_KINDS)
def test_covariance_grows_in_a_coast(kind):
    target = Target(kind=kind)
    for k in range(500):
        target.observe(k * T, 0.1)
    grown = np.array([target.variances(T) for T in (0.0, 0.1, 0.5, 1.0, 3.0)])
    assert (np.diff(grown[:, 0]) > 0).all()
    assert (np.diff(grown[:, 2]) >= (0 if kind == 'alpha_beta' else 1e-30)).all()


@pytest.mark.parametrize('gap', [0.1, 0.5, 0.9])
@pytest.mark.parametrize('kind', FILTER_KINDS)
def test_an_error_is_compared_with_what_was_told_in_the_coast(kind, gap):
    """Out of a turn, the innovation after a gap is measured from the estimate of that time, in sigmas of its
    covariance: the antenna points where the gate is."""
    target = Target({'gate': 1e6}, kind=kind)
    for k in range(300):
        target.observe(k * T, 0.1 + 0.02 * k * T + 0.5 * 0.02 * max(k * T - 2.0, 0.0)**2)
    stamp = 299 * T + gap
    angle, stated = target.outlook(stamp)[0], target.variances(gap)[0]
    variance = axis_filter.expected(target.state[0]['filter']['axis'][0]).P.p11
    assert stated >= axis_filter.MIN_CALM * variance
    outcome, azimuth = target.observe(stamp, 0.3)
    assert outcome == receiver_error.OUTCOME_ACCEPTED and azimuth.nu == pytest.approx(0.3 - angle, abs=1e-12)
    assert azimuth.S == pytest.approx(variance + SIGMA**2, rel=1e-12)
    assert nis(azimuth) == pytest.approx(azimuth.nu**2 / (variance + SIGMA**2), rel=1e-12)


def test_receiver_law():
    # theta3 / (k_m sqrt(2 C/N0 tau)): 1 deg, 1.6, 40 dB-Hz, 10 ms -> 1 / (1.6 sqrt(200)) deg
    receiver = record(ReceiverModelParameters(beamwidth=DEG, slope=1.6, integration=0.01))[0]
    receiver['sigma_floor'] = 0.0
    R = error_variance(0.0, 0.0, 40.0, receiver)
    assert math.sqrt(R) == pytest.approx(DEG / (1.6 * math.sqrt(200.0)))
    assert error_variance(0.3 * DEG, 0.4 * DEG, 40.0, receiver) == pytest.approx(1.64 * R)
    receiver['sigma_floor'] = 1e-3
    assert error_variance(0.0, 0.0, 300.0, receiver) == pytest.approx(1e-6)


@pytest.mark.parametrize('elevation', [0.1, 0.7, 1.3])
@pytest.mark.parametrize('along', [None, (1.0, -1.0, 0.2)])
def test_noise_of_the_attitude_moves_a_direction_as_rotations_do(elevation, along):
    """Oracle: scipy turns the direction by 20,000 small rotations about deck axes and the vertical; in the frame it
    moves along the axes of that. The frame is laid horizontally, or along a climb to the north-east."""
    f = frames.Frame.zeros()[0]
    u = Vector(*line_of_sight.earth_direction(0.3, elevation))
    frames.lay(f, u, ZERO_VECTOR if along is None else Vector(*np.cross(u, along)))
    generator = np.random.default_rng(1)
    tilt, heading = 2e-4 * generator.standard_normal((2, 20_000)), 5e-4 * generator.standard_normal(20_000)
    turned = Rotation.from_rotvec(np.column_stack((*tilt, heading))).apply(u) @ f['mat']
    measured = np.arctan2(turned[:, 0], turned[:, 1]).var(), np.arcsin(turned[:, 2]).var()
    assert attitude_variances(frames.verticals(f, 0.0, 0.0), 2e-4**2, 5e-4**2) == pytest.approx(measured,
                                                                                                rel=0.03)
