"""The tilted frame and the bridge against scipy's rotations and differences."""
import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from acu_tracker.geometry import deck_reference, estimate_frame
from acu_tracker.program import bridge, program_track


def tilted():
    """A frame on the way of a target near the zenith, and that target's direction and rate."""
    motion = deck_reference.moving_direction(0.4, 0.05, 0.0, 1.35, 0.01, 0.0)
    frame = np.zeros(1, estimate_frame.FRAME)
    estimate_frame.tilt(frame[0], *motion[:6])
    return frame[0], np.array(motion)


def test_the_target_runs_along_the_equator():
    frame, motion = tilted()
    np.testing.assert_allclose(frame['mat'] @ frame['mat'].T, np.eye(3), atol=1e-15)
    assert np.linalg.det(frame['mat']) == pytest.approx(1.0)
    A, dA, _, E, dE, _ = estimate_frame.moving_in_frame(frame, *motion)
    assert (A, E, dE) == pytest.approx((0.0, 0.0, 0.0), abs=1e-15) and dA == pytest.approx(np.linalg.norm(motion[3:6]))
    assert estimate_frame.measured(frame, 0.4, 1.35) == pytest.approx((0.0, 0.0), abs=1e-15)


def test_there_and_back():
    frame, motion = tilted()
    angles = (0.3, 0.02, 0.001, -0.2, 0.01, -0.002)
    np.testing.assert_allclose(estimate_frame.moving_in_frame(frame, *estimate_frame.moving_in_earth(frame, *angles)),
                               angles, atol=1e-15)
    still = np.zeros(1, estimate_frame.FRAME)
    for e, n, u in ((0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.1, 0.2, 0.974)):
        estimate_frame.tilt(still[0], e, n, u, 0.0, 0.0, 0.0)
        assert np.isfinite(still['mat']).all()
    np.testing.assert_allclose(estimate_frame.moving_in_frame(frame, *motion)[:1], 0.0, atol=1e-15)


def test_variances_turn_with_the_frame():
    """Against samples: directions scattered in the frame, their spread in earth angles."""
    frame, _ = tilted()
    rng = np.random.default_rng(5)
    sigma = 1e-4, 3e-4
    A, E = 0.05 + sigma[0] * rng.normal(size=4000), 0.02 + sigma[1] * rng.normal(size=4000)
    seen = np.column_stack((np.cos(E) * np.sin(A), np.cos(E) * np.cos(A), np.sin(E))) @ frame['mat'].T
    azimuth, elevation = np.arctan2(seen[:, 0], seen[:, 1]), np.arcsin(seen[:, 2])
    told = estimate_frame.earth_variances(frame, 0.05, 0.02, azimuth.mean(), elevation.mean(), sigma[0]**2,
                                          sigma[1]**2)
    np.testing.assert_allclose(told, [azimuth.var(), elevation.var()], rtol=0.1)


def test_the_bridge_is_the_program_turned_to_the_target():
    times = np.arange(0.0, 40.0)
    table = np.column_stack((0.5 + 0.03 * times, 0.4 + 0.01 * times))
    seen = np.array([math.cos(0.515) * math.sin(0.83), math.cos(0.515) * math.cos(0.83), math.sin(0.515)])
    b = np.zeros(1, bridge.BRIDGE)
    bridge.begin(b[0], times, table, 10.0, *seen)
    assert b['there'][0] == 1
    was = np.array(program_track.direction(times, table, 10.0))
    turn = Rotation.align_vectors([seen], [was])[0]
    assert turn.magnitude() == pytest.approx(math.acos(was @ seen), rel=1e-9)
    h = 1e-3
    A, E = np.array([(math.atan2(v[0], v[1]), math.asin(v[2])) for v in
                     (turn.apply(program_track.direction(times, table, 17.5 + d)) for d in (-h, 0.0, h))]).T
    got = bridge.outlook(b[0], times, table, 17.5)
    for x, (angle, rate, acceleration) in ((A, got[:3]), (E, got[3:])):
        assert angle == pytest.approx(x[1], abs=1e-12)
        assert rate == pytest.approx((x[2] - x[0]) / (2 * h), abs=1e-8)
        assert acceleration == pytest.approx((x[2] - 2 * x[1] + x[0]) / h**2, abs=1e-6)
    bridge.begin(b[0], times, table, 10.0, 0.0, 0.0, 1.0)
    assert b['there'][0] == 0
    bridge.begin(b[0], times, table, 50.0, *seen)
    assert b['there'][0] == 0
