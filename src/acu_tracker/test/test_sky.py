"""Predicted directions against astropy, skyfield and ERFA, with the UT1 and the polar motion of one file of the IERS.

The file and the ephemeris come from the package skyfield-data; nothing is downloaded.
"""
import math
import os

import numpy as np
import pytest
from sgp4.api import Satrec
from skyfield.api import EarthSatellite, Loader, wgs84
from skyfield.data import iers
from skyfield_data import get_skyfield_data_path

from acu_tracker.program.prediction import PredictionParameters, Predictor
from pedestal_common.geometry import bodies, orbit
from pedestal_common.geometry.earth_orientation import EarthOrientationParameters
from pedestal_common.geometry.geodesy import StationParameters

pytestmark = pytest.mark.filterwarnings('ignore:The file finals2000A.all has expired:RuntimeWarning')

LINES = ('1 25544U 98067A   19343.69339541  .00001764  00000-0  38792-4 0  9991',
         '2 25544  51.6439 211.2001 0007417  17.6667  85.6398 15.50103472202482')
GEO = tuple(line[:68] + str(orbit.compute_checksum(line)) for line in (
    '1 37951U 11051A   19343.50000000 -.00000100  00000-0  00000-0 0  9991',
    '2 37951   0.0200 100.0000 0002000 100.0000 200.0000  1.00270000 30000'))
STATION = StationParameters(latitude_deg=47.36, longitude_deg=8.61, height=500.0)
FILE = os.path.join(get_skyfield_data_path(), 'finals2000A.all')
LIMIT_DEG = 1e-4
"""Required accuracy of a direction [deg]."""


def predictor(start, lines=('', ''), station=STATION, file=FILE, **values):
    return Predictor(PredictionParameters(line_1=lines[0], line_2=lines[1], start_time=start, station=station,
                                          earth_orientation=EarthOrientationParameters(file=str(file)), **values))


def vector(azimuth, elevation):
    return np.stack((np.sin(azimuth) * np.cos(elevation), np.cos(azimuth) * np.cos(elevation), np.sin(elevation)),
                    axis=-1)


def distance_deg(angles, azimuth, elevation):
    """Largest angle between directions (n, 2) and others [deg]."""
    a, b = vector(*angles.T), vector(azimuth, elevation)
    return np.degrees(np.arctan2(np.linalg.norm(np.cross(a, b), axis=-1), (a * b).sum(axis=-1))).max()


@pytest.fixture(scope='module')
def skyfield():
    """(timescale, ephemeris) with the UT1 and the polar motion of FILE."""
    load = Loader(get_skyfield_data_path(), expire=False)
    scale = load.timescale(builtin=False)
    with open(FILE, 'rb') as file:
        iers.install_polar_motion_table(scale, iers.parse_x_y_dut1_from_finals_all(file))
    return scale, load('de421.bsp')


def times_of(scale, start, times):
    begin = orbit.instant('start', start)
    return scale.utc(begin.year, begin.month, begin.day, begin.hour, begin.minute, begin.second + times)


def place(station):
    return wgs84.latlon(station.latitude_deg, station.longitude_deg, station.height)


@pytest.mark.parametrize('lines, start, step', [
    (LINES, '2019-12-10T09:22:00', 20.0), (GEO, '2019-12-10T09:22:00', 1800.0), (LINES, '2019-12-11T23:59:40', 1.0)])
def test_a_satellite_without_light_time(skyfield, lines, start, step):
    times = step * np.arange(40)
    azimuth_elevation = predictor(start, lines)._satellite_angles(times)
    elevation, azimuth, _ = (EarthSatellite(*lines) - place(STATION)).at(times_of(skyfield[0], start, times)).altaz()
    assert distance_deg(azimuth_elevation, azimuth.radians, elevation.radians) < 0.1 * LIMIT_DEG
    # Without the file the earth is turned by UT1 - UTC, -0.17 s, and the directions differ by more.
    assert distance_deg(predictor(start, lines, file='')._satellite_angles(times), azimuth.radians,
                        elevation.radians) > LIMIT_DEG


@pytest.fixture(scope='module')
def astropy():
    """The parts of astropy, with the UT1 and the polar motion of FILE. Python 3.10 has no astropy 8."""
    coordinates = pytest.importorskip('astropy.coordinates')
    from astropy.utils import iers as astropy_iers
    with astropy_iers.earth_orientation_table.set(astropy_iers.IERS_A.open(FILE)):
        yield coordinates


def test_a_satellite_against_astropy(astropy):
    from astropy.coordinates import ITRS, TEME, AltAz, CartesianRepresentation, EarthLocation
    start, times = '2019-12-10T09:22:00', 20.0 * np.arange(40)
    when = astropy_times(start, times)
    _, r, _ = Satrec.twoline2rv(*LINES).sgp4_array(when.utc.jd1, when.utc.jd2)
    here = EarthLocation.from_geodetic(STATION.longitude_deg, STATION.latitude_deg, STATION.height)
    fixed = TEME(CartesianRepresentation(*r.T, unit='km'), obstime=when).transform_to(ITRS(obstime=when))
    relative = ITRS(fixed.cartesian - here.get_itrs(when).cartesian, obstime=when, location=here)
    seen = relative.transform_to(AltAz(obstime=when, location=here))
    assert distance_deg(predictor(start, LINES)._satellite_angles(times), seen.az.rad, seen.alt.rad) < 0.1 * LIMIT_DEG


def astropy_times(start, times):
    import astropy.units
    from astropy.time import Time
    return Time(start) + times * astropy.units.s


@pytest.mark.parametrize('lines, step', [(LINES, 20.0), (GEO, 1800.0)])
def test_light_time_of_a_satellite(skyfield, lines, step):
    """The apparent place of skyfield, which contains light time and aberration."""
    scale, ephemeris = skyfield
    start, times = '2019-12-10T09:22:00', step * np.arange(40)
    t = times_of(scale, start, times)
    earth = ephemeris['earth']
    elevation, azimuth, _ = (earth + place(STATION)).at(t).observe(earth + EarthSatellite(*lines)).apparent().altaz()
    seen = predictor(start, lines, light_time=True)._satellite_angles(times)
    assert distance_deg(seen, azimuth.radians, elevation.radians) < 0.3 * LIMIT_DEG
    assert distance_deg(predictor(start, lines)._satellite_angles(times), azimuth.radians,
                        elevation.radians) > 3.0 * LIMIT_DEG


@pytest.mark.parametrize('year', [2000, 2010, 2019, 2026])
def test_the_sun_against_skyfield(skyfield, year):
    scale, ephemeris = skyfield
    start, times = f'{year}-01-05T03:00:00', 5.03 * 86400.0 * np.arange(70)
    elevation, azimuth, _ = (ephemeris['earth'] + place(STATION)).at(times_of(scale, start, times)).observe(
        ephemeris['sun']).apparent().altaz()
    assert distance_deg(predictor(start).sun_angles(times), azimuth.radians, elevation.radians) < LIMIT_DEG


def test_the_sun_against_astropy(astropy):
    from astropy.coordinates import AltAz, EarthLocation, get_body
    start, times = '2019-01-05T03:00:00', 5.03 * 86400.0 * np.arange(70)
    when = astropy_times(start, times)
    here = EarthLocation.from_geodetic(STATION.longitude_deg, STATION.latitude_deg, STATION.height)
    seen = get_body('sun', when, here).transform_to(AltAz(obstime=when, location=here))
    assert distance_deg(predictor(start).sun_angles(times), seen.az.rad, seen.alt.rad) < LIMIT_DEG


@pytest.mark.parametrize('year', [2000, 2019, 2045])
def test_the_moon_against_skyfield(skyfield, year):
    """The moon of simulated targets and of program tracks; its series is cut at some thousandths of a degree."""
    scale, ephemeris = skyfield
    start, times = f'{year}-01-05T03:00:00', 5.03 * 86400.0 * np.arange(70)
    elevation, azimuth, distance = (ephemeris['earth'] + place(STATION)).at(times_of(scale, start, times)).observe(
        ephemeris['moon']).apparent().altaz()
    of_file = predictor(start)
    julian, fraction = of_file._julian(0.0)
    fractions = fraction + times / 86400.0
    e, n, u = bodies.seen('moon', STATION, julian, fractions, of_file._to_fixed(julian, fractions)).T
    angles = np.column_stack((np.arctan2(e, n), np.arctan2(u, np.hypot(e, n))))
    assert distance_deg(angles, azimuth.radians, elevation.radians) < 0.007
    # The distance of skyfield contains the way of the earth while the light travels, 38 km.
    np.testing.assert_allclose(np.sqrt(e * e + n * n + u * u), distance.m, rtol=1.2e-4)


@pytest.mark.parametrize('when, azimuth, elevation', [
    ('2026-01-10T11:00:00', 171.82690, 20.32041), ('2026-03-20T06:30:00', 100.66224, 9.48396),
    ('2026-06-21T12:00:00', 198.08121, 65.20364), ('2026-08-01T18:00:00', 287.26144, 8.44552),
    ('2026-12-05T09:00:00', 147.80432, 13.82304)])
def test_the_sun_of_de421(when, azimuth, elevation):
    """Directions of skyfield 1.55 with the ephemeris DE421, printed to 1e-5 deg; polar motion is not in them."""
    seen = predictor(when).sun_angles(np.zeros(1))
    assert distance_deg(seen, math.radians(azimuth), math.radians(elevation)) < 2.0 * LIMIT_DEG
