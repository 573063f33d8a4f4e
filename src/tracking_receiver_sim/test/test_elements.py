"""Files of orbital elements of many satellites: OMM as sgp4's exporter and CelesTrak write them, in four forms."""
import csv
import io
import json
import re

import pytest
from sgp4 import omm
from sgp4.api import WGS72, Satrec
from sgp4.exporter import export_omm

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
             {key: json.loads(value) if key in elements.NUMBER_LIMITS else value for key, value in fields.items()}
             for fields in objects])}


@pytest.mark.parametrize('form', FORMS)
def test_a_satellite_is_found_by_name_number_or_designator(form, tmp_path):
    path = tmp_path / f'a.{form}'
    path.write_text(FORMS[form](ALL))
    for name in ('iss (zarya)', '25544', '1998-067a'):
        if name != '1998-067a' or form == 'kvn':
            path.write_text(FORMS[form](ALL[:-1]))
        assert elements.read(path, name) == ('ISS (ZARYA)', *LINES)


@pytest.mark.parametrize('form', FORMS)
def test_a_number_beyond_five_digits_and_an_epoch_without_a_fraction(form, tmp_path):
    path = tmp_path / f'a.{form}'
    path.write_text(FORMS[form](ALL))
    name, *lines = elements.read(path, '270001')
    ours = orbit.satellite(LeoPassParameters(line_1=lines[0], line_2=lines[1]))
    theirs = Satrec()
    omm.initialize(theirs, {**NEW, 'EPOCH': '2019-12-09T16:38:29.0'}, WGS72)
    assert name == 'NEW ONE' and ours.satnum == 270_001 and ours.mo == pytest.approx(theirs.mo % 6.283185307179586)
    assert ours.jdsatepoch + ours.jdsatepochF == pytest.approx(theirs.jdsatepoch + theirs.jdsatepochF, abs=1e-8)


def test_one_satellite_goes_without_a_name(tmp_path):
    path = tmp_path / 'a.json'
    path.write_text(json.dumps(ISS))
    assert elements.read(path) == ('ISS (ZARYA)', *LINES)
    path.write_text('{0}\n{1}\nNEXT\n{0}\n{1}\n'.format(*LINES))
    with pytest.raises(orbit.TargetError, match='satellites: 2 found, 25544, NEXT: name one with --satellite'):
        elements.read(path)
    with pytest.raises(orbit.TargetError, match="'25544' is in it 2 times; name it by its number"):
        elements.read(path, '25544')


REFUSED = {
    'unknown': (lambda: kvn(ALL), 'STARLINK-4470', "is in it 0 times; did you mean 'STARLINK-44"),
    'theory': (lambda: kvn([{**ISS, 'MEAN_ELEMENT_THEORY': 'SGP4-XP'}]), '', "line 1: MEAN_ELEMENT_THEORY = 'SG"),
    'frame': (lambda: table([{**ISS, 'REF_FRAME': 'EME2000'}]), '', "line 2: REF_FRAME = 'EME2000': must be TEME"),
    'nan': (lambda: xml([ISS, {**NEW, 'ECCENTRICITY': 'nan'}]), 'new one', 'line 4: ECCENTRICITY = nan: must'),
    'missing': (lambda: kvn([{key: value for key, value in ISS.items() if key != 'INCLINATION'}]), '',
                'line 1: INCLINATION = None: must be a number'),
    'epoch': (lambda: json.dumps([{**ISS, 'EPOCH': 'today'}]), '', "EPOCH = 'today': must be a time such as"),
    'number': (lambda: json.dumps({**ISS, 'NORAD_CAT_ID': 400_000}), '', 'NORAD_CAT_ID = 400000: must be 0 to 339999'),
    'json': (lambda: json.dumps([ISS])[:-20], '', 'line 1, column [0-9]+: not valid JSON: '),
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
