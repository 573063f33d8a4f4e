"""Files across the leap second at the end of 2016, and logs across midnight."""
import datetime

import numpy as np
import pynmea2
import pytest

from pedestal_common.geometry import orbit
from pedestal_common.geometry.geodesy import StationParameters
from pedestal_common.text_files import csv_table
from tracking_receiver_sim import target
from tracking_receiver_sim.params import TargetParameters, TrackFileParameters
from tracking_receiver_sim.tracks import files as track_files
from tracking_receiver_sim.tracks import instant

STATION = StationParameters(latitude_deg=30.0, longitude_deg=-74.0, height=0.0)
BEGIN = datetime.datetime(2016, 12, 31, 23, 55)
STATES = """
0 6463.334629 1461.226697 1843.608041 -2.603665201 4.443387930 5.606160399
60 6292.983447 1724.413326 2175.666933 -3.072620605 4.326275524 5.458401405
120 6094.891095 1979.998276 2498.134897 -3.528031067 4.190091726 5.286580304
180 5869.930815 2226.854858 2809.590407 -3.967889015 4.035436873 5.091454528
240 5619.094295 2463.894862 3108.660484 -4.390255436 3.862992723 4.873884245
300 5343.487289 2690.073352 3394.026745 -4.793268425 3.673519457 4.634828563
301 5338.690748 2693.745223 3398.659494 -4.799811098 3.670221949 4.630668145
361 5039.146507 2907.859345 3668.804316 -5.181327365 3.464292408 4.370849809
421 4717.388345 3109.154837 3922.776057 -5.540002941 3.243091329 4.091763585
481 4374.834662 3296.744334 4159.455141 -5.874256689 3.007593828 3.794639762
""".strip().splitlines()
"""Seconds from BEGIN, 300 is the leap second; position and velocity of a circular orbit in EME2000 [km], [km/s]."""
SEEN = {270.0: (216.617, 65.477), 290.0: (205.437, 80.437), 331.0: (49.982, 66.328)}
"""{seconds from BEGIN: azimuth and elevation [deg]} of this orbit from STATION."""


def utc(passed, row=''):
    """The UTC of a number of seconds after BEGIN."""
    if passed == 300:
        return '2016-12-31T23:59:60' + row
    return (BEGIN + datetime.timedelta(seconds=passed - (passed > 300))).isoformat() + row


def oem(system='UTC', ahead=0.0, rows=STATES):
    lines = ['CCSDS_OEM_VERS = 2.0', 'META_START', 'OBJECT_NAME = CIRCLE', 'OBJECT_ID = 2016-000A',
             'CENTER_NAME = EARTH', 'REF_FRAME = EME2000', f'TIME_SYSTEM = {system}', 'INTERPOLATION = HERMITE',
             'INTERPOLATION_DEGREE = 7', 'META_STOP']
    for row in rows:
        passed, numbers = row.split(' ', 1)
        epoch = (utc(int(passed)) if system == 'UTC' else
                 (BEGIN + datetime.timedelta(seconds=int(passed) + ahead)).isoformat(timespec='milliseconds'))
        lines.append(f'{epoch} {numbers}')
    return '\n'.join(lines) + '\n'


def stk():
    head = ['stk.v.11.0', 'BEGIN Ephemeris', 'ScenarioEpoch 31 Dec 2016 23:55:00', 'InterpolationMethod Hermite',
            'InterpolationOrder 7', 'DistanceUnit Kilometers', 'CentralBody Earth', 'CoordinateSystem J2000',
            'EphemerisTimePosVel']
    return '\n'.join([*head, *STATES, 'END Ephemeris']) + '\n'


def built(path, text, duration=480.0):
    path.write_text(text)
    return target.build(TargetParameters(kind='track_file', station=STATION,
                                         track_file=TrackFileParameters(path=str(path))), duration)


@pytest.mark.parametrize('text', [
    oem(rows=[row for row in STATES if not row.startswith('300 ')]), oem(), oem('TAI', 36.0), oem('GPS', 17.0),
    oem('TT', 68.184), oem('TDB', 68.184), stk()], ids=['UTC', 'UTC with 60', 'TAI', 'GPS', 'TT', 'TDB', 'STK'])
def test_an_orbit_across_a_leap_second(text, tmp_path):
    of = built(tmp_path / 'a.oem', text)
    assert of.start_time == '2016-12-31T23:55:00.000Z'
    azimuth, elevation, _ = np.degrees(target.look_angles(of, np.array([*SEEN])))
    assert np.column_stack((azimuth % 360.0, elevation)) == pytest.approx(np.array([*SEEN.values()]), abs=1e-3)


@pytest.mark.parametrize('text, message', [
    (oem().replace('2016-12-31T23:59:60', '2016-12-31T23:58:60'), "line 16, column 1: epoch = '2016-12-31T23:58:60'"),
    (oem().replace('2016-12-31', '2018-12-31').replace('2017-01-01', '2019-01-01'),
     'line 16, column 1: second 60: TIME_SYSTEM UTC has no leap second'),
    (oem('GPS', 17.0).replace('00:00:17.000', '23:59:60'), 'line 16, column 1: second 60: TIME_SYSTEM GPS has no'),
    (stk().replace('23:55:00', '23:55:75'), 'ScenarioEpoch = ')])
def test_a_leap_second_that_is_none(text, message, tmp_path):
    with pytest.raises(csv_table.TableError, match=message):
        built(tmp_path / 'a.oem', text.replace('2017-01-01T23:59:60', '2016-12-31T23:59:60'))


@pytest.mark.parametrize('form', ['utc', 'seconds', 'julian'])
def test_a_table_of_directions_across_a_leap_second(form, tmp_path):
    """A target that turns by 1 deg/s: the row after the leap second is 11 s after the row before."""
    passed = [p for p in range(280, 330, 10) if form == 'utc' or p != 300]
    passed += [] if form == 'utc' else [331, 341]
    midnight = 1483228800
    rows = []
    for p in sorted(passed):
        unix = midnight - 300 + p - (p > 300)
        time = {'utc': utc(p, 'Z'), 'seconds': utc(p, 'Z'), 'julian': f'{2440587.5 + unix / 86400.0:.9f}'}[form]
        rows.append(f'{time} {p - 200.0} 40.0' if form == 'julian' else f'{time},{p - 200.0},40.0')
    of = built(tmp_path / 'a.csv', '\n'.join(([] if form == 'julian' else ['utc,az,el']) + rows) + '\n', 30.0)
    assert of.start_time == '2016-12-31T23:59:40.000Z'
    azimuth, _, _ = np.degrees(target.look_angles(of, np.array([5.0, 15.0, 25.0])))
    assert azimuth == pytest.approx([85.0, 95.0, 105.0], abs=0.01)


def sentence(kind, second, time='', date=''):
    """An NMEA sentence at a number of seconds after the midnight of 2018; time, date: other texts."""
    when = datetime.datetime(2018, 1, 1) + datetime.timedelta(seconds=second)
    time, date = time or f'{when:%H%M%S}', date or f'{when:%d%m%y}'
    place = f'47{24 + 0.01 * second:07.4f}', 'N', '00831.2000', 'E'
    data = ((time, *place, '1', '08', '0.9', '1500', 'M', '47.5', 'M', '', '') if kind == 'GGA' else
            (time, 'A', *place, '0', '0', date, '', ''))
    return str(getattr(pynmea2, kind)('GP', kind, data))


def fixes(tmp_path, text):
    path = tmp_path / 'a.nmea'
    path.write_text(text)
    return track_files.read(TrackFileParameters(path=str(path)))[1]


@pytest.mark.parametrize('order', [
    [('GGA', -2), ('RMC', -2), ('GGA', -1), ('GGA', 0), ('RMC', 0), ('GGA', 1)],
    [('GGA', -2), ('GGA', -1), ('RMC', 0), ('GGA', 0), ('GGA', 1)],
    [('RMC', -1), ('GGA', 0), ('GGA', 1), ('GGA', 2), ('GGA', 3), ('RMC', 3)],
    [('GGA', 0), ('RMC', -1), ('GGA', 1), ('GGA', 2), ('GGA', 3)],
    [('GGA', -2), ('GGA', -1), ('GGA', 0), ('GGA', 1), ('RMC', 1)]])
def test_the_date_of_an_rmc_belongs_to_its_own_time(order, tmp_path):
    text = '\n'.join(sentence(kind, second) for kind, second in order)
    first = next(second for kind, second in order if kind == 'GGA')
    got = fixes(tmp_path, text)
    begin = datetime.datetime(2018, 1, 1) + datetime.timedelta(seconds=first)
    assert got.dated and instant.iso(got.time[0]) == begin.isoformat(timespec='milliseconds') + 'Z'
    assert np.diff(got.time).tolist() == [1.0] * (sum(kind == 'GGA' for kind, _ in order) - 1)


@pytest.mark.parametrize('dated', [True, False])
def test_235960_is_a_time(dated, tmp_path):
    times = ('235958', '235959', '235960', '000000', '000001')
    rows = [sentence('GGA', k, time) for k, time in enumerate(times)]
    rows.insert(1, sentence('RMC', 0, '235958', '311216') if dated else '')
    got = fixes(tmp_path, '\n'.join(rows))
    assert np.diff(got.time).tolist() == [1.0] * 4
    if dated:
        assert [instant.iso(time)[11:19] for time in got.time] == [
            '23:59:58', '23:59:59', '23:59:60', '00:00:00', '00:00:01']
        without = fixes(tmp_path, '\n'.join(row for row in rows if '235960' not in row))
        assert np.diff(without.time).tolist() == [1.0, 2.0, 1.0]
        with pytest.raises(csv_table.TableError, match="line 4: time = '235960': must be hhmmss.ss"):
            fixes(tmp_path, '\n'.join(rows).replace(rows[1], sentence('RMC', 0, '235958', '311217')))


@pytest.mark.parametrize('text, same', [
    ('2016-12-31T23:59:60Z', '2016-12-31T23:59:60.000Z'), ('2017-01-01 00:59:60.5+01:00', '2016-12-31T23:59:60.500Z'),
    ('1483228799.5', '2016-12-31T23:59:59.500Z'), ('1483228800', '2017-01-01T00:00:00.000Z'),
    ('2017-01-01T00:00:00', '2017-01-01T00:00:00.000Z'), ('2015-07-01T00:00:00Z', '2015-07-01T00:00:00.000Z')])
def test_the_text_of_an_instant(text, same):
    assert instant.iso(instant.seconds('a', 1, 'time', text)) == same


def test_the_times_of_a_run_across_a_leap_second():
    begin = np.datetime64('2016-12-31T23:59:58.000000', 'us')
    passed = np.arange(0, 5_000_000, 500_000).astype('m8[us]')
    assert [text[11:21] for text in instant.utc_texts(begin, passed)] == [
        '23:59:58.0', '23:59:58.5', '23:59:59.0', '23:59:59.5', '23:59:60.0', '23:59:60.5', '00:00:00.0',
        '00:00:00.5', '00:00:01.0', '00:00:01.5']
    assert orbit.instant('a', '2016-12-31T23:59:60.500Z') == datetime.datetime(2017, 1, 1, 0, 0, 0, 500_000)


@pytest.mark.parametrize('text', ['2017-12-31T23:59:60Z', '2016-12-31T22:59:60Z', '2016-12-31T23:59:61Z'])
def test_no_leap_second(text):
    with pytest.raises(csv_table.TableError, match='must be UTC as ISO 8601'):
        instant.seconds('a', 1, 'time', text)
