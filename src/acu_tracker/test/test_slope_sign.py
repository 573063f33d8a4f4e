"""Which of two directions moves smoothly: loops of a beam on a target, closed the right and the wrong way round."""
import math

import numpy as np
import pytest

from acu_tracker import signals
from acu_tracker.estimation import monitors
from acu_tracker.geometry.vector import Vector, turn
from pedestal_common.geometry.line_of_sight import ASHORE_ATTITUDE as BOW_NORTH

T, SIGMA, GAP = 0.005, 5e-4, 0.1
ASHORE = turn(*BOW_NORTH)


@pytest.fixture
def state():
    record = monitors.SlopeSign.zeros()[0]
    monitors.restart_slope(record)
    return record


def first(state, angles, errors, t=None, sigma=SIGMA):
    """Index of the first error at which the slope counts as reversed, None: it never does. angles (n, 2): azimuth and
    elevation of the beam [rad]; errors (n, 2) [rad]."""
    t = T * np.arange(len(errors)) if t is None else t
    return next((k for k, (at, e) in enumerate(zip(angles, errors)) if monitors.take_slope(
        state, t[k], monitors.slope_beam(ASHORE, *at), tuple(e), sigma**2, GAP)), None)


TURNED = 2 * monitors.MIN_ERROR_COUNT
"""Error from which on a slope is reversed."""


def loop(target, slope, noise, bandwidth=12.0):
    """(angles, errors) of a beam in elevation, driven as a type II loop on a target (n,) [rad] until it is half a
    radian off; slope: 1 or -1, from TURNED on."""
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


def test_of_the_first_errors_nothing_is_said_and_of_those_off_the_straight_part_of_their_curve_or_none_at_all(state):
    """Errors that lead away from the first on: what they are is seen, and said from FEWEST on."""
    way = 0.01 * np.exp(0.05 * np.arange(200))
    angles, errors = np.column_stack((np.zeros(200), 0.5 - way)), np.column_stack((np.zeros(200), -way))
    assert first(state, angles, errors) == monitors.MIN_ERROR_COUNT - 1
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
    assert k is not None and state['J'][0, 0] == pytest.approx(state['J'][0, 1], rel=1e-3)


def test_outliers_noise_and_a_beam_that_is_pushed(state):
    rng = np.random.default_rng(3)
    noise = rng.normal(0.0, SIGMA, 4000)
    noise[1000:1040] += 0.01
    noise[2000:2500] *= 30.0
    angles, errors = loop(np.zeros(4000), 1.0, noise)
    push = np.where(np.arange(4000) > 3000, 0.003 * np.sin(2.0 * math.pi * T * np.arange(4000)), 0.0)
    assert first(state, angles + np.column_stack((0.0 * push, push)),
                 errors - np.column_stack((0.0 * push, push))) is None


def test_lines_are_least_squares_and_what_a_straight_line_does_is_none_of_it(state):
    """The first errors alone make a line; one that all lie on leaves no innovation, whatever its rate."""
    k = np.arange(300)
    first(state, np.column_stack((np.zeros(300), np.full(300, 0.5))), np.column_stack((1e-5 * k, -2e-5 * k)))
    assert np.abs(state['J']).max() < 1e-12
    restarted = monitors.SlopeSign.zeros()[0]
    monitors.restart_slope(restarted)
    e = np.random.default_rng(1).normal(0.0, SIGMA, (100, 2))
    first(restarted, np.zeros((100, 2)), e)
    line = np.polyfit(T * np.arange(100), e[:, 1], 1)
    assert restarted['line'][4] == pytest.approx([np.polyval(line, T * 99), line[0]], rel=1e-9)


def test_it_begins_anew_after_a_gap_and_leaves_old_errors_alone(state):
    beam = monitors.Beam(Vector(1.0, 0.0, 0.0), Vector(0.0, 1.0, 0.0), Vector(0.0, 0.0, 1.0))
    for k in range(50):
        monitors.take_slope(state, T * k, beam, (1e-3 * (-1)**k, 0.0), SIGMA**2, GAP)
    J = state['J'].copy()
    monitors.take_slope(state, T * 49, beam, (1.0, 1.0), SIGMA**2, GAP)
    assert state['n'] == 50 and (state['J'] == J).all() and J[0, 0] > 0.1
    monitors.take_slope(state, T * 49 + 1.01 * GAP, beam, (1.0, 1.0), SIGMA**2, GAP)
    assert state['n'] == 1 and (state['J'] == 0.0).all()
