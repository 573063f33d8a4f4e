"""Passes against skyfield's find_events; which pass a text names; TLE files as they come."""
import datetime

import numpy as np
import pytest
from skyfield.api import EarthSatellite, load, wgs84

from pedestal_common.geometry import orbit, passes
from pedestal_common.geometry.geodesy import StationParameters
from tracking_receiver_sim import elements
from tracking_receiver_sim.params import LeoPassParameters

LINE_1, LINE_2 = LeoPassParameters().line_1, LeoPassParameters().line_2
SATELLITE, STATION = orbit.satellite(LeoPassParameters()), StationParameters()
EPOCH = orbit.calendar(SATELLITE.jdsatepoch, SATELLITE.jdsatepochF)
GEO_1 = '1 28884U 05041A   19343.50000000  .00000000  00000-0  00000-0 0  9990'
GEO_2 = '2 28884   0.0200  80.0000 0002000 100.0000 250.0000  1.00270000 51000'


def summed(line):
    return line[:68] + str(orbit.compute_checksum(line))


def skyfield_passes(station, days):
    """[(rise, top, set as UTC datetime, elevation at the top [deg])] of whole passes, with UT1 = UTC as orbit.py."""
    scale = load.timescale(builtin=True)
    scale.delta_t_function = lambda tt: np.full(np.shape(tt), 32.184 + 37.0)
    sky = EarthSatellite(LINE_1, LINE_2, 'ISS', scale)
    place = wgs84.latlon(station.latitude_deg, station.longitude_deg, station.height)
    times, kinds = sky.find_events(place, sky.epoch, sky.epoch + days, altitude_degrees=0.0)
    at = [(kind, time.utc_datetime().replace(tzinfo=None), (sky - place).at(time).altaz()[0].degrees)
          for time, kind in zip(times, kinds)]
    triples = [at[i:i + 3] for i in range(len(at) - 2)]
    return [(a[1], b[1], c[1], b[2]) for a, b, c in triples if (a[0], b[0], c[0]) == (0, 1, 2)]


@pytest.mark.parametrize('station', [STATION, StationParameters(latitude_deg=-33.9, longitude_deg=18.4, height=10.0)])
def test_passes_agree_with_skyfield(station):
    ours = passes.passes_after(SATELLITE, station, EPOCH, 3.0)
    theirs = [known for known in skyfield_passes(station, 3.0) if known[3] >= passes.MIN_CULMINATION_DEG]
    assert len(ours) == len(theirs) >= 8
    for own, (rise, top, down, elevation) in zip(ours, theirs):
        assert abs((own.rise - rise).total_seconds()) < 0.2 and abs((own.set - down).total_seconds()) < 0.2
        assert abs((own.top - top).total_seconds()) < 1.0
        assert own.elevation == pytest.approx(elevation, abs=0.01)


def test_a_pass_is_named_by_number_by_utc_or_as_next():
    listed = passes.passes_after(SATELLITE, STATION, EPOCH)
    old = EPOCH + datetime.timedelta(days=2000)
    assert passes.chosen_pass(SATELLITE, STATION, '3', old) == listed[2]
    inside = listed[2].top.isoformat()
    for now in (EPOCH, old):
        named = passes.chosen_pass(SATELLITE, STATION, inside, now)
        assert abs((named.rise - listed[2].rise).total_seconds()) < 0.01
    before = (listed[2].rise - datetime.timedelta(minutes=5)).isoformat() + 'Z'
    assert abs((passes.chosen_pass(SATELLITE, STATION, before, old).rise - listed[2].rise).total_seconds()) < 0.01
    fresh = listed[0].rise + datetime.timedelta(seconds=1.0)
    assert abs((passes.chosen_pass(SATELLITE, STATION, 'next', fresh).rise - listed[1].rise).total_seconds()) < 0.01


@pytest.mark.parametrize('which, days, message', [
    ('next', 40, r'--pass next: the TLE of satellite 25544 is of 2019-12-09, 40 days old; SGP4 holds for 30'),
    ('next', -40, '40 days ahead'),
    ('0', 0, '--pass 0: there are 2. passes above 10 deg within 5 days of 2019-12-09T16:38:29Z'),
    ('99', 0, '--pass 99: there are'),
    ('soon', 0, "--pass = 'soon': must be UTC as ISO 8601"),
    ('2026-01-01', 0, '--pass 2026-01-01: 2214.3 days from the TLE epoch')])
def test_a_pass_that_is_not_there(which, days, message):
    with pytest.raises(orbit.TargetError, match=message):
        passes.chosen_pass(SATELLITE, STATION, which, EPOCH + datetime.timedelta(days=days))


def test_a_satellite_that_stands_or_never_rises():
    geostationary = orbit.satellite(LeoPassParameters(line_1=summed(GEO_1), line_2=summed(GEO_2)))
    [[x, y, _]], _ = orbit.enu(geostationary, StationParameters(latitude_deg=90.0, longitude_deg=0.0),
                               geostationary.jdsatepoch, geostationary.jdsatepochF, np.zeros(1))
    under = float(np.degrees(np.arctan2(x, -y)))     # at the pole east is y of the earth, north is -x
    for longitude, said in ((under, 'never sets'), ((under + 360.0) % 360.0 - 180.0, 'does not rise')):
        with pytest.raises(orbit.TargetError, match=f'28884 {said} within'):
            passes.passes_after(geostationary, StationParameters(latitude_deg=0.0, longitude_deg=longitude), EPOCH,
                                1.0)


@pytest.mark.parametrize('text, name, title', [
    (f'{LINE_1}\n{LINE_2}\n', '', '25544'), (f'ISS (ZARYA)   \r\n{LINE_1}\r\n{LINE_2}\r\n', '', 'ISS (ZARYA)'),
    (f'0 ISS\n{LINE_1}\n{LINE_2}\nGEO\n{summed(GEO_1)}\n{summed(GEO_2)}\n', 'iss', 'ISS'),
    (f'{LINE_1}\n{LINE_2}\n{summed(GEO_1)}\n{summed(GEO_2)}\n', '25544', '25544')])
def test_a_tle_file(tmp_path, text, name, title):
    path = tmp_path / 'a.tle'
    path.write_text(text)
    assert elements.read(path, name) == (title, LINE_1, LINE_2)


@pytest.mark.parametrize('text, name, message', [
    ('', '', 'must hold a TLE'), (LINE_1, '', 'must hold a TLE'), ('<html></html>\n', '', 'must hold a TLE'),
    (f'{LINE_1}\n{LINE_2}\nGEO\n{GEO_1}\n{GEO_2}\n', '', '2 found, 25544, GEO: name one with --satellite'),
    (f'{LINE_1}\n{LINE_2}\n', 'NOAA', "1 found, 25544: satellite 'NOAA' is in it 0 times")])
def test_a_tle_file_that_does_not_do(tmp_path, text, name, message):
    path = tmp_path / 'a.tle'
    path.write_text(text)
    with pytest.raises(orbit.TargetError, match=message):
        elements.read(path, name)
    with pytest.raises(orbit.TargetError, match='nowhere.tle: No such file'):
        elements.read(tmp_path / 'nowhere.tle')
