"""The verb `plan`: its interface, its files, bad objects, bad options, stations where azimuth or longitude ends."""
import csv
import datetime
import json
import subprocess
import sys

import icalendar
import pytest
from sgp4.io import compute_checksum
from skyfield.api import EarthSatellite, load, wgs84

from pedestal_station import planning
from pedestal_station.outputs import file

BEGIN = datetime.datetime(2019, 12, 10, 6, 0)
PLACE = ('--station', '47.4,8.5,500', '--from', f'{BEGIN:%Y-%m-%dT%H:%M}')
FIRST_METRICS = ['rise_s', 'culmination_s', 'set_s', 'max_elevation_deg', 'peak_azimuth_rate_deg_s', 'loss_s', 'taken']


def tle(name, number, inclination=51.6439, node=211.2001, anomaly=85.6398, motion=15.50103472, epoch='19343.69339541'):
    """A TLE of the orbit of the ISS with some other elements."""
    first = f'1 {number:>5}U 98067A   {epoch}  .00001764  00000-0  38792-4 0  999'
    second = f'2 {number:>5} {inclination:8.4f} {node:8.4f} 0007417  17.6667 {anomaly:8.4f} {motion:11.8f}20248'
    lines = (f'{line}{compute_checksum(line)}\n' for line in (first, second))
    return f'{name}\n' * bool(name) + ''.join(lines)


ISS = tle('ISS (ZARYA)', 25544)
OTHER = tle('', 43013, 98.7, 120.0, 200.0, 14.19)
GEO = tle('GEO', 40874, 0.05, 71.1, 249.0, 1.0027)


@pytest.fixture
def files(tmp_path):
    """Three files: two low satellites, a geostationary one, bad objects before a good one."""
    wrong = ISS.replace('1 25544U', '1 99999U').replace('ISS (ZARYA)', 'WRONG')
    old = tle('OLD', 40031, epoch='19300.50000000')
    for name, content in (('low.tle', ISS + OTHER), ('geo.tle', GEO), ('bad.tle', wrong + old + ISS)):
        (tmp_path / name).write_text(content)
    return tmp_path


@pytest.fixture
def planned(pedestal, files):
    """planned(*arguments) -> (exit code, {case: {metric: value}}, what it complained) of a plan."""
    def call(*words):
        code, _, errors = pedestal('plan', *words, '--json', 'rows.json')
        return code, metrics((files / 'rows.json').read_text()), errors
    return call


def metrics(text):
    """{case: {metric: value}} of the JSON."""
    found = {}
    for row in json.loads(text)['rows']:
        assert set(row) == {'case', 'metric', 'value', 'unit', 'paper', 'target'}
        assert row['paper'] is row['target'] is None
        found.setdefault(row['case'], {})[row['metric']] = row['value']
    return found


def test_the_rows_of_the_interface_are_those_of_skyfield(files):
    command = 'plan', 'low.tle', *PLACE, '--hours', '24', '--horizon', '5', '--json', '-'
    done = subprocess.run([sys.executable, '-m', 'pedestal.cli', *command], cwd=files, capture_output=True, text=True,
                          timeout=300, check=True)
    found = metrics(done.stdout)
    assert 'Weighted contact time' in done.stderr
    assert all(list(values)[:len(FIRST_METRICS)] == FIRST_METRICS for values in found.values())
    rises = [values['rise_s'] for values in found.values()]
    assert rises == sorted(rises) and {case.rpartition('/')[0] for case in found} == {'ISS (ZARYA)', '43013'}
    timescale = load.timescale(builtin=True)
    start = timescale.from_datetime(BEGIN.replace(tzinfo=datetime.timezone.utc))
    for name, lines in (('ISS (ZARYA)', ISS.splitlines()[1:]), ('43013', OTHER.splitlines())):
        satellite, place = EarthSatellite(*lines, ts=timescale), wgs84.latlon(47.4, 8.5, 500.0)
        times, events = satellite.find_events(place, start, start + 1.0, altitude_degrees=5.0)
        expected = [(86400.0 * (t - start), (satellite - place).at(t).altaz()[0].degrees) for t in times]
        for i in range(len(events) // 3):
            own = found[f'{name}/{i + 1}']
            assert events[3 * i:3 * i + 3].tolist() == [0, 1, 2]
            assert [own['rise_s'], own['set_s']] == pytest.approx([expected[3 * i][0], expected[3 * i + 2][0]],
                                                                  abs=0.1)
            assert own['culmination_s'] == pytest.approx(expected[3 * i + 1][0], abs=0.5)   # as find_events is exact
            assert own['max_elevation_deg'] == pytest.approx(expected[3 * i + 1][1], abs=0.002)
    assert {values['taken'] for values in found.values()} <= {0, 1} and max(
        values['peak_azimuth_rate_deg_s'] for values in found.values()) > 1.0


def test_every_file_says_the_same_and_repeats_to_the_byte(pedestal, files):
    names = {'json': 'p.json', 'csv': 'p.csv', 'ics': 'p.ics', 'html': 'p.html', 'output': 'plan.json'}
    contents = []
    for _ in range(2):
        options = [word for option, name in names.items() for word in (f'--{option}', name)]
        code, said, _ = pedestal('plan', 'low.tle', *PLACE, '--horizon', 5, *options)
        assert code == 0
        contents.append([said, *((files / name).read_bytes() for name in names.values())])
        for name in names.values():
            (files / name).unlink()
    assert contents[0] == contents[1]
    said, rows, table, calendar, page, plan = contents[0]
    found = metrics(rows)
    taken = [case for case, values in found.items() if values['taken']]
    lines = list(csv.DictReader(table.decode().splitlines()))
    assert [line['case'] for line in lines] == list(found) and all(case in said for case in found)
    assert [str(event['summary']) for event in icalendar.Calendar.from_ical(calendar).walk('VEVENT')] == taken
    assert page.decode().count('<svg') == 1 + len(found)
    (files / 'plan.json').write_bytes(plan)
    contacts = file.read(files / 'plan.json').contacts
    assert [contact.case for contact in contacts if contact.taken] == taken
    assert {contact.case: contact.begin - file.seconds(BEGIN) for contact in contacts if contact.taken} == {
        case: pytest.approx(found[case]['begin_s'], abs=1e-3) for case in taken}


def test_a_bad_object_is_refused_and_the_others_are_planned(planned, pedestal, files):
    code, found, errors = planned('bad.tle', 'low.tle', *PLACE)
    assert code == 0 and any(case.startswith('ISS (ZARYA)/') for case in found)
    assert 'bad.tle: line 5: OLD: the epoch of the elements is 43' in errors and 'Traceback' not in errors
    assert [line for line in errors.splitlines() if 'bad.tle: line 2: WRONG' in line]
    (files / 'only.tle').write_text(tle('OLD', 40031, epoch='19300.50000000'))
    code, said, errors = pedestal('plan', 'only.tle', *PLACE)
    assert (code, said) == (2, '') and 'only.tle: line 2: OLD: ' in errors and errors.count('error: ') == 1


def test_a_geostationary_satellite_has_the_times_that_the_user_chooses(planned, pedestal):
    code, said, errors = pedestal('plan', 'geo.tle', 'low.tle', *PLACE, '--hours', 6)
    assert code == 0 and 'no --window' in said and 'GEO/1: does not set; choose its times with --window' in errors
    code, found, _ = planned('geo.tle', 'low.tle', *PLACE, '--hours', 6, '--priority', '40874=5', '--window',
                             'GEO=2019-12-10T07:00/2019-12-10T08:00', '40874=2019-12-10T09:00/2019-12-10T09:30')
    assert [(found[case][name]) for case in ('GEO/1', 'GEO/2') for name in ('begin_s', 'end_s', 'priority')] == [
        3600.0, 7200.0, 5.0, 10800.0, 12600.0, 5.0]
    assert code == 0 and found['GEO/1']['taken'] == 1
    code, _, errors = pedestal('plan', 'low.tle', *PLACE, '--window', '25544=2019-12-10T07:00/2019-12-10T08:00')
    assert code == 2 and 'the object rises and sets' in errors


def test_objects_are_selected_by_name_by_number_and_by_a_weight_of_0(planned, pedestal):
    for words, expected in ((('--satellite', 'iss (zarya)'), {'ISS (ZARYA)'}), (('--satellite', '43013'), {'43013'}),
                            (('--priority', '43013=0'), {'ISS (ZARYA)'}),
                            (('--satellite', '43013', '25544', '--satellite', '25544'), {'ISS (ZARYA)', '43013'})):
        code, found, _ = planned('low.tle', *PLACE, *words)
        assert code == 0 and {case.rpartition('/')[0] for case in found} == expected
    code, _, errors = pedestal('plan', 'low.tle', *PLACE, '--priority', '43013=0', '25544=0')
    assert code == 2 and '--priority: the weight of every object is 0; no object is left to plan' in errors


def test_more_passes_than_a_plan_holds_are_refused(pedestal, files, monkeypatch):
    monkeypatch.setattr(planning, 'MAX_PASSES', 9)
    code, said, errors = pedestal('plan', 'low.tle', *PLACE)
    assert (code, said) == (2, '') and 'must be at most 9; choose objects by --satellite, or fewer --hours' in errors


@pytest.mark.every_case
@pytest.mark.parametrize(('words', 'expected'), (
    (('--station', '91,0,0'), '--station 91,0,0: latitude_deg = 91 deg: must be -90 to 90'),
    (('--station', '1,2'), "--station '1,2': must be LATITUDE,LONGITUDE,HEIGHT"),
    (('--station', 'nan,0,0'), '--station nan,0,0: latitude_deg = nan deg: must be'),
    (('--from', 'tomorrow'), "--from = 'tomorrow': must be UTC"),
    (('--from', '9999-12-31T23:00'), 'must be in the years 1957 to 2099'),
    (('--hours', '0'), '--hours 0: must be above 0 and at most'), (('--hours', 'nan'), '--hours nan: must be'),
    (('--hours', '1e9'), '--hours 1e+09: must be'), (('--horizon', '95'), '--horizon 95: must be -5 to 89 deg'),
    (('--horizon', 'nan'), '--horizon nan: must be'), (('--rain-margin', '-1'), '--rain-margin -1: must be 0 to 100'),
    (('--priority', 'ISS'), '--priority ISS'), (('--priority', '25544=x'), '--priority 25544=x'),
    (('--priority', '25544=-1'), '--priority 25544=-1'), (('--priority', 'IS=2'), 'no object'),
    (('--satellite', '25545'), "--satellite 25545: no object '25545' in the files; did you mean '"),
    (('--window', 'GEO'), '--window GEO: must be NAME=UTC/UTC'),
    (('--window', '25544=2019-12-10T09:00/2019-12-10T08:00'), 'must begin before it ends, inside the night'),
    (('--window', 'GEO=2019-12-10T09:00/2019-12-10T10:00'), "no object 'GEO'"),
    (('--window', '25544=9/2019-12-10T08:00'), 'must be UTC as ISO 8601'),
    (('--min-pass', '-1'), '--min-pass = -1 s: must be'), (('--setup', 'nan'), '--setup = nan s: must be'),
    (('--time-limit', '0'), '--time-limit = 0 s: must be'), (('--scenario', 'no_such'), "unknown scenario 'no_such'"),
    (('--param', 'acu.no_such=1'), 'no_such'), (('--csv', 'low.tle'), '--csv low.tle: exists already'),
    (('--csv', 'new', '--ics', 'new'), 'is also the file of --'),
    (('--html', 'no/x.html'), 'in a directory that exists'),
    (('--output', '-'), '--output -: must be the name of a file'), (('missing.tle',), 'missing.tle: no such file')))
def test_a_wrong_option_is_refused_in_one_line(words, expected, pedestal, files):
    code, said, errors = pedestal('plan', 'low.tle', *words[:1] * (not words[0].startswith('-')),
                                  *(PLACE if '--station' not in words else PLACE[2:]),
                                  *words * words[0].startswith('-'))
    assert (code, said) == (2, '') and expected in errors and errors.count('\n') == 1
    assert sorted(path.name for path in files.iterdir()) == ['bad.tle', 'geo.tle', 'low.tle']


@pytest.mark.parametrize(('one', 'other'), (('0,180,0', '0,-180,0'), ('90,0,0', '90,0,0'), ('-90,45,10', '-90,45,10'),
                                            ('71,-179.999,0', '71,180.001,0')))
def test_a_station_at_the_pole_or_on_the_date_line_has_passes(one, other, planned):
    found = []
    for station in (one, other):
        code, rows, _ = planned('low.tle', '--station', station, *PLACE[2:])
        assert code == 0
        found.append(rows)
    assert any(case.startswith('43013/') for case in found[0])
    assert [(case, pytest.approx(values['rise_s'], abs=1e-3)) for case, values in found[0].items()] == [
        (case, values['rise_s']) for case, values in found[1].items()]


def test_a_contact_leaves_out_a_loss_at_an_end_of_its_pass(planned):
    """A sector hides the west up to 30 deg: passes begin or end behind it."""
    code, found, _ = planned('low.tle', *PLACE, '--satellite', '25544', '--param', 'acu.blockage=3.3 6.1 0.5')
    seen = [each for each in found.values() if each['taken'] and each['loss_s']]
    assert code == 0 and seen
    for each in seen:
        assert each['begin_s'] == pytest.approx(each['rise_s']) or each['end_s'] == pytest.approx(each['set_s'])
        assert each['end_s'] - each['begin_s'] == pytest.approx(each['set_s'] - each['rise_s'] - each['loss_s'])
