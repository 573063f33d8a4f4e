"""The alignment law piece by piece, against a batch solution, scipy and closed forms."""
import math

import numpy as np
import pytest
from scipy import linalg
from scipy.spatial.transform import Rotation

from pedestal_common.geometry.quaternion import product
from ship_motion_sim import alignment, strapdown
from ship_motion_sim.params import AlignmentParameters

H, LATITUDE = 0.02, math.radians(34.0)
K = alignment.conditions(AlignmentParameters(), LATITUDE)


def test_riccati_limit_is_the_posterior_of_all_measurements_at_once():
    """Batch: the trajectory's prior covariance and all measurements solved in one go."""
    n, r, h = 20, 0.05**2, 0.2
    q = (float(K['gravity']) * float(K['gyro_noise']))**2 * h
    F = np.array([[1.0, h, 0.5 * h * h], [0.0, 1.0, h], [0.0, 0.0, 1.0]])
    state = alignment.Observer.zeros()
    alignment.start(state[0], K, math.radians(5.0), 2.0)
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
        alignment.advance_covariance(state[0], k, h)
    np.testing.assert_allclose(p, [batch[0, 0], batch[0, 1], batch[0, 2], batch[1, 1], batch[1, 2], batch[2, 2]],
                               rtol=1e-6)


def test_both_channels_push_their_tilt_out():
    """The paper's equation (11) as printed makes the east channel run away: signs of both, one linear step."""
    o, command = alignment.Observer.zeros(), np.zeros(3)
    o[0]['z'][:, 1] = 0.1       # both accelerate upwards of zero
    alignment.level(o[0], K, np.zeros(2), np.zeros(2), 1.0, command)
    assert (o[0]['input'] < 0.0).all() and command[0] < 0.0 < command[1]
    np.testing.assert_allclose(o[0]['input'], [-9.795 * command[1], 9.795 * command[0]], rtol=1e-3)
    o[0]['z'][:, 1] = 100.0
    alignment.level(o[0], K, np.zeros(2), np.zeros(2), 1.0, command)
    np.testing.assert_allclose(np.abs(command[:2]), alignment.MAX_LEVELLING_RATE_RAD_S)
    np.testing.assert_allclose(np.abs(o[0]['input']), float(K['gravity']) * alignment.MAX_LEVELLING_RATE_RAD_S)


def test_the_differentiator_is_at_its_reference_after_two_steps():
    v1 = v2 = 0.0
    for _ in range(2):
        v1, v2 = alignment.differentiated(v1, v2, 1e-3, H)
    v1, v2 = alignment.differentiated(v1, v2, 1e-3, H)
    assert v1 == pytest.approx(1e-3, rel=1e-9) and abs(v2) < 1e-12


def test_quaternion_helpers_against_scipy():
    a, b = Rotation.from_rotvec([0.3, -0.4, 1.1]), Rotation.from_rotvec([-0.2, 0.5, 0.1])
    np.testing.assert_allclose(np.abs(product(a.as_quat(), b.as_quat())), np.abs((a * b).as_quat()),
                               atol=1e-15)
    for size in (0.0, 1e-6, 1e-3, 2.0):
        np.testing.assert_allclose(strapdown.from_rotvec(0.6 * size, 0.0, 0.8 * size),
                                   Rotation.from_rotvec([0.6 * size, 0.0, 0.8 * size]).as_quat(), atol=1e-15)
