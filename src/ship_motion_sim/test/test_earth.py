import math

import pytest

from ship_motion_sim import earth


@pytest.mark.parametrize('latitude_deg', [0.0, 20.0, -34.0, 47.0, 70.0, 90.0])
def test_gravity_against_the_series_of_grs_80(latitude_deg):
    """Chebyshev series of the 1980 gravity formula (Moritz 1980): another ellipsoid within 1e-6, another form."""
    s2, d2 = math.sin(math.radians(latitude_deg)) ** 2, math.sin(math.radians(2 * latitude_deg)) ** 2
    series = 9.780327 * (1.0 + 0.0053024 * s2 - 0.0000058 * d2)
    assert earth.gravity(math.radians(latitude_deg)) == pytest.approx(series, abs=5e-6)


def test_the_earth_turns_once_in_a_sidereal_day_about_the_pole():
    east, north, up = earth.rate(math.radians(30.0))
    assert 2.0 * math.pi / math.hypot(north, up) == pytest.approx(86164.1, abs=0.1)
    assert east == 0.0 and up / north == pytest.approx(math.tan(math.radians(30.0)))
    assert earth.rate(-0.5)[2] < 0.0
