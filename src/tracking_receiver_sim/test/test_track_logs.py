"""Logs of one flight in every form, what is passed over in them, and every way they can be wrong."""
import gzip

import numpy as np
import pynmea2
import pytest

from pedestal_common.text_files import csv_table
from tracking_receiver_sim.params import TrackFileParameters
from tracking_receiver_sim.tracks import files as track_files
from tracking_receiver_sim.tracks import fixes, instant

N = 8
BEGIN = 1532340000
"""2018-07-23T10:00:00Z."""
LATITUDE = [47.3665 + 1e-4 * k for k in range(N)]
LONGITUDE = [8.5007 + 4e-4 * k for k in range(N)]
FEET = [2175, 2175, 2200, 2225, 2225, 2275, 2300, 2325]
ALTITUDE = [0.3048 * feet for feet in FEET]
"""The flight that every file below holds: once a second, in steps of 25 ft."""


def clock(second, separator='T', zone='Z'):
    return f'2018-07-23{separator}10:00:{second:02}{zone}'


def own():
    rows = (f'{k},{LATITUDE[k]!r},{LONGITUDE[k]!r},{ALTITUDE[k]!r}' for k in range(N))
    return '\n'.join(['time_s,latitude_deg,longitude_deg,altitude_m', *rows])


def traffic(aircraft=('4b1812,RGA3',)):
    """As the library `traffic` writes it: barometric altitude in feet beside the geometric one, some rows without."""
    lines = ['timestamp,icao24,callsign,altitude,geoaltitude,latitude,longitude,onground']
    for k in range(N):
        for who in aircraft:
            lines += [f'{clock(k, " ", "+00:00")},{who},9999.0,{FEET[k]}.0,{LATITUDE[k]!r},{LONGITUDE[k]!r},False']
    return '\n'.join([*lines[:3], f'{clock(0, " ", "+00:00")},4b1812,RGA3,,,,,False', *lines[3:]])


def opensky():
    rows = (f'{BEGIN + k},4b1812,{LATITUDE[k]!r},{LONGITUDE[k]!r},50.0,90.0,RGA3    ,3000.0,{ALTITUDE[k]!r}'
            for k in range(N))
    return '\n'.join(['time,icao24,lat,lon,velocity,heading,callsign,baroaltitude,geoaltitude', *rows])


def trkpt(k, ele=None, geoid='<geoidheight>47.5</geoidheight>'):
    ele = f'<ele>{ALTITUDE[k] - 47.5!r}</ele>' if ele is None else ele
    return f'<trkpt lat="{LATITUDE[k]!r}" lon="{LONGITUDE[k]!r}">{ele}<time>{clock(k)}</time>{geoid}</trkpt>'


def gpx(tracks=('Rega 3',), points=None):
    body = '\n'.join(points or [trkpt(k) for k in range(N)])
    return ('<?xml version="1.0" encoding="UTF-8"?>\n<gpx version="1.1" xmlns="http://www.topografix.com/GPX/1/1">\n'
            '<metadata><name>ours</name><time>2018-07-23T09:00:00Z</time></metadata><wpt lat="1" lon="2"><ele>3</ele>'
            '</wpt>\n' + ''.join(f'<trk><name>{name}</name><trkseg>\n{body}\n</trkseg></trk>\n' for name in tracks)
            + '</gpx>\n')


def angle(value, width):
    return f'{int(value):0{width}}{60.0 * (value % 1.0):011.8f}'


def gga(k, time=None, altitude=None, quality='1', latitude=None, talker='GP', unit='M', dilution='0.9'):
    data = (time or f'1000{k:02}.00', latitude or angle(LATITUDE[k], 2), 'N', angle(LONGITUDE[k], 3), 'E', quality,
            '08', dilution, altitude or f'{ALTITUDE[k] - 47.5:.4f}', unit, '47.5', 'M', '', '')
    return str(pynmea2.GGA(talker, 'GGA', data))


def incomplete(k, empty):
    """Return a GGA of which the field `empty` is empty."""
    data = list(pynmea2.parse(gga(k)).data)
    data[empty] = ''
    return str(pynmea2.GGA('GP', 'GGA', tuple(data)))


def nmea(sentences=None, date='230718'):
    rmc = pynmea2.RMC('GP', 'RMC', ('100000.00', 'A', '4721.99', 'N', '00830.04', 'E', '0', '0', date, '', ''))
    return '\n'.join(['$GPGSV,1,1,00*79', *(sentences or [gga(k) for k in range(N)]), str(rmc), ''])


LOGS = {'own': own, 'traffic': traffic, 'opensky': opensky, 'gpx': gpx, 'nmea': nmea}


def read(tmp_path, content, **values):
    path = tmp_path / 'flight.log'
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return track_files.read(TrackFileParameters(path=str(path), **values))[1]


def refused(tmp_path, content, **values):
    with pytest.raises(csv_table.TableError) as raised:
        read(tmp_path, content, **values)
    message = str(raised.value)
    assert message.startswith(f'{tmp_path}/flight.log: ') and '\n' not in message
    return message


@pytest.mark.parametrize('name', LOGS)
def test_every_form_holds_the_same_flight(tmp_path, name):
    got = read(tmp_path, LOGS[name]())
    assert got.time - got.time[0] == pytest.approx(np.arange(N), abs=1e-9)
    assert got.latitude == pytest.approx(LATITUDE, abs=1e-9)
    assert got.longitude == pytest.approx(LONGITUDE, abs=1e-9)
    assert got.altitude == pytest.approx(ALTITUDE, abs=1e-3)
    assert got.dated == (name != 'own')
    if got.dated:
        assert got.time[0] == BEGIN and instant.iso(got.time[0]) == '2018-07-23T10:00:00.000Z'


def test_lines_are_those_of_the_file(tmp_path):
    content = traffic()
    got = read(tmp_path, content)
    for line, latitude in zip(got.line, got.latitude):
        assert repr(float(latitude)) in content.splitlines()[line - 1]


def test_rows_without_a_position_are_counted(tmp_path):
    assert read(tmp_path, traffic()).description == (
        'flight.log: ADS-B of 4b1812 RGA3, columns timestamp in UTC, latitude in deg, longitude in deg, '
        'geoaltitude in ft, passed over 1 x row without time, position or aircraft')


def test_barometric_altitude_is_said(tmp_path):
    content = traffic().replace('geoaltitude', 'other').replace('9999.0', '2500.0')
    got = read(tmp_path, content)
    assert got.altitude == pytest.approx(np.full(N, 762.0)) and 'barometric altitude' in got.description


def test_one_of_several_aircraft(tmp_path):
    content = traffic(('4b1812,RGA3', '3c6444,DLH9'))
    for asked in ('3C6444', 'dlh9'):
        got = read(tmp_path, content, aircraft=asked)
        assert got.description.startswith('flight.log: ADS-B of 3c6444 DLH9') and len(got.time) == N
    for asked in ('', 'SWR1'):
        message = refused(tmp_path, content, aircraft=asked)
        assert f'aircraft = {asked!r}: must name one of the 2 in the file: 4b1812 RGA3, 3c6444 DLH9' in message
    many = traffic(tuple(f'{k:06x},' for k in range(500)))
    assert len(refused(tmp_path, many)) < 300 + len(str(tmp_path))


def test_one_of_several_tracks(tmp_path):
    assert len(read(tmp_path, gpx(('out', 'back')), aircraft='back').time) == N
    assert 'must name one of the 2 in the file: out, back' in refused(tmp_path, gpx(('out', 'back')))


def test_a_point_without_geoidheight_or_ele(tmp_path):
    got = read(tmp_path, gpx(points=[trkpt(k, geoid='') for k in range(N)]))
    assert got.altitude == pytest.approx(np.array(ALTITUDE) - 47.5) and 'ele taken as height' in got.description
    got = read(tmp_path, gpx(points=[trkpt(k, ele='' if k == 3 else None) for k in range(N)]))
    assert len(got.time) == N - 1 and 'passed over 1 x point without ele' in got.description


def test_the_known_gga(tmp_path):
    """The sentence of every manual of NMEA 0183, four times, its seconds counting."""
    times = [f'$GPGGA,12351{k},4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,*{0x47 ^ ord("9") ^ ord(str(k)):02X}'
             for k in range(6, 10)]
    got = read(tmp_path, '\n'.join(times))
    assert got.latitude == pytest.approx(np.full(4, 48.1173)) and got.longitude == pytest.approx(11.0 + 31.0 / 60.0)
    assert got.altitude == pytest.approx(592.3) and got.time.tolist() == [45316.0, 45317.0, 45318.0, 45319.0]


def test_a_log_of_nmea_as_it_comes(tmp_path):
    """Logger's stamps before the sentence, noise, a damaged sentence, one without a fix, midnight."""
    good = [f'12:00:0{k} {gga(k, time)}' for k, time in enumerate(
        ('235958.50', '235959.00', '235959.50', '000000.00', '000000.50'))]
    damaged = gga(5).replace('0.9', '0.8')
    got = read(tmp_path, ('\n'.join(['$GPGGA', '$GPGGA,', '!AIVDM,1', damaged, gga(6, quality='0'), *good])
                          + '\r\n').encode() + b'\xff\xfe$GP\n')
    assert np.diff(got.time).tolist() == [0.5] * 4
    assert 'passed over 1 x GGA without a fix' in got.description
    assert 'passed over 2 x damaged sentence' in got.description


def test_two_talkers_in_one_log(tmp_path):
    """The better one is taken, or the chosen one; the description names both."""
    both = nmea([text for k in range(N) for text in (gga(k, dilution='1.4'), gga(k, altitude='9.0', talker='GN'))])
    got = read(tmp_path, both)
    assert got.altitude == pytest.approx(np.full(N, 56.5))
    assert got.description.startswith('flight.log: NMEA of GN (8 fixes, mean HDOP 0.9), not of GP (8 fixes, mean '
                                      'HDOP 1.4): aircraft names the talker to take')
    assert read(tmp_path, both, aircraft='gp').altitude == pytest.approx(ALTITUDE, abs=1e-3)
    assert "aircraft = 'GL': must name one of the 2 in the file: GP, GN" in refused(tmp_path, both, aircraft='GL')
    unknown = nmea([text for k in range(N) for text in (gga(k, quality='8', dilution=''), gga(k, talker='GN'))])
    assert read(tmp_path, unknown).description.endswith(
        'GN (8 fixes, mean HDOP 0.9), not of GP (8 fixes, HDOP not known): aircraft names the talker to take, '
        '8 fixes of quality 8 (simulated) of GP')
    rare = nmea([*SENTENCES, gga(0, time='100008.00', talker='GN', dilution='0.5')])
    assert ' of GP (8 fixes' in read(tmp_path, rare).description


def test_a_talker_that_changes_is_one_receiver(tmp_path):
    """Its constellations change. The description names both; a chosen talker is taken alone."""
    turns = nmea([gga(k, talker='GP' if k in (0, 1, 4, 5, 6) else 'GN', dilution=f'{1.0 + k % 2}') for k in range(N)])
    got = read(tmp_path, turns)
    assert got.altitude == pytest.approx(ALTITUDE, abs=1e-3)
    assert got.description == ('flight.log: NMEA of GP (5 fixes, mean HDOP 1.4) and GN (3 fixes, mean HDOP 1.7), '
                               'which take turns')
    assert len(read(tmp_path, turns, aircraft='GP').time) == 5
    two = nmea([gga(k, time=f'1000{k:02}.{half}0', talker=name) for k in range(N) for half, name in ((0, 'GP'),
                                                                                                (5, 'GN'))])
    assert len(read(tmp_path, two).time) == N


def test_qualities_and_old_dates_are_named(tmp_path):
    """A receiver whose week counter has overflowed dates a log of 2026 in 2006; 7168 days are 1,024 weeks."""
    made_up = nmea([gga(k, quality='8' if k < 5 else '6') for k in range(N)], date='221106')
    assert read(tmp_path, made_up).description.endswith(
        'NMEA of GP, 3 fixes of quality 6 (estimated), 5 fixes of quality 8 (simulated), dated 2006-11-22: if the '
        'week counter of its receiver has overflowed (1,024 weeks), the log is of 2026-07-08')
    assert 'dated' not in read(tmp_path, nmea()).description


SENTENCES = [gga(k) for k in range(N)]
AS_LOGGED = {
    'cut': ([gga(0)[30:], *SENTENCES[1:]], 'passed over 1 x damaged sentence'),
    'cut at the end': ([*SENTENCES[:-1], gga(N - 1)[:-20]], 'passed over 1 x damaged sentence'),
    'cut and joined': ([SENTENCES[0], gga(1)[:40] + SENTENCES[2], *SENTENCES[3:]], 'passed over 1 x damaged sentence'),
    'prefix': ([f'2018-07-23T10:00:00.123 {text}' for text in SENTENCES], 'flight.log: NMEA'),
    'tag block': ([f'\\g:1-2-1234,s:r003669945,c:1120959341*57\\{text}' for text in SENTENCES], 'flight.log: NMEA'),
    'comment': (['# log of u-center', *SENTENCES], 'flight.log: NMEA'),
    'Android': (['# Version: v3', '#', 'Fix,GPS,47.3,8.5', *(f'NMEA,{text},1532340000000' for text in SENTENCES)],
                'flight.log: NMEA'),
    'time behind': ([f'{text},1532340000000' for text in SENTENCES], 'flight.log: NMEA'),
    'two dimensions': ([SENTENCES[0], incomplete(1, 8), *SENTENCES[2:]], 'passed over 1 x GGA without altitude'),
    'no time': ([SENTENCES[0], incomplete(1, 0), *SENTENCES[2:]], 'passed over 1 x GGA without time')}


@pytest.mark.parametrize('name', AS_LOGGED)
@pytest.mark.parametrize('encoding', ['ascii', 'utf-16'])
def test_sentences_as_loggers_write_them(name, encoding, tmp_path):
    sentences, described = AS_LOGGED[name]
    got = read(tmp_path, '\r\n'.join(sentences).encode(encoding))
    assert described in got.description
    kept = [k for k in range(N) if SENTENCES[k] in '\n'.join(sentences)]
    assert got.latitude == pytest.approx(np.array(LATITUDE)[kept], abs=1e-9)
    assert got.altitude == pytest.approx(np.array(ALTITUDE)[kept], abs=1e-3)


def test_a_log_without_gga_is_named(tmp_path):
    assert '0 fixes, must be at least 4: no GGA in it (3 GLL, 1 GSA, 1 GSV, 1 RMC)' in refused(
        tmp_path, '\n'.join(['$GPGLL,4721.99,N,00830.04,E,100000,A*20'] * 3) + nmea(['$GPGSA,A']))


@pytest.mark.parametrize('declared, encoding', [
    ('ISO-8859-1', 'latin-1'), ('windows-1252', 'cp1252'), ('UTF-8', 'utf-8'), ('UTF-8', 'utf-8-sig'),
    ('UTF-16', 'utf-16'), ('UTF-8', 'utf-16')])
def test_a_gpx_is_read_in_its_encoding(declared, encoding, tmp_path):
    got = read(tmp_path, gpx(('Zürich',)).replace('UTF-8', declared).encode(encoding))
    assert got.description.startswith('flight.log: GPX of Zürich') and got.latitude == pytest.approx(LATITUDE)


def test_a_gpx_without_a_track_is_named(tmp_path):
    assert 'no point has an ele, passed over 8 x point without ele' in refused(
        tmp_path, gpx(points=[trkpt(k, ele='') for k in range(N)]))
    assert 'no trkpt in it (9 wpt)' in refused(tmp_path, gpx().replace('trkpt', 'wpt'))
    assert 'line 4: not well-formed XML (encoding UTF-8)' in refused(tmp_path, gpx(('Zürich',)).encode('latin-1'))
    assert '(encoding Shift_JIS)' in refused(tmp_path, gpx().replace('UTF-8', 'Shift_JIS'))


def test_a_point_that_is_repeated_is_counted(tmp_path):
    got = read(tmp_path, gpx(points=[trkpt(k) for k in (0, 1, 1, 1, 2, 3, 4, 5, 6, 7)]))
    assert len(got.time) == N and 'passed over 2 x row that repeats time and place' in got.description
    assert 'time = 2018-07-23T10:00:01.000Z: 0 s after' in refused(
        tmp_path, gpx(points=[trkpt(k).replace(clock(2), clock(1)) for k in range(N)]))


def test_a_packed_log_is_named(tmp_path):
    for name, log in LOGS.items():
        assert 'compressed by gzip: unpack it with gunzip' in refused(tmp_path, gzip.compress(log().encode())), name


@pytest.mark.parametrize('text, expected', [
    ('1532340000', BEGIN), ('1532340000.25', BEGIN + 0.25), ('1532340000250', BEGIN + 0.25),
    ('1532340000250000', BEGIN + 0.25), ('2018-07-23T10:00:00', BEGIN),
    ('2018-07-23 10:00:00+00:00', BEGIN), ('2018-07-23T12:00:00.5+02:00', BEGIN + 0.5),
    ('2018-07-23T10:00:00.123456789Z', BEGIN + 0.123456789), ('2018-07-23 10:00:00,5 UTC', BEGIN + 0.5)])
def test_instants(text, expected):
    assert instant.seconds('a.csv', 2, 'timestamp', text) == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize('text', ['', 'noon', '2018-13-01T00:00:00', '2018-07-23', '10:00:00', '1e999', 'nan', '-5',
                                  '15323400000000', '-1532340000000', '9999-12-31T23:59:59Z',
                                  '2018-07-23T10:00:00+99:99'])
def test_no_instants(text):
    with pytest.raises(csv_table.TableError, match='a.csv: line 2: timestamp = '):
        instant.seconds('a.csv', 2, 'timestamp', text)


def test_iso_writes_what_seconds_reads():
    for value in (0.0, 1532340000.125, 4102444799.999):
        assert instant.seconds('a', 1, 'time', instant.iso(value)) == value


BOMB = ('<?xml version="1.0"?>\n<!DOCTYPE gpx [<!ENTITY a "aaaaaaaaaa">' + ''.join(
    f'<!ENTITY {chr(98 + k)} "{f"&{chr(97 + k)};" * 10}">' for k in range(9)) + ']>\n<gpx><name>&j;</name></gpx>')


@pytest.mark.parametrize('content, message', [
    (traffic().replace(repr(LATITUDE[4]), 'north'), "latitude = 'north': must be a number"),
    (traffic().replace(repr(LATITUDE[4]), '95'), 'line 7: latitude = 95: must be -90 to 90'),
    (traffic().replace(f',{FEET[4]}.0', ',9e9', 1), 'geoaltitude = 9e+09: must be -3000 to 500000'),
    (traffic().replace(':03+00', ':61+00'), 'line 6: timestamp = '),
    (traffic().replace(':03+00', ':01+00'), 'line 6: timestamp = 2018-07-23T10:00:01.000Z: -1 s after the row before'),
    (traffic().replace(':07+00', ':59+00'), ': 53 s after the row before, must be above 0 and at most max_gap = 10 s'),
    (traffic().replace('latitude', 'north'), "line 1: column 'latitude' is missing"),
    (opensky().replace('baroaltitude', 'a').replace('geoaltitude', 'b'), "line 1: column 'geoaltitude' is missing"),
    ('\n'.join(traffic().splitlines()[:3]), '2 fixes, must be at least 4'),
    ('timestamp,latitude,longitude,altitude\n', '0 fixes, must be at least 4'),
    (gpx()[:-30], 'line 12: not well-formed XML'),
    (gpx().replace('</ele><time>', 'x</ele><time>', 1), 'line 5: ele = '),
    (gpx().replace(f'lat="{LATITUDE[2]!r}"', ''), 'line 7: lat = None: must be a number'),
    (gpx().replace(clock(3), 'noon'), "line 8: time = 'noon': must be UTC as ISO 8601"),
    (gpx(points=['']), '0 fixes, must be at least 4'),
    ('<html><body>404</body></html>', "line 1: element 'html': must be gpx"),
    ('AXCS123Soarer\r\nHFDTE230718\r\nB1000004722000N00830000EA0150001500\r\n',
     'an IGC log of a glider: convert it to GPX, for example with gpsbabel -i igc'),
    ('<?xml version="1.0"?>\n<!-- a log -->\n<kml xmlns="http://www.opengis.net/kml/2.2"/>',
     'a KML file of Google Earth: convert it to GPX, for example with gpsbabel -i kml'),
    ('time,lat,lon,alt_msl_ft\n' + '0,47,8,1000\n' * 5, 'is above mean sea level, must be above the ellipsoid'),
    (BOMB, 'line 2: a document type declaration: GPX has none'),
    ('<gpx>' + '<a>' * 200, 'line 1: must be at most 100 nested elements'),
    (nmea([gga(k, unit='f' if k == 2 else 'M') for k in range(N)]), "line 4: unit of altitude = 'f': must be M"),
    (nmea([gga(k, altitude='high' if k == 2 else None) for k in range(N)]), "line 4: altitude = 'high': must be a"),
    (nmea([gga(k, latitude='4799.0' if k == 2 else None) for k in range(N)]), 'must be degrees and minutes below 60'),
    (nmea([gga(k, time='256000' if k == 2 else None) for k in range(N)]), "line 4: time = '256000': must be hhmmss"),
    (nmea([gga(k, time='100001' if k == 2 else None) for k in range(N)]), '4: time = 2018-07-23T10:00:01.000Z: 0 s'),
    (nmea([gga(k, quality='0') for k in range(N)]), '0 fixes, must be at least 4, passed over 8 x GGA without a fix'),
    ('$' + 'x' * 5000, 'line 1: longer than 1024 characters'),
    (gpx().replace('UTF-8', 'UTF-9').replace('Rega', '\udce4').encode(errors='surrogateescape'), 'line 1: not well'),
    (b'$\xff\xfe', '0 fixes'), (b'<gpx>\xff', 'line 1: not well-formed XML')])
def test_bad_logs(tmp_path, content, message):
    assert message in refused(tmp_path, content)


@pytest.mark.parametrize('name', LOGS)
def test_a_damaged_log_is_read_or_refused_by_one_line(tmp_path, name):
    """Some bytes of a sound log become others; beside TableError nothing may be raised."""
    random, content = np.random.default_rng(1), LOGS[name]().encode()
    odd = np.frombuffer(b'0123456789.,-+eEnaif<>"\'&;:TZ*$\n\x00\xff NSEW/', np.uint8)
    outcomes = set()
    for _ in range(200):
        damaged = np.frombuffer(content, np.uint8).copy()
        count = random.integers(1, 6)
        damaged[random.integers(0, len(damaged), count)] = random.choice(odd, count)
        try:
            read(tmp_path, damaged.tobytes())
            outcomes.add('read')
        except csv_table.TableError as error:
            assert str(error).startswith(f'{tmp_path}/flight.log: ') and '\n' not in str(error)
            outcomes.add('refused')
    assert outcomes == {'read', 'refused'}


def test_too_many_rows(tmp_path, monkeypatch):
    monkeypatch.setattr(csv_table, 'MAX_CSV_ROWS', 5)
    for name, log in LOGS.items():
        assert 'must be at most 5 rows' in refused(tmp_path, log()), name


def test_too_many_aircraft(tmp_path, monkeypatch):
    monkeypatch.setattr(fixes, 'MAX_AIRCRAFT', 3)
    message = refused(tmp_path, traffic(tuple(f'{k:06x},' for k in range(50))), aircraft='000001')
    assert 'must be at most 3 aircraft' in message


def test_a_text_as_long_as_the_file_is_cut(tmp_path):
    got = read(tmp_path, gpx((f'{"n" * 3_000_000}',)))
    assert len(got.time) == N and len(got.description) < 200
