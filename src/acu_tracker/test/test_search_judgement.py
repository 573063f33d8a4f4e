"""Slope check, side lobe and coast against least squares, a dish's pattern and closed forms."""
import math

import numpy as np
import pytest

from acu_tracker import tracking
from acu_tracker.estimation import departure
from acu_tracker.search import judgement

B = 0.0175


def checked(K, moved=0.15, noise=0.01, seed=1, n=200):
    """(record, expected offsets, errors (n, 2)) of a beam on a circle, errors K d + an error of the prediction."""
    rng = np.random.default_rng(seed)
    angle = np.linspace(0.0, 2.0 * math.pi * 0.9, n)
    d = moved * B * np.column_stack((np.cos(angle), np.sin(angle)))
    e = d @ np.asarray(K, float).T + [0.3 * B, -0.2 * B] + noise * B * rng.standard_normal((n, 2))
    s = judgement.Slopes.zeros()[0]
    judgement.restart_slopes(s)
    for one, error in zip(d, e):
        judgement.take_slopes(s, one, error)
    return s, d, e


def turned(beta):
    return [[math.cos(beta), -math.sin(beta)], [math.sin(beta), math.cos(beta)]]


def test_slopes_are_those_of_least_squares():
    s, d, e = checked([[1.3, 0.2], [-0.4, 0.7]], noise=0.05)
    K = np.linalg.lstsq(np.column_stack((d, np.ones(len(d)))), e, rcond=None)[0][:2].T
    assert judgement.slopes(s) == pytest.approx((K[0, 0], K[1, 1]), rel=1e-9)


@pytest.mark.parametrize('K, verdict', [
    (np.eye(2), judgement.VERDICT_RIGHT), (turned(0.5), judgement.VERDICT_RIGHT),
    (turned(1.2), judgement.VERDICT_WRONG),
    (np.diag([-1.0, 1.0]), judgement.VERDICT_WRONG), (np.diag([1.0, -1.0]), judgement.VERDICT_WRONG),
    (-np.eye(2), judgement.VERDICT_WRONG), ([[0.0, 1.0], [1.0, 0.0]], judgement.VERDICT_WRONG),
    (np.zeros((2, 2)), judgement.VERDICT_WRONG)])
def test_verdict(K, verdict):
    s, *_ = checked(K)
    assert judgement.slope_verdict(s, 200) == verdict
    assert judgement.slope_verdict(s, 201) == judgement.VERDICT_UNKNOWN


def test_a_beam_that_does_not_move_shows_no_slope():
    s, *_ = checked(np.eye(2), moved=0.0, noise=0.0)
    assert all(math.isnan(k) for k in judgement.slopes(s))
    assert judgement.slope_verdict(s, 10) == judgement.VERDICT_WRONG


def dish(x, e):
    """Level [dB] of the cosine taper in both axes, x and e in beamwidths: side lobes of -23 dB."""
    def taper(v):
        u = 3.7352430 * v
        return np.cos(u) / (1.0 - (2.0 * u / math.pi)**2)
    return 20.0 * np.log10(np.abs(taper(x) * taper(e)) + 1e-4)


@pytest.mark.parametrize('direction', np.linspace(0.0, 2.0 * math.pi, 13)[:-1])
def test_the_main_lobe_is_found_from_the_false_null_of_a_side_lobe(direction):
    place = np.array([1.68 * math.cos(direction), 1.68 * math.sin(direction)])
    for _ in range(4):
        around = [place + np.array(judgement.look_around_place(i, 1.0))
                  for i in range(1 + judgement.LOOK_AROUND_PLACES)]
        chosen = judgement.best_place(np.array([dish(*one) for one in around]))
        place = around[chosen]
    assert chosen == 0 and dish(*place) > -6.0


def test_a_beam_on_its_target_stays():
    for x, e in ((0.0, 0.0), (0.3, 0.0), (0.0, -0.35), (0.2, 0.2)):
        levels = [dish(x + dx, e + de) for dx, de in (judgement.look_around_place(i, 1.0) for i in range(7))]
        assert judgement.best_place(np.array(levels)) == 0


def test_expected_level():
    assert judgement.expected_level(46.4, 500e3, 2.0, 1000e3) == pytest.approx(46.4 - 6.0206, abs=1e-4)
    assert judgement.expected_level(46.4, 500e3, 2.0, math.nan) == 46.4
    assert judgement.suspected(36.0, 46.4) and not judgement.suspected(37.0, 46.4)


def test_coast():
    assert tracking.sigma_across(4e-6, 1e-6, math.acos(0.25)) == pytest.approx(1e-3)
    assert tracking.sigma_across(4e-6, 1e-6, 0.0) == pytest.approx(2e-3)
    departed = departure.MAX_OFFSET_BEAMWIDTHS * B
    assert not tracking.leaves_beam(0.49 * B, 0.99 * departed, B)
    assert tracking.leaves_beam(0.51 * B, 0.0, B) and tracking.leaves_beam(0.0, 1.01 * departed, B)
