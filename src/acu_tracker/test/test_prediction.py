"""What the control unit predicts itself, against skyfield, printed examples and SGP4 between the rows."""
import math

import erfa
import numpy as np
import pytest
from skyfield.api import EarthSatellite, load, wgs84

from acu_tracker.modes import Mode, Reason
from acu_tracker.program import prediction, program_track
from acu_tracker.program.prediction import PredictionParameters, Predictor
from pedestal_common.geometry import bodies, orbit
from pedestal_common.geometry.geodesy import StationParameters
from pedestal_common.parameters import ParameterError

LINES = ('1 25544U 98067A   19343.69339541  .00001764  00000-0  38792-4 0  9991',
         '2 25544  51.6439 211.2001 0007417  17.6667  85.6398 15.50103472202482')
START = '2019-12-10T09:22:00'
STATION = StationParameters()


def predictor(start=START, lines=LINES, **values):
    return Predictor(PredictionParameters(line_1=lines[0], line_2=lines[1], start_time=start,
                                          **{'station': STATION, **values}))


def test_the_sun_of_meeus():
    """Astronomical Algorithms, 2nd edition, example 25.b: 1992 October 13.0 TD. Its right ascension is from the true
    equinox, which the nutation in longitude, 15.908 arcsec, moves along the equator."""
    [(x, y, z)] = bodies.position('sun', np.array([2448908.5 - erfa.DJ00 - bodies.TT_MINUS_UTC_S / 86400.0]))
    R = math.hypot(x, y, z)
    assert R / erfa.DAU == pytest.approx(0.99760775, abs=5e-6)
    equinox = 15.908 / 3600.0 * math.cos(math.radians(23.4401443))
    assert math.degrees(math.atan2(y, x)) % 360.0 + equinox == pytest.approx(198.378121, abs=5e-5)
    assert math.degrees(math.asin(z / R)) == pytest.approx(-7.783817, abs=5e-5)


def test_the_sun_of_nrel_over_a_station():
    """Reda and Andreas, NREL/TP-560-34302: 2003-10-17 12:30:30 MST at 39.742476, -105.1786, 1830.14 m; without
    refraction."""
    station = StationParameters(latitude_deg=39.742476, longitude_deg=-105.1786, height=1830.14)
    track = predictor('2003-10-17T19:30:30', ('', ''), station=station).sun(0.0).track
    motion = program_track.motion_at(track, 0.0)
    assert math.degrees(motion.azimuth.angle) % 360.0 == pytest.approx(194.34024, abs=0.01)
    assert math.degrees(motion.elevation.angle) == pytest.approx(39.872046, abs=0.01)
    told = dict(predictor('2003-10-17T19:30:30', ('', ''), station=station).diagnostic_values(0.0))
    assert float(told['sun_azimuth_deg']) % 360.0 == pytest.approx(194.34024, abs=0.01)
    assert float(told['sun_elevation_deg']) == pytest.approx(39.872046, abs=0.01)
    assert predictor('', ('', '')).diagnostic_values(0.0) == []


def test_the_satellite_agrees_with_skyfield():
    track = predictor().satellite(0.0).track
    theirs = EarthSatellite(*LINES) - wgs84.latlon(STATION.latitude_deg, STATION.longitude_deg, STATION.height)
    scale = load.timescale()
    for t in (30.5, 200.25, 318.0, 500.75):
        motion = program_track.motion_at(track, t)
        elevation, azimuth, _ = theirs.at(scale.utc(2019, 12, 10, 9, 22, t)).altaz()
        off = math.remainder(motion.azimuth.angle - azimuth.radians, 2.0 * math.pi) * math.cos(elevation.radians)
        # Between them lies UT1 - UTC, -0.17 s of earth rotation, and how far the satellite is.
        assert math.hypot(off, motion.elevation.angle - elevation.radians) < math.radians(0.01)


def test_the_table_interpolates_what_sgp4_says_between_its_rows():
    ours = predictor()
    track = ours.satellite(0.0).track
    times = np.arange(0.0, 700.0, 0.37)
    angles = ours._satellite_angles(times)
    interpolated = np.array([[a.angle for a in program_track.motion_at(track, t)] for t in times])
    off = np.hypot(np.remainder(interpolated[:, 0] - angles[:, 0] + math.pi, 2.0 * math.pi) - math.pi,
                   interpolated[:, 1] - angles[:, 1])
    assert np.degrees(off.max()) < 1e-3


def test_a_table_is_made_anew_while_the_satellite_is_down():
    ours = predictor()
    made = ours.satellite(0.0)
    assert made.reason == Reason.NONE and made.since == made.track.times[0] < 0.0
    assert made.track.times[len(made.track.times) // 2] <= made.until < made.track.times[-1]
    [[_, elevation]] = ours._satellite_angles(np.array([made.until]))
    assert elevation < 0.0
    assert ours.satellite(made.until).track.times[0] <= made.until


def test_why_there_is_no_table():
    assert predictor(lines=('', '')).satellite(0.0).reason == Reason.NO_ELEMENTS
    assert predictor('').satellite(0.0).reason == predictor('').sun(0.0).reason == Reason.NO_UTC
    assert Predictor(predictor('').parameters, 1575969720 * 10**9).satellite(0.0).reason == Reason.NONE
    old = predictor('2019-12-30T00:00:00')
    assert old.satellite(0.0).reason == Reason.TOO_OLD
    assert old.refusal_details(Mode.TLE, Reason.TOO_OLD, 0.0) == 'epoch 20.3 days from now; must be at most 14'
    assert predictor('2019-12-30T00:00:00', oldest=30.0).satellite(0.0).reason == Reason.NONE


def test_the_next_rise_is_where_the_elevation_passes_zero():
    ours = predictor('2019-12-10T06:00:00')
    said = ours.refusal_details(Mode.TLE, Reason.BELOW_HORIZON, 0.0)
    rise = orbit.instant('rise', said.removeprefix('next rise at '))
    t = (rise - orbit.instant('start', '2019-12-10T06:00:00')).total_seconds()
    before, after = ours._satellite_angles(np.array([t - 1.0, t + 1.0]))[:, 1]
    assert before < 0.0 < after


def test_the_polar_night_has_no_sunrise():
    ours = predictor('2019-12-21T12:00:00', station=StationParameters(latitude_deg=85.0))
    assert ours.refusal_details(Mode.SUN, Reason.BELOW_HORIZON, 0.0) == 'no rise within 2 days'


def test_orbits_of_a_day_have_fewer_rows_a_second():
    geostationary = ('1 37951U 11051A   19343.50000000 -.00000100  00000-0  00000-0 0  9991',
                     '2 37951   0.0200 100.0000 0002000 100.0000 200.0000  1.00270000 30000')
    lines = [line[:68] + str(orbit.compute_checksum(line)) for line in geostationary]
    track = predictor(lines=lines).satellite(0.0).track
    assert 10.0 < track.times[1] - track.times[0] < 20.0


@pytest.mark.parametrize('values, text', [
    ({'line_1': LINES[0][:-1] + '0', 'line_2': LINES[1]}, 'checksum'), ({'line_2': LINES[1]}, 'TLE line 1'),
    ({'start_time': 'noon'}, 'start_time')])
def test_what_is_no_tle_or_time_is_refused(values, text):
    with pytest.raises(ParameterError, match=text):
        PredictionParameters(**values)


def test_rows_are_as_many_as_are_said():
    assert len(predictor().satellite(0.0).track.times) == prediction.TABLE_ROW_COUNT
