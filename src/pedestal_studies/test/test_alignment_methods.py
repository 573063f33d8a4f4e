"""The methods of alignment of Zhou 2011 piece by piece, against Monte Carlo, scipy and closed forms."""
import itertools
import math

import numpy as np
import pytest
from scipy import integrate, linalg
from scipy.spatial.transform import Rotation

from pedestal_common import parameters
from pedestal_studies.p001_zhou_yang_qin import adrc, classical, methods, oba
from pedestal_studies.p001_zhou_yang_qin.adrc import AdrcParameters
from pedestal_studies.p001_zhou_yang_qin.methods import MethodParameters
from ship_motion_sim import alignment
from ship_motion_sim.params import AlignmentParameters

H, LATITUDE = 0.02, math.radians(34.0)
K = alignment.conditions(AlignmentParameters(), LATITUDE)


def test_observer_poles_are_where_the_gains_put_them():
    w_o, h = 2.0, 0.05
    l1, l2, l3 = adrc.gains(w_o, h)
    F = np.array([[1.0, h, 0.5 * h * h], [0.0, 1.0, h], [0.0, 0.0, 1.0]])
    poles = np.linalg.eigvals((np.eye(3) - np.outer([l1, l2, l3], [1.0, 0.0, 0.0])) @ F)
    np.testing.assert_allclose(poles, math.exp(-w_o * h), atol=2e-5)       # a triple root, so the cube root of eps


def test_the_scheduled_covariance_is_what_its_gains_leave():
    """Monte Carlo of the observer's error with the gains of adrc_scheduled."""
    runs, seconds = 4000, 20.0
    random = np.random.default_rng(1)
    state = alignment.Observer.zeros()
    alignment.start(state[0], K, math.radians(5.0), 2.0)
    p, r = state[0]['p'], float(K['velocity_density']) / H
    e = random.standard_normal((3, runs)) * np.sqrt([[p[0]], [p[3]], [p[5]]])
    q = float(K['gravity']) * float(K['gyro_noise']) * math.sqrt(H)
    for n in range(1, round(seconds / H) + 1):
        gains = adrc.gains(adrc.bandwidth(n * H), H)
        e[0], e[1] = e[0] + H * e[1] + 0.5 * H * H * e[2], e[1] + H * e[2] + q * random.standard_normal(runs)
        innovation = e[0] + math.sqrt(r) * random.standard_normal(runs)
        e -= np.outer(gains, innovation)
        alignment.predict_covariance(state[0], K, H)
        alignment.correct_covariance(state[0], *gains, r)
    np.testing.assert_allclose(e.var(axis=1), [p[0], p[3], p[5]], rtol=0.1)     # 4000 runs: 2.2 %


def test_slope_is_the_least_squares_line_through_the_integral():
    x = np.random.default_rng(2).standard_normal(50)
    first = second = 0.0
    n = 0
    for value in x:
        first, second, n = adrc.added(first, second, n, value)
    line = np.polyfit(np.arange(51), np.concatenate(([0.0], np.cumsum(x))), 1)
    assert adrc.slope(first, second, n) == pytest.approx(line[0], rel=1e-12)


def test_steady_covariance_against_scipy():
    A = np.array([[0.9, 0.1], [-0.2, 0.7]])
    Q = np.array([[1.0, 0.3], [0.3, 2.0]])
    np.testing.assert_allclose(classical.steady_covariance(A, Q), linalg.solve_discrete_lyapunov(A, Q), rtol=1e-12)


def test_classical_poles():
    s0 = 0.025
    c = classical.constants(K, s0, H)
    g, w = float(K['gravity']), float(K['earth_rate'][1])
    A = np.array([[-c['K1'], g, 0.0, 0.0], [-c['k2'], 0.0, 0.0, -w], [1.0, 0.0, -c['K4'], 0.0],
                  [0.0, 0.0, c['K3'] / w, 0.0]])
    np.testing.assert_allclose(np.poly(A), np.polymul([1, 2 * s0, 2 * s0**2], [1, 2 * s0, 2 * s0**2]), rtol=1e-9)


def test_classical_from_180_deg_against_its_equations():
    """The method, noise-free on a deck at rest that lies along ENU, against solve_ivp: error of azimuth [rad]."""
    dt = 0.0025         # the steps are those of Euler: at 0.02 s they are 2.2 deg off
    constants = methods.constants(MethodParameters(AlignmentParameters(step=dt)), 'classical', LATITUDE)
    start = Rotation.from_euler('zxy', -np.radians([180.0, 3.0, 3.0]))
    state, k = methods.initial_state(constants, start.as_quat()), constants[0]['conditions']
    earth_rate, gravity = np.array(k['earth_rate']), float(k['gravity'])
    angle, force, attitudes = earth_rate * dt, np.array([0.0, 0.0, gravity * dt]), []
    for _ in range(20):
        for _ in range(round(10.0 / dt)):
            methods.step(state[0], constants[0], angle, force, dt)
        attitudes.append(Rotation.from_quat(methods.attitude(state[0], constants[0])).as_matrix())
    c = constants[0]['classical']

    def slope_of(_, y):
        turned, east, north, turning = Rotation.from_quat(y[:4]), y[4], y[5], y[6]
        command = np.array([-c['k2'] * north, c['k2'] * east,
                            np.clip(c['K3'] / earth_rate[1] * turning, -classical.MAX_AZIMUTH_RATE_RAD_S,
                                    classical.MAX_AZIMUTH_RATE_RAD_S)])
        rate = turned.apply(earth_rate) - earth_rate - command      # of n' against n, in n'
        x, y_, z, w = y[:4]
        wx, wy, wz = rate
        f = turned.apply([0.0, 0.0, gravity]) - np.cross(2.0 * earth_rate, [east, north, 0.0])
        return np.array([w * wx + wy * z - wz * y_, w * wy + wz * x - wx * z, w * wz + wx * y_ - wy * x,
                         -wx * x - wy * y_ - wz * z, 0.0, 0.0, 0.0]) * 0.5 + np.array(
            [0.0, 0.0, 0.0, 0.0, f[0] - c['K1'] * east, f[1] - c['K1'] * north, north - c['K4'] * turning])

    exact = integrate.solve_ivp(slope_of, (0.0, 200.0), [*start.as_quat(), 0.0, 0.0, 0.0], rtol=1e-8, atol=1e-10,
                                max_step=0.5, t_eval=10.0 * np.arange(1, 21))
    azimuth = [math.atan2(-m[1, 0], m[1, 1]) for m in attitudes]
    expected = [math.atan2(-m[1, 0], m[1, 1]) for m in Rotation.from_quat(exact.y[:4].T).as_matrix()]
    error = np.array(azimuth) - expected
    assert np.abs(np.arctan2(np.sin(error), np.cos(error))).max() < math.radians(1.0)


def test_gravity_in_the_frame_of_the_start_against_a_sum():
    axis, t, n = np.array(K['earth_rate']), 500.0, 2000
    times = (np.arange(n) + 0.5) * t / n
    felt = Rotation.from_rotvec(np.outer(times, axis)).apply([0.0, 0.0, float(K['gravity'])])
    np.testing.assert_allclose(oba.gravity_integral(t, K), felt.sum(axis=0) * t / n, rtol=1e-7, atol=1e-5)


def test_the_solution_is_the_rotation_and_agrees_with_kabsch():
    random = np.random.default_rng(3)
    turn = Rotation.from_euler('xyz', [0.1, -0.2, 2.9])
    s = oba.State.zeros()
    k, start = K.copy(), np.array([0.3, -0.2, 0.1])
    a, b = [], []
    for n in range(1, 400):
        b.append(np.array(oba.gravity_integral(n * 0.5, k)))
        a.append(turn.inv().apply(b[-1]) + start + 0.05 * random.standard_normal(3))
        oba.step(s[0], k, tuple(map(float, a[-1])), 0.5)
    ours = Rotation.from_quat(oba.solve(s[0]))
    a, b = np.array(a), np.array(b)
    kabsch, _ = Rotation.align_vectors(b - b.mean(axis=0), a - a.mean(axis=0))
    assert (ours * kabsch.inv()).magnitude() < 1e-7
    assert (ours * turn.inv()).magnitude() < 0.02


def test_a_level_control_that_would_be_unstable_is_named():
    with pytest.raises(parameters.ParameterError, match='adrc.control = 20 rad/s: must be at most 1 / step = 10'):
        parameters.build(MethodParameters, {'alignment.step': 0.1, 'adrc.control': 20.0})


@pytest.mark.parametrize('step', [0.001, 0.02, 0.1, 1.0])
def test_what_is_allowed_is_stable(step):
    for observer, control, s0 in itertools.product((0.01, 0.3, 20.0), (0.01, 20.0), (0.005, 0.2)):
        p = MethodParameters(AlignmentParameters(step=step), s0, AdrcParameters(observer, min(control, 1.0 / step)))
        c = methods.constants(p, 'adrc', 0.8)[0]
        sigmas = [float(c[name][field]) for name, field in (
            ('adrc', 'level'), ('adrc', 'velocity_variance'), ('classical', 'level_sigma'),
            ('classical', 'azimuth_sigma'))]
        assert all(0.0 < sigma < 10.0 for sigma in sigmas), (p, sigmas)


def test_a_gyrocompass_that_dwells_at_180_deg_is_not_aligned():
    """An unstable equilibrium: this azimuth, on a deck without motion, with sensors without errors, stays there."""
    dt = 0.02
    for azimuth, dwells in ((180.0, True), (60.0, False)):
        constants = methods.constants(MethodParameters(), 'classical', LATITUDE)
        k = constants[0]['conditions']
        angle, force = np.array(k['earth_rate']) * dt, np.array([0.0, 0.0, float(k['gravity']) * dt])
        state = methods.initial_state(constants, Rotation.from_euler('z', -azimuth, degrees=True).as_quat())
        for _ in range(round(420.0 / dt)):
            methods.step(state[0], constants[0], angle, force, dt)
        error = Rotation.from_quat(methods.attitude(state[0], constants[0])).magnitude()
        assert (state['azimuth_sigma'][0] > 3.0) == dwells
        assert error > 2.9 if dwells else error < 1e-3


def test_the_azimuth_from_the_slope_of_a_quiet_gyro_is_as_good_as_the_velocity_allows():
    """Exact: the slope as a linear function of the velocity at each step, by summation in place of the closed form."""
    window, n, variance = 40.0, 4000, 0.03**2
    constants, quiet = adrc.Constants.zeros(), K.copy()
    constants['velocity_variance'], quiet['gyro_noise'], quiet['gyro_bias'] = variance, 0.0, 0.0
    t = (np.arange(n) + 0.5) * window / n
    parabola = 6.0 * t * (window - t) / window**3               # weights of the commands in the slope of the angle
    at_ends = np.array([parabola[1] - parabola[0], parabola[-2] - parabola[-1]]) / (window / n)
    sigma = math.sqrt(variance * np.sum(at_ends**2)) / float(K['gravity']) / float(K['earth_rate'][1])
    observer = alignment.Observer.zeros()
    observer['innovation_ratio'] = 1.0
    assert adrc.azimuth_sigma(constants[0], quiet, observer[0], window) == pytest.approx(sigma, rel=1e-3)
