import dataclasses
import functools
import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from ship_motion_sim import earth, imu, motion
from ship_motion_sim.params import ImuParameters, PlainParameters, ShipMotionParameters, ShipParameters

IDEAL = ImuParameters(gyro_bias_x=0.0, gyro_bias_y=0.0, gyro_bias_z=0.0, gyro_noise=0.0, accelerometer_bias_x=0.0,
                      accelerometer_bias_y=0.0, accelerometer_bias_z=0.0, accelerometer_noise=0.0)
STILL = dict(motion='plain', plain=PlainParameters(roll_amplitude_deg=0.0), speed=0.0)
NO_NOISE = np.zeros(imu.IMU_NORMALS_PER_STEP)


constants_of = functools.cache(motion.constants)
"""A spectrum of waves is cut into components anew by each call."""


def truth_at(params, t):
    truth = motion.Truth.zeros()
    motion.truth(constants_of(params.ship)[0], t, truth[0])
    return truth


def sample(params, t, dt=0.005, normals=NO_NOISE):
    inputs, outputs = imu.Inputs.zeros(), imu.Outputs.zeros()
    inputs['t'], inputs['dt'] = t, dt
    imu.step(imu.initial_state()[0], imu.constants(params)[0], constants_of(params.ship)[0], inputs[0],
             truth_at(params, t)[0], outputs[0], normals)
    return outputs[0]


@pytest.mark.parametrize('heading, x, y', [(0.0, 1.0, 0.0), (90.0, 0.0, 1.0), (180.0, -1.0, 0.0)])
def test_at_rest_it_reads_plus_g_and_the_earth_rate(heading, x, y):
    latitude = math.radians(47.0)
    out = sample(ShipMotionParameters(ShipParameters(heading_deg=heading, **STILL), IDEAL), 3.0)
    np.testing.assert_allclose(out['linear_acceleration'], [0.0, 0.0, 9.8080], atol=1e-3)
    north = 7.292115e-5 * math.cos(latitude)
    np.testing.assert_allclose(out['angular_velocity'], [north * x, north * y, 7.292115e-5 * math.sin(latitude)],
                               atol=1e-16)


def test_force_and_rate_against_a_ship_seen_from_inertial_space():
    """Position and attitude carried into a frame that does not turn with the earth, then differentiated there."""
    ship = ShipParameters(sea_state=6, wave_angle_deg=60.0, heading_deg=130.0, speed=12.0)
    params = ShipMotionParameters(ship, IDEAL)
    latitude = math.radians(47.0)
    spin, gravity = np.array(earth.rate(latitude)), earth.gravity(latitude)
    h = 0.02
    for t in (0.0, 31.0):
        grid = [truth_at(params, t + n * h)[0] for n in (-2, -1, 0, 1, 2)]
        turn = [Rotation.from_rotvec(spin * n * h) for n in (-2, -1, 0, 1, 2)]
        place = np.array([c.apply(g['position']) for c, g in zip(turn, grid, strict=True)])
        second = (-place[0] + 16 * place[1] - 30 * place[2] + 16 * place[3] - place[4]) / (12 * h * h)
        deck = Rotation.from_matrix(grid[2]['mat_ed'])
        # the centrifugal force of the tangent point is in g; that of the way from it is not
        second -= np.cross(spin, np.cross(spin, place[2]))
        out = sample(params, t)
        np.testing.assert_allclose(out['linear_acceleration'], deck.inv().apply(second + [0, 0, gravity]), atol=2e-7)
        attitude = [(deck.inv() * c * Rotation.from_matrix(g['mat_ed'])).as_rotvec()
                    for c, g in zip(turn, grid, strict=True)]
        rate = (8 * (attitude[3] - attitude[1]) - (attitude[4] - attitude[0])) / (12 * h)
        np.testing.assert_allclose(out['angular_velocity'], rate, atol=1e-7)


def test_specific_force_integrates_to_the_velocity():
    params = ShipMotionParameters(ShipParameters(heading_deg=40.0), IDEAL)
    latitude, dt = math.radians(47.0), 0.02
    spin, times = np.array(earth.rate(latitude)), np.arange(0.0, 30.0001, 0.02)
    truth = np.concatenate([truth_at(params, t) for t in times])
    force = np.array([sample(params, t)['linear_acceleration'] for t in times])
    pull = np.einsum('nij,nj->ni', truth['mat_ed'], force) - [0, 0, earth.gravity(latitude)]
    pull -= 2.0 * np.cross(spin, truth['velocity'])
    gained = dt * (pull.sum(axis=0) - 0.5 * (pull[0] + pull[-1]))
    np.testing.assert_allclose(gained, truth['velocity'][-1] - truth['velocity'][0], atol=2e-5)


@pytest.mark.parametrize('dt', [0.005, 0.02])
def test_noise_is_a_density_and_bias_is_added(dt):
    errors = ImuParameters(gyro_bias_y=0.01, gyro_noise=1e-4, accelerometer_bias_x=0.2, accelerometer_noise=3e-3)
    params, ideal = (ShipMotionParameters(ShipParameters(**STILL), e) for e in (errors, IDEAL))
    normals = np.random.default_rng(4).standard_normal((3000, imu.IMU_NORMALS_PER_STEP))
    state, constants, truth = imu.initial_state(), imu.constants(params), truth_at(params, 0.0)
    ship = motion.constants(params.ship)
    inputs, outputs = imu.Inputs.zeros(), imu.Outputs.zeros()
    inputs['dt'] = dt
    rates, forces = [], []
    for row in normals:
        imu.step(state[0], constants[0], ship[0], inputs[0], truth[0], outputs[0], row)
        rates.append(outputs[0]['angular_velocity'].copy())
        forces.append(outputs[0]['linear_acceleration'].copy())
    rates -= sample(ideal, 0.0)['angular_velocity']
    forces -= sample(ideal, 0.0)['linear_acceleration']
    # random walk of the integral over 1 s = density; 3000 samples: 1.3 % per axis, four of them allowed
    np.testing.assert_allclose(rates.std(axis=0) * math.sqrt(dt), 1e-4, rtol=0.055)
    np.testing.assert_allclose(forces.std(axis=0) * math.sqrt(dt), 3e-3, rtol=0.055)
    np.testing.assert_allclose(rates.mean(axis=0), [0.0, 0.01, 0.0], atol=4 * 1e-4 / math.sqrt(dt * 3000))
    np.testing.assert_allclose(forces.mean(axis=0), [0.2, 0.0, 0.0], atol=4e-4 + 4 * 3e-3 / math.sqrt(dt * 3000))


@pytest.mark.parametrize('dt', [0.0, -0.005, math.nan, math.inf])
def test_a_step_that_is_not_positive_is_said(dt):
    out = sample(ShipMotionParameters(), 1.0, dt=dt)
    assert imu.IMU_STATUS_TEXTS[out['status']] == 'step is not positive'
    assert np.isnan(out['angular_velocity']).all() and np.isnan(out['linear_acceleration']).all()


def test_truth_that_is_not_valid_is_said():
    out = sample(ShipMotionParameters(), math.nan)
    assert imu.IMU_STATUS_TEXTS[out['status']] == 'truth is not valid'
    assert np.isnan(out['angular_velocity']).all() and np.isnan(out['linear_acceleration']).all()


def test_increments_are_the_integrals_of_the_rates():
    ship = ShipParameters(sea_state=6, wave_angle_deg=60.0, heading_deg=130.0)
    at_stamp = ShipMotionParameters(ship, IDEAL)
    mean = ShipMotionParameters(ship, dataclasses.replace(IDEAL, output='increment'))
    nodes, weights = np.polynomial.legendre.leggauss(8)
    for t in (0.0, 31.0):
        out = sample(mean, t, dt=0.02)
        for field in ('angular_velocity', 'linear_acceleration'):
            inside = [sample(at_stamp, t - 0.01 + 0.01 * node)[field] for node in nodes]
            np.testing.assert_allclose(out[field], 0.5 * weights @ inside, rtol=0, atol=1e-14 * 20)


def test_scale_and_misalignment():
    true = sample(ShipMotionParameters(imu=IDEAL), 5.0)
    errors = dataclasses.replace(IDEAL, gyro_scale=1e-3, gyro_misalignment=2e-3, accelerometer_scale=-3e-3,
                                 accelerometer_misalignment=5e-4)
    out = sample(ShipMotionParameters(imu=errors), 5.0)
    turned = np.roll(np.eye(3), 1, axis=1)
    for field, scale, angle in (('angular_velocity', 1e-3, 2e-3), ('linear_acceleration', -3e-3, 5e-4)):
        np.testing.assert_allclose(out[field], ((1.0 + scale) * np.eye(3) + angle * turned) @ true[field], rtol=1e-13)


def test_quantised_increments_are_whole_and_lose_nothing():
    quanta = dict(gyro_quantum=1e-5, accelerometer_quantum=1e-2)
    params = [ShipMotionParameters(imu=dataclasses.replace(IDEAL, output='increment', **more))
              for more in ({}, quanta)]
    states = [imu.initial_state(), imu.initial_state()]
    ship, dt = motion.constants(params[0].ship), 0.01
    total = np.zeros((2, 6))
    for k in range(300):
        for i in range(2):
            inputs, outputs = imu.Inputs.zeros(), imu.Outputs.zeros()
            inputs['t'], inputs['dt'] = k * dt, dt
            imu.step(states[i][0], imu.constants(params[i])[0], ship[0], inputs[0],
                     truth_at(params[i], k * dt)[0], outputs[0], NO_NOISE)
            increment = dt * np.concatenate((outputs[0]['angular_velocity'], outputs[0]['linear_acceleration']))
            total[i] += increment
            if i == 1:
                counts = increment / ([1e-5] * 3 + [1e-2] * 3)
                np.testing.assert_allclose(counts, np.round(counts), atol=1e-6)
        assert (np.abs(total[0] - total[1]) <= np.array([0.501e-5] * 3 + [0.501e-2] * 3)).all()
