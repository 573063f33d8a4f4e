import math

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline

from acu_tracker.geometry.vector import line_of_sight
from acu_tracker.modes import Reason
from acu_tracker.program import program_track
from acu_tracker.program.program_track import ProgramTrack


def table(n=40, seed=2):
    rng = np.random.default_rng(seed)
    times = np.cumsum(rng.uniform(0.5, 1.5, n))
    return times, np.column_stack([3.0 + 0.05 * times, 0.6 + 0.1 * np.sin(0.2 * times)])


def wrapped(angles):
    out = angles.copy()
    out[:, 0] = (out[:, 0] + math.pi) % (2 * math.pi) - math.pi
    return out


def test_is_the_hermite_spline_with_parabolic_slopes():
    times, angles = table()
    slopes = np.gradient(angles, times, axis=0, edge_order=2)
    spline = CubicHermiteSpline(times, angles, slopes)
    program = ProgramTrack(times, wrapped(angles))
    for t in np.linspace(times[0], times[-1] - 1e-9, 500):
        for axis in (0, 1):
            got = program_track.interpolated(program, t, axis)
            expected = [spline(t, derivative)[axis] for derivative in range(3)]
            turns = 2 * math.pi * round((got[0] - expected[0]) / (2 * math.pi)) if axis == 0 else 0.0
            np.testing.assert_allclose(np.subtract(got, (turns, 0, 0)), expected, atol=1e-11)


def test_quadratic_is_reproduced_and_two_rows_are_a_line():
    times = np.array([0.0, 1.0, 2.5, 3.0])
    angles = np.column_stack([0.1 * times**2, 0.2 - 0.05 * times**2])
    for t in (0.0, 0.7, 1.0, 2.9, 3.0, 3.01):
        np.testing.assert_allclose(program_track.interpolated(ProgramTrack(times, angles), t, 0),
                                   (0.1 * t * t, 0.2 * t, 0.2), atol=1e-13)
    line = program_track.interpolated(ProgramTrack(times[:2], angles[:2]), 0.25, 0)
    np.testing.assert_allclose(line, (0.025, 0.1, 0.0), atol=1e-15)


def test_rate_is_continuous_over_rows_and_the_north_crossing():
    times, angles = table()
    program = ProgramTrack(times, wrapped(angles))
    for row in times[1:-1]:
        for axis in (0, 1):
            before = program_track.interpolated(program, row - 1e-9, axis)
            after = program_track.interpolated(program, row + 1e-9, axis)
            assert before.rate == pytest.approx(after.rate, abs=1e-8)


def test_status():
    times, angles = table()
    program = ProgramTrack(times, angles)
    assert program_track.status(program, times[0]) == Reason.NONE
    assert program_track.status(program, times[-1]) == Reason.NONE
    assert program_track.status(program, times[0] - 1e-6) == Reason.BEFORE_PROGRAM
    assert program_track.status(program, times[-1] + 1e-6) == Reason.AFTER_PROGRAM
    assert program_track.status(ProgramTrack(times[:1], angles[:1]), times[0]) == Reason.NO_PROGRAM
    assert program_track.status(program_track.NO_TRACK, times[0]) == Reason.NO_PROGRAM


def test_travel_until_the_end():
    times = np.arange(5.0)
    angles = np.zeros((5, 2))
    angles[:, 0] = (3.0, -3.0, -2.5, 3.0, 2.0)
    below, above = program_track.azimuth_travel(ProgramTrack(times, angles), 1.0)
    assert above == pytest.approx(0.5)
    assert below == pytest.approx(2.0 - (2 * math.pi - 3.0))


@pytest.mark.parametrize('times, angles, words', [
    ([0.0], [[0, 0]], '1 rows'),
    ([0.0, 1.0], [[0, 0]], 'shape (2,), angles (1, 2)'),
    ([0.0, math.nan], [[0, 0], [1, 0]], 'row 1'),
    ([0.0, 1.0], [[0, math.inf], [1, 0]], 'row 0'),
    ([0.0, 2.0, 2.0], [[0, 0]] * 3, 'row 2: time 2 s; must be after 2'),
    ([0.0, 2.0], [[0, 0], [0, 1.6]], 'row 1: elevation 91.6732 deg'),
])
def test_bad_tables_are_named(times, angles, words):
    with pytest.raises(program_track.ProgramTrackError) as error:
        program_track.checked(times, angles)
    assert words in str(error.value) and '\n' not in str(error.value)


@pytest.mark.parametrize('E0_deg', [89.99, 88.0, 84.0])
def test_a_pass_through_the_zenith_is_interpolated_as_a_direction(E0_deg):
    """A great circle of 0.87 deg/s in rows of 1 s: place, rate and acceleration of its unit vector."""
    E0, W = math.radians(E0_deg), math.radians(0.87)

    def motion(t):
        s = W * (t - 20.3)
        u = np.array([math.sin(s), math.cos(s) * math.cos(E0), math.cos(s) * math.sin(E0)])
        du = W * np.array([math.cos(s), -math.sin(s) * math.cos(E0), -math.sin(s) * math.sin(E0)])
        return np.array([*u, *du])
    times = np.arange(41.0)
    program = ProgramTrack(times, np.array([(math.atan2(u[0], u[1]), math.asin(u[2])) for u in map(motion, times)]))
    for t in np.arange(5.0, 36.0, 0.37):
        got = line_of_sight(program_track.motion_at(program, t))
        np.testing.assert_allclose([*got.u, *got.du], motion(t), atol=4e-5)
        np.testing.assert_allclose(program_track.direction(program, t), motion(t)[:3], atol=2e-5)
