"""The frame of the filter and the bridge against scipy's rotations and differences."""
import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from acu_tracker.estimation.filters import axis_filter, target_filter, unscented
from acu_tracker.estimation.filters.measurement import AxisMeasurement, Measurement
from acu_tracker.estimation.params import FilterParameters, UkfParameters
from acu_tracker.geometry import frames
from acu_tracker.geometry.vector import (
    ZERO_VECTOR,
    AxisMotion,
    Motion,
    Vector,
    earth_angles,
    line_of_sight,
    rotated,
    rotation,
    transposed,
    turned,
)
from acu_tracker.program import bridge, program_track
from acu_tracker.program.program_track import ProgramTrack


def laid():
    """A frame on the way of a target near the zenith, and the LineOfSight of that target."""
    sight = line_of_sight(Motion(AxisMotion(0.4, 0.05, 0.0), AxisMotion(1.35, 0.01, 0.0)))
    frame = frames.Frame.zeros()
    frames.lay(frame[0], sight.u, sight.du)
    return frame[0], sight


def to_frame(frame, sight):
    """The Motion in a frame of a LineOfSight in ENU."""
    return earth_angles(turned(transposed(rotation(frame['mat'])), sight))


def standing(A, E):
    """The Motion of a target that stands."""
    return Motion(AxisMotion(A, 0.0, 0.0), AxisMotion(E, 0.0, 0.0))


def test_the_target_runs_along_the_equator():
    frame, sight = laid()
    np.testing.assert_allclose(frame['mat'] @ frame['mat'].T, np.eye(3), atol=1e-15)
    assert np.linalg.det(frame['mat']) == pytest.approx(1.0)
    (A, dA, _), (E, dE, _) = to_frame(frame, sight)
    assert (A, E, dE) == pytest.approx((0.0, 0.0, 0.0), abs=1e-15) and dA == pytest.approx(np.linalg.norm(sight.du))
    assert frames.direction_to_frame(frame, 0.4, 1.35) == pytest.approx((0.0, 0.0), abs=1e-15)


def test_there_and_back():
    frame, sight = laid()
    motion = Motion(AxisMotion(0.3, 0.02, 0.001), AxisMotion(-0.2, 0.01, -0.002))
    np.testing.assert_allclose(to_frame(frame, frames.to_earth(frame, motion)), motion, atol=1e-15)
    still = frames.Frame.zeros()
    for e, n, u in ((0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.1, 0.2, 0.974)):
        frames.lay(still[0], Vector(e, n, u), ZERO_VECTOR)
        np.testing.assert_allclose(still['mat'][0] @ still['mat'][0].T, np.eye(3), atol=2e-3)
        assert still['mat'][0, 2, 0] == 0.0     # Azimuth grows horizontally.
    np.testing.assert_allclose(to_frame(frame, sight).azimuth.angle, 0.0, atol=1e-15)


def test_variances_turn_with_the_frame():
    """Against samples: directions scattered in the frame, their spread in earth angles."""
    frame, _ = laid()
    rng = np.random.default_rng(5)
    sigma = 1e-4, 3e-4
    A, E = 0.05 + sigma[0] * rng.normal(size=4000), 0.02 + sigma[1] * rng.normal(size=4000)
    framed = np.column_stack((np.cos(E) * np.sin(A), np.cos(E) * np.cos(A), np.sin(E))) @ frame['mat'].T
    azimuth, elevation = np.arctan2(framed[:, 0], framed[:, 1]), np.arcsin(framed[:, 2])
    shares = frames.earth_shares(frame, standing(0.05, 0.02), standing(azimuth.mean(), elevation.mean()))
    np.testing.assert_allclose(np.array(shares) @ np.square(sigma), [azimuth.var(), elevation.var()], rtol=0.1)


def test_a_filter_turns_with_its_frame():
    """The direction, its rate, and the variances in earth angles are the same in both frames, but for the part of the
    variances that a turn by 60 deg in the plane of the sky mixes; scipy turns the Cartesian covariance."""
    before, after = laid()[0], frames.Frame.zeros()[0]
    motion = Motion(AxisMotion(0.2, 0.01, 0.0), AxisMotion(0.35, -0.02, 0.0))
    sight = frames.to_earth(before, motion)
    frames.lay(after, sight.u, sight.du)
    turn = frames.from_earth(after, rotation(before['mat']))
    np.testing.assert_allclose(np.array(turn), after['mat'].T @ before['mat'], atol=1e-15)

    params = FilterParameters(kind='ca')
    c = target_filter.constants(UkfParameters(), (params, params), 0.0)[0]
    f = target_filter.Filter.zeros()[0]
    axis = [AxisMeasurement(m.angle, variance, math.nan, math.nan) for m, variance in zip(motion, (4e-8, 1e-8))]
    target_filter.start(f, c, Measurement(0.0, tuple(axis), math.nan, math.nan), 0.1)
    for i in range(2):
        f['axis'][i]['x'][0] = motion[i]
        axis_filter.join(f['axis'][i])
    target_filter.predict(f, c, 0.0)
    unscented.start(f['cartesian'], c['cartesian'], target_filter.read_axes(f), 1000.0, 1.0)
    cartesian = f['cartesian']['p'].copy()
    f['running'] = 1
    target_filter.turn(f, c, turn)
    R = np.kron(np.eye(3), np.array(turn))
    np.testing.assert_allclose(f['cartesian']['p'], R @ cartesian @ R.T, atol=1e-12 * np.abs(cartesian).max())

    target_filter.predict(f, c, 0.0)
    turned = target_filter.read_axes(f)
    np.testing.assert_allclose(np.ravel(frames.to_earth(after, turned.motion)), np.ravel(sight), atol=1e-14)
    # Against samples of the errors in both old axes, projected on both new axes.
    a, b = np.random.default_rng(3).normal(size=(2, 20_000)) * [[2e-4 * math.cos(0.35)], [1e-4]]
    across, up = (rotated(turn, v) for v in (
        Vector(math.cos(0.2), -math.sin(0.2), 0.0),
        Vector(-math.sin(0.35) * math.sin(0.2), -math.sin(0.35) * math.cos(0.2), math.cos(0.35))))
    expected = np.var(a * across.x + b * up.x), np.var(a * across.z + b * up.z)
    np.testing.assert_allclose([v.p11 for v in turned.variances], expected, rtol=0.03)


@pytest.mark.parametrize('degrees', [0.0, 30.0, 90.0])
def test_the_probabilities_of_the_models_turn_with_the_frame(degrees):
    """About a line of sight to the north: after 90 deg each axis has the models of the other one."""
    c = target_filter.constants(UkfParameters(), (FilterParameters(), FilterParameters()), 0.0)[0]
    f = target_filter.Filter.zeros()[0]
    axis = AxisMeasurement(0.0, 1e-8, math.nan, math.nan)
    target_filter.start(f, c, Measurement(0.0, (axis, axis), math.nan, math.nan), 0.1)
    before = np.random.default_rng(1).dirichlet(np.ones(f['axis'][0]['count']), 2)
    for i in range(2):
        f['axis'][i]['mu'][:before.shape[1]] = before[i]
    matrix = Rotation.from_rotvec([0.0, math.radians(degrees), 0.0]).as_matrix()
    target_filter.turn(f, c, rotation(matrix))
    share = math.cos(math.radians(degrees))**2
    np.testing.assert_allclose(f['axis']['mu'][:, :before.shape[1]], share * before + (1.0 - share) * before[::-1],
                               atol=1e-12)


def test_the_bridge_is_the_program_turned_to_the_target():
    times = np.arange(0.0, 40.0)
    program = ProgramTrack(times, np.column_stack((0.5 + 0.03 * times, 0.4 + 0.01 * times)))
    estimated = np.array([math.cos(0.515) * math.sin(0.83), math.cos(0.515) * math.cos(0.83), math.sin(0.515)])
    b = bridge.Bridge.zeros()
    bridge.begin(b[0], program, 10.0, Vector(*estimated))
    assert b['valid'][0] == 1
    was = np.array(program_track.direction(program, 10.0))
    turn = Rotation.align_vectors([estimated], [was])[0]
    assert turn.magnitude() == pytest.approx(math.acos(was @ estimated), rel=1e-9)
    h = 1e-3
    A, E = np.array([(math.atan2(v[0], v[1]), math.asin(v[2])) for v in
                     (turn.apply(program_track.direction(program, 17.5 + d)) for d in (-h, 0.0, h))]).T
    got = bridge.motion_at(bridge.way(b[0], program), 17.5)
    for x, (angle, rate, acceleration) in zip((A, E), got):
        assert angle == pytest.approx(x[1], abs=1e-12)
        assert rate == pytest.approx((x[2] - x[0]) / (2 * h), abs=1e-8)
        assert acceleration == pytest.approx((x[2] - 2 * x[1] + x[0]) / h**2, abs=1e-6)
    bridge.clear(b[0])
    assert bridge.motion_at(bridge.way(b[0], program), 17.5) == program_track.motion_at(program, 17.5)
    bridge.begin(b[0], program, 10.0, Vector(0.0, 0.0, 1.0))
    assert b['valid'][0] == 0
    bridge.begin(b[0], program, 50.0, Vector(*estimated))
    assert b['valid'][0] == 0
