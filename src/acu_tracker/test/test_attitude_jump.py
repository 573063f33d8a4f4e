"""An attitude that jumps against the rates of its deck; rotations by scipy."""
import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from acu_tracker.geometry import attitude
from acu_tracker.params import AcuParameters, SharedParameters
from pedestal_common.parameters import record

T, STILL = 0.005, Rotation.identity()
P = record(AcuParameters(), SharedParameters)[0]


def rolling(t):
    return Rotation.from_euler('ZYX', [1.0 + 0.02 * math.sin(0.5 * t), 0.1 * math.sin(0.9 * t + 1.0),
                                       0.2 * math.sin(0.8 * t)])


def rate(t, h=1e-4):
    return (rolling(t - h).inv() * rolling(t + h)).as_rotvec() / (2 * h)


class Deck:
    """A rolling deck, told with a rotation in the earth's frame before it; `error`: of what is believed [rad]."""

    def __init__(self):
        self.s, self.k = np.zeros(1, attitude.DeckAttitude.dtype)[0], 0
        self.s['stabilised'] = 1

    def take(self, turned=STILL, aligning=0, told=None):
        self.k += 1
        t = self.k * T
        q, w = told or ((turned * rolling(t)).as_quat(), rate(t))
        outcome = attitude.take(self.s, P, t, t, q, w, aligning)
        h = self.s['history']
        believed = Rotation.from_quat(h['sample'][h['newest'], :4])
        self.error = (believed * rolling(h['stamp'][h['newest']]).inv()).magnitude()
        return outcome


@pytest.fixture
def deck():
    made = Deck()
    for _ in range(100):
        assert made.take() == attitude.SAMPLE_NEW and made.error < 1e-12
    return made


@pytest.mark.parametrize('jump', ([0.0, 0.0, -0.02], [0.01, -0.004, 0.0], [0.0, 2.0, 0.0]))
def test_a_jump_is_let_in_slowly_and_so_is_its_end(deck, jump):
    jump = Rotation.from_rotvec(jump)
    for k in range(400):
        deck.take(jump)
        assert deck.error == pytest.approx(attitude.JUMP_DECAY_RATE_RAD_S * T * k, abs=2e-5)
    assert deck.s['jump']['apart']
    let_in = deck.error
    for k in range(600):
        deck.take()
        assert deck.error == pytest.approx(max(let_in - attitude.JUMP_DECAY_RATE_RAD_S * T * k, 0.0), abs=4e-5)
    assert not deck.s['jump']['apart']


def test_an_attitude_of_noise_is_carried_by_its_rates(deck):
    rng = np.random.default_rng(1)
    errors = []
    for _ in range(1000):
        deck.take(Rotation.from_rotvec(rng.normal(0.0, 0.01, 3)))
        errors.append(deck.error)
    assert max(errors) < 0.5 * 0.0175


def test_below_the_angle_and_while_it_aligns_an_attitude_is_what_it_is_told(deck):
    deck.take(Rotation.from_rotvec([0.0, 0.9 * attitude.MAX_UNEXPLAINED_ANGLE_RAD, 0.0]))
    assert deck.error == pytest.approx(0.9 * attitude.MAX_UNEXPLAINED_ANGLE_RAD)
    for turned in (0.3, -0.3):
        deck.take(Rotation.from_rotvec([0.0, 0.0, turned]), aligning=1)
        assert deck.error == pytest.approx(0.3)
    deck.take()
    assert deck.error < 1e-9 and not deck.s['jump']['apart']


def test_after_a_gap_nothing_predicts(deck):
    deck.k += 100
    deck.take(Rotation.from_rotvec([0.0, 0.0, 0.3]))
    assert deck.error == pytest.approx(0.3)


def test_numbers_that_repeat_are_none_but_of_a_deck_that_stands(deck):
    frozen = rolling(deck.k * T).as_quat(), rate(deck.k * T)
    assert deck.take(told=frozen) == attitude.SAMPLE_INVALID
    still = rolling(0.0).as_quat(), np.zeros(3)
    assert [Deck().take(told=still) for _ in range(2)] == [attitude.SAMPLE_NEW] * 2
    standing = Deck()
    assert [standing.take(told=still) for _ in range(3)] == [attitude.SAMPLE_NEW] * 3
