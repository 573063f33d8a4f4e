"""The sums of likelihood ratios against the program: scipy's densities, a beam about its program, lateness, jumps."""
import math

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.stats import multivariate_normal

from acu_tracker.estimation import monitors, slope_ratio
from acu_tracker.geometry.vector import Vector
from acu_tracker.program import program_track
from pedestal_common.compiled import compiled

T, SIGMA, GAP = 0.02, 2.5e-4, 0.1   # of a block, of the mean of its errors [rad]; gap [s]
BEAM = monitors.Beam(Vector(0.0, 1.0, 0.0), Vector(1.0, 0.0, 0.0), Vector(0.0, 0.0, 1.0))  # to the north
STILL = program_track.checked([0.0, 1e4], [[0.0, 0.0]] * 2)


@pytest.fixture
def state():
    record = slope_ratio.SlopeRatio.zeros()[0]
    slope_ratio.restart(record)
    return record


@compiled
def sums(state, blocks, program, t, beam, error):
    """Sums (n, hypotheses) after each block, and alarms, of directions of the beam (n, 3) and of errors (n, 2)."""
    table, alarm = np.zeros((len(t), slope_ratio.HYPOTHESIS_COUNT)), np.zeros(len(t), np.bool_)
    count = monitors.BLOCK_ERROR_COUNT
    for k in range(len(t)):
        for i in range(3):
            blocks.sum[i] = count * beam[k, i]
        blocks.sum[3], blocks.sum[4], blocks.sum[5] = count * error[k, 0], 0.0, count * error[k, 1]
        blocks.variance = SIGMA**2 * count**2
        blocks.block_stamp = t[k]
        alarm[k] = slope_ratio.take(state, blocks, BEAM, program, 0.0, GAP)
        table[k] = state.S
    return table, alarm


def run(state, beam, error, program=STILL, place=None):
    """`sums` of a beam (n, 2) [rad] about a place (n, 3), by default the north horizon."""
    n = len(beam)
    place = np.tile([0.0, 1.0, 0.0], (n, 1)) if place is None else place
    return sums(state, monitors.WrongSlope.zeros()[0], program, T * np.arange(1, n + 1),
                place + np.column_stack((beam[:, 0], np.zeros(n), beam[:, 1])), error)


def shaken(rng, n, rms):
    """A beam (n, 2) [rad] that shakes about its program by this many SIGMA, as by the noise of a filter."""
    return lfilter([0.03], [1.0, -0.97], rng.normal(0.0, 1.0, (n, 2)), axis=0) / 0.123 * rms * SIGMA


def turned(error, degrees):
    x, e = error.T
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return np.column_stack((c * x - s * e, s * x + c * e))


def innovations(y):
    """Innovations (n, 2) of y over their standard deviation, by the matrices of a Kalman filter for lines."""
    F, H = np.array([[1.0, T], [0.0, 1.0]]), np.array([[1.0, 0.0]])
    Q = slope_ratio.BEND * np.array([[T**3 / 3.0, T**2 / 2.0], [T**2 / 2.0, T]])
    x, P, table = np.vstack((y[0], [0.0, 0.0])), np.diag([SIGMA**2, slope_ratio.LINE_RATE**2]), np.zeros(y.shape)
    for k in range(1, len(y)):
        x, P = F @ x, F @ P @ F.T + Q
        S = (H @ P @ H.T)[0, 0] + SIGMA**2
        table[k] = (y[k] - x[0]) / math.sqrt(S)
        x, P = x + P @ H.T / S * (y[k] - x[0]), P - P @ H.T @ H @ P / S
    return table


def test_a_step_is_the_ratio_of_scipys_densities(state):
    rng, n = np.random.default_rng(1), 400
    beam = shaken(rng, n, 0.3)
    error = rng.normal(0.0, SIGMA, (n, 2))
    got = np.diff(run(state, beam, error)[0], axis=0)
    a, b = innovations(beam), innovations(error)
    one = multivariate_normal(cov=1.0)
    for h, wrong in ((0, np.diag([-1.0, 1.0])), (1, np.diag([1.0, -1.0])), (4, -np.eye(2)),
                     (3, turned(np.eye(2), 135.0).T)):
        ratio = sum(one.logpdf((a + b @ wrong.T)[:, i]) - one.logpdf((a + b)[:, i]) for i in range(2))
        moved = a - a @ wrong.T
        expected = (ratio - slope_ratio.CAUTION * 0.5 * (moved**2).sum(axis=1))[1:]
        grows = (got[:, h] > 0.0) & (expected > 0.0) & (expected < slope_ratio.MAX_STEP)
        assert grows.sum() > 5 and got[grows, h] == pytest.approx(expected[grows], rel=1e-6)


@pytest.mark.parametrize('degrees', [100.0, 180.0, 250.0])
def test_a_beam_within_half_the_noise_of_its_program_shows_a_turn(state, degrees):
    rng, n, onset = np.random.default_rng(2), 1500, 1000
    beam = shaken(rng, n, 0.4)
    error = -beam
    error[onset:] = turned(error[onset:], degrees)
    alarm = run(state, beam, error + rng.normal(0.0, SIGMA, (n, 2)))[1]
    assert onset < np.argmax(alarm) < onset + 300


@pytest.mark.parametrize('axis', [0, 1])
def test_the_sign_of_one_axis_is_found_by_its_own_sum(state, axis):
    rng = np.random.default_rng(3)
    beam = shaken(rng, 1500, 0.5)
    error = -beam
    error[1000:, axis] *= -1.0
    table, alarm = run(state, beam, error + rng.normal(0.0, SIGMA, (1500, 2)))
    k = np.argmax(alarm)
    assert 1000 < k < 1300 and table[k, axis] > table[k, 1 - axis] + 8.0


@pytest.mark.parametrize('rms', [0.1, 0.3, 0.6])
def test_no_alarm_in_three_hours_of_a_right_slope(state, rms):
    rng = np.random.default_rng(4)
    for _ in range(6):
        beam = shaken(rng, 90000, rms)
        assert not run(state, beam, rng.normal(0.0, SIGMA, beam.shape) - beam)[1].any()


@pytest.mark.parametrize('lateness', [-2.0, 0.3, 1.0])
def test_the_lateness_of_a_satellite_is_estimated_and_is_no_wrong_slope(state, lateness):
    """A target overhead that culminates at 1 deg/s, seen with its own beam; its program is late."""
    rng, n = np.random.default_rng(5), 5000
    t = np.arange(-1.0, 150.0, 1.0)

    def elevation(t):
        return np.radians(30.0) * np.tanh((t - 50.0) / 30.0)
    program = program_track.checked(t, np.column_stack((0.0 * t, elevation(t - lateness))))
    at = elevation(T * np.arange(1, n + 1))
    place = np.column_stack((0.0 * at, np.cos(at), np.sin(at)))
    _, alarm = run(state, np.zeros((n, 2)), rng.normal(0.0, SIGMA, (n, 2)), program, place)
    assert not alarm.any()
    known, product, _ = state['lateness']
    assert product / (known + slope_ratio.LATENESS_PRIOR) == pytest.approx(lateness, abs=0.2)


def test_a_jump_of_the_program_begins_the_lines_anew(state):
    beam, error = np.zeros((400, 2)), np.random.default_rng(6).normal(0.0, SIGMA, (400, 2))
    beam[300:] = SIGMA
    run(state, beam, error)
    assert state['n'] == 100 and abs(state['line'][0, 0] - SIGMA) < 1e-5


def test_a_receiver_whose_offset_jumps_by_many_sigma_stops_the_sums(state):
    beam, error = np.zeros((500, 2)), np.random.default_rng(7).normal(0.0, SIGMA, (500, 2))
    error[400:] += 5.0 * SIGMA
    assert not run(state, beam, error)[1].any()
    assert state['hold'] > 0 and not state['S'].any()


@pytest.mark.parametrize('period, degrees', [(1.0, 3.0), (0.05, 0.5)])
def test_a_program_that_is_no_satellites_or_has_few_rows_is_not_used(state, period, degrees):
    """3 deg from row to row; an acceleration of 0.5 deg in 0.05 s."""
    t = np.arange(0.0, 10.0, period)
    way = np.radians(degrees) * (np.arange(len(t)) if period == 1.0 else np.arange(len(t)) % 2)
    program = program_track.checked(t, np.column_stack((way, 0.0 * way)))
    run(state, np.zeros((100, 2)), np.zeros((100, 2)), program)
    assert state['n'] == 0


def test_without_a_program_or_after_a_gap_it_begins_anew(state):
    rng = np.random.default_rng(8)
    run(state, np.zeros((50, 2)), rng.normal(0.0, SIGMA, (50, 2)))
    assert state['n'] == 50
    run(state, np.zeros((1, 2)), np.zeros((1, 2)), program_track.checked([50.0, 60.0], [[0.0, 0.0]] * 2))
    assert state['n'] == 0
