"""Passes against skyfield's find_events; which pass a text names; TLE files as they come."""
import datetime
import re

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


def skyfield_passes(station, days, least):
    """[(rise, top, set as UTC datetime, elevation at the top [deg])] of whole passes, with UT1 = UTC as orbit.py."""
    scale = load.timescale(builtin=True)
    scale.delta_t_function = lambda tt: np.full(np.shape(tt), 32.184 + 37.0)
    sky = EarthSatellite(LINE_1, LINE_2, 'ISS', scale)
    place = wgs84.latlon(station.latitude_deg, station.longitude_deg, station.height)
    times, kinds = sky.find_events(place, sky.epoch, sky.epoch + days, altitude_degrees=least)
    at = [(kind, time.utc_datetime().replace(tzinfo=None), (sky - place).at(time).altaz()[0].degrees)
          for time, kind in zip(times, kinds)]
    triples = [at[i:i + 3] for i in range(len(at) - 2)]
    return [(a[1], b[1], c[1], b[2]) for a, b, c in triples if (a[0], b[0], c[0]) == (0, 1, 2)]


@pytest.mark.parametrize('station, least', [
    (STATION, 0.0), (STATION, 15.0), (StationParameters(latitude_deg=-33.9, longitude_deg=18.4, height=10.0), 0.0)])
def test_passes_agree_with_skyfield(station, least):
    """Rise and set are at the stated elevation."""
    end = EPOCH + datetime.timedelta(days=3.0)
    ours = [own for own in passes.passes_after(SATELLITE, station, EPOCH, 3.0, least)
            if not own.under_way and own.set < end]
    theirs = [known for known in skyfield_passes(station, 3.0, least) if known[3] >= passes.MIN_CULMINATION_DEG]
    assert len(ours) == len(theirs) >= 8
    for own, (rise, top, down, elevation) in zip(ours, theirs):
        apart = 0.3 if least else 0.2       # the elevation changes more slowly high above the horizon
        assert max(abs((own.rise - rise).total_seconds()), abs((own.set - down).total_seconds())) < apart
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
    for late, number in ((1.0, 0), (listed[0].duration - 1.0, 0), (listed[0].duration + 1.0, 1)):
        fresh = listed[0].rise + datetime.timedelta(seconds=late)
        named = passes.chosen_pass(SATELLITE, STATION, 'next', fresh)
        assert abs((named.rise - listed[number].rise).total_seconds()) < 0.01
        assert named.under_way == (number == 0) and named.start == named.rise


@pytest.mark.parametrize('which, days, message', [
    ('next', 40, r'--pass next: the TLE of satellite 25544 is of 2019-12-09, 40 days old; SGP4 holds for 30'),
    ('next', -40, '40 days ahead'),
    ('0', 0, '--pass 0: there are 2. passes above 10 deg within 5 days of 2019-12-09T16:38:29Z'),
    ('99', 0, '--pass 99: there are'),
    ('soon', 0, "--pass = 'soon': must be UTC as ISO 8601"),
    ('tonight', 0, '; or next, list, or a number of the list'),
    ('2026-01-01', 0, '--pass 2026-01-01: 2214.3 days from the TLE epoch')])
def test_a_pass_that_is_not_there(which, days, message):
    with pytest.raises(orbit.TargetError, match=message):
        passes.chosen_pass(SATELLITE, STATION, which, EPOCH + datetime.timedelta(days=days))


def test_a_satellite_that_stands_or_never_rises():
    geostationary = orbit.satellite(LeoPassParameters(line_1=summed(GEO_1), line_2=summed(GEO_2)))
    [[x, y, _]], _ = orbit.enu(geostationary, StationParameters(latitude_deg=90.0, longitude_deg=0.0),
                               geostationary.jdsatepoch, geostationary.jdsatepochF, np.zeros(1))
    under = float(np.degrees(np.arctan2(x, -y)))     # at the pole east is y of the earth, north is -x
    with pytest.raises(orbit.TargetError, match='28884 does not rise within'):
        passes.passes_after(geostationary, StationParameters(latitude_deg=0.0, longitude_deg=(
            under + 360.0) % 360.0 - 180.0), EPOCH, 1.0)
    above = StationParameters(latitude_deg=0.0, longitude_deg=under)
    for which in ('1', 'next', EPOCH.isoformat()):
        each = passes.chosen_pass(geostationary, above, which, EPOCH)
        assert (each.rise, each.set, each.start) == (None, None, EPOCH) and each.under_way and each.elevation > 80.0
    low = StationParameters(latitude_deg=75.0, longitude_deg=under)
    assert 0.0 < passes.chosen_pass(geostationary, low, 'next', EPOCH).elevation < passes.MIN_CULMINATION_DEG


HEO = ('1 90003U 20001A   26328.00000000  .00000000  00000-0  00000-0 0  9996',
       '2 90003  60.0000  10.0000 8500000 270.0000   0.0000  0.30000000    17')


@pytest.mark.parametrize('at, rise, down, start', [
    ('2026-11-25T18:00', '2026-11-24T01:23', '2026-11-27T07:03', '2026-11-25T18:00'),
    ('2026-11-24T01:24', '2026-11-24T01:23', '2026-11-27T07:03', '2026-11-24T01:24'),
    ('2026-11-27T07:02', '2026-11-24T01:23', '2026-11-27T07:03', '2026-11-27T07:02'),
    ('2026-11-27T07:04', '2026-11-27T12:48', '2026-11-30T13:16', '2026-11-27T12:48')])
def test_a_pass_of_days_is_found_by_every_utc_inside(at, rise, down, start):
    heo = orbit.satellite(LeoPassParameters(line_1=HEO[0], line_2=HEO[1]))
    each = passes.chosen_pass(heo, STATION, at, EPOCH)
    assert (f'{each.rise:%Y-%m-%dT%H:%M}', f'{each.set:%Y-%m-%dT%H:%M}') == (rise, down)
    assert f'{each.start:%Y-%m-%dT%H:%M}' == start and each.duration > passes.MAX_RUN_S
    listed = passes.passes_after(heo, STATION, orbit.instant('at', at))
    assert listed[0] == each and len(listed) > 1 and all(later.rise > each.set for later in listed[1:])


@pytest.mark.parametrize('text, name, title', [
    (f'{LINE_1}\n{LINE_2}\n', '', '25544'), (f'ISS (ZARYA)   \r\n{LINE_1}\r\n{LINE_2}\r\n', '', 'ISS (ZARYA)'),
    (f'0 ISS\n{LINE_1}\n{LINE_2}\nGEO\n{summed(GEO_1)}\n{summed(GEO_2)}\n', 'iss', 'ISS'),
    (f'  ISS\n  {LINE_1}\n  {LINE_2}\n', '', 'ISS'), (f'ISS\r{LINE_1}\r{LINE_2}\r', '', 'ISS'),
    (f'{LINE_1}\n{LINE_2}\n{summed(GEO_1)}\n{summed(GEO_2)}\n', '25544', '25544')])
def test_a_tle_file(tmp_path, text, name, title):
    path = tmp_path / 'a.tle'
    path.write_bytes(text.encode())
    assert elements.read(path, name) == (title, {'line_1': LINE_1, 'line_2': LINE_2, 'omm': ''}, '')


@pytest.mark.parametrize('when, line, epoch', [('2019-12-01', 1, '2019-12-09 16:38:29'), ('2019-12-10T05:00', 3, ''),
                                               ('2019-12-30', 5, '2019-12-11 12:00:00'), (None, 5, '')])
def test_of_a_history_the_nearest_elements_are_taken(when, line, epoch, tmp_path):
    lines = [LINE_1, *(summed(LINE_1.replace('343.69339541', day)) for day in ('344.50000000', '345.50000000'))]
    path = tmp_path / 'history.tle'
    path.write_text(''.join(f'{each}\n{LINE_2}\n' for each in lines))
    chosen = elements.read(path, '', when and orbit.instant('when', when))
    assert chosen.values['line_1'] == lines[line // 2]
    assert re.fullmatch(f'history.tle: 3 sets of elements of satellite 25544, of 2019-12-09 to 2019-12-11; taken: the '
                        f'set of {epoch}.* UTC in line {line}, the nearest to .*', chosen.remark)
    path.write_text(path.read_text().replace('344.50000000', '34x.50000000'))
    with pytest.raises(orbit.TargetError, match="line 3, column 19: epoch = '1934x.50000000': must be year and day"):
        elements.read(path)


@pytest.mark.parametrize('kind, theory', [(4, 'SGP4-XP'), (3, 'PPT3'), (1, 'SGP'), (6, 'numerical propagation')])
def test_elements_of_another_theory_are_refused(kind, theory, tmp_path):
    path = tmp_path / 'a.tle'
    line = summed(LINE_1[:62] + str(kind) + LINE_1[63:])
    path.write_text(f'{line}\n{LINE_2}\n')
    with pytest.raises(orbit.TargetError, match=f'a.tle: line 1: TLE line 1, column 63: ephemeris type {kind}: must '
                       rf'be 0 or 2 \(SGP4\); type {kind} needs {theory}$'):
        elements.read(path)


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
