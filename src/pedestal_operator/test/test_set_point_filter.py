"""Set-points in sequence: a steady motion without steps back that ends where the last one was."""
import numpy as np
import pytest

from pedestal_operator.rotator.set_point_filter import MAX_SET_POINT_GAP_S, MOTION_DURATION_RATIO, SetPointFilter


def commanded(times, set_points, t):
    """C at times t (n,), (n, 2), where set-points come at times."""
    course, due, places = SetPointFilter(), list(zip(times, set_points)), []
    for now in t:
        while due and due[0][0] <= now:
            at, set_point = due.pop(0)
            course.take(set_point, at)
        places.append(course.place(now))
    return np.array(places)


def test_a_steady_stream_is_followed_without_lag_or_jump():
    times = 0.8 * np.arange(20)
    points = np.outer(times, (0.9, -0.4)) + (350.0, 40.0)
    t = np.arange(8.0, 16.0, 0.01)
    places = commanded(times, points, np.arange(0.0, 16.0, 0.01))[800:]
    np.testing.assert_allclose(places, np.outer(t, (0.9, -0.4)) + (350.0, 40.0), atol=5e-3)
    assert np.abs(np.diff(places, axis=0)).max() < 0.01 * 0.95


def test_what_comes_early_or_late_never_leads_it_back():
    rng = np.random.default_rng(1)
    times = 0.8 * np.arange(60) + rng.uniform(-0.1, 0.1, 60)
    points = np.outer(times + rng.uniform(-0.2, 0.2, 60), (0.9, 0.5))
    points = np.maximum.accumulate(points)
    places = commanded(times, points, np.arange(0.2, 47.0, 0.01))
    assert np.diff(places, axis=0).min() >= 0.0


@pytest.mark.parametrize('times', ((0.0, 1.0), (0.0, 0.5, 2.9), (0.0, 4.0, 8.0, 12.0)))
def test_set_points_without_a_pace_are_gone_to(times):
    """Two of them too: who knows whether a third comes."""
    course = SetPointFilter()
    for i, at in enumerate(times):
        begins, rate, moves = course.take((float(i), 0.0), at)
        assert (begins.tolist(), rate.tolist(), moves) == ([float(i), 0.0], [0.0, 0.0], 0.0)


def test_another_target_is_gone_to_at_once():
    course = SetPointFilter()
    for i in range(5):
        course.take((0.5 * i, 10.0), 0.8 * i)
    begins, rate, _ = course.take((120.0, 10.0), 4.0)
    assert begins.tolist() == [120.0, 10.0] and not rate.any()


def test_a_stream_that_ends_stands_and_is_over():
    course = SetPointFilter()
    for i in range(6):
        course.take((0.8 * i, 0.0), 0.8 * i)
    ended = 4.0
    assert course.place(ended + 2.0 * MOTION_DURATION_RATIO) == pytest.approx((4.0 + 0.8 * MOTION_DURATION_RATIO, 0.0),
                                                                              abs=0.1)
    assert course.continues(ended + 0.9 * MAX_SET_POINT_GAP_S) and not course.continues(ended + MAX_SET_POINT_GAP_S)
