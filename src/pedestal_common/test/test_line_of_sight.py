"""Geometry against scipy's rotations and plain vector algebra."""
import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pedestal_common.geometry import line_of_sight as los

RNG = np.random.default_rng(7)
BEAMS = [(0.0, 0.0), (0.4, 0.7), (-2.9, 1.4), (3.1, -0.1)]


def random_attitude():
    return Rotation.from_quat(RNG.standard_normal(4))


@pytest.mark.parametrize('angle, wrapped', [(0.0, 0.0), (4.0, 4.0 - 2 * math.pi), (-math.pi, -math.pi),
                                            (math.pi, -math.pi), (9 * math.pi, -math.pi)])
def test_wrap(angle, wrapped):
    assert los.wrap(angle) == pytest.approx(wrapped)


@pytest.mark.parametrize('azimuth, elevation', BEAMS)
def test_angles_invert_direction(azimuth, elevation):
    assert los.angles(*los.direction(azimuth, elevation)) == pytest.approx((azimuth, elevation))
    assert los.earth_angles(*los.earth_direction(azimuth, elevation)) == pytest.approx((azimuth, elevation))


def test_azimuth_turns_clockwise():
    """A quarter turn from the bow looks to starboard; from north it looks east."""
    assert los.direction(math.pi / 2, 0.0) == pytest.approx((0.0, -1.0, 0.0))
    assert los.earth_direction(math.pi / 2, 0.0) == pytest.approx((1.0, 0.0, 0.0))


def test_ashore_deck_and_earth_angles_are_the_same():
    mat_ed = los.ashore_matrix()
    assert Rotation.from_quat(los.ASHORE_ATTITUDE).as_matrix() == pytest.approx(mat_ed)
    assert los.earth_angles(*los.to_earth(mat_ed, *los.direction(0.7, 0.3))) == pytest.approx((0.7, 0.3))


@pytest.mark.parametrize('azimuth, elevation', BEAMS)
def test_offsets_are_the_angle_between_beam_and_target(azimuth, elevation):
    for _ in range(20):
        target = RNG.standard_normal(3)
        cross, up = los.offsets(azimuth, elevation, *target)
        cosine = np.dot(los.direction(azimuth, elevation), target) / np.linalg.norm(target)
        assert math.hypot(cross, up) == pytest.approx(math.acos(cosine), abs=1e-7)


def test_offsets_of_an_azimuth_error_shrink_with_elevation():
    elevation, error = 1.2, 1e-5
    cross, up = los.offsets(0.3, elevation, *los.direction(0.3 + error, elevation))
    assert cross == pytest.approx(error * math.cos(elevation), rel=1e-5)
    assert abs(up) < 1e-9
    above = los.direction(0.3, elevation + error)
    assert los.offsets(0.3, elevation, *above) == pytest.approx((0.0, error), abs=1e-12)


@pytest.mark.parametrize('azimuth, elevation', BEAMS)
@pytest.mark.parametrize('offset', [(0.0, 0.0), (1e-3, -2e-3), (0.3, 0.2), (-1.0, 0.5)])
def test_displaced_inverts_offsets(azimuth, elevation, offset):
    assert los.offsets(azimuth, elevation, *los.direction(*los.displaced(azimuth, elevation, *offset))
                       ) == pytest.approx(offset, abs=1e-12)


def test_rotation_and_its_transpose_against_scipy():
    mat, vector = np.empty((3, 3)), RNG.standard_normal(3)
    for _ in range(20):
        attitude = random_attitude()
        los.rotation(*attitude.as_quat(), mat)
        assert mat == pytest.approx(attitude.as_matrix())
        assert los.to_earth(mat, *vector) == pytest.approx(attitude.apply(vector))
        assert los.to_deck(mat, *vector) == pytest.approx(attitude.inv().apply(vector))


def test_quaternion_is_fixed_axis_roll_pitch_yaw():
    angles = RNG.uniform(-1.0, 1.0, 3)
    ours = Rotation.from_quat(los.quaternion(*angles))
    assert ours.as_matrix() == pytest.approx(Rotation.from_euler('xyz', angles).as_matrix())


def beam_at(t):
    """Beam angles and the rates they change at."""
    return (0.4 + 0.3 * t, 0.7 - 0.2 * t), (0.3, -0.2)


def target_at(t):
    """A vector of changing length and its rate."""
    return (np.array([3.0, -1.2, 2.6]) + t * np.array([0.5, 0.8, -0.3]) + t * t * np.array([0.1, -0.2, 0.05]),
            np.array([0.5, 0.8, -0.3]) + 2.0 * t * np.array([0.1, -0.2, 0.05]))


@pytest.mark.parametrize('t', [0.0, -1.3, 2.5])
def test_offset_rates_against_the_difference_of_offsets(t):
    h = 1e-5
    before, after = (np.array(los.offsets(*beam_at(t + d)[0], *target_at(t + d)[0])) for d in (-h, h))
    rates = los.offset_rates(*beam_at(t), *map(tuple, target_at(t)))
    assert rates == pytest.approx((after - before) / (2.0 * h), abs=1e-9)


@pytest.mark.parametrize('offset', [(0.0, 0.0), (1e-9, -2e-9), (1e-4, 2e-4), (0.009, 0.001), (0.3, 0.2), (-1.0, 0.5)])
def test_displaced_motion_inverts_offset_rates(offset):
    (azimuth, elevation), rates = beam_at(0.0)
    seen = los.displaced_motion(azimuth, elevation, *rates, *offset, 0.02, -0.03)
    assert seen[:3] == pytest.approx(los.direction(*los.displaced(azimuth, elevation, *offset)), abs=1e-15)
    assert np.dot(seen[:3], seen[3:]) == pytest.approx(0.0, abs=1e-15)
    assert los.offset_rates((azimuth, elevation), rates, seen[:3], seen[3:]) == pytest.approx((0.02, -0.03), abs=1e-12)
