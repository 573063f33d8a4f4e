"""Refraction against ERFA above 5 deg, and its shape below."""
import math

import erfa
import numpy as np
import pytest

from pedestal_common.geometry import refraction

WEATHERS = ((1013.25, 15.0, 0.5), (1010.0, 10.0, 0.0), (1005.0, 30.0, 0.8), (1013.0, -10.0, 0.5), (560.0, -20.0, 0.1),
            (1040.0, 40.0, 1.0))
LIMIT_DEG = 1e-4


def raised_by_erfa(weather, elevation):
    """Refraction [rad] by the functions refco and atioq of ERFA at a true elevation [rad]."""
    astrom = erfa.apio(0.0, 0.0, 0.0, 0.8, 0.0, 0.0, 0.0, *erfa.refco(*weather, 200.0))
    astrom['diurab'] = 0.0
    hour_angle, declination = erfa.ae2hd(1.0, elevation, 0.8)
    azimuth, zenith, *_ = erfa.atioq(-hour_angle, declination, astrom)
    assert elevation == 0.5 * math.pi or azimuth == pytest.approx(1.0, abs=1e-9)
    return 0.5 * math.pi - zenith - elevation


@pytest.mark.parametrize('weather', WEATHERS)
def test_above_5_deg_it_is_that_of_erfa(weather):
    air = refraction.of_weather(*weather)
    assert (air.A, air.B) == pytest.approx(erfa.refco(*weather, 200.0), rel=1e-12)
    for degrees in (5.0, 5.01, 7.0, 10.0, 20.0, 45.0, 80.0, 89.9, 90.0):
        E = math.radians(degrees)
        off = refraction.refraction(air, E) - raised_by_erfa(weather, E)
        assert abs(math.degrees(off)) < 0.1 * LIMIT_DEG, degrees


def test_the_printed_values_of_refco():
    air = refraction.of_weather(1013.25, 15.0, 0.5)
    assert air.N == pytest.approx(311.4, abs=1.0)       # by Smith and Weintraub's coefficients
    assert math.degrees(refraction.refraction(air, math.radians(20.0))) == pytest.approx(0.04867, abs=2e-4)


def test_near_the_horizon_it_is_that_of_the_itu():
    """Recommendation ITU-R P.834 at sea level, for 315 N."""
    air = refraction.Air(3.1e-4, -3.2e-7, 315.0)
    for degrees, expected in ((0.0, 0.5787), (1.0, 0.43359), (2.0, 0.33794), (3.0, 0.27134)):
        assert math.degrees(refraction.refraction(air, math.radians(degrees))) == pytest.approx(expected, abs=2e-4)


def corners():
    for P in refraction.PRESSURE_RANGE_HPA:
        for t in (*refraction.TEMPERATURE_RANGE_CELSIUS, 0.0, 30.0):
            for humidity in refraction.HUMIDITY_RANGE:
                yield P, t, humidity


@pytest.mark.parametrize('weather', (*WEATHERS, *corners()))
def test_apparent_elevations_keep_their_order(weather):
    """Refraction falls and the apparent elevation grows, from -1 deg to the zenith, without a step."""
    air = refraction.of_weather(*weather)
    E = np.radians(np.linspace(-2.0, 90.0, 92_001))
    R = np.array([refraction.refraction(air, elevation) for elevation in E])
    assert (np.diff(E + R) > 0.0).all()
    assert (np.diff(R) <= 1e-15).all() and (R >= 0.0).all()
    assert np.degrees(R.max()) < 3.0
    inside = E[:-2] > np.radians(-0.999)
    assert np.abs(np.diff(R, 2))[inside].max() < 1e-7 * air.N / 100.0      # a slope without a step


def test_a_table_is_raised_row_by_row():
    weather = np.array([WEATHERS[0], WEATHERS[2]])
    elevations = np.radians([10.0, 10.0])
    expected = [E + refraction.refraction(refraction.of_weather(*row), E) for row, E in zip(weather, elevations)]
    refraction.raise_all(weather, elevations)
    assert elevations.tolist() == expected
