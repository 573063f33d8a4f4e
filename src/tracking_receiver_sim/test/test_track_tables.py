"""Tables of directions and flights as programs write them: names, units, times and separators of their own."""
import datetime
import re

import numpy as np
import pytest

from pedestal_common.text_files import csv_table
from tracking_receiver_sim.params import TargetParameters, TrackFileParameters
from tracking_receiver_sim.tracks import files as track_files
from tracking_receiver_sim.tracks import instant, times

N = 20
BEGIN = datetime.datetime(2026, 6, 1, 12)
SECONDS = 10.0 * np.arange(N)
AZIMUTH, ELEVATION = 120.0 + 0.05 * SECONDS, 40.0 + 0.01 * SECONDS
LATITUDE = 47.4 + 1e-4 * SECONDS
"""A pass of 190 s, and a flight to the north."""


def table(names, *cells):
    """Return a CSV text of rows; cells(k): text of a cell of row k."""
    return '\n'.join([names, *(','.join(cell(k) for cell in cells) for k in range(N))]) + '\n'


def utc(form='%Y-%m-%dT%H:%M:%SZ', ahead=0.0):
    return lambda k: (BEGIN + datetime.timedelta(seconds=SECONDS[k] + ahead)).strftime(form)


def number(values, form='.7f'):
    return lambda k: format(values[k], form)


AZ, EL = number(AZIMUTH), number(ELEVATION)
ZERO = number(np.zeros(N))


def horizons(preamble=''):
    rows = table(' Date__(UT)__HR:MN:SS, , ,Azi_(a-app), Elev_(a-app),', utc(' %Y-%b-%d %H:%M:%S'), lambda k: '*',
                 lambda k: 'm', AZ, EL, lambda k: '')
    names, _, rows = rows.partition('\n')
    if not preamble:
        return f'{names}\n{rows}'
    return f'{preamble}\n{"*" * 60}\n{names}\n{"*" * 60}\n$$SOE\n{rows}$$EOE\n{"*" * 60}\nColumn meaning: a, b, c\n'


def days(zero):
    return number(zero + SECONDS / 86400.0, '.9f')


def read(tmp_path, text, **values):
    path = tmp_path / 'pass.csv'
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    target = TargetParameters(kind='track_file', track_file=TrackFileParameters(path=str(path), **values))
    return track_files.read(target.track_file)[1], track_files.lay_out(target, 10.0, 0.0)


def refused(tmp_path, text):
    with pytest.raises(csv_table.TableError) as raised:
        read(tmp_path, text)
    assert str(raised.value).startswith(f'{tmp_path}/pass.csv: ') and '\n' not in str(raised.value)
    return str(raised.value)


ISO = utc()
DIRECTIONS = {
    'minutes': (table('time [min],az,el', number(SECONDS / 60.0), AZ, EL), 'time [min] in min, az in deg, el in deg'),
    'radians': (table('time,azimuth_rads,elevation_rads', number(SECONDS), number(np.radians(AZIMUTH), '.12f'),
                      number(np.radians(ELEVATION), '.12f')), 'azimuth_rads in rad, elevation_rads in rad'),
    'rates first': (table('time,az_rate,az,el_rate,el', number(SECONDS), ZERO, AZ, ZERO, EL), 'az in deg, el in deg'),
    'errors first': (table('time,az_error,el_error,az,el', number(SECONDS), ZERO, ZERO, AZ, EL), 'az in deg'),
    'local time': (table('time_local,time_utc,az,el', utc('%Y-%m-%dT%H:%M:%S', 7200.0), utc('%Y-%m-%dT%H:%M:%S'), AZ,
                         EL), 'time_utc in UTC'),
    'Julian dates': (table('jd,az,el', days(2461193.0), AZ, EL), 'jd in UTC'),
    'modified Julian dates': (table('MJD,az,el', days(61192.5), AZ, EL), 'MJD in UTC'),
    'seconds since 1970': (table('time_utc,az,el', number(1780315200.0 + SECONDS, '.0f'), AZ, EL), 'time_utc in UTC'),
    'milliseconds': (table('timestamp,az,el', number(1e3 * (1780315200.0 + SECONDS), '.0f'), AZ, EL),
                     'timestamp in UTC'),
    'microseconds': (table('time_utc,az,el', number(1e6 * (1780315200.0 + SECONDS), '.0f'), AZ, EL),
                     'time_utc in UTC'),
    'Horizons': (horizons(), 'Date__(UT)__HR:MN:SS in UTC, Azi_(a-app) in deg, Elev_(a-app) in deg'),
    'Horizons with its text': (horizons('*****\nEphemeris, of a comet\nCenter: 8.5,47.4'), 'Azi_(a-app) in deg'),
    'STK': (table('"Time (UTCG)","Azimuth (deg)","Elevation (deg)","Range (km)"', utc('%-d %b %Y %H:%M:%S.000'), AZ,
                  EL, ZERO), 'Time (UTCG) in UTC'),
    'German': (table('Zeit;Az;El', utc('%d.%m.%Y %H:%M:%S'), AZ, EL).replace(',', ';').replace('.', ',').replace(
        'Zeit', 'Time').replace('01,06,2026', '01.06.2026'), 'Time in UTC'),
    'date and time of day': (table('Date,Time,az,el', utc('%Y-%m-%d'), utc('%H:%M:%S'), AZ, EL),
                             'columns Date and Time in UTC'),
    'date with a month name': (table('az,el,UTC Time,UTC Date', AZ, EL, utc('%H:%M:%S'), utc('%d %b %Y')),
                               'columns UTC Date and UTC Time in UTC'),
    'basic format': (table('time,az,el', utc('%Y%m%dT%H%M%SZ'), AZ, EL), 'time in UTC'),
    'blank line first': ('\n' + table('utc,az,el', ISO, AZ, EL), 'utc in UTC'),
    'names in a comment': (table('# utc,el,az', ISO, EL, AZ), 'utc in UTC, az in deg, el in deg'),
    'a row twice': (table('utc,az,el', ISO, AZ, EL) + f'{ISO(N - 1)},{AZ(N - 1)},{EL(N - 1)}\n',
                    'passed over 1 x row that repeats the row before'),
    'beside a place': (table('time,lat,lon,elevation_deg,azimuth', ISO, ZERO, ZERO, EL, AZ), 'elevation_deg in deg'),
    'Windows': (table('Time,Azimuth [°],Elevation [°]', ISO, AZ, EL).encode('cp1252'), 'Azimuth [°] in deg'),
    'UTF-16': (table('Time,Azimuth [°],Elevation [°]', ISO, AZ, EL).encode('utf-16'), 'Azimuth [°] in deg')}


@pytest.mark.parametrize('name', DIRECTIONS)
def test_a_table_of_directions_is_read_by_names_and_units(name, tmp_path):
    text, described = DIRECTIONS[name]
    got, laid = read(tmp_path, text)
    assert got.t - got.t[0] == pytest.approx(SECONDS, abs=1e-3)
    assert np.degrees(got.azimuth) == pytest.approx(AZIMUTH, abs=1e-6)
    assert np.degrees(got.elevation) == pytest.approx(ELEVATION, abs=1e-6)
    assert described in laid.summary[0] and 'table of azimuth and elevation' in laid.summary[0]
    dated = name not in ('minutes', 'radians', 'rates first', 'errors first')
    assert laid.start_time == ('2026-06-01T12:00:00.000Z' if dated else '')


@pytest.mark.parametrize('text, message', [
    (table('time,az [gon],el [gon]', ISO, AZ, EL), "column 'az [gon]': must end with a known unit to be taken as"),
    (table('time_local,az,el', ISO, AZ, EL), "column 'time_local': must end with a known unit to be taken as time"),
    (table('utc,time,az,el', ISO, ISO, AZ, EL), "columns 'utc' and 'time': only one of them may be the time"),
    (table('utc,az,el,Azimuth [deg]', ISO, AZ, EL, AZ), "columns 'az' and 'Azimuth [deg]': only one of them may be"),
    (table('time,lat,lon,elevation,azimuth,speed', ISO, ZERO, ZERO, EL, AZ, AZ),
     "column 'elevation' beside latitude and longitude: must name its unit"),
    (table('time,az,el', days(2461193.0), AZ, EL), 'which look like a Julian date in days: name the column JD'),
    (table('t,az,el', days(61192.5), AZ, EL), 'which look like a Julian date in days: name the column MJD'),
    (table('', days(2461193.0), AZ, EL).lstrip(), 'name the column JD'),
    (table('time,az,el', utc('%m/%d/%Y %H:%M:%S'), AZ, EL),
     "line 2: time = '06/01/2026 12:00:00': the order of day and month is unknown: must be UTC as"),
    (table('Date,Time,az,el', utc('%d-%m-%y'), utc('%H:%M:%S'), AZ, EL),
     "line 2: Date and Time = '01-06-26 12:00:00': the order of day and month is unknown: must be UTC as"),
    (table('Date,Time,az,el', utc('%Y-%m-%d'), utc('%I:%M:%S %p'), AZ, EL),
     "line 2: Date and Time = '2026-06-01 12:00:00 PM': must be UTC as"),
    (table('Date,Time,az,el', lambda k: '', utc('%H:%M:%S'), AZ, EL), "line 2: Date and Time = '12:00:00': must be"),
    (table('Date,Time [s],az,el', utc('%Y-%m-%d'), number(SECONDS), AZ, EL),
     "columns 'Date' and 'Time [s]': only one of them may be the time"),
    (table('Date,Time,Timestamp,az,el', utc('%Y-%m-%d'), utc('%H:%M:%S'), ISO, AZ, EL),
     "columns 'Time' and 'Timestamp': only one of them may be the time"),
    (table('time,azimuth_deg,altitude_deg', ISO, AZ, EL), "column 'elevation' is missing; columns found: 'time',"),
    (table('time,az,el', lambda k: f'1_{k:03}', AZ, EL), "line 2: time = '1_000': must be a number"),
    (table('utc,az,el', lambda k: f'1_780_315_2{k:02}', AZ, EL), "line 2: utc = '1_780_315_200': must be UTC"),
    (table('time [min],az,el', ISO, AZ, EL), "line 2: time [min] = '2026-06-01T12:00:00Z': must be a number"),
    (table('utc,az,el', number(SECONDS), AZ, EL), 'or at least 1e+08 s since 1970'),
    (table('utc,az,el', ISO, lambda k: AZ(0), lambda k: EL(0)).replace(ISO(1), ISO(0)), 'row above, must be above 0'),
    (table('utc,az,el', lambda k: ISO(0), lambda k: AZ(0), lambda k: EL(0)), '1 rows, must be at least 4')])
def test_a_table_of_directions_that_is_refused(text, message, tmp_path):
    if 'must be above 0' in message:
        text = text.replace(f'{ISO(0)},{AZ(0)}', f'{ISO(0)},{AZ(1)}', 1)
    assert message in refused(tmp_path, text)


UNIX = number(1780315200 + SECONDS, '.0f')
LAT, LON, FEET = number(LATITUDE), lambda k: '8.52', lambda k: '4921.26'
FLIGHTS = {
    'Flightradar24': (table('Timestamp,UTC,Callsign,Position,Altitude,Speed,Direction', UNIX, ISO,
                            lambda k: 'SWR8', lambda k: f'"{LAT(k)},8.52"', FEET, ZERO, ZERO),
                      'Flightradar24 of SWR8, columns Timestamp in UTC, Position in deg, Altitude in ft, barometric'),
    'date and time of day': (table('Date,Time,Latitude,Longitude,Altitude (m)', utc('%Y/%m/%d'), utc('%H:%M:%S'), LAT,
                                   LON, lambda k: '1500'), 'CSV, columns Date and Time in UTC, Latitude in deg'),
    'milliseconds': (table('timestamp,latitude,longitude,altitude', number(1e3 * (1780315200 + SECONDS), '.0f'),
                           LAT, LON, FEET), 'ADS-B, columns timestamp in UTC'),
    'drone': (table('time,lat,lon,elevation [m],azimuth,speed', ISO, LAT, LON, lambda k: '1500', AZ, ZERO),
              'CSV, columns time in UTC, lat in deg, lon in deg, elevation [m] in m'),
    'feet': (table('Time [min],Latitude [deg],Longitude [rad],Alt [ft]', number(SECONDS / 60.0, '.12f'),
                   LAT, lambda k: f'{np.radians(8.52):.12f}', FEET), 'Longitude [rad] in rad, Alt [ft] in ft'),
    'comma': (table('time_s,latitude_deg,longitude_deg,altitude_m', number(SECONDS), LAT, LON,
                    lambda k: '1500.0').replace(',', ';').replace('.', ','),
              'CSV, columns time_s in s, latitude_deg in deg'),
    'a row twice': (table('time,icao24,lat,lon,geoaltitude', UNIX, lambda k: 'a', LAT, LON,
                          lambda k: '1500') + f'{1780315200 + 190},a,{LAT(N - 1)},8.52,1500\n',
                    'passed over 1 x row that repeats time and place')}


def test_a_file_is_read_again_after_a_change(tmp_path):
    track, rows = TrackFileParameters(path=str(tmp_path / 'a.csv')), 'time [s],azimuth [deg],elevation [deg]\n0,1,20\n'
    (tmp_path / 'a.csv').write_text(rows + '1,2,20\n2,3,20\n3,4,20\n')
    _, first = track_files.read(track)
    assert track_files.read(track)[1] is first
    (tmp_path / 'a.csv').write_text(rows + '1,2,20\n2,3,20\n3,15,20\n')
    assert track_files.read(track)[1] is not first


@pytest.mark.parametrize('name', FLIGHTS)
def test_a_flight_is_read_by_names_and_units(name, tmp_path):
    text, described = FLIGHTS[name]
    got, laid = read(tmp_path, text, max_gap=11.0)
    assert got.time - got.time[0] == pytest.approx(SECONDS, abs=1e-3)
    assert got.latitude == pytest.approx(LATITUDE, abs=1e-7) and got.longitude == pytest.approx(8.52, abs=1e-9)
    assert got.altitude == pytest.approx(1500.0, abs=1e-3)
    assert described in laid.summary[0]
    assert laid.start_time == ('' if name in ('feet', 'comma') else '2026-06-01T12:00:00.000Z')


@pytest.mark.parametrize('text, message', [
    (table('time,lat,lon,elevation', ISO, LAT, LON, ZERO), "column 'elevation': must end with a known unit"),
    (table('time,lat,lon,speed', ISO, LAT, LON, ZERO), "column 'geoaltitude' is missing; columns found: 'time',"),
    (table('time_s,lat,latitude,lon,alt_m', number(SECONDS), LAT, LAT, LON, ZERO), "columns 'lat' and 'latitude':"),
    (table('time,icao24,lat,lon,geoaltitude', UNIX, lambda k: 'a', LAT, LON, ZERO)
     + f'{1780315200 + 190},a,47.5,8.52,1500\n', 'line 22: time = 2026-06-01T12:03:10.000Z: 0 s after the row before'),
    (table('Timestamp,Position,Altitude', UNIX, LAT, FEET),
     "line 2: Position = '47.4000000': must be latitude,longitude")])
def test_a_flight_that_is_refused(text, message, tmp_path):
    assert message in refused(tmp_path, text)


@pytest.mark.parametrize('modified, low, high', [(False, 2400000.5, 2536000.0), (True, 0.0, 135999.5)])
def test_a_julian_date_lies_between_1858_and_2231(modified, low, high):
    """The two ends of the range are the same instants for Julian dates and for modified ones."""
    def julian(number):
        return times.julian('a.csv', 2, 'day', f'{number:.1f}', modified)
    utc = datetime.timezone.utc
    assert julian(low) == instant.of_unix_time(datetime.datetime(1858, 11, 17, tzinfo=utc).timestamp())
    assert julian(high) == instant.of_unix_time(datetime.datetime(2231, 3, 26, 12, tzinfo=utc).timestamp())
    for beyond in (low - 1.0, high + 1.0):
        with pytest.raises(csv_table.TableError, match=re.escape(f'must be {low:g} to {high:g}')):
            julian(beyond)
