"""The mechanisation against the truth it is fed from, and against python-ins, another author's integrator."""
import math

import numba
import numpy as np
import pandas as pd
import pyins.strapdown
import pyins.transform
import pytest
from scipy.spatial.transform import Rotation

from ship_motion_sim import earth, imu, motion, strapdown
from ship_motion_sim.params import ImuParameters, PlainParameters, ShipMotionParameters, ShipParameters

DT = 0.01
LATITUDE = math.radians(34.0)
ARCSECOND = math.radians(1.0 / 3600.0)
EXACT = ImuParameters(output='increment', **{f'{sensor}_{name}': 0.0 for sensor in ('gyro', 'accelerometer')
                                             for name in ('bias_x', 'bias_y', 'bias_z', 'noise')})
PLAIN = PlainParameters(roll_amplitude_deg=7.0, roll_period=1.0 / 0.3, pitch_amplitude_deg=5.0, pitch_period=2.0,
                        yaw_amplitude_deg=9.0, yaw_period=5.0)
SWAY = ShipParameters(motion='plain', plain=PLAIN, speed=0.0, latitude_deg=34.0)
SEA = ShipParameters(sea_state=6, wave_angle_deg=60.0, heading_deg=130.0, latitude_deg=34.0)


@numba.njit
def measured(state, constants, ship, inputs, truth, outputs, count, angle, force):
    for k in range(count):
        inputs[0].t = (k + 1) * inputs[0].dt
        motion.truth(ship[0], inputs[0].t, truth[0])
        imu.step(state[0], constants[0], ship[0], inputs[0], truth[0], outputs[0], np.zeros(imu.IMU_NORMALS_PER_STEP))
        for i in range(3):
            angle[k, i] = outputs[0].angular_velocity[i] * inputs[0].dt
            force[k, i] = outputs[0].linear_acceleration[i] * inputs[0].dt


def increments(ship, seconds):
    """(angle, force) (n, 3) of an errorless IMU from 0 s on."""
    params, count = ShipMotionParameters(ship, EXACT), round(seconds / DT)
    inputs = imu.Inputs.zeros()
    inputs['dt'] = DT
    angle, force = np.zeros((count, 3)), np.zeros((count, 3))
    measured(imu.initial_state(), imu.constants(params), motion.constants(ship), inputs,
             motion.Truth.zeros(), imu.Outputs.zeros(), count, angle, force)
    return angle, force


def truth_at(ship, t):
    truth = motion.Truth.zeros()
    motion.truth(motion.constants(ship)[0], t, truth[0])
    return truth[0]


@numba.njit
def integrate(state, angle, force, dt, earth_rate, command, gravity):
    for k in range(len(angle)):
        strapdown.step(state[0], angle[k], force[k], dt, earth_rate, command, gravity)


def navigated(ship, angle, force, command=(0.0, 0.0, 0.0)):
    """The STATE record after these increments from the true attitude and velocity at 0 s."""
    state, start = strapdown.State.zeros(), truth_at(ship, 0.0)
    strapdown.set_attitude(state[0], *start['quaternion'])
    state['velocity'] = start['velocity']
    integrate(state, angle, force, DT, np.array(earth.rate(LATITUDE)), np.array(command), earth.gravity(LATITUDE))
    return state[0]


def apart(a, b):
    """Angle between two attitudes (x, y, z, w) [rad]."""
    return (Rotation.from_quat(a) * Rotation.from_quat(b).inv()).magnitude()


@pytest.mark.parametrize('ship, seconds, angle_limit, velocity_limit', [
    (SWAY, 300.0, 2e-3 * ARCSECOND, 1e-5), (SEA, 120.0, 2e-4 * ARCSECOND, 1e-6)])
def test_without_errors_it_stays_on_the_truth(ship, seconds, angle_limit, velocity_limit):
    state, end = navigated(ship, *increments(ship, seconds)), truth_at(ship, seconds)
    assert apart(state['quaternion'], end['quaternion']) < angle_limit
    np.testing.assert_allclose(state['velocity'], end['velocity'], atol=velocity_limit)
    np.testing.assert_allclose(Rotation.from_quat(state['quaternion']).as_matrix(), state['mat'], atol=1e-15)


def test_a_wrong_earth_rate_would_be_seen():
    angle, force = increments(SWAY, 60.0)
    state, start = strapdown.State.zeros(), truth_at(SWAY, 0.0)
    strapdown.set_attitude(state[0], *start['quaternion'])
    integrate(state, angle, force, DT, np.zeros(3), np.zeros(3), earth.gravity(LATITUDE))
    assert apart(state['quaternion'], truth_at(SWAY, 60.0)['quaternion']) == pytest.approx(
        60.0 * earth.WGS84_EARTH_RATE_RAD_S, rel=0.01)


def test_a_command_turns_the_computed_frame():
    angle, force = increments(SWAY, 10.0)
    state, end = navigated(SWAY, angle, force, (0.0, 0.0, 0.02)), truth_at(SWAY, 10.0)
    turned = Rotation.from_rotvec([0.0, 0.0, -0.2]) * Rotation.from_quat(end['quaternion'])
    # n' turns away from north, so that the earth's rate there is wrong by up to 0.2 of its north part
    assert apart(state['quaternion'], turned.as_quat()) == pytest.approx(
        0.5 * 0.2 * 10.0 * earth.WGS84_EARTH_RATE_RAD_S * math.cos(LATITUDE), rel=0.01)


def test_against_python_ins():
    """The same increments through pyins (FRD, NED, WGS-84 position): sway on the spot, so neither moves over the earth
    and its transport rate stays out."""
    seconds = 120.0
    angle, force = increments(SWAY, seconds)
    state, start = navigated(SWAY, angle, force), truth_at(SWAY, 0.0)
    flip, to_ned = np.diag([1.0, -1.0, -1.0]), np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
    times = DT * np.arange(len(angle) + 1)
    readings = np.hstack((angle @ flip, force @ flip))
    frame = pd.DataFrame(np.vstack((np.zeros(6), readings)), index=times,
                         columns=['gyro_x', 'gyro_y', 'gyro_z', 'accel_x', 'accel_y', 'accel_z'])
    rph = pyins.transform.mat_to_rph(to_ned @ start['mat_ed'] @ flip)
    pva = pd.Series([34.0, 108.0, 0.0, 0.0, 0.0, 0.0, *rph],
                    index=['lat', 'lon', 'alt', 'VN', 'VE', 'VD', 'roll', 'pitch', 'heading'])
    integrator = pyins.strapdown.Integrator(pva, with_altitude=False)
    end = integrator.integrate(pyins.strapdown.compute_increments_from_imu(frame, 'increment')).iloc[-1]
    theirs = to_ned.T @ pyins.transform.mat_from_rph(end[['roll', 'pitch', 'heading']]) @ flip
    theirs = Rotation.from_matrix(theirs).as_quat()
    assert apart(state['quaternion'], theirs) < 1e-3 * ARCSECOND
    assert apart(theirs, truth_at(SWAY, seconds)['quaternion']) < 2e-3 * ARCSECOND
    np.testing.assert_allclose(state['velocity'][:2], end[['VE', 'VN']], atol=2e-5)
