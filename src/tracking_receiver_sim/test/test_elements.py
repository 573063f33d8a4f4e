"""Files of orbital elements of many satellites: OMM as sgp4's exporter and CelesTrak write them, in four forms."""
import csv
import datetime
import io
import json
import re

import pytest
from sgp4 import omm
from sgp4.api import WGS72, Satrec
from sgp4.exporter import export_omm
from sgp4.io import compute_checksum

from pedestal_common.geometry import omm as omm_elements
from pedestal_common.geometry import orbit
from tracking_receiver_sim import elements
from tracking_receiver_sim.params import LeoPassParameters

LINES = LeoPassParameters().line_1, LeoPassParameters().line_2
ISS = {keyword: str(value) for keyword, value in export_omm(Satrec.twoline2rv(*LINES), 'ISS (ZARYA)').items()}
OTHERS = [{**ISS, 'OBJECT_NAME': f'STARLINK-{number}', 'NORAD_CAT_ID': str(number),
           'OBJECT_ID': f'2020-00{number % 7}B'} for number in range(44_700, 44_710)]
NEW = {**ISS, 'OBJECT_NAME': 'NEW ONE', 'NORAD_CAT_ID': '270001', 'EPOCH': '2019-12-09T16:38:29',
       'MEAN_ANOMALY': '-10.5'}
ALL = [*OTHERS, ISS, NEW]


TLE = Satrec.twoline2rv(*LINES)


def assert_same(chosen, name, number, theirs):
    """Elements.read gave this satellite, with the elements of a Satrec."""
    ours = orbit.satellite(LeoPassParameters(**chosen.values))
    assert (chosen.name, ours.number, chosen.remark) == (name, number, '')
    for key in ('no_kozai', 'ecco', 'inclo', 'nodeo', 'argpo', 'bstar'):
        assert getattr(ours, key) == pytest.approx(getattr(theirs, key), rel=1e-9, abs=1e-15), key
    assert ours.mo == pytest.approx(theirs.mo % 6.283185307179586)
    assert ours.jdsatepoch + ours.jdsatepochF == pytest.approx(theirs.jdsatepoch + theirs.jdsatepochF, abs=1e-8)


def kvn(objects):
    return ''.join('CCSDS_OMM_VERS = 2.0\nCOMMENT a test\nMETA_START\n' + ''.join(
        f'{keyword} = {value}\n' + ('META_STOP\n' if keyword == 'MEAN_ELEMENT_THEORY' else '')
        for keyword, value in fields.items()) for fields in objects)


def xml(objects):
    meta = ('OBJECT_NAME', 'OBJECT_ID', 'CENTER_NAME', 'REF_FRAME', 'TIME_SYSTEM', 'MEAN_ELEMENT_THEORY')
    of_tle = ('EPHEMERIS_TYPE', 'CLASSIFICATION_TYPE', 'NORAD_CAT_ID', 'ELEMENT_SET_NO', 'REV_AT_EPOCH', 'BSTAR',
              'MEAN_MOTION_DOT', 'MEAN_MOTION_DDOT')

    def part(name, keywords, fields):
        return f'<{name}>' + ''.join(f'<{key}>{fields[key]}</{key}>' for key in keywords) + f'</{name}>'

    return '<?xml version="1.0"?>\n<ndm>\n' + '\n'.join(
        '<omm><body><segment>' + part('metadata', meta, fields) + '<data>' + part('meanElements', [
            key for key in fields if key not in (*meta, *of_tle)], fields) + part('tleParameters', of_tle, fields)
        + '</data></segment></body></omm>' for fields in objects) + '\n</ndm>\n'


def table(objects):
    stream = io.StringIO()
    writer = csv.DictWriter(stream, ISS)
    writer.writeheader()
    writer.writerows(objects)
    return stream.getvalue()


FORMS = {'kvn': kvn, 'xml': xml, 'csv': table, 'json': lambda objects: json.dumps(objects, indent=1),
         'numbers.json': lambda objects: json.dumps([
             {key: json.loads(value) if key in (*omm_elements.NUMBER_LIMITS, 'NORAD_CAT_ID') else value
              for key, value in fields.items()}
             for fields in objects])}


@pytest.mark.parametrize('form', FORMS)
def test_a_satellite_is_found_by_name_number_or_designator(form, tmp_path):
    path = tmp_path / f'a.{form}'
    path.write_text(FORMS[form](ALL))
    for name in ('iss (zarya)', '25544', '1998-067a'):
        if name != '1998-067a' or form == 'kvn':
            path.write_text(FORMS[form](ALL[:-1]))
        assert_same(elements.read(path, name), 'ISS (ZARYA)', '25544', TLE)


@pytest.mark.parametrize('form', FORMS)
def test_a_number_beyond_five_digits_and_an_epoch_without_a_fraction(form, tmp_path):
    path = tmp_path / f'a.{form}'
    path.write_text(FORMS[form](ALL))
    theirs = Satrec()
    omm.initialize(theirs, {**NEW, 'EPOCH': '2019-12-09T16:38:29.0'}, WGS72)
    assert_same(elements.read(path, '270001'), 'NEW ONE', '270001', theirs)


WIDE = {'nine digits': {'NORAD_CAT_ID': '799501299'}, 'revolutions': {'REV_AT_EPOCH': '123456'},
        'set': {'ELEMENT_SET_NO': '123456'}, 'tiny': {'BSTAR': '-1e-12'}, 'large': {'BSTAR': '12.5'},
        'derivative': {'MEAN_MOTION_DOT': '-4.5'}, 'second': {'MEAN_MOTION_DDOT': '1e-14'},
        'type': {'EPHEMERIS_TYPE': '2'}, 'Alpha-5': {'NORAD_CAT_ID': 'T0001'},
        'digits': {'MEAN_MOTION': '15.501034720123', 'ECCENTRICITY': '0.00074171234'}}


@pytest.mark.parametrize('case', WIDE)
@pytest.mark.parametrize('form', ['kvn', 'json', 'csv', 'xml'])
def test_numbers_that_a_tle_cannot_hold(case, form, tmp_path):
    fields, path = {**ISS, **WIDE[case]}, tmp_path / 'a'
    path.write_text(FORMS[form]([fields]))
    theirs = Satrec()
    omm.initialize(theirs, {**fields, 'NORAD_CAT_ID': '0', 'REV_AT_EPOCH': '0', 'ELEMENT_SET_NO': '0'}, WGS72)
    number = {'nine digits': '799501299', 'Alpha-5': '270001'}.get(case, '25544')
    assert_same(elements.read(path, number), 'ISS (ZARYA)', number, theirs)


def test_a_csv_may_begin_with_the_keyword_of_a_kvn(tmp_path):
    """Programs that write all keywords of an OMM as columns begin with its version."""
    path, fields = tmp_path / 'a.csv', {'CCSDS_OMM_VERS': '3.0', **ISS}
    path.write_text(','.join(fields) + '\n' + ','.join(fields.values()) + '\n')
    assert elements.read(path).values['omm'] and elements.read(path, '25544').name == elements.read(path).name
    path.write_text(path.read_text().replace('INCLINATION', 'INCLINATION [rad]'))
    with pytest.raises(ValueError, match=r'INCLINATION: unit \[rad\]: must be \[deg\]'):
        elements.read(path)


def test_a_history_of_omm_and_a_satellite_without_a_number(tmp_path):
    path = tmp_path / 'a.json'
    later = {**ISS, 'EPOCH': '2019-12-12T00:00:00'}
    path.write_text(json.dumps([ISS, later]))
    early, late = (elements.read(path, '25544', datetime.datetime(2019, 12, day)) for day in (10, 20))
    epochs = [json.loads(each.values['omm'])['EPOCH'][:13] for each in (early, late)]
    assert epochs == ['2019-12-09T16', '2019-12-12T00']
    assert early.remark.startswith('a.json: 2 sets of elements of satellite 25544, of 2019-12-09 to 2019-12-12')
    path.write_text(json.dumps({key: value for key, value in ISS.items() if key != 'NORAD_CAT_ID'}))
    assert orbit.satellite(LeoPassParameters(**elements.read(path).values)).number == '1998-067A'


def test_a_satellite_without_number_and_names(tmp_path):
    path = tmp_path / 'a.json'
    path.write_text(json.dumps({key: value for key, value in ISS.items()
                                if key not in ('NORAD_CAT_ID', 'OBJECT_ID', 'OBJECT_NAME')}))
    assert orbit.satellite(LeoPassParameters(**elements.read(path).values)).number == 'without a name'


@pytest.mark.parametrize('when, julian', [
    ((2000, 1, 1, 12), (2451544.5, 0.5)), ((2026, 11, 26, 6), (2461370.5, 0.25)), ((2100, 2, 28), (2488127.5, 0.0)),
    ((2100, 3, 1, 18), (2488128.5, 0.75))])
def test_a_julian_date_is_right_beyond_the_year_2100(when, julian):
    """2100 has no 29 February; sgp4.api.jday counts one."""
    assert orbit.julian_date(datetime.datetime(*when)) == julian


@pytest.mark.parametrize('text, message', [
    ('{"EPOCH": ', 'omm: not valid JSON'), ('[]', 'omm: must be an object'),
    ('{}', 'omm: MEAN_MOTION is missing'),
    (json.dumps({**ISS, 'EPOCH': 'today'}), "omm: EPOCH = 'today': must be UTC as ISO 8601"),
    (json.dumps({**ISS, 'MEAN_MOTION': '99'}), 'omm: MEAN_MOTION = 99: must be 0.05 to 18'),
    (json.dumps({**ISS, 'EPHEMERIS_TYPE': 4}), 'omm: ephemeris type 4: must be 0 or 2')])
def test_a_parameter_that_is_no_omm(text, message):
    with pytest.raises(orbit.TargetError, match=message):
        orbit.satellite(LeoPassParameters(omm=text))


def test_one_satellite_goes_without_a_name(tmp_path):
    path = tmp_path / 'a.json'
    path.write_text(json.dumps(ISS))
    assert_same(elements.read(path), 'ISS (ZARYA)', '25544', TLE)
    other = [line.replace('25544', '25545') for line in LINES]
    path.write_text('ISS\n{}\n{}\nISS\n{}\n{}\n'.format(*LINES, *other))
    with pytest.raises(orbit.TargetError, match='satellites: 2 found, ISS, ISS: name one with --satellite'):
        elements.read(path)
    with pytest.raises(orbit.TargetError, match="'ISS' is in it 2 times; name it by its number"):
        elements.read(path, 'ISS')


def test_an_omm_of_sgp4_may_omit_bstar_and_begin_with_a_comment(tmp_path):
    path = tmp_path / 'a.omm'
    path.write_text('COMMENT of an exporter\n' + kvn([{key: value for key, value in ISS.items() if key != 'BSTAR'}]))
    chosen = elements.read(path)
    assert chosen.name == 'ISS (ZARYA)' and orbit.satellite(LeoPassParameters(**chosen.values)).bstar == 0.0
    assert chosen.remark == 'a.omm: line 2: BSTAR is missing: taken as 0, without drag'


def xml_with_units(fields, unit):
    return re.sub(r'<([A-Z_]+)>', lambda m: f'<{m[1]} units="{unit(m[1])}">' if unit(m[1]) else m[0], xml([fields]))


WITH_UNITS = {      # {form: the text of fields with the unit(keyword) of each number, as this form states it}
    'kvn': lambda fields, unit: kvn([{key: f'{value} [{unit(key)}]' if unit(key) else value
                                      for key, value in fields.items()}]),
    'xml': xml_with_units,
    'csv': lambda fields, unit: table([fields]).replace('\r', '').replace(','.join(fields), ','.join(
        f'{key} [{unit(key)}]' if unit(key) else key for key in fields)),
    'json': lambda fields, unit: json.dumps([{key: f'{value} [{unit(key)}]' if unit(key) else value
                                              for key, value in fields.items()}])}


@pytest.mark.parametrize('spelled', [str, str.upper, lambda unit: unit.replace('**', '^').replace('deg', 'degrees')])
@pytest.mark.parametrize('form', WITH_UNITS)
def test_the_unit_of_the_standard_is_accepted_in_any_spelling(form, spelled, tmp_path):
    path = tmp_path / f'a.{form}'
    path.write_text(WITH_UNITS[form](ISS, lambda keyword: spelled(omm_elements.STANDARD_UNITS.get(keyword, ''))))
    assert_same(elements.read(path), 'ISS (ZARYA)', '25544', TLE)


@pytest.mark.parametrize('keyword, unit', [('INCLINATION', 'rad'), ('MEAN_MOTION', 'rad/min'), ('BSTAR', '1/m'),
                                           ('MEAN_MOTION_DOT', 'rev/day'), ('ECCENTRICITY', 'deg')])
@pytest.mark.parametrize('form', WITH_UNITS)
def test_another_unit_is_refused_by_its_keyword(form, keyword, unit, tmp_path):
    path = tmp_path / f'a.{form}'
    path.write_text(WITH_UNITS[form](ISS, lambda key: unit if key == keyword else ''))
    standard = omm_elements.STANDARD_UNITS[keyword]
    with pytest.raises(orbit.TargetError, match=re.escape(
            f'{keyword}: unit [{unit}]: must be {f"[{standard}]" if standard else "absent"}')):
        elements.read(path)


@pytest.mark.parametrize('form', FORMS)
def test_an_empty_optional_value_counts_as_missing(form, tmp_path):
    path = tmp_path / f'a.{form}'
    empty = dict.fromkeys(('MEAN_MOTION_DOT', 'MEAN_MOTION_DDOT', 'BSTAR', 'CENTER_NAME', 'EPHEMERIS_TYPE'), '')
    fields = {**ISS, **empty}
    path.write_text(table([fields]) if form == 'csv' else WITH_UNITS[form.rpartition('.')[2]](fields, lambda _: ''))
    chosen = elements.read(path)
    satrec = orbit.satellite(LeoPassParameters(**chosen.values))
    assert (satrec.bstar, satrec.ndot, satrec.inclo) == (0.0, 0.0, TLE.inclo) and 'BSTAR is missing' in chosen.remark


@pytest.mark.parametrize('year, day, message', [
    ('19', '366.50000000', 'line 1: epoch day 366.50000000: must be 1 to below 366 in 2019'), ('20', '366.5', ''),
    ('19', '000.5', 'line 1: epoch day 000.5'), ('00', '366.9', ''), ('57', '366.0', 'below 366 in 1957')])
def test_the_day_of_an_epoch_is_one_of_its_year(year, day, message, tmp_path):
    path, line = tmp_path / 'a.tle', f'{LINES[0][:18]}{year}{day:<012}{LINES[0][32:68]}'
    path.write_text(f'{line}{compute_checksum(line)}\n{LINES[1]}\n')
    if message:
        with pytest.raises(orbit.TargetError, match=message):
            elements.read(path)
    else:
        assert elements.read(path).values['line_1'].startswith(line)


REFUSED = {
    'day 366': (lambda: kvn([{**ISS, 'EPOCH': '2019-366T00:00:00'}]), '', "EPOCH = '2019-366T00:00:00': must be a ti"),
    'unit of a time': (lambda: kvn([{**ISS, 'EPOCH': ISS['EPOCH'] + ' [TAI]'}]), '', r"EPOCH = '.* \[TAI\]': must be"),
    'no drag term': (lambda: kvn([{key: value for key, value in ISS.items()
                                   if key not in ('BSTAR', 'MEAN_ELEMENT_THEORY')}]), '',
                     'line 1: BSTAR is missing: only an OMM with MEAN_ELEMENT_THEORY = SGP4 may omit it'),
    'unknown': (lambda: kvn(ALL), 'STARLINK-4470', "is in it 0 times; did you mean 'STARLINK-44"),
    'theory': (lambda: kvn([{**ISS, 'MEAN_ELEMENT_THEORY': 'SGP4-XP'}]), '', "line 1: MEAN_ELEMENT_THEORY = 'SG"),
    'type': (lambda: json.dumps([{**ISS, 'EPHEMERIS_TYPE': 4}]), '', 'line 1: ephemeris type 4: .*needs SGP4-XP'),
    'xp': (lambda: kvn([{**ISS, 'BTERM': '0.02'}]), '', "line 1: BTERM = '0.02': must be absent"),
    'frame': (lambda: table([{**ISS, 'REF_FRAME': 'EME2000'}]), '', "line 2: REF_FRAME = 'EME2000': must be TEME"),
    'nan': (lambda: xml([ISS, {**NEW, 'ECCENTRICITY': 'nan'}]), 'new one', 'line 4: ECCENTRICITY = nan: must'),
    'missing': (lambda: kvn([{key: value for key, value in ISS.items() if key != 'INCLINATION'}]), '',
                'line 1: INCLINATION is missing'),
    'epoch': (lambda: json.dumps([{**ISS, 'EPOCH': 'today'}]), '', "EPOCH = 'today': must be a time such as"),
    'number': (lambda: json.dumps({**ISS, 'NORAD_CAT_ID': 10**9}), '',
               "NORAD_CAT_ID = '1000000000': must be 0 to 999999999"),
    'json': (lambda: json.dumps([ISS])[:-20], '', 'line 1, column [0-9]+: not valid JSON: '),
    'json of a server': (lambda: '{"error": "log in"}', '',
                         'line 1, column 1: EPOCH is missing; keywords found: error$'),
    'underscore': (lambda: json.dumps({**ISS, 'MEAN_MOTION': '15.50_1'}), '',
                   "MEAN_MOTION = '15.50_1': must be a number"),
    'json of numbers': (lambda: '[1, 2]', '', 'line 1, column 2: must be an object of an OMM'),
    'json in depth': (lambda: '{"a": ' * 200_000, '', 'JSON nested too deeply|not valid JSON'),
    'xml': (lambda: xml(ALL)[:-200], '25544', 'line [0-9]+, column [0-9]+: not well-formed XML'),
    'entities': (lambda: '<!DOCTYPE x [<!ENTITY a "b">]><ndm>&a;</ndm>', '', 'a document type declaration'),
    'kvn': (lambda: kvn([ISS]) + 'nonsense\n', '', "line 26, column 1: 'nonsense': must be KEYWORD = value"),
    'nothing': (lambda: '<ndm></ndm>', '', 'or an OMM'), 'csv': (lambda: 'EPOCH,x\n1,2\n', '', 'NORAD_CAT_ID')}


@pytest.mark.parametrize('case', REFUSED)
def test_what_does_not_do_is_refused(case, tmp_path):
    make, name, message = REFUSED[case]
    path = tmp_path / 'file'
    path.write_text(make())
    with pytest.raises(orbit.TargetError) as refused:
        elements.read(path, name)
    assert re.search(message, str(refused.value)) and str(refused.value).startswith('TLE file ')
    assert len(str(refused.value).splitlines()) == 1
