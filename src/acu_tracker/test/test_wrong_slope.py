"""Which of several directions moves smoothly: loops of a beam on a target, closed the right and the wrong way."""
import math

import numpy as np
import pytest
from scipy.signal import lfilter

from acu_tracker import signals
from acu_tracker.estimation import monitors
from acu_tracker.geometry.vector import Vector, turn
from pedestal_common.compiled import compiled
from pedestal_common.geometry.line_of_sight import ASHORE_ATTITUDE as BOW_NORTH

T, SIGMA, GAP = 0.005, 5e-4, 0.1
ASHORE = turn(*BOW_NORTH)


@pytest.fixture
def state():
    record = monitors.WrongSlope.zeros()[0]
    monitors.restart_slope(record)
    return record


@compiled
def alarms(state, beam, errors):
    """True if the slope counts as wrong at one of the errors (n, 2) [rad] of a beam (n, 2) [rad] near the horizon."""
    found = False
    for k in range(len(beam)):
        found |= monitors.take_slope(state, T * k, monitors.slope_beam(ASHORE, beam[k, 0], beam[k, 1]),
                                     (errors[k, 0], errors[k, 1]), SIGMA**2, GAP, math.inf)
    return found


def first(state, angles, errors, t=None, sigma=SIGMA, leaving=math.inf):
    """Index of the first error at which the slope counts as reversed, None: it never does. angles (n, 2): azimuth and
    elevation of the beam [rad]; errors (n, 2) [rad]."""
    t = T * np.arange(len(errors)) if t is None else t
    return next((k for k, (at, e) in enumerate(zip(angles, errors)) if monitors.take_slope(
        state, t[k], monitors.slope_beam(ASHORE, *at), tuple(e), sigma**2, GAP, leaving)), None)


FIRST_VERDICT = monitors.MIN_BLOCK_COUNT * monitors.BLOCK_ERROR_COUNT
TURNED = 2 * FIRST_VERDICT
"""Error from which on a slope is reversed."""


def loop(target, slope, noise, bandwidth=12.0):
    """(angles, errors) of a beam in elevation, driven as a type II loop on a target (n,) [rad] until it is half a
    radian off; slope: that from TURNED on."""
    beam, rate, angles, errors = target[0], 0.0, [], []
    for k, (r, n) in enumerate(zip(target, noise)):
        e = (slope if k >= TURNED else 1.0) * (r - beam) + n
        angles.append((0.3, 0.5 + beam))
        errors.append((0.0, e))
        rate += T * bandwidth**2 * e
        beam += T * (rate + 1.4 * bandwidth * e)
        if abs(beam - r) > 0.5:
            break
    return np.array(angles), np.array(errors)


def reversals(seconds=20.0, rate=0.06, acceleration=0.19):
    """A target (n,) [rad] to and fro at 3.5 deg/s, turned at 11 deg/s2."""
    t, x, v, goal = np.arange(0.0, seconds, T), 0.0, rate, rate
    way = []
    for k in range(len(t)):
        if k % 500 == 499:
            goal = -goal
        v += min(max(goal - v, -acceleration * T), acceleration * T)
        x += v * T
        way.append(x)
    return np.array(way)


@pytest.mark.parametrize('sigma', [1e-5, SIGMA, 5e-3])
@pytest.mark.parametrize('seed', range(5))
def test_a_target_that_reverses_is_no_reversed_slope(state, sigma, seed):
    target = reversals()
    noise = np.random.default_rng(seed).normal(0.0, sigma, len(target))
    assert first(state, *loop(target, 1.0, noise), sigma=sigma) is None


@pytest.mark.parametrize('seed', range(5))
def test_a_reversed_slope_is_seen_while_the_beam_is_less_than_20_sigma_off(state, seed):
    target = 0.01 * T * np.arange(2000)
    angles, errors = loop(target, -1.0, np.random.default_rng(seed).normal(0.0, SIGMA, 2000))
    off = np.abs(angles[:, 1] - 0.5 - target[:len(angles)])
    k = first(state, angles, errors)
    assert k > TURNED and off[k] < 20.0 * SIGMA


@pytest.mark.parametrize('seed', range(5))
def test_small_errors_with_the_wrong_sign_are_seen_while_the_beam_is_less_than_40_sigma_off(state, seed):
    """They move the beam away slowly; the hypotheses of errors of the right size are silent."""
    target = 0.01 * T * np.arange(4000)
    angles, errors = loop(target, -0.3, np.random.default_rng(seed).normal(0.0, SIGMA, 4000))
    off = np.abs(angles[:, 1] - 0.5 - target[:len(angles)])
    k = first(state, angles, errors, leaving=10.0 * SIGMA)
    assert k > TURNED and off[k] < 40.0 * SIGMA
    assert monitors.score(state, 3, False) > 1.0 > max(monitors.score(state, h, False) for h in range(3))


@pytest.mark.parametrize('seed', range(4))
@pytest.mark.parametrize('cn0_dbhz', [26.0, 30.0])
def test_the_lag_of_a_target_that_turns_in_a_fade_is_no_small_error(Rig, seed, cn0_dbhz):
    """With the noise of the fade the filter is slow, and follows a target of 0.2 rad/s2 a tenth of the beamwidth
    late. The receiver reports errors at each C/N0."""
    def target(t):
        return 0.5 + 0.1 * max(t - 4.0, 0.0)**2 / math.cos(0.6), 0.6
    rig = Rig(target, at=(0.5, 0.6), initial_mode='program', sigma=SIGMA)
    rig.rng = np.random.default_rng(seed)
    rig.program(target=target)
    rig.run(4.0, cn0_dbhz=46.0)
    rig.sigma = SIGMA * 10.0**(0.05 * (46.0 - cn0_dbhz))
    rig.run(3.0, cn0_dbhz=cn0_dbhz)
    assert 'diverged' not in rig.reason


def test_of_the_first_errors_nothing_is_said_and_of_those_off_the_straight_part_of_their_curve_or_none_at_all(state):
    """Errors that lead away from the first on: what they are is seen, and said from FIRST_VERDICT on."""
    way = 0.01 * np.exp(0.05 * np.arange(200))
    angles, errors = np.column_stack((np.zeros(200), 0.5 - way)), np.column_stack((np.zeros(200), -way))
    assert first(state, angles, errors) == FIRST_VERDICT - 1
    u = signals.Inputs.zeros()[0]
    for x, near in ((0.0, True), (0.4, True), (-0.6, False), (math.nan, False)):
        u['cross_elevation'] = 0.02 * x
        assert monitors.shows_slope(u, 0.02) == near


def test_the_other_axis_says_nothing_of_it(state):
    """The cross-elevation of a beam at rest is measured the right way round, the elevation runs away."""
    rng = np.random.default_rng(1)
    angles, errors = loop(np.zeros(2000), -1.0, rng.normal(0.0, SIGMA, 2000))
    errors[:, 0] = rng.normal(0.0, SIGMA, len(errors))
    k = first(state, angles, errors)
    assert k is not None
    right, wrong = monitors.roughnesses(state, 0)
    assert right == pytest.approx(wrong, rel=1e-3)


def test_outliers_noise_and_a_beam_that_is_pushed(state):
    rng = np.random.default_rng(3)
    noise = rng.normal(0.0, SIGMA, 4000)
    noise[1000:1040] += 0.01
    noise[2000:2500] *= 30.0
    angles, errors = loop(np.zeros(4000), 1.0, noise)
    push = np.where(np.arange(4000) > 3000, 0.003 * np.sin(2.0 * math.pi * T * np.arange(4000)), 0.0)
    assert first(state, angles + np.column_stack((0.0 * push, push)),
                 errors - np.column_stack((0.0 * push, push))) is None


def innovations(y):
    """Innovations (n, ...) of the means y (n, ...) of blocks. The parabola through all blocks before predicts each;
    the first three are 0."""
    k = np.arange(len(y))
    return np.array([y[i] - sum(c * i**p for p, c in enumerate(np.polynomial.polynomial.polyfit(k[:i], y[:i], 2)))
                     if i > 2 else np.zeros(y.shape[1]) for i in k])


def means(x):
    """Means (n, ...) of blocks of errors."""
    return x.reshape(-1, monitors.BLOCK_ERROR_COUNT, *x.shape[1:]).mean(axis=1)


def test_the_turn_with_the_smoothest_direction_is_found_as_by_a_search(state):
    """A beam at rest in azimuth 0 and elevation 0 has fixed axes; the search tries 90 to 270 deg in steps of 0.01."""
    rng, n = np.random.default_rng(5), 40 * monitors.BLOCK_ERROR_COUNT
    assert n <= monitors.CURVE_BLOCK_COUNT * monitors.BLOCK_ERROR_COUNT
    beam = np.cumsum(rng.normal(0.0, 0.04 * SIGMA, (n, 2)), axis=0) @ (1.0, 1.0j)
    for beta in np.radians([20.0, 100.0, 180.0, -130.0]):
        monitors.restart_slope(state)
        error = -np.exp(1j * beta) * beam + rng.normal(0.0, 0.02 * SIGMA, (n, 2)) @ (1.0, 1.0j)
        pairs = [np.column_stack((x.real, x.imag)) for x in (beam, error)]
        alarms(state, *pairs)
        a, b = (innovations(means(x)) @ (1.0, 1.0j) / SIGMA * monitors.BLOCK_ERROR_COUNT**0.5 for x in pairs)
        share = 1.0 / monitors.SLOPE_BLOCK_COUNT
        weights = share * (1.0 - share)**np.arange(len(a))[::-1]
        turns = np.exp(1j * np.radians(np.arange(90.0, 270.0, 0.01)))
        for hypothesis, size in ((2, 1.0), (3, monitors.SMALL_SLOPE)):
            searched = min((weights * np.abs(size * turn * a + b)**2).sum() for turn in turns)
            right, wrong = monitors.roughnesses(state, hypothesis)
            assert right == pytest.approx((weights * np.abs(a + b)**2).sum(), rel=1e-4)
            assert wrong == pytest.approx(searched, rel=1e-3)
        for axis, (x, y) in enumerate(((a.real, b.real), (a.imag, b.imag))):
            assert monitors.roughnesses(state, axis) == pytest.approx(
                [(weights * (x + sign * y)**2).sum() for sign in (1.0, -1.0)], rel=1e-4)


def test_what_a_parabola_does_is_none_of_it(state):
    """One that all lie on leaves no innovation, whatever its rate and acceleration."""
    k = np.arange(80 * monitors.BLOCK_ERROR_COUNT)
    first(state, np.zeros((len(k), 2)), np.column_stack((1e-5 * k, 1e-7 * k**2)))
    assert max(monitors.roughnesses(state, 2)) < 1e-12


@pytest.mark.parametrize('jitter', [0.0, 0.3, 3.0])
def test_noise_and_a_beam_that_shakes_are_no_wrong_slope_in_an_hour(state, jitter):
    """Errors with the right slope of a target at rest. The rms of the beam is in units of the noise."""
    rng = np.random.default_rng(6)
    for _ in range(12):
        beam = lfilter([0.1], [1.0, -0.9], rng.normal(0.0, 1.0, (60000, 2)), axis=0) / 0.23 * jitter * SIGMA
        assert not alarms(state, beam, rng.normal(0.0, SIGMA, beam.shape) - beam)


def test_it_begins_anew_after_a_gap_and_leaves_old_errors_alone(state):
    beam = monitors.Beam(Vector(1.0, 0.0, 0.0), Vector(0.0, 1.0, 0.0), Vector(0.0, 0.0, 1.0))
    for k in range(50):
        monitors.take_slope(state, T * k, beam, (1e-3 * (-1)**(k // 4), 0.0), SIGMA**2, GAP, math.inf)
    before = state.copy()
    monitors.take_slope(state, T * 49, beam, (1.0, 1.0), SIGMA**2, GAP, math.inf)
    assert state == before and monitors.roughnesses(state, 0)[0] > 0.1
    monitors.take_slope(state, T * 49 + 1.01 * GAP, beam, (1.0, 1.0), SIGMA**2, GAP, math.inf)
    assert (state['n'], state['count']) == (0, 1) and monitors.roughnesses(state, 2) == (0.0, 0.0)
