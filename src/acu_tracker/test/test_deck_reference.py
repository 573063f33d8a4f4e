import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from acu_tracker.geometry import attitude as deck_attitude
from acu_tracker.geometry import frames, lever_arm
from acu_tracker.geometry.azimuth_wrap import Travel, nearest
from acu_tracker.geometry.frames import Attitude
from acu_tracker.geometry.vector import (
    ZERO_VECTOR,
    AxisMotion,
    LineOfSight,
    Motion,
    Vector,
    angles,
    line_of_sight,
    north_west_up,
    rotation,
    turn,
)
from acu_tracker.lookahead.slew import best_elevation
from acu_tracker.params import AcuParameters, SharedParameters
from pedestal_common.geometry.line_of_sight import ashore_matrix
from pedestal_common.parameters import record

LOW, HIGH = -1.5 * math.pi, 1.5 * math.pi


def attitude(t):
    """Deck -> earth on a rough day: yaw, pitch, roll all moving."""
    return Rotation.from_euler('ZYX', [0.7 + 0.05 * math.sin(0.3 * t), 0.08 * math.sin(0.9 * t + 1),
                                       0.17 * math.sin(0.785 * t)])


def body_rate(t, h=1e-4):
    return (attitude(t - h).inv() * attitude(t + h)).as_rotvec() / (2 * h)


def earth(t):
    return 1.0 + 0.03 * t + 0.002 * t * t, 0.5 + 0.02 * t - 0.001 * t * t


def earth_motion(t):
    """The Motion of `earth`."""
    A, E = earth(t)
    return Motion(AxisMotion(A, 0.03 + 0.004 * t, 0.004), AxisMotion(E, 0.02 - 0.002 * t, -0.002))


def deck_by_rotation(t):
    A, E = earth(t)
    x, y, z = attitude(t).inv().apply([math.cos(E) * math.sin(A), math.cos(E) * math.cos(A), math.sin(E)])
    return np.array([math.atan2(-y, x), math.asin(z)])


@pytest.mark.parametrize('t', [0.0, 1.7, 4.4, 9.1])
def test_deck_angles_rates_and_accelerations(t):
    w = body_rate(t)
    dw = (body_rate(t + 1e-3) - body_rate(t - 1e-3)) / 2e-3
    deck = Attitude(rotation(attitude(t).as_matrix()), Vector(*w), Vector(*dw))
    got = np.array(angles(frames.on_deck(deck, line_of_sight(earth_motion(t)))))
    h = 1e-3
    before, here, after = (deck_by_rotation(t + d) for d in (-h, 0.0, h))
    np.testing.assert_allclose(got[:, 0], here, atol=1e-13)
    np.testing.assert_allclose(got[:, 1], (after - before) / (2 * h), atol=2e-7)
    np.testing.assert_allclose(got[:, 2], (after - 2 * here + before) / h**2, atol=2e-6)


def test_the_zenith_gives_finite_numbers():
    deck = Attitude(turn(0.0, 0.0, 0.0, 1.0), Vector(0.1, 0.1, 0.1), ZERO_VECTOR)
    zenith = Motion(AxisMotion(0.0, 0.01, 0.0), AxisMotion(0.5 * math.pi, 0.01, 0.0))
    assert np.isfinite(angles(frames.on_deck(deck, line_of_sight(zenith)))).all()
    up = LineOfSight(Vector(0.0, 0.0, 1.0), Vector(0.1, 0.0, 0.0), Vector(0.0, 0.0, -0.01))
    assert np.isfinite(angles(up)).all()


def test_turned_is_the_rotation_by_a_vector():
    rng = np.random.default_rng(1)
    for size in (0.0, 1e-9, 0.1, 2.0):
        q, r = Rotation.from_rotvec(rng.normal(size=3)), size * rng.normal(size=3)
        got = Rotation.from_quat(deck_attitude.rotated(q.as_quat(), tuple(r)))
        assert (got.inv() * q * Rotation.from_rotvec(r)).magnitude() < 1e-14


def test_every_instant_has_its_own_attitude():
    """Between two samples and ahead of them against scipy; NaN where nothing is known; ashore always the same."""
    p, s = record(AcuParameters(), SharedParameters)[0], deck_attitude.DeckAttitude.zeros()
    s['stabilised'] = 1
    known, deck = deck_attitude.at(s[0], p, 0.0)
    assert not known and np.isnan(np.array(deck.mat)).all()
    for k in range(20):
        deck_attitude.take(s[0], p, 0.005 * k, 0.005 * k, attitude(0.005 * k).as_quat(), body_rate(0.005 * k), False)
    asked = {t: deck_attitude.at(s[0], p, t) for t in (0.0521, 0.1, 0.0, 0.4)}
    for t, (known, deck) in asked.items():
        assert known == (t < 0.3)
        if known:
            np.testing.assert_allclose(np.array(deck.mat), attitude(t).as_matrix(), atol=1e-6)
            np.testing.assert_allclose(deck.w, body_rate(t), atol=1e-3)
    s['stabilised'] = 0
    _, deck = deck_attitude.at(s[0], p, 9.0)
    assert np.array(deck.mat) == pytest.approx(ashore_matrix(), abs=1e-15)


@pytest.mark.parametrize('azimuth, near, travel, expected', [
    (0.5, 0.4, (0, 0), 0.5),
    (-3.0, 3.0, (0, 0), 2 * math.pi - 3.0),
    (-1.4, 4.7, (0, 0), -1.4),                  # 2 pi - 1.4 = 4.88 lies behind the limit
    (3.0, 4.0, (0, 2.0), 3.0 - 2 * math.pi),    # the travel would hit the limit on the near wrap
    (3.0, 4.0, (-1.0, 0), 3.0),
    (3.0, 4.0, (-9.0, 9.0), 3.0),               # no wrap holds all of it
])
def test_nearest_wrap(azimuth, near, travel, expected):
    assert nearest(azimuth, near, LOW, HIGH, Travel(*map(float, travel))) == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize('t', [0.0, 1.7, 4.4, 9.1])
def test_a_deck_rate_comes_back_to_earth(t):
    h = 1e-4
    before, after = (attitude(t + d).inv().apply([math.cos(E) * math.sin(A), math.cos(E) * math.cos(A), math.sin(E)])
                     for d in (-h, h) for A, E in [earth(t + d)])
    here = 0.5 * (before + after)
    deck = Attitude(rotation(attitude(t).as_matrix()), Vector(*body_rate(t)), ZERO_VECTOR)
    got = frames.earth_rates(deck, Vector(*here), Vector(*(after - before) / (2.0 * h)))
    assert got == pytest.approx((0.03 + 0.004 * t, 0.02 - 0.002 * t), abs=1e-7)


@pytest.mark.parametrize('t', [0.0, 4.4])
def test_the_end_of_a_lever_arm_sees_the_target_from_there(t):
    """Place and motion of a direction less r / range, against differences."""
    arm = np.array([0.02, -0.05, 0.3])

    def direction_at(t):
        A, E = earth(t)
        u = attitude(t).inv().apply([math.cos(E) * math.sin(A), math.cos(E) * math.cos(A), math.sin(E)])
        return u, (u - arm) / np.linalg.norm(u - arm)
    h = 1e-3
    (u0, n0), (u1, n1), (u2, n2) = (direction_at(t + d) for d in (-h, 0.0, h))
    state = lever_arm.LeverArm.zeros()
    state['arm'] = arm
    sight = LineOfSight(Vector(*u1), Vector(*(u2 - u0) / (2 * h)), Vector(*(u2 - 2 * u1 + u0) / h**2))
    got = lever_arm.to_antenna(state[0], sight)
    np.testing.assert_allclose(got.u, n1, atol=1e-14)
    np.testing.assert_allclose(got.du, (n2 - n0) / (2 * h), atol=1e-7)
    np.testing.assert_allclose(got.ddu, (n2 - 2 * n1 + n0) / h**2, atol=1e-6)


def test_the_best_elevation_is_closest_to_the_target():
    """Its angle against a search, its rates against differences, over the top as well."""
    def beam(t):
        return 2.5 * math.sin(0.4 * t + 0.1)
    h = 1e-3
    for t in np.arange(0.0, 12.0, 0.83):
        A, E = earth(t)
        sight = LineOfSight(*map(north_west_up, line_of_sight(earth_motion(t))))
        got = best_elevation(AxisMotion(beam(t), math.cos(0.4 * t + 0.1), -0.4 * math.sin(0.4 * t + 0.1)), sight)
        grid = np.linspace(0.0, math.pi, 20001)
        along = math.cos(E) * math.cos(A - beam(t)) * np.cos(grid) + math.sin(E) * np.sin(grid)
        assert got[0] == pytest.approx(grid[np.argmax(along)], abs=2e-4)
        before, here, after = (math.atan2(math.tan(earth(at)[1]), math.cos(earth(at)[0] - beam(at)))
                               for at in (t - h, t, t + h))
        assert got[1] == pytest.approx((after - before) / (2 * h), abs=1e-5)
        assert got[2] == pytest.approx((after - 2 * here + before) / h**2, abs=1e-3)


def test_from_the_ins_to_the_antenna_and_back():
    """For an arm of which R is known, against numpy; the two ways undo each other up to the square of the arm."""
    state = lever_arm.LeverArm.zeros()
    state['arm'] = [0.003, -0.005, 0.007]
    u, du = np.array([0.48, 0.6, 0.64]), np.array([0.01, -0.02, 0.01125])
    sight, rate = lever_arm.to_ins(state[0], Vector(*u), Vector(*du))
    seen = u + state['arm'][0]
    np.testing.assert_allclose(sight, seen / np.linalg.norm(seen), atol=1e-12)
    back = lever_arm.to_antenna(state[0], LineOfSight(sight, rate, Vector(0.0, 0.0, 0.0)))
    np.testing.assert_allclose(back.u, u, atol=1e-4)
