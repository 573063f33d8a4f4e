"""The expected place against numerical derivatives, and the displaced beam against the geometry of offsets."""
import math

import numpy as np
import pytest

from acu_tracker.geometry.vector import ZERO_VECTOR, AxisMotion, Motion, Vector
from acu_tracker.search import place
from acu_tracker.search.pattern import Point
from pedestal_common.geometry import line_of_sight


@pytest.fixture
def remembered():
    s = place.Place.zeros()[0]
    u = np.array(line_of_sight.earth_direction(0.7, 0.5))
    du = 0.004 * np.cross(u, [0.0, 0.6, 0.8])
    place.remember(s, 10.0, Vector(*u), Vector(*du))
    return s, u, du


def angles(s, t):
    motion = place.motion_at(s, t)
    return np.array([motion.azimuth.angle, motion.elevation.angle])


def test_it_begins_where_the_target_was_and_ends_where_its_rate_has_faded(remembered):
    s, u, du = remembered
    assert angles(s, 10.0) == pytest.approx(line_of_sight.earth_angles(*u), abs=1e-12)
    end = np.array(line_of_sight.earth_direction(*angles(s, 1e4)))
    W = np.linalg.norm(du)
    assert math.acos(end @ u) == pytest.approx(W * place.RATE_FADE_TIME_S, rel=1e-9)
    assert end @ np.cross(u, du) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize('t', [10.5, 13.0, 25.0])
def test_rates_and_accelerations_are_the_derivatives(remembered, t):
    s, *_ = remembered
    h, motion = 1e-3, place.motion_at(s, t)
    rates = (angles(s, t + h) - angles(s, t - h)) / (2.0 * h)
    accelerations = (angles(s, t + h) - 2.0 * angles(s, t) + angles(s, t - h)) / (h * h)
    assert [axis.rate for axis in motion] == pytest.approx(rates, rel=1e-5, abs=1e-9)
    assert [axis.acceleration for axis in motion] == pytest.approx(accelerations, rel=1e-3, abs=1e-7)


def test_what_was_at_rest_stays(remembered):
    s, u, _ = remembered
    place.remember(s, 10.0, Vector(*u), ZERO_VECTOR)
    assert angles(s, 500.0) == pytest.approx(line_of_sight.earth_angles(*u), abs=1e-12)


def test_a_displaced_beam_sees_its_target_on_the_other_side():
    A, E, x, e = 0.4, 0.9, 0.03, -0.02
    def beam(t):
        target = Motion(AxisMotion(A + 0.01 * t, 0.01, 0.0), AxisMotion(E - 0.02 * t, -0.02, 0.0))
        return place.displaced(target, Point(x + 0.05 * t, e + 0.03 * t, 0.05, 0.03))

    motion, h = beam(0.0), 1e-5
    direction = line_of_sight.direction(motion.azimuth.angle, motion.elevation.angle)
    assert line_of_sight.offsets(A, E, *direction) == pytest.approx((x, e), abs=1e-12)
    for i in range(2):
        assert motion[i].rate == pytest.approx((beam(h)[i].angle - beam(-h)[i].angle) / (2.0 * h), rel=1e-6)


def test_track():
    motion = Motion(AxisMotion(0.0, 0.02, 0.0), AxisMotion(1.0, 0.02 * math.cos(1.0), 0.0))
    assert place.track(motion) == pytest.approx(math.pi / 4)
