import math

import numba
import numpy as np
import pytest
from scipy import integrate
from scipy.spatial.transform import Rotation

from ship_motion_sim import motion, waves
from ship_motion_sim.params import PlainParameters, ShipParameters

STILL = PlainParameters(roll_amplitude_deg=0.0)
WILD = PlainParameters(roll_amplitude_deg=30.0, pitch_amplitude_deg=20.0, pitch_period=5.0, yaw_amplitude_deg=40.0,
                       heave_amplitude=2.0)


def ship(**values):
    """t -> truth record of a ship with these parameters."""
    constants = motion.constants(ShipParameters(**values))

    def at(t):
        outputs = np.zeros(1, motion.Truth.dtype)
        motion.truth(constants[0], t, outputs[0])
        return outputs[0]
    return at


def series(at, times, field):
    return np.array([at(t)[field] for t in times])


def difference(f, t, h):
    """Central difference of fourth order."""
    return (8.0 * (f(t + h) - f(t - h)) - (f(t + 2 * h) - f(t - 2 * h))) / (12.0 * h)


CASES = [dict(sea_state=6, wave_angle_deg=60.0, heading_deg=130.0),
         dict(motion='plain', plain=WILD, heading_deg=300.0)]


@pytest.mark.parametrize('values', CASES, ids=['waves', 'plain'])
def test_derivatives_against_differences(values):
    at, h = ship(**values), 0.01
    for t in (0.0, 3.7, 611.0):
        now = at(t)
        freedoms = difference(lambda u: at(u)['freedoms'], t, h)
        np.testing.assert_allclose(freedoms[:2], now['freedoms'][1:], atol=1e-7)
        for low, high in (('position', 'velocity'), ('velocity', 'acceleration'),
                          ('angular_velocity', 'angular_acceleration')):
            rate = difference(lambda u, low=low: at(u)[low], t, h)
            np.testing.assert_allclose(rate, now[high], atol=1e-7, err_msg=high)


@pytest.mark.parametrize('values', CASES, ids=['waves', 'plain'])
def test_body_rates_against_turns_of_the_attitude(values):
    at, h = ship(**values), 0.005
    for t in (0.3, 5.1, 47.0):
        back = Rotation.from_quat(at(t)['quaternion']).inv()
        rate = difference(lambda u, back=back: (back * Rotation.from_quat(at(u)['quaternion'])).as_rotvec(), t, h)
        np.testing.assert_allclose(rate, at(t)['angular_velocity'], atol=1e-8)


def test_attitude_is_fixed_axis_roll_pitch_yaw_of_rep_103():
    at = ship(motion='plain', plain=WILD, heading_deg=30.0)
    for t in (0.7, 2.9):
        now = at(t)
        expected = Rotation.from_euler('xyz', [now['roll'], now['pitch'], now['yaw']])
        np.testing.assert_allclose(now['mat_ed'], expected.as_matrix(), atol=1e-14)
        np.testing.assert_allclose(Rotation.from_quat(now['quaternion']).as_matrix(), expected.as_matrix(), atol=1e-14)
        np.testing.assert_allclose(now['velocity_deck'], expected.inv().apply(now['velocity']), atol=1e-13)


@pytest.mark.parametrize('heading, east, north', [(0.0, 0.0, 1.0), (90.0, 1.0, 0.0), (210.0, -0.5, -math.sqrt(0.75))])
def test_the_bow_and_the_course_point_to_the_compass_heading(heading, east, north):
    now = ship(motion='plain', plain=STILL, heading_deg=heading, speed=5.0)(8.0)
    np.testing.assert_allclose(now['position'], [40.0 * east, 40.0 * north, 0.0], atol=1e-12)
    np.testing.assert_allclose(now['mat_ed'][:, 0], [east, north, 0.0], atol=1e-14)
    np.testing.assert_allclose(now['velocity_deck'], [5.0, 0.0, 0.0], atol=1e-14)


def test_positive_roll_lifts_port_and_positive_pitch_lowers_the_bow():
    rolled = ship(motion='plain', plain=PlainParameters(roll_amplitude_deg=10.0, roll_period=8.0))(2.0)
    assert rolled['mat_ed'][2, 1] == pytest.approx(math.sin(math.radians(10.0)))
    pitched = ship(motion='plain', plain=PlainParameters(roll_amplitude_deg=0.0, pitch_amplitude_deg=4.0,
                                                         pitch_period=6.0))(1.5)
    assert pitched['mat_ed'][2, 0] == pytest.approx(-math.sin(math.radians(4.0)))


def test_plain_sine_is_its_closed_form():
    at, w, a = ship(motion='plain', heading_deg=90.0), 2.0 * math.pi / 8.0, math.radians(10.0)
    for t in np.linspace(0.0, 20.0, 41):
        now = at(t)
        assert now['roll'] == pytest.approx(a * math.sin(w * t), abs=1e-15)
        np.testing.assert_allclose(now['angular_velocity'], [a * w * math.cos(w * t), 0.0, 0.0], atol=1e-15)
        np.testing.assert_allclose(now['angular_acceleration'], [-a * w * w * math.sin(w * t), 0.0, 0.0], atol=1e-15)
    heave = ship(motion='plain', plain=PlainParameters(heave_amplitude=1.5, heave_period=7.0))(1.75)
    np.testing.assert_allclose([heave['position'][2], heave['velocity'][2]], [1.5, 0.0], atol=1e-14)


def test_the_same_time_gives_the_same_bits_in_any_order():
    times = np.arange(0.0, 5.0, 0.005)
    forward = [ship(seed=5)(0.0).tobytes()] + [None] * (len(times) - 1)
    at = ship(seed=5)
    for i in range(1, len(times)):
        forward[i] = at(times[i]).tobytes()
    other = ship(seed=5)
    for i in np.random.default_rng(0).permutation(len(times)):
        assert other(times[i]).tobytes() == forward[i]


def test_seeds_are_different_seas():
    times = np.arange(0.0, 600.0, 1.0)
    one, other = (series(ship(seed=seed), times, 'roll') for seed in (1, 2))
    assert abs(np.corrcoef(one, other)[0, 1]) < 0.4


def test_the_sea_does_not_repeat():
    """Equally spaced frequencies repeat after 2 pi / dw: the correlation of the motion with itself would be 1."""
    low, high = waves.band(waves.SEA_STATES[5][1])
    period = 2.0 * math.pi * waves.WAVE_COMPONENT_COUNT / (high - low)
    at, times = ship(speed=0.0), np.arange(0.0, 2000.0, 1.0)
    for periods in (1, 2):
        later = series(at, times + periods * period, 'position')[:, 2]
        assert abs(np.corrcoef(series(at, times, 'position')[:, 2], later)[0, 1]) < 0.5


def test_variance_of_a_long_realisation():
    """Head sea, pitch, 10 h: 2 % of the sum over the components (what the beats of neighbours leave), and 20 % of the
    integral of RAO^2 S: seeds scatter by 3 % in sigma, so three standard deviations in variance."""
    params = ShipParameters(wave_angle_deg=180.0)
    variance = series(ship(wave_angle_deg=180.0), np.arange(0.0, 36000.0, 1.37), 'pitch').var()
    response = waves.build(params).response[:, waves.PITCH]
    assert variance == pytest.approx(np.sum(np.abs(response) ** 2) / 2.0, rel=0.02)
    hs, tp = waves.SEA_STATES[5]
    z, weight = np.polynomial.hermite_e.hermegauss(21)

    def density(w):
        rao = waves.transfer(params.hull, w, np.radians(180.0 + 15.0 * z), 7.0, 9.81)[1][:, waves.PITCH]
        return np.sum(np.abs(rao) ** 2 * weight) / weight.sum() * float(waves.spectrum(w, hs, tp, 3.3))

    expected, _ = integrate.quad(density, *waves.band(tp), points=[2.0 * math.pi / tp], limit=200)
    assert variance == pytest.approx(expected, rel=0.2)


def test_sine_and_cosine_to_a_million_radians():
    for angle in np.concatenate((np.linspace(-1e6, 1e6, 4001), np.linspace(-10.0, 10.0, 2001),
                                 np.arange(-40, 41) * math.pi / 4.0)):
        sine, cosine = motion.sin_cos(angle)
        assert abs(sine - math.sin(angle)) < 1e-15 and abs(cosine - math.cos(angle)) < 1e-15


@pytest.mark.parametrize('t', [math.nan, math.inf, -math.inf])
def test_time_that_is_not_finite_is_said_and_nothing_looks_valid(t):
    now = ship()(t)
    assert motion.MOTION_STATUS_TEXTS[now['status']] == 'time is not finite'
    for field in motion.Truth.dtype.names:
        if field != 'status':
            assert np.isnan(now[field]).all(), field


def test_compiled_callers_get_the_same_truth():
    @numba.njit
    def call(constants, t, outputs):
        motion.truth(constants[0], t, outputs[0])

    outputs = np.zeros(1, motion.Truth.dtype)
    call(motion.constants(ShipParameters()), 77.7, outputs)
    assert outputs.tobytes() == ship()(77.7).tobytes()
