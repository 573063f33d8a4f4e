"""Laws of the input of an INS against scipy: frames, rates, and the check of the frames."""
import itertools
import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pedestal_hardware.ins import frame_check, frames, rate_estimator

RNG = np.random.default_rng(1)
FLU_OF = {'flu': np.eye(3), 'frd': np.array(((1, 0, 0), (0, -1, 0), (0, 0, -1))),
          'rfu': np.array(((0, 1, 0), (-1, 0, 0), (0, 0, 1)))}
"""Rows: forward, left and up in the axes of a body frame."""

ENU_OF = {'enu': np.eye(3), 'nwu': np.array(((0, -1, 0), (1, 0, 0), (0, 0, 1))),
          'ned': np.array(((0, 1, 0), (1, 0, 0), (0, 0, -1)))}
"""Rows: east, north and up in the axes of a frame of the earth."""


ALL_FRAMES = tuple(itertools.product(frames.EARTH_MATRICES, frames.BODY_MATRICES, frames.BODY_MATRICES))
RIGHT = ('enu', 'flu', 'flu')


def test_headings_become_the_attitude_of_rep_103():
    """Against the matrix of heading, pitch, roll in NED and FRD, by scipy; and the number of hardware.md C."""
    q = frames.of_angles(*np.radians((30.0, 5.0, 10.0)))
    assert q == pytest.approx((0.097134, 0.005905, 0.500916, 0.860008), abs=1e-6)
    for heading, pitch, roll in RNG.uniform((-180, -80, -170), (360, 80, 170), (300, 3)):
        ned = Rotation.from_euler('ZYX', (heading, pitch, roll), degrees=True).as_matrix()
        expected = ENU_OF['ned'] @ ned @ FLU_OF['frd'].T
        found = Rotation.from_quat(frames.of_angles(*np.radians((heading, pitch, roll)))).as_matrix()
        assert found == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize('earth, body, rate_body', ALL_FRAMES)
def test_every_frame_gives_the_true_attitude_and_rate(earth, body, rate_body):
    """A device with a mounting and a heading zero measures a deck; the conversion gives the deck back."""
    for truth, case, w in zip(Rotation.random(20, random_state=1), Rotation.random(20, random_state=2),
                              RNG.normal(size=(20, 3))):
        yaw, pitch, roll = case.as_euler('ZYX')
        zero = math.radians(17.0)
        # heading of the device = true heading - zero, so its earth is turned clockwise by zero
        of_case = Rotation.from_euler('Z', zero) * truth * case
        device = Rotation.from_matrix(ENU_OF[earth].T @ of_case.as_matrix() @ FLU_OF[body])
        c = frames.constants(earth, body, rate_body, (roll, pitch, yaw), zero)[0]
        found = Rotation.from_quat(frames.attitude(c, device.as_quat()))
        assert (found * truth.inv()).magnitude() < 1e-12
        assert frames.on_deck(c, FLU_OF[rate_body].T @ case.inv().apply(w)) == pytest.approx(tuple(w), abs=1e-12)


def test_rotation_vectors_against_scipy():
    for a, b in zip(Rotation.random(50, random_state=3), Rotation.random(50, random_state=4)):
        expected = (a.inv() * b).as_rotvec()
        assert frames.rotation_vector(a.as_quat(), b.as_quat()) == pytest.approx(tuple(expected), abs=1e-9)
        turned = Rotation.from_quat(frames.turned(a.as_quat(), *expected))
        assert (turned * b.inv()).magnitude() < 1e-9


def sea(t):
    """Attitude (Rotation FLU -> ENU) of a rolling, pitching and yawing deck at times (n,) [s]."""
    t = np.atleast_1d(t)
    angles = (40.0 + 4.0 * np.sin(2 * math.pi * t / 13.0), 3.0 * np.sin(2 * math.pi * t / 7.0 + 1.0),
              8.0 * np.sin(2 * math.pi * t / 11.0))
    return Rotation.from_euler('ZYX', np.stack(angles, axis=1), degrees=True)


def rate(t, moves=sea):
    """Rates of a deck on the deck (n, 3) [rad/s] at times (n,), by differences of 1 ms."""
    return (moves(t - 5e-4).inv() * moves(t + 5e-4)).as_rotvec() / 1e-3


@pytest.mark.parametrize('period, digits, limit', [(0.02, 3, 0.05), (0.1, 2, 0.15)])
def test_the_rates_of_a_device_without_rates(period, digits, limit):
    """50 Hz in 0.001 deg, and 10 Hz in 0.01 deg: rms error [deg/s] far below that of differences (0.22 at 50 Hz)."""
    s, t = rate_estimator.Estimator.zeros()[0], period * np.arange(1, round(40.0 / period))
    angles = np.round(sea(t).as_euler('ZYX', degrees=True), digits)
    found = [rate_estimator.take(s, round(at * 1e9), q, 10.0)
             for at, q in zip(t, Rotation.from_euler('ZYX', angles, degrees=True).as_quat())]
    settled, w, jumped = map(np.array, zip(*found))
    assert not jumped.any()
    assert np.array_equal(settled, (t - t[0]) * 10.0 >= rate_estimator.SETTLING_TIME_CONSTANTS - 1e-6)
    errors = np.degrees(w - rate(t))[t > 2.0]
    assert np.sqrt(np.mean(np.square(errors))) < limit


class Checked:
    """A check of a device with true frames, whose parameters declare other frames.

    moves: attitudes of its deck at times; noise: of the attitude [rad]; scale: of the rates
    """

    def __init__(self, true, declared, moves=sea, gravity=True, noise=1.7e-4, scale=1.0):
        self.true, self.declared, self.moves, self.gravity = true, declared, moves, gravity
        self.noise, self.scale, self.rng, self.now = noise, scale, np.random.default_rng(1), 0.0
        self.s = frame_check.Check.zeros()[0]
        self.c = frames.constants(*declared, (0.0, 0.0, 0.0), 0.0)[0]

    def run(self, seconds):
        """Take the samples of a time. Return the time of the first verdict `wrong` [s], None without one."""
        t, (earth, body, rate_body) = self.now + 0.02 * np.arange(1, round(seconds / 0.02) + 1), self.true
        deck = self.moves(t) * Rotation.from_rotvec(self.noise * self.rng.standard_normal((t.size, 3)))
        device = Rotation.from_matrix(ENU_OF[earth].T @ deck.as_matrix() @ FLU_OF[body]).as_quat()
        w = self.scale * rate(t, self.moves) @ FLU_OF[rate_body]
        force = deck.inv().apply((0.0, 0.0, 9.8)) @ FLU_OF[rate_body] if self.gravity else np.full((t.size, 3), np.nan)
        wrong = None
        for k in range(t.size):
            frame_check.take(self.s, round(t[k] * 1e9), np.array(frames.attitude(self.c, device[k])),
                             np.array(frames.on_deck(self.c, w[k])), np.array(frames.on_deck(self.c, force[k])),
                             frame_check.ALL_AXES)
            if wrong is None and (self.s['verdict'] == frame_check.FRAME_WRONG or self.s['down']):
                wrong = t[k]
        self.now, self.q = t[-1], device[-1]
        return wrong

    @property
    def fits(self):
        return frame_check.fitting_conventions(self.s, self.declared, np.eye(3), self.q)


@pytest.mark.parametrize('frame', ALL_FRAMES)
def test_right_frames_agree(frame):
    checked = Checked(frame, frame)
    assert checked.run(20.0) is None and checked.s['verdict'] == frame_check.FRAME_RIGHT


@pytest.mark.parametrize('true', [frame for frame in ALL_FRAMES if frame[0] == 'enu' and frame[1] != frame[2]])
def test_wrong_body_frames_are_found_within_10_s_and_named(true):
    """The declared frames are those of REP 145, the default of the node."""
    checked = Checked(true, RIGHT)
    found = checked.run(10.0)
    assert found is not None and found < 10.0
    assert any(candidate[1:] == true[1:] for candidate in checked.fits) and RIGHT not in checked.fits


def test_the_frame_of_a_noisy_device_is_named():
    checked = Checked(('enu', 'flu', 'rfu'), RIGHT, noise=9e-4)
    assert checked.run(10.0) is not None and checked.fits == [('enu', 'flu', 'rfu')]


def test_no_frame_explains_rates_in_another_unit():
    checked = Checked(RIGHT, RIGHT, scale=10.0)
    assert checked.run(10.0) is not None and checked.fits == []
    assert 'unit of its rates' in frame_check.text_of(checked.fits)


@pytest.mark.parametrize('true, declared', [(('ned', 'frd', 'frd'), RIGHT), (RIGHT, ('ned', 'frd', 'frd'))])
def test_a_frame_that_rates_and_attitude_share_is_found_by_gravity(true, declared):
    checked = Checked(true, declared)
    found = checked.run(10.0)
    assert found is not None and found < 10.0 and checked.s['down']
    assert checked.s['verdict'] == frame_check.FRAME_RIGHT and true in checked.fits
    without = Checked(true, declared, gravity=False)
    assert without.run(10.0) is None        # the documentation states this limit


@pytest.mark.parametrize('scale', [math.degrees(1.0), math.radians(1.0)])
def test_rates_in_another_unit_are_found(scale):
    assert Checked(RIGHT, RIGHT, scale=scale, moves=lambda t: sea(1.5 * t)).run(10.0) is not None


def test_a_deck_at_rest_gives_no_verdict():
    checked = Checked(RIGHT, ('enu', 'flu', 'frd'), moves=lambda t: sea(0.0 * t), gravity=False, noise=1e-3)
    assert checked.run(30.0) is None and checked.s['verdict'] == frame_check.FRAME_UNKNOWN


def test_a_noisy_attitude_is_no_wrong_frame():
    """0.05 deg white at 50 Hz, as of a small sensor."""
    checked = Checked(RIGHT, RIGHT, noise=9e-4)
    assert checked.run(60.0) is None and checked.s['verdict'] == frame_check.FRAME_RIGHT


def test_a_jump_of_the_heading_is_no_wrong_frame():
    def moves(t):
        return Rotation.from_euler('Z', np.where(t > 10.01, 5.0, 0.0)[:, None], degrees=True) * sea(0.3 * t)
    checked = Checked(RIGHT, RIGHT, moves=moves)
    assert checked.run(20.0) is None and checked.s['jumps'] == 1


def test_a_corrected_parameter_clears_a_wrong_verdict():
    checked = Checked(('enu', 'flu', 'frd'), RIGHT)
    assert checked.run(10.0) is not None
    checked.true = RIGHT
    checked.run(25.0)
    assert checked.s['verdict'] == frame_check.FRAME_RIGHT


@pytest.mark.parametrize('sign, expected', [(1.0, frame_check.FRAME_RIGHT), (-1.0, frame_check.FRAME_WRONG)])
def test_the_sign_of_a_rate_of_turn(sign, expected):
    """Smoothed over 1 s, as a compass does."""
    s, smooth, t = frame_check.Check.zeros()[0], 0.0, 0.1 * np.arange(1, 200)
    for at, q, w in zip(t, sea(t).as_quat(), rate(t)):
        smooth += 0.1 * (sign * w[2] - smooth)
        frame_check.take(s, round(at * 1e9), q, np.array((0.0, 0.0, smooth)), np.full(3, np.nan),
                         frame_check.TURN_AXIS)
    assert s['verdict'] == expected
