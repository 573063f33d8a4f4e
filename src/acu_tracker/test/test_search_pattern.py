"""Search patterns against numerical derivatives, an integrated spiral, and targets strewn over the area."""
import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial import cKDTree

from acu_tracker.search import pattern
from acu_tracker.search.pattern import PATTERN_SECTOR, PATTERN_SPIRAL, PATTERN_SQUARE, SEARCH_PATTERNS, Area, Point

PITCH, SPEED = 0.7, 2.5
"""In beamwidths, as the radii here."""

STEP = 0.005


def area(kind, radius=5.0, across=1.4):
    return Area(kind, radius, across, PITCH, SPEED)


def flown(of, step=STEP):
    """(times (n,), x, y, dx, dy (n, 4)) of a pattern."""
    t = np.arange(0.0, pattern.duration(of) + 0.5, step)
    return t, np.array([pattern.point(of, instant) for instant in t])


@pytest.mark.parametrize('kind', range(len(SEARCH_PATTERNS)))
@pytest.mark.parametrize('radius', [0.5, 1.5, 5.0])
def test_the_path_has_no_jump_and_its_rate_is_its_derivative(kind, radius):
    t, path = flown(area(kind, radius))
    assert path[0].tolist() == [0.0, 0.0, 0.0, 0.0]
    middle = path[:-1, 2:] + 0.5 * np.diff(path[:, 2:], axis=0)
    inside = t[1:] < pattern.duration(area(kind, radius))   # the spiral ends without coming to rest
    assert np.abs(np.diff(path[:, :2], axis=0) - STEP * middle)[inside].max() < 1e-3 * SPEED * STEP + 4e-5
    speed = np.hypot(path[:, 2], path[:, 3])
    assert speed.max() <= SPEED * (1 + 1e-9)
    assert np.abs(np.diff(speed))[inside].max() <= SPEED / pattern.SPEED_RISE_TIME_S * STEP * (1 + 1e-6)


@pytest.mark.parametrize('kind', range(len(SEARCH_PATTERNS)))
@pytest.mark.parametrize('radius', [0.3, 1.5, 5.0])
def test_every_place_of_the_area_is_within_the_beam_for_four_time_constants(kind, radius):
    """speed = b / (4 tau): within half a beamwidth for as long as it takes to fly the chord; in the first corner of
    the square for half of 4 tau."""
    of = area(kind, radius)
    rng = np.random.default_rng(kind)
    places = rng.uniform(-1.0, 1.0, (4000, 2)) * radius
    if kind in (PATTERN_SPIRAL, PATTERN_SQUARE):
        places = places[np.hypot(*places.T) <= radius]
    else:
        places[:, 1] *= 1.4 / radius
    _, path = flown(of)
    distance, _ = cKDTree(path[:, :2]).query(places)
    reach = (0.57 if kind == PATTERN_SQUARE else 0.5) * PITCH * 1.01
    assert distance.max() <= reach
    seen = np.array([np.hypot(*(path[:, :2] - place).T) < 0.5 for place in places[:200]]).sum(axis=1) * STEP
    assert seen.min() >= (0.2 if kind == PATTERN_SQUARE else 2.0 * math.sqrt(0.25 - reach**2) / SPEED - STEP)


def test_the_spiral_is_the_one_that_is_integrated():
    """d theta/dt = v / (k sqrt(1 + theta^2))."""
    k = 0.5 * PITCH / math.pi
    begun = pattern.spiral_length(0.1, PITCH)
    out = solve_ivp(lambda t, theta: SPEED / (k * np.sqrt(1.0 + theta * theta)), (0.0, 20.0), [0.1], rtol=1e-10,
                    atol=1e-12, dense_output=True).sol
    of = area(PATTERN_SPIRAL, 20.0)
    for t in (1.0, 3.0, 10.0, 20.0):
        theta = out(t)[0]
        x, y, *_ = pattern.point(of, 0.5 * pattern.SPEED_RISE_TIME_S + (begun + SPEED * t) / SPEED)
        assert (x, y) == pytest.approx((k * theta * math.cos(theta), k * theta * math.sin(theta)), abs=1e-7)


@pytest.mark.parametrize('kind', [PATTERN_SPIRAL, PATTERN_SECTOR])
def test_it_rests_where_it_has_ended(kind):
    of = area(kind)
    T = pattern.duration(of)
    last, later = pattern.point(of, T + 0.01), pattern.point(of, T + 100.0)
    assert last == pytest.approx(later) and later[2:] == (0.0, 0.0)


def test_corners():
    expanding = [pattern.vertex(area(PATTERN_SQUARE), i) for i in range(8)]
    assert np.allclose(np.array(expanding) / PITCH, [(0, 0), (1, 0), (1, 1), (-1, 1), (-1, -1), (2, -1), (2, 2),
                                                     (-2, 2)])
    raster = [pattern.vertex(area(pattern.PATTERN_RASTER, 5.0, 0.7), i) for i in range(7)]
    assert np.allclose(raster, [(0, 0), (5, 0), (-5, 0), (-5, 0.7), (5, 0.7), (5, -0.7), (-5, -0.7)])
    sector = [pattern.vertex(area(PATTERN_SECTOR, 5.0, 0.7), i) for i in range(7)]
    assert np.allclose(sector, [(0, 0), (5, -0.7), (-5, -0.7), (-5, 0), (5, 0), (5, 0.7), (-5, 0.7)])


def test_circle_and_rotation():
    for t in (0.0, 0.3, 0.99, 1.5):
        x, y, dx, dy = pattern.circle(0.15, 1.0, t)
        h = 1e-6
        after, before = pattern.circle(0.15, 1.0, t + h), pattern.circle(0.15, 1.0, t - h)
        assert (dx, dy) == pytest.approx(((after.x - before.x) / (2 * h), (after.y - before.y) / (2 * h)), abs=1e-6)
        assert math.hypot(x, y) == pytest.approx(0.15 * min(t, 1.0))
    assert pattern.rotated(Point(1.0, 0.0, 2.0, 0.0), 0.5 * math.pi) == pytest.approx((0.0, 1.0, 0.0, 2.0))
    assert pattern.highest_speed(0.02, 0.1, 0.5) == pytest.approx(0.025)
