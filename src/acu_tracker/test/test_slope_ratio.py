"""The sum of likelihood ratios against the program: scipy's densities, loops of a beam, targets that leave it."""
import math

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.stats import multivariate_normal

from acu_tracker.estimation import slope_ratio
from acu_tracker.geometry.vector import Vector
from pedestal_common.compiled import compiled

T, SIGMA = 0.02, 2.5e-4     # of a block, and of the mean of its errors [rad]
EAST, NORTH = Vector(1.0, 0.0, 0.0), Vector(0.0, 1.0, 0.0)


@pytest.fixture
def state():
    record = slope_ratio.SlopeRatio.zeros()[0]
    slope_ratio.restart(record)
    return record


@compiled
def sums(state, beam, error):
    """The sums (n, hypotheses) after each block of beam less program and of errors (n, 2) [rad], and the alarms."""
    table, alarm = np.zeros((len(beam), slope_ratio.HYPOTHESIS_COUNT)), np.zeros(len(beam), np.bool_)
    for k in range(len(beam)):
        alarm[k] = slope_ratio.take(state, T * (k + 1), Vector(beam[k, 0], beam[k, 1], 0.0),
                                    Vector(error[k, 0], error[k, 1], 0.0), EAST, NORTH, SIGMA**2)
        table[k] = state.S
    return table, alarm


def shaken(rng, n, rms):
    """A beam (n, 2) [rad] that shakes about its program by this many SIGMA, as by the noise of a filter."""
    return lfilter([0.1], [1.0, -0.9], rng.normal(0.0, 1.0, (n, 2)), axis=0) / 0.23 * rms * SIGMA


def turned(error, degrees):
    x, e = error.T
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return np.column_stack((c * x - s * e, s * x + c * e))


def innovations(y):
    """Innovations (n, 2) of lines through all blocks before, over the noise of a block and of the line."""
    k, table = np.arange(len(y)), np.zeros(y.shape)
    for i in k[3:]:
        line = np.polynomial.polynomial.polyfit(k[:i], y[:i], 1)
        table[i] = (y[i] - line[0] - i * line[1]) / math.sqrt(1.0 + 4.0 / (i + 1))
    return table


def test_a_step_is_the_ratio_of_scipys_densities(state):
    """A turn of 180 deg, 135 deg and each sign, in a run where the sums stay above 0; the caution is added."""
    rng, n = np.random.default_rng(1), 200
    beam = shaken(rng, n, 0.5)
    error = beam + rng.normal(0.0, SIGMA, (n, 2))
    got = np.diff(sums(state, beam, error)[0], axis=0)
    a, b = innovations(beam), innovations(error)
    one = multivariate_normal(cov=SIGMA**2)
    for h, wrong in ((0, np.diag([-1.0, 1.0])), (1, np.diag([1.0, -1.0])), (6, -np.eye(2)),
                     (4, turned(np.eye(2), 135.0).T)):
        ratio = sum(one.logpdf((a + b @ wrong.T)[:, i]) - one.logpdf((a + b)[:, i]) for i in range(2))
        moved = a - a @ wrong.T
        expected = (ratio - slope_ratio.CAUTION * 0.5 * (moved**2).sum(axis=1) / SIGMA**2)[1:]
        grows = (got[:, h] > 0.0) & (expected > 0.0)
        assert grows.sum() > 5 and got[grows, h] == pytest.approx(expected[grows], rel=1e-6)


@pytest.mark.parametrize('degrees', [100.0, 180.0, 250.0])
def test_a_beam_within_half_the_noise_of_its_program_shows_a_turn(state, degrees):
    rng = np.random.default_rng(2)
    n, onset = 1500, 1000
    beam = shaken(rng, n, 0.4)
    error = -beam
    error[onset:] = turned(error[onset:], degrees)
    _, alarm = sums(state, beam, error + rng.normal(0.0, SIGMA, (n, 2)))
    assert onset < np.argmax(alarm) < onset + 300


@pytest.mark.parametrize('axis', [0, 1])
def test_the_sign_of_one_axis_is_found_by_its_own_sum(state, axis):
    rng = np.random.default_rng(3)
    beam = shaken(rng, 1500, 0.5)
    error = -beam
    error[1000:, axis] *= -1.0
    table, alarm = sums(state, beam, error + rng.normal(0.0, SIGMA, (1500, 2)))
    k = np.argmax(alarm)
    assert 1000 < k and table[k, axis] == table[k].max() and table[k, 1 - axis] < 5.0


@pytest.mark.parametrize(('rms', 'wander'), [(0.0, 0.0), (0.1, 0.2), (0.3, 0.4), (3.0, 0.4)])
def test_no_alarm_in_two_hours_of_a_right_slope(state, rms, wander):
    """The beam shakes by this many sigma; the errors do not show the wander of the attitude, of 60 s."""
    rng = np.random.default_rng(4)
    for _ in range(6):
        n = 60000
        beam = shaken(rng, n, rms)
        keep = math.exp(-T / 60.0)
        walk = lfilter([math.sqrt(1.0 - keep * keep)], [1.0, -keep], rng.normal(0.0, wander * SIGMA, (n, 2)), axis=0)
        assert not sums(state, beam + walk, rng.normal(0.0, SIGMA, (n, 2)) - beam)[1].any()
        slope_ratio.restart(state)


def test_of_targets_that_leave_their_program_at_most_one_in_ten_looks_like_a_wrong_slope(state):
    """Every 20 s the target turns away at 0.1 to 5 deg/s2 for half a second, and the beam follows 0.1 s later."""
    rng, turns = np.random.default_rng(5), 180
    push = np.radians(np.repeat(np.exp(rng.uniform(math.log(0.1), math.log(5.0), turns)), 1000))
    k = np.arange(len(push)) % 1000
    rate = T * np.cumsum(np.where(k < 25, push, np.where(k < 50, -push, 0.0)))
    target = np.column_stack((T * np.cumsum(rate), 0.0 * rate))
    beam = lfilter([1.0 - math.exp(-T / 0.1)], [1.0, -math.exp(-T / 0.1)], target, axis=0)
    _, alarm = sums(state, beam, target - beam + rng.normal(0.0, SIGMA, target.shape))
    assert alarm.reshape(turns, -1).any(axis=1).mean() <= 0.1


def test_a_jump_begins_the_lines_anew(state):
    beam, error = np.zeros((100, 2)), np.random.default_rng(6).normal(0.0, SIGMA, (100, 2))
    beam[70:] = 0.01
    sums(state, beam[:71], error[:71])
    assert state['n'] == 0
    assert state['hold'] == slope_ratio.HOLD_BLOCK_COUNT
    sums(state, beam[71:], error[71:])
    assert state['n'] == 29 and abs(state['line'][0, 0] - 0.01) < 1e-12
