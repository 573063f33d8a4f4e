"""The plan file: what is written is read, for elements and for ephemerides; a broken file is refused by field."""
import datetime
import json

import numpy as np
import pytest

from pedestal_common.geometry.geodesy import StationParameters
from pedestal_station import objects
from pedestal_station.night import Choice, Night, Object, Pass, Prediction, Share, Window
from pedestal_station.outputs import file
from pedestal_station.station import fresh
from pedestal_station.station.requests import Antenna
from tracking_receiver_sim.params import LeoPassParameters

BEGIN = datetime.datetime(2019, 12, 10, 12, 0)
STATION = StationParameters()
ANTENNA = Antenna(STATION, (-270.0, 270.0), 14.0)
DEFAULT = LeoPassParameters()
TLE = f'ISS\n{DEFAULT.line_1}\n{DEFAULT.line_2}\n'


class Moving:
    """An orbit of an ephemeris: it goes from north to east in a hundred seconds."""

    def enu(self, times):
        angles = np.asarray(times) * np.pi / 200.0
        return np.stack((np.sin(angles), np.cos(angles), 0.5 * np.ones(len(angles))), axis=-1)

    def elements_age(self, t):
        return 0.0


@pytest.fixture
def night(tmp_path):
    """A Night of three passes: of elements, of an ephemeris, and one that is dropped."""
    (tmp_path / 'iss.tle').write_text(TLE)
    [iss], _ = objects.read([tmp_path / 'iss.tle'], STATION, BEGIN, 7200.0)
    moon = Object('MOON', '', tmp_path / 'moon.oem', 1, Moving(), 2.0)
    window = Window(2100.0, (2305.0,), 2305.0, 2500.0, 0.93, False)
    predicted = Prediction((np.radians(300.0), 0.0), (0.2, 0.2), (1.0, 1.0), 1.0, (0.1, 0.1), (0.1, 0.1), False, (),
                           5e5, (40.0, 50.0), 0.0, 0.0)
    passes = (Pass(iss, 1, window, predicted), Pass(iss, 2, window, predicted),
              Pass(moon, 1, Window(10.0, (50.0,), 50.0, 90.0, 0.4, False), predicted))
    choice = Choice((Share(True, 2200.0, 2400.0, ('MOON/1',), 'begins late'),
                     Share(False, np.nan, np.nan, ('ISS/1',), ''), Share(True, 10.0, 90.0, (), '')), 1.0, 1.0, True)
    return Night(BEGIN, 7200.0, STATION, None, 'leo_pass', passes, choice, choice, ())


def test_what_is_written_is_read(night, tmp_path):
    path = tmp_path / 'night.json'
    file.write(path, night)
    plan = file.read(path)
    moon, dropped, iss = plan.contacts
    utc = file.seconds(BEGIN)
    assert plan.station == STATION and [each.case for each in plan.contacts] == ['MOON/1', 'ISS/2', 'ISS/1']
    assert (iss.begin - utc, iss.end - utc, iss.taken, iss.reason) == (2200.0, 2400.0, True,
                                                                       'begins late, lost to MOON/1')
    assert (dropped.taken, dropped.begin - utc, dropped.reason) == (False, 2100.0, 'lost to ISS/1')
    assert iss.elements == {'line_1': DEFAULT.line_1, 'line_2': DEFAULT.line_2} and iss.track == ()
    assert moon.elements == {} and moon.number == ''
    assert moon.track[0][0] - utc == 0.0 and moon.track[-1][0] - utc >= 90.0
    assert moon.track[10][1] == pytest.approx(np.radians(9.0), abs=1e-6)
    assert (moon.azimuth_deg, moon.elevation_deg) == pytest.approx((300.0, np.degrees(np.arctan(0.5))))
    # the turn of the prediction, and the sky of the elements
    azimuth, elevation = file.direction(iss.elements, STATION, iss.begin)
    first, _ = file.direction(iss.elements, STATION, utc + 2100.0)
    assert iss.elevation_deg == pytest.approx(elevation, abs=0.01)
    assert iss.azimuth_deg - 300.0 == pytest.approx((azimuth - first + 180.0) % 360.0 - 180.0, abs=0.01)


def test_a_satellite_that_stays_in_view_for_days_can_be_planned(night, tmp_path):
    first, dropped, moon = night.passes
    long = dropped._replace(window=dropped.window._replace(set=250000.0))
    file.write(tmp_path / 'night.json', night._replace(passes=(first, long, moon)))
    assert file.read(tmp_path / 'night.json').contacts[1].end == file.seconds(BEGIN) + 250000.0
    with pytest.raises(file.PlanError, match='5001 passes, must be at most 5000'):
        file.write(tmp_path / 'many.json', night._replace(passes=(first,) * 5001))


@pytest.mark.parametrize('place, value, reason', [
    (('pedestal_plan',), 2, 'pedestal_plan = 2: must be 1'),
    (('passes',), [], 'passes: 0 passes, must be 1 to 5000'),
    (('passes',), {}, 'passes = {}: must be a list'),
    (('passes', 0), 7, 'passes[0] = 7: must be an object of JSON'),
    (('passes', 0, 'case'), '', "passes[0].case = '': must be 1 to 100 printable characters"),
    (('passes', 1, 'case'), 'ISS/1', "passes[1].case = 'ISS/1': must be unique"),
    (('passes', 0, 'begin'), 'soon', "passes[0].begin = 'soon': must be UTC"),
    (('passes', 0, 'end'), '2019-12-10T00:00:00Z', 'passes[0].end = 2019-12-10T00:00:00.000Z: must be after begin'),
    (('passes', 0, 'azimuth_deg'), 'north', "passes[0].azimuth_deg = 'north': must be a number, in deg"),
    (('passes', 0, 'elevation_deg'), float('nan'), 'passes[0].elevation_deg = nan deg: must be -90 to 180'),
    (('passes', 0, 'taken'), 1, 'passes[0].taken = 1: must be true or false'),
    (('passes', 0, 'elements'), {'line_1': 'x'}, 'passes[0].elements = '),
    (('passes', 0, 'elements'), {'tle': 'x'}, 'tle: must be line_1 and line_2, or omm'),
    (('passes', 0, 'elements'), {}, 'passes[0].track = []: must be two or more rows'),
    (('passes', 2, 'track'), [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]], 'passes[2].track = '),
    (('station', 'latitude_deg'), 91.0, 'latitude_deg = 91'),
    (('station', 'height'), 10 ** 400, 'station.height = 1000'),
    (('station', 'height'), None, 'station.height = None')])
def test_a_broken_plan_is_refused_by_file_field_and_reason(night, tmp_path, place, value, reason):
    path = tmp_path / 'night.json'
    file.write(path, night)
    content = json.loads(path.read_text())
    where = content
    for key in place[:-1]:
        where = where[key]
    where[place[-1]] = value
    path.write_text(json.dumps(content))
    with pytest.raises(file.PlanError) as refused:
        file.read(path)
    assert str(refused.value).startswith(f'{path}: ') and reason in str(refused.value), refused.value


@pytest.mark.parametrize('content', ['', '[]', '{', '{"pedestal_plan": true}', '[' * 100000, '\x00', 'NaN'])
def test_what_is_no_plan_is_refused(tmp_path, content):
    path = tmp_path / 'night.json'
    path.write_text(content)
    with pytest.raises(file.PlanError, match='night.json: '):
        file.read(path)


def test_a_missing_plan_is_named(tmp_path):
    with pytest.raises(file.PlanError, match='No such file'):
        file.read(tmp_path / 'none.json')


def test_only_quiet_files_of_elements_are_read(tmp_path):
    """A file counts in the second look at which it is the same; a hidden one and one of other satellites never."""
    watch = fresh.Watch(tmp_path, ANTENNA)
    wanted, utc, now = frozenset(('25544',)), file.seconds(BEGIN), 0.0

    def looked():
        nonlocal now
        now += fresh.LOOK_PERIOD_S
        found = watch.look(now, wanted, utc)
        if watch._pending:
            watch._pending.result(60.0)
            more = watch.look(now, wanted, utc)
            found = found[0] + more[0], found[1] + more[1]
        return found
    assert looked() == ([], [])
    (tmp_path / '.iss.tle').write_text(TLE)
    (tmp_path / 'other.tle').write_text(TLE.replace('25544', '25545'))
    (tmp_path / 'iss.tle').write_text(TLE[:80])
    assert looked() == ([], [])
    (tmp_path / 'iss.tle').write_text(TLE)
    looked()
    [found], _ = looked()
    assert (found.satellite, found.source, dict(found.elements)['line_2']) == ('25544', 'iss.tle', DEFAULT.line_2)
    assert looked() == ([], [])
    (tmp_path / 'broken.tle').write_text('no elements at all\n')
    looked()
    assert [line.startswith(f'refused: {tmp_path / "broken.tle"}') for line in looked()[1]] == [True]
    watch.close()
    with pytest.raises(NotADirectoryError, match='must be a directory'):
        fresh.Watch(tmp_path / 'none', ANTENNA)
