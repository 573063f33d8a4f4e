"""Objects of a night from files as they come: many in a file, in all forms, with bad ones among them."""
import datetime
import json

import numpy as np
import pytest
from sgp4.api import Satrec
from sgp4.exporter import export_omm
from sgp4.io import compute_checksum

from pedestal_common.geometry import orbit
from pedestal_common.geometry.geodesy import StationParameters
from pedestal_common.geometry.orbit import TargetError
from pedestal_station import objects, planning, windows
from tracking_receiver_sim.params import LeoPassParameters

DAY_S = 86400.0
STATION, BEGIN = StationParameters(), datetime.datetime(2019, 12, 10, 6)
LINES = LeoPassParameters().line_1, LeoPassParameters().line_2
ISS = {keyword: str(value) for keyword, value in export_omm(Satrec.twoline2rv(*LINES), 'ISS (ZARYA)').items()}


def summed(line):
    return line[:68] + str(compute_checksum(line))


def tle(number='25544', day='343.69339541', name='', **changed):
    """The ISS with another number of five characters and another epoch."""
    one, two = (summed(line.replace('25544', number).replace('343.69339541', day)) for line in LINES)
    return f'{name}\n{changed.get("one", one)}\n{changed.get("two", two)}\n'.lstrip('\n')


def omm(**changed):
    return {**ISS, **changed}


def kvn(*fields):
    return ''.join('CCSDS_OMM_VERS = 2.0\n' + ''.join(f'{key} = {value}\n' for key, value in each.items())
                   for each in fields)


def csv(*fields):
    return ','.join(ISS) + '\n' + ''.join(','.join(each.values()) + '\n' for each in fields)


def xml(*fields):
    return '<?xml version="1.0"?>\n<ndm>\n' + '\n'.join(
        '<omm><body><segment>' + ''.join(f'<{key}>{value}</{key}>' for key, value in each.items())
        + '</segment></body></omm>' for each in fields) + '\n</ndm>\n'


def oem(*names, begin=BEGIN, count=60):
    """Objects in the orbit of the ISS in an OEM, with a state every 60 s."""
    satellite, text = orbit.satellite(LeoPassParameters()), 'CCSDS_OEM_VERS = 2.0\n'
    for name, designator in names:
        text += (f'META_START\nOBJECT_NAME = {name}\nOBJECT_ID = {designator}\nCENTER_NAME = EARTH\n'
                 'REF_FRAME = TEME\nTIME_SYSTEM = UTC\nMETA_STOP\n')
        for i in range(count):
            when = begin + datetime.timedelta(seconds=60 * i)
            _, r, v = satellite.sgp4(*orbit.julian_date(when))
            text += f'{when.isoformat()} ' + ' '.join(f'{value:.9f}' for value in (*r, *v)) + '\n'
    return text


def read(tmp_path, *texts, begin=BEGIN, duration=DAY_S, **options):
    """Read each text from a file of its own."""
    paths = []
    for i, text in enumerate(texts):
        paths.append(tmp_path / f'{i}.txt')
        paths[-1].write_text(text)
    return objects.read(paths, STATION, begin, duration, **options)


FORMS = {'kvn': kvn, 'csv': csv, 'xml': xml, 'json': lambda *fields: json.dumps(fields, indent=1)}


@pytest.mark.every_case
@pytest.mark.parametrize('form', FORMS)
def test_objects_of_an_omm_in_every_form(form, tmp_path):
    """Nine digits, Alpha-5, no name; a bad one among them."""
    fields = (omm(), omm(OBJECT_NAME='WIDE', NORAD_CAT_ID='799501299'), omm(OBJECT_NAME='', NORAD_CAT_ID='T0001'),
              omm(OBJECT_NAME='WILD', NORAD_CAT_ID='7', MEAN_MOTION='99'), omm(OBJECT_NAME='LAST', NORAD_CAT_ID='8'))
    found, [refused] = read(tmp_path, FORMS[form](*fields))
    assert [(each.name, each.number) for each in found] == [
        ('ISS (ZARYA)', '25544'), ('WIDE', '799501299'), ('270001', '270001'), ('LAST', '8')]
    assert refused.name == 'WILD' and refused.reason == 'MEAN_MOTION = 99: must be 0.05 to 18' and refused.line > 1
    [first, *_] = windows.find(found[0].orbit, windows.Horizon.constant(0.0), DAY_S)
    for each in found[1:]:
        assert windows.find(each.orbit, windows.Horizon.constant(0.0), DAY_S)[0] == first


def test_a_folder_of_tles_with_names_alpha_5_and_no_names(tmp_path):
    (tmp_path / 'a.tle').write_text(tle(name='0 ISS (ZARYA)') + tle('T0001') + tle('00005', name='VANGUARD'))
    (tmp_path / 'b.json').write_text(json.dumps([omm(OBJECT_NAME='VANGUARD', NORAD_CAT_ID='6')]))
    (tmp_path / '.hidden').write_text('x')
    (tmp_path / 'readme.md').write_text('These are elements.\n')
    found, [refused] = objects.read([tmp_path], STATION, BEGIN, DAY_S)
    assert [each.name for each in found] == ['ISS (ZARYA)', '270001', 'VANGUARD 5', 'VANGUARD 6']
    assert [(each.path.name, each.line) for each in found] == [('a.tle', 2), ('a.tle', 4), ('a.tle', 7), ('b.json', 1)]
    assert refused.path.name == 'readme.md' and refused.reason.startswith('must hold a TLE')
    assert [each.priority for each in planning.weighted(found, ['vanguard 6=3', '270001=0'])] == [1.0, 0.0, 1.0, 3.0]
    for text, message in (('FOO=1', "no object 'FOO'"), ('270001=-1', "weight = '-1': must be a number from 0 to")):
        with pytest.raises(ValueError, match=message):
            planning.weighted(found, [text])


@pytest.mark.parametrize('day, taken', [(2, '336.5'), (10, '343.69339541'), (20, '354.25')])
def test_of_several_sets_in_several_files_the_nearest_to_the_night_is_taken(day, taken, tmp_path):
    days = ('336.5', '343.69339541', '354.25')
    texts = [tle(day=f'{each:0<12}') for each in days[::-1]] + [tle('25545')]
    found, refused = read(tmp_path, texts[0] + texts[1], texts[2], texts[3], begin=datetime.datetime(2019, 12, day, 6))
    assert [each.number for each in found] == ['25544', '25545'] and not refused
    assert found[0].orbit.values.line_1[20:].startswith(taken)
    assert found[0].remark.startswith('3 sets of elements; taken: ') and not found[1].remark


def test_a_bad_set_gives_way_to_the_next_one(tmp_path):
    bad = tle(day='344.75000000')
    found, [refused] = read(tmp_path, tle() + bad[:100] + '9' + bad[101:])
    assert found[0].orbit.values.line_1 == LINES[0]
    assert (refused.line, refused.name) == (3, '25544') and refused.reason.startswith('TLE line 2: checksum ')


SEVEN = [summed(line.replace('25544', '00007')) for line in LINES]
BAD = {     # {case: (text between two good TLEs, line, reason)}
    'checksum': (tle('00007')[:-2] + 'x\n', 3, 'TLE line 2: checksum'),
    'second line lost': (SEVEN[0] + '\n', 3, 'must have a line that begins with "2 " behind this one'),
    'first line lost': (SEVEN[1] + '\n', 3, 'must have a line that begins with "1 " before this one'),
    'cut': (tle('00007')[:-30] + '\n', 3, 'TLE line 2: 40 characters'),
    'two satellites': (tle('00007', two=LINES[1]), 3, "TLE line 2: satellite '25544', must be '00007'"),
    'epoch': (tle('00007', day='3x3.69339541'), 3, "column 19: epoch = '193x3.69339541'"),
    'decayed': (tle('00007', two=summed(SEVEN[1].replace(' 15.5010', ' 17.9010'))), 3, 'has decayed'),
    'below the ground': (tle('00007', two=summed(SEVEN[1].replace('0007417', '9007417'))), 3,
                         'TLE of satellite 00007: 20'),
    'sgp4-xp': (tle('00007', one=summed(SEVEN[0][:62] + '4' + LINES[0][63:])), 3, 'type 4 needs SGP4-XP'),
    'old': (tle('00007', day='320.00000000'), 3,
            'the epoch of the elements is 24.2 days before the pass, must be at most 14'),
    'ahead': (tle('00007', day='365.00000000'), 3, 'the epoch of the elements is 19.8 days after the pass')}


@pytest.mark.every_case
@pytest.mark.parametrize('case', BAD)
def test_a_bad_object_is_refused_by_file_line_and_reason_and_the_others_go_on(case, tmp_path):
    text, line, reason = BAD[case]
    found, [refused] = read(tmp_path, tle() + text + tle('00009', name='LAST'))
    assert [each.name for each in found] == ['25544', 'LAST']
    assert (refused.path.name, refused.line) == ('0.txt', line) and reason in refused.reason, refused


BAD_FILES = {
    'empty': ('', 0, 'must hold a TLE'), 'text': ('<html></html>', 0, 'must hold a TLE'),
    'one line': (LINES[0], 1, 'must have a line that begins with "2 " behind this one'),
    'json': (json.dumps([omm(), omm(NORAD_CAT_ID='7')])[:-20], 1, 'not valid JSON'),
    'json without elements': (json.dumps([omm(), {'error': 'log in'}, 7]), 1, 'EPOCH is missing; keywords'),
    'xml': (xml(omm(), omm(NORAD_CAT_ID='7'))[:-200], 4, 'not well-formed XML'),
    'kvn': (kvn(omm(), omm(NORAD_CAT_ID='7')) + 'nonsense\n', 45, "column 1: 'nonsense': must be KEYWORD = value"),
    'csv': (csv(omm(), {**omm(), 'more': '7,7'}, omm(NORAD_CAT_ID='8')), 3, 'cells, must be 21 as in line 1'),
    'oem as xml': ('<oem id="CCSDS_OEM_VERS"></oem>', 0, 'an OEM must be in the notation KEYWORD = value'),
    'gzip': ('\x1f\x8b', 0, 'compressed by gzip'), 'binary': ('\0\0\0', 1, 'must be text in UTF-8')}


@pytest.mark.every_case
@pytest.mark.parametrize('case', BAD_FILES)
def test_a_bad_file_is_refused_and_what_it_holds_before_goes_on(case, tmp_path):
    text, line, reason = BAD_FILES[case]
    path = tmp_path / 'a'
    path.write_bytes(text.encode('latin-1'))
    (tmp_path / 'b').write_text(tle('00009'))
    found, refused = objects.read([path, tmp_path / 'b'], STATION, BEGIN, DAY_S)
    numbers = {'json': ['25544'], 'json without elements': ['25544'], 'xml': ['25544'], 'kvn': ['25544'],
               'csv': ['25544', '8']}
    assert [each.number for each in found] == [*numbers.get(case, []), '9']
    assert (refused[0].path, refused[0].line) == (path, line) and reason in refused[0].reason, refused
    assert len(refused) == (2 if case == 'json without elements' else 1)


def test_a_path_that_does_not_exist(tmp_path):
    for path, message in ((tmp_path / 'nowhere', 'nowhere: no such file'), (tmp_path, 'no file in this folder')):
        with pytest.raises(TargetError, match=message):
            objects.read([path], STATION, BEGIN, DAY_S)


def test_the_age_is_that_in_the_pass(tmp_path):
    [each], _ = read(tmp_path, tle(), begin=datetime.datetime(2019, 12, 12), duration=20.0 * DAY_S)
    rises = [(objects.age_warning(each.orbit, t), objects.age_refusal(each.orbit, t))
             for t in (0.0, 1.0 * DAY_S, 15.0 * DAY_S)]
    assert rises[0] == ('', '')
    assert rises[1] == ('elements 3.3 days from the pass, above 3 days for a low satellite', '')
    assert rises[2][1].startswith('the epoch of the elements is 17.3 days before the pass, must be at most 14 (acu.p')
    assert objects.age_refusal(each.orbit, 15.0 * DAY_S, 365.0) == ''
    assert 'at most 30' in objects.age_refusal(each.orbit, 40.0 * DAY_S, 365.0)
    late, [refused] = read(tmp_path, tle(), begin=datetime.datetime(2019, 12, 12), oldest=1.0)
    assert not late and 'must be at most 1 ' in refused.reason


def test_objects_of_an_oem_are_where_their_elements_say(tmp_path):
    """Two objects, of which one is also in a TLE; a wrong number; another day; a part of the night."""
    station_keeping = oem(('ISS (ZARYA)', '1998-067-A'), ('OTHER', '2020-001B'), count=1500)
    found, refused = read(tmp_path, station_keeping, tle(name='ISS'), duration=0.5 * DAY_S)
    assert [(each.name, each.number) for each in found] == [('ISS (ZARYA)', '25544'), ('OTHER', '')] and not refused
    assert found[0].remark == '2 sets of elements; taken: 0.txt, line 8'
    [elements], _ = read(tmp_path, tle(), duration=0.5 * DAY_S)
    times = np.arange(0.0, 0.5 * DAY_S, 777.0)
    assert np.abs(found[0].orbit.enu(times) - elements.orbit.enu(times)).max() < 2.0
    horizon = windows.Horizon.constant(0.0)
    known = windows.find(elements.orbit, horizon, 0.5 * DAY_S)
    for each in found:
        ours = windows.find(each.orbit, horizon, 0.5 * DAY_S)
        np.testing.assert_allclose([w[2:5] for w in ours], [w[2:5] for w in known], rtol=0.0, atol=0.01)
        assert len(known) == 6 and not any(w.endless for w in ours)
    assert objects.age_warning(found[0].orbit, 0.0) == objects.age_refusal(found[0].orbit, 0.0) == ''


def test_an_oem_that_covers_a_part_of_the_night_or_none(tmp_path):
    """The window is cut where the file begins, and in two by a gap of the file."""
    horizon = windows.Horizon.constant(0.0)
    [elements], _ = read(tmp_path, tle())
    [whole, *_] = windows.find(elements.orbit, horizon, DAY_S)
    top = BEGIN + datetime.timedelta(seconds=round(whole.culmination))
    [part], _ = read(tmp_path, oem(('A', '2020-001A'), begin=top))
    assert part.remark.startswith('0.txt: the ephemeris is of 2019-12-10T') and part.remark.endswith(' of the night')
    [cut] = windows.find(part.orbit, horizon, DAY_S)
    assert (cut.rise, cut.set) == pytest.approx((round(whole.culmination), whole.set), abs=0.01) and not cut.endless
    assert np.isnan(part.orbit.enu(np.array([0.0]))).all()
    rows = oem(('A', '2020-001A'), begin=top - datetime.timedelta(seconds=1800)).splitlines()
    [part], _ = read(tmp_path, '\n'.join(rows[:36] + rows[41:]))       # the first state is in row 8
    before, after = windows.find(part.orbit, horizon, DAY_S)
    assert (before.rise, after.set) == pytest.approx((whole.rise, whole.set), abs=0.01)
    assert (before.set, after.rise) == pytest.approx((cut.rise - 180.0, cut.rise + 180.0), abs=0.01)
    none, [refused] = read(tmp_path, oem(('A', '2020-001A'), begin=BEGIN - datetime.timedelta(days=3)), duration=600.0)
    assert not none and refused.reason.endswith('outside the night')


def test_a_wrong_number_in_an_oem_is_of_its_object_only(tmp_path):
    rows = oem(('A', '2020-001A'), ('B', '2020-001B'), count=20).splitlines()
    rows[12] = rows[12].replace('.', '.x', 2)
    [other], [refused] = read(tmp_path, '\n'.join(rows))
    assert other.name == 'B' and (refused.line, refused.name) == (13, 'A') and 'must be' in refused.reason
