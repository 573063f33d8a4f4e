"""Windows of objects over a station: against skyfield over all latitudes and five kinds of orbit, and over horizons
that are cut to the second."""
import datetime
import itertools
import math

import numpy as np
import pytest
from sgp4.api import WGS72, Satrec
from sgp4.exporter import export_tle
from skyfield.api import EarthSatellite, load, wgs84

from pedestal_common.geometry.geodesy import StationParameters
from pedestal_station import objects, windows

DAY_S = 86400.0
BEGIN = datetime.datetime(2026, 11, 28, 6)
SCALE = load.timescale(builtin=True)
KINDS = {       # {kind: mean motion [rev/day], eccentricity, inclination, argument of perigee, mean anomalies [deg]}
    'LEO': (15.5, 0.001, 51.6, 40.0, (0.0, 130.0)), 'sun-synchronous': (14.2, 0.001, 98.6, 90.0, (10.0, 200.0)),
    'MEO': (2.005, 0.01, 55.0, 30.0, (20.0, 140.0, 260.0)), 'HEO': (2.006, 0.72, 63.4, 270.0, (0.0, 90.0, 180.0)),
    'GEO': (1.0027, 0.0005, 14.0, 10.0, (0.0, 110.0, 230.0))}
STATIONS = ((90.0, 0.0), (-90.0, 45.0), (78.2, 15.4), (64.8, -147.5), (47.4, 8.5), (28.3, -16.5), (0.0, 180.0),
            (-16.9, -179.99), (-33.9, 18.4), (-53.2, -70.9), (-72.0, 190.0), (10.0, 359.0))


def tle(kind, anomaly, node=50.0):
    motion, eccentricity, inclination, perigee, _ = KINDS[kind]
    satellite = Satrec()
    epoch = (BEGIN - datetime.datetime(1949, 12, 31)).total_seconds() / DAY_S - 0.7
    satellite.sgp4init(WGS72, 'i', 90000 + int(anomaly), epoch, 1e-5, 0.0, 0.0, eccentricity, math.radians(perigee),
                       math.radians(inclination), math.radians(anomaly), motion * 2.0 * math.pi / 1440.0,
                       math.radians(node % 360.0))
    return export_tle(satellite)


def read(path, lines, station, duration, begin=BEGIN):
    path.write_text('\n'.join(lines) + '\n')
    found, refused = objects.read([path], station, begin, duration)
    assert not refused, refused
    return found


class Sky:
    """A satellite over a station as skyfield has it."""

    def __init__(self, lines, latitude, longitude, begin=BEGIN):
        self.satellite, self.place = EarthSatellite(*lines, '', SCALE), wgs84.latlon(latitude, longitude, 500.0)
        self.begin = SCALE.utc(begin.year, begin.month, begin.day, begin.hour)

    def angles(self, t):
        azimuth, elevation = (self.satellite - self.place).at(self.time(t)).altaz()[1::-1]
        return azimuth.degrees, elevation.degrees

    def time(self, t):
        return SCALE.tt_jd(self.begin.whole, self.begin.tt_fraction + np.asarray(t) / DAY_S)

    def crossing(self, t, least):
        """Times at which the elevation is `least`, near t."""
        for _ in range(4):
            before, here, after = (self.angles(t + d)[1] for d in (-0.5, 0.0, 0.5))
            t = t + (least - here) / (after - before)
        return t

    def top(self, t):
        """Times of the maxima near t."""
        for d in (30.0, 4.0, 0.5):
            before, here, after = (self.angles(t + s)[1] for s in (-d, 0.0, d))
            t = t + np.clip(0.5 * d * (before - after) / (before - 2.0 * here + after), -d, d)
        return t

    def events(self, duration, least):
        """Times and kinds of the events in a night. find_events misses a rise after the set of a pass that culminates
        before its beginning, therefore it begins a day early."""
        times, kinds = self.satellite.find_events(self.place, self.time(-DAY_S), self.time(duration + DAY_S), least)
        t = (times - self.begin) * DAY_S
        inside = (t > 0.0) & (t < duration)
        return t[inside], kinds[inside]


def compare(path, kind, place, least, days, anomalies):
    """Compare the windows of satellites of a kind over a place with skyfield. Return the number of passes."""
    count = 0
    station = StationParameters(latitude_deg=place[0], longitude_deg=place[1], height=500.0)
    for anomaly in anomalies:
        lines = tle(kind, anomaly, 50.0 + place[1])
        [each] = read(path, lines, station, days * DAY_S)
        found = windows.find(each.orbit, windows.Horizon.constant(least), days * DAY_S)
        sky = Sky(lines, *place)
        times, kinds = sky.events(days * DAY_S, least)
        for code, ours in ((0, [w.rise for w in found if not w.endless]), (2, [w.set for w in found if not w.endless]),
                           (1, [t for w in found for t in w.culminations if t not in (w.rise, w.set)])):
            ours = np.array([t for t in ours if 0.0 < t < days * DAY_S])
            # find_events has half a second.
            assert len(ours) == np.count_nonzero(kinds == code), (kind, place, code, ours, times[kinds == code])
            np.testing.assert_allclose(ours, times[kinds == code], rtol=0.0, atol=1.0)
            if len(ours):
                exact = sky.top(ours) if code == 1 else sky.crossing(ours, least)
                np.testing.assert_allclose(ours, exact, rtol=0.0, atol=0.02, err_msg=f'{kind} {place} {code}')
                azimuth, elevation = np.degrees(windows.angles(each.orbit, ours)).T
                apart = (azimuth - sky.angles(ours)[0] + 180.0) % 360.0 - 180.0
                assert np.abs(apart * np.cos(np.radians(elevation))).max() < 0.0002
                np.testing.assert_allclose(elevation, sky.angles(ours)[1], rtol=0.0, atol=0.0002)
        count += len(found)
    return count


@pytest.mark.every_case
@pytest.mark.parametrize('kind', KINDS)
def test_windows_agree_with_skyfield(kind, tmp_path):
    assert compare(tmp_path / 'a.tle', kind, STATIONS[3], 5.0, 1.0, KINDS[kind][-1]) > 0


@pytest.mark.thorough
def test_a_thousand_passes_agree_with_skyfield(tmp_path):
    """At all latitudes, over the poles and on the date line. What is left of the differences is the interval of the
    search for a rise and a set, and the noise of the position at a flat maximum."""
    count = {kind: sum(compare(tmp_path / 'a.tle', kind, place, least, 4.0, KINDS[kind][-1])
                       for place, least in zip(STATIONS, itertools.cycle((0.0, 5.0, 12.0)))) for kind in KINDS}
    assert sum(count.values()) >= 1000 and min(count.values()) >= 30, count


def by_force(orbit, horizon, duration, step):
    """Begin and end of the times above the horizon, by steps."""
    times = np.arange(0.0, duration, step)
    azimuth, elevation = windows.angles(orbit, times).T
    above = np.concatenate(([False], elevation > horizon.at(azimuth), [False])).astype(int)
    return np.column_stack((times[np.flatnonzero(np.diff(above) > 0)], times[np.flatnonzero(np.diff(above) < 0) - 1]))


@pytest.mark.every_case
@pytest.mark.parametrize('seed', range(2))
def test_no_gap_and_no_peak_of_a_floor_is_passed_over(seed, tmp_path):
    """Floors with gaps and walls of a degree, which an object passes in seconds."""
    rng = np.random.default_rng(seed)
    centres = np.sort(rng.uniform(0.1, 6.1, 15))
    points = [(a, f) for centre, height in zip(centres, rng.uniform(-0.1, 0.6, 15))
              for a, f in ((centre - 0.01, 0.1), (centre, height), (centre + 0.01, 0.1))]
    points = [(a, f) for i, (a, f) in enumerate(points) if i == 0 or a > points[i - 1][0]]
    points = [points[0], *(b for a, b in zip(points, points[1:]) if b[0] > a[0])]
    text = '; '.join(f'{a:.6f} {f:.6f}' for a, f in points)
    horizon = windows.Horizon.of_floor(text, 0.02)
    [each] = read(tmp_path / 'a.tle', tle('sun-synchronous', 10.0), StationParameters(), 0.5 * DAY_S)
    found = [w for w in windows.find(each.orbit, horizon, 0.5 * DAY_S) if w.set - w.rise > 0.1]
    known = by_force(each.orbit, horizon, 0.5 * DAY_S, 0.1)
    assert len(found) > len(windows.find(each.orbit, windows.Horizon.constant(5.73), 0.5 * DAY_S))  # some are cut
    np.testing.assert_allclose([(w.rise, w.set) for w in found], known, rtol=0.0, atol=0.1)
    for w in found:
        inside = windows.angles(each.orbit, np.linspace(w.rise, w.set, 2000))[:, 1]
        assert w.max_elevation == pytest.approx(inside.max(), abs=1e-5) and w.culmination in w.culminations
        assert w.max_elevation >= inside.max() - 1e-12


@pytest.mark.parametrize('half', [0.05, 1.0, 9.0])
def test_a_pass_of_a_second_is_found_and_a_dip_of_a_second_divides(half, tmp_path):
    """A horizon that a satellite passes by for a time of 2 `half` at each of its culminations, and at a minimum."""
    [leo] = read(tmp_path / 'a.tle', tle('LEO', 0.0), StationParameters(), DAY_S)
    for each in windows.find(leo.orbit, windows.Horizon.constant(0.0), DAY_S):
        least = np.degrees(windows.angles(leo.orbit, each.culmination + np.array([-half, half]))[:, 1])
        found = windows.find(leo.orbit, windows.Horizon.constant(float(least.mean())), DAY_S)
        [short] = [w for w in found if abs(w.culmination - each.culmination) < 1.0]
        assert short.set - short.rise == pytest.approx(2.0 * half, rel=0.02, abs=0.01)
    [heo] = read(tmp_path / 'a.tle', tle('HEO', 180.0), StationParameters(latitude_deg=20.0), DAY_S)
    times = np.arange(0.0, DAY_S, 10.0)
    elevation = windows.angles(heo.orbit, times)[:, 1]
    middle = elevation[1:-1]
    dips = times[1:-1][(middle < elevation[:-2]) & (middle < elevation[2:]) & (middle > 0.0)]
    assert len(dips)
    for dip in dips:
        lowest = dip + np.linspace(-10.0, 10.0, 200_001)
        values = windows.angles(heo.orbit, lowest)[:, 1]
        at = lowest[np.argmin(values)]
        least = float(np.degrees(windows.angles(heo.orbit, at + np.array([-half, half]))[:, 1]).mean())
        found = windows.find(heo.orbit, windows.Horizon.constant(least), DAY_S)
        [(before, after)] = [(a, b) for a, b in zip(found, found[1:]) if a.set < at < b.rise]
        assert after.rise - before.set == pytest.approx(2.0 * half, rel=0.02, abs=0.02)


def test_a_window_under_way_is_followed_and_a_geo_has_no_end(tmp_path):
    station = StationParameters(latitude_deg=-33.9, longitude_deg=18.4)
    lines = [*tle('MEO', 20.0), *tle('GEO', 0.0, 280.0)]
    long, geo = (each.orbit for each in read(tmp_path / 'a.tle', lines, station, DAY_S))
    horizon = windows.Horizon.constant(5.0)
    whole = windows.find(long, horizon, DAY_S)[1]
    later = BEGIN + datetime.timedelta(seconds=round(whole.rise) + 3600)
    [each, _] = read(tmp_path / 'a.tle', lines, station, 60.0, later)
    [cut] = windows.find(each.orbit, horizon, 60.0)
    assert (cut.rise, cut.set) == pytest.approx((whole.rise - round(whole.rise) - 3600.0,
                                                 whole.set - round(whole.rise) - 3600.0), abs=1e-3)
    assert not cut.endless and cut.max_elevation == pytest.approx(whole.max_elevation, abs=1e-9)
    for duration in (60.0, DAY_S):
        [each] = windows.find(geo, horizon, duration)
        assert (each.rise, each.set, each.endless) == (0.0, duration, True)
        assert each.max_elevation >= windows.angles(geo, np.linspace(0.0, duration, 500))[:, 1].max() - 1e-12
    assert len(windows.find(geo, horizon, DAY_S)[0].culminations) in (1, 2)
    assert windows.find(geo, windows.Horizon.constant(80.0), DAY_S) == []


def test_stations_on_the_pole_and_on_the_date_line(tmp_path):
    """The same place by another longitude has the same windows; at a pole every longitude is the same place."""
    lines, horizon = tle('sun-synchronous', 10.0), windows.Horizon.constant(10.0)

    def of(latitude, longitude):
        station = StationParameters(latitude_deg=latitude, longitude_deg=longitude)
        [each] = read(tmp_path / 'a.tle', lines, station, DAY_S)
        return windows.find(each.orbit, horizon, DAY_S)
    for latitude, one, other, least in ((12.0, 180.0, -180.0, 2), (-50.0, 200.0, -160.0, 2), (90.0, 0.0, 123.0, 13),
                                        (-90.0, 7.0, -77.0, 13)):
        a, b = of(latitude, one), of(latitude, other)
        np.testing.assert_allclose([w[2:5] for w in a], [w[2:5] for w in b], rtol=0.0, atol=1e-3)
        assert len(a) >= least


@pytest.mark.parametrize('text, low, at', [
    ('', -0.1, ((1.0, 0.0),)), ('', 0.1, ((1.0, 0.1),)), ('0 -0.02; 3 -0.02', -0.1, ((1.0, -0.02),)),
    ('-1 0.2; 1 0.0', 0.1, ((-1.0, 0.2), (-0.5, 0.15), (0.0, 0.1), (0.5, 0.1), (math.pi, 0.1))),
    ('1 0.3', 0.0, ((0.0, 0.3), (4.0, 0.3)))])
def test_the_horizon_of_a_floor(text, low, at):
    horizon = windows.Horizon.of_floor(text, low)
    for azimuth, elevation in at:
        assert horizon.at(np.array([azimuth]))[0] == pytest.approx(elevation, abs=1e-12)
    if len(horizon.azimuths) > 1:
        azimuths = np.linspace(-math.pi, math.pi, 2001)
        assert horizon.at(azimuths) == pytest.approx([max(low, windows.travel.floor_at(text, A)) for A in azimuths],
                                                     abs=1e-12)
