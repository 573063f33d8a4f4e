"""One wind over both axes: its mean torques against the vector formula, its turbulence, and what a drive feels."""
import math

import numpy as np
import pytest
from scipy import integrate

from adu_drive.plant import wind
from drive_law.params import AduParameters, WindFieldParameters
from pedestal_common.parameters import build

STEADY = WindFieldParameters(speed=12.0, from_azimuth=2.0, intensity=0.0, diameter=7.0)
FULL = 0.5 * 1.225 * 12.0 ** 2 * math.pi * 3.5 ** 2 * 7.0
"""q A D [Nm]."""


def torques(p, t, A, E):
    return np.array(wind.field_torques.py_func(wind.field_constants(p).view(np.recarray)[0], t, A, E))


@pytest.mark.parametrize('A, E', [(0.0, 0.0), (2.0, 0.4), (-1.0, 1.2), (5.3, 0.1)])
def test_mean_torques_are_the_moment_about_each_axis(A, E):
    """numpy's vectors: q A D C(alpha) along beam x wind, projected on the axes of growing angles."""
    beam = np.array([math.cos(E) * math.cos(A), -math.cos(E) * math.sin(A), math.sin(E)])
    to = -np.array([math.cos(2.0), -math.sin(2.0), 0.0])
    alpha = math.acos(-beam @ to)
    normal = np.cross(beam, to) / np.linalg.norm(np.cross(beam, to)) if math.sin(alpha) > 1e-9 else np.zeros(3)
    moment = FULL * (0.055 * math.sin(alpha) - 0.08 * math.sin(2.0 * alpha)) * normal
    axes = np.array([[0.0, 0.0, -1.0], [-math.sin(A), -math.cos(A), 0.0]])
    assert torques(STEADY, 3.0, A, E) == pytest.approx(axes @ moment, abs=1e-9 * FULL)


def test_a_wind_into_the_dish_turns_nothing_and_one_from_behind_most():
    assert np.abs(torques(STEADY, 0.0, 2.0, 0.0)).max() < 1e-9 * FULL
    round_the_clock = np.array([torques(STEADY, 0.0, 2.0 + a, 0.0)[0] for a in np.radians(np.arange(0, 360))])
    assert 120 <= np.argmax(np.abs(round_the_clock[:180])) <= 140
    assert np.abs(round_the_clock).max() == pytest.approx(0.12 * FULL, rel=0.03)
    assert round_the_clock[1:180] == pytest.approx(-round_the_clock[:180:-1])


def test_turbulence_has_its_shares_and_is_averaged_over_the_dish():
    p = WindFieldParameters(speed=12.0, intensity=0.2, length=80.0)
    sigma = np.sqrt(np.sum(wind.field_constants(p)[0]['amplitude'] ** 2, axis=1) / 2.0)
    def density(x):
        f = math.exp(x)
        side = math.sqrt(math.pi) * 3.5
        return f * wind.von_karman(f, 12.0, 80.0) / (1.0 + (2.0 * f * side / 12.0) ** (4.0 / 3.0)) ** 2
    expected = (0.2 * math.sqrt(integrate.quad(density, math.log(wind.MIN_GUST_FREQUENCY_HZ),
                                               math.log(wind.MAX_GUST_FREQUENCY_HZ), limit=200)[0]))
    assert sigma == pytest.approx(expected * np.array([1.0, 0.78, 0.55]), rel=0.03)
    assert 0.1 < expected < 0.19


def test_both_axes_are_moved_by_one_wind():
    """Abeam and level only azimuth feels the mean; the vertical gusts move elevation, and are not those of azimuth."""
    p = WindFieldParameters(speed=12.0, from_azimuth=0.5 * math.pi, intensity=0.2)
    path = np.array([torques(p, 5.3 * k, 0.0, 0.0) for k in range(4000)])
    mean, sigma = path.mean(axis=0), path.std(axis=0)
    assert abs(mean[1]) < 0.05 * abs(mean[0]) and sigma[1] > 0.02 * abs(mean[0])
    assert abs(np.corrcoef(path.T)[0, 1]) < 0.1
    other = np.array([torques(WindFieldParameters(speed=12.0, from_azimuth=0.5 * math.pi, seed=2), 5.3 * k, 0.0, 0.0)
                      for k in range(50)])
    assert np.abs(other - path[:50]).max() > 0.1 * abs(mean[0])


@pytest.mark.parametrize('speed', (12.0, 27.0))
def test_a_drive_starts_in_balance_and_holds_against_it(drive, speed):
    """At 27 m/s each motor holds more than the torque above which there is no bias."""
    p = build(AduParameters, {'initial_elevation': 0.7, 'wind.field.speed': speed, 'wind.field.from_azimuth': 2.5,
                              'wind.field.intensity': 0.0, 'wind.field.diameter': 7.0})
    d = drive(p).run(0.5, azimuth=0.0, elevation=0.0)
    expected = torques(p.wind.field, 0.0, 0.0, 0.7)
    for axis, torque in zip(('azimuth', 'elevation'), expected):
        unbalance = getattr(p, axis).load.unbalance * math.cos(0.7)
        assert np.ptp(d.log[axis]['load_position']) < 3e-5
        assert d.log[axis]['torque'][-1] == pytest.approx(unbalance - torque, abs=1.5 * 80.0)
    assert np.abs(expected).max() > 300.0
