"""The alignment laws piece by piece, against batch solutions, Monte Carlo, scipy and closed forms."""
import math

import numpy as np
import pytest
from scipy import integrate, linalg
from scipy.spatial.transform import Rotation

from pedestal_common.geometry.quaternion import product
from ship_motion_sim import strapdown
from ship_motion_sim.alignment import (
    adrc,
    adrc_scheduled,
    classical,
    extended_observer,
    levelling,
    oba,
    riccati_eso,
    slope,
    steady_state,
)
from ship_motion_sim.alignment.conditions import conditions
from ship_motion_sim.navigation import navigator
from ship_motion_sim.params import AlignmentParameters

H, LATITUDE = 0.02, math.radians(34.0)
K = conditions(AlignmentParameters(), LATITUDE)


def test_observer_poles_are_where_the_gains_put_them():
    w_o, h = 2.0, 0.05
    l1, l2, l3 = extended_observer.gains(w_o, h)
    F = np.array([[1.0, h, 0.5 * h * h], [0.0, 1.0, h], [0.0, 0.0, 1.0]])
    poles = np.linalg.eigvals((np.eye(3) - np.outer([l1, l2, l3], [1.0, 0.0, 0.0])) @ F)
    np.testing.assert_allclose(poles, math.exp(-w_o * h), atol=2e-5)       # a triple root, so the cube root of eps


def test_riccati_limit_is_the_posterior_of_all_measurements_at_once():
    """Batch: the trajectory's prior covariance and all measurements solved in one go."""
    n, r, h = 20, 0.05**2, 0.2
    q = (float(K['gravity']) * float(K['gyro_noise']))**2 * h
    F = np.array([[1.0, h, 0.5 * h * h], [0.0, 1.0, h], [0.0, 0.0, 1.0]])
    state = extended_observer.State.zeros()
    extended_observer.start(state[0], K, math.radians(5.0), 2.0)
    p = state[0]['p']
    P0 = np.diag([p[0], p[3], p[5]])
    powers = [np.linalg.matrix_power(F, i) for i in range(n + 1)]
    # x_n and each y_k as linear functions of x_0 and the walk's steps
    to_y = np.array([[*powers[k][0], *(powers[k - j][0, 1] if j <= k else 0.0 for j in range(1, n + 1))]
                     for k in range(1, n + 1)])
    to_x = np.hstack([powers[n]] + [powers[n - j][:, 1:2] for j in range(1, n + 1)])
    prior = linalg.block_diag(P0, q * np.eye(n))
    S = to_y @ prior @ to_y.T + r * np.eye(n)
    gain = to_x @ prior @ to_y.T @ np.linalg.inv(S)
    batch = to_x @ prior @ to_x.T - gain @ to_y @ prior @ to_x.T
    k = K.copy()
    k['velocity_density'] = r * h
    for _ in range(n):
        riccati_eso.advance_covariance(state[0], k, h)
    np.testing.assert_allclose(p, [batch[0, 0], batch[0, 1], batch[0, 2], batch[1, 1], batch[1, 2], batch[2, 2]],
                               rtol=1e-6)


def test_the_scheduled_covariance_is_what_its_gains_leave():
    """Monte Carlo of the observer's error with the gains of adrc_scheduled."""
    runs, seconds = 4000, 20.0
    random = np.random.default_rng(1)
    state = extended_observer.State.zeros()
    extended_observer.start(state[0], K, math.radians(5.0), 2.0)
    p, r = state[0]['p'], float(K['velocity_density']) / H
    e = random.standard_normal((3, runs)) * np.sqrt([[p[0]], [p[3]], [p[5]]])
    q = float(K['gravity']) * float(K['gyro_noise']) * math.sqrt(H)
    for n in range(1, round(seconds / H) + 1):
        gains = extended_observer.gains(adrc_scheduled.bandwidth(n * H), H)
        e[0], e[1] = e[0] + H * e[1] + 0.5 * H * H * e[2], e[1] + H * e[2] + q * random.standard_normal(runs)
        innovation = e[0] + math.sqrt(r) * random.standard_normal(runs)
        e -= np.outer(gains, innovation)
        extended_observer.predict_covariance(state[0], K, H)
        extended_observer.correct_covariance(state[0], *gains, r)
    np.testing.assert_allclose(e.var(axis=1), [p[0], p[3], p[5]], rtol=0.1)     # 4000 runs: 2.2 %


def test_slope_is_the_least_squares_line_through_the_integral():
    x = np.random.default_rng(2).standard_normal(50)
    first = second = 0.0
    n = 0
    for value in x:
        first, second, n = slope.added(first, second, n, value)
    line = np.polyfit(np.arange(51), np.concatenate(([0.0], np.cumsum(x))), 1)
    assert slope.slope(first, second, n) == pytest.approx(line[0], rel=1e-12)


def test_steady_covariance_against_scipy():
    A = np.array([[0.9, 0.1], [-0.2, 0.7]])
    Q = np.array([[1.0, 0.3], [0.3, 2.0]])
    np.testing.assert_allclose(steady_state.covariance(A, Q), linalg.solve_discrete_lyapunov(A, Q), rtol=1e-12)


def test_both_channels_push_their_tilt_out():
    """The paper's equation (11) as printed makes the east channel run away: signs of both, one linear step."""
    o, command = extended_observer.State.zeros(), np.zeros(3)
    o[0]['z'][:, 1] = 0.1       # both accelerate upwards of zero
    levelling.level(o[0], K, np.zeros(2), np.zeros(2), 1.0, command)
    assert (o[0]['input'] < 0.0).all() and command[0] < 0.0 < command[1]
    np.testing.assert_allclose(o[0]['input'], [-9.795 * command[1], 9.795 * command[0]], rtol=1e-3)
    o[0]['z'][:, 1] = 100.0
    levelling.level(o[0], K, np.zeros(2), np.zeros(2), 1.0, command)
    np.testing.assert_allclose(np.abs(command[:2]), levelling.MAX_LEVELLING_RATE_RAD_S)
    np.testing.assert_allclose(np.abs(o[0]['input']), float(K['gravity']) * levelling.MAX_LEVELLING_RATE_RAD_S)


def test_the_differentiator_is_at_its_reference_after_two_steps():
    v1 = v2 = 0.0
    for _ in range(2):
        v1, v2 = levelling.differentiated(v1, v2, 1e-3, H)
    v1, v2 = levelling.differentiated(v1, v2, 1e-3, H)
    assert v1 == pytest.approx(1e-3, rel=1e-9) and abs(v2) < 1e-12


def test_classical_poles():
    s0 = 0.025
    c = classical.constants(K, s0, H)
    g, w = float(K['gravity']), float(K['earth_rate'][1])
    A = np.array([[-c['K1'], g, 0.0, 0.0], [-c['k2'], 0.0, 0.0, -w], [1.0, 0.0, -c['K4'], 0.0],
                  [0.0, 0.0, c['K3'] / w, 0.0]])
    np.testing.assert_allclose(np.poly(A), np.polymul([1, 2 * s0, 2 * s0**2], [1, 2 * s0, 2 * s0**2]), rtol=1e-9)


def test_classical_from_180_deg_against_its_equations():
    """The navigator, noise-free on a deck at rest that lies along ENU, against solve_ivp: error of azimuth [rad]."""
    dt = 0.0025         # the steps are those of Euler: at 0.02 s they are 2.2 deg off
    constants = navigator.constants(AlignmentParameters(step=dt), 'classical', 'none', LATITUDE)
    start = Rotation.from_euler('zxy', -np.radians([180.0, 3.0, 3.0]))
    state, k = navigator.initial_state(constants, start.as_quat()), constants[0]['conditions']
    earth_rate, gravity = np.array(k['earth_rate']), float(k['gravity'])
    angle, force, attitudes = earth_rate * dt, np.array([0.0, 0.0, gravity * dt]), []
    for _ in range(20):
        for _ in range(round(10.0 / dt)):
            navigator.step(state[0], constants[0], angle, force, dt, np.zeros(3))
        attitudes.append(Rotation.from_quat(navigator.attitude(state[0], constants[0])).as_matrix())
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
        oba.step(s[0], k, tuple(map(float, a[-1])), (0.0, 0.0, 0.0), 0.5)
    ours = Rotation.from_quat(oba.solve(s[0]))
    a, b = np.array(a), np.array(b)
    kabsch, _ = Rotation.align_vectors(b - b.mean(axis=0), a - a.mean(axis=0))
    assert (ours * kabsch.inv()).magnitude() < 1e-7
    assert (ours * turn.inv()).magnitude() < 0.02


def test_quaternion_helpers_against_scipy():
    a, b = Rotation.from_rotvec([0.3, -0.4, 1.1]), Rotation.from_rotvec([-0.2, 0.5, 0.1])
    np.testing.assert_allclose(np.abs(product(a.as_quat(), b.as_quat())), np.abs((a * b).as_quat()),
                               atol=1e-15)
    for size in (0.0, 1e-6, 1e-3, 2.0):
        np.testing.assert_allclose(strapdown.from_rotvec(0.6 * size, 0.0, 0.8 * size),
                                   Rotation.from_rotvec([0.6 * size, 0.0, 0.8 * size]).as_quat(), atol=1e-15)


def test_the_azimuth_from_the_slope_of_a_quiet_gyro_is_as_good_as_the_velocity_allows():
    """Exact: the slope as a linear function of the velocity at each step, by summation in place of the closed form."""
    window, n, variance = 40.0, 4000, 0.03**2
    constants, quiet = adrc.Constants.zeros(), K.copy()
    constants['velocity_variance'], quiet['gyro_noise'], quiet['gyro_bias'] = variance, 0.0, 0.0
    t = (np.arange(n) + 0.5) * window / n
    parabola = 6.0 * t * (window - t) / window**3               # weights of the commands in the slope of the angle
    at_ends = np.array([parabola[1] - parabola[0], parabola[-2] - parabola[-1]]) / (window / n)
    sigma = math.sqrt(variance * np.sum(at_ends**2)) / float(K['gravity']) / float(K['earth_rate'][1])
    observer = extended_observer.State.zeros()
    observer['innovation_ratio'] = 1.0
    assert adrc.azimuth_sigma(constants[0], quiet, observer[0], window) == pytest.approx(sigma, rel=1e-3)
